"""A persistent tree of segments: an edit rebuilds one path from root to leaf and shares everything else.

Every child of a node has a time offset. A segment starts at the offsets summed from the root down, in that order,
plus its own start in the leaf; that float is the start, wherever it's asked for. Shifting a tail adds Δ to the
offsets right of the path at each level and to no segment. A node that is made anew from one node keeps its
offset; one that is made from two has offset 0 and their children the summed offset, so that the same float comes
out. Leaves that are made anew have absolute starts: their offset takes away what's summed above them, exactly.
"""

from __future__ import annotations

import weakref
from array import array
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np

from vrs.model import Array

_T = TypeVar("_T")

LEAF = 48
"""Segments of a leaf, at most: more cost more to copy, fewer make more leaves."""

CAPACITY = 96
"""Children of a node, at most: more cost more to copy, fewer make the tree deeper."""

FILLED = 0.75
"""How full a sequence that grows at its end leaves what lies behind: edits that follow there need no split."""

_FEW = 16
"""Numbers up to which a list is quicker than NumPy."""


class Leaf:
    """Up to LEAF segments, a column a property. Never changed once it's made, but put away: see `vrs.archive`."""

    __slots__ = ("count", "durations", "first", "owners", "place", "rows", "starts")

    place: Any
    """Where it's put away; not there before."""

    def __init__(
        self, starts: array[float], durations: array[float], owners: array[int], rows: tuple[bytes, ...]
    ) -> None:
        self.starts = starts
        """Start of each segment [s], in the leaf's time."""
        self.durations = durations
        """[s]."""
        self.owners = owners
        """Command ids; 0 for a hold."""
        self.rows = rows
        """Coefficients (degree + 1, n) of each segment, as the bytes of a C-ordered float64 array."""
        self.first: float = starts[0]
        self.count = len(starts)


class Node:
    """Up to CAPACITY leaves or nodes, all of one height. What a reader sees of it never changes."""

    __slots__ = (
        "__weakref__", "asked", "children", "count", "counts", "first", "firsts", "index", "offsets", "place",
        "stack",
    )  # fmt: skip

    place: Any
    """Where it's put away; not there before."""

    head: tuple[float, float] | None = None
    """Offset of the first child and `first` of it, where they're known though the children are put away."""

    def __init__(
        self,
        children: tuple[Any, ...],
        offsets: array[float],
        firsts: array[float],
        counts: array[int],
    ) -> None:
        self.children = children
        """Leaves, or nodes: which of them, the height says."""
        self.offsets = offsets
        """Time offset of each child [s]."""
        self.firsts = firsts
        """Where each child's first segment starts, in this node's time [s]; exact to rounding only."""
        self.counts = counts
        """Segments before each child, and in all."""
        self.first: float = firsts[0]
        self.count: int = counts[-1]
        self.index: Any = None
        self.stack: Any = None
        """What `vrs.evaluation` makes for single times and for many; to be had again if it's dropped."""
        self.asked = 0
        """For how many times the stack was missing."""


class CacheLimit(Generic[_T]):
    """The newest so many things of a kind whose caches are in memory; of older ones they're dropped."""

    def __init__(self, most: int, drop: Callable[[_T], None]) -> None:
        """Take how many, and what drops a cache."""
        self.most, self._drop = most, drop
        self._kept: deque[weakref.ref[_T]] = deque()

    def add(self, kept: _T) -> None:
        """Note that a cache was made."""
        self._kept.append(weakref.ref(kept))
        while len(self._kept) > self.most:
            oldest = self._kept.popleft()()
            if oldest is not None:
                self._drop(oldest)


class Run(NamedTuple):
    """Consecutive segments with absolute starts, in columns as a leaf's, of any length."""

    starts: array[float]
    durations: array[float]
    owners: array[int]
    rows: tuple[bytes, ...]


class Path(NamedTuple):
    """The way from the root to a segment."""

    steps: list[Step]
    leaf: Leaf
    place: int
    offset: float


Step: TypeAlias = tuple[Node, int, float]
"""A node on the way, the child that was taken, and the node's summed offset."""


def path_at(root: Node, height: int, t: float) -> tuple[int, Path]:
    """Index of the last segment that doesn't start after t, which isn't before the first, and the way there."""
    steps = []
    node: Any = root
    index, offset = 0, 0.0
    for _ in range(height):
        child = max(bisect_right(node.firsts, t - offset) - 1, 0)
        steps.append((node, child, offset))
        index += node.counts[child]
        offset += node.offsets[child]
        node = node.children[child]
    starts = node.starts
    i = max(bisect_right(starts, t - offset) - 1, 0)
    # t − offset is rounded: the comparison that counts is the one with offset + start.
    if offset + starts[i] <= t and i + 1 < len(starts) and t < offset + starts[i + 1]:
        return index + i, Path(steps, node, i, offset)
    index += i
    while index + 1 < root.count and start_of(root, height, index + 1) <= t:
        index += 1
    while start_of(root, height, index) > t:
        index -= 1
    return index, path_to(root, height, index)


def start_of(root: Node, height: int, index: int) -> float:
    """Start of a segment [s]."""
    _, leaf, i, offset = path_to(root, height, index)
    return offset + leaf.starts[i]


def first_start(node: Any, height: int, offset: float) -> float:
    """Start of the first segment below a node or, of height 0, in a leaf, whose summed offset is given."""
    for _ in range(height):
        head: tuple[float, float] | None = node.head
        if head is not None:
            return offset + head[0] + head[1]
        offset += node.offsets[0]
        node = node.children[0]
    start: float = offset + node.first
    return start


def last_end(root: Node, height: int) -> float:
    """End of the last segment."""
    node: Any = root
    offset = 0.0
    for _ in range(height):
        offset += node.offsets[-1]
        node = node.children[-1]
    end: float = offset + node.starts[-1] + node.durations[-1]
    return end


def path_to(root: Node, height: int, index: int) -> Path:
    """The way to a segment."""
    steps = []
    node: Any = root
    offset = 0.0
    for _ in range(height):
        child = bisect_right(node.counts, index) - 1
        steps.append((node, child, offset))
        index -= node.counts[child]
        offset += node.offsets[child]
        node = node.children[child]
    return Path(steps, node, index, offset)


def leaves(root: Node | None, height: int, low: int, high: int) -> Iterator[tuple[Leaf, slice, float]]:
    """The leaves of the segments low to high − 1, where these are in each, and its summed offset."""
    while root is not None and low < min(high, root.count):
        _, leaf, i, offset = path_to(root, height, low)
        low += leaf.count - i
        yield leaf, slice(i, leaf.count - max(low - high, 0)), offset


def knots_of(parts: Iterable[tuple[Leaf, slice, float]], n: int) -> tuple[Array, Array]:
    """Starts [s], (m,), and velocities there, (m, n), of segments in leaves, each with its summed offset."""
    starts, rates = [np.empty(0)], bytearray()
    for leaf, part, offset in parts:
        starts.append(offset + np.frombuffer(leaf.starts)[part])
        rates += b"".join([row[8 * n : 16 * n].ljust(8 * n, b"\0") for row in leaf.rows[part]])
    return np.concatenate(starts), np.frombuffer(rates).reshape(-1, n)


def _bounds(count: int, most: int, even: bool) -> list[int]:
    """Where to cut a sequence into groups of at most so many; uneven ones are filled one after the other."""
    if even:
        groups = -(-count // most)
        return [count * k // groups for k in range(groups + 1)]
    return [*range(0, count, max(int(FILLED * most), 2)), count]


def splice(
    height: int,
    left: Path | None,
    last: float | None,
    new: Run,
    right: Path | None = None,
    tail_start: float = 0.0,
) -> tuple[Node | None, int]:
    """Keep the segments up to one, put new ones there, and let those from another on follow, shifted as a whole.

    Args:
        height: Levels of nodes above the tree's leaves; 0 where there's none.
        left: The way to the last segment that stays before the new ones; None for none.
        last: What that one lasts then [s]; None leaves it as it is.
        new: The new segments.
        right: The way to the first segment that stays after them; None for none.
        tail_start: When that one starts then [s].

    Returns:
        The new tree and its height.
    """
    starts, durations, owners, rows = new
    if right is not None and starts and starts[-1] > tail_start:
        # Sums of durations are rounded: what lasts no longer than that mustn't start after what follows it.
        starts = array("d", [min(start, tail_start) for start in starts])
    if left is not None:
        leaf, stop, offset = left.leaf, left.place + 1, left.offset
        starts = _moved(leaf.starts[:stop], offset) + starts
        durations = leaf.durations[:stop] + durations
        if last is not None:
            durations[stop - 1] = last
        owners = leaf.owners[:stop] + owners
        rows = leaf.rows[:stop] + rows
    delta = 0.0
    if right is not None:
        leaf, begin, offset = right.leaf, right.place, right.offset
        delta = tail_start - (offset + leaf.starts[begin])
        starts += _moved(leaf.starts[begin:], offset, delta)
        durations += leaf.durations[begin:]
        owners += leaf.owners[begin:]
        rows += leaf.rows[begin:]
    children: tuple[Any, ...]
    if len(starts) > LEAF:
        cuts = pairwise(_bounds(len(starts), LEAF, right is not None))
        children = tuple([Leaf(starts[a:b], durations[a:b], owners[a:b], rows[a:b]) for a, b in cuts])
    else:
        children = (Leaf(starts, durations, owners, rows),) if starts else ()
    base = 0.0
    for level in range(height - 1, -1, -1):
        children, base = _joined(left and left.steps[level], children, base, right and right.steps[level], delta)
    while len(children) > 1 or (children and not height):
        children, base = _joined(None, children, base, None, 0.0)
        height += 1
    if not children:
        return None, 0
    top: Node = children[0]
    while height > 1 and len(top.children) == 1 and not top.offsets[0]:
        top, height = top.children[0], height - 1
    return top, height


def _joined(
    left: Step | None, new: tuple[Any, ...], made: float, right: Step | None, delta: float
) -> tuple[tuple[Node, ...], float]:
    """Nodes over what lies left of a path, what was made anew, and what lies right of a path.

    Args:
        left: The step of the path to the last segment that stays before what's new.
        new: What was made anew at the level below.
        made: Summed offset at which its times hold [s]: 0, or that of the node that it was made from.
        right: The step of the path to the first segment that stays after it.
        delta: How much later that segment starts than before [s].

    Returns:
        The nodes, and the summed offset at which their times hold [s].
    """
    same = left is None or right is None or left[0] is right[0]
    near = left or right
    base = near[2] if same and near else 0.0
    entry = near[0].offsets[near[1]] if made and near else -base
    children = new
    offsets, counts = array("d", (entry,) * len(new)), array("q", (0,))
    firsts = array("d", [entry + fresh.first for fresh in new])
    if left is not None:
        node, child, offset = left
        counts = node.counts[: child + 1]
        if child:
            children = node.children[:child] + new
            if same:
                offsets, firsts = node.offsets[:child] + offsets, node.firsts[:child] + firsts
            else:
                moved = _moved(node.offsets[:child] + node.firsts[:child], offset)
                offsets, firsts = moved[:child] + offsets, moved[child:] + firsts
    before = counts[-1]
    for fresh in new:
        before += fresh.count
        counts.append(before)
    if right is not None:
        node, child, offset = right
        child += 1
        more = len(node.children) - child
        if more:
            children += node.children[child:]
            counts += _added(node.counts[child + 1 :], before - node.counts[child])
            moved = _moved(node.offsets[child:] + node.firsts[child:], 0.0 if same else offset, delta)
            offsets += moved[:more]
            firsts += moved[more:]
    if len(children) <= CAPACITY:
        return ((Node(children, offsets, firsts, counts),) if children else ()), base
    nodes = []
    for a, b in pairwise(_bounds(len(children), CAPACITY, right is not None)):
        nodes.append(Node(children[a:b], offsets[a:b], firsts[a:b], _added(counts[a : b + 1], -counts[a])))
    return tuple(nodes), base


def _moved(times: array[float], by: float, further: float = 0.0) -> array[float]:
    """Times later by one span, then by another [s]."""
    if not (by or further):
        return times
    if len(times) <= _FEW:
        return array("d", [(time + by) + further for time in times])
    moved = np.frombuffer(times) + by if by else np.frombuffer(times)
    return array("d", (moved + further if further else moved).tobytes())


def _added(counts: array[int], more: int) -> array[int]:
    if not more or len(counts) <= _FEW:
        return array("q", [count + more for count in counts]) if more else counts
    return array("q", (np.frombuffer(counts, np.int64) + more).tobytes())
