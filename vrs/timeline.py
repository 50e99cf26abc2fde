"""The timeline τ: an ordered run of segments that is plan, live state and recording.

A timeline is a value. An edit keeps what lies before a cut, puts new pieces after it and shifts a tail; the
parts that stay are shared, not copied: see `vrs.tree`.
"""

from __future__ import annotations

import math
import sys
from bisect import bisect_right
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from vrs.commands import finite, finite_array
from vrs.errors import InvalidValueError, NonFiniteTimeError
from vrs.evaluation import Places, places_of, sample_many
from vrs.model import Array
from vrs.segment import (
    HOLD,
    QUICK_ORDER,
    Cursor,
    Packed,
    Piece,
    PolynomialSegment,
    State,
    check_derivative,
    checked_run,
    evaluate,
    filled_rows,
    first_state,
    idle_cursor,
    known_segment,
    power_sum,
    rows_of,
    run_of,
    settled,
    times,
)
from vrs.track import Track, remade
from vrs.tree import Node, knots_of, leaves, path_at, splice

_LARGEST = sys.float_info.max
_POSITION = 0
_VISITS = 4096
"""Segments for which one single time makes it worth while to list the nodes."""
_Float64 = np.float64


class Timeline(Track[PolynomialSegment]):
    """An immutable run of segments, half-open and contiguous.

    Before the start the initial position is held, after the end the last one.
    """

    __slots__ = ("_final", "_free", "_missed", "_places")

    def __init__(
        self, q: ArrayLike, start: float = 0.0, segments: Iterable[PolynomialSegment] = (), version: int = 0
    ) -> None:
        """Make a timeline that holds q, or that runs through the segments.

        Args:
            q: Initial joints [rad], (n,).
            start: Origin [s].
            segments: Contiguous segments from `start` on, starting at q.
            version: Number of the version.

        Raises:
            InvalidValueError: If the segments leave gaps, overlap, jump or differ in width.
        """
        initial = finite_array("q", q, None, "finite joint values [rad], shape (n,)")
        if initial.ndim != 1 or len(initial) == 0:
            raise InvalidValueError("q", q, "finite joint values [rad], shape (n,)")
        origin = finite("start", start, "finite seconds")
        self._set(initial, origin, *splice(0, None, None, checked_run(segments, origin, initial)), version)

    def _set(self, initial: Array, start: float, root: Node | None, height: int, version: int) -> None:
        super()._set(initial, start, root, height, version)
        self._free: list[Cursor] = []
        self._places: Places | None = None
        self._missed = 0
        self._final: Array | None = None

    @property
    def dof(self) -> int:
        """Number of joints, n."""
        return len(self._initial)

    @property
    def initial(self) -> Array:
        """Joints before the start [rad], (n,)."""
        return self._initial

    def segment(self, index: int) -> PolynomialSegment:
        """The segment at an index, 0 to len(self) − 1."""
        leaf, i, offset = self._locate(index)
        a = rows_of(leaf.rows[i], self.dof)
        return known_segment(offset + leaf.starts[i], leaf.durations[i], a, leaf.owners[i] or None)

    def knots(self, low: int, high: int) -> tuple[Array, Array]:
        """Starts of the segments low to high − 1 [s], (m,), and their velocities there [rad/s], (m, n)."""
        return knots_of(leaves(self._root, len(self._levels), low, high), self.dof)

    def sample(self, t: ArrayLike, *, derivative: int = 0) -> Array:
        """Evaluate the timeline.

        One time and many agree to rounding: a few 1e-16 of the sum of the polynomial's terms. Certified motions,
        lines at 0.001 of their speed among them, agree to 1e-15.

        Args:
            t: Timeline time [s], scalar or shape (k,). Before the start the first position is held, after the
                end the last one. At a knot the later segment counts.
            derivative: Order of the time derivative, 0 to 3.

        Returns:
            Joint values [rad / s**derivative], shape (n,) or (k, n).

        Raises:
            NonFiniteTimeError: If t holds NaN or infinity.
            InvalidValueError: If derivative isn't 0 to 3.
        Source: Doulgeri, Zikos, Delopoulos, eq. (4).
        """
        if derivative is not _POSITION:
            return self._sample(t, check_derivative(derivative))
        if type(t) is float:
            x = t
        elif type(t) is _Float64:
            x = float(t)
        else:
            return self._sample(t, 0)
        # Popping and appending are atomic: a cursor is one caller's while it's used.
        free = self._free
        try:
            cursor = free.pop()
        except IndexError:
            cursor = idle_cursor(len(self._initial))
        low, high, product, rows, powers, few, many = cursor
        if not low <= x < high:
            low, high, rows = self._find(x)
            product = few if len(rows) == QUICK_ORDER else many
            cursor = (low, high, product, rows, powers, few, many)
        powers[1] = u = x - low
        powers[2] = square = u * u
        powers[3] = square * u
        value = product(rows)
        free.append(cursor)
        return value

    def _sample(self, t: ArrayLike, order: int) -> Array:
        moments = times(t)
        if moments.ndim == 0:
            return self._at(float(moments), order)
        if self._root is None:
            return np.tile(np.zeros(self.dof) if order else self._initial, (len(moments), 1))
        span, held = (self._first, self._end), (self._initial, self._last())
        return sample_many(self._root, len(self._levels), span, held, self._find, moments, order)

    def _at(self, t: float, order: int) -> Array:
        if not order:
            return self.sample(t)
        start, _, rows = self._find(t)
        return evaluate(rows, t - start, order)

    def _find(self, t: float) -> tuple[float, float, Array]:
        """Start of the segment at a time, or of the hold before or after all; start of the next; coefficients."""
        places = self._places
        if places is not None:
            firsts, indexes, nodes = places
            place = bisect_right(firsts, t) - 1
            columns = indexes[place].columns or indexes[place].wanted(nodes[place], self.dof)
            if columns is not None:
                first, scale, starts, grid, rows = columns
                try:
                    cell = int((t - first) * scale)
                    i = grid[cell]
                    low, high = starts[i - 1], starts[i]
                    if low <= t < high:
                        return low, high, rows[i - 1]
                    i = bisect_right(starts, t, i, grid[cell + 1])
                    low, high = starts[i - 1], starts[i]
                    if low <= t < high:
                        return low, high, rows[i - 1]
                except (IndexError, ValueError, OverflowError):
                    # Before or after all, or no finite number: what follows knows.
                    pass
        if not self._first <= t < self._end:
            if not math.isfinite(t):
                raise NonFiniteTimeError(t)
            if t < self._first:
                return -_LARGEST, self._first, self._initial[None]
            return self._end, math.inf, self._last()[None]
        # No index yet; at a node's end; where rounding led astray.
        root, height = self._root, len(self._levels)
        assert root is not None
        self._missed += 1
        if places is None and self._missed * _VISITS > self._count:
            self._places = places_of(root, height)
        index, (_, leaf, i, offset) = path_at(root, height, t)
        high = offset + leaf.starts[i + 1] if i + 1 < leaf.count else self.start_of(index + 1)
        return offset + leaf.starts[i], high, filled_rows(leaf.rows[i], self.dof)

    def _last(self) -> Array:
        """Position that is held after the end [rad], (n,), read-only."""
        if not self._count:
            return self._initial
        if self._final is None:
            leaf, i, _ = self._locate(self._count - 1)
            final = power_sum(rows_of(leaf.rows[i], self.dof), leaf.durations[i])
            final.flags.writeable = False
            self._final = final
        return self._final

    def final(self) -> Array:
        """Position that is held after the end [rad], (n,)."""
        return self._last().copy()

    def state_before(self, t: float) -> State:
        """The state at t as what lies before t makes it: at a knot the earlier segment counts.

        An earlier segment of degree 2 or less that ends at rest leaves no acceleration behind.
        """
        if self._root is None or not self._first < t <= self._end:
            rest = np.zeros(self.dof)
            return State(self._initial.copy() if t <= self._first else self.final(), rest, rest)
        if t < self._end:
            index, (_, leaf, i, offset) = self._way_at(t)
            if offset + leaf.starts[i] >= t:
                leaf, i, offset = self._locate(index - 1)
        else:
            leaf, i, offset = self._locate(self._count - 1)
        u = min(t - (offset + leaf.starts[i]), leaf.durations[i])
        return State(*settled(leaf.rows[i], self.dof, u))

    def state_after(self, index: int) -> State:
        """The state at the start of a segment, as the segment has it."""
        leaf, i, _ = self._locate(index)
        return State(*first_state(leaf.rows[i], self.dof))

    def edited(
        self, cut: float, pieces: Iterable[Piece | Packed], tail: int | None = None, tail_start: float | None = None
    ) -> Timeline:
        """Keep what lies before `cut`, put pieces there, and let the segments from `tail` on follow.

        Args:
            cut: Time of the cut [s]; the segment that it falls into keeps its coefficients and is shortened.
                After the end a hold fills the gap; before the start the timeline begins at the cut.
            pieces: What comes instead.
            tail: Index, in this timeline, of the first segment that stays after the pieces; None for none.
            tail_start: Time at which the tail starts [s].
        """
        start = self._start
        left, last = self._cut(cut)
        if self._root is None or not self._first <= cut < self._end:
            start = min(start, cut)
            if cut > self._end:
                pieces = (Piece([cut - self._end], [self._last()[None]], HOLD), *pieces)
                cut = self._end
        right = None
        if tail is not None and tail_start is not None and tail < self._count:
            right = self._way_to(tail)
        tree = splice(len(self._levels), left, last, run_of(pieces, cut), right, tail_start or 0.0)
        result = remade(Timeline, self._initial, start, *tree, self.version + 1)
        try:
            cursor = self._free.pop()
        except IndexError:
            return result
        result._free.append((math.inf, -math.inf, *cursor[2:]))
        return result
