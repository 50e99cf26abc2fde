"""What a tool twist asks of the joints: rates from the Jacobian, at the start and on the way, and how fast.

Lengths are divided by the model's characteristic length, so that linear and angular rows compare.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from vrs.model import Array, Limits, RobotModel

SLOW_FROM = 30.0
"""Condition number from which approaching a singularity slows the tool."""
STOP_AT = 100.0
"""Condition number at which approaching ends, and above which rates are damped."""
_NODES = np.array([0.0, 0.3, 1.0])
_FINE = np.linspace(0.0, 1.0, 25)
FREE = np.ones_like(_FINE)
"""Caps of a course that nothing slows; known by its identity."""
_SPEED = 0.97
"""Share of the speed limits for the way along the twist."""
_TANGENTIAL = 0.3
"""Growth of the logarithm of the condition number per radian of joint motion that isn't an approach yet."""
_SINGULAR = 0.1 / STOP_AT
"""σ_min / σ_max below which the sign of det J is noise."""
_BRAKING = 0.8
"""Share of the acceleration limits with which joints slow before their position limits."""
_SHORTEST = 0.01
"""Shortest way that's looked at [s at full speed]."""


class Twist(NamedTuple):
    """Where the tool is to go."""

    linear: Array
    """[m/s] over the characteristic length, (3,), in the base frame, at the start."""
    angular: Array
    """[rad/s], (3,), in the base frame."""
    turns: bool
    """Whether the linear part turns with the tool."""

    def after(self, s: Array) -> Array:
        """The twist at each of the times s [s] of motion at full speed, (k, 6)."""
        v, w = self.linear, self.angular
        rate = float(np.sqrt(w @ w))
        if not self.turns or rate == 0.0:
            return np.broadcast_to(np.concatenate([v, w]), (len(s), 6))
        axis = w / rate
        along = (axis @ v) * axis
        c, d = np.cos(rate * s)[:, None], np.sin(rate * s)[:, None]
        turned = along + c * (v - along) + d * _cross(axis, v)
        return np.concatenate([turned, np.broadcast_to(w, (len(s), 3))], axis=1)


def _cross(a: Array, b: Array) -> Array:
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def weighted_jacobian(model: RobotModel, q: Array) -> Array:
    """Jacobians of joint positions (k, n), linear rows over the characteristic length: (k, 6, n)."""
    J = np.array(model.jacobian(q))
    J[:, :3] /= model.characteristic_length
    return J


def damped_rates(J: Array, twists: Array) -> tuple[Array, Array]:
    """Least rates that give the twists, damped where the condition number is above STOP_AT.

    A singular value σ below ε = σ_max / STOP_AT answers with σ/ε² instead of 1/σ: continuous, and 0 for the
    directions in which the tool can't go.

    Args:
        J: Jacobians, (k, 6, n).
        twists: (k, 6).

    Returns:
        Rates [rad/s], (k, n), and σ_min / σ_max with the sign of det J (J square), (k,).
    """
    U, S, Vt = np.linalg.svd(J, full_matrices=False)
    floor = S[:, :1] / STOP_AT
    answer = 1.0 / np.maximum(S, floor)
    answer *= np.minimum(S / np.maximum(floor, 1e-300), 1.0)
    parts = answer * (twists[:, None] @ U)[:, 0]
    u = (parts[:, None] @ Vt)[:, 0]
    nearness = S[:, -1] / np.maximum(S[:, 0], 1e-300)
    if J.shape[1] == J.shape[2]:
        nearness = nearness * np.where(np.linalg.det(J) < 0.0, -1.0, 1.0)
    return u, nearness


def sliding_rates(J: Array, twist: Array, low: Array, high: Array) -> Array:
    """The rates that come nearest to a twist with some of them bounded, (n,).

    The joint that passes its bound by most is set to it and the others are solved again, until none does.

    Args:
        J: Jacobian, (6, n).
        twist: (6,).
        low: Lowest rates [rad/s], (n,), not positive.
        high: Highest rates [rad/s], (n,), not negative.
    """
    n = J.shape[1]
    u = np.zeros(n)
    free = np.ones(n, dtype=bool)
    while free.any():
        left = twist - J[:, ~free] @ u[~free]
        u[free] = damped_rates(J[None, :, free], left[None])[0][0]
        over = np.where(free, np.maximum(u - high, low - u), -np.inf)
        worst = int(np.argmax(over))
        if over[worst] <= 0.0:
            break
        u[worst] = min(max(u[worst], low[worst]), high[worst])
        free[worst] = False
    return u


def rates_to_limits(q: Array, limits: Limits) -> tuple[Array, Array]:
    """Rates with which each joint may go down and up, falling to 0 at its limits: (n,), (n,) [rad/s]."""
    A = _BRAKING * limits.qdd_max
    lag = 0.5 * A * limits.qdd_max / limits.qddd_max
    down, up = np.maximum(q - limits.q_min, 0.0), np.maximum(limits.q_max - q, 0.0)
    low, high = (np.sqrt(lag * lag + 2.0 * A * way) - lag for way in (down, up))
    return -low, high


class TwistCourse(NamedTuple):
    """The joint rates along the twist, as functions of the way s [s at full speed]."""

    u: Array
    """Rates at the start [rad/s], (n,)."""
    slope: Array
    curve: Array
    offset: Array
    """What the rates change by when the transient has moved the arm aside."""
    seen: float
    """How far they hold [s]."""
    grid: Array
    """Ways at which the speed is bounded [s], (k,)."""
    caps: Array
    """Largest share of the asked-for speed there, (k,)."""


def course(
    model: RobotModel, q: Array, u: Array, aside: Array, twist: Twist, reach: float, limits: Limits
) -> TwistCourse:
    """Sample rates and condition numbers on the way.

    Args:
        model: The arm.
        q: Start [rad], (n,).
        u: Rates there [rad/s], (n,).
        aside: Where the transient leaves the arm, from q [rad], (n,).
        twist: What to follow.
        reach: How far to look [s at full speed].
        limits: Their speeds bound the share.
    """
    seen = reach
    for _ in range(3):
        ways = seen * _NODES
        places = q + aside + ways[:, None] * u
        rates, near = damped_rates(weighted_jacobian(model, places), twist.after(ways))
        # Rates near a singularity change like 1 / σ_min: no parabola fits them over a longer way.
        change_here = float(np.abs(near[1:] - near[0]).max()) / max(abs(float(near[0])), 1.0 / STOP_AT)
        if change_here <= 0.6 or seen <= _SHORTEST:
            break
        seen = max(0.5 * seen / change_here, _SHORTEST)
    offset = rates[0] - u
    # The parabola through the three.
    before, after = (rates[1] - rates[0]) / ways[1], (rates[2] - rates[1]) / (ways[2] - ways[1])
    curve = 2.0 * (after - before) / seen
    slope = before - 0.5 * curve * ways[1]
    fastest = _SPEED / (np.abs(rates) / limits.qd_max).max(axis=1)
    grid = reach * _FINE
    caps = FREE
    sharpest = float(((np.abs(slope) + seen * np.abs(curve)) / limits.qdd_max).max())
    slowest = min(float(fastest.min()), sqrt(0.5 / max(sharpest, 0.5)))
    if slowest < 1.0:
        caps = np.minimum(np.interp(grid, ways, fastest), sqrt(0.5 / max(sharpest, 0.5)))
    sign = -1.0 if near[0] < 0.0 else 1.0
    if (sign * near).min() < 1.0 / SLOW_FROM or seen < reach:
        ahead = np.interp(grid, ways, near)
        ahead += np.maximum(grid - seen, 0.0) * float(near[2] - near[1]) / float(ways[2] - ways[1])
        caps = np.minimum(caps, _share(ahead, grid, sqrt(float(u @ u))))
    return TwistCourse(u, slope, curve, offset, seen, grid, caps)


def _share(near: Array, way: Array, rate: float) -> Array:
    """Share of the speed that a singularity leaves: all of it, unless it's being approached.

    Args:
        near: Signed σ_min / σ_max along the way, (k,).
        way: Where [s at full speed], (k,).
        rate: Joint rates of the twist [rad/s], their norm.
    """
    nearness = np.abs(near)
    condition = 1.0 / np.maximum(nearness, 1e-12)
    left = np.clip((STOP_AT - condition) / (STOP_AT - SLOW_FROM), 0.0, 1.0)
    step = np.diff(near) / np.diff(way)
    # From an exactly singular pose every way leads away.
    falling = -near * np.append(step, step[-1]) / np.maximum(nearness, _SINGULAR) ** 2
    approaching = np.clip((falling / rate - _TANGENTIAL) / (4.0 * _TANGENTIAL), 0.0, 1.0)
    share = 1.0 - (1.0 - left) * approaching
    if nearness[0] > _SINGULAR:
        share[1:][near[1:] * near[:-1] < 0.0] = 0.0
    return np.asarray(share)
