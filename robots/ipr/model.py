"""The mobile robot as a value: limits and geometry of either body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from math import hypot

from robots.ipr import parameters as p
from robots.onboard.driving import IPR_WHEEL_BASE, drive_limits
from vrs.checks import finite
from vrs.errors import InvalidValueError
from vrs.mobile import DriveLimits, Wheels


class Kind(StrEnum):
    """Which of the paper's two robots."""

    IPR = "ipr"
    """The 75 kg robot of section 2.1."""
    MICRO = "micro"
    """The 430 g robot of section 4.2."""


@dataclass(frozen=True, slots=True)
class Body:
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
class Ipr:
    """An internet-based personal robot. Source: Han, Kim, Kim, Kim, 2001, section 2."""

    limits: DriveLimits
    wheels: Wheels
    body: Body
    period: float = p.PERIOD
    """T: time between commands [s], positive."""
    kind: Kind = Kind.IPR
    name: str = "ipr"

    def __post_init__(self) -> None:
        if finite("period", self.period, "positive seconds") <= 0:
            raise InvalidValueError("period", self.period, "positive seconds")

    @property
    def radius(self) -> float:
        """Of the circle about the reference point that holds the whole robot [m]."""
        return self.body.radius


def model(kind: Kind | str = Kind.IPR, *, limits: DriveLimits | None = None, period: float | None = None) -> Ipr:
    """Return an IPR.

    Args:
        kind: `ipr`, 45 × 52 × 75 cm and 75 kg, or `micro`, 7.5 cm and 430 g.
        limits: Limits of its commands; None means 0.5 m/s, 45 deg/s and 0.52 m/s² of `robots.ipr.parameters`.
        period: T, time between commands [s]; None means 0.1.

    Raises:
        InvalidValueError: If there's no such robot, or the period isn't positive.
    """
    try:
        which = Kind(kind)
    except ValueError:
        raise InvalidValueError("kind", kind, f"one of {', '.join(Kind)}") from None
    if which is Kind.IPR:
        wheels = Wheels(IPR_WHEEL_BASE, p.IPR_WHEEL_RADIUS)
        body = Body(p.IPR_LENGTH, p.IPR_WIDTH, p.IPR_HEIGHT, p.IPR_MASS, p.IPR_AXLE_OFFSET)
    else:
        wheels = Wheels(p.MICRO_WHEEL_BASE, p.MICRO_WHEEL_RADIUS)
        body = Body(p.MICRO_SIDE, p.MICRO_SIDE, p.MICRO_SIDE, p.MICRO_MASS, p.MICRO_AXLE_OFFSET)
    if limits is None:
        limits = drive_limits(wheels.base)
    made = Ipr(limits, wheels, body, kind=which)
    return made if period is None else replace(made, period=period)
