"""Both sites of a teleoperated robot: messages, the operator's, the robot's."""

from interfaces.teleop.operator import (
    Correction,
    OperatorSite,
    OperatorSiteConfig,
    RobotLine,
    SiteObserver,
)
from interfaces.teleop.robot import (
    AdaptiveOffset,
    JointReference,
    OffsetConfig,
    RobotHost,
    RobotHostConfig,
    RobotSite,
    RobotSiteConfig,
)

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
]  # fmt: skip
