"""A plan: polynomials that follow one another, and the certificate that they keep the limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vrs.chunk import State
from vrs.model import Array, Limits

TOLERANCE = 5e-10
"""Relative overshoot that a certificate lets pass: rounding, half of what the laws allow."""


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """Segments of a move, one after the other."""

    durations: Array
    """[s], (m,), positive."""
    coefficients: Array
    """(m, K, n), ascending powers of the time since each segment's start."""

    @property
    def duration(self) -> float:
        """Of the whole [s]."""
        return float(self.durations.sum())

    def __len__(self) -> int:
        return len(self.durations)

    def then(self, other: Plan) -> Plan:
        """This plan, then the other."""
        if len(self) == 0 or len(other) == 0:
            return self if len(other) == 0 else other
        order = max(self.coefficients.shape[1], other.coefficients.shape[1])
        both = [
            np.pad(p.coefficients, ((0, 0), (0, order - p.coefficients.shape[1]), (0, 0))) for p in (self, other)
        ]
        return Plan(np.concatenate([self.durations, other.durations]), np.concatenate(both))

    def rows(self) -> list[Array]:
        """The coefficients, an array of shape (degree + 1, n) a segment, read-only, leading zeros dropped."""
        a = self.coefficients
        a.flags.writeable = False
        filled: list[list[bool]] = np.any(a != 0, axis=2).tolist()
        orders = [max((k + 1 for k, some in enumerate(row) if some), default=1) for row in filled]
        return [row[:order] for row, order in zip(a, orders, strict=True)]


def empty(n: int) -> Plan:
    """A plan that stays where it is."""
    return Plan(np.empty(0), np.empty((0, 1, n)))


def integrate(state: State, durations: Array, control: Array, order: int) -> Plan:
    """Polynomials of a piecewise constant control.

    Args:
        state: Start.
        durations: [s], (m,).
        control: Acceleration (order 2) or jerk (order 3) of each interval, (m, n).
        order: 2 or 3.
    """
    m, n = control.shape
    a = np.empty((m, order + 1, n))
    h = durations[:, None]
    if order == 2:
        a[:, 2] = 0.5 * control
        a[:, 1] = state.qd + _before(h * control)
    else:
        acceleration = state.qdd + _before(h * control)
        a[:, 3] = control / 6.0
        a[:, 2] = 0.5 * acceleration
        a[:, 1] = state.qd + _before(h * (acceleration + 0.5 * h * control))
    step = h * (a[:, 1] + h * (a[:, 2] + (h * a[:, 3] if order == 3 else 0.0)))
    a[:, 0] = state.q + _before(step)
    return Plan(durations, a)


def _before(steps: Array) -> Array:
    """Sum of the rows before each row."""
    sums: Array = np.cumsum(steps, axis=0)
    sums[1:] = sums[:-1].copy()
    sums[0] = 0.0
    return sums


def end_state(plan: Plan) -> State:
    """Where a plan that isn't empty ends."""
    h, a = plan.durations[-1], plan.coefficients[-1]
    powers = np.arange(len(a))
    q = (a * (h**powers)[:, None]).sum(0)
    qd = (a[1:] * (powers[1:] * h ** powers[:-1])[:, None]).sum(0)
    k = powers[2:]
    qdd = (a[2:] * (k * (k - 1) * h ** (k - 2.0))[:, None]).sum(0)
    return State(q, qd, qdd)


def violation(plan: Plan, limits: Limits, *, jerk: bool) -> str | None:
    """Say which limit a plan of degree 3 or less passes, at any instant; None if it keeps them all.

    The extremes are exact: positions at the roots of the velocity, velocities at the roots of the acceleration.

    Args:
        plan: What to certify.
        limits: Position, speed, acceleration and, if asked for, jerk limits.
        jerk: Whether the jerk limits bind.
    """
    if len(plan) == 0:
        return None
    a = plan.coefficients
    if not np.isfinite(a).all() or not (plan.durations > 0).all():
        return "the plan isn't finite"
    h = plan.durations[:, None]
    zero = np.zeros_like(a[:, 0])
    c0, c1 = a[:, 0], a[:, 1] if a.shape[1] > 1 else zero
    c2 = a[:, 2] if a.shape[1] > 2 else zero
    c3 = a[:, 3] if a.shape[1] > 3 else zero
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        flat = -c2 / (3.0 * c3)
        root = np.sqrt(c2 * c2 - 3.0 * c1 * c3)
        # The stable pair of roots of c1 + 2 c2 u + 3 c3 u²; it covers c3 = 0 too.
        big = -(c2 + np.copysign(root, c2))
        turns = np.stack([big / (3.0 * c3), c1 / big, zero, zero + h])
        flats = np.stack([flat, zero, zero + h])
    turns = np.clip(np.where(np.isfinite(turns), turns, 0.0), 0.0, h)
    flats = np.clip(np.where(np.isfinite(flats), flats, 0.0), 0.0, h)
    q = c0 + turns * (c1 + turns * (c2 + turns * c3))
    qd = np.abs(c1 + flats * (2.0 * c2 + flats * 3.0 * c3))
    qdd = np.maximum(np.abs(2.0 * c2), np.abs(2.0 * c2 + 6.0 * h * c3))
    over = [
        ("position", (q - limits.q_max).max((0, 1)) / np.maximum(1.0, np.abs(limits.q_max))),
        ("position", (limits.q_min - q).max((0, 1)) / np.maximum(1.0, np.abs(limits.q_min))),
        ("speed", qd.max((0, 1)) / limits.qd_max - 1.0),
        ("acceleration", qdd.max(0) / limits.qdd_max - 1.0),
    ]
    if jerk:
        over.append(("jerk", np.abs(6.0 * c3).max(0) / limits.qddd_max - 1.0))
    for what, excess in over:
        if excess.max() > TOLERANCE:
            return f"joint {int(np.argmax(excess)) + 1} would pass its {what} limit"
    return None
