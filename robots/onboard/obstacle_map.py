"""What stands in a building beside its map, from laser scans: where, since when, and what of it moves.

A grid of cells. A beam that ends in one, and not at a known thing, says that something is there; beams that go on
behind all of one say that nothing is. A cell that was seen free and then isn't is somebody who moves until it has
been occupied for a while; one that was never seen free stands. What stands is remembered until it's looked through.

Source: occupancy grids after Moravec, Elfes, *High resolution maps from wide angle sonar*, 1985, with times instead
of probabilities, as a laser's beams are narrow.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from robots.onboard.laser import LaserScan, OdometryTrack, beam_angles, deskewed
from vrs.checks import validated, within
from vrs.mobile.environment import Grid
from vrs.mobile.model import all_wrapped, placed
from vrs.model import Array

Bools = NDArray[np.bool_]
_WIDTHS = (1, 3, 5, 9, 17, 33, 65)
"""Beams that a cell covers are looked at in such numbers."""
_APART = 0.2
"""Beams side by side that end further from one another end at two things [m]."""
_MOST_MEAN = 20.0
"""So many hits are averaged."""


@dataclass(frozen=True, slots=True)
@validated
class ObstacleMapConfig:
    """What is believed, and for how long."""

    reach: Annotated[float, within(0.5, 20.0)] = 5.0
    """What is further from the robot isn't taken in [m], in [0.5, 20]."""
    tolerance: Annotated[float, within(0.0, 1.0)] = 0.07
    """A beam that ends so near to a known thing ends at it [m], in [0, 1]: noise, and errors of the posture."""
    behind: Annotated[float, within(0.0, 1.0)] = 0.06
    """A beam that goes on so far behind a cell has gone through it [m], in [0, 1]."""
    settled: Annotated[float, within(0.0, 60.0)] = 2.5
    """What has been where it is for so long stands [s], in [0, 60]."""
    fleeting: Annotated[float, within(0.0, 60.0)] = 1.5
    """What moves is remembered for so long [s], in [0, 60]."""
    memory: Annotated[float, within(0.0, 86400.0)] = 180.0
    """And what stands, where it isn't looked at any more [s], in [0, 86400]."""
    widest: Annotated[float, within(0.1, 5.0)] = 0.9
    """What moves and is wider isn't a person [m], in [0.1, 5]."""
    thick: Annotated[float, within(0.0, 1.0)] = 0.14
    """The middle of somebody is so far behind the middle of what is seen of him [m], in [0, 1]."""


class ObstacleMap:
    """Takes scans in, says what stands and what moves; it knows no clock. Times don't run back."""

    def __init__(
        self, grid: Grid, knows: Callable[[Array], Bools], config: ObstacleMapConfig | None = None
    ) -> None:
        """Begin with the known map alone.

        Args:
            grid: Cells, 5 cm wide or so.
            knows: Which places (k, 2) [m] belong to known things, (k,).
            config: What is believed.
        """
        self._grid, self._knows = grid, knows
        self._config = ObstacleMapConfig() if config is None else config
        shape = grid.shape
        self._since = np.full(shape, np.nan)
        """From when on a cell has been occupied [s]; nan while it isn't."""
        self._last = np.full(shape, -math.inf)
        self._free = np.full(shape, -math.inf)
        """When a cell was last seen free [s]."""
        self._moves = np.zeros(shape, bool)
        """Whether it had been seen free when it became occupied."""
        self._count = np.zeros(shape)
        self._mean = np.zeros((*shape, 2))
        """Of the places that beams ended at in a cell [m]."""
        self._movers: list[tuple[float, float]] = []

    def see(self, scan: LaserScan, odometry: OdometryTrack, posture: tuple[float, float, float]) -> None:
        """Take in a scan.

        Args:
            scan: One sweep that the odometry covers.
            odometry: Its readings until now.
            posture: Where the robot is at the last of them, (x, y, θ) [m, m, rad].
        """
        points, now = deskewed(scan, odometry), odometry.time
        ahead = points.origins.mean(axis=0) if len(points.origins) else np.array([scan.forward, 0.0])
        origin = placed(ahead, posture)
        count = len(scan.ranges)
        bearings = beam_angles(count)
        if len(points.beams):
            skewed = np.arctan2(points.ways[:, 1], points.ways[:, 0]) - bearings[points.beams]
            bearings = bearings + np.interp(np.arange(count), points.beams, skewed)
        self._look_through(origin, bearings + posture[2], _filled(scan.ranges, self._config.reach), now)
        places = placed(points.places, posture)
        near = (points.ranges < self._config.reach) & self._grid.inside(self._grid.index(places))
        new = np.zeros(len(places), bool)
        new[near] = ~self._knows(places[near])
        self._occupy(places[new], now)
        self._forget(now)
        moving = np.zeros(len(places), bool)
        cells = self._grid.index(places[new])
        moving[new] = self._is_moving(now)[cells[:, 0], cells[:, 1]]
        self._movers = self._grouped(places, points.beams, moving, origin)

    @property
    def movers(self) -> list[tuple[float, float]]:
        """Middles of what moved in the last scan, as large as people [m]."""
        return list(self._movers)

    def standing(self, now: float) -> Array:
        """Places of what stands there beside the known map [m], (k, 2): one a cell."""
        return np.asarray(self._mean[np.isfinite(self._since) & ~self._is_moving(now)])

    def places(self) -> Array:
        """The same of everything, also of what moves [m], (k, 2)."""
        return np.asarray(self._mean[np.isfinite(self._since)])

    def was_free(self, places: Array) -> Bools:
        """Which places (k, 2) [m] were seen free when they were seen last, (k,); what wasn't seen wasn't."""
        cells = self._grid.index(places)
        found = self._grid.inside(cells)
        i, j = cells[found].T
        found[found] = np.isnan(self._since[i, j]) & (self._free[i, j] > -math.inf)
        return found

    def _is_moving(self, now: float) -> Bools:
        with np.errstate(invalid="ignore"):
            found: Bools = self._moves & (now - self._since < self._config.settled)
        return found

    def _look_through(self, origin: Array, bearings: Array, ranges: Array, now: float) -> None:
        """Free the cells behind all of which beams go on."""
        from scipy.ndimage import minimum_filter1d

        config, grid = self._config, self._grid
        low = np.maximum(grid.index(origin - config.reach), 0)
        high = np.minimum(grid.index(origin + config.reach) + 1, grid.shape)
        if (high <= low).any():
            return
        window = np.s_[low[0] : high[0], low[1] : high[1]]
        at = np.array(grid.origin)
        dx = (at[0] + (np.arange(low[0], high[0]) + 0.5) * grid.cell - origin[0])[:, None]
        dy = (at[1] + (np.arange(low[1], high[1]) + 0.5) * grid.cell - origin[1])[None, :]
        far = np.hypot(dx, dy)
        middle = len(bearings) // 2
        ahead = all_wrapped(np.arctan2(dy, dx) - bearings[middle]) + bearings[middle]
        beam = np.clip(np.searchsorted(bearings, ahead), 0, len(bearings) - 1)
        step = (bearings[-1] - bearings[0]) / (len(bearings) - 1)
        # A cell's half diagonal, as an angle, in beams on either side of its middle.
        wide = 2 * np.ceil(0.71 * grid.cell / np.maximum(far, grid.cell) / step) + 1
        level = np.minimum(np.searchsorted(_WIDTHS, wide), len(_WIDTHS) - 1)
        least = np.stack([minimum_filter1d(ranges, n, mode="nearest") for n in _WIDTHS])
        seen = (ahead >= bearings[0]) & (ahead <= bearings[-1]) & (far < config.reach)
        free = seen & (least[level, beam] > far + config.behind)
        self._free[window][free] = now
        self._since[window][free] = np.nan

    def _occupy(self, places: Array, now: float) -> None:
        if not len(places):
            return
        cells, which = np.unique(self._grid.index(places), axis=0, return_inverse=True)
        hits = np.bincount(which.ravel()).astype(float)
        mean = np.column_stack([np.bincount(which.ravel(), places[:, k]) for k in (0, 1)]) / hits[:, None]
        i, j = cells.T
        fresh = np.isnan(self._since[i, j])
        self._count[i[fresh], j[fresh]] = 0.0
        self._moves[i[fresh], j[fresh]] = self._free[i[fresh], j[fresh]] > -math.inf
        self._since[i[fresh], j[fresh]] = now
        self._last[i, j] = now
        count = np.minimum(self._count[i, j] + hits, _MOST_MEAN)
        share = (np.minimum(hits, _MOST_MEAN) / count)[:, None]
        self._mean[i, j] = (1 - share) * self._mean[i, j] + share * mean
        self._count[i, j] = count

    def _forget(self, now: float) -> None:
        config = self._config
        with np.errstate(invalid="ignore"):
            fleeting = self._moves & (self._last - self._since < config.settled)
        self._since[now - self._last > np.where(fleeting, config.fleeting, config.memory)] = np.nan

    def _grouped(
        self, places: Array, beams: NDArray[np.int64], moving: Bools, origin: Array
    ) -> list[tuple[float, float]]:
        """Middles of what moves, beam by beam."""
        k = np.flatnonzero(moving)
        if not len(k):
            return []
        apart = (np.hypot(*np.diff(places[k], axis=0).T) > _APART) | (np.diff(beams[k]) > 10)
        found = []
        for group in np.split(places[k], np.flatnonzero(apart) + 1):
            if len(group) < 2 or math.dist(group[0], group[-1]) > self._config.widest:
                continue
            middle = group.mean(axis=0)
            way = (middle - origin) / max(math.dist(middle, origin), 1e-9)
            found.append(
                (float(middle[0] + self._config.thick * way[0]), float(middle[1] + self._config.thick * way[1]))
            )
        return found


def _filled(ranges: Array, reach: float) -> Array:
    """Ranges with single beams that brought nothing taken for their neighbours; many side by side saw nothing."""
    padded = np.pad(ranges, 2, mode="edge")
    around = np.min(np.stack([padded[k : k + len(ranges)] for k in range(5)]), axis=0)
    found: Array = np.where(np.isfinite(ranges), ranges, np.where(np.isfinite(around), around, reach))
    return found
