"""Both sites of a mobile robot that is driven live, round the parts of `interfaces.teleop.architectures`."""

from interfaces.teleop.driving.autonomy import Autonomy, Hands, JourneyPilot, LaserSight, NavigatorPilot, Pilot
from interfaces.teleop.driving.robot import DrivenConfig, DrivenHost, DrivenRobot

__all__ = [
    "Autonomy",
    "DrivenConfig",
    "DrivenHost",
    "DrivenRobot",
    "Hands",
    "JourneyPilot",
    "LaserSight",
    "NavigatorPilot",
    "Pilot",
]
