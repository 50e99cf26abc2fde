"""The module creator: a typed Python package for a robot, from its model.

Plain lines, formatted as this house's own; the same model gives the same bytes.
"""

from __future__ import annotations

import math
import re
from dataclasses import MISSING, fields
from enum import StrEnum
from pathlib import Path
from typing import Final

from interfaces.rsp.model.elements import (
    Command,
    Effector,
    Element,
    Event,
    Filling,
    MemoryCommand,
    MemoryEvent,
    Module,
    Monitor,
    OnLoss,
    RobotModel,
    Scalar,
    Sensor,
)
from vrs.errors import FormatError

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


def robot_module(model: RobotModel) -> str:
    """The text of `robot.py`."""
    handler = f"{camel(model.name)}Handler"
    body = [*_effects(model), *_outputs(model)]
    for index, element in enumerate(model):
        body += _methods(index, element, model)
    text = "\n".join(body)
    used = [name for name in ("Commanded", "RobotOutput", "Stored") if name in text or name == "RobotOutput"]
    lines = [
        f'"""The packet handler of the robot `{model.name}`: derive from it. Generated; don\'t edit."""',
        "",
        "from __future__ import annotations",
        "",
        f"from interfaces.rsp.outputs import {', '.join(used)}",
        "from interfaces.rsp.robot import RobotCore",
        *(["", "from . import packets"] if "packets." in text else []),
        "",
        "",
        f"class {handler}:",
        '    """Calls `on_…` for what came; `measure_…`, `occur_…` and `tell_…` send what the robot has to say."""',
        "",
        "    def __init__(self, core: RobotCore) -> None:",
        '        """Take the robot\'s side of the protocol."""',
        "        self.core = core",
        "",
        "    def advance(self, *, now: float) -> list[RobotOutput]:",
        '        """Do what is due by now [s]; returns what happened to the session."""',
        *body,
    ]
    return "\n".join(lines) + "\n"


def _effects(model: RobotModel) -> list[str]:
    moved = [(i, e) for i, e in enumerate(model) if isinstance(e, Effector) and not e.stream]
    lines = ["        told = self.core.effectors(now=now)"] if moved else ["        self.core.effectors(now=now)"]
    for index, element in moved:
        lines += [
            f"        if {index} in told:",
            f"            self.on_{element.name}(packets.values_{element.name}(told[{index}]))",
        ]
    return lines


def _outputs(model: RobotModel) -> list[str]:
    if not any(isinstance(element, Command | MemoryCommand) for element in model):
        return ["        return self.core.take()"]
    lines = [
        "        others: list[RobotOutput] = []",
        "        for output in self.core.take():",
        "            match output:",
    ]
    for index, element in enumerate(model):
        if isinstance(element, Command):
            lines += [
                f"                case Commanded(index={index}, payload=payload):",
                f"                    self.on_{element.name}(packets.unpack_{element.name}(payload))",
            ]
        elif isinstance(element, MemoryCommand):
            lines += [
                f"                case Stored(index={index}, data=data):",
                f"                    self.on_{element.name}(data)",
            ]
    return [
        *lines,
        "                case _:",
        "                    others.append(output)",
        "        return others",
    ]


def _methods(index: int, element: Element, model: RobotModel) -> list[str]:
    name, values = element.name, values_type(element, model)
    match element:
        case Effector(stream=size) if size:
            return [
                "",
                f"    def take_{name}(self) -> bytes | None:",
                f'        """Take the next fragment of {name}; None where there is none."""',
                f"        return self.core.streams.take({index})",
            ]
        case Effector() | Command():
            return [
                "",
                f"    def on_{name}(self, values: {values}) -> None:",
                f'        """Do what {name} was told."""',
            ]
        case Sensor():
            return [
                "",
                f"    def measure_{name}(self, values: {values}) -> None:",
                f'        """Set what {name} says."""',
                f"        self.core.measure({index}, packets.pack_{name}(values))",
            ]
        case Event():
            return [
                "",
                f"    def occur_{name}(self, values: {values}) -> bool:",
                f'        """Tell of {name}; returns whether it will be told."""',
                f"        return self.core.occur({index}, packets.pack_{name}(values))",
            ]
        case MemoryCommand():
            return [
                "",
                f"    def on_{name}(self, data: bytes) -> None:",
                f'        """Keep what came for {name}."""',
            ]
        case MemoryEvent():
            return [
                "",
                f"    def tell_{name}(self, data: bytes, *, deadline: float) -> int:",
                f'        """Tell {name}, to be settled by a time [s]; returns its ID."""',
                f"        return self.core.store({index}, data, deadline=deadline)",
            ]
        case _:
            return []


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


def package(model: RobotModel) -> dict[str, str]:
    """The files of a robot's package, by name.

    Args:
        model: Of the robot.

    Returns:
        `__init__.py`, `model.py`, `packets.py` (values and bytes of each payload, for both ends), `local.py` and
        `robot.py`; and `py.typed`.
    """
    return {
        "__init__.py": _door(model),
        "model.py": _model(model),
        "packets.py": _packets(model),
        "local.py": local_module(model),
        "robot.py": robot_module(model),
        "py.typed": "",
    }


def write_package(model: RobotModel, directory: Path) -> Path:
    """Write a robot's package into a directory, as a package of the model's name; returns where.

    Raises:
        FormatError: If it can't be written there, or something else is there.
    """
    files = package(model)
    target = directory / model.name
    try:
        target.mkdir(parents=True, exist_ok=True)
        strange = {path.name for path in target.iterdir()} - {*files, "__pycache__"}
        if strange:
            raise FormatError(str(target), f"holds {', '.join(sorted(strange)[:3])}, which isn't generated")
        for name, text in files.items():
            (target / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise FormatError(str(target), f"can't hold the package: {error.strerror}") from None
    return target


def _door(model: RobotModel) -> str:
    robot = camel(model.name)
    local = sorted([robot, *class_names(model).values(), "connect"], key=_order)
    handler = f"{robot}Handler"
    everything = sorted([*local, handler, "MODEL"], key=_order)
    return "\n".join(
        [
            f'"""The robot `{model.name}` over RSP. Generated; don\'t edit."""',
            "",
            "from .local import (",
            *(f"    {name}," for name in local),
            ")",
            "from .model import MODEL",
            f"from .robot import {handler}",
            "",
            "__all__ = [",
            *(f'    "{name}",' for name in everything),
            "]",
            "",
        ]
    )


def _order(name: str) -> tuple[int, list[tuple[int, int | str]]]:
    """Constants, classes, functions, numbers by their size: as import sorters have them."""
    parts = [(0, int(part)) if part.isdigit() else (1, part) for part in re.split(r"(\d+)", name) if part]
    return (0 if name.isupper() and len(name) > 1 else 1 if name[0].isupper() else 2), parts


def _model(model: RobotModel) -> str:
    kinds = {type(element).__name__ for element in model}
    enums = (Filling, OnLoss, Scalar)
    elements = [line for element in model for line in literal(element)]
    kinds |= {enum.__name__ for enum in enums if any(f"={enum.__name__}." in line for line in elements)}
    return "\n".join(
        [
            f'"""The robot model of `{model.name}`. Generated; don\'t edit."""',
            "",
            "from __future__ import annotations",
            "",
            "from typing import Final",
            "",
            "from interfaces.rsp.model import (",
            *(f"    {name}," for name in sorted({*kinds, "RobotModel"})),
            ")",
            "",
            "MODEL: Final = RobotModel(",
            f'    name="{model.name}",',
            f"    id={model.id},",
            "    elements=(",
            *(f"        {line}" for line in elements),
            "    ),",
            f"    buffers={model.buffers},",
            ")",
            "",
        ]
    )


def _packets(model: RobotModel) -> str:
    lines = [
        f'"""Payloads of `{model.name}`: values and bytes, for both ends. Generated; don\'t edit."""',
        "",
        "from __future__ import annotations",
        "",
        "import struct",
        "from typing import Final, cast",
    ]
    valued = [
        element
        for element in model
        if isinstance(element, Effector | Sensor | Command | Event) and not getattr(element, "stream", 0)
    ]
    if not valued:
        return lines[0] + "\n"
    lines += ["", *(f'_{e.name.upper()}: Final = struct.Struct("{e.format.format}")' for e in valued)]
    for element in valued:
        lines += _packing(element, model)
    return "\n".join(lines) + "\n"


def _packing(element: Element, model: RobotModel) -> list[str]:
    name, values, n = element.name, values_type(element, model), count(element, model)
    lines = [
        "",
        "",
        f"def pack_{name}(values: {values}) -> bytes:",
        f'    """The payload of {name}: {n} of {getattr(element, "type", "")}."""',
        f"    return _{name.upper()}.pack(*values)",
        "",
        "",
        f"def unpack_{name}(payload: bytes) -> {values}:",
        f'    """The values of a payload of {name}."""',
        f'    return cast("{values}", _{name.upper()}.unpack(payload))',
    ]
    if isinstance(element, Effector):
        one = scalar(element, model)
        lines += [
            "",
            "",
            f"def values_{name}(played: tuple[float, ...]) -> {values}:",
            f'    """What the motion filter plays, as values of {name}."""',
            f'    return cast("{values}", tuple({one}(value) for value in played))',
        ]
    return lines
