"""The path-following controller: a uni-vector field leads the robot to a path and along it.

Source: Han, Kim, Kim, Kim, eq. (14)–(15), after Kim, Kim, Kim 1998. The field's direction beside a path is

    θ_N(l) = θ_d − sgn(l) atan(g |l|^(1/c)),
    ω = K_ω sgn(θ_e) √|θ_e| + (cos θ ∂θ_N/∂x + sin θ ∂θ_N/∂y) v,    v = K_v Δs

with θ_e = θ_N − θ and θ the direction in which the robot travels (its heading, or the opposite where it reverses).
On the field θ_N' goes as v g²/c |l|^(2/c − 1): bounded only for c ≤ 2.

*Literal* keeps these three laws, with θ_d constant in the gradient, so that curves aren't foreseen, and v whatever
ω can do. What had to be said to make it run: |l| isn't taken for less than `l_floor` in the gradient, and nowhere
else; where the heading is opposite to the field the side is kept that was chosen; √|θ_e| gives no more than a
straight line through 0 that a loop with this period and this motor lag follows without ringing; Δs ends at the
next pivot or reversal, which the field doesn't know; and a robot has limits.

*Capped* adds the gradient's part that comes from the curve, κ v cos ψ / (1 − κ l), and bounds v: so that ω holds
its limit here and on the curves ahead, and by the way that it takes to stop before pivots, reversals and the
path's end.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Annotated

from robots.onboard.driving import IPR_LIMITS, STAND, Drive, kept
from robots.onboard.path import MovingPath, Projection
from vrs.checks import number_in, validated, within
from vrs.errors import InvalidValueError
from vrs.mobile import DriveLimits, clipped, wrapped

_OPPOSITE = math.radians(170)
"""From this deviation on the side to turn to is kept."""
_RINGS = 2.0
"""Slope of the heading's law times its response: damping 1/√2."""
_LEAST = 0.2
"""Least of 1 − κ l that counts: the centre of a curve has no nearest point."""


class FieldLaw(enum.StrEnum):
    """How closely the paper's laws are kept."""

    LITERAL = "literal"
    CAPPED = "capped"


@dataclass(frozen=True, slots=True)
@validated
class PathFollowingConfig:
    """Constants of the field and of the loop. One set serves every path and every delay."""

    g: Annotated[float, within(1e-6, 100.0)] = 2.0
    """How steep the field is [1/m^(1/c)], in (0, 100]."""
    c: float = 1.5
    """Its exponent, 1 < c < 2: from 2 on the field asks for an angular speed without bound as l goes to 0."""
    K_w: Annotated[float, within(1e-6, 100.0)] = 2.0
    """K_ω [√rad/s], in (0, 100]."""
    K_v: Annotated[float, within(1e-6, 100.0)] = 1.0
    """[1/s], in (0, 100]; the robot lags 1/K_v behind the path's end, and brakes at K_v · v."""
    l_floor: Annotated[float, within(1e-4, 0.1)] = 0.005
    """Least |l| in the gradient [m], in [1e-4, 0.1]."""
    period: Annotated[float, within(1e-3, 1.0)] = 0.05
    """Between two calls [s], in [1e-3, 1]."""
    lag: Annotated[float, within(0.0, 1.0)] = 0.1
    """Of the motors, first order, the longest to be expected [s], in [0, 1]."""
    cruise: Annotated[float, within(1e-3, 10.0)] = 0.5
    """Speed not to exceed [m/s], in [1e-3, 10]; the limits hold, too."""
    arrival: Annotated[float, within(1e-4, 0.1)] = 0.005
    """Way left at which a stretch counts as driven [m], in [1e-4, 0.1]."""
    arrival_angle: Annotated[float, within(1e-3, 0.5)] = 0.02
    """Turn left at which a pivot counts as driven [rad], in [1e-3, 0.5]."""
    curve_share: Annotated[float, within(0.1, 1.0)] = 0.9
    """Capped: share of the largest ω that curves may take; the rest is for the field. In [0.1, 1]."""
    limits: DriveLimits = IPR_LIMITS
    """Of the robot."""

    def __post_init__(self) -> None:
        if not 1.0 < number_in("c", self.c, 0.0, 100.0) < 2.0:
            allowed = "in (1, 2): from 2 on the field needs an angular speed without bound near the path"
            raise InvalidValueError("c", self.c, allowed)

    @property
    def response(self) -> float:
        """From a measurement to its effect [s]: half a period until the command's middle, and the motors."""
        return 0.5 * self.period + self.lag


def field_direction(l: float, theta_d: float, config: PathFollowingConfig) -> float:  # noqa: E741
    """Return θ_N [rad] at a distance l beside a path of direction θ_d. Source: Han et al., eq. (14)."""
    return theta_d - math.copysign(math.atan(config.g * abs(l) ** (1 / config.c)), l)


def field_slope(l: float, config: PathFollowingConfig) -> float:  # noqa: E741
    """Return ∂θ_N/∂l [rad/m], with |l| not taken for less than the floor."""
    far = max(abs(l), config.l_floor)
    steep = config.g * math.pow(far, 1 / config.c)
    return -steep / (config.c * far * (1 + steep * steep))


class PathFollowingController:
    """Follows a moving path, pivots and reversals included; it knows no clock, and is called once a period."""

    def __init__(
        self, path: MovingPath, config: PathFollowingConfig | None = None, *, law: FieldLaw = FieldLaw.CAPPED
    ) -> None:
        """Take the path, which others make longer, and the law."""
        self._path = path
        self.config = PathFollowingConfig() if config is None else config
        self._law = FieldLaw(law)
        self._v = 0.0
        self._side = 0.0
        """Side to which an opposite heading is turned."""
        self._turning = 0.0
        """Side to which the pivot is turned, once it has begun."""
        self.projection: Projection | None = None
        """Where the robot was beside the path at the last call."""
        self.direction = 0.0
        """Direction in which it was to travel then [rad]."""

    def control(self, posture: tuple[float, float, float], *, v_before: float | None = None) -> Drive:
        """Say what to drive until the next call.

        Args:
            posture: Where the robot is, (x, y, θ) [m, m, rad]; only finite numbers.
            v_before: Linear speed that it was really told to drive last [m/s], if others changed it.

        Returns:
            A drive within the limits.
        """
        if v_before is not None:
            self._v = v_before
        place = self._arrive(posture)
        self.projection = place
        if place.turn is not None:
            drive = self._pivot(place.turn)
            self.direction = wrapped(posture[2])
        else:
            drive = self._follow(place, posture[2])
        config = self.config
        drive = kept(drive.v, drive.w, self._v, config.period, config.limits)
        self._v = drive.v
        return drive

    def _arrive(self, posture: tuple[float, float, float]) -> Projection:
        """Take as driven what is driven."""
        config, path = self.config, self._path
        for _ in range(len(path) + 1):
            place = path.locate(posture)
            driven = (
                place.to_stop <= config.arrival
                if place.turn is None
                else abs(place.turn) <= config.arrival_angle or place.turn * self._turning < 0
            )
            if not driven or not path.pass_stop():
                break
            self._turning = 0.0
        return place

    def _straighten(self, error: float) -> float:
        """The heading's law: K_ω √|θ_e|, but no more than the loop follows without ringing."""
        config = self.config
        far = abs(error)
        w = config.K_w * math.sqrt(far)
        if config.response > 0:
            w = min(w, far / (_RINGS * config.response))
        return math.copysign(w, error)

    def _pivot(self, turn: float) -> Drive:
        config = self.config
        if abs(self._v) > config.limits.a_max * config.period:
            return STAND
        self._turning = math.copysign(1.0, turn)
        return Drive(0.0, clipped(self._straighten(turn), config.limits.w_max))

    def _follow(self, place: Projection, heading: float) -> Drive:
        config = self.config
        theta = heading if place.direction > 0 else heading + math.pi
        aim = field_direction(place.l, place.theta_d, config)
        self.direction = aim
        error = wrapped(aim - theta)
        # Opposite to the field both ways are as far: noise mustn't choose anew at each call.
        if abs(error) < _OPPOSITE:
            self._side = 0.0
        elif self._side == 0.0:
            self._side = math.copysign(1.0, error) if abs(error) < math.pi else math.copysign(1.0, -place.l)
        elif self._side * error < 0:
            error += math.copysign(math.tau, self._side)
        steer = self._straighten(error)
        psi = wrapped(theta - place.theta_d)
        per_metre = field_slope(place.l, config) * math.sin(psi)
        if self._law is FieldLaw.LITERAL:
            speed = min(config.K_v * place.to_stop, config.cruise, config.limits.v_max)
            return Drive(place.direction * speed, steer + per_metre * speed)
        curvature = self._curvature_soon(place)
        per_metre += curvature * math.cos(psi) / max(1 - curvature * place.l, _LEAST)
        speed = self._speed(place, error, per_metre)
        before = place.direction * self._v
        step = config.limits.a_max * config.period
        return Drive(place.direction * speed, steer + per_metre * clipped(speed, step, before))

    def _curvature_soon(self, place: Projection) -> float:
        """Curvature where the robot will be once the motors have answered."""
        reach = abs(self._v) * self.config.response
        found = place.curvature
        for _, found in self._path.ahead(reach):  # noqa: B007
            pass
        return found

    def _speed(self, place: Projection, error: float, per_metre: float) -> float:
        """The capped speed along the path [m/s], not negative."""
        config = self.config
        limits = config.limits
        reaction = config.period + config.lag
        speed = min(config.cruise, limits.v_max, config.K_v * place.left)
        speed = min(speed, limits.braking_speed(place.to_stop, reaction))
        w_share = config.curve_share * limits.w_max
        for gap, curvature in self._path.ahead(limits.braking_distance(speed, reaction)):
            if abs(curvature) * speed > w_share:
                speed = min(speed, limits.braking_speed(gap, reaction, w_share / abs(curvature)))
        if abs(per_metre) * speed > w_share:
            speed = w_share / abs(per_metre)
        return speed * max(math.cos(error), 0.0)
