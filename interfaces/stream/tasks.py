"""What clients and a mobile robot's server tell each other of what the robot does by itself."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias

from interfaces.jobs import Forecast, JobList, ListCommand, Load, OperatorLoss, Progress
from interfaces.teleop.tasks import Doing, Go, Point
from robots.onboard.journey import Goal, JourneyState


class Trial(enum.StrEnum):
    """What is asked of the virtual robot alone."""

    DRY_RUN = "dry-run"
    """Say how long the list is likely to take."""


Wanted: TypeAlias = Go | Load | ListCommand | Trial
"""What a client asks for: a goal; a list in the place of the one before; that something is done with it."""


@dataclass(frozen=True, slots=True)
class TaskOrder:
    """Holder: let the robot do something by itself. The answer is a `Tasks` or a `Problem`."""

    kind: ClassVar[str] = "task"
    version: ClassVar[int] = 1
    number: int
    epoch: int
    wanted: Wanted


@dataclass(frozen=True, slots=True)
class Tasks:
    """Server: what the robot does by itself, and the list of jobs; the newest one counts."""

    kind: ClassVar[str] = "tasks"
    version: ClassVar[int] = 1
    doing: Doing = Doing.NOTHING
    journey: JourneyState = JourneyState.IDLE
    reason: str = ""
    """Why it waits or couldn't get there."""
    goal: Goal | None = None
    route: tuple[Point, ...] = ()
    """The way that's being driven [m]."""
    left: float = 0.0
    """Of that way [m]."""
    jobs: JobList = field(default_factory=JobList)
    progress: Progress = field(default_factory=Progress)
    forecast: Forecast | None = None
    """What the dry run said of this list; None where there was none since it was changed."""
    loss: OperatorLoss | None = None
    """What follows when the operator is lost; None before the robot is met."""
    shows: str = ""
    """What stands on its screen."""
    says: str = ""
    """What it's saying."""
    problem: str = ""
    """What is wrong with the file of the list; empty if nothing is."""
    answers: int | None = None
    """Number of the receiver's order that this answers."""


@dataclass(frozen=True, slots=True)
class Seen:
    """Server: what the robot sees of its surroundings; the newest one counts."""

    kind: ClassVar[str] = "seen"
    version: ClassVar[int] = 1
    time: float
    """By the robot's own clock [s]."""
    points: tuple[Point, ...]
    """Where its laser's beams ended, on the map [m]."""
    doubt: tuple[float, float, float] | None = None
    """Of its place: variance of x, covariance, variance of y [m²]; None where nobody knows."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Server: the known map of where the robot drives."""

    kind: ClassVar[str] = "plan"
    version: ClassVar[int] = 1
    size: Point
    """Of the floor, 0 ≤ x ≤ length and 0 ≤ y ≤ width [m]."""
    things: tuple[tuple[Point, ...], ...] = ()
    """Outlines of what stands there [m]."""
    via: tuple[Point, ...] = ()
    """Via points [m]."""
    robot: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """What the robot's rectangle reaches ahead and back from its driving axle, and its width [m]."""
