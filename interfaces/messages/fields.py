"""Types of fields with their ranges, and what all messages on the wire share."""

from __future__ import annotations

import enum
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import Annotated, Any, ClassVar, Self

import msgspec
import msgspec.inspect
import numpy as np
from msgspec import Meta

from vrs.checks import SMALLEST
from vrs.commands import ENDLESS, FARTHEST, Endless
from vrs.errors import InvalidValueError
from vrs.model import frozen_array
from vrs.record import LARGEST, LONGEST_TEXT, Count, Number, Pose, Record, Text, Time, Twist, Value, set_field

__all__ = ["Count", "Number", "Pose", "Text", "Time", "Twist", "Value"]

MOST_JOINTS = 64
"""Joints of a robot, at most."""
MOST_NAMES = 1000
"""Commands that a receipt names, at most."""

MOST_POINTS = 720
"""Of a scan, or a route."""

_DIGITS = r"\A[1-9][0-9]{0,19}\Z"

CommandId = Annotated[int, Meta(ge=-(2**63), le=2**63 - 1)]
Finite = Annotated[float, Meta(ge=-sys.float_info.max, le=sys.float_info.max)]
"""A coefficient: a short segment's may be of any size."""
Seconds = Annotated[float, Meta(gt=0, le=1e9)]
"""A duration."""
Stamp = Annotated[float, Meta(ge=-1e12, le=1e12)]
"""Seconds by a clock with an origin of its own."""
Echo = tuple[Number, Stamp, Stamp]
"""Of a message that was heard: its number, when it was sent by its sender's clock and arrived by one's own [s]."""
Uncertainty = Annotated[float, Meta(ge=0, le=1e12)]
"""Bound on an error of a clock [s]."""
Name = Annotated[str, Meta(min_length=1, max_length=100)]
Word = Annotated[str, Meta(max_length=200)]
Rate = Annotated[float, Meta(gt=0, le=1e4)]
"""Of frames [1/s]."""
Share = Annotated[float, Meta(ge=0, le=1)]
Span = Annotated[float, Meta(ge=0, le=1e9)]
"""A time that something took, or may take [s]."""
Timeout = Annotated[float, Meta(gt=0, le=3600)]
"""[s]."""
Distance = Annotated[float, Meta(ge=0, le=1e9)]
"""[m]."""
Coordinate = Annotated[float, Meta(ge=-1e9, le=1e9)]
PointRow = tuple[Coordinate, Coordinate]
"""x, y [m]."""
Points = Annotated[tuple[PointRow, ...], Meta(max_length=MOST_POINTS)]
Joints = Annotated[list[Value], Meta(min_length=1, max_length=MOST_JOINTS)]


class Epoch(int):
    """Of a control lease, below 2⁶⁴. It crosses as decimal digits: JavaScript's numbers end at 2⁵³."""

    def __new__(cls, number: int) -> Self:
        """Check its range.

        Raises:
            InvalidValueError: If it's out of it.
        """
        if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number < 2**64:
            raise InvalidValueError("epoch", number, "an integer from 1 to 2**64 - 1")
        return super().__new__(cls, number)


class Party(enum.StrEnum):
    """Who sends a message."""

    SERVER = "Server"
    CLIENT = "Client"
    """Any client, whatever its role."""
    OPERATOR = "Operator"
    """A client that may have the lease."""
    HOLDER = "Holder"
    """One that has it, or shares it."""
    ADMIN = "Admin"
    EITHER = "Either side"
    SITE = "Operator's site"
    ROBOT = "Robot's site"


class Message(Record, frozen=True, omit_defaults=True, gc=False, tag_field="type"):
    """A message, or a part that has a type."""

    sender: ClassVar[Party]
    """Who sends it; parts of messages have none."""
    secrets: ClassVar[tuple[str, ...]] = ()
    """Fields that no log may show."""
    absent: ClassVar[Mapping[str, str]] = {}
    """What a field stands for that is left out, computed of others, as in `edit - 1`; defaults need no word."""

    @property
    def kind(self) -> str:
        """What stands for it in `type`."""
        return str(self.__struct_config__.tag)

    def as_written(self, _packed: bool) -> Self:
        """The same message as it's written, where that isn't what it holds.

        Args:
            _packed: Whether it's for msgpack, where coefficients are bytes; all else looks the same in both.
        """
        return self

    def __repr__(self) -> str:
        shown = (name for name in self.__struct_fields__ if name not in self.secrets)
        return f"{type(self).__name__}({', '.join(f'{name}={getattr(self, name)!r}' for name in shown)})"


def check_normal(raw: object, read: object, name: str) -> None:
    """Look for a subnormal number in a message or a part of it: what is divided by one overflows.

    Args:
        raw: The message as it crossed: numbers, texts, lists and maps.
        read: What was read from it; fields that it doesn't have are passed over.
        name: What it's called.

    Raises:
        InvalidValueError: If one of its numbers is nearer to 0 than `SMALLEST`, and isn't 0.
    """
    if isinstance(raw, float):
        if 0.0 < abs(raw) < SMALLEST:
            raise InvalidValueError(name, raw, f"0, or at least {SMALLEST:.3g} in size")
    elif isinstance(raw, dict):
        known = getattr(read, "__struct_encode_fields__", None)
        for key, item in raw.items():
            if known is None:
                check_normal(item, None, f"{name}[{key!r}]")
            elif key in known:
                field = read.__struct_fields__[known.index(key)]  # type: ignore[attr-defined]
                check_normal(item, getattr(read, field), f"{name}.{key}")
    elif isinstance(raw, list):
        parts = read if isinstance(read, tuple) and len(read) == len(raw) else [None] * len(raw)
        for i, (item, part) in enumerate(zip(raw, parts, strict=True)):
            check_normal(item, part, f"{name}[{i}]")


def text(words: str) -> str:
    """Text for people, cut off where it's too long; what UTF-8 can't say, of a file's name, is a question mark."""
    return words[:LONGEST_TEXT].encode("utf-8", "replace").decode("utf-8")


def plain(value: object) -> object:
    """What msgspec doesn't know, for an encoder: arrays as lists, epochs as digits, NumPy's scalars as Python's.

    Raises:
        InvalidValueError: If it's anything else.
    """
    # Arrays are what comes most, and this is the quickest way to know them.
    if type(value) is np.ndarray or isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, Epoch):
        return str(value)
    if isinstance(value, Endless):
        return ENDLESS
    raise InvalidValueError("field", value, "what a message may hold")


def rich(kind: Any, value: Any) -> Any:
    """The opposite, for a decoder: an epoch of digits, a pose of its rows, a read-only array (n,) of numbers.

    Raises:
        ValueError: If there's none.
    """
    if kind is Epoch:
        return epoch_of(value)
    if kind is Pose:
        if not isinstance(value, list) or len(value) != 4:
            raise ValueError("Expected `array` of 4 rows")
        return frozen_array([_numbers(row, 4, 4, FARTHEST) for row in value]).view(kind)
    if kind is Twist:
        return frozen_array(_numbers(value, 6, 6, LARGEST)).view(kind)
    return frozen_array(_numbers(value, 1, MOST_JOINTS, LARGEST))


def _numbers(value: Any, least: int, most: int, largest: float) -> list[float]:
    if not isinstance(value, list) or not least <= len(value) <= most:
        raise ValueError(f"Expected `array` of {least} to {most} numbers")
    for number in value:
        if (type(number) is not float and type(number) is not int) or not -largest <= number <= largest:
            raise ValueError(f"Expected `array` of numbers from -{largest:g} to {largest:g}")
    return value


_Row = Annotated[list[Annotated[float, Meta(ge=-FARTHEST, le=FARTHEST)]], Meta(min_length=4, max_length=4)]
CROSSING: Mapping[type, Any] = {
    np.ndarray: Joints,
    Twist: Annotated[list[Value], Meta(min_length=6, max_length=6)],
    Pose: Annotated[list[_Row], Meta(min_length=4, max_length=4)],
    Epoch: Annotated[str, Meta(pattern=_DIGITS)],
}
"""What stands on the wire for what msgspec doesn't know, as `plain` writes and `rich` reads it."""


def json_schema(kind: Any) -> dict[str, Any]:
    """JSON Schema of what crosses by hooks."""
    return msgspec.json.schema(CROSSING[kind])


def epoch_of(digits: object) -> Epoch:
    """The epoch that digits stand for.

    Raises:
        ValueError: If they stand for none.
    """
    if not isinstance(digits, str) or not re.match(_DIGITS, digits):
        raise ValueError("Expected the digits of an epoch, without leading zeros")
    return Epoch(int(digits))


def cut(message: Any) -> Any:
    """The same message, its texts cut off where a reader takes no more; what UTF-8 can't say is a question mark."""
    changed: dict[str, Any] = {}
    for name, most in _texts(message.__class__).items():
        value = getattr(message, name)
        fit = _fitting(value, most)
        if fit is not value and fit != value:
            changed[name] = fit
    return msgspec.structs.replace(message, **changed) if changed else message


def _fitting(value: Any, most: int | None) -> Any:
    if isinstance(value, str):
        return value[:most].encode("utf-8", "replace").decode("utf-8")
    if isinstance(value, msgspec.Struct):
        return cut(value)
    if isinstance(value, tuple):
        parts = [_fitting(part, most) for part in value]
        return tuple(parts) if any(a is not b for a, b in zip(parts, value, strict=True)) else value
    return value


def writer(encode: Callable[[Any], bytes]) -> Callable[[Any], bytes]:
    """What writes messages: as `encode` does, their texts cut off where a reader takes no more."""

    def write(message: Any) -> bytes:
        try:
            data = encode(message)
        except UnicodeEncodeError:
            return encode(cut(message))
        if len(data) <= LONGEST_TEXT or (fitting := cut(message)) is message:
            return data
        return encode(fitting)

    return write


@cache
def _texts(kind: Any) -> dict[str, int | None]:
    """Fields that may hold text, with how long it may be, and those that hold messages themselves."""
    found: dict[str, int | None] = {}
    for field in msgspec.inspect.type_info(kind).fields:  # type: ignore[attr-defined]
        for one in _parts(field.type):
            if isinstance(one, msgspec.inspect.StrType) or (
                isinstance(one, msgspec.inspect.StructType) and _texts(one.cls)
            ):
                found[field.name] = getattr(one, "max_length", None)
    return found


def _parts(kind: msgspec.inspect.Type) -> Iterator[msgspec.inspect.Type]:
    """What a field may hold, in arrays too."""
    inspect = msgspec.inspect
    if isinstance(kind, inspect.UnionType):
        inner = kind.types
    elif isinstance(kind, inspect.TupleType):
        inner = kind.item_types
    elif isinstance(kind, inspect.VarTupleType):
        inner = (kind.item_type,)
    else:
        yield kind
        return
    for one in inner:
        yield from _parts(one)


class Leased(Message, frozen=True, omit_defaults=True, gc=False):
    """A message with an epoch; a plain number becomes one, and 0 none."""

    def __post_init__(self) -> None:
        epoch = self.epoch  # type: ignore[attr-defined]
        if epoch is not None and type(epoch) is not Epoch:
            optional = type(self).__struct_defaults__
            number = None if epoch == 0 and optional else Epoch(epoch)
            set_field(self, "epoch", number)
