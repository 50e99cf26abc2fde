"""What a timeline is edited with: pieces to put in, states at a knot."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from vrs.errors import InvalidValueError
from vrs.model import Array
from vrs.polynomials import power_sum
from vrs.segment import PolynomialSegment
from vrs.tree import Run

HOLD = 0
"""Command id, inside, of a hold; `PolynomialSegment.command_id` says None."""


_JOINT_TOLERANCE = 1e-6
"""Jump of a joint [rad] between segments that's only rounding."""


class Piece(NamedTuple):
    """New polynomials for an edit, one after the other."""

    durations: Sequence[float]
    """Durations [s], (m,), positive."""
    coefficients: Sequence[Array]
    """m arrays of shape (degree + 1, n)."""
    command_id: int
    """Who made them; HOLD for a hold."""

    @property
    def rows(self) -> list[bytes]:
        """The coefficients as bytes in C order."""
        return [a.tobytes() for a in self.coefficients]


class Packed(NamedTuple):
    """A piece that has its coefficients as a timeline keeps them."""

    durations: Sequence[float]
    """Durations [s], (m,), positive."""
    rows: Sequence[bytes]
    """m arrays of shape (degree + 1, n), as bytes in C order."""
    command_id: int
    """Who made them; HOLD for a hold."""


class State(NamedTuple):
    """Where the arm is and how it moves, each (n,)."""

    q: Array
    """[rad]."""
    qd: Array
    """[rad/s]."""
    qdd: Array
    """[rad/s²]."""


def run_of(pieces: Iterable[Piece | Packed], start: float) -> Run:
    """Pieces as consecutive segments from a time [s] on."""
    durations, owners, rows = list[float](), list[int](), list[bytes]()
    for piece in pieces:
        durations += piece.durations
        rows += piece.rows
        owners += [piece.command_id] * (len(rows) - len(owners))
    assert len(rows) == len(durations)
    starts = array("d", list(accumulate(durations, initial=start)))
    starts.pop()
    return Run(starts, array("d", durations), array("q", owners), tuple(rows))


def checked_run(segments: Iterable[PolynomialSegment], start: float, q: Array) -> Run:
    """Segments that begin at a time [s] and at joints q [rad], (n,).

    Raises:
        InvalidValueError: If they leave gaps, overlap, jump or differ in width.
    """
    starts, durations, owners, rows = array("d"), array("d"), array("q"), list[bytes]()
    end, position = start, q
    for index, segment in enumerate(segments):
        if segment.coefficients.shape[1] != len(q):
            raise InvalidValueError(f"segment {index}", segment.coefficients.shape, f"of width {len(q)}")
        if abs(segment.start - end) > 1e-9 * max(1.0, abs(end)):
            raise InvalidValueError(f"segment {index} start", segment.start, f"contiguous, at {end}")
        if np.abs(segment.coefficients[0] - position).max() > _JOINT_TOLERANCE:
            raise InvalidValueError(f"segment {index} position", segment.coefficients[0], f"at {position}")
        # What's only rounding doesn't let a segment start before the one that it follows.
        starts.append(max(segment.start, starts[-1]) if starts else segment.start)
        durations.append(segment.duration)
        owners.append(segment.command_id or HOLD)
        rows.append(segment.coefficients.tobytes())
        end = segment.end
        position = power_sum(segment.coefficients, segment.duration)
    return Run(starts, durations, owners, tuple(rows))
