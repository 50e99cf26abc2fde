"""Passing a via without stopping: the move to it and the move from it overlap."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from vrs.commands import Profile
from vrs.model import Array, Limits, RobotModel
from vrs.planning.certificate import violation
from vrs.planning.overlap import overlapped
from vrs.planning.plan import Plan, end_state
from vrs.segment import evaluate

Pair: TypeAlias = Callable[[Limits], tuple[Plan, Plan, str]]
"""Plans, within limits, that end and begin at rest at the via, and what the user must know of them."""

_KNOT = 2e-12
"""Times nearer to a knot than this [s] are at it: sums of durations are rounded."""
_GRID = 16
_HALVINGS = 6
_LOOKS = 65
_SLOWER_MOST = 1.1
"""How much longer than with a stop a rounded way may take: it was asked for."""


@dataclass(frozen=True, slots=True, eq=False)
class Rounded:
    """Two plans, joined at a via."""

    first: Plan
    second: Plan
    delta: float
    """How long they overlap [s]; 0 where they don't."""
    whole: Plan
    note: str
    """What the user must know of it."""


def rounded(plans: Pair, deviation: float, model: RobotModel, limits: Limits, profile: Profile) -> Rounded:
    """Join two plans at a via, the second beginning before the first ends, as early as is allowed.

    The joints of both are superposed while they overlap, so the ways outside stay what they were. Where both need
    a joint's whole acceleration, they're tried again with half of it each.

    Args:
        plans: Makes the two plans.
        deviation: How far the tool may stay away from the via [m]; 0 stops at it.
        model: The robot.
        limits: Limits that hold at every instant.
        profile: Whether jerk limits bind.
    """
    first, second, note = plans(limits)
    stopping = Rounded(first, second, 0.0, first.then(second), note)
    if deviation <= 0 or min(len(first), len(second)) == 0:
        return stopping
    best = _overlapped(first, second, deviation, model, limits, profile)
    if best is None:
        half = replace(limits, qdd_max=0.5 * limits.qdd_max, qddd_max=0.5 * limits.qddd_max)
        slow, onward, note = plans(half)
        best = _overlapped(slow, onward, deviation, model, limits, profile)
        if best is None or best.whole.duration > _SLOWER_MOST * stopping.whole.duration:
            text = "stops at the via: no overlap keeps the limits"
            return replace(stopping, note=f"{stopping.note}; {text}" if stopping.note else text)
    return replace(best, note=f"{note}; {best.note}" if note else best.note)


def _overlapped(
    first: Plan, second: Plan, deviation: float, model: RobotModel, limits: Limits, profile: Profile
) -> Rounded | None:
    """The longest overlap that was found to keep the limits and the deviation."""
    if min(len(first), len(second)) == 0:
        return None
    via = model.forward(end_state(first).q)[:3, 3]

    def attempt(delta: float) -> Rounded | None:
        whole = overlapped(first, second, delta)
        if violation(whole, limits, jerk=profile is Profile.JERK_LIMITED) is not None:
            return None
        away = _distance(whole, first.duration - delta, first.duration, via, model)
        note = f"passes the via within {away:.3g} m"
        return Rounded(first, second, delta, whole, note) if away <= deviation else None

    longest = min(first.duration, second.duration)
    high = longest
    for delta in sorted(_overlaps(first, second, longest), reverse=True):
        best = attempt(delta)
        if best is not None:
            for _ in range(_HALVINGS if high > best.delta else 0):
                middle = attempt(0.5 * (best.delta + high))
                best, high = (middle, high) if middle is not None else (best, 0.5 * (best.delta + high))
            return best
        high = delta
    return None


def _overlaps(first: Plan, second: Plan, longest: float) -> Iterator[float]:
    """Overlaps to try: a grid, and those at which knots of both coincide, so that jerks can cancel."""
    yield from (longest * (k + 1) / _GRID for k in range(_GRID))
    before = first.duration - np.cumsum(first.durations)[-5:-1]
    for knot in np.concatenate([before, [first.durations[-1]]]).tolist():
        for after in np.cumsum(second.durations)[:4].tolist():
            if 0.0 < knot + after < longest:
                yield knot + after


def later(plan: Plan, t: float) -> Plan:
    """What of a plan comes after a knot at t [s]."""
    first = int(np.searchsorted(np.cumsum(plan.durations), t + _KNOT, side="right"))
    return Plan(plan.durations[first:], plan.coefficients[first:])


def _distance(plan: Plan, begin: float, end: float, via: Array, model: RobotModel) -> float:
    """How near the tool comes to the via [m] between two times of a plan [s]."""
    t = np.linspace(begin, end, _LOOKS)
    ends = np.cumsum(plan.durations)
    piece = np.minimum(np.searchsorted(ends, t, side="right"), len(ends) - 1)
    q = evaluate(plan.coefficients[piece], t - (ends - plan.durations)[piece], 0)
    p = model.forward(q)[:, :3, 3]
    return float(np.sqrt(((p - via) ** 2).sum(1).min()))
