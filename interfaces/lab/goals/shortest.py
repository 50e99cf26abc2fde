"""The shortest way for a disc through a room, worked out without the robot's own map: the yardstick of its routes.

A fine grid with the distance to the nearest thing, Dijkstra between neighbours, then corners cut wherever the
straight line keeps its distance.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from robots.bullet.rooms import Room
from robots.ipr.floor_plan import FloorPlan
from vrs.model import Array

CELL = 0.025
"""Side of a cell [m]."""
_NEIGHBOURS = ((1, 0), (0, 1), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1))


class Shortest:
    """Shortest ways in a room as it stands at a time, for a disc."""

    def __init__(self, room: Room, radius: float, t: float = 0.0) -> None:
        """Measure how far everything is from things.

        Args:
            room: Walls, things and doors; people count as well.
            radius: Of the disc [m].
            t: Time [s].
        """
        from scipy.ndimage import distance_transform_edt

        shape = math.ceil(room.length / CELL - 1e-9), math.ceil(room.width / CELL - 1e-9)
        taken = np.pad(FloorPlan(room).grid(CELL, shape, t), 1, constant_values=True)
        # From middle to middle: a thing's edge is half a cell nearer.
        clearance: Array = distance_transform_edt(~taken)[1:-1, 1:-1] * CELL - CELL / 2
        self._free = clearance >= radius
        self._graph = self._edges()

    def length(self, begin: tuple[float, float], end: tuple[float, float]) -> float:
        """Of the shortest way from place to place [m]; infinite if there's none."""
        from scipy.sparse.csgraph import dijkstra

        first, last = self._cell(begin), self._cell(end)
        if not (self._free[first] and self._free[last]):
            return math.inf
        m = self._free.shape[1]
        source, target = first[0] * m + first[1], last[0] * m + last[1]
        ways, before = dijkstra(self._graph, directed=False, indices=source, return_predecessors=True)
        if not math.isfinite(ways[target]):
            return math.inf
        cells = [target]
        while cells[-1] != source:
            cells.append(int(before[cells[-1]]))
        places = np.column_stack(np.divmod(cells[::-1], m)).astype(float)
        return min(float(ways[target]), self._cut(places))

    def _cell(self, place: tuple[float, float]) -> tuple[int, int]:
        i, j = (min(max(int(x / CELL), 0), n - 1) for x, n in zip(place, self._free.shape, strict=True))
        return i, j

    def _edges(self) -> Any:
        from scipy.sparse import coo_matrix

        m, n = self._free.shape
        number = np.arange(m * n).reshape(m, n)
        rows, columns, ways = [], [], []
        for di, dj in _NEIGHBOURS:
            a = slice(0, m - di), slice(max(0, -dj), n - max(0, dj))
            b = slice(di, m), slice(max(0, dj), n + min(0, dj))
            both = self._free[a] & self._free[b]
            rows.append(number[a][both])
            columns.append(number[b][both])
            ways.append(np.full(int(both.sum()), CELL * math.hypot(di, dj)))
        pairs = np.concatenate(rows), np.concatenate(columns)
        return coo_matrix((np.concatenate(ways), pairs), shape=(m * n, m * n)).tocsr()

    def _cut(self, places: Array) -> float:
        """Length of a way of cells with its corners cut, each as far on as can be seen [m]."""
        total, k = 0.0, 0
        while k < len(places) - 1:
            low, high = k + 1, len(places) - 1
            while low < high:
                middle = (low + high + 1) // 2
                low, high = (middle, high) if self._sees(places[k], places[middle]) else (low, middle - 1)
            total += CELL * math.dist(places[k], places[low])
            k = low
        return total

    def _sees(self, a: Array, b: Array) -> bool:
        count = max(2, math.ceil(2 * math.dist(a, b)))
        i, j = np.rint(np.linspace(a, b, count)).astype(int).T
        return bool(self._free[i, j].all())
