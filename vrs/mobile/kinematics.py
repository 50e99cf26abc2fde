"""Kinematics of a robot on two driven wheels that roll without slipping.

Postures are (x, y, θ) [m, m, rad] of the middle of the driving axle in the world frame, θ counted on past ±π.
Speeds u = (v, ω) [m/s, rad/s]: forward positive, to the left positive. Wheels (v_R, v_L) [m/s].

Source: Han, Kim, Kim, Kim, "Internet Control Architecture for Internet-Based Personal Robot", 2001, eq. (1)–(6).
"""

from __future__ import annotations

from math import cos, pi, remainder, sin, tau

import numpy as np
from numpy.typing import ArrayLike

from vrs.model import Array

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
