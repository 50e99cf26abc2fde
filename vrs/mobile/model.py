"""What a mobile robot must be for the engine: limits, wheels, and the period of its commands.

Commands keep the limits of acceleration: a ramp is a stair of commands, a stop goes along an arc. The engine takes
a command (v, ω, duration) as an exact arc without a ramp; what commands the robot keeps its accelerations, from
each command to the next.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import ceil, sqrt
from typing import Protocol, runtime_checkable

from vrs.checks import finite
from vrs.errors import InvalidValueError

SLACK = 1.0 + 1e-9
"""What a limit is multiplied by to be kept: rounding."""


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """How fast a mobile robot may be commanded, and how fast that may change."""

    v_max: float
    """Largest linear speed [m/s], either way, positive."""
    w_max: float
    """Largest angular speed [rad/s], either way, positive."""
    a_max: float
    """Largest linear acceleration [m/s²], positive."""
    alpha_max: float
    """Largest angular acceleration [rad/s²], positive."""

    def __post_init__(self) -> None:
        for item in fields(self):
            _put_positive(self, item.name)

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
class Wheels:
    """Two driven wheels on one axle."""

    base: float
    """L: distance between the wheels' points of contact [m], positive."""
    radius: float
    """Of a wheel [m], positive."""

    def __post_init__(self) -> None:
        for item in fields(self):
            _put_positive(self, item.name)


def _put_positive(value: DriveLimits | Wheels, name: str) -> None:
    number = finite(name, getattr(value, name), "a positive number")
    if number <= 0:
        raise InvalidValueError(name, number, "a positive number")
    object.__setattr__(value, name, number)


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
