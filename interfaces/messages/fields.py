"""Types of fields with their ranges, and what all messages on the wire share."""

from __future__ import annotations

import enum
import re
import sys
from collections.abc import Mapping
from functools import cache
from typing import Annotated, Any, ClassVar, Self

import msgspec
import msgspec.inspect
import numpy as np
from msgspec import Meta

from vrs.checks import LARGEST, SMALLEST
from vrs.errors import InvalidValueError
from vrs.model import Array, frozen_array

MOST_JOINTS = 64
"""Joints of a robot, at most."""
MOST_NAMES = 1000
"""Commands that a receipt names, at most."""
LONGEST_TEXT = 2000
"""Text for people is cut off after so many characters."""

_DIGITS = re.compile(r"[1-9][0-9]{0,19}")

Number = Annotated[int, Meta(ge=1, le=2**63 - 1)]
Count = Annotated[int, Meta(ge=0, le=2**63 - 1)]
CommandId = Annotated[int, Meta(ge=-(2**63), le=2**63 - 1)]
Finite = Annotated[float, Meta(ge=-sys.float_info.max, le=sys.float_info.max)]
"""A coefficient: a short segment's may be of any size."""
Value = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]
"""A joint value, a speed, a parameter; in its own unit."""
Time = Annotated[float, Meta(ge=-1e9, le=1e9)]
"""Seconds of the session."""
Seconds = Annotated[float, Meta(gt=0, le=1e9)]
"""A duration."""
Stamp = Annotated[float, Meta(ge=-1e12, le=1e12)]
"""Seconds by a clock with an origin of its own."""
Digits = Annotated[str, Meta(pattern=r"\A[1-9][0-9]{0,19}\Z")]
"""An epoch's."""
Name = Annotated[str, Meta(min_length=1, max_length=100)]
Word = Annotated[str, Meta(max_length=200)]
Text = Annotated[str, Meta(max_length=LONGEST_TEXT)]
Rate = Annotated[float, Meta(gt=0, le=1e4)]
"""Of frames [1/s]."""
Share = Annotated[float, Meta(ge=0, le=1)]
Span = Annotated[float, Meta(ge=0, le=1e9)]
"""A time that something took, or may take [s]."""
Timeout = Annotated[float, Meta(gt=0, le=3600)]
"""[s]."""
Joints = Annotated[list[Value], Meta(min_length=1, max_length=MOST_JOINTS)]
Names = Annotated[tuple[Number, ...], Meta(max_length=MOST_NAMES)]


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


class Wire(msgspec.Struct, frozen=True, omit_defaults=True, gc=False):
    """A message or a part of one as it crosses: defaults are left out, unknown fields passed over."""


class Message(Wire, frozen=True, omit_defaults=True, gc=False, tag_field="type"):
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

    def __repr__(self) -> str:
        shown = (name for name in self.__struct_fields__ if name not in self.secrets)
        return f"{type(self).__name__}({', '.join(f'{name}={getattr(self, name)!r}' for name in shown)})"

    @classmethod
    def of(cls, value: Any, _packed: bool) -> Message:
        """The wire form of a value whose fields have the same names.

        Args:
            value: The value.
            _packed: Whether it's for msgpack, where coefficients are bytes; most messages look the same in both.
        """
        fields = [getattr(value, name) for name in cls.__struct_fields__]
        return cls(*[field.tolist() if isinstance(field, np.ndarray) else field for field in fields])

    def read(self) -> Any:
        """The value that it stands for.

        Raises:
            InvalidValueError: If there's none.
        """
        raise NotImplementedError


def check_normal(value: object, name: str) -> None:
    """Look for a subnormal number in a message or a part of it: what is divided by one overflows.

    Args:
        value: The message, as it crossed.
        name: What it's called.

    Raises:
        InvalidValueError: If one of its numbers is nearer to 0 than `SMALLEST`, and isn't 0.
    """
    if isinstance(value, float):
        if 0.0 < abs(value) < SMALLEST:
            raise InvalidValueError(name, value, f"0, or at least {SMALLEST:.3g} in size")
    elif isinstance(value, msgspec.Struct):
        for field in value.__struct_fields__:
            check_normal(getattr(value, field), f"{name}.{field}")
    elif isinstance(value, np.ndarray):
        check_normal(value.tolist(), name)
    elif isinstance(value, (list, tuple)):
        for i, item in enumerate(value):
            check_normal(item, f"{name}[{i}]")
    elif isinstance(value, dict):
        for key, item in value.items():
            check_normal(item, f"{name}[{key!r}]")


def numbers(q: Array) -> list[float]:
    """An array as a list of Python's floats."""
    values: list[float] = q.tolist()
    return values


def array(values: list[float]) -> Array:
    """A read-only array."""
    return frozen_array(values)


def text(words: str) -> str:
    """Text for people, cut off where it's too long; what UTF-8 can't say, of a file's name, is a question mark."""
    return words[:LONGEST_TEXT].encode("utf-8", "replace").decode("utf-8")


def plain(value: object) -> object:
    """What msgspec doesn't know, for an encoder: arrays as lists, epochs as digits, NumPy's scalars as Python's.

    Raises:
        InvalidValueError: If it's anything else.
    """
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, Epoch):
        return str(value)
    raise InvalidValueError("field", value, "what a message may hold")


def rich(kind: Any, value: Any) -> Any:
    """The opposite, for a decoder: an epoch of digits, a read-only array (n,) of a list of numbers.

    Raises:
        ValueError: If there's none.
    """
    if kind is Epoch:
        return epoch_of(value)
    if not isinstance(value, list) or not 1 <= len(value) <= MOST_JOINTS:
        raise ValueError(f"Expected `array` of 1 to {MOST_JOINTS} numbers")
    for number in value:
        if (type(number) is not float and type(number) is not int) or not -LARGEST <= number <= LARGEST:
            raise ValueError(f"Expected `array` of numbers from -{LARGEST:g} to {LARGEST:g}")
    return frozen_array(value)


CROSSING: Mapping[type, Any] = {np.ndarray: Joints, Epoch: Digits}
"""What stands on the wire for what msgspec doesn't know, as `plain` writes and `rich` reads it."""


def epoch_of(digits: object) -> Epoch:
    """The epoch that digits stand for.

    Raises:
        ValueError: If they stand for none.
    """
    if not isinstance(digits, str) or not _DIGITS.fullmatch(digits):
        raise ValueError("Expected the digits of an epoch, without leading zeros")
    return Epoch(int(digits))


def cut(message: Any) -> Any:
    """The same message, its texts cut off where a reader takes no more; what UTF-8 can't say is a question mark."""
    changed: dict[str, Any] = {}
    for name, most in _texts(message.__class__).items():
        value = getattr(message, name)
        if isinstance(value, str):
            fit = value[:most].encode("utf-8", "replace").decode("utf-8")
            if fit != value:
                changed[name] = fit
        elif isinstance(value, msgspec.Struct) and (fitting := cut(value)) is not value:
            changed[name] = fitting
    return msgspec.structs.replace(message, **changed) if changed else message


@cache
def _texts(kind: Any) -> dict[str, int | None]:
    """Fields that are text, with how long it may be, and those that are messages themselves."""
    found: dict[str, int | None] = {}
    for field in msgspec.inspect.type_info(kind).fields:  # type: ignore[attr-defined]
        kinds = getattr(field.type, "types", (field.type,))
        for one in kinds:
            if isinstance(one, msgspec.inspect.StrType | msgspec.inspect.StructType):
                found[field.encode_name] = getattr(one, "max_length", None)
    return found


def digits(epoch: int | None) -> str | None:
    """An epoch's digits; None where there's none."""
    return str(epoch) if epoch else None


def epoch(digits: str | None) -> int:
    """The epoch that digits stand for; 0 where there are none.

    Raises:
        InvalidValueError: If it has more than 64 bits.
    """
    number = 0 if digits is None else int(digits)
    if number >= 2**64:
        raise InvalidValueError("epoch", digits, "less than 2**64")
    return number


class Leased(Message, frozen=True, omit_defaults=True, gc=False):
    """A message with an epoch; a plain number becomes one, and 0 none."""

    def __post_init__(self) -> None:
        epoch = self.epoch  # type: ignore[attr-defined]
        if epoch is not None and type(epoch) is not Epoch:
            optional = type(self).__struct_defaults__
            number = None if epoch == 0 and optional else Epoch(epoch)
            msgspec.structs.force_setattr(self, "epoch", number)
