"""The module creator: a typed Python package for a robot, from its model.

The texts are the templates beside this file; the same model gives the same bytes.
"""

from __future__ import annotations

import math
import re
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Any, Final

from interfaces.rsp.model.elements import (
    Command,
    Effector,
    Element,
    Event,
    Filling,
    Module,
    Monitor,
    OnLoss,
    RobotModel,
    Scalar,
    Sensor,
    stated,
)
from interfaces.system import written
from vrs.errors import FormatError

FILES: Final = ("__init__.py", "model.py", "packets.py", "local.py", "robot.py")
"""What a package holds; `py.typed` besides. Each has a template of its name."""
RESERVED: Final = {"middleware"}
"""Attributes of a generated robot that are no devices."""


def camel(name: str) -> str:
    """A name of a model as a class's."""
    return "".join(part.capitalize() for part in name.split("_"))


def class_names(model: RobotModel) -> dict[str, str]:
    """Names of the classes of a model's elements, each once, and none the robot's own."""
    found: dict[str, str] = {}
    for index, element in enumerate(model):
        name = camel(element.name) + type(element).__name__
        taken = name == camel(model.name) or name in found.values()
        found[element.name] = f"{name}{index}" if taken else name
    return found


def literal(element: Element) -> list[str]:
    """An element as the lines of an expression."""
    lines = [f"{type(element).__name__}("]
    for name, value in stated(element):
        if isinstance(value, tuple):
            lines += [f"    {name}=(", *(f"        {_spelled(each)}," for each in value), "    ),"]
        else:
            lines.append(f"    {name}={_spelled(value)},")
    return [*lines, "),"]


def _spelled(value: object) -> str:
    if isinstance(value, StrEnum):
        return f"{type(value).__name__}.{value.name}"
    if isinstance(value, str):
        return f'"{value}"'
    assert isinstance(value, int) or (isinstance(value, float) and math.isfinite(value))
    return repr(value)


def about(element: Element, model: RobotModel) -> str:
    """An element in a sentence."""
    match element:
        case Effector(stream=size) if size:
            return f"plays data, {size} bytes a fragment"
        case Effector():
            return f"{element.count} of {element.type} in [{element.low:g}, {element.high:g}]"
        case Sensor() | Command() | Event():
            return f"{element.count} of {element.type}"
        case Monitor():
            valued = model.effector_of(element)
            return f"{valued.count} of {valued.type}, what {element.effector} does"
        case Module():
            return f"{len(element.members)} elements together"
        case _:
            return f"{element.size} bytes at most"


def _described(index: int, element: Element, model: RobotModel, class_name: str) -> dict[str, Any]:
    """What the templates say of an element."""
    valued = model.effector_of(element) if isinstance(element, Monitor) else element
    kind = type(element).__name__
    if getattr(element, "stream", 0):
        kind = "Stream"
    count = int(getattr(valued, "count", 0))
    scalar = "float" if getattr(valued, "type", None) is Scalar.F32 else "int"
    return {
        "index": index,
        "name": element.name,
        "kind": kind,
        "class_name": class_name,
        "attribute": f"{element.name}_" if element.name in RESERVED else element.name,
        "base": "SensorDevice" if kind == "Monitor" else f"{kind}Device",
        "valued": kind in ("Effector", "Sensor", "Monitor", "Command", "Event"),
        "scalar": scalar,
        "values_type": f"tuple[{', '.join([scalar] * count)}]" if count <= 4 else f"tuple[{scalar}, ...]",
        "about_values": f"{count} of {getattr(element, 'type', '')}",
        "about": about(element, model),
        "format": element.format.format if isinstance(element, Effector | Sensor | Command | Event) else "",
        "literal": literal(element),
    }


def _order(name: str) -> tuple[int, list[tuple[int, int | str]]]:
    """Constants, classes, functions, numbers by their size: as import sorters have them."""
    parts = [(0, int(part)) if part.isdigit() else (1, part) for part in re.split(r"(\d+)", name) if part]
    return (0 if name.isupper() and len(name) > 1 else 1 if name[0].isupper() else 2), parts


def package(model: RobotModel) -> dict[str, str]:
    """The files of a robot's package, by name.

    Args:
        model: Of the robot.

    Returns:
        `__init__.py`, `model.py`, `packets.py` (values and bytes of each payload, for both ends), `local.py` and
        `robot.py`; and `py.typed`.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    templates = Environment(
        loader=PackageLoader("interfaces.rsp"), undefined=StrictUndefined, keep_trailing_newline=True,
        trim_blocks=True, lstrip_blocks=True, autoescape=False,  # noqa: S701 - Python, not HTML
    )  # fmt: skip
    names = class_names(model)
    elements = [_described(index, one, model, names[one.name]) for index, one in enumerate(model)]
    spelled = "\n".join(line for one in elements for line in one["literal"])
    enums = {enum.__name__ for enum in (Filling, OnLoss, Scalar) if f"={enum.__name__}." in spelled}
    said = {
        "model": model,
        "robot": camel(model.name),
        "classes": list(names.values()),
        "elements": elements,
        "packed": [one for one in elements if one["valued"] and one["kind"] != "Monitor"],
        "model_imports": sorted({"RobotModel", *enums, *(type(element).__name__ for element in model)}),
        "in_order": partial(sorted, key=_order),
    }
    return {name: templates.get_template(f"{name}.j2").render(said) for name in FILES} | {"py.typed": ""}


def write_package(model: RobotModel, directory: Path) -> Path:
    """Write a robot's package into a directory, as a package of the model's name; returns where.

    Raises:
        FormatError: If it can't be written there, or something else is there.
    """
    files = package(model)
    target = directory / model.name
    with written(target, "can't hold the package"):
        target.mkdir(parents=True, exist_ok=True)
        strange = {path.name for path in target.iterdir()} - {*files, "__pycache__"}
        if strange:
            raise FormatError(str(target), f"holds {', '.join(sorted(strange)[:3])}, which isn't generated")
        for name, text in files.items():
            (target / name).write_text(text, encoding="utf-8")
    return target
