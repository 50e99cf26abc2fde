"""What a timeline makes of its polynomials to be sampled quickly: indexes for single times, stacks for many."""

from __future__ import annotations

import math
import weakref
from array import array
from bisect import bisect_right
from collections.abc import Callable, Iterator
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from vrs.model import Array
from vrs.segment import QUICK_ORDER, filled_rows
from vrs.tree import CacheLimit, Node, first_start

DENSE = 1024
"""Times below one node of height 1 that are worth more than the shortest way."""

GATHERED = 1024
"""Times whose coefficients are gathered at once, DENSE or more: 0.2 MB for six joints, which a cache holds."""

_CELLS = 2
"""Cells of an index a segment."""

Columns: TypeAlias = tuple[float, float, "array[float]", "array[int]", Any]
"""An index: start of the first segment [s]; cells of the grid a second; starts [s], then NaN; how many start before
each cell, or with it; the coefficients of each segment."""

Places: TypeAlias = tuple[list[float], list["Index"], list[Node]]
"""The nodes of height 1: when the first segment of each starts [s], their indexes, and themselves."""

_Integers: TypeAlias = NDArray[np.int64]

_VERSIONS = 2
"""Stacks, and indexes, that are kept of nodes that begin with the same leaf: most are of older timelines."""

_stacked_from: dict[int, list[weakref.ref[Node]]] = {}
_indexed_from: dict[int, list[weakref.ref[Index]]] = {}


class Stack:
    """Polynomials of all segments below a node of height 1, in arrays, for many times at once."""

    __slots__ = ("_absolute", "_blocks", "_class_of", "_offsets", "_place", "_sizes", "_starts", "quick")

    def __init__(self, node: Node, n: int) -> None:
        leaves = node.children
        self._offsets = np.frombuffer(node.offsets)
        self._sizes: _Integers = np.array([leaf.count for leaf in leaves])
        self._starts = np.frombuffer(b"".join(leaf.starts for leaf in leaves))
        self._absolute: tuple[float, Array] = (math.nan, self._starts)
        rows = [row for leaf in leaves for row in leaf.rows]
        orders = np.fromiter(map(len, rows), np.int64, len(rows)) // (8 * n)
        # Orders of one class are filled up to the highest of it: 4, 5 to 8, 9 to 16, and so on.
        classes = np.maximum(np.ceil(np.log2(orders)), 2).astype(np.int8)
        names, self._class_of = np.unique(classes, return_inverse=True)
        self._place: _Integers = np.empty(len(rows), np.int64)
        self._blocks: list[Array] = []
        """Coefficients of each class, a segment's together: (m, n, K)."""
        for name in range(len(names)):
            members = np.flatnonzero(self._class_of == name)
            self._place[members] = np.arange(len(members))
            size = 8 * n * max(int(orders[members].max()), QUICK_ORDER)
            joined = b"".join([rows[i].ljust(size, b"\0") for i in members.tolist()])
            self._blocks.append(np.frombuffer(joined).reshape(len(members), -1, n).swapaxes(1, 2).copy())
        self.quick = [block.shape[2] for block in self._blocks] == [QUICK_ORDER]
        """Whether all polynomials are of QUICK_ORDER, so that `gather` serves."""

    def _segments(self, t: Array, offset: float) -> tuple[_Integers, Array]:
        """Segments below the node at times, and the times since they began [s]."""
        known, starts = self._absolute
        if known != offset:
            starts = _ascending(np.repeat(offset + self._offsets, self._sizes) + self._starts)
            self._absolute = (offset, starts)
        index = _sorted_into(starts, t)
        return index, t - starts.take(index)

    def gather(self, t: Array, offset: float, terms: Array, u: Array) -> None:
        """Write the coefficients that count at times (k,), none before the first segment, into arrays.

        Args:
            t: Times [s], sorted.
            offset: The node's summed offset [s].
            terms: Where the coefficients go, (k, n, QUICK_ORDER).
            u: Where the times since each segment's start go [s], (k,).
        """
        index, u[:] = self._segments(t, offset)
        self._blocks[0].take(index, 0, terms, "clip")

    def fill(self, t: Array, offset: float, derivative: int, out: Array) -> None:
        """Write the values at times (k,), none before the first segment, into `out`, (k, n).

        Args:
            t: Times [s], sorted.
            offset: The node's summed offset [s].
            derivative: Order of the time derivative.
            out: Where the values go.
        """
        index, u = self._segments(t, offset)
        if len(self._blocks) == 1:
            _fill_from(self._blocks[0], index, u, derivative, out)
            return
        class_of, place = self._class_of.take(index), self._place.take(index)
        for name, block in enumerate(self._blocks):
            chosen = np.flatnonzero(class_of == name)
            if len(chosen):
                values = np.empty((len(chosen), out.shape[1]))
                _fill_from(block, place.take(chosen), u.take(chosen), derivative, values)
                out[chosen] = values


class Index:
    """Where the segments below a node of height 1 start, for single times: a grid, then a search in its cell."""

    __slots__ = ("__weakref__", "columns", "missed", "offset")

    def __init__(self, offset: float) -> None:
        self.offset = offset
        """The node's summed offset [s], for which alone the index holds."""
        self.columns: Columns | None = None
        self.missed = 0
        """How often they were missing."""

    def wanted(self, node: Node, n: int) -> Columns | None:
        """The columns; None while too few times were asked for to make them."""
        self.missed += 1
        if self.missed < 16:
            return None
        self.columns = columns = _columns(node, self.offset, n)
        older = _older(_indexed_from, node, self)
        if older is not None:
            older.columns, older.missed = None, 0
        INDEXES.add(self)
        return columns

    def forget(self) -> None:
        """Drop the columns. What doesn't fit in is made again seldom: making it mustn't cost more than it saves."""
        self.columns, self.missed = None, -1000


INDEXES = CacheLimit(512, Index.forget)
"""Indexes that are kept in all: 0.3 GB of cubic segments of six joints."""


_Kept = TypeVar("_Kept")


def _older(kept: dict[int, list[weakref.ref[_Kept]]], node: Node, newest: _Kept) -> _Kept | None:
    """Note what is kept for a node; the one that is too much now, if there's one.

    Leaves are told apart by their addresses: another leaf at the address of one that's gone costs but a cache.
    """
    if len(kept) > 2 * (STACKS.most + INDEXES.most):
        kept.clear()
    first = id(node.children[0])
    older: list[_Kept] = []
    for found in kept.pop(first, []):
        there = found()
        if there is not None and there is not newest:
            older.append(there)
    kept[first] = [weakref.ref(version) for version in [*older[-_VERSIONS + 1 :], newest]]
    return older[0] if len(older) >= _VERSIONS else None


def _columns(node: Node, offset: float, n: int) -> Columns:
    leaves = node.children
    shifts = zip(node.offsets, leaves, strict=True)
    starts = _ascending(np.concatenate([(offset + shift) + np.frombuffer(leaf.starts) for shift, leaf in shifts]))
    count, first = len(starts), float(starts[0])
    span = float(starts[-1]) - first + leaves[-1].durations[-1]
    scale = _CELLS * count / max(span, 1e-9)
    edges = first + np.arange(_CELLS * count + 2) / scale
    before = array("H", starts.searchsorted(edges, "right").astype(np.uint16).tobytes())
    # No time is before or after NaN: what's first or last here is left to a closer look.
    ordered = array("d", starts.tobytes() + np.array(math.nan).tobytes())
    size = 8 * n * QUICK_ORDER
    rows: Any = [row for leaf in leaves for row in leaf.rows]
    if max(map(len, rows)) <= size:
        rows = np.frombuffer(b"".join([row.ljust(size, b"\0") for row in rows])).reshape(count, QUICK_ORDER, n)
    else:
        rows = [filled_rows(row, n) for row in rows]
    return first, scale, ordered, before, rows


def places_of(root: Node, height: int) -> Places:
    """The nodes of height 1 of a tree."""
    level: list[tuple[Any, float]] = [(root, 0.0)]
    for _ in range(height - 1):
        level = [
            (child, offset + shift)
            for node, offset in level
            for child, shift in zip(node.children, node.offsets, strict=True)
        ]
    for node, offset in level:
        if node.index is None or node.index.offset != offset:
            node.index = Index(offset)
    firsts = [first_start(node, 1, offset) for node, offset in level]
    return firsts, [node.index for node, _ in level], [node for node, _ in level]


def stack_of(node: Node, n: int, times: int) -> Stack | None:
    """The stack of a node of height 1; None while too few times were asked for to make one.

    Args:
        node: The node.
        n: Number of joints.
        times: For how many times it's wanted now.
    """
    stack: Stack | None = node.stack
    if stack is None:
        node.asked += times
        if node.asked * 64 < node.count:
            return None
        stack = node.stack = Stack(node, n)
        node.asked = 0
        older = _older(_stacked_from, node, node)
        if older is not None:
            older.stack = None
        STACKS.add(node)
    return stack


def _unstack(node: Node) -> None:
    node.stack = None


STACKS = CacheLimit(128, _unstack)
"""Stacks that are kept in all: 0.1 GB of cubic segments of six joints."""


def nodes_at(node: Any, height: int, offset: float, t: Array, done: int) -> Iterator[tuple[Node, float, int, int]]:
    """Nodes of height 1 in which sorted times lie, none before the first segment.

    Args:
        node: What they're below.
        height: Its height.
        offset: Its summed offset [s].
        t: Times [s].
        done: How many times come before these.

    Yields:
        A node, its summed offset [s], and the range of its times.
    """
    if height == 1:
        yield node, offset, done, done + len(t)
        return

    def first(child: int) -> float:
        return first_start(node.children[child], height - 1, offset + node.offsets[child])

    # `firsts` is rounded: the comparison that counts is the one with the start itself.
    child = min(bisect_right(node.firsts, float(t[0]) - offset), len(node.children) - 1)
    while first(child) > t[0]:
        child -= 1
    low = 0
    while low < len(t):
        high = int(t.searchsorted(first(child + 1))) if child + 1 < len(node.children) else len(t)
        if low < high:
            yield from nodes_at(
                node.children[child], height - 1, offset + node.offsets[child], t[low:high], done + low
            )
            low = high
        child += 1


def _ascending(starts: Array) -> Array:
    """Starts, none after a later one: a leaf's last may be, by the rounding of its offset and the next one's."""
    return np.ascontiguousarray(np.minimum.accumulate(starts[::-1])[::-1])


def _sorted_into(starts: Array, t: Array) -> _Integers:
    """Index of the last start that isn't after each of the sorted times, none before the first start."""
    if len(t) < DENSE:
        near: _Integers = starts.searchsorted(t, "right")
        near -= 1
        return near
    low, high = (starts.searchsorted((t[0], t[-1]), "right") - (1, 0)).tolist()
    if high - low > len(t):
        found: _Integers = starts.searchsorted(t, "right") - 1
        return found
    # Many times a segment: it's quicker to search the starts among the times.
    edges = t.searchsorted(starts[low + 1 : high]).tolist()
    return np.repeat(np.arange(low, high), np.diff([0, *edges, len(t)]))


def _fill_from(block: Array, index: _Integers, u: Array, derivative: int, out: Array) -> None:
    """Write the values of segments of a block (m, n, K), by their sorted index, into `out`, (k, n)."""
    first = int(index[0])
    # Many times a segment: what few segments there are is put so that a power is read at once.
    powers = block[first : int(index[-1]) + 1].transpose(2, 0, 1).copy()
    near, room = index - first, np.empty_like(out)
    horner(lambda power: powers[power].take(near, 0, room, "clip").reshape(-1), len(powers), u, derivative, out)


def horner(term: Callable[[int], Array], order: int, u: Array, derivative: int, out: Array) -> None:
    """Horner's rule, the operations of `evaluate` in their order.

    Args:
        term: Gives the coefficients of a power, (k n,).
        order: Number of powers.
        u: Times since the segments' starts [s], (k,).
        derivative: Order of the time derivative.
        out: Where the values go, (k, n), rows without gaps.
    """
    if order <= derivative:
        out[...] = 0.0
        return
    x, values = u.repeat(out.shape[1]), out.reshape(-1)
    values[...] = term(order - 1)
    if derivative:
        values *= math.perm(order - 1, derivative)
    for power in range(order - 2, derivative - 1, -1):
        values *= x
        values += term(power) * math.perm(power, derivative) if derivative else term(power)
