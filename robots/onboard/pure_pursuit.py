"""Pure pursuit: an arc from the robot to a point ahead on its path, at one speed.

Source: Coulter, Implementation of the pure pursuit path tracking algorithm, CMU-RI-TR-92-01, 1992.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from robots.onboard.curve import Curve
from robots.onboard.driving import STAND, Drive
from vrs.checks import validated, within


@dataclass(frozen=True, slots=True)
@validated
class PurePursuitConfig:
    """Constants of pure pursuit."""

    speed: Annotated[float, within(1e-3, 10.0)] = 0.5
    """[m/s], in [1e-3, 10]."""
    ahead: Annotated[float, within(1e-3, 10.0)] = 0.3
    """How far ahead the point is, along the path [m], in [1e-3, 10]."""
    most_turning: Annotated[float, within(1e-3, 100.0)] = math.radians(45.0)
    """Largest |ω| [rad/s], in [1e-3, 100]: where the arc needs more, the robot goes slower."""
    arrival: Annotated[float, within(0.0, 10.0)] = 0.05
    """Distance from the path's end at which the robot stands [m], in [0, 10]."""
    window: Annotated[float, within(1e-2, 1e9)] = 1.0
    """How far from where it was on the path the nearest point is looked for [m], in [1e-2, 1e9]."""


class PurePursuit:
    """Drives a robot forward along a curve; called once a period, it knows no clock."""

    def __init__(self, curve: Curve, config: PurePursuitConfig | None = None) -> None:
        """Take the path."""
        self._curve = curve
        self._config = PurePursuitConfig() if config is None else config
        self._end = curve.at(curve.length)
        self.s: float | None = None
        """Way along the path to its point nearest to the robot, at the last call [m]."""

    def control(self, posture: tuple[float, float, float]) -> Drive:
        """Say what to drive until the next call.

        Args:
            posture: Where the robot is, (x, y, θ) [m, m, rad]; only finite numbers.
        """
        x, y, theta = posture
        curve, config = self._curve, self._config
        if math.hypot(self._end.x - x, self._end.y - y) <= config.arrival:
            return STAND
        self.s = curve.nearest(x, y, around=self.s, window=config.window)
        point = curve.at(self.s + config.ahead)
        dx, dy = point.x - x, point.y - y
        left = math.cos(theta) * dy - math.sin(theta) * dx
        square = dx * dx + dy * dy
        if square == 0:
            return STAND
        curvature = 2 * left / square
        speed = config.speed
        if abs(curvature) * speed > config.most_turning:
            speed = config.most_turning / abs(curvature)
        return Drive(speed, curvature * speed)
