"""Values of the public interface that also cross a network and are stored: one definition each, with ranges."""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta

from vrs.model import Array

LARGEST = 1e9
"""Size of the largest value that a command may ask for, in any unit: squares and products are far from overflow."""

Time = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]
"""Seconds of the session."""
Number = Annotated[int, Meta(ge=1, le=2**63 - 1)]
Count = Annotated[int, Meta(ge=0, le=2**63 - 1)]
Value = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]
"""A joint value, a speed, a parameter; in its own unit."""
LONGEST_TEXT = 2000
"""Text for people is cut off after so many characters."""
Text = Annotated[str, Meta(max_length=LONGEST_TEXT)]

if TYPE_CHECKING:
    Pose: TypeAlias = Array
    Twist: TypeAlias = Array
else:

    class Pose(np.ndarray):
        """A homogeneous transform, (4, 4); it crosses as its rows."""

    class Twist(np.ndarray):
        """Speeds of a body, (6,): linear, then angular."""


class _AsDataclass:
    """What `dataclasses.replace`, `fields` and `asdict` look for in a class."""

    def __get__(self, record: Record | None, kind: type[Record]) -> dict[str, dataclasses.Field[Any]]:
        return _dataclass_fields(kind)


@cache
def _dataclass_fields(kind: type[Record]) -> dict[str, dataclasses.Field[Any]]:
    alike: Any = dataclasses.make_dataclass(kind.__name__, kind.__struct_fields__)
    fields: dict[str, dataclasses.Field[Any]] = alike.__dataclass_fields__
    return fields


class Record(msgspec.Struct, frozen=True, omit_defaults=True, gc=False):
    """A frozen value that is written as it's held: defaults are left out, unknown fields passed over.

    `dataclasses.replace` and its like take it as they take a dataclass.
    """

    if TYPE_CHECKING:
        __dataclass_fields__: ClassVar[dict[str, dataclasses.Field[Any]]]
    else:
        __dataclass_fields__ = _AsDataclass()


set_field = msgspec.structs.force_setattr
"""Sets a field of a record while it's being made."""
