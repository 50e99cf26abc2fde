"""What the parts that drive a mobile robot share: drives, postures, and a drive within the limits."""

from __future__ import annotations

from typing import NamedTuple

from vrs.mobile import DriveLimits, clipped


class Drive(NamedTuple):
    """What a mobile robot is told to do."""

    v: float
    """Linear speed [m/s], forward positive."""
    w: float
    """Angular speed [rad/s], to the left positive."""


class Posture(NamedTuple):
    """Where the middle of the driving axle is, in the world frame."""

    x: float
    """[m]."""
    y: float
    """[m]."""
    theta: float
    """Heading [rad], not wrapped."""


STAND = Drive(0.0, 0.0)


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
