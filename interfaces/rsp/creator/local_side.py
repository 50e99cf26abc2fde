"""The module creator: classes of the local system's side, one a device."""

from __future__ import annotations

from typing import Final

from interfaces.rsp.creator.names import attribute, camel, class_names, count, scalar
from interfaces.rsp.model.elements import (
    Command,
    Effector,
    Element,
    Event,
    MemoryCommand,
    MemoryEvent,
    Module,
    Monitor,
    Sensor,
)
from interfaces.rsp.model.robot_model import RobotModel

_BASES: Final[dict[type[Element], str]] = {
    Effector: "EffectorDevice",
    Sensor: "SensorDevice",
    Monitor: "SensorDevice",
    Command: "CommandDevice",
    Module: "ModuleDevice",
    Event: "EventDevice",
    MemoryCommand: "MemoryCommandDevice",
    MemoryEvent: "MemoryEventDevice",
}
_VALUED: Final = (Effector, Sensor, Monitor, Command, Event)


def base(element: Element) -> str:
    """The class that a device's is derived from."""
    return "StreamDevice" if isinstance(element, Effector) and element.stream else _BASES[type(element)]


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
            return f"{count(element, model)} of {model.effector_of(element).type}, what {element.effector} does"
        case Module():
            return f"{len(element.members)} elements together"
        case _:
            return f"{element.size} bytes at most"


def local_module(model: RobotModel) -> str:
    """The text of `local.py`."""
    names = class_names(model)
    bases = sorted({base(element) for element in model})
    robot = camel(model.name)
    lines = [
        f'"""The local middleware of `{model.name}`: a class a device, and the robot. Generated; don\'t edit."""',
        "",
        "from __future__ import annotations",
        "",
        "from collections.abc import Iterator",
        "from contextlib import contextmanager",
        "from pathlib import Path",
        "",
        *_from("interfaces.rsp.devices", bases),
        "from interfaces.rsp.live import opened",
        "from interfaces.rsp.middleware import Middleware",
        "",
        "from .model import MODEL",
    ]
    for element in model:
        kind = base(element)
        generic = f"[{scalar(element, model)}]" if isinstance(element, _VALUED) and kind != "StreamDevice" else ""
        lines += [
            "",
            "",
            f"class {names[element.name]}({kind}{generic}):",
            f'    """`{element.name}`: {about(element, model)}."""',
            "",
            "    def __init__(self, middleware: Middleware) -> None:",
            '        """Take what all devices share."""',
            f'        super().__init__(middleware, "{element.name}")',
        ]
    lines += [
        "",
        "",
        f"class {robot}:",
        '    """The robot as its devices: the simulacrum."""',
        "",
        "    def __init__(self, middleware: Middleware) -> None:",
        '        """Take what all devices share."""',
        "        self.middleware = middleware",
        *(f"        self.{attribute(element.name)} = {names[element.name]}(middleware)" for element in model),
        "",
        "",
        "@contextmanager",
        "def connect(",
        "    address: str, *, key_file: Path | None = None, timeout: float = 5.0, takeover: bool = False",
        f") -> Iterator[{robot}]:",
        '    """Have a session with the robot at HOST:PORT meanwhile; see `interfaces.rsp.live.opened`."""',
        "    with opened(MODEL, address, key_file=key_file, timeout=timeout, takeover=takeover) as middleware:",
        f"        yield {robot}(middleware)",
    ]
    return "\n".join(lines) + "\n"


def _from(module: str, names: list[str]) -> list[str]:
    line = f"from {module} import {', '.join(names)}"
    return [line] if len(line) <= 116 else [f"from {module} import (", *(f"    {name}," for name in names), ")"]
