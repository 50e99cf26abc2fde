"""The plans of one command: at its speed and pace, with its share of the acceleration, for its tool."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from math import inf
from typing import TypeVar

import numpy as np

from vrs import planning
from vrs.analyzer import solve
from vrs.chunk import State
from vrs.commands import JointTarget, Motion, MotionCommand, Profile
from vrs.errors import PlanningError
from vrs.insertion import joined
from vrs.model import Array, Limits, RobotModel
from vrs.planning import Plan
from vrs.planning.plan import end_position, slowed
from vrs.tooled import Tooled, tooled

HASTY = "planned with all of the limits: the arm is too fast for the command's pace or acceleration"

_CONTINUOUS = 0.5
"""Share of the acceleration that moves of a continuous path take: two of them overlap."""

_SLACK = 1.0 + 1e-9
"""What a limit is multiplied by to be kept: rounding."""

_Rest = TypeVar("_Rest")


def move(command: MotionCommand, model: RobotModel, limits: Limits, state: State) -> tuple[Plan, Array, str]:
    """Plan a command's move from any state, at a pace as at pace 1 and then slowed.

    Args:
        command: The command.
        model: The robot.
        limits: Limits that hold at every instant.
        state: Start.

    Returns:
        The plan, the joints where it ends, and what the user must know of it (empty if nothing).

    Raises:
        PlanningError: If no plan keeps the limits.
        UnreachablePoseError: If the target has no arm solution.
    """
    if is_plain(command):
        return _planned(command, command.speed, model, limits, state)

    def plan(speed: float, allowed: Limits, start: State) -> tuple[Plan, tuple[Array, str]]:
        made, q, note = _planned(command, speed, model, allowed, start)
        return made, (q, note)

    made, (q, note), hasty = _eased(command, limits, state, plan)
    return made, q, joined(note, hasty)


def join(command: MotionCommand, limits: Limits, q: Array, goal: State) -> tuple[Plan, str]:
    """Plan, as a command moves, from rest at q to the state in which a scheduled move begins; see `move`.

    Raises:
        PlanningError: If no plan keeps the limits.
    """
    if is_plain(command):
        return planning.run_up(q, goal, command.speed, command.profile, limits)

    def plan(speed: float, allowed: Limits, state: State) -> tuple[Plan, str]:
        return planning.run_up(q, state, speed, command.profile, allowed)

    made, note, hasty = _eased(command, limits, goal, plan)
    return made, joined(note, hasty)


def is_plain(command: MotionCommand) -> bool:
    """Whether a command takes the limits as they are."""
    return command.pace == 1.0 and command.acceleration == 1.0 and command.deviation < inf


def _eased(
    command: MotionCommand,
    limits: Limits,
    state: State,
    plan: Callable[[float, Limits, State], tuple[Plan, _Rest]],
) -> tuple[Plan, _Rest, str]:
    """Plan within a command's share of the limits, at its pace; else, from a moving arm, within all of them."""
    pace = command.pace
    allowed = eased(limits, command.acceleration * (_CONTINUOUS if command.deviation == inf else 1.0))
    quick = _quickened(state, pace)
    moving = bool(state.qd.any() or state.qdd.any())
    if not moving or _keeps(quick, allowed, command.profile):
        try:
            made, rest = plan(command.speed, allowed, quick)
        except PlanningError:
            if not moving:
                raise
        else:
            return (made if pace == 1.0 or not len(made) else slowed(made, 1.0 / pace)), rest, ""
    made, rest = plan(command.speed * pace, limits, state)
    return made, rest, HASTY


def _keeps(state: State, limits: Limits, profile: Profile) -> bool:
    """Whether a state keeps limits as far as a profile asks for that."""
    fast = bool((np.abs(state.qd) > _SLACK * limits.qd_max).any())
    smooth = profile is Profile.JERK_LIMITED
    return not fast and not (smooth and bool((np.abs(state.qdd) > _SLACK * limits.qdd_max).any()))


@lru_cache(maxsize=64)
def eased(limits: Limits, share: float) -> Limits:
    """Limits with a share of their acceleration and jerk; the same value for the same limits, which is kept."""
    if share == 1.0:
        return limits
    return replace(limits, qdd_max=share * limits.qdd_max, qddd_max=share * limits.qddd_max)


def _quickened(state: State, pace: float) -> State:
    """A state as it is where time runs 1/pace times as fast."""
    return state if pace == 1.0 else State(state.q, state.qd / pace, state.qdd / (pace * pace))


def _planned(
    command: MotionCommand, speed: float, model: RobotModel, limits: Limits, state: State
) -> tuple[Plan, Array, str]:
    profile, target = command.profile, command.target
    if command.motion is Motion.LINE:
        from vrs.planning.line import line

        seen = tooled(model, command.tool)
        if isinstance(target, JointTarget):
            model.limits.check(target.q)
            X = seen.forward(target.q)
            plan, note = line(state, X, speed, profile, seen, limits, q_goal=target.q)
            return plan, target.q, note
        X = target.X @ seen.tool if isinstance(seen, Tooled) else target.X
        plan, note = line(state, X, speed, profile, seen, limits, configuration=target.configuration)
        return plan, end_position(plan) if len(plan) else state.q, note
    # The arm solution is chosen from where the arm will be at the final execution time.
    q = solve(target, model, state.q)
    plan, note = planning.move(state, q, speed, profile, limits)
    return plan, q, note
