"""Both sites of a teleoperated robot: messages, the operator's, the robot's."""

from interfaces.teleop.messages import LogEntry, Orders, PlanPart, Report
from interfaces.teleop.operator import (
    CommandRecord,
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
from interfaces.teleop.samples import Sample

__all__ = [
    "AdaptiveOffset",
    "CommandRecord",
    "Correction",
    "JointReference",
    "LogEntry",
    "OffsetConfig",
    "OperatorSite",
    "OperatorSiteConfig",
    "Orders",
    "PlanPart",
    "Report",
    "RobotHost",
    "RobotHostConfig",
    "RobotLine",
    "RobotSite",
    "RobotSiteConfig",
    "Sample",
    "SiteObserver",
]  # fmt: skip
