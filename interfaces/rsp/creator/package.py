"""The module creator: a typed Python package for a robot, from its model.

Plain lines, formatted as this house's own; the same model gives the same bytes.
"""

from __future__ import annotations

import re
from pathlib import Path

from interfaces.rsp.creator.local_side import local_module
from interfaces.rsp.creator.names import camel, class_names, count, literal, scalar, values_type
from interfaces.rsp.creator.robot_side import robot_module
from interfaces.rsp.model.elements import Command, Effector, Element, Event, Filling, OnLoss, Scalar, Sensor
from interfaces.rsp.model.robot_model import RobotModel
from vrs.errors import FormatError


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
