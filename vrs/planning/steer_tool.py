"""A tool twist as joint motion: one time law s(t) for all joints, and a transient.

The tool goes along the asked-for twist at s(t) times its speed. What the arm moves beside that at the start (it
came from another direction) dies away as a transient of its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vrs.chunk import State
from vrs.model import Array, Limits, RobotModel
from vrs.planning.certificate import violation
from vrs.planning.plan import Plan
from vrs.planning.steer_course import FREE, Twist, TwistCourse, course
from vrs.planning.steer_joint import JerkProfile, change, cut, from_accelerations

STANDING = 1e-9
"""Share of the speed limits below which a joint doesn't move."""

_BUDGETS = ((0.85, 0.1, 1.0), (0.5, 0.4, 0.6), (0.3, 0.25, 0.3))
"""Shares of the acceleration and jerk limits for the time law and for the transient, and of the hold, tried in
turn. A shorter hold stops before a position limit that the longer one would pass."""
_TRANSIENTS = (0.06, 0.09, 0.12, 0.15, 0.19, 0.24, 0.3, 0.38, 0.48, 0.6, 0.75, 0.95)
"""Durations of a transient to try [s]."""
_GAP = 0.06
"""Longest segment [s]: accelerations run straight in it."""
_NEAR = 4e-3
"""Knots nearer than this [s] become one."""
_CLOSE = 0.01
"""Share of the asked-for speed that the time law leaves to the transient."""
_AHEAD = 0.12
"""How far beyond the hold the way is looked at [s at full speed]."""
_STOP = 0.8
"""How long after the hold the arm may still move [s]: each joint by itself stops in about half of that."""
_FOUR = np.arange(4.0)


class Transient(NamedTuple):
    """A motion that dies away: its acceleration runs straight between four knots."""

    duration: float
    """[s]."""
    a: Array
    """Accelerations at the knots, the last one 0, (4, n)."""

    def aside(self, dv: Array) -> Array:
        """Where it ends, from where it began at the rate dv [rad], (n,)."""
        h = self.duration / 3.0
        return np.asarray(3.0 * h * dv + h * h * (self.a[0] * (4.0 / 3.0) + self.a[1] * 2.0 + self.a[2]))


def transient(dv: Array, da: Array, T: float) -> Transient:
    """Bring a rate dv and an acceleration da to nothing in T, with the least squared jerk."""
    half = -1.5 / T * dv - 0.25 * da
    bend = da / 6.0
    return Transient(T, np.array([da, half + bend, half - bend, np.zeros_like(da)]))


def shortest(dv: Array, da: Array, limits: Limits, share: float) -> float:
    """The first of the durations to try in which a transient keeps a share of the limits; else the last [s]."""
    joints = zip(dv.tolist(), da.tolist(), limits.qdd_max.tolist(), limits.qddd_max.tolist(), strict=True)
    tried = iter(_TRANSIENTS)
    T = next(tried)
    for v, a, A, J in joints:
        # A longer duration asks less of every joint, unless a itself is the reason.
        while not _kept(v, a, share * A, share * J * T / 3.0, T):
            longer = next(tried, None)
            if longer is None:
                return T
            T = longer
    return T


def _kept(v: float, a: float, A: float, step: float, T: float) -> bool:
    """Whether one joint's transient keeps accelerations A, and changes of them from knot to knot of `step`."""
    half, bend = -1.5 / T * v - 0.25 * a, a / 6.0
    first, second = half + bend, half - bend
    most = max(abs(first - a), abs(second - first), abs(second))
    return max(abs(first), abs(second)) <= A and most <= step


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


def reachable(way: TwistCourse, A: float, J: float) -> Array:
    """Largest share at each place of the grid from which the caps ahead can still be kept, (k,).

    Args:
        way: With the caps.
        A: Largest rate of the share [1/s]; half of it is counted on.
        J: Largest rate of that [1/s²].
    """
    if way.caps is FREE:
        return FREE
    later = way.grid[None] - way.grid[:, None]
    lag = 0.25 * A * A / J
    brakes = way.caps + np.sqrt(lag * lag + A * np.maximum(later, 0.0)) - lag
    share = np.where(later >= 0.0, brakes, np.inf).min(axis=1)
    # Nothing is to be had beyond a place that mustn't be passed.
    share[np.minimum.accumulate(way.caps) <= 0.0] = 0.0
    return np.asarray(share)


def speed_law(
    s: float, ds: float, goal: float, hold: float, way: TwistCourse, A: float, J: float
) -> tuple[SpeedLaw, float]:
    """Bring the share from s to its goal, keep under the caps on the way, stop after `hold`.

    Args:
        s: Share at the start.
        ds: Its rate [1/s].
        goal: Share asked for.
        hold: When the stop begins [s].
        way: With the caps.
        A: Largest rate of the share [1/s].
        J: Largest rate of that [1/s²].

    Returns:
        The law, and the share that may be had at the start.
    """
    allowed = reachable(way, A, J)
    steps = 1 if allowed.min() >= goal else 5
    starts, states = [], []
    x, v, a, t = 0.0, s, ds, 0.0
    parts: list[tuple[float, float]] = [(goal, hold)] if steps == 1 else [(-1.0, hold / steps)] * steps
    for target, lasting in [*parts, (0.0, np.inf)] if hold > 0.0 else [(0.0, np.inf)]:
        u = target if target >= 0.0 else min(goal, float(np.interp(x, way.grid, allowed)))
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
    twist: Twist,
    goal: float,
    hold: float,
    limits: Limits,
    *,
    blocked: bool = False,
) -> tuple[Plan | None, float]:
    """Plan along a twist.

    Args:
        state: Start.
        model: The arm.
        u: Joint rates of the twist at the start [rad/s], (n,).
        twist: What to follow.
        goal: Share of its speed to reach.
        hold: When the stop begins [s].
        limits: Limits that hold at every instant.
        blocked: Whether a joint at its limit is in the way, so that only the share is of use.

    Returns:
        A certified plan, or None where none of the budgets gives one; and the share of the speed that may be
        had at the start.
    """
    # A joint counts by its share of the speed limits.
    onto_u = u / (limits.qd_max * limits.qd_max)
    onto_u = onto_u / float(onto_u @ u)
    s = float(state.qd @ onto_u)
    dv = state.qd - (goal if abs(s - goal) < _CLOSE else s) * u
    still = np.zeros_like(u)
    rough = transient(dv, still, shortest(dv, still, limits, _BUDGETS[0][1]))
    way = course(model, state.q, u, rough.aside(dv), twist, hold + _AHEAD, limits)
    bent = state.qdd - s * s * way.slope
    ds = float(bent @ onto_u)
    target = min(goal, float(way.caps[0]))
    if abs(s - target) < _CLOSE and abs(ds) < 20.0 * _CLOSE:
        # Near enough to leave the rest to the transient, without knots of its own.
        s, ds = target, 0.0
    dv, da = state.qd - s * u, bent - ds * u
    T = shortest(dv, da, limits, _BUDGETS[0][1])
    size = np.abs(u) + np.abs(way.curve) * way.seen**2
    bend = np.abs(way.slope) + np.abs(way.curve) * way.seen
    sharpest = float((bend / limits.qddd_max).max())
    for for_law, for_transient, part in _BUDGETS:
        A = for_law / max(float((size / limits.qdd_max).max()), 10.0 * sharpest)
        J = 0.7 * for_law / float((size / limits.qddd_max).max())
        law, share = speed_law(s, ds, goal, part * hold, way, A, J)
        if for_transient != _BUDGETS[0][1]:
            T = shortest(dv, da, limits, for_transient)
        if blocked or max(T, float(law.starts[-1])) > hold + _STOP:
            break
        plan = _composed(state, way, law, s, ds, T)
        problem = violation(plan, limits, jerk=True)
        if problem is None:
            return plan, share
    return None, share


def _composed(state: State, way: TwistCourse, law: SpeedLaw, s: float, ds: float, T: float) -> Plan:
    """The course under the law, and a transient of duration T that meets the state."""
    # The offset comes as 1 − (1 − t/T)².
    du = s * s * way.slope + (2.0 * s / T) * way.offset
    beside = transient(state.qd - s * way.u, state.qdd - ds * way.u - du, T)
    t = _knots([*law.starts.tolist(), T / 3.0, 2.0 * T / 3.0, T])
    x, v, a = law.at(t)
    left = np.maximum(1.0 - t / T, 0.0)
    x, v, a, left = x[:, None], v[:, None], a[:, None], left[:, None]
    u = way.u + (1.0 - left * left) * way.offset + x * (way.slope + 0.5 * x * way.curve)
    du = (2.0 / T * left) * way.offset + v * (way.slope + x * way.curve)
    hats = np.maximum(1.0 - np.abs((3.0 / T) * t[:, None] - _FOUR), 0.0)
    accelerations = a * u + v * du + hats @ beside.a
    accelerations[-1] = 0.0
    h = t[1:] - t[:-1]
    # What straight lines between the knots left over of the rate goes where the arm is about to stop.
    residue = state.qd + 0.5 * h @ (accelerations[1:] + accelerations[:-1])
    tail = np.maximum(t - 0.4 * t[-1], 0.0) * (t[-1] - t)
    accelerations -= (tail / (0.5 * h @ (tail[1:] + tail[:-1])))[:, None] * residue
    jerks = (accelerations[1:] - accelerations[:-1]) / h[:, None]
    return from_accelerations(state, h, accelerations[:-1], jerks)


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
