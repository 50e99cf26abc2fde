"""A track: an ordered run of segments on a persistent tree, whatever they describe.

A track is a value. An edit keeps what lies before a cut, puts new segments after it and shifts a tail; the parts
that stay are shared, not copied: see `vrs.tree`. What the rows of its leaves mean, and what moves by them, is for
its kinds to say: `vrs.timeline.Timeline` for joints, `vrs.mobile.ArcTimeline` for a mobile robot.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Generic, Self, TypeVar, overload

import numpy as np

from vrs.model import Array
from vrs.segment import HOLD, Segment
from vrs.tree import Leaf, Node, Path, first_start, last_end, leaves, path_at, path_to

S = TypeVar("S", bound=Segment)


class Track(Generic[S]):
    """An immutable run of segments, half-open and contiguous."""

    __slots__ = (
        "_asked", "_count", "_end", "_first", "_initial", "_levels", "_near", "_root", "_start", "version",
    )  # fmt: skip

    version: int
    """How many edits made it."""

    def _set(self, initial: Array, start: float, root: Node | None, height: int, version: int) -> None:
        self._initial = initial
        self._start = start
        self._root = root
        self._levels = range(height)
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
    def segments(self) -> SegmentView[S]:
        """The segments, made when they're looked at."""
        return SegmentView(self)

    def __len__(self) -> int:
        return self._count

    def __reduce__(self) -> tuple[Any, ...]:
        return remade, (type(self), self._initial, self._start, self._root, len(self._levels), self.version)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Track) or type(self) is not type(other):
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
            index, path = path_at(self._root, len(self._levels), t)
            self._asked = newest = t, index, path
            self._near = index - path.place, path
        return newest[1], newest[2]

    def _way_to(self, index: int) -> Path:
        """The way to a segment; one more step from its neighbours in the leaf that was asked for last."""
        near = self._near
        if near is None or not 0 <= index - near[0] < near[1].leaf.count:
            if self._root is None or not 0 <= index < self._count:
                raise IndexError(index)
            path = path_to(self._root, len(self._levels), index)
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
        parts = leaves(self._root, len(self._levels), low, high)
        found = dict.fromkeys(owner for leaf, part, _ in parts for owner in leaf.owners[part])
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
        """The same track under another version number."""
        return remade(type(self), self._initial, self._start, self._root, len(self._levels), version)

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


_TrackT = TypeVar("_TrackT", bound=Track[Any])


def remade(
    kind: type[_TrackT], initial: Array, start: float, root: Node | None, height: int, version: int
) -> _TrackT:
    """A track of a kind over a tree."""
    result = kind.__new__(kind)
    result._set(initial, start, root, height, version)
    return result


class SegmentView(Sequence[S]):
    """A timeline's segments, made one by one as they're asked for."""

    __slots__ = ("_timeline",)

    def __init__(self, timeline: Track[S]) -> None:
        self._timeline: Track[S] = timeline

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
