"""Two moves that overlap in time, so that the arm passes the place between them without stopping.

Either a via is rounded within one command, or, on a continuous path, a move begins where the one before it begins
to brake, as far as the limits allow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from vrs.commands import Profile
from vrs.errors import InvalidValueError
from vrs.model import Array, Limits, RobotModel
from vrs.notes import Note, NoteCode, Notes
from vrs.planning.certificate import violation
from vrs.planning.plan import Plan, end_state
from vrs.segment import evaluate, shifted

_REST = 1e-9
"""Speed [rad/s] and distance from the via [rad] that count as none."""
_SAME_KNOT = 1e-12
"""Knots nearer than this [s] are one."""


def overlapped(first: Plan, second: Plan, delta: float) -> Plan:
    """The second plan starts before the first ends, their ways superposed.

    q(t) = q1(t) + q2(t − (T1 − δ)) − q_via, where q1 stays at the via after T1 and q2 before T1 − δ. Speeds,
    accelerations and jerks add, so that the result wants a certificate of its own.

    Args:
        first: Ends at rest at the via.
        second: Begins at rest there.
        delta: Overlap δ [s], from 0 to the duration of the shorter plan.

    Returns:
        The sum on the union of the knots; it starts as the first and ends as the second does.

    Raises:
        InvalidValueError: If the plans don't meet at rest, or the overlap is longer than one of them.
    """
    most = min(first.duration, second.duration)
    if not 0.0 <= delta <= most:
        raise InvalidValueError("delta", delta, f"from 0 to {most:.9g} s, the shorter plan's duration")
    if len(first) == 0 or len(second) == 0:
        return first.then(second)
    via = second.coefficients[0, 0]
    end = end_state(first)
    # The slice is empty where the second plan is one of positions alone.
    moving = max(np.abs(end.qd).max(), np.abs(second.coefficients[0, 1:2]).max(initial=0.0)) > _REST
    if moving or np.abs(end.q - via).max() > _REST:
        raise InvalidValueError("second", second, "a plan that begins where the first ends, both at rest")
    if delta <= _SAME_KNOT:
        return first.then(second)
    begin = max(first.duration - delta, 0.0)
    early, late = _knots(first, 0.0), _knots(second, begin)
    knots = _union(early, late)
    order = max(first.coefficients.shape[1], second.coefficients.shape[1])
    a = np.zeros((len(knots) - 1, order, len(via)))
    for row, start, stop in zip(a, knots[:-1], knots[1:], strict=True):
        middle = 0.5 * (start + stop)
        before, after = middle < early[-1], middle > late[0]
        if before:
            _add(row, first, early, start, middle)
        if after:
            _add(row, second, late, start, middle)
        if before and after:
            row[0] -= via
    return Plan(np.diff(knots), a)


def _knots(plan: Plan, start: float) -> list[float]:
    """Times of the knots [s], (m + 1,)."""
    times = [start]
    for duration in plan.durations.tolist():
        times.append(times[-1] + duration)
    return times


def _union(early: list[float], late: list[float]) -> list[float]:
    """Both plans' knots in order."""
    knots = [early[0]]
    last = late[-1]
    for time in sorted(early[1:] + late[:-1]):
        if knots[-1] + _SAME_KNOT < time < last - _SAME_KNOT:
            knots.append(time)
    return [*knots, last]


def _add(row: Array, plan: Plan, knots: list[float], start: float, middle: float) -> None:
    """Add the plan's polynomial at the middle of an interval, in powers of the time since the interval's start."""
    index = sum(knot <= middle for knot in knots[1:-1])
    a, shift = plan.coefficients[index], start - knots[index]
    row[: len(a)] += a if abs(shift) <= _SAME_KNOT else shifted(a, shift)


Pair: TypeAlias = Callable[[Limits], tuple[Plan, Plan, Notes]]
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
    """The first of them."""
    delta: float
    """How long they overlap [s]; 0 where they don't."""
    whole: Plan
    notes: Notes
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
    first, second, notes = plans(limits)
    stopping = Rounded(first, 0.0, first.then(second), notes)
    if deviation <= 0 or min(len(first), len(second)) == 0:
        return stopping
    best = _overlapped(first, second, deviation, model, limits, profile)
    if best is None:
        half = replace(limits, qdd_max=0.5 * limits.qdd_max, qddd_max=0.5 * limits.qddd_max)
        slow, onward, notes = plans(half)
        best = _overlapped(slow, onward, deviation, model, limits, profile)
        if best is None or best.whole.duration > _SLOWER_MOST * stopping.whole.duration:
            return replace(stopping, notes=(*stopping.notes, Note(NoteCode.STOPS_AT_VIA)))
    return replace(best, notes=(*notes, *best.notes))


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
        notes = (Note(NoteCode.PASSES_VIA, (away,)),)
        return Rounded(first, delta, whole, notes) if away <= deviation else None

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


_RISE = 1e-4
"""Relative growth of a speed from knot to knot that doesn't count: joints of a line at an even pace vary."""
_STRAIGHT = 1e-6
"""How much less than 1 the cosine between velocities in one direction may be."""
_TRIALS = 8
_ROUNDING = 1e-12
"""Durations that differ by less [s] are the same."""


def continuous(
    first: Plan, second: Plan, most: float, ramps: tuple[float, float], limits: Limits, *, jerk: bool
) -> tuple[float, Plan]:
    """Let a move begin before the one before it ends, by the time that it starts or that one brakes, the shorter.

    Where that passes a limit, by the longest of some shorter times that doesn't.

    Args:
        first: Ends at rest where the second begins; at least its end.
        second: Begins at rest.
        most: Longest overlap [s].
        ramps: How long the first brakes, and how long the second takes to reach its speed [s].
        limits: Limits that hold at every instant.
        jerk: Whether jerk limits bind.

    Returns:
        How long they overlap [s], 0 where they don't, and the plan from where the second begins.
    """
    longest = min(most, *ramps, first.duration, second.duration)
    for k in range(_TRIALS, 0, -1) if longest > _ROUNDING else ():
        delta = longest * k / _TRIALS
        # Only what overlaps is new, and is to be certified.
        end, (beginning, rest) = _last(first, delta), _divided(second, delta)
        both = overlapped(end, beginning, delta)
        both = _divided(both, end.duration - delta)[1]
        if violation(both, limits, jerk=jerk) is None:
            return delta, both.then(rest)
    return 0.0, second


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
