"""Trajectory generation: the inner part of f, eq. (1), for joint moves."""

from __future__ import annotations

from vrs.commands import Profile
from vrs.model import Array, Limits
from vrs.notes import Notes
from vrs.planning import jerk_limited, parabolic
from vrs.planning.certificate import violation
from vrs.planning.plan import Plan, empty
from vrs.planning.rounding import overlapped
from vrs.segment import State

__all__ = ["Plan", "empty", "move", "overlapped", "run_up", "violation"]


def move(state: State, q: Array, speed: float, profile: Profile, limits: Limits) -> tuple[Plan, Notes]:
    """Plan from any state to rest at q.

    Args:
        state: Start.
        q: Target [rad], (n,), within the position limits.
        speed: Share v of the speed limits, in (0, 1].
        profile: Time law.
        limits: Limits that hold at every instant.

    Returns:
        The plan, and what the user must know of it.

    Raises:
        PlanningError: If no plan keeps the limits.
    """
    if profile is Profile.PARABOLIC:
        return parabolic.to_rest(state, q, speed, limits), ()
    return jerk_limited.to_rest(state, q, speed, limits)


def run_up(q: Array, goal: State, speed: float, profile: Profile, limits: Limits) -> tuple[Plan, Notes]:
    """Plan from rest at q to the state in which a scheduled move begins.

    Args:
        q: Start [rad], (n,).
        goal: State to meet; v is raised as far as its velocity demands.
        speed: Share v of the speed limits, in (0, 1].
        profile: Time law.
        limits: Limits that hold at every instant.

    Returns:
        The plan, and what the user must know of it.

    Raises:
        PlanningError: If no plan keeps the limits.
    """
    if profile is Profile.PARABOLIC:
        return parabolic.from_rest(q, goal, speed, limits), ()
    return jerk_limited.from_rest(q, goal, speed, limits)
