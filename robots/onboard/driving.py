"""What the parts that drive a mobile robot share: drives, postures, and limits, by the distance between the wheels.

Source: Kim, Han, Kim, Kim, 2002 [K]: safety limits of the mobile robot IPR.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, NamedTuple

from msgspec import Meta

from vrs.mobile import DriveLimits, clipped

V_MAX: Final = 0.5
"""Largest linear speed [m/s]; safety limit of [K]."""
W_MAX: Final = math.radians(45.0)
"""Largest angular speed [rad/s]; safety limit of [K], 45 deg/s."""
A_MAX: Final = 0.52
"""Largest linear acceleration [m/s²]; safety limit of [K]."""
IPR_WHEEL_BASE: Final = 0.40
"""L of the IPR [m], an assumption: as wide as the body allows, with wheels 5 cm thick inside its 45 cm."""


def drive_limits(wheel_base: float) -> DriveLimits:
    """Limits of a robot's commands: the safety limits of [K], and one of the angular acceleration.

    That's where each wheel's rim, on the spot, has the linear limit; an assumption.

    Args:
        wheel_base: L, distance between the wheels [m].
    """
    return DriveLimits(V_MAX, W_MAX, A_MAX, 2.0 * A_MAX / wheel_base)


IPR_LIMITS: Final = drive_limits(IPR_WHEEL_BASE)
"""Limits of the IPR's commands, and of what drives on board unless told otherwise."""


class Drive(NamedTuple):
    """What a mobile robot is told to do."""

    v: Annotated[float, Meta(ge=-1e6, le=1e6)]
    """Linear speed [m/s], forward positive."""
    w: Annotated[float, Meta(ge=-1e6, le=1e6)]
    """Angular speed [rad/s], to the left positive."""


class Posture(NamedTuple):
    """Where the middle of the driving axle is, in the world frame."""

    x: Annotated[float, Meta(ge=-1e9, le=1e9)]
    """[m]."""
    y: Annotated[float, Meta(ge=-1e9, le=1e9)]
    """[m]."""
    theta: Annotated[float, Meta(ge=-1e9, le=1e9)]
    """Heading [rad], not wrapped."""


STAND = Drive(0.0, 0.0)
STILL: Final = Drive(0.02, 0.05)
"""A robot that's told to move slower than this stands: it only keeps its place [m/s, rad/s]."""


def kept(v: float, w: float, before: float, dt: float, limits: DriveLimits) -> Drive:
    """Return what is nearest to a drive within the limits; the angular speed may jump, as the motors ramp it.

    Args:
        v: Linear speed [m/s].
        w: Angular speed [rad/s].
        before: Linear speed `dt` seconds before [m/s].
        dt: [s], positive.
        limits: Of the robot.
    """
    v = clipped(clipped(v, limits.v_max), limits.a_max * dt, before)
    return Drive(v, clipped(w, limits.w_max))


def is_still(drive: Drive) -> bool:
    """Whether a robot that's told that is at rest."""
    return abs(drive.v) <= STILL.v and abs(drive.w) <= STILL.w
