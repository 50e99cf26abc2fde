"""A line map from a drive: the robot finds its place in the map so far, and puts into it what is new.

Posture and lines are estimated together (`LineFilter`, building), so that what the robot didn't know of its place
when it saw a line is in that line's doubt, and lines seen from one place share their errors. A new line goes into
the map when it was seen at one place several times over a while: who walks doesn't stay, and is too narrow. Lines
that prove to be one are merged; there's no smoothing over the whole drive afterwards.

Sources: Kim, Han, Kim, Kim 2002, section 3.1, which cites Kim and Kim 2001 for the building of the map; the joint
estimate after Smith, Self and Cheeseman 1990.

A robot that doesn't know where it is surveys: it gathers lines and beams in a frame of its own. The frame is where
it began. Its own movement since is followed with a line map that is built on the way, so that a turn on the spot
closes although its wheels are wrong.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from robots.onboard.global_localization import Surroundings
from robots.onboard.gsp_map import GspMap, Lines
from robots.onboard.laser import LaserScan
from robots.onboard.line_filter import LineFilter, Sights
from robots.onboard.localization import LocalizationConfig, Tracker
from vrs.checks import validated, within
from vrs.mobile import wrapped
from vrs.mobile.model import all_wrapped, placed, turned
from vrs.model import Array, frozen_array

_EXACT = 1e-12
"""Variance of a start that defines the frame [m², rad²]: numbers stay sound."""
_WAITING = 400
"""Sightings of new lines that are kept, at most."""


@dataclass(frozen=True, slots=True)
@validated
class BuildingConfig:
    """What comes into a map."""

    localization: LocalizationConfig = field(default_factory=LocalizationConfig)
    """Of the robot that builds it."""
    shortest: Annotated[float, within(0.1, 10.0)] = 0.5
    """Shorter lines stay out [m], in [0.1, 10]: a person is narrower."""
    sightings: Annotated[int, within(1, 100)] = 3
    """How often a line must have been seen, in [1, 100]."""
    lasting: Annotated[float, within(0.0, 60.0)] = 0.7
    """And over how long [s], in [0, 60]."""
    memory: Annotated[float, within(0.1, 600.0)] = 5.0
    """A sighting counts for so long [s], in [0.1, 600]."""
    turn: Annotated[float, within(1e-3, 1.0)] = 0.06
    """Two sightings of a new line differ by no more [rad], in [1e-3, 1]."""
    across: Annotated[float, within(1e-3, 1.0)] = 0.05
    """Nor by more across [m], in [1e-3, 1]."""
    gap: Annotated[float, within(0.0, 5.0)] = 0.3
    """Lines are merged across a gap of so much [m], in [0, 5]."""
    same: Annotated[float, within(0.1, 100.0)] = 9.2
    """And if they differ by less than this, squared and in their own doubt, in [0.1, 100]."""
    across_floor: Annotated[float, within(0.0, 0.1)] = 0.0005
    """What a line of the map is off across beside what the estimate says [m], in [0, 0.1]: wrong cuts don't average
    out."""
    turn_floor: Annotated[float, within(0.0, 0.1)] = 2e-4
    """And in direction [rad], in [0, 0.1]."""
    most: Annotated[int, within(1, 2000)] = 400
    """Lines of a map, 1 to 2000; then no new ones come."""


class MapBuilder(Tracker):
    """Builds a map while it follows its robot."""

    def __init__(
        self,
        posture: tuple[float, float, float] = (0.0, 0.0, 0.0),
        covariance: Array | None = None,
        config: BuildingConfig | None = None,
    ) -> None:
        """Begin without a line.

        Args:
            posture: Where the robot is in the map's frame, (x, y, θ) [m, m, rad].
            covariance: How well that is known, (3, 3); exactly, unless given.
            config: What comes into the map.
        """
        self._building = config = BuildingConfig() if config is None else config
        start = _EXACT * np.eye(3) if covariance is None else covariance
        empty = GspMap.of("built", Lines.none())
        super().__init__(empty, posture, start, config.localization, building=True)
        self._new: deque[tuple[float, Array]] = deque(maxlen=_WAITING)
        """When, and the pose and span of each new line that waits, (5,)."""

    def see(self, scan: LaserScan) -> bool:
        """Take in a scan; returns whether it was: not if it isn't new, or the odometry doesn't cover it yet."""
        taken = super().see(scan)
        if taken:
            self._grow()
        return taken

    def _grow(self) -> None:
        """Stretch what was recognised, and take in what is new and has lasted."""
        assert self.sights is not None
        self.filter.stretch(self.sights)
        fresh = self._fresh(self.seen, self.sights)
        placed = fresh.moved(self.posture)
        now, config = self.odometry.time, self._building
        while self._new and self._new[0][0] < now - config.memory:
            self._new.popleft()
        lasting = np.array(
            [self._lasted(now, pose, span) for pose, span in zip(placed.poses, placed.spans, strict=True)]
        )
        for pose, span in zip(placed.poses, placed.spans, strict=True):
            self._new.append((now, np.concatenate([pose, span])))
        if len(fresh) and lasting.any() and len(self.filter.lines) + int(lasting.sum()) <= config.most:
            self.filter.add(fresh.taken(lasting))
            merge(self.filter, config)

    def _fresh(self, seen: Lines, sights: Sights) -> Lines:
        """Lines that aren't in the map, nor nearly."""
        long = seen.lengths >= self._building.shortest
        used = {tuple(pose) for pose in sights.lines.poses.tolist()}
        new = np.array([tuple(pose) not in used for pose in seen.poses.tolist()], dtype=np.bool_)
        return seen.taken(np.flatnonzero(long & new))

    def _lasted(self, now: float, pose: Array, span: Array) -> bool:
        """Whether a line was seen here often enough and for long enough."""
        config = self._building
        x, y, theta = pose.tolist()
        c, s = math.cos(theta), math.sin(theta)
        count, first = 1, now
        for t, (ox, oy, other, low, high) in self._new:
            along, off = c * (ox - x) + s * (oy - y), c * (oy - y) - s * (ox - x)
            if abs(wrapped(other - theta)) > config.turn or abs(off) > config.across:
                continue
            if along + low < span[1] and along + high > span[0]:
                count, first = count + 1, min(first, t)
        return count >= config.sightings and now - first >= config.lasting

    def built(self, name: str = "built") -> GspMap:
        """The map so far."""
        merge(self.filter, self._building)
        config = self._building
        floors = np.tile([config.across_floor**2, config.turn_floor**2], len(self.filter.lines))
        covariance = self.filter.line_covariance + np.diag(floors)
        lines = replace(self.filter.lines, variances=frozen_array(np.diag(covariance).reshape(-1, 2)))
        return GspMap.of(name, lines, covariance)


def merge(held: LineFilter, config: BuildingConfig) -> None:
    """Merge lines of a map that is being built that are one."""
    i = 0
    while i < len(held.lines):
        other = _same_as(held, i, config)
        if other is None:
            i += 1
        else:
            held.join(i, other)


def _same_as(held: LineFilter, i: int, config: BuildingConfig) -> int | None:
    """A later line that is the same as line i, if there's one."""
    lines = held.lines
    pose, span = lines.poses[i], lines.spans[i]
    later = np.arange(i + 1, len(lines))
    if not len(later):
        return None
    turn = all_wrapped(lines.poses[later, 2] - pose[2])
    delta = lines.poses[later, :2] - pose[:2]
    c, s = math.cos(pose[2]), math.sin(pose[2])
    along, off = delta @ (c, s), delta @ (-s, c)
    gap = np.maximum(along + lines.spans[later, 0] - span[1], span[0] - along - lines.spans[later, 1])
    near = (np.abs(turn) < 3 * config.turn) & (np.abs(off) < 3 * config.across) & (gap < config.gap)
    for k in np.flatnonzero(near):
        j = int(later[k])
        if held.difference(i, j) < config.same:
            return j
    return None


BEAMS = 60
"""Beams of a scan that are kept."""
MOST = 120
"""Scans that are kept."""
_THROUGH, _CONTRADICTED = 0.2, 3
"""It begins again if this share of the beams goes through its own lines, in so many scans one after the other."""
_BLIND, _MOSTLY = 0.15, 0.6
"""Or if so many beams end nearer than this [m]: somebody stands before it."""
_TURN, _WAY = math.radians(12), 0.3
"""Scans are kept each so much turning [rad] or so long a way [m]."""


class Surveyor:
    """Gathers while the robot turns or drives."""

    def __init__(self, config: BuildingConfig | None = None) -> None:
        """Begin here."""
        self._config = BuildingConfig(shortest=0.3, sightings=2, lasting=0.15) if config is None else config
        self._begin()

    def _begin(self) -> None:
        self.builder = MapBuilder(config=self._config)
        """What follows the robot in the frame, and knows the last scan."""
        self._contradicted = 0
        self._kept: list[tuple[Array, Array, Array]] = []
        self._last: tuple[float, float, float] | None = None
        self._headings: list[float] = []

    @property
    def scans(self) -> int:
        """How many scans were kept."""
        return len(self._kept)

    @property
    def seen_around(self) -> float:
        """Angle that the scans cover, of a whole turn: 0.5 for the first, 1 after a turn on the spot."""
        if not self._headings:
            return 0.0
        ahead = np.sort(np.remainder(self._headings, math.tau))
        gaps = np.diff(np.concatenate([ahead, ahead[:1] + math.tau]))
        return float(1 - np.maximum(gaps - math.pi, 0.0).sum() / math.tau)

    def move(self, time: float, reading: tuple[float, float, float]) -> None:
        """Take a reading of the odometry."""
        self.builder.move(time, reading)

    def see(self, scan: LaserScan) -> bool:
        """Take in a scan; returns whether it was: not if it isn't new, or the odometry doesn't cover it yet."""
        if not self.builder.see(scan):
            return False
        if self._lost():
            self._begin()
            return True
        here = self.builder.posture
        last = self._last
        near = last is not None and math.dist(last[:2], here[:2]) < _WAY and abs(wrapped(here[2] - last[2])) < _TURN
        if near or len(self._kept) >= MOST:
            return True
        self._last = here
        self._headings.append(here[2])
        points = self.builder.points
        assert points is not None
        step = max(1, math.ceil(len(points.beams) / BEAMS))
        origins, ways = placed(points.origins[::step], here), turned(points.ways[::step], here[2])
        self._kept.append((origins, ways, points.ranges[::step]))
        return True

    def _lost(self) -> bool:
        """Whether it doesn't know any more where it is in its own frame, or sees nothing."""
        points = self.builder.points
        assert points is not None
        through = self.builder.evidence.through > _THROUGH
        self._contradicted = self._contradicted + 1 if through else 0
        blind = float(np.mean(points.ranges < _BLIND)) > _MOSTLY if len(points.ranges) else True
        return blind or self._contradicted >= _CONTRADICTED

    def surroundings(self) -> Surroundings:
        """What was gathered so far."""
        built = self.builder.built()
        lines = built.lines if len(built.lines) else Lines.none()
        if not self._kept:
            none = frozen_array(np.zeros((0, 2)))
            return Surroundings(lines, none, none, frozen_array(np.zeros(0)), self.builder.noise)
        origins, ways, ranges = (frozen_array(np.concatenate(parts)) for parts in zip(*self._kept, strict=True))
        return Surroundings(lines, origins, ways, ranges, self.builder.noise)
