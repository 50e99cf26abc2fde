"""Coming to rest from any state, each joint as fast as it can."""

from __future__ import annotations

import numpy as np

from vrs.commands import Profile
from vrs.model import Limits
from vrs.planning.certificate import violation
from vrs.planning.parabolic import brake
from vrs.planning.plan import Plan, integrate
from vrs.planning.steer_joint import change, rates_plan
from vrs.segment import State

BRAKED = "braked with parabolas: no jerk-limited stop from this state keeps the limits"

_PARALLEL = 1e-9
"""Share of an acceleration that may point aside from the motion on a straight line: rounding."""
_PATIENCE = 2.0
"""Stopping on the way may take this many times as long as each joint's braking, and `_GRACE` more."""
_GRACE = 0.05
"""[s]."""


def is_prompt(on_way: float, braking: float) -> bool:
    """Whether a stop that keeps to the way takes little enough longer [s] than braking each joint [s]."""
    return on_way <= _PATIENCE * braking + _GRACE


def stop(state: State, profile: Profile, limits: Limits) -> tuple[Plan, str]:
    """Plan a stop.

    Args:
        state: Start.
        profile: Parabolic, or jerk-limited where that can be.
        limits: Limits that hold at every instant.

    Returns:
        The plan, empty at rest, and what the user must know of it (empty if nothing).
    """
    if profile is Profile.JERK_LIMITED and (state.qd.any() or state.qdd.any()):
        made = rates_plan(state, np.zeros_like(state.q), 0.0, limits)
        if made is not None and not made[1] and violation(made[0], limits, jerk=True) is None:
            return made[0], ""
        return brake(state, limits), BRAKED
    return brake(state, limits), ""


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
    plan = integrate(State(state.q, d, acceleration * d), h, jerks[:, None] * d, 3)
    return plan if violation(plan, limits, jerk=True) is None else None
