"""Internet control architectures of a mobile robot, as short compositions of the same parts.

Source: Han, Kim, Kim, Kim, *Internet Control Architecture for Internet-Based Personal Robot*, 2001, for I, II, III
and the extended one; `III-capped` and `timeline` are ours.
"""

from interfaces.teleop.architectures.compositions import (
    ARCHITECTURES,
    Architecture,
    Constants,
    architecture,
    controller,
)
from interfaces.teleop.architectures.controllers import (
    Controller,
    Filtered,
    Following,
    Immediate,
    Player,
    PlayerConfig,
)
from interfaces.teleop.architectures.messages import DriveOrders, DriveReport, is_still
from interfaces.teleop.architectures.segments import Packet, Receiver, Sender, Transport
from interfaces.teleop.architectures.sites import OperatorSite, Position, Report, RobotSite
from interfaces.teleop.architectures.surroundings import (
    Aim,
    CellChanges,
    OperatorSurroundings,
    RobotSurroundings,
    Sonar,
)

__all__ = [
    "ARCHITECTURES",
    "Aim",
    "Architecture",
    "CellChanges",
    "Constants",
    "Controller",
    "DriveOrders",
    "DriveReport",
    "Filtered",
    "Following",
    "Immediate",
    "OperatorSite",
    "OperatorSurroundings",
    "Packet",
    "Player",
    "PlayerConfig",
    "Position",
    "Receiver",
    "Report",
    "RobotSite",
    "RobotSurroundings",
    "Sender",
    "Sonar",
    "Transport",
    "architecture",
    "controller",
    "is_still",
]
