"""Two moves that overlap in time: what rounds a via."""

from __future__ import annotations

import math

import numpy as np

from vrs.errors import InvalidValueError
from vrs.model import Array
from vrs.planning.plan import Plan, end_state

_REST = 1e-9
"""Speed [rad/s] and distance from the via [rad] that count as none."""
_KNOT = 1e-12
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
    if delta <= _KNOT:
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
        if knots[-1] + _KNOT < time < last - _KNOT:
            knots.append(time)
    return [*knots, last]


def _add(row: Array, plan: Plan, knots: list[float], start: float, middle: float) -> None:
    """Add the plan's polynomial at the middle of an interval, in powers of the time since the interval's start."""
    index = sum(knot <= middle for knot in knots[1:-1])
    a, shift = plan.coefficients[index], start - knots[index]
    row[: len(a)] += a if abs(shift) <= _KNOT else _shift(len(a), shift) @ a


def _shift(order: int, u: float) -> Array:
    """Matrix of Taylor's shift of ascending powers by u."""
    powers = [u**k for k in range(order)]
    return np.array(
        [[math.comb(i, k) * powers[i - k] if i >= k else 0.0 for i in range(order)] for k in range(order)]
    )
