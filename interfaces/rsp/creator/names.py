"""Names in generated code."""

from __future__ import annotations

import math
from dataclasses import MISSING, fields
from enum import StrEnum
from typing import Final

from interfaces.rsp.model.elements import (
    Command,
    Effector,
    Element,
    Event,
    MemoryCommand,
    MemoryEvent,
    Module,
    Monitor,
    Scalar,
    Sensor,
)
from interfaces.rsp.model.robot_model import RobotModel

SUFFIXES: Final[dict[type[Element], str]] = {
    Effector: "Effector",
    Sensor: "Sensor",
    Monitor: "Monitor",
    Command: "Command",
    Module: "Module",
    Event: "Event",
    MemoryCommand: "MemoryCommand",
    MemoryEvent: "MemoryEvent",
}
"""What class names of elements end in."""
RESERVED: Final = {"middleware"}
"""Attributes of a generated robot that are no devices."""


def camel(name: str) -> str:
    """A name of a model as a class's."""
    return "".join(part.capitalize() for part in name.split("_"))


def class_names(model: RobotModel) -> dict[str, str]:
    """Names of the classes of a model's elements, each once, and none the robot's own."""
    found: dict[str, str] = {}
    for index, element in enumerate(model):
        name = camel(element.name) + SUFFIXES[type(element)]
        taken = name == camel(model.name) or name in found.values()
        found[element.name] = f"{name}{index}" if taken else name
    return found


def attribute(name: str) -> str:
    """A device's attribute of the robot."""
    return f"{name}_" if name in RESERVED else name


def scalar(element: Element, model: RobotModel) -> str:
    """What a value of an element is in Python."""
    valued = model.effector_of(element) if isinstance(element, Monitor) else element
    return "float" if getattr(valued, "type", None) is Scalar.F32 else "int"


def count(element: Element, model: RobotModel) -> int:
    """How many values an element has."""
    valued = model.effector_of(element) if isinstance(element, Monitor) else element
    return int(getattr(valued, "count", 0))


def values_type(element: Element, model: RobotModel) -> str:
    """The tuple of an element's values as a type."""
    n, one = count(element, model), scalar(element, model)
    return f"tuple[{', '.join([one] * n)}]" if n <= 4 else f"tuple[{one}, ...]"


def literal(element: Element) -> list[str]:
    """An element as the lines of an expression."""
    lines = [f"{type(element).__name__}("]
    for item in fields(element):
        value = getattr(element, item.name)
        if item.name in ("low", "high"):
            assert isinstance(element, Effector)
            if value == element.type.bounds[item.name == "high"]:
                continue
        elif item.default is not MISSING and value == item.default:
            continue
        if isinstance(value, tuple):
            lines += [f"    {item.name}=(", *(f"        {_spelled(each)}," for each in value), "    ),"]
        else:
            lines.append(f"    {item.name}={_spelled(value)},")
    return [*lines, "),"]


def _spelled(value: object) -> str:
    if isinstance(value, StrEnum):
        return f"{type(value).__name__}.{value.name}"
    if isinstance(value, str):
        return f'"{value}"'
    assert isinstance(value, int) or (isinstance(value, float) and math.isfinite(value))
    return repr(value)
