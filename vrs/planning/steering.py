"""Steering: a hand's rates or twist as a plan that goes on for a while and then stops by itself.

Every plan ends at rest, so the watchdog is in the plan: what no further input replaces stops the arm. Each joint
goes to a rate under bounded jerk, holds it, then rests, never beyond its position limits.

A tool twist leads through poses that are known: the joints there are found at some places ahead, and joined by one
polynomial. Lengths are divided by the model's characteristic length, so that linear and angular rows compare. One
time law s(t) holds for all joints: the tool goes along the asked-for twist at s(t) times its speed. What the arm
moves beside that at the start (it came from another direction) dies away as a transient of its own.

One concept in over 600 lines: the plan of one steering input, by joint rates or by a twist.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from itertools import accumulate, pairwise
from math import copysign, hypot, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vrs.checks import finite, finite_array
from vrs.commands import Frame
from vrs.errors import InvalidValueError, PlanningError
from vrs.model import Array, Limits, RobotModel, for_people
from vrs.notes import Note, NoteCode, Notes
from vrs.planning.certificate import violation
from vrs.planning.online import roots
from vrs.planning.parabolic import brake
from vrs.planning.path import polynomial
from vrs.planning.plan import Plan, empty, packed
from vrs.planning.redundancy import TASK, stiffness, units
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
_NEAR_LIMIT = 1e-10
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
            for t in roots(half, a, v):
                if 0.0 < t < h:
                    turn = q + t * (v + t * (0.5 * a + t * half / 3.0))
                    low, high = min(low, turn), max(high, turn)
        q += h * (v + h * (2.0 * a + after) / 6.0)
        v, a = v_after, after
        low, high = min(low, q), max(high, q)
    return (q, v, a), low, high


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
    if least >= -_NEAR_LIMIT:
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


SLOW_FROM = 30.0
"""Condition number from which approaching a singularity slows the tool."""
STOP_AT = 100.0
"""Condition number at which approaching ends, and above which rates are damped."""
_WEIGHTED = 10.0
"""By how much weights may make a condition number larger."""
_NODES = np.array([0.0, 0.04, 0.14, 0.3, 0.5, 0.7, 0.87, 1.0])
"""Where the way is looked at; the nearest, which is what is moved before the next input, the closest."""
_DEGREES = np.arange(len(_NODES) + 1.0)
"""Of a polynomial of which the values there, and the slope at 0, are known."""
_POWERS = _NODES[:, None] ** _DEGREES
_LED = _POWERS[:, 1:] / _DEGREES[1:] @ np.linalg.inv(_POWERS[:, :-1])
"""What rates at the nodes lead to there, on a way of 1, (k, k)."""
_THROUGH = np.linalg.inv(_POWERS[1:, 2:])
"""The higher coefficients of a polynomial with value and slope 0 at 0, from its values, (k - 1, k - 1)."""
_BENDS = _POWERS[:, :-2] * (_DEGREES * (_DEGREES - 1.0))[2:]
"""Second derivatives at the nodes, on a way of 1, of the higher coefficients, (k, k - 1)."""
_TWISTS = _POWERS[:, :-3] * (_DEGREES * (_DEGREES - 1.0) * (_DEGREES - 2.0))[3:]
"""Third derivatives, (k, k - 2)."""
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
_SHORTEST = 1e-3
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
        twists = np.empty((len(s), TASK))
        twists[:, :3] = self._turned(s)[0] @ self.linear if self.turns else self.linear
        twists[:, 3:] = self.angular
        return twists

    def leads(self, X: Array, s: Array) -> tuple[Array, Array]:
        """Where it leads from a pose X, (4, 4), at each of the times s.

        Returns:
            Ways of the tool over the characteristic length, (k, 3), and its rotation matrices, (k, 3, 3).
        """
        turned, led = self._turned(s)
        return led @ self.linear if self.turns else s[:, None] * self.linear, turned @ X[:3, :3]

    def _turned(self, s: Array) -> tuple[Array, Array]:
        """Rotations since the start at times s, (k, 3, 3), and their integrals over the time [s]."""
        x, y, z = w = self.angular.tolist()
        rate = hypot(*w) or 1.0
        K = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0))) / rate
        angle = (rate * s)[:, None, None]
        sine, rest = np.sin(angle), 1.0 - np.cos(angle)
        return _EYE + sine * K + rest * (K @ K), (angle * _EYE + rest * K + (angle - sine) * (K @ K)) / rate


_EYE = np.eye(3)


def _axial(M: Array) -> Array:
    """Σ a × b for M = Σ a bᵀ, (..., 3, 3): (..., 3)."""
    return np.asarray(M[..., (1, 2, 0), (2, 0, 1)] - M[..., (2, 0, 1), (1, 2, 0)])


def weighted_jacobian(model: RobotModel, q: Array) -> Array:
    """Jacobians of joint positions (k, n), linear rows over the characteristic length: (k, 6, n)."""
    J = np.array(model.jacobian(q))
    J[:, :3] /= model.characteristic_length
    return J


def damped_inverses(J: Array, stop_at: float = STOP_AT) -> tuple[Array, Array]:
    """What makes least rates of twists, damped where the condition number is above `stop_at`.

    A singular value σ below ε = σ_max / stop_at answers with σ/ε² instead of 1/σ: continuous, and 0 for the
    directions in which the tool can't go.

    Args:
        J: Jacobians, (k, m, n).
        stop_at: See above.

    Returns:
        (k, n, m), and σ_min / σ_max with the sign of det J (J square), (k,).
    """
    U, S, Vt = np.linalg.svd(J, full_matrices=False)
    floor = S[:, :1] / stop_at
    answer = 1.0 / np.maximum(np.maximum(S, floor), 1e-300)
    answer *= np.minimum(S / np.maximum(floor, 1e-300), 1.0)
    nearness = S[:, -1] / np.maximum(S[:, 0], 1e-300)
    if J.shape[1] == J.shape[2]:
        nearness = nearness * np.where(np.linalg.det(J) < 0.0, -1.0, 1.0)
    return (Vt.swapaxes(1, 2) * answer[:, None]) @ U.swapaxes(1, 2), nearness


def _plain_inverses(J: Array) -> tuple[Array, Array] | None:
    """The same of Jacobians (k, 6, n ≥ 6) far from singularities, σ_min / σ_max or less of it; None of others."""
    JT = J.swapaxes(1, 2)
    try:
        P = np.asarray(np.linalg.inv(J) if J.shape[1] == J.shape[2] else JT @ np.linalg.inv(J @ JT))
    except np.linalg.LinAlgError:
        return None
    nearness = 1.0 / np.sqrt(np.einsum("kij,kij->k", J, J) * np.einsum("kij,kij->k", P, P))
    return (P, nearness) if float(nearness.min()) > 1.0 / SLOW_FROM else None


def position_first(J: Array) -> tuple[Array, Array]:
    """The same of arms of fewer than six joints: the position goes as asked, and the tool turns as that admits.

    Args:
        J: Jacobians, (k, 6, n).

    Returns:
        (k, n, 6), damped as by `damped_inverses`, and σ_min / σ_max of the linear rows, (k,).
    """
    linear, angular = J[:, :3], J[:, 3:]
    U, S, Vt = np.linalg.svd(linear)
    m = S.shape[1]
    floor = np.maximum(S[:, :1] / STOP_AT, 1e-300)
    share = np.minimum(S / floor, 1.0)
    answer = share / np.maximum(S, floor)
    ways = (Vt[:, :m].swapaxes(1, 2) * answer[:, None]) @ U[:, :, :m].swapaxes(1, 2)
    left = np.ones(Vt.shape[:2])
    left[:, :m] -= share * share
    free = left[:, :, None] * Vt
    turns = free.swapaxes(1, 2) @ damped_inverses(angular @ free.swapaxes(1, 2))[0]
    both = np.concatenate([ways - turns @ (angular @ ways), turns], axis=2)
    return both, S[:, -1] / np.maximum(S[:, 0], 1e-300)


def inverses(model: RobotModel, q: Array, J: Array, held: NDArray[np.bool_] | None = None) -> tuple[Array, Array]:
    """What makes joint rates of twists, as an arm of any number of joints takes them.

    Those of a redundant arm are the least by the weights of `stiffness`: joints near their limits move less.

    Args:
        model: The arm.
        q: Joint positions, (k, n).
        J: Jacobians there, (k, 6, n).
        held: Which joints of a redundant arm stay where they are, (n,); none unless given.

    Returns:
        (k, n, 6), damped as by `damped_inverses`, and σ_min / σ_max, (k,).
    """
    n = J.shape[2]
    if n < TASK:
        return position_first(J)
    if n == TASK:
        return _plain_inverses(J) or damped_inverses(J)
    ease = units(model.prismatic, n, model.characteristic_length) / np.sqrt(stiffness(q, model.limits))
    if held is not None:
        ease, J = ease * ~held, J * ~held
    eased = J * ease[:, None]
    plain = None if held is not None else _plain_inverses(eased)
    if plain is not None:
        # The weights' own condition bounds what they hide.
        near = plain[1] * (ease.min(axis=1) / ease.max(axis=1))
        if float(near.min()) > 1.0 / SLOW_FROM:
            return ease[:, :, None] * plain[0], near
    # The weights are no reason to damp what the arm can do.
    return ease[:, :, None] * damped_inverses(eased, _WEIGHTED * STOP_AT)[0], _nearness(J)


def bend_along(J: Array, P: Array, u: Array, twist: Twist) -> Array:
    """How joint rates change on the way along a twist [rad/s²], at its start, (n,).

    Of a redundant arm, and where rates are damped, nearly.

    Args:
        J: The Jacobian there, (6, n).
        P: What makes rates of twists, (n, 6).
        u: Rates [rad/s], (n,).
        twist: What is followed.
    """
    # Joints turn the axes of those behind them, and what these carry.
    turns = J[3:] * u
    until = np.add.accumulate(turns, axis=1)
    before = until - turns
    change_here = np.concatenate([_axial((until + before) @ (J[:3] * u).T), _axial(before @ turns.T)])
    if twist.turns:
        change_here[:3] -= np.cross(twist.angular, twist.linear)
    return np.asarray(-P @ change_here)


def _rates(P: Array, twists: Array) -> Array:
    """Rates of twists (k, 6) by inverses (k, n, 6): (k, n)."""
    return np.asarray((P @ twists[:, :, None])[:, :, 0])


def rates_to_limits(q: Array, limits: Limits) -> tuple[Array, Array]:
    """Rates with which each joint may go down and up, falling to 0 at its limits: (n,), (n,) [rad/s]."""
    A = _BRAKING * limits.qdd_max
    lag = 0.5 * A * limits.qdd_max / limits.qddd_max
    down, up = np.maximum(q - limits.q_min, 0.0), np.maximum(limits.q_max - q, 0.0)
    low, high = (np.sqrt(lag * lag + 2.0 * A * way) - lag for way in (down, up))
    return -low, high


class TwistCourse(NamedTuple):
    """The joints along the twist, as functions of the way s [s at full speed]."""

    path: Array
    """Joint positions, from where it begins: ascending powers of s, (k + 1, n), the first 0."""
    A: Array
    """Largest rate of the share there that the acceleration limits leave [1/s], (k,)."""
    J: Array
    """Largest rate of that [1/s²], (k,)."""
    grid: Array
    """Ways at which the speed is bounded [s], (k,)."""
    caps: Array
    """Largest share of the asked-for speed there, (k,)."""

    def ending(self) -> TwistCourse:
        """The same for those who don't go beyond."""
        caps, ones = np.array(self.caps), np.ones_like(self.grid)
        caps[-1] = 0.0
        return self._replace(caps=caps, A=self.A * ones, J=self.J * ones)


def course(
    model: RobotModel,
    q: Array,
    u: Array,
    bend: Array,
    twist: Twist,
    reach: float,
    limits: Limits,
    held: NDArray[np.bool_] | None = None,
) -> TwistCourse:
    """Find the joints on the way.

    Args:
        model: The arm.
        q: Where it begins [rad], (n,).
        u: Rates there, nearly [rad/s], (n,).
        bend: How they change, nearly [rad/s²], (n,).
        twist: What to follow.
        reach: How far to look [s at full speed].
        limits: Their speeds and positions bound the share.
        held: Joints of a redundant arm that stay where they are, (n,); none unless given.
    """
    seen = reach
    while True:
        ways = seen * _NODES
        on_way, rates, near, share = _followed(model, q, u, bend, twist, ways, held)
        if share == 1.0 or seen <= _SHORTEST:
            break
        # Rates near a singularity change like 1 / σ_min: no polynomial fits them over a longer way.
        seen = max(0.9 * share * seen, _SHORTEST)
    # On the way as a share of it, and then as it is.
    path = np.empty((len(_DEGREES), len(q)))
    path[0], path[1] = 0.0, seen * rates[0]
    path[2:] = _THROUGH @ (on_way[1:] - _NODES[1:, None] * path[1])
    derivatives = np.abs(np.array((rates, (_BENDS @ path[2:]) / seen**2, (_TWISTS @ path[3:]) / seen**3)))
    path *= (1.0 / seen) ** _DEGREES[:, None]
    caps_at_nodes, A, J = _bounds(derivatives, limits)
    grid = seen * _FINE
    caps = FREE
    if caps_at_nodes.min() < 1.0:
        caps = np.interp(grid, ways, caps_at_nodes)
    sign = -1.0 if near[0] < 0.0 else 1.0
    if (sign * near).min() < 1.0 / SLOW_FROM or seen < reach:
        caps = np.minimum(caps, _share(np.interp(grid, ways, near), grid, sqrt(float(u @ u))))
        caps[-1] = 0.0 if seen < reach else caps[-1]
    places = q + on_way
    if (places < limits.q_min).any() or (places > limits.q_max).any():
        on = q + polynomial(path, grid)
        out = (on < np.minimum(q, limits.q_min) - _NEAR_LIMIT) | (on > np.maximum(q, limits.q_max) + _NEAR_LIMIT)
        if out.any():
            caps = caps * (np.arange(len(grid)) < out.any(axis=1).argmax() - 1)
    if caps is FREE:
        return TwistCourse(path, A.min(keepdims=True), J.min(keepdims=True), grid, caps)
    return TwistCourse(path, np.interp(grid, ways, A), np.interp(grid, ways, J), grid, caps)


def _followed(
    model: RobotModel,
    q: Array,
    u: Array,
    bend: Array,
    twist: Twist,
    ways: Array,
    held: NDArray[np.bool_] | None,
) -> tuple[Array, Array, Array, float]:
    """Find the joints at some ways along a twist, by Newton's method; inverses serve again where they're near.

    Returns:
        Joints from where the way begins, (k, n); rates there, (k, n); σ_min / σ_max there, (k,); the share of the
        way that's even. Where that's less than 1, the joints are of no use.
    """
    few = len(q) < TASK
    twists = twist.after(ways)
    on_way = ways[:, None] * (u + 0.5 * ways[:, None] * bend)
    goal, missed, off = None, twists, np.inf
    for _ in range(_CORRECTIONS):
        if off > _COARSE:
            looked_at = on_way
            J = weighted_jacobian(model, q + on_way)
            P, near = inverses(model, q + on_way, J, held)
            rates, share = _rates(P, twists), _even(P, near)
            if share < 1.0 and float(ways[-1]) > _SHORTEST:
                break
        on_way = on_way + _rates(P, missed) if goal else float(ways[-1]) * (_LED @ rates)
        if (goal and off * float(np.abs(on_way - looked_at).max()) < _NEARLY) or not _exact(J, near, rates, twists):
            break
        X = model.forward(q + on_way)
        goal = goal or twist.leads(X[0], ways)
        missed = np.zeros_like(twists)
        missed[:, :3] = goal[0] - (X[:, :3, 3] - X[0, :3, 3]) / model.characteristic_length
        if not few:
            missed[:, 3:] = 0.5 * _axial(X[:, :3, :3] @ goal[1].swapaxes(1, 2))
        off = float(np.abs(missed).max())
    return on_way, rates, near, share


def _exact(J: Array, near: Array, rates: Array, twists: Array) -> bool:
    """Whether rates, (k, n), by J, (k, 6, n), give twists, (k, 6); of fewer than six joints, their linear part."""
    if J.shape[2] >= TASK:
        return float(np.abs(near).min()) > 1.0 / STOP_AT
    return float(np.abs((J[:, :3] @ rates[:, :, None])[:, :, 0] - twists[:, :3]).max()) < _FOLLOWED


def _bounds(derivatives: Array, limits: Limits) -> tuple[Array, Array, Array]:
    """What the limits leave of the speed along the twist, where the way's derivatives are known.

    Args:
        derivatives: Sizes of the joints' first, second and third derivative by the way, (3, k, n).
        limits: Of the joints.

    Returns:
        The largest share of the speed, the largest rate of that [1/s], and of that in turn [1/s²], (k,) each.
    """
    # By derivative and limit, the joint that counts.
    ((speed, rate, jerk), (_, bent, bent_jerk), (_, _, twisted)) = (
        derivatives[:, None] / np.array((limits.qd_max, limits.qdd_max, limits.qddd_max))[:, None]
    ).max(axis=3)
    shares = np.minimum(
        _SPEED / speed,
        np.minimum(np.sqrt(_BENT / np.maximum(bent, _BENT)), np.cbrt(_JERKED / np.maximum(twisted, _JERKED))),
    )
    s = np.minimum(shares, 1.0)
    return shares, 1.0 / np.maximum(rate / (1.0 - s * s * bent), 6.0 * s * bent_jerk), 0.7 / jerk


def _even(P: Array, near: Array) -> float:
    """On which share of the way σ_min / σ_max changes little; if not of six joints, the inverses too.

    Args:
        P: Inverses, (k, n, 6).
        near: σ_min / σ_max, (k,).
    """
    n = P.shape[1]
    changes = np.abs(near - near[0]) / max(abs(float(near[0])), 1.0 / STOP_AT)
    if n != TASK:
        moved = 0.5 * np.abs(P - P[0]).max(axis=(1, 2)) / float(np.abs(P[0]).max())
        changes = moved if n < TASK else np.maximum(changes, moved)
    first = int((changes > _CHANGE).argmax())
    if first == 0:
        return 1.0
    (low, high), (start, end) = changes[first - 1 : first + 1].tolist(), _NODES[first - 1 : first + 1].tolist()
    return float(start + (end - start) * (_CHANGE - low) / (high - low))


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


_CORRECTIONS, _COARSE, _NEARLY = 4, 1e-3, 3e-6
"""How often the places on the way are looked for at most; from what they miss on [rad] other inverses are needed;
and what they may miss in the end."""
_CHANGE = 0.5
"""By which part σ_min / σ_max may change on a way that polynomials fit."""
_BENT, _JERKED = 0.4, 0.4
"""Shares of the acceleration and jerk limits for the bend of the way, and for how that changes."""
_FOLLOWED = 1e-6
"""By how much rates may miss a twist that the arm follows [rad/s]."""
STANDING = 1e-9
"""Share of the speed limits below which a joint doesn't move."""

_BUDGETS = ((0.85, 0.1, 1.0), (0.5, 0.4, 0.6), (0.3, 0.25, 0.3))
"""Shares of the acceleration and jerk limits for the time law and for the transient, and of the hold, tried in
turn. A shorter hold stops before a position limit that the longer one would pass."""
_TRANSIENTS = (0.06, 0.09, 0.12, 0.15, 0.19, 0.24, 0.3, 0.38, 0.48, 0.6, 0.75, 0.95)
"""Durations of a transient to try [s]."""
_GAP = 0.1
"""Longest segment [s]: a polynomial of the fifth degree."""
_NEAR = 4e-3
"""Knots nearer than this [s] become one."""
_CLOSE = 1e-4
"""Share of the asked-for speed that the time law leaves to the transient."""
_AHEAD = 0.2
"""How far beyond the hold the way is looked at [s at full speed]."""
_STOP = 0.95
"""How long after the hold the arm may still move [s]: each joint by itself stops in about half of that."""


def transient(dv: Array, da: Array, T: float) -> Array:
    """Bring a rate and an acceleration to nothing in T, with the least squared jerk.

    Returns:
        Where that leads: ascending powers of the time, (5, n), the first 0.
    """
    end = dv / T
    return np.array((np.zeros_like(dv), dv, 0.5 * da, -(end + da / 1.5) / T, (0.5 * end + 0.25 * da) / (T * T)))


_START = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 0.5], [-10, -6, -1.5], [15, 8, 1.5], [-6, -3, -0.5]])
_END = np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [10, -4, 0.5], [-15, 7, -1], [6, -3, 0.5]])
_BETWEEN = np.concatenate([_START, _END], axis=1)
"""Coefficients of the polynomial of the fifth degree on [0, 1] with given position, rate, acceleration at its start
and its end."""


def shortest(dv: Array, da: Array, limits: Limits, share: float) -> float:
    """The first of the durations to try in which a transient keeps a share of the limits; else the last [s]."""
    joints = zip(dv.tolist(), da.tolist(), limits.qdd_max.tolist(), limits.qddd_max.tolist(), strict=True)
    tried = iter(_TRANSIENTS)
    T = next(tried)
    for v, a, A, J in joints:
        # A longer duration asks less of every joint, unless a itself is the reason.
        while not _kept(v, a, share * A, share * J * T, T):
            longer = next(tried, None)
            if longer is None:
                return T
            T = longer
    return T


def _kept(v: float, a: float, A: float, step: float, T: float) -> bool:
    """Whether one joint's transient keeps accelerations A, and changes of them in T of `step`."""
    c = -6.0 * v / T - 3.0 * a
    if max(abs(c - a), abs(c + a)) > step:
        return False
    return abs(c) <= abs(a) or abs(a + (c - a) ** 2 / (4.0 * c)) <= A


class SpeedLaw(NamedTuple):
    """s(t): share of the asked-for speed, in phases of constant jerk."""

    starts: Array
    """(k,)."""
    state: Array
    """Way, share, its rate, its jerk at the start of each phase, (4, k); after the last one it stands."""

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Way [s at full speed], share and its rate [1/s] at times t."""
        i = np.maximum(np.searchsorted(self.starts, t, side="right") - 1, 0)
        x, v, a, j = self.state[:, i]
        u = t - self.starts[i]
        return x + u * (v + u * (a / 2 + u * j / 6)), v + u * (a + u * j / 2), a + u * j


def reachable(way: TwistCourse, part: float) -> Array:
    """Largest share at each place of the grid from which the caps ahead can still be kept, (k,).

    Args:
        way: With the caps.
        part: What of its A and J is used; of A half is counted on.
    """
    if way.caps is FREE:
        return FREE
    later = 0.0
    shares: list[float] = []
    gap = float(way.grid[1])
    for cap, A, J in zip(way.caps[::-1].tolist(), way.A[::-1].tolist(), way.J[::-1].tolist(), strict=True):
        lag = 0.25 * part * A * A / J
        later = min(cap, sqrt((later + lag) ** 2 + part * A * gap) - lag) if shares else cap
        shares.append(later)
    share = np.array(shares[::-1])
    # Nothing is to be had beyond a place that mustn't be passed.
    share[np.minimum.accumulate(way.caps) <= 0.0] = 0.0
    return share


def speed_law(
    s: float, ds: float, goal: float, hold: float, way: TwistCourse, part: float
) -> tuple[SpeedLaw, float]:
    """Bring the share from s to its goal, keep under the caps on the way, stop after `hold`.

    Args:
        s: Share at the start.
        ds: Its rate [1/s].
        goal: Share asked for.
        hold: When the stop begins [s].
        way: With the caps.
        part: What of its A and J is used.

    Returns:
        The law, and the share that may be had at the start.
    """
    allowed = reachable(way, part)
    As, Js = (part * way.A).tolist(), (part * way.J).tolist()
    gap, last = float(way.grid[1]), len(As) - 1
    capped = float(allowed[: int(max(s, goal) * hold / gap) + 2].min()) < goal
    steps = 5 if capped else 1
    starts, states = [], []
    x, v, a, t = 0.0, s, ds, 0.0
    for target, lasting in [*[(goal, hold / steps)] * steps, (0.0, np.inf)] if hold > 0.0 else [(0.0, np.inf)]:
        # What holds from here to where the step, or the stop, ends.
        here, fastest = min(max(int(x / gap), 0), last), abs(v) if capped else max(abs(v), target)
        far = x + fastest * min(lasting, fastest / As[here] + As[here] / Js[here])
        passed = slice(here, max(int(far / gap), here) + 2)
        A, J = min(As[passed]), min(Js[passed])
        u = min(target, *np.interp([x, far], way.grid, allowed).tolist()) if capped else target
        phases: JerkProfile = change(v, a, u, A, J)
        for h, j, after in cut(phases, a, lasting) if lasting < np.inf else phases:
            starts.append(t)
            states.append((x, v, a, j))
            x += h * (v + h * (2.0 * a + after) / 6.0)
            v += 0.5 * h * (a + after)
            a = after
            t += h
    starts.append(t)
    states.append((x, 0.0, 0.0, 0.0))
    return SpeedLaw(np.array(starts), np.array(states).T), float(allowed[0])


def along(
    state: State,
    model: RobotModel,
    u: Array,
    bend: Array,
    twist: Twist,
    goal: float,
    hold: float,
    limits: Limits,
    held: NDArray[np.bool_] | None = None,
) -> tuple[Plan | None, float]:
    """Plan along a twist.

    Args:
        state: Start.
        model: The arm.
        u: Joint rates of the twist at the start [rad/s], (n,).
        bend: How they change on the way [rad/s²], (n,).
        twist: What to follow.
        goal: Share of its speed to reach.
        hold: When the stop begins [s].
        limits: Limits that hold at every instant.
        held: Joints of a redundant arm that stay where they are, (n,); none unless given.

    Returns:
        A certified plan, or a stop on the way, or None where none of the budgets gives one; and the share of the
        speed that may be had at the start.
    """
    # A joint counts by its share of the speed limits.
    onto_u = u / (limits.qd_max * limits.qd_max)
    onto_u = onto_u / float(onto_u @ u)
    s = float(state.qd @ onto_u)
    dv = state.qd - (goal if abs(s - goal) < _CLOSE else s) * u
    # Half of the way at that rate is where a transient leads.
    aside = 0.5 * shortest(dv, np.zeros_like(u), limits, _BUDGETS[0][1]) * dv
    way = course(model, state.q + aside, u, bend, twist, hold + _AHEAD, limits, held)
    u, slope = way.path[1], 2.0 * way.path[2]
    bent = state.qdd - s * s * slope
    ds = float(bent @ onto_u)
    target = min(goal, float(way.caps[0]))
    if abs(s - target) < _CLOSE and abs(ds) < 20.0 * _CLOSE:
        # Near enough to leave the rest to the transient, without knots of its own.
        s, ds = target, 0.0
    dv, da = state.qd - s * u, bent - ds * u
    for to in dict.fromkeys((goal, 0.0)):
        for for_law, for_transient, part in _BUDGETS:
            law, share = speed_law(s, ds, to, part * hold, way, for_law)
            if float(law.state[0, -1]) > float(way.grid[-1]):
                way = way.ending()
                law, share = speed_law(s, ds, to, part * hold, way, for_law)
            T = shortest(dv, da, limits, for_transient)
            if max(T, float(law.starts[-1])) > hold + _STOP:
                break
            plan = _composed(state, way, law, transient(dv, da, T), T)
            if violation(plan, limits, jerk=True) is None:
                return plan, share
    return None, share


def _composed(state: State, way: TwistCourse, law: SpeedLaw, beside: Array, T: float) -> Plan:
    """The course under the law, and beside it a transient of duration T that meets the state."""
    t = _knots([*law.starts.tolist(), T])
    x, v, a = law.at(t)
    # Positions from where the arm is, as the others would lose digits.
    q, u, bend = _derivatives(way.path, x)
    left, rate, change_here = _derivatives(beside, np.minimum(t, T))
    v, a = v[:, None], a[:, None]
    at = np.array((q + left, v * u + rate, a * u + v * v * bend + change_here))
    at[1:, 0] = state.qd, state.qdd
    at[1:, -1] = 0.0
    h = t[1:] - t[:-1]
    powers = h[:, None] ** _DEGREES[:6]
    scale = powers[:, :3].T[:, :, None]
    c = _BETWEEN @ np.concatenate([at[:, :-1] * scale, at[:, 1:] * scale]).swapaxes(0, 1)
    c /= powers[:, :, None]
    c[:, 0] += state.q
    return Plan(h, c)


def _derivatives(c: Array, x: Array) -> tuple[Array, Array, Array]:
    """Values, slopes and bends at x, (k,), of ascending powers, (K, n): (k, n) each."""
    degrees = _DEGREES[: len(c), None]
    powers = x[:, None] ** degrees[:, 0]
    slope = degrees[1:] * c[1:]
    return powers @ c, powers[:, :-1] @ slope, powers[:, :-2] @ (degrees[1:-1] * slope[1:])


def _knots(times: list[float]) -> Array:
    """The times in order from 0 to the last, none nearer than _NEAR, none farther apart than _GAP."""
    end = max(times)
    knots = [0.0]
    for t in sorted(times):
        if t - knots[-1] >= _NEAR and (end - t >= _NEAR or t == end):
            gap = t - knots[-1]
            parts = int(gap / _GAP) + 1
            start = knots[-1]
            knots += [start + gap * k / parts for k in range(1, parts)]
            knots.append(t)
    return np.array(knots)


_SLOWED = 0.5
"""A hand is told what is in its way where less than this share is left of what it asks for."""
_TRIED = 0.1
"""How far each joint is moved to see whether that leads away from a singularity [rad]."""


def steer(
    state: State,
    rates: ArrayLike | None,
    twist: ArrayLike | None,
    frame: Frame,
    hold: float,
    model: RobotModel,
    limits: Limits,
) -> tuple[Plan, Notes, str]:
    """Plan what a hand asks for now, for as long as the input is fresh, and the stop after that.

    Args:
        state: Start; any state within the limits.
        rates: Joint rates [rad/s], (n,); beyond the speed limits all are scaled alike. None with a twist.
        twist: Of the tool, (6,): linear [m/s], then angular [rad/s], of the last link's frame; beyond the model's
            nominal speeds scaled. None with rates.
        frame: Axes of the twist; those of the tool turn with it.
        hold: How long to go on [s]; 0 or less stops.
        model: The arm.
        limits: Limits that hold at every instant.

    Returns:
        A certified plan that ends at rest, empty where the arm stands and stays; what the user must know of it;
        what keeps the arm from going as asked, and what leads away from it, empty if nothing does.

    Raises:
        InvalidValueError: If not exactly one of rates and twist is given, or something is of the wrong form.
        PlanningError: If the state can't be brought to rest within the limits.
    """
    n = limits.dof
    lasting = max(finite("hold", hold, "finite seconds"), 0.0)
    if not isinstance(frame, Frame):
        raise InvalidValueError("frame", frame, "base or tool")
    if rates is not None and twist is None:
        u = finite_array("rates", rates, (n,), f"finite joint rates [rad/s], shape ({n},)")
        return *_by_rates(state, u, lasting, limits), _at_limit(state.q, u, limits, model)
    if twist is None or rates is not None:
        raise InvalidValueError("rates and twist", (rates, twist), "one of the two, the other None")
    given = finite_array("twist", twist, (6,), "a finite twist (v [m/s], w [rad/s]), shape (6,)")
    return _by_twist(state, _wanted(given, frame, state, model), lasting, model, limits)


def _by_rates(
    state: State, u: Array, hold: float, limits: Limits, shares: Sequence[float] | None = None
) -> tuple[Plan, Notes]:
    u = u / max(1.0, *(abs(rate) / V for rate, V in zip(u.tolist(), limits.qd_max.tolist(), strict=True)))
    made = rates_plan(state, u, hold, limits, shares)
    if made is not None and violation(made[0], limits, jerk=True) is None:
        return made[0], (Note(NoteCode.ACCELERATIONS_DROPPED),) if made[1] else ()
    plan = brake(state, limits)
    problem = violation(plan, limits, jerk=False)
    if problem is not None:
        raise PlanningError(f"no stop from this state: {problem}")
    return plan, (Note(NoteCode.NO_SMOOTH_STEERING),)


def _wanted(given: Array, frame: Frame, state: State, model: RobotModel) -> Twist:
    """The twist in the base frame, not faster than nominal, its linear part over the characteristic length."""
    v, w = given[:3], given[3:]
    scale = max(1.0, hypot(*v.tolist()) / model.tool_speed, hypot(*w.tolist()) / model.tool_turn_speed)
    scale_linear = scale * model.characteristic_length
    if frame is Frame.TOOL:
        R = model.forward(state.q)[:3, :3]
        v, w = R @ v, R @ w
    return Twist(v / scale_linear, w / scale, frame is Frame.TOOL)


def _by_twist(
    state: State, twist: Twist, hold: float, model: RobotModel, limits: Limits
) -> tuple[Plan, Notes, str]:
    q = state.q[None]
    J = weighted_jacobian(model, q)
    asked = np.concatenate([twist.linear, twist.angular])
    P, _ = inverses(model, q, J)
    u = P[0] @ asked
    if hold == 0.0 or float((np.abs(u) / limits.qd_max).max()) < STANDING:
        stuck = hold > 0.0 and bool(asked.any())
        return *_released(state, J[0], P[0], hold, model, limits), _stuck(state.q, model) if stuck else ""
    hindrance = _at_limit(state.q, u, limits, model)
    held = None
    if hindrance and len(u) > TASK:
        held, P = _without_limits(model, state.q, u, J, P, limits)
        u = P[0] @ asked
        hindrance = hindrance if held is None else ""
    bend = bend_along(J[0], P[0], u, twist)
    plan, share = along(state, model, u, bend, twist, 1.0, hold, limits, held)
    missed = asked - J[0] @ u
    slowed = share < _SLOWED or float(missed @ missed) > (1.0 - _SLOWED) ** 2 * float(asked @ asked)
    if slowed and not hindrance and float(_nearness(J)[0]) < 1.0 / SLOW_FROM:
        hindrance = _singular(state.q, model)
    if plan is not None:
        return plan, (), hindrance
    low, high = rates_to_limits(state.q, limits)
    u = np.clip(share * u, low, high)
    return *_by_rates(state, u, hold, limits, _together(state, u, limits)), hindrance


def _without_limits(
    model: RobotModel, q: Array, u: Array, J: Array, P: Array, limits: Limits
) -> tuple[NDArray[np.bool_] | None, Array]:
    """Which joints of a redundant arm stay at their limits while the others do what is asked, and their inverses.

    None, and the inverses as they were, where the others can't.
    """
    low, high = rates_to_limits(q, limits)
    held = (_SLOWED * u < low) | (_SLOWED * u > high)
    of_others, near = inverses(model, q[None], J * ~held, held)
    if held.sum() > len(u) - TASK or near[0] < 1.0 / SLOW_FROM:
        return None, P
    return held, of_others


def _at_limit(q: Array, u: Array, limits: Limits, model: RobotModel) -> str:
    """Say which joint a position limit keeps from moving at the rates u [rad/s]; empty where none does."""
    low, high = rates_to_limits(q, limits)
    most = np.where(u < 0.0, -low, high)
    left = np.where(u == 0.0, 1.0, most / np.maximum(np.abs(u), 1e-12))
    joint = int(left.argmin())
    if left[joint] >= _SLOWED:
        return ""
    which, back = ("lower", "up") if u[joint] < 0.0 else ("upper", "down")
    at, unit = for_people(joint, float((limits.q_min if u[joint] < 0.0 else limits.q_max)[joint]), model.prismatic)
    where = f"{at:.0f}°" if unit == "deg" else f"{at:g} {unit}"
    return f"joint {joint + 1} is at its {which} limit, {where}: jog it {back}, or move back"


def _nearness(J: Array) -> Array:
    """σ_min / σ_max of weighted Jacobians, (k,)."""
    S = np.linalg.svd(J, compute_uv=False)
    return np.asarray(S[:, -1] / np.maximum(S[:, 0], 1e-300))


def _stuck(q: Array, model: RobotModel) -> str:
    """Say why no joint moves at a twist."""
    n = len(q)
    if n < TASK:
        which = "its only joint" if n == 1 else f"the arm's {n} joints"
        return f"{which} can't move the tool that way: jog joints instead"
    return _singular(q, model)


def _singular(q: Array, model: RobotModel) -> str:
    """Say which joint, and which way, leads away from the singularity that is near q."""
    limits, n = model.limits, len(q)
    places = np.concatenate([q + _TRIED * np.eye(n), q - _TRIED * np.eye(n)])
    gains = _nearness(weighted_jacobian(model, places)) - _nearness(weighted_jacobian(model, q[None]))
    gains[((places < limits.q_min) | (places > limits.q_max)).any(axis=1)] = -np.inf
    best = int(gains.argmax())
    joint, other = best % n, float(gains[(best + n) % (2 * n)])
    # From a singularity itself both ways lead away.
    way = "" if other > 0.5 * float(gains[best]) else " up" if best < n else " down"
    return f"near a singularity: jog joint {joint + 1}{way}, or move back"


def _released(
    state: State, J: Array, P: Array, hold: float, model: RobotModel, limits: Limits
) -> tuple[Plan, Notes]:
    """Stop on the way that the tool is going."""
    u = state.qd
    if float((np.abs(u) / limits.qd_max).max()) >= STANDING:
        present = J @ u
        twist = Twist(present[:3], present[3:], False)
        plan, _ = along(state, model, u, bend_along(J, P, u, twist), twist, 0.0, hold, limits)
        if plan is not None:
            return plan, ()
    return _by_rates(state, np.zeros_like(u), hold, limits)


def _together(state: State, u: Array, limits: Limits) -> list[float]:
    """Shares of the limits with which all joints reach their rates at once, so that the direction is kept."""
    needed = np.abs(u - state.qd) / limits.qdd_max
    longest = float(needed.max())
    if longest < STANDING:
        return [1.0] * len(u)
    share = np.maximum(needed / longest, np.abs(state.qdd) / limits.qdd_max)
    return [float(value) for value in np.clip(share, 1e-3, 1.0)]
