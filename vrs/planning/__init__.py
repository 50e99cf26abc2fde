"""Trajectory generation: the inner part of f, eq. (1), for joint moves."""

from __future__ import annotations

import numpy as np

from vrs.chunk import State
from vrs.commands import Profile
from vrs.model import Array, Limits
from vrs.planning import jerk_limited, parabolic
from vrs.planning.online import online as _online
from vrs.planning.plan import Plan, empty, violation

__all__ = ["Plan", "empty", "move", "run_up", "violation"]


def move(state: State, q: Array, speed: float, profile: Profile, limits: Limits) -> tuple[Plan, str]:
    """Plan from any state to rest at q.

    Args:
        state: Start.
        q: Target [rad], (n,), within the position limits.
        speed: Share v of the speed limits, in (0, 1].
        profile: Time law.
        limits: Limits that hold at every instant.

    Returns:
        The plan, and what the user must know of it (empty if nothing).

    Raises:
        PlanningError: If no plan keeps the limits.
    """
    if profile is Profile.PARABOLIC:
        return parabolic.to_rest(state, q, speed, limits), ""
    return jerk_limited.to_rest(state, q, speed, limits)


def run_up(q: Array, goal: State, speed: float, profile: Profile, limits: Limits) -> tuple[Plan, str]:
    """Plan from rest at q to the state in which a scheduled move begins.

    Args:
        q: Start [rad], (n,).
        goal: State to meet; v is raised as far as its velocity demands.
        speed: Share v of the speed limits, in (0, 1].
        profile: Time law.
        limits: Limits that hold at every instant.

    Returns:
        The plan, and what the user must know of it (empty if nothing).

    Raises:
        PlanningError: If no plan keeps the limits.
    """
    jerky = profile is Profile.JERK_LIMITED
    if not goal.qd.any():
        planner = jerk_limited.rest_to_rest if jerky else parabolic.rest_to_rest
        return planner(q, goal.q, speed, limits), ""
    still = np.zeros_like(q)
    plan = _online(State(q, still, still), goal, speed, limits, order=3 if jerky else 2)
    if plan is not None:
        return plan, ""
    note = "the joining move accelerates with parabolas" if jerky else ""
    return parabolic.from_rest(q, goal, speed, limits), note
