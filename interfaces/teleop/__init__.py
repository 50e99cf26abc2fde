"""Both sites of a teleoperated robot: messages, the operator's, the robot's."""

from interfaces.teleop.host import RobotHost, RobotHostConfig
from interfaces.teleop.line import RobotLine
from interfaces.teleop.listening import Correction, Deed, Listener
from interfaces.teleop.measured import Sample
from interfaces.teleop.messages import Entry, Orders, PlanPart, Report
from interfaces.teleop.offset import AdaptiveOffset, OffsetConfig
from interfaces.teleop.operator import OperatorSite, OperatorSiteConfig
from interfaces.teleop.robot import Reference, RobotSite, RobotSiteConfig

__all__ = [
    "AdaptiveOffset", "Correction", "Deed", "Entry", "Listener", "OffsetConfig", "OperatorSite",
    "OperatorSiteConfig", "Orders", "PlanPart", "Reference", "Report", "RobotHost", "RobotHostConfig", "RobotLine",
    "RobotSite", "RobotSiteConfig", "Sample",
]  # fmt: skip
