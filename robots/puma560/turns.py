"""Turns: the joint values within limits that put the arm where a branch puts it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from math import ceil, cos, floor, pi, tau
from typing import Final

from robots.puma560.branches import MERGE_WRIST, Branch, Joints

SLACK: Final = 1e-10
"""How far outside a limit rounding may put a solution [rad]; it is moved onto the limit."""
NEARLY_SINGULAR: Final = 1e-4
"""|sin q5| below which rounding in q4 and q6 is worth compensating between them at a limit."""


def turns(q: float, low: float, high: float) -> Sequence[float]:
    """Return the values q + 2πk [rad] within [low, high], ends included to SLACK."""
    if q - tau < low - SLACK and q + tau > high + SLACK:
        if low <= q <= high:
            return (q,)
        return (min(max(q, low), high),) if low - SLACK <= q <= high + SLACK else ()
    return [min(max(value, low), high) for value in _between(q, low - SLACK, high + SLACK)]


def _between(q: float, low: float, high: float) -> list[float]:
    """Return the values q + 2πk [rad] within [low, high]."""
    return [q + k * tau for k in range(ceil((low - q) / tau), floor((high - q) / tau) + 1)]


def _shared(
    branch: Branch, low: Joints, high: Joints, near: tuple[float, float] | None
) -> Iterator[tuple[float, float]]:
    """Yield q4 and q6 where the wrist is singular: one pair for every turn of the sum that they share.

    Args:
        branch: A branch with |sin q5| ≈ 0.
        low: Lowest joint values [rad].
        high: Highest joint values [rad].
        near: Values of q4 and q6 to be close to; None means q4 = 0.
    """
    q4, q6 = branch.q[3], branch.q[5]
    fold = 1.0 if cos(branch.q[4]) > 0 else -1.0
    shared = q6 + fold * q4
    ends = sorted((fold * low[3], fold * high[3]))
    for total in turns(shared, low[5] + ends[0], high[5] + ends[1]):
        bounds = sorted((fold * (total - low[5]), fold * (total - high[5])))
        least, most = max(bounds[0], low[3]), min(bounds[1], high[3])
        wanted = 0.0 if near is None else (near[0] + fold * (total - near[1])) / 2
        p4 = min(max(wanted, least), most)
        yield min(max(p4, low[3]), high[3]), min(max(total - fold * p4, low[5]), high[5])


def _traded(branch: Branch, low: Joints, high: Joints) -> list[tuple[float, float]]:
    """Return the turns of q4 and q6 near the singular wrist, where one makes up for the other at a limit."""
    q4, q6 = branch.q[3], branch.q[5]
    give = SLACK / branch.sin5
    fold = 1.0 if cos(branch.q[4]) > 0 else -1.0
    found = []
    for a in _between(q4, low[3] - give, high[3] + give):
        moved = min(max(a, low[3]), high[3])
        for b in _between(q6, low[5] - give, high[5] + give):
            p6 = min(max(b + fold * (a - moved), low[5]), high[5])
            p4 = a + fold * (b - p6)
            if abs(p4 - a) <= give and low[3] - SLACK <= p4 <= high[3] + SLACK:
                found.append((min(max(p4, low[3]), high[3]), p6))
    return found


def all_turns(branch: Branch, low: Joints, high: Joints) -> list[Joints]:
    """Return every joint solution of a branch within the limits.

    Where the wrist is singular only those with the smallest possible |q4|.
    """
    q1, q2, q3, q4, q5, q6 = branch.q
    if not (first := turns(q1, low[0], high[0])):
        return []
    if not (second := turns(q2, low[1], high[1])):
        return []
    if not (third := turns(q3, low[2], high[2])):
        return []
    if not (fifth := turns(q5, low[4], high[4])):
        return []
    if branch.sin5 >= NEARLY_SINGULAR:
        fourth, sixth = turns(q4, low[3], high[3]), turns(q6, low[5], high[5])
        return [*product(first, second, third, fourth, fifth, sixth)]
    if branch.sin5 >= MERGE_WRIST:
        pairs = _traded(branch, low, high)
    else:
        pairs = list(_shared(branch, low, high, None))
        least = min((abs(pair[0]) for pair in pairs), default=0.0)
        pairs = [pair for pair in pairs if abs(pair[0]) <= least]
    return [(a, b, c, d, e, f) for a, b, c, e, (d, f) in product(first, second, third, fifth, pairs)]


def nearest_turns(q: Joints, near: Joints, low: Joints, high: Joints) -> Joints | None:
    """Return the turns of q nearest to near, for a wrist that isn't singular; None where a limit forbids all."""
    q1, q2, q3, q4, q5, q6 = q
    a1, a2, a3, a4, a5, a6 = low
    b1, b2, b3, b4, b5, b6 = high
    if a1 <= q1 <= b1 and a2 <= q2 <= b2 and a3 <= q3 <= b3 and a4 <= q4 <= b4 and a5 <= q5 <= b5:
        n1, n2, n3, n4, n5, n6 = near
        if (
            a6 <= q6 <= b6
            and -pi <= q1 - n1 <= pi
            and -pi <= q2 - n2 <= pi
            and -pi <= q3 - n3 <= pi
            and -pi <= q4 - n4 <= pi
            and -pi <= q5 - n5 <= pi
            and -pi <= q6 - n6 <= pi
        ):
            return q
    found = []
    for value, reference, least, most in zip(q, near, low, high, strict=True):
        if least <= value <= most and -pi <= value - reference <= pi:
            found.append(value)
            continue
        turned = value + tau * round((reference - value) / tau)
        if turned < least:
            turned += tau * ceil((least - turned) / tau)
        elif turned > most:
            turned -= tau * ceil((turned - most) / tau)
        if not least <= turned <= most:
            return None
        found.append(turned)
    q1, q2, q3, q4, q5, q6 = found
    return q1, q2, q3, q4, q5, q6


def nearest(branch: Branch, near: Joints, low: Joints, high: Joints) -> Joints | None:
    """Return the joint solution of a branch that is nearest to near within the limits, or None."""
    if branch.sin5 < MERGE_WRIST:
        pairs = list(_shared(branch, low, high, (near[3], near[5])))
        q1, q2, q3, _, q5, _ = branch.q
        arms = [turns(v, low[j], high[j]) for j, v in ((0, q1), (1, q2), (2, q3), (4, q5))]
        candidates = [(a, b, c, d, e, f) for a, b, c, e in product(*arms) for d, f in pairs]
    else:
        candidates = all_turns(branch, low, high)
    return min(candidates, key=lambda q: distance2(q, near), default=None)


def distance2(q: Joints, p: Joints) -> float:
    """Return the sum of squares of the joint differences [rad²]."""
    return sum((a - b) ** 2 for a, b in zip(q, p, strict=True))


def violation(branch: Branch, low: Joints, high: Joints) -> tuple[float, int, float]:
    """Return by how much a branch misses its worst limit [rad], that joint's index, and its value [rad]."""
    worst = (0.0, 0, branch.q[0])
    for j, value in enumerate(branch.q):
        if j == 3 and branch.sin5 < MERGE_WRIST:
            continue
        best = min((max(low[j] - v, v - high[j], 0.0), v) for v in (value + k * tau for k in (0, -1, 1, -2, 2)))
        worst = max(worst, (best[0], j, best[1]))
    return worst
