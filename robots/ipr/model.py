"""The mobile robot IPR and the micro-robot that stood in for it in the experiment: geometry and limits, as a value.

Sources: Han, Kim, Kim, Kim, 2001 [H]: section 2.1, 4.2. Kim, Han, Kim, Kim, 2002 [K]: sizes of the
same robot. What neither gives is an assumption; its reason stands beside it.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Final

from robots.base import PERIOD, Footprint, MobileBase
from robots.onboard.driving import IPR_WHEEL_BASE, drive_limits
from vrs.errors import InvalidValueError
from vrs.mobile import DriveLimits, Wheels

IPR_LENGTH: Final = 0.52
"""Along the direction of travel [m]; [K]: 45 × 52 × 75 cm."""
IPR_WIDTH: Final = 0.45
"""Across it [m]."""
IPR_HEIGHT: Final = 0.75
"""[m]."""
IPR_MASS: Final = 75.0
"""[kg]; [K]."""
IPR_WHEEL_RADIUS: Final = 0.10
"""[m], an assumption: passes the door sills of a house, and 0.5 m/s is a common gear motor's 48 turns/min."""
IPR_AXLE_OFFSET: Final = 0.06
"""How far the driving axle is ahead of the body's centre [m], D of [K], eq. (2); its size is an assumption."""

MICRO_SIDE: Final = 0.075
"""Length, width and height [m]; [H], section 4.2."""
MICRO_MASS: Final = 0.430
"""[kg]; [H], section 4.2."""
MICRO_WHEEL_BASE: Final = 0.068
"""L [m], an assumption: wheels 7 mm thick flush with the sides."""
MICRO_WHEEL_RADIUS: Final = 0.022
"""[m], an assumption: usual for soccer robots of this size, on which it's built."""
MICRO_AXLE_OFFSET: Final = 0.0
"""How far the driving axle is ahead of the body's centre [m], an assumption: they turn about their centre."""


class Kind(StrEnum):
    """Which of the paper's two robots."""

    IPR = "ipr"
    """The 75 kg robot of section 2.1."""
    MICRO = "micro"
    """The 430 g robot of section 4.2."""


def model(
    kind: Kind | str = Kind.IPR, *, limits: DriveLimits | None = None, period: float | None = None
) -> MobileBase:
    """Return an IPR.

    Args:
        kind: `ipr`, 45 × 52 × 75 cm and 75 kg, or `micro`, 7.5 cm and 430 g.
        limits: Limits of its commands; None means 0.5 m/s, 45 deg/s and 0.52 m/s² of `robots.ipr.model`.
        period: T, time between commands [s]; None means 0.1.

    Raises:
        InvalidValueError: If there's no such robot, or the period isn't positive.
    """
    try:
        which = Kind(kind)
    except ValueError:
        raise InvalidValueError("kind", kind, f"one of {', '.join(Kind)}") from None
    if which is Kind.IPR:
        wheels = Wheels(IPR_WHEEL_BASE, IPR_WHEEL_RADIUS)
        body = Footprint(IPR_LENGTH, IPR_WIDTH, IPR_HEIGHT, IPR_MASS, IPR_AXLE_OFFSET)
    else:
        wheels = Wheels(MICRO_WHEEL_BASE, MICRO_WHEEL_RADIUS)
        body = Footprint(MICRO_SIDE, MICRO_SIDE, MICRO_SIDE, MICRO_MASS, MICRO_AXLE_OFFSET)
    if limits is None:
        limits = drive_limits(wheels.base)
    return MobileBase(limits, wheels, body, PERIOD if period is None else period, "ipr")
