"""Messages of a recording, as they stand in the file: of arms, of mobile robots, of commands and links.

One concept: all that a file may hold is here, so that a reader finds each message and what it is made of in one
place.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from copy import copy
from dataclasses import fields, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, TypeAlias, TypeVar

import numpy as np
from msgspec import Meta, field

from interfaces.messages.fields import (
    MOST_JOINTS,
    CommandId,
    Count,
    Finite,
    Joints,
    Number,
    Seconds,
    Stamp,
    Text,
    Time,
    Word,
)
from interfaces.messages.segments import MOST_POWERS, placed, written
from robots.rooms import MOST_THINGS, Block, Column, Door, Length, Person, Room, Size
from robots.things import MOST_SCENE_THINGS, Scene, ThingPose
from vrs.commands import Command, MotionCommand, Profile
from vrs.errors import FormatError, InvalidValueError
from vrs.ledger import LedgerEntry, Receipt
from vrs.mobile import Grid
from vrs.model import Array
from vrs.notes import rough_in
from vrs.record import Record, set_field
from vrs.segment import ArcSegment, PolynomialSegment, known_arc, known_segment
from vrs.timeline import Timeline

Place = Annotated[list[Length], Meta(min_length=2, max_length=2)]
"""x, y [m]."""
if TYPE_CHECKING:
    Posture: TypeAlias = tuple[float, float, float]
else:
    Posture = Annotated[tuple[Length, ...], Meta(min_length=3, max_length=3)]
    """x, y [m], θ [rad]."""
Speed = Annotated[float, Meta(ge=-1e3, le=1e3)]
"""[m/s] or [rad/s]."""
Cells = Annotated[tuple[Annotated[int, Meta(ge=0, le=4095)], ...], Meta(max_length=131_072)]
"""Of the virtual environment, two numbers a cell: along x, along y."""


class Entry(Record, frozen=True, omit_defaults=True, gc=False, tag_field="kind"):
    """A message of a channel that has several kinds."""


class GridFacts(Record, frozen=True, omit_defaults=True, gc=False):
    """The cells of the virtual environment."""

    shape: Annotated[list[Annotated[int, Meta(ge=1, le=4096)]], Meta(min_length=2, max_length=2)]
    """Cells along x and along y."""
    cell: Size
    """Side of a cell [m]."""
    origin: Place
    """Lower left corner of the first cell [m]."""


class DriveFacts(Record, frozen=True, omit_defaults=True, gc=False, kw_only=True):
    """How a mobile robot's run was set up."""

    body: Word
    """Which robot, by its name; `bare`: the usual one with its bare body."""
    architecture: Word
    """By its name, as `vrs lab --architecture` takes it."""
    transport: Literal["stream", "datagrams"]
    operator: Word
    """Who drove, as `vrs lab --operator` takes it; `live` of people."""
    length: Seconds | None = None
    """For how long the operator drove [s]; None where that wasn't settled beforehand, as live."""
    period: Seconds
    """T: between two commands [s]."""
    position: Word
    """What told the real robot where it was."""
    grid: GridFacts | None = None
    """Of the virtual environment; None where there was none."""
    newest: Count = 0
    """Highest command id given out where the recording begins in the middle of a session."""


class ThingEntry(Record, frozen=True, omit_defaults=True, gc=False):
    """A block, or a column where it has a radius."""

    name: Word
    """A wall's begins with `wall`."""
    x: Length
    """Of its middle [m]."""
    y: Length
    """[m]."""
    height: Size
    """[m]."""
    length: Size | None = None
    """Along its own first axis [m]; None of a column."""
    width: Size | None = None
    """Across [m]; None of a column."""
    # Written even where it's zero: a plain default is left out only where it's the very same object.
    angle: Finite = field(default_factory=float)
    """Of its first axis [rad]."""
    radius: Size | None = None
    """Of a column [m]; None of a block."""
    known: bool = True
    """Whether the operator's map has it."""
    start: Finite | None = None
    """It stands there from then on [s]; None: it always did."""
    end: Finite | None = None
    """It stands there until then [s]; None: for ever."""


class RoomEntry(Entry, frozen=True, omit_defaults=True, gc=False, tag="room"):
    """Where it was: written at the beginning and at the end, live as its clock is known; the newest counts."""

    name: Word
    length: Size
    """Along x [m]."""
    width: Size
    """Along y [m]."""
    things: Annotated[tuple[ThingEntry, ...], Meta(max_length=MOST_THINGS)] = ()
    """Blocks, walls among them, then columns."""
    people: Annotated[tuple[Person, ...], Meta(max_length=MOST_THINGS)] = ()
    """With the paths that they walk."""
    doors: Annotated[tuple[Door, ...], Meta(max_length=MOST_THINGS)] = ()
    """With their timetables."""


class PostureSample(Record, frozen=True, omit_defaults=True, gc=False):
    """Where a robot is, or is thought to be, at a time."""

    t: Time
    """User time [s]."""
    x: Length
    """[m]."""
    y: Length
    """[m]."""
    theta: Length
    """[rad]."""

    @property
    def q(self) -> list[float]:
        """(x, y, θ)."""
        return [self.x, self.y, self.theta]


class VirtualPosture(PostureSample, frozen=True, omit_defaults=True, gc=False):
    """The virtual robot as it's shown, 20 times a second: a comfort for other readers, ours compute it."""

    edit: Count = 0
    """Number of the newest edit."""


class RealPosture(PostureSample, frozen=True, omit_defaults=True, gc=False, kw_only=True):
    """The real robot, truly, live where it takes itself to be, 20 times a second; and what it's told to drive."""

    v: Speed
    """What it's told to drive [m/s]."""
    w: Speed
    """What it's told to turn [rad/s]."""
    D: Finite | None = None
    """How far behind the operator it wants to be [s]; None where the architecture has no such thing."""

    @property
    def play(self) -> float:
        """The time of the timeline that it wants to be at [s]; NaN where there's none."""
        return math.nan if self.D is None else self.t - self.D

    @property
    def reference(self) -> list[float]:
        """(v, ω)."""
        return [self.v, self.w]


class MeasuredPosture(PostureSample, frozen=True, omit_defaults=True, gc=False):
    """Where the real robot takes itself to be."""

    edit: ClassVar[int] = 0


class EstimatedPosture(PostureSample, frozen=True, omit_defaults=True, gc=False):
    """Where the operator's site thinks that the real robot will come to, as of the last command."""

    edit: ClassVar[int] = 0


class CellsEntry(Record, frozen=True, omit_defaults=True, gc=False):
    """Cells of the virtual environment, beside the known map, that came and went since the entry before."""

    t: Time
    """User time [s]."""
    added: Cells = ()
    """Two numbers a cell: along x, along y."""
    gone: Cells = ()
    """Two numbers a cell: along x, along y."""


FORMAT = "vrs-recording/1"
"""Name and version of what the messages mean."""
OWN = "the robot's own"
"""`Begin.offset` and `Begin.link_loss` of a robot that somebody else started: it alone knows them."""
COLLISION = "collision"
"""`RunEvent.kind` of collisions."""

Site: TypeAlias = Literal["virtual", "real"]
Direction: TypeAlias = Literal["forward", "backward"]


class Late(Record, frozen=True, omit_defaults=True, gc=False):
    """How the operator's engine stood when a recording began in the middle of its session; see `vrs.ledger`."""

    newest: Count
    """Highest command id given out."""
    qd_max: Joints
    """Limit of speed in force [rad/s]."""
    qdd_max: Joints
    """Of acceleration [rad/s²]."""
    qddd_max: Joints
    """Of jerk [rad/s³]."""
    steered: Number | None = None
    """The command that the next steering input goes on with."""
    steered_at: Time = 0.0
    """When that began [s]."""
    grips: Annotated[tuple[tuple[Time, Annotated[float, Meta(ge=0, le=1e6)]], ...], Meta(max_length=1)] = ()
    """[t, opening]: what the hand was told by then [m]; none where it was as far open as it goes."""


class Begin(Entry, frozen=True, omit_defaults=True, gc=False, tag="begin", kw_only=True):
    """How the run was set up; repeated every 10 s, the first counts: no damage makes a recording nameless."""

    format: Literal["vrs-recording/1"] = FORMAT  # type: ignore[assignment]
    """Name and version of what the messages mean."""
    t: Time
    """Where the recording begins [s]."""
    robot: Word
    """As in `robots.NAME`."""
    driver: Literal["laboratory", "live"]
    """Whether it ran in virtual time."""
    title: Text
    """For people."""
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1)] | None = None
    """Of everything random in the run; None where nothing is."""
    delay: Text
    """Delay profile, as it was asked for: one of a file has its path."""
    offset: Word
    """How far the real robot plays behind: `adaptive`, `fixed:S`, or `the robot's own`; `none` of a mobile robot
    whose architecture has none."""
    service: Word
    """How the link delivers."""
    link_loss: Word
    """What the robot does when nothing fresh is heard: `halt`, `hold`, or `the robot's own`."""
    step: Seconds
    """Between two samples [s]."""
    q: Joints
    """Joints of both robots at the start [rad]; of a mobile robot its posture."""
    lateness: Word
    """What becomes of commands that come too late: `postpone`, `reject`."""
    software: Word
    """What wrote the file, with its version."""
    began: Stamp | None = None
    """Seconds since 1970 at `t`; None in the laboratory, where the same seed gives the same bytes."""
    sampled: Seconds | None = None
    """Between two samples of a live arm [s]; None where they came with its reports alone."""
    late: Late | None = None
    """How the engine stood; None where nothing had been commanded yet."""
    drive: DriveFacts | None = None
    """How a mobile robot's run was set up; None of an arm."""
    found_by: Text = ""
    """What finds the robot where that's a file or numbers; empty of one that its name finds."""


class Drop(Record, frozen=True, omit_defaults=True, gc=False):
    """Messages of a topic for which there was no room."""

    topic: Word
    count: Count
    """Since the beginning."""


class Dropped(Entry, frozen=True, omit_defaults=True, gc=False, tag="dropped"):
    """How many messages weren't recorded since the beginning, because the disk took no more."""

    t: Time
    """User time [s]."""
    counts: tuple[Drop, ...]
    """By topic."""


class End(Entry, frozen=True, omit_defaults=True, gc=False, tag="end"):
    """The recording was closed in order."""

    t: Time
    """User time [s]."""
    extras: dict[str, Any] | None = None
    """What the run's summary holds besides what can be computed from the recording."""


class CommandRecord(Entry, frozen=True, omit_defaults=True, gc=False, eq=False, tag="command"):
    """A command that the operator's engine was given, and what became of it; rejected ones too."""

    number: Number
    """Counts a recording's commands, anchors and placements, from 1; 0 where it isn't in one yet."""
    at: Time
    """The engine's clock, exactly [s]."""
    command: Command | None = None
    """None: it takes back the newest accepted one."""
    receipt: Receipt | None = None
    """None where the command gives none."""
    refused: bool = False
    """Whether the site refused it before the engine saw it."""


class GivenEntry(Entry, frozen=True, omit_defaults=True, gc=False, tag="given"):
    """A command from before the recording that wasn't over when it began, or by which the arm had moved last."""

    t: Time
    """Where the recording begins [s]."""
    receipt: Receipt
    """As it was then."""
    command: Command | None = None
    """None where it's no motion command."""
    smooth: bool = False
    """Whether it moves the arm with bounded jerk."""

    @property
    def known(self) -> LedgerEntry:
        """What an engine that goes on from here is told.

        Raises:
            InvalidValueError: If it's no command's.
        """
        command = self.command
        if command is not None and not isinstance(command, MotionCommand):
            raise InvalidValueError("command", command, "a motion command")
        profile = Profile.JERK_LIMITED if self.smooth else Profile.PARABOLIC
        return LedgerEntry(self.receipt, command, rough_in(self.receipt.reason), profile=profile)


UNSAID = -math.inf
"""Start of segments whose entries don't say when: where those before them end."""


class SegmentEntry(Record, frozen=True, omit_defaults=True, gc=False):
    """A segment: a row of `dof` numbers a power, ascending, one row after the other."""

    duration: Seconds
    """[s]."""
    coefficients: Annotated[list[Finite], Meta(min_length=1, max_length=MOST_JOINTS * MOST_POWERS)]
    """Rows of one number a joint, by ascending power of t − start, one row after the other."""
    command_id: CommandId | None = None
    """None of a hold."""
    start: Time | None = None
    """[s]; None: where the segment before ends."""

    @classmethod
    def of(cls, segment: PolynomialSegment, start: float | None = None) -> SegmentEntry:
        """What stands in the file for a segment."""
        return cls(segment.duration, segment.coefficients.ravel().tolist(), segment.command_id, start)

    def segment(self, start: float, dof: int) -> PolynomialSegment:
        """The segment that it stands for.

        Raises:
            InvalidValueError: If the coefficients don't fit the joints.
        """
        count = len(self.coefficients)
        if not dof or count % dof or count > dof * MOST_POWERS:
            raise InvalidValueError("coefficients", f"{count} numbers", f"1 to {MOST_POWERS} rows of {dof}")
        a: Array = np.array(self.coefficients).reshape(-1, dof)
        a.flags.writeable = False
        return known_segment(start, self.duration, a, self.command_id)


class ArcEntry(Record, frozen=True, omit_defaults=True, gc=False):
    """An arc at constant speeds."""

    duration: Seconds
    """[s]."""
    posture: Posture
    """x, y, θ at its start [m, m, rad]."""
    v: Speed
    """[m/s]."""
    w: Speed
    """[rad/s]."""
    command_id: CommandId | None = None
    """None of standing."""
    start: Time | None = None
    """[s]; None: where the arc before ends."""

    @classmethod
    def of(cls, arc: ArcSegment, start: float | None = None) -> ArcEntry:
        """What stands in the file for an arc."""
        return cls(arc.duration, arc.posture, arc.v, arc.w, arc.command_id, start)

    def segment(self, start: float, _dof: int) -> ArcSegment:
        """The arc that it stands for."""
        return known_arc(start, self.duration, self.posture, self.v, self.w, self.command_id)


if TYPE_CHECKING:
    Arcs: TypeAlias = tuple[ArcSegment, ...]
    Polynomials: TypeAlias = tuple[PolynomialSegment, ...]
else:
    Arcs = tuple[ArcEntry, ...]
    Polynomials = tuple[SegmentEntry, ...]


class SegmentedEntry(Entry, frozen=True, omit_defaults=True, gc=False, eq=False):
    """An entry with segments: it holds them as they are, and is written with an entry for each."""

    row: ClassVar[type[SegmentEntry | ArcEntry]] = SegmentEntry

    @property
    def dof(self) -> int:
        """Joints of the segments."""
        return len(self.initial)  # type: ignore[attr-defined]

    def __post_init__(self) -> None:
        given = self.segments  # type: ignore[attr-defined]
        if given and type(given[0]) is self.row:
            dof = self.dof
            set_field(self, "segments", tuple([row.segment(start, dof) for start, row in placed(given, UNSAID)]))

    def as_written(self) -> Self:
        """The same as it stands in the file; the start of the first segment is always given."""
        message = copy(self)
        set_field(message, "segments", written(self.segments, self.row.of, UNSAID))  # type: ignore[attr-defined]
        return message


S = TypeVar("S", PolynomialSegment, ArcSegment)


def following(segments: Iterable[S], start: float) -> Iterator[S]:
    """Segments as they're held, from a time [s] on where they don't say when."""
    for segment in segments:
        at = start if segment.start == UNSAID else segment.start
        yield segment if segment.start == at else replace(segment, start=at)
        start = at + segment.duration


class Anchor(SegmentedEntry, frozen=True, omit_defaults=True, gc=False, eq=False, tag="anchor", kw_only=True):
    """The virtual robot joined the real one's plan, which stands here whole, because the two had parted."""

    number: Number
    """Counts a recording's commands and anchors, from 1."""
    at: Time
    """The engine's clock, exactly [s]."""
    initial: Array
    """Before the start of that plan [rad]."""
    start: Time
    """Origin of that plan [s]."""
    version: Count
    """Of that plan."""
    segments: Polynomials = ()
    """That plan's."""
    end: Time
    """Until when it takes to come back [s]."""
    error: Array
    """By how much the virtual robot was off [rad], (n,)."""
    reason: Text
    """Why they had parted, one line."""
    timeline_version: Count | None = None
    """Version of the operator's timeline afterwards."""

    @property
    def truth(self) -> Timeline:
        """The real robot's plan that was joined.

        Raises:
            InvalidValueError: If it's none.
        """
        return Timeline(self.initial, self.start, following(self.segments, self.start), self.version)


class Placement(Entry, frozen=True, omit_defaults=True, gc=False, tag="placed"):
    """The virtual robot was put where the real one stands: a drive began, or the real one drives by itself."""

    number: Number
    """Counts a recording's commands and placements, from 1."""
    at: Time
    """The engine's clock, exactly [s]."""
    posture: Posture
    """x, y, θ from then on [m, m, rad]."""
    along: bool = False
    """Whether the real one drives by itself, and the virtual one goes along with it."""


class ReceiptEntry(Entry, frozen=True, omit_defaults=True, gc=False, tag="receipt"):
    """The newest truth about a command at one of the sites."""

    t: Time
    """User time [s]."""
    site: Site
    """Whose truth."""
    receipt: Receipt


class CommandPacket(Entry, frozen=True, omit_defaults=True, gc=False, tag="packet"):
    """A motion command on its way across the link."""

    number: Number
    """Place in the order of sending, from 1."""
    command_id: Number
    """Id that the operator's engine gave the command, from 1."""
    sent: Time
    """User time of sending [s]."""
    arrived: Time | None = None
    """User time at which it first arrived [s]; None when it never did."""
    real_id: Number | None = None
    """Id that the real robot's engine gave the command; None when it never arrived."""
    lost: bool = False
    """Whether the link lost the first message with it; later messages repeat it."""


class HistoryEntry(
    SegmentedEntry, frozen=True, omit_defaults=True, gc=False, eq=False, tag="history", kw_only=True
):
    """A part of the whole timeline with an edit, as the virtual robot shows it."""

    edit: Count
    """Its number, from 1; 0 is what the recording begins with."""
    at: Time
    """The engine's clock when the timeline was that [s]."""
    version: Count
    """Of the timeline."""
    initial: Array
    """Before the start of the timeline [rad]."""
    start: Time
    """Origin of the timeline [s]."""
    total: Count
    """Segments of the whole."""
    index: Count
    """Number of the first segment of this part, from 0."""
    segments: Polynomials = ()


class ArcHistory(HistoryEntry, frozen=True, omit_defaults=True, gc=False, eq=False, tag="arcs", kw_only=True):
    """A part of the whole timeline with an edit, of a mobile robot."""

    row: ClassVar[type[SegmentEntry | ArcEntry]] = ArcEntry
    initial: Posture  # type: ignore[assignment]
    """x, y, θ before the start of the timeline [m, m, rad]."""
    segments: Arcs = ()  # type: ignore[assignment]


class EditEntry(SegmentedEntry, frozen=True, omit_defaults=True, gc=False, eq=False, kw_only=True):
    """An edit, as what it put in."""

    edit: Number
    """Its number, from 1."""
    base: Count
    """Number of the edit that it builds on."""
    at: Time
    """The engine's clock, exactly [s]."""
    version: Count
    """Of the timeline afterwards."""
    first: Count
    """So many segments stay."""


class ChangeEntry(EditEntry, frozen=True, omit_defaults=True, gc=False, eq=False, tag="change", kw_only=True):
    """An edit: the first `first` segments stay, `segments` follow, then those of the base from `tail` on."""

    dof: Count
    """Joints."""
    segments: Polynomials = ()
    """New ones."""
    tail: Count | None = None
    """The base's segments from this one on follow; None: none do."""
    tail_start: Time
    """When those begin [s]."""
    end: Time
    """Of the timeline afterwards [s]."""
    command_id: CommandId | None = None
    """Who made it; None: a correction."""


class ArcChange(EditEntry, frozen=True, omit_defaults=True, gc=False, eq=False, tag="drive", kw_only=True):
    """An edit of a mobile robot's timeline: the first `first` arcs stay, `segments` follow."""

    row: ClassVar[type[SegmentEntry | ArcEntry]] = ArcEntry
    dof: ClassVar[int] = 3
    segments: Arcs = ()
    """New ones."""
    end: Time
    """Of the timeline afterwards [s]."""
    command_id: CommandId | None = None
    """Who made it."""


class VirtualSample(Record, frozen=True, omit_defaults=True, gc=False):
    """Joints of the virtual robot as it's shown: a comfort for other readers, ours compute them."""

    t: Time
    """User time [s]."""
    q: Joints
    """[rad]."""
    edit: Count
    """Number of the newest edit."""


class RealSample(Record, frozen=True, omit_defaults=True, gc=False):
    """Joints of the real robot as measured."""

    t: Time
    """User time [s]."""
    play: Time
    """Where its timeline is played [s]."""
    q: Joints
    """[rad]."""
    reference: Joints | None = None
    """What its own timeline asked for [rad]; None where that isn't known."""


class SceneEntry(Entry, frozen=True, omit_defaults=True, gc=False, tag="scene"):
    """What was around the real arm, as it was at first."""

    scene: Scene


class HandEntry(Entry, frozen=True, omit_defaults=True, gc=False, tag="hand"):
    """The real hand and the things around it, as they were measured."""

    t: Time
    """User time [s]."""
    opening: Annotated[float, Meta(ge=0, le=10)]
    """Between the fingers [m]."""
    holds: Count | None = None
    """Which of the things that move both fingers press on, from 0; None for none."""
    things: Annotated[tuple[tuple[Count, ThingPose], ...], Meta(max_length=MOST_SCENE_THINGS)] = ()
    """[number, pose]: where things are that have moved: x, y, z [m], a quaternion x, y, z, w; in the base frame."""


class LinkEntry(Record, frozen=True, omit_defaults=True, gc=False):
    """A packet of the link whose fate is known."""

    direction: Direction
    """`forward` goes to the robot."""
    sent: Time
    """User time [s]."""
    arrived: Time | None = None
    """User time [s]; None where it was lost, or still on its way when the recording ended."""
    lost: bool = False
    attempts: Count = 1
    """How often it was sent."""
    size: Count = 0
    """[byte]; 0 where that wasn't recorded."""


class RunEvent(Record, frozen=True, omit_defaults=True, gc=False, order=True):
    """Something that happened to the real robot or the link."""

    t: Time
    """User time [s]."""
    kind: Word
    """`payload`, `release`, `late`, `lost`, `slowed`, `waited`, `corrected`, `halted`, `diverged`, `unfinished`;
    live `up`, `down`, `followed`; of a mobile robot `collision`, `learned`, `forgot`."""
    text: Text
    """What happened, one line."""


def room_entry(room: Room) -> RoomEntry:
    """A room for the file."""
    things = tuple(map(_thing_entry, room.things))
    return RoomEntry(room.name, room.length, room.width, things, room.people, room.doors)


def _thing_entry(thing: Block | Column) -> ThingEntry:
    held = {one.name: getattr(thing, one.name) for one in fields(thing)}
    return ThingEntry(**{name: value for name, value in held.items() if value not in {-math.inf, math.inf}})


def room_of(entry: RoomEntry, where: str) -> Room:
    """The room that an entry stands for.

    Raises:
        FormatError: If a thing or somebody in it makes no sense.
    """
    things = [_thing(one, where) for one in entry.things]
    for one in entry.people:
        if not _ascend(one.times) or not len(one.times) == len(one.x) == len(one.y):
            raise FormatError(where, f"{one.name!r} in its room walks no path")
    for leaf in entry.doors:
        if not _ascend(leaf.times) or len(leaf.times) != len(leaf.shares):
            raise FormatError(where, f"{leaf.name!r} in its room has no timetable")
    return Room(
        entry.name,
        entry.length,
        entry.width,
        blocks=tuple(thing for thing in things if isinstance(thing, Block)),
        columns=tuple(thing for thing in things if isinstance(thing, Column)),
        people=entry.people,
        doors=entry.doors,
    )


def _ascend(times: tuple[float, ...]) -> bool:
    return all(a < b for a, b in pairwise(times))


def _thing(entry: ThingEntry, where: str) -> Block | Column:
    if entry.radius is None and (entry.length is None or entry.width is None):
        raise FormatError(where, f"{entry.name!r} in its room has no size")
    kind: type[Block | Column] = Block if entry.radius is None else Column
    held = {one.name: getattr(entry, one.name) for one in fields(kind)}
    return kind(**{name: value for name, value in held.items() if value is not None})


def grid_facts(grid: Grid) -> GridFacts:
    """The cells of a virtual environment for the file."""
    return GridFacts(list(grid.shape), grid.cell, grid.origin.tolist())


def grid_of(facts: GridFacts) -> Grid:
    """The cells that an entry stands for."""
    m, n = facts.shape
    return Grid((m, n), facts.cell, facts.origin)
