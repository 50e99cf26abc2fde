"""Polynomials of a timeline at one time or at many: coefficients as bytes, power sums, stacks."""

from __future__ import annotations

import math
import weakref
from array import array
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Sequence
from struct import unpack
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from vrs.model import Array
from vrs.segment import evaluate
from vrs.tree import Node, first_start

QUICK_ORDER = 4
"""Rows of coefficients up to which a sample makes no array but its result; where there are fewer, zeros follow."""

STACKS = 128
"""Stacks that are kept in all, the oldest dropped first: 0.1 GB of cubic segments of six joints."""

INDEXES = 512
"""Indexes that are kept in all, the oldest dropped first: 0.3 GB of cubic segments of six joints."""

_CELLS = 4
"""Cells of an index a segment."""

_DOUBLE = np.dtype(np.float64)

Product: TypeAlias = Callable[[Array], Array]

Cursor: TypeAlias = tuple[float, float, Product, Array, "array[float]", Product, Product]
"""A segment to be sampled, for one caller at a time: its start; the start of the next; what makes the value from
its coefficients, and these; the buffer of 1, u, u² and u³ that this reads; what does so for few coefficients, and
for many."""

Columns: TypeAlias = tuple[float, float, "array[float]", "array[int]", Any]
"""An index: start of the first segment [s]; cells of the grid a second; starts [s], then NaN; how many start before
each cell, or with it; the coefficients of each segment."""

Places: TypeAlias = tuple["array[float]", list["Index"], list[Node]]
"""The nodes of height 1: when the first segment of each starts [s], their indexes, and themselves."""

Floats: TypeAlias = Sequence[float]

_Integers: TypeAlias = NDArray[np.int64]

_stacked: deque[weakref.ref[Node]] = deque()
_indexed: deque[weakref.ref[Index]] = deque()


def idle_cursor(n: int) -> Cursor:
    """A cursor for n joints, at no segment."""
    powers = array("d", (1.0, 0.0, 0.0, 0.0))
    few: Product = np.frombuffer(powers).dot

    def many(coefficients: Array) -> Array:
        return power_sum(coefficients, powers[1])

    return math.inf, -math.inf, few, np.zeros((QUICK_ORDER, n)), powers, few, many


def rows_of(row: bytes, n: int) -> Array:
    """The coefficients in a leaf's row, (degree + 1, n), read-only."""
    return np.ndarray((len(row) // (8 * n), n), _DOUBLE, row)


def filled_rows(row: bytes, n: int) -> Array:
    """The same with zeros for missing powers, QUICK_ORDER rows at least."""
    return rows_of(row.ljust(8 * n * QUICK_ORDER, b"\0"), n)


def power_sum(coefficients: Array, u: float) -> Array:
    """Polynomials at u: the product of 1, u, u² and so on with coefficients (K, n)."""
    power, powers = u, [1.0]
    for _ in range(len(coefficients) - 1):
        powers.append(power)
        power *= u
    value: Array = np.array(powers).dot(coefficients)
    return value


def state_of(row: bytes, n: int, u: float) -> tuple[Floats, Floats, Floats]:
    """Position, velocity and acceleration, n values each, of the polynomials in a leaf's row at u [s]."""
    values = unpack(f"{len(row) // 8}d", row)
    last = len(values) - n
    q: Floats = values[last:]
    qd: Floats = (0.0,) * n
    qdd: Floats = qd
    # By Horner's rule; for few joints plain floats are quicker than arrays.
    for k in range(last - n, -1, -n):
        qdd = [x * u + y for x, y in zip(qdd, qd, strict=True)]
        qd = [x * u + y for x, y in zip(qd, q, strict=True)]
        q = [x * u + y for x, y in zip(q, values[k : k + n], strict=True)]
    return q, qd, [2.0 * x for x in qdd]


def first_state(row: bytes, n: int) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration, (n,) each, where the polynomials in a leaf's row begin."""
    q, qd, half = np.frombuffer(row.ljust(24 * n, b"\0")[: 24 * n]).reshape(3, n)
    return q, qd, 2.0 * half


def settled(row: bytes, n: int, u: float) -> Array:
    """Position, velocity and acceleration (3, n) of a leaf's row at u [s], without what rounding leaves of rest.

    Polynomials of degree 2 at most leave no acceleration behind at rest.
    """
    q, qd, qdd = state_of(row, n, u)
    qd = [0.0 if -1e-11 < x < 1e-11 else x for x in qd]
    still = len(row) < 32 * n and not any(qd)
    qdd = [0.0 if still or -1e-9 < x < 1e-9 else x for x in qdd]
    return np.array((*q, *qd, *qdd)).reshape(3, -1)


class Stack:
    """Polynomials of all segments below a node of height 1, in arrays, for many times at once."""

    __slots__ = ("_absolute", "_blocks", "_class_of", "_offsets", "_place", "_sizes", "_starts")

    def __init__(self, node: Node, n: int) -> None:
        leaves = node.children
        self._offsets = np.frombuffer(node.offsets)
        self._sizes: _Integers = np.array([leaf.count for leaf in leaves])
        self._starts = np.frombuffer(b"".join(leaf.starts for leaf in leaves))
        self._absolute: tuple[float, Array] = (math.nan, self._starts)
        rows = [row for leaf in leaves for row in leaf.rows]
        orders = np.fromiter(map(len, rows), np.int64, len(rows)) // (8 * n)
        # Orders of one class are filled up to the highest of it: 1 to 4, 5 to 8, 9 to 16, and so on.
        classes = np.maximum(np.ceil(np.log2(orders)), 2).astype(np.int8)
        names, self._class_of = np.unique(classes, return_inverse=True)
        self._place: _Integers = np.empty(len(rows), np.int64)
        self._blocks: list[Array] = []
        for name in range(len(names)):
            members = np.flatnonzero(self._class_of == name)
            self._place[members] = np.arange(len(members))
            block = np.zeros((int(orders[members].max()), len(members), n))
            for order in np.unique(orders[members]).tolist():
                same = np.flatnonzero(orders[members] == order)
                joined = np.frombuffer(b"".join([rows[i] for i in members[same].tolist()]))
                block[:order, same] = joined.reshape(len(same), order, n).transpose(1, 0, 2)
            self._blocks.append(block)

    def fill(self, t: Array, offset: float, derivative: int, out: Array) -> None:
        """Write the values at times (k,), none before the first segment, into `out`, (k, n).

        Args:
            t: Times [s], sorted.
            offset: The node's summed offset [s].
            derivative: Order of the time derivative.
            out: Where the values go.
        """
        known, starts = self._absolute
        if known != offset:
            starts = np.repeat(offset + self._offsets, self._sizes) + self._starts
            self._absolute = (offset, starts)
        index = _sorted_into(starts, t)
        u = t - starts.take(index)
        if len(self._blocks) == 1:
            _horner(self._blocks[0], index, u, derivative, out)
            return
        class_of, place = self._class_of.take(index), self._place.take(index)
        for name, block in enumerate(self._blocks):
            chosen = np.flatnonzero(class_of == name)
            if len(chosen):
                values = np.empty((len(chosen), out.shape[1]))
                _horner(block, place.take(chosen), u.take(chosen), derivative, values)
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
        _indexed.append(weakref.ref(self))
        while len(_indexed) > INDEXES:
            oldest = _indexed.popleft()()
            if oldest is not None:
                # What doesn't fit in is made again seldom, so that making it doesn't cost more than it saves.
                oldest.columns, oldest.missed = None, -1000
        return columns


def _columns(node: Node, offset: float, n: int) -> Columns:
    leaves = node.children
    shifts = zip(node.offsets, leaves, strict=True)
    starts = np.concatenate([(offset + shift) + np.frombuffer(leaf.starts) for shift, leaf in shifts])
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
    firsts = array("d", [first_start(node, 1, offset) for node, offset in level])
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
        _stacked.append(weakref.ref(node))
        while len(_stacked) > STACKS:
            oldest: Any = _stacked.popleft()()
            if oldest is not None:
                oldest.stack = None
    return stack


def sample_many(
    root: Node,
    height: int,
    span: tuple[float, float],
    held: tuple[Array, Array],
    find: Callable[[float], tuple[float, float, Array]],
    t: Array,
    derivative: int,
) -> Array:
    """Values at many times, by Horner's rule.

    Args:
        root: The tree.
        height: Levels of nodes above its leaves.
        span: Its start and its end [s].
        held: Positions before it and after it, each (n,).
        find: Gives a segment's start, the next one's, and the coefficients, for a time in the span.
        t: Times [s], (k,), in any order.
        derivative: Order of the time derivative.

    Returns:
        Values (k, n).
    """
    places = None if (t[1:] >= t[:-1]).all() else np.argsort(t)
    if places is not None:
        t = t[places]
    values = np.empty((len(t), len(held[0])))
    begin, stop = t.searchsorted(span).tolist()
    values[:begin] = 0.0 if derivative else held[0]
    values[stop:] = 0.0 if derivative else held[1]
    if begin < stop:
        _fill(root, height, 0.0, find, t[begin:stop], derivative, values[begin:stop])
    if places is None:
        return values
    result = np.empty_like(values)
    result[places] = values
    return result


def _fill(
    node: Any,
    height: int,
    offset: float,
    find: Callable[[float], tuple[float, float, Array]],
    t: Array,
    derivative: int,
    out: Array,
) -> None:
    """Write the values at sorted times that lie in a node, none before its first segment, into `out`."""
    if height == 1:
        n = out.shape[1]
        stack = stack_of(node, n, len(t))
        if stack is not None:
            stack.fill(t, offset, derivative, out)
            return
        for row, x in zip(out, t.tolist(), strict=True):
            start, _, coefficients = find(x)
            row[:] = evaluate(coefficients, x - start, derivative)
        return

    def first(child: int) -> float:
        return first_start(node.children[child], height - 1, offset + node.offsets[child])

    # `firsts` is rounded: the comparison that counts is the one with the start itself.
    child = min(bisect_right(node.firsts, float(t[0]) - offset), len(node.children) - 1)
    while first(child) > t[0]:
        child -= 1
    done = 0
    while done < len(t):
        stop = int(t.searchsorted(first(child + 1))) if child + 1 < len(node.children) else len(t)
        if done < stop:
            part = slice(done, stop)
            inner = offset + node.offsets[child]
            _fill(node.children[child], height - 1, inner, find, t[part], derivative, out[part])
            done = stop
        child += 1


def _sorted_into(starts: Array, t: Array) -> _Integers:
    """Index of the last start that isn't after each of the sorted times, none before the first start."""
    low, high = (starts.searchsorted((t[0], t[-1]), "right") - (1, 0)).tolist()
    if high - low > len(t):
        found: _Integers = starts.searchsorted(t, "right") - 1
        return found
    # Many times a segment: it's quicker to search the starts among the times.
    edges = t.searchsorted(starts[low + 1 : high]).tolist()
    return np.repeat(np.arange(low, high), np.diff([0, *edges, len(t)]))


def _horner(block: Array, index: _Integers, u: Array, derivative: int, out: Array) -> None:
    """Horner's rule, the operations of `evaluate` in their order, on rows of a block (K, m, n)."""
    order, _, n = block.shape
    if order <= derivative:
        out[...] = 0.0
        return
    x, term = np.repeat(u, n).reshape(-1, n), np.empty_like(out)
    block[order - 1].take(index, 0, out, "clip")
    if derivative:
        out *= math.perm(order - 1, derivative)
    for power in range(order - 2, derivative - 1, -1):
        out *= x
        block[power].take(index, 0, term, "clip")
        if derivative:
            term *= math.perm(power, derivative)
        out += term
