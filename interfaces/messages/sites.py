"""What crosses the link between the operator's site and the robot's: of an arm, then of a base."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain
from typing import Annotated, Any, ClassVar, Final, TypeAlias

import msgspec
from msgspec import Meta
from typing_extensions import override

from interfaces.messages.control import HandReport, SensedPoints
from interfaces.messages.fields import (
    MOST_NAMES,
    Coordinate,
    Count,
    Distance,
    Echo,
    Epoch,
    Leased,
    Number,
    Party,
    Seconds,
    Stamp,
    Text,
    Time,
    Uncertainty,
    Value,
)
from interfaces.messages.jobs import NONE_LEFT, Doing, Errand, TaskReport
from interfaces.messages.segments import Dof, Planned, Segmented
from robots.onboard.driving import Drive, Posture
from robots.onboard.supervisor import CellChange
from vrs.checks import SMALLEST, normal
from vrs.commands import Command
from vrs.ledger import Receipt
from vrs.model import Array
from vrs.record import Record, set_field
from vrs.segment import ArcSegment, known_arc

NEW: Final = 128
"""New samples in one report, at most; the older ones are asked for."""
AGAIN: Final = 32
"""Samples in one report that were asked for, at most."""
RANGES: Final = 32
"""Ranges of samples that are asked for in one message, at most."""

MOST_ENTRIES = 4096
"""Entries or receipts in one message, at most."""

Ranges = tuple[tuple[Number, Number], ...]
"""First and last number of each range."""


class Sample(msgspec.Struct, frozen=True, array_like=True, gc=False, eq=False):
    """Where the robot was measured once; it crosses as an array."""

    number: Number
    """Counts the samples of a robot's site, without gaps; 0 of a robot that doesn't number them."""
    t: Stamp
    """When, by the robot's clock [s]."""
    play: Time
    """Time on the robot's timeline that it played then [s]."""
    q: Array
    """Measured joints [rad], (n,)."""
    reference: Array | None = None
    """What the robot's own timeline asked for at `play` [rad], (n,); None of a robot that doesn't say."""


class LogEntry(Record, frozen=True, omit_defaults=True, gc=False, eq=False):
    """One command of the operator's log."""

    number: Number
    """From 1, without gaps, within an epoch."""
    at: Time
    """When it was given, by the operator's clock [s]; entries are in this order."""
    command_id: Count
    """Id that the operator's engine gave it."""
    command: Command | None = None
    """What was commanded, poses and times resolved as they were accepted; None: take back the newest."""


class Orders(Leased, frozen=True, omit_defaults=True, gc=False, eq=False, tag="orders"):
    """From the operator's site: entries of the log, or a heartbeat without any."""

    sender: ClassVar[Party] = Party.SITE
    epoch: Epoch
    """Of the control lease."""
    number: Number
    """Of the packet, from 1."""
    sent_at: Stamp
    """By the operator's clock [s]."""
    newest: Count
    """Number of the newest entry."""
    complete_until: Time
    """With all entries up to the newest, nothing will change before this time on the timeline [s]."""
    epoch_began: Time
    """When the epoch began [s]: no entry of it changes anything before."""
    heard: Count = 0
    """Number of the newest report that came."""
    entries: Annotated[tuple[LogEntry, ...], Meta(max_length=MOST_ENTRIES)] = ()
    """New ones, and older ones that may have been lost."""
    wanted: Annotated[Ranges, Meta(max_length=RANGES)] = ()
    """[first, last]: numbers of samples that are missing."""
    halted: Text = ""
    """Why the operator's site commands no more until somebody resumes: the robot is to stop and wait for that."""


class PlanPart(Segmented, frozen=True, omit_defaults=True, gc=False, eq=False):
    """The robot's plan from a time on."""

    version: Count
    """Of the robot's timeline."""
    since: Time
    """Before it nothing changed since the version that the operator knew [s]."""
    initial: Array
    """Where the arm stands before the first segment [rad], (n,)."""
    dof: Dof = 0
    """Joints of the segments."""
    start: Time = 0.0
    """Start of the first segment [s]."""
    segments: Planned = ()
    """All of them from there on."""


class Report(Leased, frozen=True, omit_defaults=True, gc=False, eq=False, tag="report"):
    """From the robot's site: where it is, and what became of the entries."""

    sender: ClassVar[Party] = Party.ROBOT
    epoch: Epoch
    """Epoch that it follows."""
    number: Number
    """Of the packet, from 1."""
    sent_at: Stamp
    """By the robot's clock [s]."""
    executed: Count
    """Entries up to this number were carried out."""
    play: Time
    """Time on the robot's timeline that it plays now [s]."""
    pace: Value
    """How fast it plays; 1 is as planned."""
    q: Array
    """Measured joints [rad], (n,)."""
    measured_at: Stamp
    """When they were measured, by the robot's clock [s]."""
    q_at: Time
    """Time on the robot's timeline that it played then [s]."""
    echo: Echo | None = None
    """The newest `Orders` heard: its number, its `sent_at`, and when it arrived by the robot's clock [s]."""
    halted: Text = ""
    """Why it stopped by itself and waits for a new epoch; empty while it doesn't."""
    receipts: Annotated[tuple[tuple[Number, Receipt], ...], Meta(max_length=MOST_ENTRIES)] = ()
    """[number, receipt] of entries that aren't known to have been reported."""
    plan: PlanPart | None = None
    """Where the robot's plan may be another than the operator thinks."""
    reference: Array | None = None
    """What the robot's own timeline asked for at `q_at` [rad], (n,); None where it doesn't say."""
    uncertainty: Uncertainty | None = None
    """Bound on the error of what it takes for the operator's clock [s]; None where that isn't known."""
    samples: Annotated[tuple[Sample, ...], Meta(max_length=NEW + AGAIN)] = ()
    """Where it was measured since the report before, 128 at most, and up to 32 earlier ones that were `wanted`."""
    oldest: Count = 0
    """Number of the oldest sample that it keeps; 0 where it keeps none."""
    hand: HandReport | None = None
    """Its hand, and the things around it; None where it's in no scene."""

    def __post_init__(self) -> None:
        # A robot that follows nobody yet reports, too, to whoever watches it in its own process.
        if self.epoch != 0:
            super().__post_init__()

    @override
    def as_written(self, packed: bool) -> Report:
        if self.plan is None and not self.receipts:
            return self
        receipts = tuple((number, receipt.named(MOST_NAMES)) for number, receipt in self.receipts)
        plan = None if self.plan is None else self.plan.as_written(packed)
        return msgspec.structs.replace(self, receipts=receipts, plan=plan)


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
    rows: list[Any] = [(arc.start - began, *arc.posture, arc.v, arc.w, arc.duration) for arc in arcs]
    if min(map(abs, filter(None, chain.from_iterable(rows))), default=math.inf) < SMALLEST:
        rows = [tuple(map(normal, row)) for row in rows]
    return tuple(rows)


def arcs_of(rows: Iterable[ArcRow]) -> list[ArcSegment]:
    """The arcs of rows, whose ranges were checked when they came."""
    return [known_arc(start, T, (x, y, theta), v, w) for start, x, y, theta, v, w, T in rows]


@dataclass(frozen=True, slots=True)
class ArcPacket:
    """Arcs of the operator's path as they cross; times count from when the drive began."""

    runs: tuple[tuple[int, tuple[ArcRow, ...]], ...] = ()
    """Runs of consecutive arcs, each with the number of its first."""
    complete_until: float = 0.0
    """No later packet changes the path before this time [s]."""
    tail: tuple[ArcRow, ...] = ()
    """How the virtual robot brakes from there, unless the operator goes on."""


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
    def size(self) -> int:
        """What its arcs take on a wire that is made for them [byte]."""
        arcs = len(self.tail) + sum(len(arcs) for _, arcs in self.runs)
        return 8 + ARC_RUN_BYTES * len(self.runs) + ARC_BYTES * arcs

    @property
    def packet(self) -> ArcPacket:
        """Its arcs."""
        return ArcPacket(self.runs, self.complete_until, self.tail)


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


SiteOrders: TypeAlias = Orders | DriveOrders
"""What an operator's site says, of any robot."""
SiteReport: TypeAlias = Report | DriveReport
"""What a robot's site says."""
