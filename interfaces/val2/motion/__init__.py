"""Motions: what programs and the monitor ask of the arm becomes commands on a robot's timeline."""

from __future__ import annotations

from typing import TYPE_CHECKING

from interfaces.val2.motion.arm import Arm
from interfaces.val2.motion.conventions import ArmConventions, conventions_of
from interfaces.val2.motion.robot import EngineRobot, RobotPort, SiteRobot

if TYPE_CHECKING:
    from collections.abc import MutableMapping

    from interfaces.stream.connection import Connection
    from robots.robot import Robot
    from vrs.engine import Engine

__all__ = ["Arm", "ArmConventions", "EngineRobot", "RobotPort", "SiteRobot", "arm_for", "conventions_of"]


def arm_for(
    reached: Engine | Connection,
    robot: Robot | None = None,
    *,
    parameters: MutableMapping[str, float] | None = None,
) -> Arm:
    """The arm of an engine in this process, or of a connection by `interfaces.connect`; for one thread.

    Args:
        reached: The engine or connection.
        robot: Which arm that is; of an engine its model alone says it unless given, of a connection it's a PUMA.
        parameters: See `Arm`.

    Raises:
        InvalidValueError: If the connection's robot is another one, or its timeline doesn't come.
    """
    from robots.robot import USUAL, load
    from vrs.engine import Engine

    if isinstance(reached, Engine):
        conventions = None if robot is None else conventions_of(robot)
        return Arm(EngineRobot(reached), conventions=conventions, parameters=parameters)
    from interfaces.val2.motion.remote import remote_robot

    robot = robot or load(USUAL)
    return Arm(remote_robot(reached, robot), conventions=conventions_of(robot), parameters=parameters)
