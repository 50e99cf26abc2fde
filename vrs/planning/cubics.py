"""Cubic pieces of piecewise constant jerk on common knots: their states, their certificate, their polynomials."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vrs.chunk import State
from vrs.model import Array, Limits
from vrs.planning.bounds import TOLERANCE, Bounds, bounds
from vrs.planning.plan import TAYLOR, Plan

_INNER = 4
"""Where the inner coefficients begin among the points, after the states at the knots."""


class Cubics(NamedTuple):
    """What a jerk does to a state, as Bernstein coefficients: each piece lies within the hull of its own."""

    h: Array
    """Durations [s], (m,)."""
    points: Array
    """(7, m + 1, n): position, speed, acceleration and jerk at the knots, the inner coefficient of the speed and
    both of the position. What the last knot has no value for is 0 or its position."""

    @property
    def end(self) -> Array:
        """q, qd and qdd at the end, (3, n)."""
        return self.points[:3, -1]

    def keeps(self, limits: Limits) -> bool:
        """Whether every piece lies within the limits at every instant, with the certificate's tolerance."""
        box = _box(limits, len(self.h))
        distance = self.points - box.middle
        np.abs(distance, distance)
        inside = distance <= box.half
        # Counting is several times quicker than `all`, and NaN isn't inside.
        return np.count_nonzero(inside) == inside.size or self._keeps(~inside, bounds(limits))

    def _keeps(self, outside: NDArray[np.bool_], bound: Bounds) -> bool:
        """Decide by exact extremes where hulls are outside, which is seldom and in few places."""
        # The knots are points of the curves themselves.
        if outside[:_INNER].any():
            return False
        for point, piece, joint in np.argwhere(outside).tolist():
            h, (q, qd, qdd, qddd) = float(self.h[piece]), self.points[:_INNER, piece, joint].tolist()
            if point == _INNER:
                # The hull of a parabola is wider than it only where it turns within, so the jerk isn't 0.
                peak = qd - 0.5 * qdd * qdd / qddd if 0.0 < -qdd * qddd < h * qddd * qddd else qd
                kept = abs(peak) <= bound.qd_max[joint] * (1.0 + TOLERANCE)
            else:
                lowest, highest = bound.lowest[joint], bound.highest[joint]
                turns = [u for u in _roots(0.5 * qddd, qdd, qd) if 0.0 < u < h]
                kept = all(lowest <= q + u * (qd + u * (0.5 * qdd + u * qddd / 6.0)) <= highest for u in turns)
            if not kept:
                return False
        return True

    def plan(self) -> Plan:
        """The polynomials."""
        states = self.points[:4, :-1].swapaxes(0, 1)
        return Plan(self.h, np.multiply(states, TAYLOR, np.empty(states.shape)))


def integrated(state: State, h: Array, jerk: Array) -> Cubics:
    """The pieces that follow from a state.

    Args:
        state: Start.
        h: Durations [s], (m,).
        jerk: [rad/s³] of each piece, (m, n).
    """
    m, n = jerk.shape
    points = np.zeros((7, m + 1, n))
    q, qd, qdd, qddd, qd_inner, q_early, q_late = points
    # Arrays of one shape: broadcasting would double what an operation costs.
    third = h.repeat(n).reshape(m, n)
    half = 0.5 * third
    qddd[:m] = jerk
    qdd[0] = state.qdd
    np.multiply(third, jerk, qdd[1:])
    np.add.accumulate(qdd, 0, None, qdd)
    rise, steps = qdd[:m] * half, qd[1:]
    np.multiply(qdd[1:], half, steps)
    steps += rise
    qd[0] = state.qd
    np.add.accumulate(qd, 0, None, qd)
    inner = np.add(qd[:m], rise, qd_inner[:m])
    # A piece covers its duration times the mean of its speed's coefficients.
    third *= 1.0 / 3.0
    early, late, steps = qd[:m] * third, inner * third, q[1:]
    np.multiply(qd[1:], third, steps)
    steps += early
    steps += late
    q[0] = state.q
    np.add.accumulate(q, 0, None, q)
    q_early[m] = q_late[m] = q[m]
    np.add(np.add(q[:m], early, q_early[:m]), late, q_late[:m])
    return Cubics(h, points)


def _roots(a: float, b: float, c: float) -> list[float]:
    """Real roots of a u² + b u + c, a = 0 included."""
    square = b * b - 4.0 * a * c
    if square < 0.0:
        return []
    stable = -0.5 * (b + math.copysign(math.sqrt(square), b))
    return [over / under for over, under in ((stable, a), (c, stable)) if under]


class _Box(NamedTuple):
    """Limits with their tolerances, for each of `Cubics.points`."""

    middle: Array
    half: Array


@lru_cache(maxsize=128)
def _box(limits: Limits, m: int) -> _Box:
    bound = bounds(limits)
    low, high = np.array(bound.lowest), np.array(bound.highest)
    qd, qdd, qddd = (rate * (1.0 + TOLERANCE) for rate in (limits.qd_max, limits.qdd_max, limits.qddd_max))
    q = 0.5 * (high - low)
    half = np.array([q, qd, qdd, qddd, qd, q, q])
    middle = np.zeros_like(half)
    middle[[0, 5, 6]] = 0.5 * (low + high)
    return _Box(*(np.repeat(rows[:, None], m + 1, axis=1) for rows in (middle, half)))
