"""The virtual environment: cells that are walls, and cells that were seen occupied and are forgotten in time.

C_mn is 1 while its lifetime L_mn = exp(−(t − t_0)/(γ C^S_mn)) is above L_TH, eq. (16)–(17): for γ C^S_mn
ln(1/L_TH) seconds. C^S_mn, the number of occupied cells among its neighbours, is counted as it is at t: when a
neighbour dies, what depends on it lives shorter. A cell without neighbours dies at once, which is the limit of eq.
(17) for C^S_mn → 0. A dead cell stays dead until it's seen again.

The sums of eq. (17) end at the borders: a cell there has five neighbours, one in a corner three. Walls count as
neighbours and never die.

Source: Han, Kim, Kim, Kim, 2001, section 3.2.

Rays in the grid enter the first cell that is occupied, exactly and all at once. A ray crosses a line of the grid
at a distance that is known in advance, and enters the cell behind it. So the crossings of all rays with all lines
are looked up together, and the nearest in an occupied cell is taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from heapq import heappop, heappush

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


SHAPE = (125, 61)
"""m × n cells along x and y; the paper's."""
CELL = 0.1
"""Side of a cell [m], an assumption: the paper's 125 × 61 cells are then a room of 12.5 m × 6.1 m."""
GAMMA = 2.0
"""γ [s], an assumption: with L_TH below, the seconds that each occupied neighbour lets a cell live."""
THRESHOLD = math.exp(-1.0)
"""L_TH, an assumption: where a lifetime has fallen by one time constant."""

Bools = NDArray[np.bool_]
_Index = tuple[int, int]


class VirtualEnvironment:
    """Cells (m, n) of one size; cell (0, 0) has its lower left corner at the origin. Time doesn't run back.

    A state machine: each call with a time takes it there first.
    """

    def __init__(
        self,
        shape: tuple[int, int] = SHAPE,
        *,
        cell: float = CELL,
        origin: ArrayLike = (0.0, 0.0),
        walls: ArrayLike | None = None,
        gamma: float = GAMMA,
        threshold: float = THRESHOLD,
    ) -> None:
        """Make an environment of which only the walls are known.

        Args:
            shape: Cells along x and along y.
            cell: Side of a cell [m].
            origin: Lower left corner (x, y) in the world frame [m].
            walls: Which cells are permanent, booleans of that shape; None for none.
            gamma: γ of eq. (17) [s], positive.
            threshold: L_TH of eq. (16), in (0, 1).

        Raises:
            InvalidValueError: If one of them isn't sound.
        """
        self.grid = Grid(shape, cell, origin)
        known = np.zeros(self.grid.shape, bool) if walls is None else np.array(walls)
        if known.shape != self.grid.shape or known.dtype != bool:
            raise InvalidValueError("walls", walls, f"booleans of shape {self.grid.shape}")
        known.flags.writeable = False
        self.walls: Bools = known
        """Permanent cells, (m, n)."""
        if finite("gamma", gamma, "positive seconds") <= 0:
            raise InvalidValueError("gamma", gamma, "positive seconds")
        if not 0 < finite("threshold", threshold, "in (0, 1)") < 1:
            raise InvalidValueError("threshold", threshold, "in (0, 1)")
        self._gamma = gamma
        self.per_neighbour = gamma * math.log(1.0 / threshold)
        """Seconds that a cell lives for each occupied neighbour."""
        self.now = -math.inf
        """The latest time that it was asked about [s]."""
        self._cells = known.copy()
        self._born: dict[_Index, float] = {}
        self._ends: list[tuple[float, _Index]] = []
        self._seen: Bools | None = None

    @property
    def longest(self) -> float:
        """The longest that a cell lives after it was last seen [s]."""
        return 8 * self.per_neighbour

    def occupied(self, t: float) -> Bools:
        """C at a time, (m, n), read-only; a value that later calls don't change.

        Args:
            t: [s], not before an earlier call's.

        Raises:
            InvalidValueError: If time runs back.
        """
        self._advance(t)
        if self._seen is None:
            self._seen = self._cells.copy()
            self._seen.flags.writeable = False
        return self._seen

    def lifetimes(self, t: float) -> Array:
        """L at a time, (m, n): 1 for walls, eq. (17) for cells that were seen, 0 elsewhere."""
        self._advance(t)
        values = self.walls.astype(np.float64)
        for index, born in self._born.items():
            neighbours = sum(bool(self._cells[near]) for near in self._around(index))
            values[index] = math.exp(-(t - born) / (self._gamma * neighbours))
        return values

    def obstacles(self, t: float) -> tuple[_Index, ...]:
        """Cells that are occupied at a time and aren't walls, in order."""
        self._advance(t)
        return tuple(sorted(self._born))

    def add(
        self, cells: Iterable[_Index], t: float, *, formed: Mapping[_Index, float] | None = None
    ) -> tuple[_Index, ...]:
        """Form cells that were seen occupied at a time, or let those that are there live anew.

        Cells of one call are formed together, so each counts as the others' neighbour. Walls stay walls.

        Args:
            cells: Their (m, n).
            t: [s], not before an earlier call's.
            formed: t_0 of cells that were seen earlier than at t, which is it for all others [s]. Of what a cell
                has already and what is given, the later counts.

        Returns:
            Those that weren't occupied before.

        Raises:
            InvalidValueError: If a cell isn't in the grid, a t_0 isn't finite or is after t, or time runs back;
                nothing is changed.
        """
        wanted = self._checked(cells)
        born = {index: t if formed is None else formed.get(index, t) for index in wanted}
        for at in born.values():
            if finite("formed", at, f"finite seconds up to {t:.9g}") > t:
                raise InvalidValueError("formed", at, f"finite seconds up to {t:.9g}")
        self._advance(t, before=True)
        new = []
        for index in wanted:
            if self.walls[index]:
                continue
            if index not in self._born:
                new.append(index)
                self._cells[index] = True
            self._born[index] = max(born[index], self._born.get(index, -math.inf))
        if new:
            self._seen = None
        for index in {*wanted, *(near for one in new for near in self._around(one))}:
            self._schedule(index)
        return tuple(new)

    def forget(self, cells: Iterable[_Index], t: float) -> tuple[_Index, ...]:
        """Free cells that were seen free at a time; walls stay.

        Returns:
            Those that were occupied before.

        Raises:
            InvalidValueError: If a cell isn't in the grid, or time runs back; nothing is changed.
        """
        wanted = self._checked(cells)
        self._advance(t, before=True)
        gone = [index for index in wanted if index in self._born]
        self._remove(gone)
        return tuple(gone)

    def cast(self, origin: ArrayLike, angles: ArrayLike, reach: float, t: float) -> Array:
        """Distances to the first occupied cell along rays at a time; see `vrs.mobile.environment.cast`."""
        return cast(self.grid, self.occupied(t), origin, angles, reach)

    def _checked(self, cells: Iterable[_Index]) -> dict[_Index, None]:
        m, n = self.grid.shape
        wanted: dict[_Index, None] = {}
        for cell in cells:
            p, q = cell
            if not (0 <= p < m and 0 <= q < n):
                raise InvalidValueError("cell", cell, f"within ({m}, {n})")
            wanted[int(p), int(q)] = None
        return wanted

    def _around(self, index: _Index) -> Iterable[_Index]:
        p, q = index
        m, n = self.grid.shape
        for a in range(max(p - 1, 0), min(p + 2, m)):
            for b in range(max(q - 1, 0), min(q + 2, n)):
                if (a, b) != index:
                    yield a, b

    def _end(self, index: _Index) -> float:
        """When a cell dies, as its neighbours are now [s]."""
        return self._born[index] + self.per_neighbour * sum(bool(self._cells[near]) for near in self._around(index))

    def _schedule(self, index: _Index) -> None:
        if index in self._born:
            heappush(self._ends, (self._end(index), index))

    def _remove(self, cells: Iterable[_Index]) -> None:
        removed = list(cells)
        for index in removed:
            del self._born[index]
            self._cells[index] = False
            self._seen = None
        for near in {near for index in removed for near in self._around(index)}:
            self._schedule(near)

    def _advance(self, t: float, *, before: bool = False) -> None:
        """Let die what dies by a time; with `before`, what dies at that very time may still be seen anew."""
        if finite("t", t, "finite seconds") < self.now:
            raise InvalidValueError("t", t, f"not before {self.now:.9g} s: time doesn't run back")
        self.now = t
        ends = self._ends
        while ends and (ends[0][0] < t or (not before and ends[0][0] == t)):
            moment = ends[0][0]
            dying = set()
            while ends and ends[0][0] <= moment:
                end, index = heappop(ends)
                # Entries of cells that were seen again, or whose neighbours changed, are out of date.
                if index in self._born and self._end(index) <= end:
                    dying.add(index)
            self._remove(dying)
