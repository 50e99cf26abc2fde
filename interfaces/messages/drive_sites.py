"""What crosses the link of a mobile robot: orders and reports, and what it does by itself.

Source: Kim, Han, Kim, Kim, section 4.1: supervisory control and job scheduling.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final

import msgspec
from msgspec import Meta

from interfaces.messages.fields import (
    Coordinate,
    Count,
    Distance,
    Echo,
    Epoch,
    Leased,
    Number,
    Party,
    Points,
    Seconds,
    Stamp,
    Text,
    Time,
    Uncertainty,
    Word,
)
from interfaces.messages.jobs import JobList, ListCommand, OperatorLoss, Progress
from robots.onboard.driving import Drive, Posture
from robots.onboard.journey import Goal, JourneyState
from robots.onboard.supervisor import CellChange
from vrs.checks import normal
from vrs.errors import InvalidValueError
from vrs.record import Record, set_field
from vrs.segment import ArcSegment, known_arc

Variance = Annotated[float, Meta(ge=-1e9, le=1e9)]
"""[m²]."""
Doubt = tuple[Variance, Variance, Variance]
NONE_LEFT: Final = 0.0
"""Of a way [m]: a field with it isn't written, where it's this very number."""


class RobotTask(Record, frozen=True, omit_defaults=True, gc=False):
    """What a robot, or a list of jobs, is asked to do: `go`, `do`, `jobs` or `halt`."""

    go: Goal | None = None
    """Drive there; a list of jobs that is being done is paused."""
    do: ListCommand | None = None
    jobs: JobList | None = None
    """Take this list in place of the one before; not while that is being done."""
    progress: Progress | None = None
    """How far that list is already; None: as far as is known of jobs with the same number that are unchanged."""
    halt: Text | None = None
    """Between sites: stop, and leave off whatever it does by itself, for this reason; a list of jobs is paused."""

    def __post_init__(self) -> None:
        given = [name for name in ("go", "do", "jobs", "halt") if getattr(self, name) is not None]
        if len(given) != 1:
            raise InvalidValueError("task", ", ".join(given), "one of go, do, jobs and halt")

    @property
    def stops(self) -> bool:
        """Whether it only stops something: it counts however late it comes."""
        return self.halt is not None or self.do in (ListCommand.PAUSE, ListCommand.ABORT)


HALT: Final = RobotTask(halt="somebody stopped the robot")
"""What a stop tells a robot that does something by itself."""


class Errand(Record, frozen=True, omit_defaults=True, gc=False):
    """A task with its number: it's sent until the robot says that it has it, and done once."""

    number: Number
    """From 1."""
    task: RobotTask
    """What is to be done."""

    def __post_init__(self) -> None:
        if self.task.do is ListCommand.DRY_RUN:
            raise InvalidValueError("task", self.task.do.value, "what a robot does")


class Doing(enum.StrEnum):
    """What a robot does by itself."""

    NOTHING = "nothing"
    GOAL = "goal"
    JOBS = "jobs"


class TaskReport(Record, frozen=True, omit_defaults=True, gc=False):
    """How far a robot is with what it does by itself."""

    journey: JourneyState = JourneyState.IDLE
    reason: Text = ""
    """Why it waits or couldn't get there."""
    goal: Goal | None = None
    """Where to."""
    route: Points = ()
    """The way that's being driven [m]."""
    digest: Word = ""
    """Of the list of jobs that it has."""
    progress: Progress = msgspec.field(default_factory=Progress)
    """How far that is."""
    loss: OperatorLoss = OperatorLoss.STOP
    """What follows when the operator is lost."""
    shows: Text = ""
    """What stands on its screen."""
    says: Text = ""
    """What it's saying."""


class SensedPoints(Record, frozen=True, omit_defaults=True, gc=False):
    """What a robot sees of its surroundings."""

    time: Stamp
    """By the robot's own clock [s]."""
    points: Points = ()
    """Where its laser's beams ended, on the map [m]."""
    doubt: Doubt | None = None
    """Of its place: variance of x, covariance, variance of y [m²]; None where nobody knows."""


MOST_CELLS = 10_000
"""Cells that a report tells of, at most."""
MOST_REPEATED = 600
"""Most arcs in a datagram's message: a minute's. With more missing, the oldest and the newest halves."""
ARC_RUN_BYTES = 44
"""Number of the first arc, time and posture at its start, and how many follow [byte]."""
ARC_BYTES = 24
"""v, ω and duration of an arc [byte]."""
CELL_BYTES = 6
"""m with added or forgotten, n, and how long ago it was seen, two bytes each [byte]."""
Speed = Annotated[float, Meta(ge=-1e6, le=1e6)]
ArcRow = tuple[Time, Coordinate, Coordinate, Coordinate, Speed, Speed, Seconds]
"""Start, posture there, v, ω, duration."""
ArcRows = Annotated[tuple[ArcRow, ...], Meta(max_length=MOST_REPEATED)]


def arc_rows(arcs: Iterable[ArcSegment], began: float = 0.0) -> tuple[ArcRow, ...]:
    """Arcs as they cross: what is computed of ordinary numbers may be subnormal, which a robot refuses.

    Args:
        arcs: Of the operator's path.
        began: When the drive began that they count from [s].
    """
    rows = ((arc.start - began, *arc.posture, arc.v, arc.w, arc.duration) for arc in arcs)
    return tuple(tuple(map(normal, row)) for row in rows)  # type: ignore[misc]


def _arcs(rows: tuple[ArcRow, ...]) -> tuple[ArcSegment, ...]:
    """The arcs of rows, whose ranges were checked when they came."""
    return tuple(known_arc(start, T, (x, y, theta), v, w) for start, x, y, theta, v, w, T in rows)


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
        arcs = len(self.tail) + sum(len(arcs) for _, arcs in self.runs)
        return 8 + ARC_RUN_BYTES * len(self.runs) + ARC_BYTES * arcs


class DriveOrders(Leased, frozen=True, omit_defaults=True, gc=False, tag="drive-orders"):
    """From the operator's site: arcs of the virtual robot's path, or a heartbeat without any.

    An epoch is a drive that begins where the real robot stands: both sites make their parts anew for it. Times of
    its arcs count from when it began.
    """

    sender: ClassVar[Party] = Party.SITE
    epoch: Epoch
    """Of the operator's site, from 1."""
    number: Number
    """Of the packet."""
    sent_at: Stamp
    """By the operator's clock [s]."""
    began: Time
    """When the epoch began, by the operator's clock [s]: time 0 of its arcs."""
    complete_until: Time
    """No later message changes the path before this time [s]."""
    start: Posture | None = None
    """Where it began; None while nobody drives."""
    runs: Annotated[tuple[tuple[Count, ArcRows], ...], Meta(max_length=8)] = ()
    """[number of the first, arcs]: runs of consecutive arcs, all that the robot hasn't said it has. An arc is
    [start, x, y, θ, v, ω, duration], with the posture at its start."""
    tail: ArcRows = ()
    """How the virtual robot brakes from there, unless the operator goes on."""
    errands: Annotated[tuple[Errand, ...], Meta(max_length=16)] = ()
    """Tasks that it isn't known to have, in their order."""

    @property
    def packet(self) -> ArcPacket:
        """Its arcs."""
        runs = tuple((first, _arcs(rows)) for first, rows in self.runs)
        return ArcPacket(runs, self.complete_until, _arcs(self.tail))


class ArchitectureReport(Record, frozen=True, omit_defaults=True, gc=False):
    """What the robot sends back of its architecture."""

    number: Number
    """It rises from report to report."""
    executed: Count
    """j: how many commands the robot has executed."""
    posture: Posture
    """Where it takes itself to be."""
    received: Count
    """How many arcs it has."""
    seen_at: Time | None = None
    """When the robot said what its supervisor saw change, by its own clock [s]; None but in the extended one."""
    cells: Annotated[tuple[CellChange, ...], Meta(max_length=MOST_CELLS)] = ()
    """What that was, each cell once: [[m, n], when it was last seen so [s], whether it's occupied]."""

    @property
    def size(self) -> int:
        """What it takes on the wire [byte]."""
        return 48 if self.seen_at is None else 58 + CELL_BYTES * len(self.cells)


class DriveReport(Leased, frozen=True, omit_defaults=True, gc=False, tag="drive-report"):
    """From the robot's site: where it takes itself to be, and what it does."""

    sender: ClassVar[Party] = Party.ROBOT
    epoch: Epoch | None
    """Epoch that it follows; None before the first."""
    number: Number
    """Of the packet."""
    sent_at: Stamp
    """By the robot's clock, as it takes the operator's to be [s]."""
    measured_at: Stamp
    """When it was there, by the same clock [s]."""
    posture: Posture
    """Where it takes itself to be."""
    drive: Drive
    """What its motors are told."""
    echo: Echo | None = None
    """The newest orders heard: their number, their `sent_at`, and when they arrived by the robot's clock [s]."""
    halted: Text = ""
    """Why it stopped by itself and waits for a new epoch; empty while it doesn't."""
    refused: Text = ""
    """Why the newest orders didn't count; empty if they did."""
    report: ArchitectureReport | None = None
    """The architecture's own; None while it's halted."""
    play: Time | None = None
    """Time of the operator's path that it's at, from the epoch's beginning [s]; None: the architecture has none."""
    D: Time | None = None
    """The time of the path that it's to play less the operator's clock, without what braking needs [s]; None: the
    architecture has none."""
    starved: bool = False
    """Whether it's slower than it should be, as nothing newer is known."""
    uncertainty: Uncertainty | None = None
    """Bound on the error of what it takes for the operator's clock [s]; None where that isn't known."""
    world: Time | None = None
    """Time of a simulated room when it was measured [s]: where people walk then; None of a real one."""
    errand: Count = 0
    """Number of the newest errand that it has done, or left; 0 for none."""
    doing: Doing = Doing.NOTHING
    """What it does by itself."""
    left: Distance = NONE_LEFT
    """Way to the goal of that [m]."""
    tasks: TaskReport | None = None
    """How far it is with that; None where it's no news and was told less than 0.5 s ago."""
    sight: SensedPoints | None = None
    """What it sees, as in `Seen`; None where there's nothing new."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.left:
            set_field(self, "left", NONE_LEFT)
