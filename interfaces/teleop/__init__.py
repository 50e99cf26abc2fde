"""Both sites of a teleoperated robot: messages, the operator's, the robot's."""

from interfaces.teleop.following_arm import (
    FollowingArm,
    JointReference,
    RobotHost,
    RobotHostConfig,
    RobotSiteConfig,
)
from interfaces.teleop.operator import Correction, OperatorSite, SiteObserver, VirtualRobot
from interfaces.teleop.robot import AdaptiveOffset, OffsetConfig, RobotSite
from interfaces.teleop.virtual_arm import OperatorSiteConfig, RobotLine, VirtualArm

__all__ = [
    "AdaptiveOffset",
    "Correction",
    "FollowingArm",
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
