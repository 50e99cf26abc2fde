"""The virtual robot: values and pure functions of time on one timeline."""

from __future__ import annotations

from vrs.clock import Clock, ManualClock, OffsetClock, SlewedClock, WallClock
from vrs.commands import (
    Alter,
    Cancel,
    DriveCommand,
    Frame,
    Grip,
    Insertion,
    InsertVia,
    JointTarget,
    Lateness,
    Motion,
    MotionCommand,
    ParameterChange,
    PoseTarget,
    Position,
    PositionQuery,
    Profile,
    Redo,
    Resume,
    Retime,
    ScaleTime,
    SteerCommand,
    Stop,
)
from vrs.engine import Engine, MobileEngine
from vrs.ledger import Receipt, Status
from vrs.model import Limits, RobotModel
from vrs.segment import ArcSegment, PolynomialSegment, Segment
from vrs.timeline import Timeline

__all__ = [
    "Alter",
    "ArcSegment",
    "Cancel",
    "Clock",
    "DriveCommand",
    "Engine",
    "Frame",
    "Grip",
    "InsertVia",
    "Insertion",
    "JointTarget",
    "Lateness",
    "Limits",
    "ManualClock",
    "MobileEngine",
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
    "Redo",
    "Resume",
    "Retime",
    "RobotModel",
    "ScaleTime",
    "Segment",
    "SlewedClock",
    "Status",
    "SteerCommand",
    "Stop",
    "Timeline",
    "WallClock",
]
