"""Both sites of a teleoperated robot: messages, the operator's, the robot's."""

from interfaces.teleop.host import RobotHost, RobotHostConfig
from interfaces.teleop.line import RobotLine
from interfaces.teleop.measured import Sample
from interfaces.teleop.messages import LogEntry, Orders, PlanPart, Report
from interfaces.teleop.observers import CommandRecord, Correction, SiteObserver
from interfaces.teleop.offset import AdaptiveOffset, OffsetConfig
from interfaces.teleop.operator import OperatorSite, OperatorSiteConfig
from interfaces.teleop.robot import JointReference, RobotSite, RobotSiteConfig

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
