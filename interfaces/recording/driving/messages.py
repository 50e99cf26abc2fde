"""What stands in a mobile robot's recording besides what all have; `docs/recording.md` is the reference.

Postures are (x, y, θ) [m, m, rad] of the middle of the driving axle, in the room's frame; θ isn't wrapped.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal, TypeAlias

from msgspec import Meta

from interfaces.wire.fields import CommandId, Count, Finite, Number, Seconds, Time, Wire, Word

Length = Annotated[float, Meta(ge=-1e6, le=1e6)]
"""[m]."""
Size = Annotated[float, Meta(gt=0, le=1e6)]
"""[m]."""
Place = Annotated[list[Length], Meta(min_length=2, max_length=2)]
"""x, y [m]."""
Posture = Annotated[list[Length], Meta(min_length=3, max_length=3)]
"""x, y [m], θ [rad]."""
Speed = Annotated[float, Meta(ge=-1e3, le=1e3)]
"""[m/s] or [rad/s]."""
Cells = Annotated[tuple[Annotated[int, Meta(ge=0, le=4095)], ...], Meta(max_length=131_072)]
"""Of the virtual environment, two numbers a cell: along x, along y."""


class GridFacts(Wire, frozen=True, omit_defaults=True, gc=False):
    """The cells of the virtual environment."""

    shape: Annotated[list[Annotated[int, Meta(ge=1, le=4096)]], Meta(min_length=2, max_length=2)]
    cell: Size
    """Side of a cell [m]."""
    origin: Place


class DriveFacts(Wire, frozen=True, omit_defaults=True, gc=False):
    """How a mobile robot's run was set up."""

    body: Literal["ipr", "micro", "bare"]
    architecture: Word
    transport: Literal["stream", "datagrams"]
    operator: Word
    length: Seconds
    """For how long the operator drove [s]."""
    period: Seconds
    """T: between two commands [s]."""
    position: Word
    """What told the real robot where it was."""
    grid: GridFacts | None = None
    """None where there was no virtual environment."""


class ThingEntry(Wire, frozen=True, omit_defaults=True, gc=False):
    """A block, or a column where it has a radius."""

    name: Word
    x: Length
    y: Length
    height: Size
    length: Size | None = None
    width: Size | None = None
    angle: Finite = 0.0
    radius: Size | None = None
    known: bool = True
    start: Finite | None = None
    """It stands there from then on [s]; None for ever."""
    end: Finite | None = None


class PersonEntry(Wire, frozen=True, omit_defaults=True, gc=False):
    """Somebody who walks."""

    name: Word
    radius: Size
    height: Size
    times: Annotated[list[Time], Meta(min_length=1, max_length=1000)]
    x: Annotated[list[Length], Meta(min_length=1, max_length=1000)]
    y: Annotated[list[Length], Meta(min_length=1, max_length=1000)]
    repeat: bool = False


class DoorEntry(Wire, frozen=True, omit_defaults=True, gc=False):
    """A door that opens and closes."""

    name: Word
    sliding: bool
    x: Length
    y: Length
    length: Size
    angle: Length
    thickness: Size
    height: Size
    swing: Length
    times: Annotated[list[Time], Meta(min_length=1, max_length=1000)]
    shares: Annotated[list[Annotated[float, Meta(ge=0, le=1)]], Meta(min_length=1, max_length=1000)]
    repeat: bool = False


class RoomEntry(Wire, frozen=True, omit_defaults=True, gc=False, tag_field="kind", tag="room"):
    """Where it was: written at the beginning, and once more at the end."""

    name: Word
    length: Size
    width: Size
    things: Annotated[tuple[ThingEntry, ...], Meta(max_length=1000)] = ()
    """Blocks, then columns."""
    people: Annotated[tuple[PersonEntry, ...], Meta(max_length=1000)] = ()
    doors: Annotated[tuple[DoorEntry, ...], Meta(max_length=1000)] = ()


class ArcEntry(Wire, frozen=True, omit_defaults=True, gc=False):
    """An arc at constant speeds."""

    duration: Seconds
    posture: Posture
    """At its start."""
    v: Speed
    """[m/s]."""
    w: Speed
    """[rad/s]."""
    command_id: CommandId | None = None
    """None for standing."""
    start: Time | None = None
    """[s]; None where the arc before ends."""


class ArcHistory(Wire, frozen=True, omit_defaults=True, gc=False, kw_only=True, tag_field="kind", tag="arcs"):
    """A part of the whole timeline with an edit; as `HistoryEntry`."""

    edit: Count
    at: Time
    version: Count
    initial: Posture
    start: Time
    total: Count
    index: Count
    segments: tuple[ArcEntry, ...] = ()


class ArcChange(Wire, frozen=True, omit_defaults=True, gc=False, kw_only=True, tag_field="kind", tag="drive"):
    """An edit of the timeline: its first `first` arcs stay, these follow."""

    edit: Number
    base: Count
    at: Time
    version: Count
    first: Count
    segments: tuple[ArcEntry, ...] = ()
    end: Time
    command_id: CommandId | None = None


class PostureSample(Wire, frozen=True, omit_defaults=True, gc=False):
    """Where a robot is, or is thought to be, at a time."""

    t: Time
    x: Length
    y: Length
    theta: Length
    """[rad]."""

    @property
    def q(self) -> list[float]:
        """(x, y, θ)."""
        return [self.x, self.y, self.theta]


class VirtualPosture(PostureSample, frozen=True, omit_defaults=True, gc=False):
    """The virtual robot as it's shown: a comfort for other readers, ours compute it."""

    edit: Count = 0
    """Number of the newest edit."""


class RealPosture(PostureSample, frozen=True, omit_defaults=True, gc=False, kw_only=True):
    """The real robot, truly; and what it's told to drive from then on."""

    v: Speed
    """[m/s]."""
    w: Speed
    """[rad/s]."""
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


class CellsEntry(Wire, frozen=True, omit_defaults=True, gc=False):
    """Cells of the virtual environment, beside the known map, that came and went since the entry before."""

    t: Time
    added: Cells = ()
    gone: Cells = ()


DriveMessage: TypeAlias = (
    RoomEntry | ArcHistory | ArcChange | VirtualPosture | RealPosture | MeasuredPosture | EstimatedPosture
    | CellsEntry
)  # fmt: skip
"""What a mobile robot's recording has besides."""
