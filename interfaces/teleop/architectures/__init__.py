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
    Filtered,
    FollowingController,
    Immediate,
    TimelineController,
)
from interfaces.teleop.architectures.sites import (
    ArchitectureOperatorSite,
    ArchitectureRobotSite,
    DriveController,
    Transport,
)
from interfaces.teleop.architectures.surroundings import OperatorSurroundings, RobotSurroundings

__all__ = [
    "ARCHITECTURES",
    "Architecture",
    "ArchitectureOperatorSite",
    "ArchitectureRobotSite",
    "Constants",
    "DriveController",
    "Filtered",
    "FollowingController",
    "Immediate",
    "OperatorSurroundings",
    "RobotSurroundings",
    "TimelineController",
    "Transport",
    "architecture",
    "controller",
]
