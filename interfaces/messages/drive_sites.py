"""What crosses the link of a mobile robot: orders and reports, and what it does by itself.

Source: Kim, Han, Kim, Kim, section 4.1: supervisory control and job scheduling.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import Final, TypeAlias

from interfaces.messages.jobs import ListCommand, Load, OperatorLoss, Progress
from robots.onboard.driving import Drive, Posture
from robots.onboard.journey import Goal, JourneyState
from robots.onboard.supervisor import CellChange
from vrs.segment import ArcSegment

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


HEADER = 44
"""Number of the first arc, time and posture at its start, and how many follow [byte]."""
ARC = 24
"""v, ω and duration of an arc [byte]."""
CELL_BYTES = 6
"""m with added or forgotten, n, and how long ago it was seen, two bytes each [byte]."""
MOST_REPEATED = 600
"""Most arcs in a datagram's message: a minute's. With more missing, the oldest and the newest halves."""


@dataclass(frozen=True, slots=True)
class ArcPacket:
    """Arcs of the operator's path."""

    runs: tuple[tuple[int, tuple[ArcSegment, ...]], ...]
    """Runs of consecutive arcs, each with the number of its first."""
    complete_until: float
    """No later packet changes the path before this time [s]."""
    tail: tuple[ArcSegment, ...] = ()
    """How the virtual robot brakes from there, unless the operator goes on."""

    @property
    def size(self) -> int:
        """What it takes on the wire [byte]."""
        return 8 + HEADER * len(self.runs) + ARC * (len(self.tail) + sum(len(arcs) for _, arcs in self.runs))


@dataclass(frozen=True, slots=True)
class CellChanges:
    """What a report says of the surroundings."""

    time: float
    """When the robot said it, by its own clock [s]."""
    cells: tuple[CellChange, ...]
    """Each cell once."""

    @property
    def size(self) -> int:
        """What it takes on the wire [byte]."""
        return 10 + CELL_BYTES * len(self.cells)


@dataclass(frozen=True, slots=True)
class ArchitectureReport:
    """What the robot sends back."""

    number: int
    """It rises from report to report."""
    executed: int
    """j: how many commands the robot has executed."""
    posture: Posture
    """Where it takes itself to be."""
    received: int
    """How many arcs it has."""
    changes: CellChanges | None = None
    """What its supervisor saw change, in the extended architecture."""

    @property
    def size(self) -> int:
        """What it takes on the wire [byte]."""
        return 48 + (0 if self.changes is None else self.changes.size)


@dataclass(frozen=True, slots=True)
class DriveOrders:
    """From the operator's site: arcs of the virtual robot's path, or a heartbeat without any.

    An epoch is a drive that begins where the real robot stands: both sites make their parts anew for it. Times of
    its arcs count from when it began.
    """

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
