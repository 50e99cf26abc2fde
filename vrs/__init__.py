"""The virtual robot: values and pure functions of time on one timeline."""

from __future__ import annotations

from vrs.clock import Clock, ManualClock, OffsetClock, WallClock
from vrs.commands import (
    DriveCommand,
    Insertion,
    JointTarget,
    Lateness,
    Motion,
    MotionCommand,
    ParameterChange,
    PoseTarget,
    Position,
    PositionQuery,
    Profile,
    Receipt,
    Status,
)
from vrs.engine import Engine
from vrs.model import Limits, RobotModel
from vrs.segment import ArcSegment, PolynomialSegment, Segment
from vrs.timeline import Timeline

__all__ = [
    "ArcSegment",
    "Clock",
    "DriveCommand",
    "Engine",
    "Insertion",
    "JointTarget",
    "Lateness",
    "Limits",
    "ManualClock",
    "Motion",
    "MotionCommand",
    "OffsetClock",
    "ParameterChange",
    "PolynomialSegment",
    "PoseTarget",
    "Position",
    "PositionQuery",
    "Profile",
    "Receipt",
    "RobotModel",
    "Segment",
    "Status",
    "Timeline",
    "WallClock",
]
