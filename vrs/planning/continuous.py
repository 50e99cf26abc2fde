"""Continuous paths: a move begins where the one before it begins to brake, as far as the limits allow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vrs.model import Array, Limits, RobotModel
from vrs.planning.certificate import violation
from vrs.planning.overlap import overlapped
from vrs.planning.plan import Plan

_RISE = 1e-4
"""Relative growth of a speed from knot to knot that doesn't count: joints of a line at an even pace vary."""
_STRAIGHT = 1e-6
"""How much less than 1 the cosine between velocities in one direction may be."""
_TRIALS = 8
_ROUNDING = 1e-12
"""Durations that differ by less [s] are the same."""


class Overlap(NamedTuple):
    """A move that begins before the one before it ends."""

    delta: float
    """How long they overlap [s]; 0 where they don't."""
    plan: Plan
    """From where the second begins."""


def continuous(
    first: Plan, second: Plan, most: float, ramps: tuple[float, float], limits: Limits, *, jerk: bool
) -> Overlap:
    """Let a move begin before the one before it ends, by the time that it starts or that one brakes, the shorter.

    Where that passes a limit, by the longest of some shorter times that doesn't.

    Args:
        first: Ends at rest where the second begins; at least its end.
        second: Begins at rest.
        most: Longest overlap [s].
        ramps: How long the first brakes, and how long the second takes to reach its speed [s].
        limits: Limits that hold at every instant.
        jerk: Whether jerk limits bind.
    """
    longest = min(most, *ramps, first.duration, second.duration)
    for k in range(_TRIALS, 0, -1) if longest > _ROUNDING else ():
        delta = longest * k / _TRIALS
        # Only what overlaps is new, and is to be certified.
        end, (beginning, rest) = _last(first, delta), _divided(second, delta)
        both = overlapped(end, beginning, delta)
        both = _divided(both, end.duration - delta)[1]
        if violation(both, limits, jerk=jerk) is None:
            return Overlap(delta, both.then(rest))
    return Overlap(0.0, second)


def braking(plan: Plan, limits: Limits, model: RobotModel | None) -> float:
    """How long a plan that ends at rest brakes [s]: from the knot on from which its speed falls, on a straight way.

    Args:
        plan: The plan.
        limits: By whose speeds joints are compared.
        model: Whose tool goes straight; None where the joints do.
    """
    v = _velocities(plan, limits, model)
    size = np.sqrt((v * v).sum(1)).tolist()
    k = last = len(v) - 1
    while k > 0 and size[k - 1] > (1.0 + _RISE) * size[k]:
        if not v[k - 1] @ v[last] >= (1.0 - _STRAIGHT) * size[k - 1] * size[last]:
            break
        k -= 1
    return float(sum(plan.durations[k:].tolist()))


def starting(plan: Plan, limits: Limits, model: RobotModel | None) -> float:
    """How long a plan that begins at rest takes to reach its speed [s]; see `braking`."""
    v = _velocities(plan, limits, model)
    size = np.sqrt((v * v).sum(1)).tolist()
    k, last = 1, len(v) - 1
    while k < last and size[k + 1] > (1.0 + _RISE) * size[k]:
        if not v[k + 1] @ v[1] >= (1.0 - _STRAIGHT) * size[k + 1] * size[1]:
            break
        k += 1
    return float(sum(plan.durations[:k].tolist()))


def _velocities(plan: Plan, limits: Limits, model: RobotModel | None) -> Array:
    """Velocities at the beginnings of segments as shares of the nominal ones, (m, n) or (m, 6)."""
    if plan.coefficients.shape[1] < 2:
        return np.zeros((len(plan), plan.coefficients.shape[2]))
    q, qd = plan.coefficients[:, 0], plan.coefficients[:, 1]
    if model is None:
        return qd / limits.qd_max
    twist: Array = (model.jacobian(q) @ qd[:, :, None])[:, :, 0]
    shares: Array = twist / np.repeat([model.tool_speed, model.tool_turn_speed], 3)
    return shares


def _divided(plan: Plan, t: float) -> tuple[Plan, Plan]:
    """The first segments of a plan that take t [s] or more together, and the others."""
    k, left = 0, t - _ROUNDING
    for duration in plan.durations.tolist():
        if left <= 0.0:
            break
        k, left = k + 1, left - duration
    return Plan(plan.durations[:k], plan.coefficients[:k]), Plan(plan.durations[k:], plan.coefficients[k:])


def _last(plan: Plan, t: float) -> Plan:
    """The last segments of a plan that take t [s] or more together."""
    k, left = len(plan), t
    for duration in plan.durations.tolist()[::-1]:
        k -= 1
        left -= duration
        if left <= 0.0:
            break
    return Plan(plan.durations[k:], plan.coefficients[k:])
