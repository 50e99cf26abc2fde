"""Trackers of a curve: pure pursuit (an arc to a point ahead, at one speed), and the quadratic-curve path tracker.

Source: Coulter, Implementation of the pure pursuit path tracking algorithm, CMU-RI-TR-92-01, 1992.

The quadratic one drives for an instant along a parabola from the robot to a point ahead on its path.

Source: Tipsuwan, Chow, eq. (5)–(18), after Yoshizawa, Hashimoto, Wada, Mori 1996. With (e_x, e_y) the reference
point in the robot's frame, A = e_y / e_x² is the parabola's, K = α / (1 + |A|), and

    v = sgn(e_x) K = sgn(e_x) α e_x² / (e_x² + |e_y|),
    ω = 2 A v      = sgn(e_x) 2 α e_y / (e_x² + |e_y|).

The second forms are finite where the reference point comes beside the robot. Eq. (9) and (13) as printed give
sgn(e_x) to both A and K, so that it cancels in ω = 2 A K (`Backwards.PRINTED`): a robot whose reference point lies
behind reverses and turns its front to that side, until the point is ahead. Along the parabola through the point,
which eq. (9) says it wants, the sign counts once (`Backwards.PARABOLA`): the robot reverses to the point, and goes
on along the path in reverse.
"""

from __future__ import annotations

import enum
import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated

from typing_extensions import override

from robots.onboard.curve import Curve
from robots.onboard.driving import STAND, Drive
from vrs.checks import number_in, validated, within
from vrs.mobile import wheel_speeds
from vrs.mobile.model import Wheels


class _CurveTracker(ABC):
    """Drives a robot towards a point ahead on a curve."""

    def __init__(self, curve: Curve, arrival: float, window: float) -> None:
        self._curve, self._arrival, self._window = curve, arrival, window
        self._end = curve.at(curve.length)
        self.s: float | None = None
        """s₀: way along the path to its point nearest to the robot, at the last call [m]."""

    def control(self, posture: tuple[float, float, float]) -> Drive:
        """Say what to drive until the next call.

        Args:
            posture: Where the robot is, (x, y, θ) [m, m, rad]; only finite numbers.
        """
        x, y, theta = posture
        if math.hypot(self._end.x - x, self._end.y - y) <= self._arrival:
            return STAND
        self.s = self._curve.nearest(x, y, around=self.s, window=self._window)
        point = self._curve.at(self._reference(self.s))
        dx, dy = point.x - x, point.y - y
        cos, sin = math.cos(theta), math.sin(theta)
        return self._towards(cos * dx + sin * dy, cos * dy - sin * dx, dx * dx + dy * dy)

    @abstractmethod
    def _reference(self, s: float) -> float:
        """Way along the path to the point [m], of the way to the nearest one."""

    @abstractmethod
    def _towards(self, ahead: float, left: float, square: float) -> Drive:
        """The drive towards a point that's so far ahead and to the left [m], its distance's square [m²]."""


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


class PurePursuit(_CurveTracker):
    """Drives a robot forward along a curve; called once a period, it knows no clock."""

    def __init__(self, curve: Curve, config: PurePursuitConfig | None = None) -> None:
        """Take the path."""
        self._config = config = PurePursuitConfig() if config is None else config
        super().__init__(curve, config.arrival, config.window)

    @override
    def _reference(self, s: float) -> float:
        return s + self._config.ahead

    @override
    def _towards(self, ahead: float, left: float, square: float) -> Drive:
        if square == 0:
            return STAND
        curvature = 2 * left / square
        speed = self._config.speed
        if abs(curvature) * speed > self._config.most_turning:
            speed = self._config.most_turning / abs(curvature)
        return Drive(speed, curvature * speed)


class Backwards(enum.StrEnum):
    """How the robot turns where its reference point lies behind it."""

    PRINTED = "printed"
    """As eq. (9), (13) and (16) are printed: its front turns to the side on which the point is."""
    PARABOLA = "parabola"
    """Along the parabola through the point: it reverses to it."""


@dataclass(frozen=True, slots=True)
@validated
class QuadraticTrackerConfig:
    """Constants of the tracker."""

    alpha: Annotated[float, within(1e-3, 10.0)] = 2.0
    """α, speed on a straight line [m/s], in [1e-3, 10]."""
    s_max: Annotated[float, within(1e-3, 10.0)] = 0.3
    """How far ahead the reference point is at most, along the path [m], in [1e-3, 10]."""
    beta: Annotated[float, within(0.0, 100.0)] = 0.1
    """β, how much nearer it comes where the path bends [m], in [0, 100]."""
    arrival: Annotated[float, within(0.0, 10.0)] = 0.05
    """Distance from the path's end at which the robot stands [m], in [0, 10]."""
    window: float = 1.0
    """How far from where it was on the path the nearest point is looked for [m], in [1e-2, inf]; the paper looks
    everywhere."""
    backwards: Backwards = Backwards.PRINTED
    """How it turns in reverse."""

    def __post_init__(self) -> None:
        if self.window != math.inf:
            number_in("window", self.window, 1e-2, 1e9)


class QuadraticCurveTracker(_CurveTracker):
    """Drives a robot along a curve by its position alone; called once a period, it knows no clock."""

    def __init__(self, curve: Curve, config: QuadraticTrackerConfig | None = None) -> None:
        """Take the path."""
        self._config = config = QuadraticTrackerConfig() if config is None else config
        super().__init__(curve, config.arrival, config.window)

    @override
    def _reference(self, s: float) -> float:
        # Source: eq. (5), (6).
        config = self._config
        return s + config.s_max / (1 + config.beta * self._curve.most_curvature(s, s + config.s_max))

    @override
    def _towards(self, ahead: float, left: float, square: float) -> Drive:
        return parabola_drive(ahead, left, self._config.alpha, self._config.backwards)


def parabola_drive(e_x: float, e_y: float, alpha: float, backwards: Backwards = Backwards.PRINTED) -> Drive:
    """Return the drive along the parabola to a point.

    Args:
        e_x: Where the point is ahead of the robot [m].
        e_y: Where it is to its left [m].
        alpha: Speed on a straight line [m/s].
        backwards: How to turn in reverse.

    Source: eq. (9), (13), (15), (16).
    """
    square = e_x * e_x
    size = square + abs(e_y)
    if size == 0:
        return STAND
    w = 2 * alpha * e_y / size
    if e_x < 0:
        return Drive(-alpha * square / size, -w if backwards is Backwards.PARABOLA else w)
    return Drive(alpha * square / size if e_x else 0.0, w)


def wheel_rates(drive: Drive, wheels: Wheels) -> tuple[float, float]:
    """Return the angular speeds of the right and the left wheel [rad/s]. Source: eq. (17), (18)."""
    right, left = (wheel_speeds(drive, wheels.base) / wheels.radius).tolist()
    return right, left
