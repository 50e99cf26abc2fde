"""What crosses the link of a mobile robot: orders and reports, and what it does by itself.

Source: Kim, Han, Kim, Kim, section 4.1: supervisory control and job scheduling.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import ClassVar, Final, TypeAlias

from interfaces.jobs.runner import ListCommand, Load
from interfaces.jobs.values import OperatorLoss, Progress
from interfaces.messages.fields import Party
from interfaces.teleop.architectures.sites import ArchitectureReport, ArcPacket
from robots.onboard.driving import Drive, Posture
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


STILL: Final = Drive(0.02, 0.05)
"""A robot that's told to move slower than this stands: it only keeps its place [m/s, rad/s]."""


def is_still(drive: Drive) -> bool:
    """Whether a robot that's told that is at rest."""
    return abs(drive.v) <= STILL.v and abs(drive.w) <= STILL.w


@dataclass(frozen=True, slots=True)
class DriveOrders:
    """From the operator's site: arcs of the virtual robot's path, or a heartbeat without any.

    An epoch is a drive that begins where the real robot stands: both sites make their parts anew for it. Times of
    its arcs count from when it began.
    """

    sender: ClassVar[Party] = Party.SITE
    epoch: int
    """Of the operator's site, from 1."""
    number: int
    """Of the packet, from 1."""
    sent_at: float
    """By the operator's clock [s]."""
    began: float
    """When the epoch began, by the operator's clock [s]: time 0 of its arcs."""
    start: Posture | None
    """Where it began; None while nobody drives."""
    packet: ArcPacket
    """What the robot may lack."""
    errands: tuple[Errand, ...] = ()
    """Tasks that it isn't known to have, in their order."""


@dataclass(frozen=True, slots=True)
class DriveReport:
    """From the robot's site: where it takes itself to be, and what it does."""

    sender: ClassVar[Party] = Party.ROBOT
    epoch: int
    """Epoch that it follows."""
    number: int
    """Of the packet, from 1."""
    sent_at: float
    """By the robot's clock, as it takes the operator's to be [s]."""
    measured_at: float
    """When it was there, by the same clock [s]."""
    posture: Posture
    """Where it takes itself to be."""
    drive: Drive
    """What its motors are told."""
    echo: tuple[int, float, float] | None = None
    """The newest orders heard: their number, their sent_at, and when they arrived by the robot's clock [s]."""
    halted: str = ""
    """Why it stopped by itself and waits for a new epoch; empty while it doesn't."""
    refused: str = ""
    """Why the newest orders didn't count; empty if they did."""
    report: ArchitectureReport | None = None
    """The architecture's own; None while it's halted."""
    play: float | None = None
    """Time of the operator's path that it's at, from the epoch's beginning [s]; None: the architecture has none."""
    D: float | None = None
    """The time of the path that it's to play less the operator's clock, without what braking needs [s]; None: the
    architecture has none."""
    starved: bool = False
    """Whether it's slower than it should be, as nothing newer is known."""
    uncertainty: float | None = None
    """Bound on the error of what it takes for the operator's clock [s]; None where that isn't known."""
    world: float | None = None
    """Time of a simulated room when it was measured [s]: where people walk then; None of a real one."""
    errand: int = 0
    """Number of the newest errand that it has done, or left; 0 for none."""
    doing: Doing = Doing.NOTHING
    """What it does by itself."""
    left: float = 0.0
    """Way to the goal of that [m]."""
    tasks: TaskReport | None = None
    """How far it is with that; None where that was told a moment ago."""
    sight: SensedPoints | None = None
    """What it sees; None where there's nothing new."""
