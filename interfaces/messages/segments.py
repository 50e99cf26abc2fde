"""Segments on the wire: duration, command, coefficients; the start where the one before doesn't end there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Generic, TypeVar

import msgspec
import numpy as np
from msgspec import Meta

from interfaces.messages.fields import MOST_JOINTS, CommandId, Finite, Seconds, Time
from vrs.errors import InvalidValueError
from vrs.model import Array
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
C = TypeVar("C")

_DOUBLE = np.dtype("<f8")


class SegmentWire(msgspec.Struct, Generic[C], frozen=True, array_like=True, gc=False):
    """A segment as it crosses: an array of three or four."""

    duration: Seconds
    command_id: CommandId | None
    coefficients: C
    start: Time | None = None


Dof = Annotated[int, Meta(ge=0, le=MOST_JOINTS)]
Segments = Annotated[tuple[SegmentWire[C], ...], Meta(max_length=MOST_SEGMENTS)]
Planned = Annotated[tuple[SegmentWire[C], ...], Meta(max_length=MOST_PLANNED)]


def rows(segments: Sequence[PolynomialSegment], packed: bool) -> tuple[int, float, tuple[Any, ...]]:
    """Segments for the wire: joints, start of the first [s], rows.

    Args:
        segments: All of one width.
        packed: Whether they're for msgpack.
    """
    if not segments:
        return 0, 0.0, ()
    end, found = segments[0].start, list[Any]()
    for segment in segments:
        a = segment.coefficients
        coefficients = a.astype(_DOUBLE, copy=False).tobytes() if packed else a.tolist()
        if segment.start == end:
            found.append((segment.duration, segment.command_id, coefficients))
        else:
            found.append((segment.duration, segment.command_id, coefficients, segment.start))
        end = segment.start + segment.duration
    return segments[0].coefficients.shape[1], segments[0].start, tuple(found)


def segments_of(dof: int, start: float, wires: Iterable[SegmentWire[Any]]) -> tuple[PolynomialSegment, ...]:
    """The segments that rows stand for.

    Raises:
        InvalidValueError: If the coefficients don't fit the joints, or aren't finite.
    """
    found = []
    for wire in wires:
        start = start if wire.start is None else wire.start
        given = wire.coefficients
        a = coefficients_from_bytes(given, dof) if isinstance(given, bytes) else coefficients_from_lists(given, dof)
        found.append(known_segment(start, wire.duration, a, wire.command_id))
        start += wire.duration
    if found and not np.isfinite(np.concatenate([segment.coefficients.ravel() for segment in found])).all():
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
