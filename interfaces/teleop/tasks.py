"""What a mobile robot does by itself, as it crosses the link: goals and lists of jobs there, how far it is back.

Source: Kim, Han, Kim, Kim, section 4.1: supervisory control and job scheduling.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import Final, TypeAlias

from interfaces.jobs.messages import ListCommand, Load
from interfaces.jobs.progress import OperatorLoss, Progress
from robots.onboard.journey import Goal, JourneyState

Point: TypeAlias = tuple[float, float]
"""x, y [m]."""
MOST_POINTS: Final = 720
"""Of a scan, or a route."""


@dataclass(frozen=True, slots=True)
class Go:
    """Drive to a goal; a list of jobs that is being done is paused."""

    goal: Goal


@dataclass(frozen=True, slots=True)
class Halt:
    """Stop, and leave off whatever it does by itself; a list of jobs is paused."""

    reason: str = "somebody stopped the robot"


Task: TypeAlias = Go | Halt | ListCommand | Load
"""What is asked of it."""


def stops(task: Task) -> bool:
    """Whether a task only stops something: it counts however late it comes."""
    return isinstance(task, Halt) or task in (ListCommand.PAUSE, ListCommand.ABORT)


@dataclass(frozen=True, slots=True)
class Errand:
    """A task with its number: it's sent until the robot says that it has it, and done once."""

    number: int
    """From 1."""
    task: Task


class Doing(enum.StrEnum):
    """What a robot does by itself."""

    NOTHING = "nothing"
    GOAL = "goal"
    JOBS = "jobs"


@dataclass(frozen=True, slots=True)
class TaskReport:
    """How far a robot is with what it does by itself."""

    journey: JourneyState = JourneyState.IDLE
    reason: str = ""
    """Why it waits or couldn't get there."""
    goal: Goal | None = None
    route: tuple[Point, ...] = ()
    """The way that's being driven [m]."""
    digest: str = ""
    """Of the list of jobs that it has."""
    progress: Progress = field(default_factory=Progress)
    """How far that is."""
    loss: OperatorLoss = OperatorLoss.STOP
    """What follows when the operator is lost."""
    shows: str = ""
    """What stands on its screen."""
    says: str = ""
    """What it's saying."""


@dataclass(frozen=True, slots=True)
class SensedPoints:
    """What a robot sees of its surroundings."""

    time: float
    """By the robot's own clock [s]."""
    points: tuple[Point, ...]
    """Where its laser's beams ended, on the map [m]."""
    doubt: tuple[float, float, float] | None = None
    """Of its place: variance of x, covariance, variance of y [m²]; None where nobody knows."""
