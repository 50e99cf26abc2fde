"""Types of fields with their ranges, and what all messages on the wire share."""

from __future__ import annotations

import sys
from typing import Annotated, Any

import msgspec
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
Epoch = Annotated[str, Meta(pattern=r"\A[1-9][0-9]{0,19}\Z")]
"""Decimal digits: JavaScript's numbers end at 2⁵³."""
Name = Annotated[str, Meta(min_length=1, max_length=100)]
Word = Annotated[str, Meta(max_length=200)]
Text = Annotated[str, Meta(max_length=LONGEST_TEXT)]
Joints = Annotated[list[Value], Meta(min_length=1, max_length=MOST_JOINTS)]
Names = Annotated[tuple[Number, ...], Meta(max_length=MOST_NAMES)]


class Wire(msgspec.Struct, frozen=True, omit_defaults=True, gc=False):
    """A message or a part of one as it crosses: defaults are left out, unknown fields passed over."""


class Message(Wire, frozen=True, omit_defaults=True, gc=False, tag_field="type"):
    """A message, or a part that has a type; `of` and `read` go between the wire and the value it stands for."""

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
    """NumPy's scalars as Python's; for an encoder that meets what it doesn't know.

    Raises:
        InvalidValueError: If it's anything else.
    """
    if isinstance(value, np.generic):
        return value.item()
    raise InvalidValueError("field", value, "what a message may hold")


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
