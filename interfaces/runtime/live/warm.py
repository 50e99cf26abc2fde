"""What a site loads before it serves: the first command of a kind mustn't wait for modules."""

from __future__ import annotations

import numpy as np

from vrs.clock import ManualClock
from vrs.commands import (
    Cancel,
    Insertion,
    JointTarget,
    Motion,
    MotionCommand,
    PoseTarget,
    Profile,
    Resume,
    ScaleTime,
    SteerCommand,
    Stop,
)
from vrs.engine import Engine
from vrs.model import Array, RobotModel

_AWAY = 0.05
"""How far the joints of an engine that nobody sees are moved [rad]."""


def warm(model: RobotModel, q: Array) -> None:
    """Carry out a command of each kind on an engine that is thrown away.

    Args:
        model: The robot.
        q: Joints [rad], (n,), within the limits; what can't be done from there is left.
    """
    clock = ManualClock(0.0)
    engine = Engine(model, q=q, clock=clock)
    middle = 0.5 * (model.limits.q_min + model.limits.q_max)
    near = q + _AWAY * np.sign(middle - q)
    rates = np.full(len(q), 0.05)
    for command in (
        MotionCommand(JointTarget(near)),
        MotionCommand(JointTarget(q), execute_at=0.05, profile=Profile.JERK_LIMITED),
        MotionCommand(JointTarget(near), insertion=Insertion.APPEND, deviation=0.01),
        MotionCommand(PoseTarget(model.forward(q)), insertion=Insertion.APPEND, motion=Motion.LINE),
        ScaleTime(0.5),
        Cancel(2),
        Stop(),
        Resume(),
        SteerCommand(rates),
        SteerCommand(twist=np.zeros(6)),
    ):
        clock.advance(0.02)
        engine.execute(command)
    engine.undo()
    clock.advance(0.01)
    engine.anchor(Engine(model, timeline=engine.timeline, clock=clock).timeline)
