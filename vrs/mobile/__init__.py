"""The virtual mobile robot: exact arcs on the timeline, posture estimator, virtual environment.

Source: Han, Kim, Kim, Kim, "Internet Control Architecture for Internet-Based Personal Robot", 2001.
"""

from __future__ import annotations

from vrs.mobile.avoidance import Avoidance
from vrs.mobile.environment import Grid, VirtualEnvironment, cast
from vrs.mobile.estimator import Feedback, PostureEstimator
from vrs.mobile.model import (
    DriveLimits,
    MobileModel,
    Wheels,
    advanced,
    braking,
    clipped,
    increment,
    limited,
    rotation,
    speeds,
    wheel_speeds,
    wrapped,
)
from vrs.mobile.timeline import ArcPiece, ArcTimeline

__all__ = [
    "ArcPiece",
    "ArcTimeline",
    "Avoidance",
    "DriveLimits",
    "Feedback",
    "Grid",
    "MobileModel",
    "PostureEstimator",
    "VirtualEnvironment",
    "Wheels",
    "advanced",
    "braking",
    "cast",
    "clipped",
    "increment",
    "limited",
    "rotation",
    "speeds",
    "wheel_speeds",
    "wrapped",
]
