"""Both sites of a teleoperated robot: messages, the operator's, the robot's."""

from interfaces.teleop.operator import Correction, OperatorSite, SiteObserver, VirtualRobot
from interfaces.teleop.robot import (
    AdaptiveOffset,
    JointReference,
    OffsetConfig,
    RobotHost,
    RobotHostConfig,
    RobotSite,
    RobotSiteConfig,
)
from interfaces.teleop.virtual_arm import OperatorSiteConfig, RobotLine, VirtualArm

__all__ = [
    "AdaptiveOffset",
    "Correction",
    "JointReference",
    "OffsetConfig",
    "OperatorSite",
    "OperatorSiteConfig",
    "RobotHost",
    "RobotHostConfig",
    "RobotLine",
    "RobotSite",
    "RobotSiteConfig",
    "SiteObserver",
    "VirtualArm",
    "VirtualRobot",
]  # fmt: skip
