"""Segments on the wire: duration, command, coefficients; the start where the one before doesn't end there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import copy
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta

from interfaces.messages.fields import MOST_JOINTS, CommandId, Finite, Seconds, Time
from vrs.errors import InvalidValueError
from vrs.model import Array
from vrs.record import Record, set_field
from vrs.segment import PolynomialSegment, known_segment

MOST_SEGMENTS = 256
"""Segments of a history's part or of an edit, at most."""
MOST_PLANNED = 4096
"""Segments of a plan between sites, at most."""
MOST_POWERS = 32
"""Coefficients of a joint, at most."""

Packed = Annotated[bytes, Meta(min_length=8, max_length=8 * MOST_JOINTS * MOST_POWERS)]
"""Coefficients in msgpack: little-endian doubles, the joints of power 0 first."""
Plain = Annotated[
    list[Annotated[list[Finite], Meta(min_length=1, max_length=MOST_JOINTS)]],
    Meta(min_length=1, max_length=MOST_POWERS),
]
"""Coefficients in JSON: rows by ascending power."""

_DOUBLE = np.dtype("<f8")


class SegmentRow(msgspec.Struct, frozen=True, array_like=True, gc=False):
    """A segment as it crosses: an array of three or four."""

    duration: Seconds
    """[s]."""
    command_id: CommandId | None
    """Of the command that made it; None for a hold."""
    coefficients: Packed | Plain
    """By ascending power, of each joint."""
    start: Time | None = None
    """[s]; None where it's the end of the one before, or the message's."""


Dof = Annotated[int, Meta(ge=0, le=MOST_JOINTS)]
if TYPE_CHECKING:
    Segments: TypeAlias = tuple[PolynomialSegment, ...]
    Planned: TypeAlias = tuple[PolynomialSegment, ...]
else:
    Segments = Annotated[tuple[SegmentRow, ...], Meta(max_length=MOST_SEGMENTS)]
    Planned = Annotated[tuple[SegmentRow, ...], Meta(max_length=MOST_PLANNED)]


class Segmented(Record, frozen=True, omit_defaults=True, gc=False, eq=False):
    """A message, or a part of one, with segments: it holds them as they are, and crosses with their rows."""

    def __post_init__(self) -> None:
        given = self.segments  # type: ignore[attr-defined]
        if given and type(given[0]) is SegmentRow:
            given = segments_of(self.dof, self.start, given)  # type: ignore[attr-defined]
            set_field(self, "segments", given)
        set_field(self, "dof", given[0].coefficients.shape[1] if given else 0)
        set_field(self, "start", given[0].start if given else 0.0)

    def as_written(self, packed: bool) -> Self:
        """The same with rows for segments.

        Args:
            packed: Whether coefficients are bytes, for msgpack, or lists.
        """
        message = copy(self)
        dof, start, found = rows(self.segments, packed)  # type: ignore[attr-defined]
        set_field(message, "dof", dof)
        set_field(message, "start", start)
        set_field(message, "segments", found)
        return message


def rows(segments: Sequence[PolynomialSegment], packed: bool) -> tuple[int, float, tuple[Any, ...]]:
    """Segments for the wire: joints, start of the first [s], rows.

    Args:
        segments: All of one width.
        packed: Whether they're for msgpack.
    """
    if not segments:
        return 0, 0.0, ()
    first = segments[0]
    return first.coefficients.shape[1], first.start, written(segments, _packed if packed else _listed, first.start)


def _packed(segment: PolynomialSegment, start: float | None = None) -> tuple[Any, ...]:
    a = segment.coefficients
    # Looking costs less than a conversion that has nothing to do.
    data = (a if a.dtype is _DOUBLE else a.astype(_DOUBLE)).tobytes()
    row = segment.duration, segment.command_id, data
    return row if start is None else (*row, start)


def _listed(segment: PolynomialSegment, start: float | None = None) -> tuple[Any, ...]:
    row = segment.duration, segment.command_id, segment.coefficients.tolist()
    return row if start is None else (*row, start)


def written(segments: Iterable[Any], row: Callable[..., Any], end: float) -> tuple[Any, ...]:
    """Rows of segments, each with its start where that isn't the end of the one before.

    Args:
        segments: Of any kind.
        row: Makes a row of a segment, and of its start [s] where it's to be given.
        end: Where what's before the first one ends [s].
    """
    found = []
    for segment in segments:
        found.append(row(segment) if segment.start == end else row(segment, segment.start))
        end = segment.start + segment.duration
    return tuple(found)


def placed(rows: Iterable[Any], start: float) -> Iterator[tuple[float, Any]]:
    """The opposite: each row with its start, where none is given the end of the one before [s]."""
    for row in rows:
        if row.start is not None:
            start = row.start
        yield start, row
        start += row.duration


def segments_of(dof: int, start: float, wires: Iterable[SegmentRow]) -> tuple[PolynomialSegment, ...]:
    """The segments that rows stand for.

    Raises:
        InvalidValueError: If the coefficients don't fit the joints, or aren't finite.
    """
    found = []
    for at, wire in placed(wires, start):
        given = wire.coefficients
        a = coefficients_from_bytes(given, dof) if isinstance(given, bytes) else coefficients_from_lists(given, dof)
        found.append(known_segment(at, wire.duration, a, wire.command_id))
    if found and not np.isfinite(np.concatenate([segment.coefficients for segment in found])).all():
        raise InvalidValueError("coefficients", "NaN or infinity", "finite")
    return tuple(found)


def coefficients_from_bytes(data: bytes, dof: int) -> Array:
    """A segment's coefficients, (powers, dof), as MessagePack carries them: little-endian doubles."""
    row = 8 * dof
    if not row or len(data) % row or len(data) > row * MOST_POWERS:
        raise InvalidValueError("coefficients", f"{len(data)} bytes", f"1 to {MOST_POWERS} rows of {dof} doubles")
    return np.frombuffer(data, _DOUBLE).reshape(-1, dof)


def coefficients_from_lists(data: list[list[float]], dof: int) -> Array:
    """A segment's coefficients, (powers, dof), as JSON carries them: a list of rows."""
    if any(len(row) != dof for row in data):
        raise InvalidValueError("coefficients", [len(row) for row in data], f"rows of {dof} numbers")
    a: Array = np.array(data)
    a.flags.writeable = False
    return a
