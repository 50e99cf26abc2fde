"""What a mobile robot must be for the engine, and the kinematics of two driven wheels that roll without slipping.

Postures are (x, y, θ) [m, m, rad] of the middle of the driving axle in the world frame, θ counted on past ±π.
Speeds u = (v, ω) [m/s, rad/s]: forward positive, to the left positive. Wheels (v_R, v_L) [m/s].

Commands keep the limits of acceleration: a ramp is a stair of commands, a stop goes along an arc. The engine takes
a command (v, ω, duration) as an exact arc without a ramp; what commands the robot keeps its accelerations, from
each command to the next.

Source: Han, Kim, Kim, Kim, "Internet Control Architecture for Internet-Based Personal Robot", 2001, eq. (1)–(6).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, cos, pi, remainder, sin, sqrt, tau
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from vrs.checks import finite, positive, validated
from vrs.errors import InvalidValueError
from vrs.model import Array

SLACK = 1.0 + 1e-9
"""What a limit is multiplied by to be kept: rounding."""


@dataclass(frozen=True, slots=True)
@validated
class DriveLimits:
    """How fast a mobile robot may be commanded, and how fast that may change."""

    v_max: Annotated[float, positive()]
    """Largest linear speed [m/s], either way, positive."""
    w_max: Annotated[float, positive()]
    """Largest angular speed [rad/s], either way, positive."""
    a_max: Annotated[float, positive()]
    """Largest linear acceleration [m/s²], positive."""
    alpha_max: Annotated[float, positive()]
    """Largest angular acceleration [rad/s²], positive."""

    def refusal(self, v: float, w: float) -> str:
        """Say which limit speeds [m/s], [rad/s] break; empty if none."""
        for name, value, most, unit in (("v", v, self.v_max, "m/s"), ("w", w, self.w_max, "rad/s")):
            if abs(value) > most * SLACK:
                return f"{name} must be within ±{most:.9g} {unit}; given: {value:.9g}"
        return ""

    def braking_speed(self, distance: float, reaction: float, end: float = 0.0) -> float:
        """The speed from which the robot still slows down within a distance [m/s].

        Args:
            distance: How far it is to where the speed must be `end` [m].
            reaction: How long the speed is kept before it falls [s].
            end: Speed to slow down to [m/s].
        """
        back = self.a_max * reaction
        return max(end, sqrt(back * back + end * end + 2 * self.a_max * max(distance, 0.0)) - back)

    def braking_distance(self, v: float, reaction: float) -> float:
        """How far the robot gets from speed v [m/s] until it stands [m], with a reaction time [s]."""
        v = abs(v)
        return v * reaction + v * v / (2 * self.a_max)


@dataclass(frozen=True, slots=True)
@validated
class Wheels:
    """Two driven wheels on one axle."""

    base: Annotated[float, positive()]
    """L: distance between the wheels' points of contact [m], positive."""
    radius: Annotated[float, positive()]
    """Of a wheel [m], positive."""


@runtime_checkable
class MobileModel(Protocol):
    """A robot on two driven wheels. Postures are of the middle of the driving axle, in the world frame."""

    @property
    def name(self) -> str:
        """Short name, as in `robots.<name>`."""

    @property
    def limits(self) -> DriveLimits:
        """Limits of its commands."""

    @property
    def wheels(self) -> Wheels:
        """Its driven wheels."""

    @property
    def period(self) -> float:
        """T: time between commands [s]."""


_ROUNDING = 1e-9
"""Share of a step that's only rounding."""


def clipped(value: float, most: float, around: float = 0.0) -> float:
    """What is nearest to value and at most `most` from `around`."""
    return min(max(value, around - most), around + most)


def limited(
    u: tuple[float, float], before: tuple[float, float], T: float, limits: DriveLimits
) -> tuple[float, float]:
    """The command nearest to what is wanted that the limits allow after another one.

    v and ω are limited each on its own: to its largest value, and to a change of a_max T, or alpha_max T.

    Args:
        u: Wanted v [m/s] and ω [rad/s].
        before: v and ω of the command before.
        T: Time between the two commands [s], positive.
        limits: Limits of speed and acceleration.

    Raises:
        InvalidValueError: If something isn't finite, or T isn't positive.
    """
    if finite("T", T, "positive seconds") <= 0:
        raise InvalidValueError("T", T, "positive seconds")
    return (
        _limited("v", u[0], before[0], limits.v_max, limits.a_max * T),
        _limited("w", u[1], before[1], limits.w_max, limits.alpha_max * T),
    )


def _limited(name: str, wanted: float, before: float, most: float, step: float) -> float:
    return clipped(clipped(finite(name, wanted), most), step, finite(name, before))


def braking(u: tuple[float, float], T: float, limits: DriveLimits) -> list[tuple[float, float]]:
    """Commands, one every T, that stop a robot along the arc that it's on, as soon as the limits allow.

    Each is the speeds times a share, and the shares fall by equal steps to 0, which comes after the last one. The
    first is a step below the present speeds: it takes effect at once.

    Args:
        u: Present v [m/s] and ω [rad/s].
        T: Time between commands [s].
        limits: Limits of acceleration.

    Returns:
        (v, ω) of each, none where one step does.
    """
    steps = max(abs(u[0]) / (limits.a_max * T), abs(u[1]) / (limits.alpha_max * T))
    count = ceil(steps * (1.0 - _ROUNDING))
    return [(u[0] * k / count, u[1] * k / count) for k in range(count - 1, 0, -1)]


_SMALL = 1e-4
"""Half an angle [rad] below which sin(x)/x is its series to rounding."""


def wrapped(angle: float) -> float:
    """The same angle [rad] in [−π, π]."""
    return remainder(angle, tau)


def all_wrapped(angles: Array) -> Array:
    """The same angles [rad], of any shape, in [−π, π)."""
    return np.remainder(angles + pi, tau) - pi


def speeds(wheels: ArrayLike, base: float) -> Array:
    """Speeds (v, ω) of wheel speeds (v_R, v_L), (2,) or (k, 2).

    Args:
        wheels: Speeds of the right and the left wheel at the ground [m/s].
        base: L, distance between the wheels [m].

    Source: eq. (2).
    """
    right, left = np.moveaxis(np.asarray(wheels, dtype=np.float64), -1, 0)
    return np.stack([0.5 * (right + left), (right - left) / base], -1)


def wheel_speeds(u: ArrayLike, base: float) -> Array:
    """Wheel speeds (v_R, v_L) of speeds (v, ω), (2,) or (k, 2): the inverse of `speeds`.

    Args:
        u: v [m/s] and ω [rad/s].
        base: L, distance between the wheels [m].
    """
    v, w = np.moveaxis(np.asarray(u, dtype=np.float64), -1, 0)
    return np.stack([v + 0.5 * base * w, v - 0.5 * base * w], -1)


def jacobian(theta: float) -> Array:
    """J(θ), (3, 2): the posture's rate of change is J(θ) u. Source: eq. (1)."""
    return np.array([[cos(theta), 0.0], [sin(theta), 0.0], [0.0, 1.0]])


def constraint(theta: float) -> Array:
    """G(θ), (3,): G times the posture's rate of change is 0, the wheels don't slide. Source: eq. (3)."""
    return np.array([sin(theta), -cos(theta), 0.0])


def rotation(theta: float) -> Array:
    """T(θ), (3, 3): from the robot's axes to the world's. Source: eq. (6)."""
    c, s = cos(theta), sin(theta)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def turned(vectors: Array, theta: float) -> Array:
    """Vectors of a robot's axes in the world's, (k, 2) or (2,), where the robot heads in θ [rad]."""
    c, s = cos(theta), sin(theta)
    found: Array = vectors @ np.array([[c, s], [-s, c]])
    return found


def placed(points: Array, posture: tuple[float, float, float]) -> Array:
    """Points of a robot's frame in the world's [m], (k, 2) or (2,), where the robot is at a posture."""
    return turned(points, posture[2]) + posture[:2]


def composed(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    """The posture in the world of what is at b in a frame that is at a."""
    c, s = cos(a[2]), sin(a[2])
    return a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], a[2] + b[2]


def increment(v: float, w: float, duration: float) -> tuple[float, float, float]:
    """H(v, ω): an exact arc's displacement in the robot's axes at its start [m, m, rad].

    The printed form, r sin ωT and r(1 − cos ωT), loses all digits as ω goes to 0; here the chord is
    v T sin(ωT/2)/(ωT/2) in the direction ωT/2, which is the same and holds for ω = 0 too.

    Source: eq. (4)–(6).
    """
    half = 0.5 * w * duration
    chord = v * duration * sinc(half)
    return chord * cos(half), chord * sin(half), w * duration


def advanced(
    posture: tuple[float, float, float], v: float, w: float, duration: float, heading: float | None = None
) -> tuple[float, float, float]:
    """The posture after an exact arc: P + T(θ) H(v, ω).

    Args:
        posture: At the start.
        v: Linear speed [m/s].
        w: Angular speed [rad/s].
        duration: [s], of either sign.
        heading: θ of T(θ) where it's another than the posture's, as in eq. (8) [rad].

    Source: eq. (6).
    """
    x, y, theta = posture
    turned = 0.5 * w * duration
    chord = v * duration * sinc(turned)
    middle = (theta if heading is None else heading) + turned
    return x + chord * cos(middle), y + chord * sin(middle), theta + 2 * turned


def sinc(x: float) -> float:
    """sin(x)/x, to rounding near 0, too."""
    return sin(x) / x if abs(x) > _SMALL else 1.0 - x * x / 6.0


def on_arcs(rows: Array, u: Array, derivative: int = 0) -> Array:
    """Postures, or their time derivatives, on arcs.

    Args:
        rows: x, y, θ at the start, v and ω of each arc, (k, 5).
        u: Time since each one's start [s], (k,).
        derivative: Order, 0 or more.

    Returns:
        (k, 3), [m or rad / s**derivative].
    """
    x, y, theta, v, w = rows.T
    if derivative:
        # The velocity (v cos, v sin) turns at ω: each further derivative is ω times as long, a quarter turn on.
        length = v * w ** (derivative - 1)
        heading = theta + w * u + 0.5 * pi * (derivative - 1)
        return np.stack([length * np.cos(heading), length * np.sin(heading), w if derivative == 1 else 0 * w], -1)
    half = 0.5 * w * u
    chord = v * u * np.sinc(half / pi)
    middle = theta + half
    return np.stack([x + chord * np.cos(middle), y + chord * np.sin(middle), theta + 2 * half], -1)


def displaced(rows: Array, origin: tuple[float, float, float], to: tuple[float, float, float]) -> Array:
    """Arcs moved as a rigid body, so that a posture comes to another.

    Args:
        rows: As of `on_arcs`, (k, 5).
        origin: Where a posture of them is.
        to: Where that's to be.

    Returns:
        (k, 5), speeds unchanged.
    """
    turned = to[2] - origin[2]
    c, s = cos(turned), sin(turned)
    x, y = rows[:, 0] - origin[0], rows[:, 1] - origin[1]
    moved = rows.copy()
    moved[:, 0] = to[0] + c * x - s * y
    moved[:, 1] = to[1] + s * x + c * y
    moved[:, 2] += turned
    return moved
