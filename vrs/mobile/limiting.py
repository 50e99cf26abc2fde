"""Commands within the limits of acceleration: a ramp as a stair of commands, and a stop along an arc.

The engine takes a command (v, ω, duration) as an exact arc without a ramp; what commands the robot keeps its
accelerations, from each command to the next.
"""

from __future__ import annotations

from math import ceil

from vrs.checks import finite
from vrs.errors import InvalidValueError
from vrs.mobile.model import DriveLimits

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
