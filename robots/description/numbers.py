"""A mobile robot in a few numbers, and what people may state of a description beside its file, as TOML."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, TypeVar, get_args, get_type_hints

import msgspec

from robots.robot import NUMBERS
from vrs.checks import bounded_text, within
from vrs.errors import FormatError, InvalidValueError

LARGEST: Final = 2**18
"""Of a TOML file [B]."""
_Number = Annotated[float, within(-1e3, 1e3)]
_S = TypeVar("_S", bound=msgspec.Struct)


class BaseNumbers(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """A mobile robot on two driven wheels; what isn't said is assumed, but for `wheelbase` and `wheel`."""

    wheelbase: Annotated[float, within(0.02, 5.0, "m")] | None = None
    """Between the middles of the driven wheels."""
    wheel: Annotated[float, within(0.005, 1.0, "m")] | None = None
    """Radius of a wheel."""
    length: Annotated[float, within(0.02, 10.0, "m")] | None = None
    """Along the direction of travel."""
    width: Annotated[float, within(0.02, 10.0, "m")] | None = None
    """Across it, wheels included."""
    height: Annotated[float, within(0.02, 5.0, "m")] | None = None
    """Above the floor."""
    mass: Annotated[float, within(0.05, 5000.0, "kg")] | None = None
    """All of it."""
    axle: Annotated[float, within(-5.0, 5.0, "m")] | None = None
    """How far the driven axle is ahead of the middle."""
    v: Annotated[float, within(0.01, 20.0, "m/s")] | None = None
    """Largest speed."""
    w: Annotated[float, within(0.01, 20.0, "rad/s")] | None = None
    """Largest angular speed."""
    a: Annotated[float, within(0.01, 50.0, "m/s²")] | None = None
    """Largest acceleration."""
    alpha: Annotated[float, within(0.01, 100.0, "rad/s²")] | None = None
    """Largest angular acceleration."""


class StatedJoint(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What's stated of a joint; of prismatic ones in m for rad, in N for N m."""

    lower: Annotated[float, within(-1e3, 1e3, "rad")] | None = None
    """Lowest position."""
    upper: Annotated[float, within(-1e3, 1e3, "rad")] | None = None
    """Highest position."""
    velocity: Annotated[float, within(1e-4, 1e3, "rad/s")] | None = None
    """Largest speed."""
    acceleration: Annotated[float, within(1e-4, 1e5, "rad/s²")] | None = None
    """Largest acceleration."""
    jerk: Annotated[float, within(1e-4, 1e7, "rad/s³")] | None = None
    """Largest jerk."""
    effort: Annotated[float, within(1e-4, 1e6, "N m")] | None = None
    """Largest torque or force."""
    armature: Annotated[float, within(0.0, 1e4, "kg m²")] | None = None
    """Inertia of the drive at the joint."""


class Stated(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What NAME.vrs.toml beside a description may state."""

    name: Annotated[str, msgspec.Meta(min_length=1, max_length=60)] | None = None
    """What the robot is called."""
    tip: str = ""
    """The link at the end of the arm."""
    tool_speed: Annotated[float, within(1e-3, 20.0, "m/s")] | None = None
    """Nominal linear speed of the tool."""
    tool_turn_speed: Annotated[float, within(1e-3, 50.0, "rad/s")] | None = None
    """Nominal angular speed of the tool."""
    point: tuple[_Number, _Number, _Number] | None = None
    """Where a gripper holds, in the tip's frame [m]."""
    joints: dict[str, StatedJoint] = {}
    """By their names."""
    poses: dict[str, dict[str, _Number]] = {}
    """Named poses: values of joints by their names [rad, m]."""
    base: BaseNumbers | None = None
    """Of a mobile robot."""
    arguments: dict[str, str] = {}
    """Of a xacro file."""


def keys(kind: type[msgspec.Struct]) -> str:
    """What a table may hold: its keys, with their ranges."""
    said = []
    for name, hint in get_type_hints(kind, include_extras=True).items():
        if name.startswith("__"):
            continue
        meta = next((note for one in (hint, *get_args(hint)) for note in getattr(one, "__metadata__", ())), None)
        limits = "" if meta is None or meta.ge is None else f" in [{meta.ge:g}, {meta.le:g}] {meta.extra['unit']}"
        said.append(f"{name}{limits}")
    return ", ".join(said)


def read_stated(path: Path) -> Stated:
    """Return what a TOML file states of a description.

    Raises:
        FormatError: If it can't be read, or states what isn't known or allowed.
    """
    return _read(path, Stated)


def read_base(path: Path) -> tuple[str, BaseNumbers]:
    """Return the name and numbers of a mobile robot of a TOML file.

    Raises:
        FormatError: If it can't be read, or a number is missing, isn't known or allowed.
    """

    class Named(BaseNumbers, frozen=True, kw_only=True, forbid_unknown_fields=True):
        name: Annotated[str, msgspec.Meta(min_length=1, max_length=60)] | None = None

    found = _read(path, Named)
    if found.wheelbase is None or found.wheel is None:
        raise FormatError(str(path), f"must have at least wheelbase and wheel; allowed: {keys(BaseNumbers)}")
    numbers = {name: getattr(found, name) for name in BaseNumbers.__struct_fields__}
    return found.name or stem(path), BaseNumbers(**numbers)


def parse_base(text: str) -> BaseNumbers:
    """Return the numbers of `diff:wheelbase=0.4,wheel=0.1,…`.

    Raises:
        InvalidValueError: If one is missing, isn't known or allowed.
    """
    allowed = f"diff:KEY=NUMBER,… with at least wheelbase and wheel; allowed: {keys(BaseNumbers)}"
    given: dict[str, float] = {}
    for part in text.removeprefix(NUMBERS).split(","):
        key, _, value = part.partition("=")
        try:
            given[key.strip()] = float(value)
        except ValueError:
            raise InvalidValueError("robot", text, allowed) from None
    try:
        numbers = msgspec.convert(given, BaseNumbers)
    except msgspec.ValidationError:
        raise InvalidValueError("robot", text, allowed) from None
    if numbers.wheelbase is None or numbers.wheel is None:
        raise InvalidValueError("robot", text, allowed)
    return numbers


def stem(path: Path) -> str:
    """A file's name without any of its endings."""
    return path.name.partition(".")[0] or path.name


def _read(path: Path, kind: type[_S]) -> _S:
    try:
        text = bounded_text(path, LARGEST)
    except OSError as error:
        raise FormatError(str(path), f"can't be read: {error.strerror or error}") from None
    try:
        return msgspec.toml.decode(text, type=kind)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        said = str(error)
        if not isinstance(error, msgspec.ValidationError):
            raise FormatError(str(path), f"isn't TOML: {said}") from None
        table: type[msgspec.Struct] = kind
        if "$.joints" in said:
            table = StatedJoint
        elif "$.base" in said:
            table = BaseNumbers
        raise FormatError(str(path), f"{said}; allowed: {keys(table)}") from None
