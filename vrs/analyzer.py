"""The command analyser: integrity of a command against a robot, and the arm solution of its target.

Source: Doulgeri, Zikos, Delopoulos, section II-A.
"""

from __future__ import annotations

from typing import TypeAlias

from vrs.commands import (
    DriveCommand,
    InsertVia,
    JointTarget,
    MotionCommand,
    ParameterChange,
    PlanEdit,
    PositionQuery,
    SteerCommand,
    Target,
)
from vrs.errors import InvalidValueError
from vrs.model import Array, RobotModel

Checked: TypeAlias = MotionCommand | SteerCommand | PlanEdit | PositionQuery | ParameterChange
"""A command that an engine for an arm takes."""


def check(command: object, model: RobotModel) -> Checked:
    """Return the command if its form fits the robot.

    Raises:
        InvalidValueError: If it's no command for an arm of this many joints.
    """
    if isinstance(command, DriveCommand):
        raise InvalidValueError("command", command, f"for an arm: {model.name} has joints and no wheels")
    if not isinstance(command, Checked):
        allowed = "a MotionCommand, SteerCommand, PositionQuery, ParameterChange or an edit of the plan"
        raise InvalidValueError("command", command, allowed)
    n = model.limits.dof
    if isinstance(command, (MotionCommand, InsertVia)):
        target = command.target
        if isinstance(target, JointTarget) and target.q.shape != (n,):
            raise InvalidValueError("target q", target.q, f"of shape ({n},) for {model.name}")
    if isinstance(command, SteerCommand) and command.rates is not None and command.rates.shape != (n,):
        raise InvalidValueError("rates", command.rates, f"of shape ({n},) for {model.name}")
    return command


def solve(target: Target, model: RobotModel, q: Array) -> Array:
    """Joints of a target, (n,) [rad]; a pose is resolved nearest to the arm at q.

    Raises:
        OutOfLimitsError: If a joint target lies outside the position limits.
        UnreachablePoseError: If a pose has no arm solution within the limits.
        InvalidValueError: If the configuration isn't one.
    """
    if isinstance(target, JointTarget):
        model.limits.check(target.q)
        return target.q
    solution = model.inverse_near(target.X, q, target.configuration)
    model.limits.check(solution)
    return solution
