"""Motions: what programs and the monitor ask of the arm becomes commands on a robot's timeline."""

from __future__ import annotations

from typing import TYPE_CHECKING

from interfaces.val2.motion.arm import Arm
from interfaces.val2.motion.robot import EngineRobot, RobotPort, SiteRobot

if TYPE_CHECKING:
    from collections.abc import MutableMapping

    from interfaces.stream.connection import Connection
    from vrs.engine import Engine

__all__ = ["Arm", "EngineRobot", "RobotPort", "SiteRobot", "arm_for"]


def arm_for(robot: Engine | Connection, *, parameters: MutableMapping[str, float] | None = None) -> Arm:
    """The arm of an engine in this process, or of a connection by `interfaces.connect`; for one thread.

    Raises:
        InvalidValueError: If the connection's robot isn't a PUMA 560, or its timeline doesn't come.
    """
    from vrs.engine import Engine

    if isinstance(robot, Engine):
        return Arm(EngineRobot(robot), parameters=parameters)
    from interfaces.val2.motion.remote import remote_robot

    return Arm(remote_robot(robot), parameters=parameters)
