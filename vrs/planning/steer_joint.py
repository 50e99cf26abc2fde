"""Joint rates under bounded jerk: each joint to a rate, held, then at rest, never beyond its position limits.

Each joint has a profile: phases of constant jerk. All joints' phases together make the segments of the plan.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from itertools import accumulate, pairwise
from math import copysign, sqrt
from typing import TypeAlias

import numpy as np

from vrs.model import Array, Limits
from vrs.planning.plan import Plan, empty, packed
from vrs.segment import State

JerkProfile: TypeAlias = list[tuple[float, float, float]]
"""(duration [s], jerk [rad/s³], acceleration at its end [rad/s²]) of each phase."""
Moving: TypeAlias = tuple[float, float, float]
"""Position, rate, acceleration of one joint."""

KNOT = 1e-12
"""Knots nearer than this [s] become one; a rate is then wrong by acceleration · KNOT, some 1e-11 rad/s."""
_SLIGHT = 1e-6
"""A peak of acceleration [rad/s²] that's left out; the rate is then wrong by _SLIGHT² / J, some 1e-14 rad/s."""
_ROUNDING = 1e-10
_BAND = 1e-11
"""Distance from a position limit [rad] that counts as at it."""
_NEAR = 1e-10
"""Distance from a position limit [rad] that isn't worth a motion."""


def change(v: float, a: float, u: float, A: float, J: float) -> JerkProfile:
    """Change a rate in the least time.

    Args:
        v: Present rate [rad/s].
        a: Present acceleration [rad/s²].
        u: Rate to reach, with no acceleration [rad/s].
        A: Largest acceleration [rad/s²]; a beyond it is brought back at once.
        J: Largest jerk [rad/s³].

    Returns:
        At most three phases.
    """
    sign = 1.0 if v + 0.5 * a * abs(a) / J <= u else -1.0
    a, d = sign * a, sign * (u - v)
    # The acceleration that the two ramps of a triangle meet at.
    peak = sqrt(max(J * d + 0.5 * a * a, 0.0))
    if a >= A:
        top = min(a, A)
        first = (a - top) / J
        level = (d - 0.5 * (a * a - top * top) / J - 0.5 * top * top / J) / top
    elif peak > A:
        top, first = A, (A - a) / J
        level = (d - (A * A - 0.5 * a * a) / J) / A
    else:
        top, first, level = max(peak, a), max(peak - a, 0.0) / J, 0.0
    if top < _SLIGHT:
        return [(abs(a) / J, -copysign(J, sign * a), 0.0)] if a else []
    up = -sign * J if a > top else sign * J
    phases = [(first, up, sign * top), (level, 0.0, sign * top), (top / J, -sign * J, 0.0)]
    return [phase for phase in phases if phase[0] > 0.0]


def cut(profile: JerkProfile, a: float, t: float) -> JerkProfile:
    """What of a profile that starts at acceleration a lies before t; without acceleration after its end."""
    kept: JerkProfile = []
    for h, j, after in profile:
        if h >= t:
            if t > 0.0:
                kept.append((t, j, a + t * j))
            return kept
        kept.append((h, j, after))
        t -= h
        a = after
    if t > 0.0:
        kept.append((t, 0.0, 0.0))
    return kept


def run(x: Moving, profile: JerkProfile) -> tuple[Moving, float, float]:
    """Where a profile ends, and the lowest and highest position on the way."""
    q, v, a = x
    low = high = q
    for h, j, after in profile:
        v_after = v + 0.5 * h * (a + after)
        half = 0.5 * j
        # The rate may pass through zero unseen twice, if the acceleration changes its sign.
        if v * v_after <= 0.0 or a * after < 0.0:
            for t in _zeros(v, a, half):
                if 0.0 < t < h:
                    turn = q + t * (v + t * (0.5 * a + t * half / 3.0))
                    low, high = min(low, turn), max(high, turn)
        q += h * (v + h * (2.0 * a + after) / 6.0)
        v, a = v_after, after
        low, high = min(low, q), max(high, q)
    return (q, v, a), low, high


def _zeros(c: float, b: float, a: float) -> tuple[float, ...]:
    """Roots of c + b t + a t², computed stably."""
    inside = b * b - 4.0 * a * c
    if inside < 0.0:
        return ()
    big = -0.5 * (b + (sqrt(inside) if b >= 0 else -sqrt(inside)))
    return ((c / big,) if big else ()) + ((big / a,) if a else ())


def one_joint(
    x: Moving,
    u: float,
    hold: float,
    low: float,
    high: float,
    V: float,
    A: float,
    J: float,
    share: float = 1.0,
) -> JerkProfile | None:
    """Bring a joint to a rate, hold it, then stop; or stop earlier, exactly at a position limit.

    Args:
        x: Present state.
        u: Rate asked for [rad/s].
        hold: When the stop begins [s].
        low: Lowest position [rad].
        high: Highest position [rad].
        V: Largest rate [rad/s].
        A: Largest acceleration [rad/s²].
        J: Largest jerk [rad/s³].
        share: Part of A and J with which the rate is changed; stops use all.

    Returns:
        The profile, or None where no bounded jerk keeps the joint within its limits.
    """
    q, v, a = x
    if not (u or v or a):
        return []
    low, high = min(low, q), max(high, q)
    if abs(v + 0.5 * a * abs(a) / (share * J)) > V:
        share = 1.0
    ramp = change(v, a, u, share * A, share * J)

    def until(t: float) -> tuple[JerkProfile, float]:
        return _then_stop(x, cut(ramp, a, t), low, high, A, J)

    held, over = until(hold)
    if over <= _BAND:
        return held
    if share < 1.0:
        return one_joint(x, u, hold, low, high, V, A, J)
    stop, least = until(0.0)
    if least > _BAND:
        return _turned_back(x, low, high, V, A, J)
    if least >= -_NEAR:
        return stop
    return _largest(until, hold, stop, least, over)


def _then_stop(
    x: Moving, begun: JerkProfile, low: float, high: float, A: float, J: float
) -> tuple[JerkProfile, float]:
    """A profile and the stop after it, and how far they pass the nearer position limit [rad]."""
    end, least, most = run(x, begun)
    stop = change(end[1], end[2], 0.0, A, J)
    _, least_after, most_after = run(end, stop)
    return begun + stop, max(max(most, most_after) - high, low - min(least, least_after))


def _largest(
    make: Callable[[float], tuple[JerkProfile, float]],
    too_late: float,
    best: JerkProfile,
    under: float,
    over: float,
) -> JerkProfile:
    """The profile that just doesn't pass: make(t) passes by `under` < 0 at t = 0 and by `over` > 0 at too_late."""
    early, late, f_early, f_late = 0.0, too_late, under, over
    for _ in range(80):
        # The false position, with one end's weight halved where the other moves twice running (Illinois).
        t = (early * f_late - late * f_early) / (f_late - f_early)
        if not early < t < late:
            t = 0.5 * (early + late)
        if not early < t < late:
            break
        profile, f = make(t)
        if f > _BAND:
            late, f_late, f_early = t, f, 0.5 * f_early
            continue
        best = profile
        if f >= -_BAND:
            break
        early, f_early, f_late = t, f, 0.5 * f_late
    return best


def _turned_back(x: Moving, low: float, high: float, V: float, A: float, J: float) -> JerkProfile | None:
    """Where stopping comes too late: brake on into the opposite direction, as little as keeps the limit."""
    _, v, a = x
    stop = change(v, a, 0.0, A, J)
    _, _, most = run(x, stop)
    away = -1.0 if most > high else 1.0

    def back(w: float) -> tuple[JerkProfile, float]:
        return _then_stop(x, change(v, a, away * w, A, J), low, high, A, J)

    best, over = back(V)
    if over > 0.0:
        return None
    enough, short = V, 0.0
    while enough - short > 1e-6 * V:
        w = 0.5 * (enough + short)
        profile, over = back(w)
        if over > 0.0:
            short = w
        else:
            best, enough = profile, w
    return best


def rates_plan(
    state: State, u: Array, hold: float, limits: Limits, shares: Sequence[float] | None = None
) -> tuple[Plan, bool] | None:
    """Bring every joint to its rate, hold it, stop.

    Args:
        state: Start.
        u: Rates asked for [rad/s], (n,), within the speed limits.
        hold: When the stops begin [s].
        limits: Limits that hold at every instant.
        shares: Part of its acceleration and jerk limits with which each joint changes its rate; all by default.

    Returns:
        The plan, and whether accelerations had to be dropped at its start (a joint so near its speed limit
        that bounded jerk would carry it over); None where a joint can't stay within its limits so.
    """
    q, qd, qdd = state.q.tolist(), state.qd.tolist(), state.qdd.tolist()
    lows, highs = limits.q_min.tolist(), limits.q_max.tolist()
    top = limits.qd_max.tolist(), limits.qdd_max.tolist(), limits.qddd_max.tolist()
    profiles = []
    dropped = False
    for j, (V, A, J) in enumerate(zip(*top, strict=True)):
        v, a = qd[j], qdd[j]
        if abs(v + 0.5 * a * abs(a) / J) > V * (1.0 + _ROUNDING):
            a = qdd[j] = copysign(sqrt(max(2.0 * J * (V - abs(v)), 0.0)), a)
            dropped = True
        share = 1.0 if shares is None else shares[j]
        profile = one_joint((q[j], v, a), float(u[j]), hold, lows[j], highs[j], V, A, J, share)
        if profile is None:
            return None
        profiles.append(profile)
    return joined(state, qdd, profiles), dropped


def joined(state: State, a: Sequence[float], profiles: list[JerkProfile]) -> Plan:
    """All joints' profiles on one grid.

    Args:
        state: Start.
        a: Accelerations to start with [rad/s²], n of them; they differ from the state's where those are dropped.
        profiles: One a joint.
    """
    n = len(profiles)
    ends = [list(accumulate(h for h, _, _ in profile)) for profile in profiles]
    grid = [0.0]
    for t in sorted(t for times in ends for t in times):
        if t - grid[-1] >= KNOT:
            grid.append(t)
    if len(grid) == 1:
        return empty(n)
    middles = [0.5 * (before + after) for before, after in pairwise(grid)]
    at: list[float] = []
    jerks: list[float] = []
    for profile, first in zip(profiles, a, strict=True):
        column: list[float] = []
        slopes: list[float] = []
        start, now = 0.0, first
        for h, j, after in profile:
            end, done = start + h, len(slopes)
            stop = bisect_left(middles, end, done)
            column += [now + j * (t - start) for t in grid[done:stop]]
            slopes += [j] * (stop - done)
            start, now = end, after
        rest = [0.0] * (len(middles) - len(slopes))
        at += column + rest
        jerks += slopes + rest
    knots = np.array(grid)
    return from_accelerations(
        state, knots[1:] - knots[:-1], packed(at).reshape(n, -1).T, packed(jerks).reshape(n, -1).T
    )


def from_accelerations(state: State, h: Array, a: Array, jerks: Array) -> Plan:
    """The plan of given accelerations and jerks.

    Args:
        state: Start; its acceleration doesn't count.
        h: Durations [s], (m,).
        a: Acceleration at the start of each segment [rad/s²], (m, n).
        jerks: Jerk in each segment [rad/s³], (m, n).
    """
    c = np.empty((len(h), 4, a.shape[1]))
    step = h[:, None]
    c[:, 3] = jerks / 6.0
    c[:, 2] = 0.5 * a
    c[0, 1], c[0, 0] = state.qd, state.q
    gain = np.add.accumulate(step * (a + 0.5 * step * jerks))
    c[1:, 1] = state.qd + gain[:-1]
    way = np.add.accumulate(step * (c[:, 1] + step * (c[:, 2] + step * c[:, 3])))
    c[1:, 0] = state.q + way[:-1]
    return Plan(h, c)
