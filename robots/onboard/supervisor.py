"""The virtual environment supervisor: tells new obstacles from the known map, and says which cells changed.

An echo says that something is on an arc across the sonar's cone, and that nothing is nearer in it. If the known map
has a wall there, within a tolerance for noise, for the cone's width and for the error of the robot's own position,
the echo is the wall's. Else the cells under the arc are occupied. What a cone looks clearly through is free: cells
that were told occupied are then told free.

What is told is bounded in rate: a cell that is seen all along is told again each `refresh` seconds, so that it
doesn't die of its lifetime; one that is free is told so a few times, as reports may be lost. Nothing else is kept.

Source: Han, Kim, Kim, Kim, 2001, section 3.2: "makes the decision whether or not the sensor information is about
obstacles, distinguishes new obstacles from the environment already known, and adds the new information".
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from robots.onboard.avoidance import Mounts, seen_from
from vrs.checks import finite, validated, within
from vrs.errors import InvalidValueError
from vrs.mobile.environment import Grid
from vrs.mobile.model import placed
from vrs.model import Array

_NEVER = -math.inf
_Index = Annotated[int, Meta(ge=0, le=2**63 - 1)]


class CellChange(NamedTuple):
    """What was seen of a cell."""

    cell: tuple[_Index, _Index]
    """(m, n) in the grid."""
    seen: Annotated[float, Meta(ge=-1e9, le=1e9)]
    """When it was last seen so, by the robot's clock [s]."""
    occupied: bool
    """To be added; else to be forgotten."""


@dataclass(frozen=True, slots=True)
@validated
class SupervisorConfig:
    """What the sonars are, and what is believed."""

    mounts: Mounts
    """As many as there are readings, 1 to 64."""
    half_cone: Annotated[float, within(0.01, 0.8)] = math.radians(12.5)
    """Half the sonar's cone [rad], in [0.01, 0.8]."""
    range_min: Annotated[float, within(0.0, 1.0)] = 0.1
    """Least reading [m], in [0, 1]: what is nearer reads as this."""
    range_max: Annotated[float, within(0.2, 20.0)] = 3.0
    """Readings from here on are of nothing [m], in [0.2, 20]."""
    tolerance: Annotated[float, within(0.0, 1.0)] = 0.08
    """How far from a known wall an echo may be and still be the wall's [m], in [0, 1]: position and noise."""
    tolerance_share: Annotated[float, within(0.0, 0.5)] = 0.025
    """And the share of the range that is added, in [0, 0.5]: five deviations of the noise that grows with it."""
    heading_error: Annotated[float, within(0.0, 0.5)] = math.radians(2.0)
    """By so much the cone is widened where known walls are looked for [rad], in [0, 0.5]."""
    depth: Annotated[float, within(0.0, 1.0)] = 0.15
    """How deep behind the arc cells are occupied [m], in [0, 1]: above √2 cells no cell is alone, which would die
    at once by eq. (17)."""
    clear_cone: Annotated[float, within(0.0, 1.0)] = 0.8
    """Share of the cone that is looked through, in [0, 1]: its edges are its neighbours', too."""
    silence: Annotated[int, within(1, 1000)] = 3
    """So many scans one after the other without an echo look clearly through as well, 1 to 1000."""
    refresh: Annotated[float, within(0.05, 60.0)] = 0.5
    """Least time between two tellings of one cell [s], in [0.05, 60]."""
    repeats: Annotated[int, within(1, 100)] = 3
    """How often it's told that a cell is free, 1 to 100."""
    memory: Annotated[float, within(0.0, 600.0)] = 16.0
    """For so long what was seen is kept [s], in [0, 600]: as long as a cell can live."""
    most: Annotated[int, within(1, 4096)] = 64
    """Most changes in a report, 1 to 4096."""
    most_kept: Annotated[int, within(1, 100000)] = 4096
    """Most cells that are kept, 1 to 100,000; there, those that were seen longest ago go first."""


@dataclass(slots=True)
class _Cell:
    seen: float
    occupied: bool
    told: float = _NEVER
    """When it was last told [s]."""
    times: int = 0
    """How often it was told as it is now."""
    told_seen: float = _NEVER
    """Which observation was told."""


class EnvironmentSupervisor:
    """Takes scans in, gives changes of cells out; it knows no clock. Times don't run back."""

    def __init__(self, grid: Grid, known: NDArray[np.bool_], config: SupervisorConfig) -> None:
        """Begin with the known map alone.

        Args:
            grid: The cells of the virtual environment.
            known: Which of them the known map has, as far as sonars see it, (m, n).
            config: Of sonars and belief.

        Raises:
            InvalidValueError: If the map isn't of the grid's shape.
        """
        if known.shape != grid.shape:
            raise InvalidValueError("known", known.shape, f"booleans of shape {grid.shape}")
        self._grid, self._config = grid, config
        self._walls = grid.corners(np.argwhere(known)) + grid.cell / 2
        self._mounts = np.array([(m.x, m.y, m.angle) for m in config.mounts], float)
        steps = math.ceil(2 * config.half_cone * config.range_max / (0.5 * grid.cell)) + 1
        self._bearings = np.linspace(-config.half_cone, config.half_cone, steps)
        self._depths = np.linspace(0.0, config.depth, math.ceil(config.depth / (0.5 * grid.cell)) + 1)
        self._silent = np.zeros(len(self._mounts), int)
        self._cells: dict[tuple[int, int], _Cell] = {}

    @property
    def obstacles(self) -> tuple[tuple[int, int], ...]:
        """Cells that are taken to be occupied beside the known map, in order."""
        return tuple(sorted(cell for cell, state in self._cells.items() if state.occupied))

    def hear(
        self, ranges: Sequence[float], posture: tuple[float, float, float], *, now: float
    ) -> NDArray[np.bool_]:
        """Take in a scan.

        Args:
            ranges: A distance for each sonar, in the order of the mounts [m]; NaN, infinity and what is at
                `range_max` or further say that it heard nothing.
            posture: Where the robot was, (x, y, θ) [m, m, rad].
            now: When it was taken [s].

        Returns:
            Which readings are echoes of something that the known map doesn't have.

        Raises:
            InvalidValueError: If the number of readings is wrong, or a time isn't finite.
        """
        config = self._config
        r = np.asarray(ranges, float)
        if r.shape != (len(self._mounts),):
            raise InvalidValueError("ranges", r.shape, f"{len(self._mounts)} distances")
        now = finite("now", now, "finite seconds")
        heard: NDArray[np.bool_] = np.isfinite(r) & (r < config.range_max)
        self._silent = np.where(heard, 0, self._silent + 1)
        self._drop(now)
        if not self._cells and not heard.any():
            return heard
        origins, angles = placed(self._mounts[:, :2], posture), self._mounts[:, 2] + posture[2]
        r = np.where(heard, np.maximum(r, config.range_min), config.range_max)
        sees = heard | (self._silent >= config.silence)
        self._look_through(origins[sees], angles[sees], r[sees], now)
        new = heard.copy()
        new[heard] = ~self._is_known(origins[heard], angles[heard], r[heard])
        if new.any():
            self._occupy(origins[new], angles[new], r[new], (origins[sees], angles[sees], r[sees]), now)
        return new

    def changes(self, *, now: float) -> tuple[CellChange, ...]:
        """What is to be told now [s], at most `most`: first what was never told, then what waits longest."""
        config = self._config
        due = [(state.told, cell) for cell, state in self._cells.items() if self._is_due(state, now)]
        due.sort()
        found = []
        for _, cell in due[: config.most]:
            state = self._cells[cell]
            state.told, state.times, state.told_seen = now, state.times + 1, state.seen
            found.append(CellChange(cell, state.seen, state.occupied))
            if not state.occupied and state.times >= config.repeats:
                del self._cells[cell]
        return tuple(found)

    def _is_due(self, state: _Cell, now: float) -> bool:
        if now - state.told < self._config.refresh - 1e-9:
            return False
        return not state.occupied or state.seen > state.told_seen

    def _tolerance(self, r: Array) -> Array:
        return self._config.tolerance + self._config.tolerance_share * r

    def _is_known(self, origins: Array, angles: Array, r: Array) -> NDArray[np.bool_]:
        """Whether the known map has something where an echo came from, for each, (k,)."""
        config, half = self._config, self._grid.cell * math.sqrt(0.5)
        if not len(self._walls) or not len(r):
            return np.zeros(len(r), bool)
        middle = origins.mean(axis=0)
        spread = float(np.abs(origins - middle).max()) * 2
        near = np.abs(self._walls - middle).max(axis=1) < float((r + self._tolerance(r)).max()) + half + spread
        distance, along = seen_from(origins, angles, self._walls[near])
        # As an angle, the cell reaches half its diagonal beyond the cone: cos(a + b), of a cone and of a cell.
        cone = config.half_cone + config.heading_error
        cell = np.minimum(half / np.maximum(distance, half), 1.0)
        edge = math.cos(cone) * np.sqrt(1 - cell * cell) - math.sin(cone) * cell
        there = np.abs(distance - r) <= half + self._tolerance(r)
        return np.asarray((there & (along >= edge * distance)).any(axis=0))

    def _is_clear(self, points: Array, origins: Array, angles: Array, r: Array) -> NDArray[np.bool_]:
        """Which cells, by their middles (k, 2), a sonar looks clearly through, (k,)."""
        config, half = self._config, self._grid.cell * math.sqrt(0.5)
        if not len(points) or not len(r):
            return np.zeros(len(points), bool)
        distance, along = seen_from(origins, angles, points)
        inside = along >= math.cos(config.clear_cone * config.half_cone) * distance
        clear = inside & (distance + half < r - self._tolerance(r))
        return np.asarray(clear.any(axis=1))

    def _look_through(self, origins: Array, angles: Array, r: Array, now: float) -> None:
        held = [cell for cell, state in self._cells.items() if state.occupied]
        if not held:
            return
        points = self._grid.corners(held) + self._grid.cell / 2
        for k in np.flatnonzero(self._is_clear(points, origins, angles, r)).tolist():
            state = self._cells[held[k]]
            state.seen, state.occupied, state.times = now, False, 0

    def _occupy(
        self, origins: Array, angles: Array, r: Array, clear: tuple[Array, Array, Array], now: float
    ) -> None:
        """Take the cells under each arc as occupied, but those that another sonar looks through."""
        bearing = angles[:, None, None] + self._bearings[:, None]
        reach = r[:, None, None] + self._depths
        points = np.stack([reach * np.cos(bearing), reach * np.sin(bearing)], -1) + origins[:, None, None]
        for arc in self._grid.index(points.reshape(len(r), -1, 2)):
            cells = np.unique(arc[self._grid.inside(arc)], axis=0)
            free = self._is_clear(self._grid.corners(cells) + self._grid.cell / 2, *clear)
            # The echo came from somewhere: if all were looked through, none was.
            for m, n in (cells if free.all() else cells[~free]).tolist():
                state = self._cells.get((m, n))
                if state is None:
                    state = self._cells[m, n] = _Cell(now, True)
                elif not state.occupied:
                    state.times = 0
                state.seen, state.occupied = now, True

    def _drop(self, now: float) -> None:
        """Forget what is too old to matter, and what there's no room for."""
        config, cells = self._config, self._cells
        for cell in [cell for cell, state in cells.items() if now - state.seen > config.memory]:
            del cells[cell]
        if len(cells) > config.most_kept:
            oldest = sorted(cells, key=lambda cell: cells[cell].seen)
            for cell in oldest[: len(cells) - config.most_kept]:
                del cells[cell]
