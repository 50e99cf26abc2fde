"""Jerk-limited moves (cubic pieces, continuous acceleration) from any state, and stops.

A stop takes each joint to rest as fast as it can, with parabolas where the motion has them.
"""

from __future__ import annotations

import numpy as np

from vrs.commands import Profile
from vrs.errors import PlanningError
from vrs.model import Array, Limits
from vrs.notes import Note, NoteCode, Notes
from vrs.planning.certificate import violation
from vrs.planning.online import integrated, online
from vrs.planning.parabolic import brake, follow, rates
from vrs.planning.parabolic import from_rest as parabolic_from_rest
from vrs.planning.plan import Plan, empty, end_state
from vrs.planning.steering import change, rates_plan
from vrs.segment import State


def to_rest(state: State, q: Array, speed: float, limits: Limits) -> tuple[Plan, Notes]:
    """Plan from any state to rest at q, all joints arriving together.

    Args:
        state: Start, its acceleration included.
        q: Target [rad], (n,), within the position limits.
        speed: Share v of the speed limits, in (0, 1].
        limits: Limits that hold at every instant.

    Returns:
        The plan, and what the user must know of it.

    Raises:
        PlanningError: If no plan keeps the limits.
    """
    if not any(state.qd.tolist()) and not any(state.qdd.tolist()):
        return rest_to_rest(state.q, q, speed, limits), ()
    still = np.zeros(len(q))
    plan = online(state, State(q, still, still), speed, limits, order=3)
    if plan is not None:
        return plan, ()
    stop = brake(state, limits)
    stopped = end_state(stop).q if len(stop) else state.q
    plan = stop.then(rest_to_rest(stopped, q, speed, limits))
    problem = violation(plan, limits, jerk=True)
    if problem is not None:
        raise PlanningError(f"no jerk-limited plan from this state: {problem}")
    return plan, (Note(NoteCode.BRAKED_FIRST),)


def from_rest(start: Array, goal: State, speed: float, limits: Limits) -> tuple[Plan, Notes]:
    """Plan from rest to a state that moves or accelerates.

    Args:
        start: Where it begins [rad], (n,).
        goal: State to meet, its acceleration included; v is raised as far as it demands.
        speed: Share v of the speed limits, in (0, 1].
        limits: Limits that hold at every instant.

    Returns:
        The plan, and what the user must know of it.

    Raises:
        PlanningError: If no plan keeps the limits.
    """
    if not any(goal.qd.tolist()) and not any(goal.qdd.tolist()):
        return rest_to_rest(start, goal.q, speed, limits), ()
    still = np.zeros(len(start))
    plan = online(State(start, still, still), goal, speed, limits, order=3)
    if plan is not None:
        return plan, ()
    return parabolic_from_rest(start, goal, speed, limits), (Note(NoteCode.JOINED_BY_PARABOLAS),)


def rest_to_rest(start: Array, q: Array, speed: float, limits: Limits) -> Plan:
    """The seven-segment profile on the straight line of joint space, in the least time.

    Raises:
        PlanningError: If either position lies outside the limits.
    """
    allowed = rates(start.tolist(), q.tolist(), speed, limits)
    if allowed is None:
        return empty(len(q))
    # One part in 1e12 inside, so that rounding can't pass a limit.
    rate, growth, jerk = (value * (1.0 - 1e-12) for value in allowed)
    if rate * jerk >= growth * growth:
        ramp, steady = growth / jerk, rate / growth - growth / jerk
    else:
        ramp, steady = (rate / jerk) ** 0.5, 0.0
    cruise = 1.0 / rate - (2.0 * ramp + steady)
    if cruise < 0:
        cruise = 0.0
        ramp = growth / jerk
        whole = 0.5 * (ramp + (ramp * ramp + 4.0 / growth) ** 0.5)
        steady = whole - 2.0 * ramp
        if steady < 0:
            ramp, steady = (0.5 / jerk) ** (1.0 / 3.0), 0.0
    # Of the jerk 1, then scaled to cover the way exactly, whatever the durations were rounded to.
    durations: list[float] = []
    share: list[float] = []
    s = sd = sdd = 0.0
    for h, sddd in (
        (ramp, 1.0),
        (steady, 0.0),
        (ramp, -1.0),
        (cruise, 0.0),
        (ramp, -1.0),
        (steady, 0.0),
        (ramp, 1.0),
    ):
        if h > 1e-12 * ramp:
            durations.append(h)
            share += (s, sd, 0.5 * sdd, sddd / 6.0)
            s += h * (sd + h * (0.5 * sdd + h * sddd / 6.0))
            sd += h * (sdd + 0.5 * h * sddd)
            sdd += h * sddd
    return follow(start, q, durations, [value / s for value in share])


_PARALLEL = 1e-9
"""Share of an acceleration that may point aside from the motion on a straight line: rounding."""
_PATIENCE = 2.0
"""Stopping on the way may take this many times as long as each joint's braking, and `_GRACE` more."""
_GRACE = 0.05
"""[s]."""


def is_prompt_stop(on_way: float, braking: float) -> bool:
    """Whether a stop that keeps to the way takes little enough longer [s] than braking each joint [s]."""
    return on_way <= _PATIENCE * braking + _GRACE


def stop(state: State, profile: Profile, limits: Limits) -> tuple[Plan, Notes]:
    """Plan a stop.

    Args:
        state: Start.
        profile: Parabolic, or jerk-limited where that can be.
        limits: Limits that hold at every instant.

    Returns:
        The plan, empty at rest, and what the user must know of it.
    """
    if profile is Profile.JERK_LIMITED and (state.qd.any() or state.qdd.any()):
        made = rates_plan(state, np.zeros_like(state.q), 0.0, limits)
        if made is not None and not made[1] and violation(made[0], limits, jerk=True) is None:
            return made[0], ()
        return brake(state, limits), (Note(NoteCode.NO_SMOOTH_STOP),)
    return brake(state, limits), ()


def straight_stop(state: State, limits: Limits) -> Plan | None:
    """Stop with bounded jerk on the straight line of joint space that the arm moves along.

    Args:
        state: Start.
        limits: Limits that hold at every instant.

    Returns:
        The plan; None if the arm doesn't move on such a line, or can't stop so.
    """
    d = state.qd
    square = float(d @ d)
    if square == 0.0:
        return None
    acceleration = float(state.qdd @ d) / square
    if np.abs(state.qdd - acceleration * d).max() > _PARALLEL * np.abs(state.qdd).max():
        return None
    moving = d != 0
    A, J = (float((bound[moving] / np.abs(d[moving])).min()) for bound in (limits.qdd_max, limits.qddd_max))
    phases = change(1.0, acceleration, 0.0, A * (1.0 - 1e-12), J * (1.0 - 1e-12))
    h, jerks = np.array([phase[0] for phase in phases]), np.array([phase[1] for phase in phases])
    plan = integrated(State(state.q, d, acceleration * d), h, jerks[:, None] * d).plan()
    return plan if violation(plan, limits, jerk=True) is None else None
