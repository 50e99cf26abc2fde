"""The timeline τ: an ordered run of segments that is plan, live state and recording.

A timeline is a value. An edit keeps what lies before a cut, puts new pieces after it and shifts a tail; the
parts that stay are shared, not copied: see `vrs.tree`. `BaseTimeline` is a run of any segments, whatever the rows
of its leaves mean; `Timeline` has the joints' polynomials, and `vrs.mobile.ArcTimeline` a mobile robot's arcs.
"""

from __future__ import annotations

import math
import sys
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Generic, Self, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike

from vrs.checks import finite, finite_array
from vrs.errors import InvalidValueError, NonFiniteTimeError
from vrs.evaluation import DENSE, GATHERED, Places, horner, nodes_at, places_of, stack_of
from vrs.model import Array
from vrs.segment import (
    HOLD,
    QUICK_ORDER,
    Cursor,
    Packed,
    Piece,
    PolynomialSegment,
    Segment,
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
from vrs.tree import Leaf, Node, Path, first_start, knots_of, last_end, leaves, path_at, path_to, splice

S = TypeVar("S", bound=Segment)


class BaseTimeline(Generic[S]):
    """An immutable run of segments, half-open and contiguous."""

    __slots__ = (
        "_asked", "_count", "_end", "_first", "_height", "_initial", "_near", "_root", "_start", "version",
    )  # fmt: skip

    version: int
    """How many edits made it."""

    def _set(self, initial: Array, start: float, root: Node | None, height: int, version: int) -> None:
        self._initial = initial
        self._start = start
        self._root = root
        self._height = height
        self._count = 0 if root is None else root.count
        self._first = start if root is None else first_start(root, height, 0.0)
        self._end = start if root is None else last_end(root, height)
        self._asked: tuple[float, int, Path] | None = None
        self._near: tuple[int, Path] | None = None
        self.version = version

    @property
    def start(self) -> float:
        """Origin [s]."""
        return self._start

    @property
    def end(self) -> float:
        """End of the last segment [s]; the origin while there's none."""
        return self._end

    @property
    def root(self) -> Node | None:
        """The tree that holds the segments; None while there's none."""
        return self._root

    @property
    def height(self) -> int:
        """Levels of nodes above the tree's leaves."""
        return self._height

    @property
    def segments(self) -> SegmentView[S]:
        """The segments, made when they're looked at."""
        return SegmentView(self)

    def __len__(self) -> int:
        return self._count

    def __reduce__(self) -> tuple[Any, ...]:
        return remade, (type(self), self._initial, self._start, self._root, self._height, self.version)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, BaseTimeline) or type(self) is not type(other):
            return False
        head = (self._start, self._end, len(self)) == (other._start, other._end, len(other))
        if not head or not np.array_equal(self._initial, other._initial):
            return False
        if self._root is other._root:
            return True
        return all(a == b for a, b in zip(self.segments, other.segments, strict=True))

    def __hash__(self) -> int:
        return hash((self._start, self._end, len(self), self._initial.tobytes()))

    def __repr__(self) -> str:
        span = f"[{self._start:g}, {self._end:g}) s"
        return f"{type(self).__name__}({len(self)} segments, {span}, version {self.version})"

    def _way_at(self, t: float) -> tuple[int, Path]:
        """Index of the segment at a time from the first start to before the end, and the way to it.

        An edit asks for its own time again and again, so the newest is remembered.
        """
        newest = self._asked
        if newest is None or newest[0] != t:
            assert self._root is not None
            index, path = path_at(self._root, self._height, t)
            self._asked = newest = t, index, path
            self._near = index - path.place, path
        return newest[1], newest[2]

    def _way_to(self, index: int) -> Path:
        """The way to a segment; one more step from its neighbours in the leaf that was asked for last."""
        near = self._near
        if near is None or not 0 <= index - near[0] < near[1].leaf.count:
            if self._root is None or not 0 <= index < self._count:
                raise IndexError(index)
            path = path_to(self._root, self._height, index)
            self._near = near = index - path.place, path
        first, path = near
        return Path(path.steps, path.leaf, index - first, path.offset)

    def _locate(self, index: int) -> tuple[Leaf, int, float]:
        """A segment's leaf, its index there, and the leaf's offset."""
        near = self._near
        if near is None or not 0 <= index - near[0] < near[1].leaf.count:
            return self._way_to(index)[1:]
        first, (_, leaf, _, offset) = near
        return leaf, index - first, offset

    def index_at(self, t: float) -> int:
        """Index of the segment with start ≤ t < end; −1 before the first, len(self) after the last."""
        if t >= self._end:
            return self._count
        if self._root is None or t < self._first:
            return -1
        return self._way_at(t)[0]

    def start_of(self, index: int) -> float:
        """Start of a segment [s]; of index len(self), the end."""
        if index >= self._count:
            return self._end
        leaf, i, offset = self._locate(index)
        return offset + leaf.starts[i]

    def owner_of(self, index: int) -> int:
        """Command id of a segment, or HOLD."""
        leaf, i, _ = self._locate(index)
        return leaf.owners[i]

    def owners(self, low: int, high: int) -> tuple[int, ...]:
        """Distinct command ids of the segments low to high − 1, in order, without holds."""
        parts = leaves(self._root, self._height, low, high)
        found: dict[int, None] = {}
        for leaf, part, _ in parts:
            found.update(dict.fromkeys(leaf.owners[part]))
        found.pop(HOLD, None)
        return tuple(found)

    def end_of_run(self, index: int) -> int:
        """One past the last segment, in a row from an index on, that the same command owns."""
        leaf, i, _ = self._locate(index)
        owner = leaf.owners[i]
        while True:
            owners = leaf.owners
            while i < leaf.count and owners[i] == owner:
                i, index = i + 1, index + 1
            if i < leaf.count or index == self._count:
                return index
            leaf, i, _ = self._locate(index)

    def with_version(self, version: int) -> Self:
        """The same timeline under another version number."""
        return remade(type(self), self._initial, self._start, self._root, self._height, version)

    def segment(self, index: int) -> S:
        """The segment at an index, 0 to len(self) − 1."""
        raise NotImplementedError

    def _cut(self, cut: float) -> tuple[Path | None, float | None]:
        """The way to the last segment that begins before a time [s], and what it lasts if that cuts it short."""
        if self._root is None or not self._first <= cut < self._end:
            return (self._way_to(self._count - 1) if self._count and cut >= self._end else None), None
        index, left = self._way_at(cut)
        last = cut - (left.offset + left.leaf.starts[left.place])
        if last > 0:
            return left, last
        return (self._way_to(index - 1) if index else None), None


_TimelineT = TypeVar("_TimelineT", bound=BaseTimeline[Any])


def remade(
    kind: type[_TimelineT], initial: Array, start: float, root: Node | None, height: int, version: int
) -> _TimelineT:
    """Return a timeline of a kind over a tree."""
    result = kind.__new__(kind)
    result._set(initial, start, root, height, version)
    return result


class SegmentView(Sequence[S]):
    """A timeline's segments, made one by one as they're asked for."""

    __slots__ = ("_timeline",)

    def __init__(self, timeline: BaseTimeline[S]) -> None:
        self._timeline: BaseTimeline[S] = timeline

    def __len__(self) -> int:
        return len(self._timeline)

    @overload
    def __getitem__(self, index: int) -> S: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[S, ...]: ...
    def __getitem__(self, index: int | slice) -> S | tuple[S, ...]:
        if isinstance(index, slice):
            return tuple(self._timeline.segment(i) for i in range(*index.indices(len(self))))
        if not -len(self) <= index < len(self):
            raise IndexError(index)
        return self._timeline.segment(index % len(self))

    def __iter__(self) -> Iterator[S]:
        return (self._timeline.segment(i) for i in range(len(self)))

    def __repr__(self) -> str:
        return f"<{len(self)} segments>"


_LARGEST = sys.float_info.max
_POSITION = 0
_VISITS = 4096
"""Segments for which one single time makes it worth while to list the nodes."""
_Float64 = np.float64


class Timeline(BaseTimeline[PolynomialSegment]):
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
        return knots_of(leaves(self._root, self._height, low, high), self.dof)

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
        places = None if (moments[1:] >= moments[:-1]).all() else np.argsort(moments)
        if places is not None:
            moments = moments[places]
        values = np.empty((len(moments), self.dof))
        begin, stop = moments.searchsorted((self._first, self._end)).tolist()
        values[:begin] = 0.0 if order else self._initial
        values[stop:] = 0.0 if order else self._last()
        if begin < stop:
            self._fill(moments[begin:stop], order, values[begin:stop])
        if places is None:
            return values
        result = np.empty_like(values)
        result[places] = values
        return result

    def _fill(self, t: Array, derivative: int, out: Array) -> None:
        """Write the values at sorted times within the span into `out`, (k, n), by Horner's rule."""
        assert self._root is not None
        count, n = out.shape
        room = min(count, GATHERED)
        terms, u = np.empty((room, n, QUICK_ORDER)), np.empty(room)
        begin = end = 0

        def finish() -> None:
            powers = terms[: end - begin].reshape(-1, QUICK_ORDER).T
            horner(powers.__getitem__, QUICK_ORDER, u[: end - begin], derivative, out[begin:end])

        for node, offset, low, high in nodes_at(self._root, self._height, 0.0, t, 0):
            stack = stack_of(node, n, high - low)
            if stack is None:
                for row, x in zip(out[low:high], t[low:high].tolist(), strict=True):
                    start, _, coefficients = self._find(x)
                    row[:] = evaluate(coefficients, x - start, derivative)
            elif stack.quick and high - low < DENSE:
                if low != end or high - begin > room:
                    finish()
                    begin = low
                end = high
                stack.gather(t[low:high], offset, terms[low - begin : high - begin], u[low - begin : high - begin])
            else:
                stack.fill(t[low:high], offset, derivative, out[low:high])
        finish()

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
        root, height = self._root, self._height
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
        tree = splice(self._height, left, last, run_of(pieces, cut), right, tail_start or 0.0)
        result = remade(Timeline, self._initial, start, *tree, self.version + 1)
        try:
            cursor = self._free.pop()
        except IndexError:
            return result
        result._free.append((math.inf, -math.inf, *cursor[2:]))
        return result
