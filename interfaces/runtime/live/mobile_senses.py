"""What a live mobile robot drives to goals with, and what it tells of what it sees."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from typing_extensions import override

from interfaces.teleop.architectures import PositionSource
from interfaces.teleop.driving import JourneyPilot
from interfaces.teleop.tasks import SensedPoints
from robots.ipr.navigation import BodyNavigator
from robots.ipr.position import LaserPosition
from robots.ipr.robot import MobileRobot
from robots.onboard.driving import STAND, Drive, Posture
from robots.onboard.journey import GOING, Goal
from robots.onboard.laser import LaserScan, beam_angles

EVERY: Final = 4
"""Each so many of a scan's beams is told of."""
_TOLD: Final = 0.39
"""At most so often [s]."""


class NavigatorPilot(JourneyPilot):
    """Drives by a robot's own navigator: its laser, its sonars, and who walks there."""

    def __init__(self, body: MobileRobot, period: float) -> None:
        """Take a robot.

        Args:
            body: With a laser scanner and sonars.
            period: Between two drives [s].
        """
        self._ahead = BodyNavigator(body, period)
        super().__init__(self._ahead.navigator.journey, lambda: body.time)

    @override
    def go(self, goal: Goal, posture: Posture) -> None:
        self._ahead.navigator.go(goal, posture, now=self._clock())

    @override
    def drive(self, posture: Posture, before: Drive) -> Drive:
        drive = self._ahead.drive(posture, v_before=before.v)
        return drive if self.state in GOING else STAND


class LaserSight:
    """Where the beams of a robot's newest scan ended, and how sure it is of its place."""

    def __init__(self, body: MobileRobot, position: PositionSource) -> None:
        """Take a robot, and what tells it where it is."""
        self._body, self._position = body, position
        self._scan: LaserScan | None = None
        self._sight: SensedPoints | None = None
        self._told = -math.inf

    def look(self) -> None:
        """Note where the robot is while its newest scan is new; to be called each control period."""
        scan = self._body.laser
        if scan is None or scan is self._scan or scan.time < self._told + _TOLD:
            return
        self._scan, self._told = scan, scan.time
        reckoned, position = self._body.reckoned, self._position
        doubt, place = None, reckoned
        if isinstance(position, LaserPosition):
            localizer = position.localizer
            place = reckoned if localizer.posture is None else localizer.posture
            (xx, xy, _), (_, yy, _), _ = localizer.covariance.tolist()
            doubt = xx, xy, yy
        self._sight = SensedPoints(scan.time, seen_from(scan, place), doubt)

    def newest(self) -> SensedPoints | None:
        """What was seen since the last call; None if that's nothing."""
        sight, self._sight = self._sight, None
        return sight


def seen_from(scan: LaserScan, place: tuple[float, float, float]) -> tuple[tuple[float, float], ...]:
    """Where some of a scan's beams ended, for a map.

    Args:
        scan: The scan; how the robot moved during it doesn't matter for a picture.
        place: Where the robot is, (x, y, θ) [m, m, rad].

    Returns:
        Places on the map [m], to the centimetre.
    """
    x, y, theta = place
    angles = beam_angles(len(scan.ranges))[::EVERY] + theta
    ranges = scan.ranges[::EVERY]
    hit = np.isfinite(ranges)
    ahead = np.array([x + scan.forward * math.cos(theta), y + scan.forward * math.sin(theta)])
    ends = ahead + ranges[hit, None] * np.column_stack([np.cos(angles[hit]), np.sin(angles[hit])])
    return tuple((round(a, 2), round(b, 2)) for a, b in ends.tolist())
