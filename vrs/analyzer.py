"""The command analyser: integrity of a command against a robot, and the arm solution of its target.

Source: Doulgeri, Zikos, Delopoulos, section II-A.
"""

from __future__ import annotations

import numpy as np

from vrs.commands import (
    DriveCommand,
    JointTarget,
    Motion,
    MotionCommand,
    ParameterChange,
    PositionQuery,
    Target,
)
from vrs.errors import InvalidValueError
from vrs.model import Array, RobotModel


def check(command: object, model: RobotModel) -> MotionCommand | PositionQuery | ParameterChange:
    """Return the command if its form fits the robot.

    Raises:
        InvalidValueError: If it's no command for an arm of this many joints.
    """
    if isinstance(command, DriveCommand):
        raise InvalidValueError("command", command, f"for an arm: {model.name} has joints and no wheels")
    if not isinstance(command, (MotionCommand, PositionQuery, ParameterChange)):
        allowed = "a MotionCommand, PositionQuery or ParameterChange"
        raise InvalidValueError("command", command, allowed)
    if isinstance(command, MotionCommand) and isinstance(command.target, JointTarget):
        n = model.limits.dof
        if command.target.q.shape != (n,):
            raise InvalidValueError("target q", command.target.q, f"of shape ({n},) for {model.name}")
    return command


def solve(target: Target, motion: Motion, model: RobotModel, q: Array) -> Array:
    """Joints of a target, (n,) [rad]; a pose is resolved nearest to the arm at q.

    Raises:
        OutOfLimitsError: If a joint target lies outside the position limits.
        UnreachablePoseError: If a pose has no arm solution within the limits, or the motion isn't planned yet.
        InvalidValueError: If the configuration isn't one.
    """
    if motion is not Motion.JOINT:
        raise InvalidValueError("motion", str(motion), f"{Motion.JOINT} (straight lines come with a later version)")
    if isinstance(target, JointTarget):
        model.limits.check(target.q)
        return np.array(target.q)
    solution = model.inverse_near(target.X, q, target.configuration)
    model.limits.check(solution)
    return solution
