"""What a robot that doesn't know where it is gathers around it: lines and beams in a frame of its own.

The frame is where it began. Its own movement since is followed with a line map that is built on the way, so that a
turn on the spot closes although its wheels are wrong.
"""

from __future__ import annotations

import math

import numpy as np

from robots.onboard.global_localization import Surroundings
from robots.onboard.gsp_map import Lines
from robots.onboard.laser import LaserScan, Points
from robots.onboard.map_building import BuildingConfig, MapBuilder
from vrs.mobile import wrapped
from vrs.model import Array, frozen_array

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
        self._builder = MapBuilder(config=self._config)
        self._contradicted = 0
        self._kept: list[tuple[Array, Array, Array]] = []
        self._last: tuple[float, float, float] | None = None
        self._headings: list[float] = []

    @property
    def posture(self) -> tuple[float, float, float]:
        """Where the robot is in the frame, (x, y, θ) [m, m, rad]."""
        return self._builder.posture

    @property
    def covariance(self) -> Array:
        """Of that, (3, 3)."""
        return self._builder.covariance

    @property
    def points(self) -> Points | None:
        """What the last scan saw, in the robot's frame."""
        return self._builder.points

    @property
    def noise(self) -> float:
        """Of the ranges [m]."""
        return self._builder.noise

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
        self._builder.move(time, reading)

    def see(self, scan: LaserScan) -> bool:
        """Take in a scan; returns whether it was: not if it isn't new, or the odometry doesn't cover it yet."""
        if not self._builder.see(scan):
            return False
        if self._lost():
            self._begin()
            return True
        x, y, theta = here = self.posture
        last = self._last
        near = last is not None and math.dist(last[:2], here[:2]) < _WAY and abs(wrapped(theta - last[2])) < _TURN
        if near or len(self._kept) >= MOST:
            return True
        self._last = here
        self._headings.append(theta)
        points = self._builder.points
        assert points is not None
        step = max(1, math.ceil(len(points.beams) / BEAMS))
        c, s = math.cos(theta), math.sin(theta)
        turn = np.array([[c, s], [-s, c]])
        self._kept.append(
            (points.origins[::step] @ turn + (x, y), points.ways[::step] @ turn, points.ranges[::step])
        )
        return True

    def _lost(self) -> bool:
        """Whether it doesn't know any more where it is in its own frame, or sees nothing."""
        points = self._builder.points
        assert points is not None
        through = self._builder.evidence.through > _THROUGH
        self._contradicted = self._contradicted + 1 if through else 0
        blind = float(np.mean(points.ranges < _BLIND)) > _MOSTLY if len(points.ranges) else True
        return blind or self._contradicted >= _CONTRADICTED

    def surroundings(self) -> Surroundings:
        """What was gathered so far."""
        built = self._builder.built()
        lines = built.lines if len(built.lines) else Lines.none()
        if not self._kept:
            none = frozen_array(np.zeros((0, 2)))
            return Surroundings(lines, none, none, frozen_array(np.zeros(0)), self.noise)
        origins, ways, ranges = (frozen_array(np.concatenate(parts)) for parts in zip(*self._kept, strict=True))
        return Surroundings(lines, origins, ways, ranges, self.noise)
