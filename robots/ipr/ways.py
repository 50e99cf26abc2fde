"""Where a robot or a person can go in a room, and the shortest ways that keep away from things."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots.bullet.rooms import Room
from robots.ipr.floor_plan import FloorPlan
from vrs.errors import InvalidValueError
from vrs.model import Array

CELL = 0.05
"""Side of a cell [m]."""
_COMFORT = 0.35
"""So much farther from things than need be, a way costs no more [m]."""


class Ways:
    """The free part of a room, for somebody of a radius; what stands at time 0 counts."""

    def __init__(self, room: Room, radius: float, *, start: tuple[float, float] | None = None) -> None:
        """Work out where there's room enough.

        Args:
            room: Walls and things, known or not; people don't count.
            radius: Of who goes there [m].
            start: Only what can be reached from here [m]; else the largest part that hangs together.

        Raises:
            InvalidValueError: If nothing is free.
        """
        from scipy.ndimage import distance_transform_edt, label

        shape = math.ceil(room.length / CELL - 1e-9), math.ceil(room.width / CELL - 1e-9)
        standing = Room(room.name, room.length, room.width, room.start, room.blocks, room.columns)
        taken = FloorPlan(standing).grid(CELL, shape, 0.0)
        outside = np.pad(taken, 1, constant_values=True)
        self.clearance: Array = distance_transform_edt(~outside)[1:-1, 1:-1] * CELL
        """From each cell to the nearest that's taken [m]."""
        parts, count = label(self.clearance > radius, np.ones((3, 3)))
        if count == 0:
            raise InvalidValueError("room", room.name, f"one with room for {radius:g} m")
        part = int(np.argmax(np.bincount(parts.ravel())[1:])) + 1
        if start is not None and parts[self._cell(start, shape)]:
            part = int(parts[self._cell(start, shape)])
        self.free: NDArray[np.bool_] = parts == part
        """Which cells can be reached."""
        self._radius = radius
        self._graph = self._edges()

    @staticmethod
    def _cell(place: tuple[float, float], shape: tuple[int, int]) -> tuple[int, int]:
        i, j = (min(max(int(x / CELL), 0), n - 1) for x, n in zip(place, shape, strict=True))
        return i, j

    @property
    def places(self) -> Array:
        """Middles of the free cells [m], (k, 2)."""
        return np.asarray((np.argwhere(self.free) + 0.5) * CELL)

    def _edges(self) -> Any:
        """Neighbours with the length of the way, longer near things."""
        from scipy.sparse import coo_matrix

        m, n = self.free.shape
        number = np.arange(m * n).reshape(m, n)
        near = np.clip(self._radius + _COMFORT - self.clearance, 0.0, None) / _COMFORT
        cost = 1.0 + 4.0 * near
        rows, columns, ways = [], [], []
        for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):
            a = slice(0, m - di), slice(max(0, -dj), n - max(0, dj))
            b = slice(di, m), slice(max(0, dj), n + min(0, dj))
            both = self.free[a] & self.free[b]
            rows.append(number[a][both])
            columns.append(number[b][both])
            ways.append(CELL * math.hypot(di, dj) * 0.5 * (cost[a] + cost[b])[both])
        size = m * n
        pairs = np.concatenate(rows), np.concatenate(columns)
        return coo_matrix((np.concatenate(ways), pairs), shape=(size, size)).tocsr()

    def route(self, begin: tuple[float, float], end: tuple[float, float]) -> Array:
        """The way from the free cell nearest to one place to the one nearest to another [m], (k, 2)."""
        from scipy.sparse.csgraph import dijkstra

        first, last = self._nearest(begin), self._nearest(end)
        _, trees = dijkstra(self._graph, directed=False, indices=[last], return_predecessors=True)
        before = trees[0]
        cells = [first]
        while cells[-1] != last:
            cells.append(int(before[cells[-1]]))
        found = np.column_stack(np.unravel_index(cells, self.free.shape))
        return np.asarray((found + 0.5) * CELL)

    def _nearest(self, place: tuple[float, float]) -> int:
        cells = np.argwhere(self.free)
        off = (cells + 0.5) * CELL - place
        i, j = cells[int(np.argmin((off * off).sum(axis=1)))].tolist()
        return int(i * self.free.shape[1] + j)
