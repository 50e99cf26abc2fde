"""Both sites of a mobile robot that is driven live, round the parts of `interfaces.teleop.architectures`."""

from interfaces.teleop.driving.autonomy import Autonomy, Hands
from interfaces.teleop.driving.deviation import Deviation, PathDeviation
from interfaces.teleop.driving.host import DrivenHost
from interfaces.teleop.driving.operator import DriveLine, DrivingOperator
from interfaces.teleop.driving.pilot import JourneyPilot, Pilot
from interfaces.teleop.driving.robot import DrivenConfig, DrivenRobot

__all__ = [
    "Autonomy",
    "Deviation",
    "DriveLine",
    "DrivenConfig",
    "DrivenHost",
    "DrivenRobot",
    "DrivingOperator",
    "Hands",
    "JourneyPilot",
    "PathDeviation",
    "Pilot",
]
