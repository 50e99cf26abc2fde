"""What a mobile robot on two driven wheels is: its limits, wheels and footprint, as a value."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

from vrs.checks import finite
from vrs.errors import InvalidValueError
from vrs.mobile import DriveLimits, Wheels


@dataclass(frozen=True, slots=True)
class Footprint:
    """A box on wheels; its reference point is the middle of the driving axle."""

    length: float
    """Along the direction of travel [m]."""
    width: float
    """Across it [m]."""
    height: float
    """[m]."""
    mass: float
    """[kg]."""
    axle_offset: float
    """How far the driving axle is ahead of the body's centre [m]."""

    @property
    def radius(self) -> float:
        """Of the circle about the reference point that holds the whole body [m]."""
        return hypot(0.5 * self.length + abs(self.axle_offset), 0.5 * self.width)


@dataclass(frozen=True, slots=True)
class MobileBase:
    """A mobile robot; satisfies `vrs.mobile.MobileModel`."""

    limits: DriveLimits
    wheels: Wheels
    body: Footprint
    period: float
    """T: time between commands [s], positive."""
    name: str

    def __post_init__(self) -> None:
        if finite("period", self.period, "positive seconds") <= 0:
            raise InvalidValueError("period", self.period, "positive seconds")

    @property
    def radius(self) -> float:
        """Of the circle about the reference point that holds the whole robot [m]."""
        return self.body.radius
