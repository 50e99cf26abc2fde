"""Rays in a grid of cells: where each one enters the first that is occupied, exactly and all at once.

A ray crosses a line of the grid at a distance that is known in advance, and enters the cell behind it. So the
crossings of all rays with all lines are looked up together, and the nearest in an occupied cell is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vrs.checks import finite, finite_array
from vrs.errors import InvalidValueError
from vrs.model import Array

_MOST = 4096
"""Cells along one side: what a hostile file can ask for."""


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Cells (m, n) of one size along x and y."""

    shape: tuple[int, int]
    """Cells along x and along y."""
    cell: float
    """Side of a cell [m]."""
    origin: Array
    """Lower left corner of cell (0, 0) in the world frame [m], (2,)."""

    def __init__(self, shape: tuple[int, int], cell: float, origin: ArrayLike = (0.0, 0.0)) -> None:
        allowed = f"two integers from 1 to {_MOST}"
        if len(shape) != 2 or not all(
            isinstance(k, int) and not isinstance(k, bool) and 1 <= k <= _MOST for k in shape
        ):
            raise InvalidValueError("shape", shape, allowed)
        if finite("cell", cell, "positive metres") <= 0:
            raise InvalidValueError("cell", cell, "positive metres")
        object.__setattr__(self, "shape", (shape[0], shape[1]))
        object.__setattr__(self, "cell", float(cell))
        object.__setattr__(self, "origin", finite_array("origin", origin, (2,), "two finite numbers"))

    def index(self, points: ArrayLike) -> NDArray[np.int64]:
        """Cells (m, n) of points (k, 2) [m], (k, 2); those of points outside lie outside the grid."""
        return np.floor((np.asarray(points, dtype=np.float64) - self.origin) / self.cell).astype(np.int64)

    def inside(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which of some cells (k, 2) are in the grid, (k,)."""
        within: NDArray[np.bool_] = np.logical_and.reduce((cells >= 0) & (cells < np.array(self.shape)), axis=-1)
        return within

    def corners(self, cells: ArrayLike) -> Array:
        """Lower left corners of cells (k, 2) [m], (k, 2)."""
        return self.origin + self.cell * np.asarray(cells, dtype=np.float64)


def cast(grid: Grid, occupied: NDArray[np.bool_], origin: ArrayLike, angles: ArrayLike, reach: float) -> Array:
    """Distances at which rays enter the first occupied cell.

    What lies outside the grid counts as free.

    Args:
        grid: The cells.
        occupied: Which of them are, (m, n).
        origin: Where the rays start, (x, y) in the world frame [m].
        angles: Directions in the world frame [rad], (k,).
        reach: How far they go [m], positive.

    Returns:
        [m], (k,): 0 where the origin's own cell is occupied, `reach` where nothing is met.

    Raises:
        InvalidValueError: If an argument isn't sound.
    """
    start = (finite_array("origin", origin, (2,), "two finite numbers") - grid.origin) / grid.cell
    directions = finite_array("angles", angles, None, "finite radians, shape (k,)")
    if directions.ndim != 1:
        raise InvalidValueError("angles", angles, "finite radians, shape (k,)")
    if finite("reach", reach, "positive metres") <= 0:
        raise InvalidValueError("reach", reach, "positive metres")
    cells = np.floor(start).astype(np.int64)
    if grid.inside(cells) and occupied[tuple(cells)]:
        return np.zeros(len(directions))
    ways = np.stack([np.cos(directions), np.sin(directions)])
    longest = reach / grid.cell
    nearest = np.full(len(directions), longest)
    for axis in (0, 1):
        along, across = ways[axis], ways[1 - axis]
        ahead = along > 0
        size, other = grid.shape[axis], grid.shape[1 - axis]
        # Lines are at whole coordinates; those out of reach aren't looked at.
        first, last = np.clip(np.floor((start[axis] - longest, start[axis] + longest + 1)), 0, size)
        lines = np.arange(first, last + 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (lines - start[axis]) / along[:, None]
            there = start[1 - axis] + distance * across[:, None]
        near = (distance >= 0) & (distance < longest)
        entered = np.where(ahead[:, None], lines, lines - 1)
        beside = np.floor(np.where(near, there, -1.0))
        near &= (entered >= 0) & (entered < size) & (beside >= 0) & (beside < other)
        ray, step = np.nonzero(near)
        place = entered[ray, step].astype(np.int64), beside[ray, step].astype(np.int64)
        hit = occupied[place if axis == 0 else place[::-1]]
        np.minimum.at(nearest, ray[hit], distance[ray[hit], step[hit]])
    return nearest * grid.cell
