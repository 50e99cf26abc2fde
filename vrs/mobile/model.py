"""What a mobile robot must be for the engine: limits, wheels, and the period of its commands."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import sqrt
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
