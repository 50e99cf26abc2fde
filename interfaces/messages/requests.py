"""What crosses between a client and the servlet near the engine: frozen values with a kind and a version.

Numbers count from 1 and belong to one client. Times are in the engine's time; the engine's time and the user's are
the same timeline, shifted by D, so that stamps cross as they are (Doulgeri, Zikos, Delopoulos, section IV-A).
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, TypeAlias

from msgspec import Meta

from interfaces.messages.fields import CommandId, Count, Message, Number, Rate, Time, Word
from vrs.commands import Command, finite
from vrs.errors import InvalidValueError
from vrs.ledger import Receipt
from vrs.model import Array
from vrs.segment import PolynomialSegment

LONGEST_DELAY: Final = 0.1
"""Compact frames wait no longer for others that go in the same message [s]."""


class FrameStatus(enum.StrEnum):
    """How far a frame can be trusted."""

    PREDICTED = "predicted"
    """It shows a time that the engine's clock hasn't passed, as far as is known: a command may change it."""
    CONFIRMED = "confirmed"
    """The engine's clock has passed the time it shows, and what it shows came true."""
    FALSIFIED = "falsified"
    """A command has changed what happens at the time it shows."""


class ViewForm(enum.StrEnum):
    """What a viewer gets."""

    SEGMENTS = "segments"
    """The timeline, and each edit of it: the viewer evaluates it itself."""
    FRAMES = "frames"
    """Positions, at a broadcaster's rate and as it asks for them."""
    COMPACT = "compact"
    """The same frames, quantised and predicted, in 1/5 to 1/16 of the bytes; see `interfaces.messages.compact`."""


@dataclass(frozen=True, slots=True)
class FrameVerdict:
    """What a predicted frame turned out to be."""

    number: int
    """The frame's number."""
    status: FrameStatus
    """Confirmed or falsified."""
    falsified_by: int | None = None
    """Id of the first command that changed it; None where it's confirmed or nobody knows which it was."""


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """A position for a time: g(t), and how far it can be trusted."""

    kind: ClassVar[str] = "frame"
    version: ClassVar[int] = 1
    number: int
    t: float
    """Time it shows [s]."""
    made_at: float
    """The engine's time when it was made [s]."""
    q: Array
    """Joints [rad], (n,), read-only."""
    status: FrameStatus
    falsified_by: int | None = None
    """Id of the first command that changed what happens at t."""


@dataclass(frozen=True, slots=True, eq=False)
class Order:
    """Client: carry out a command. It's sent again until its outcome comes, and carried out once."""

    kind: ClassVar[str] = "order"
    version: ClassVar[int] = 1
    number: int
    """Orders are carried out in the order of their numbers; a stop doesn't wait."""
    command: Command | None
    """None takes back the newest accepted command."""
    epoch: int = 0
    """Of the control lease, below 2⁶⁴; 0 where none is needed, as on an engine in this process."""

    def __post_init__(self) -> None:
        _check_number(self.number)
        if isinstance(self.epoch, bool) or not isinstance(self.epoch, int) or not 0 <= self.epoch < 2**64:
            raise InvalidValueError("epoch", self.epoch, "an integer from 0 to 2**64 - 1")


class Ask(Message, frozen=True, omit_defaults=True, gc=False, tag="ask"):
    """Client: g(t), please. Sent again, it asks what has become of the frame."""

    number: Number
    t: Time | None = None
    """[s]; None for the engine's present, plus the servlet's lead."""

    def __post_init__(self) -> None:
        _check_number(self.number)
        if self.t is not None:
            finite("t", self.t, "None or finite seconds")


class Follow(Message, frozen=True, omit_defaults=True, gc=False, tag="follow"):
    """Client: the scene, please, and from now on what changes in it."""

    number: Number
    form: ViewForm
    rate: Rate | None = None
    """Wished rate of frames [1/s]; the broadcaster with the nearest one is taken."""
    delay: Annotated[float, Meta(ge=0, le=LONGEST_DELAY)] = 0.0
    """How long a compact frame may wait for others that go in the same message [s]."""

    def __post_init__(self) -> None:
        _check_number(self.number)
        if self.rate is not None:
            finite("rate", self.rate, "None or frames a second")
        if not 0 <= finite("delay", self.delay, "0 to 0.1 s") <= LONGEST_DELAY:
            raise InvalidValueError("delay", self.delay, "0 to 0.1 s")


class Want(Message, frozen=True, omit_defaults=True, gc=False, tag="want"):
    """Client: segments that it lacks."""

    edit: Count
    """Number of the newest edit in what it has, or of that which a `Scene` began with."""
    index: Count | None = None
    """First segment that it lacks of a history; None when it has that and lacks later edits."""


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Servlet: what became of an order; again when a later command changed that."""

    kind: ClassVar[str] = "outcome"
    version: ClassVar[int] = 1
    number: int
    receipt: Receipt | None
    """None where there was nothing to take back, the command gives no receipt, or it was refused."""
    refusal: str
    """Why the command couldn't be taken at all; empty where it could."""
    revision: int
    """Counts up with each change of the receipt, from 0."""
    made_at: float
    """The engine's time [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """Servlet: the frame that was asked for, with its status as it is now."""

    kind: ClassVar[str] = "answer"
    version: ClassVar[int] = 1
    frame: Frame
    now: float
    """The engine's time when this was sent [s]."""


@dataclass(frozen=True, slots=True)
class Verdicts:
    """What became of the newest frames of a broadcaster, as ranges of numbers.

    Frames from `since` to `through` are confirmed, unless they stand in `falsified`. Later ones are predicted,
    unless they stand there.
    """

    since: int
    through: int
    falsified: tuple[tuple[int, int, int | None], ...] = ()
    """First and last number, and the command."""


@dataclass(frozen=True, slots=True, eq=False)
class Broadcast:
    """Servlet: the newest frame of a broadcaster, and what became of earlier ones."""

    kind: ClassVar[str] = "broadcast"
    version: ClassVar[int] = 1
    frame: Frame
    verdicts: Verdicts


Range: TypeAlias = tuple[Count, Count, CommandId | None]
"""First and last number of frames that were falsified, and the command."""


class Compact(Message, frozen=True, omit_defaults=True, gc=False, tag="compact"):
    """Servlet: the newest frames of a broadcaster in compact form, and what became of earlier ones."""

    q: Annotated[bytes, Meta(min_length=2, max_length=32768)]
    """1 to 16 frames; see `interfaces.messages.compact`. In JSON base64."""
    since: Count | None = None
    """Of older frames than this nothing is known; absent: as before, of a key frame 1."""
    falsified: Annotated[tuple[Range, ...], Meta(max_length=256)] = ()
    """Frames that were falsified since the message before; with a key frame, all that are known."""


class Scene(Message, frozen=True, omit_defaults=True, gc=False, eq=False, tag="scene"):
    """Servlet: what there is to see, for one who has just come."""

    number: Number
    """Number of the `Follow` that it answers."""
    robot: Word
    """Name of the robot's model."""
    initial: Array
    """Joints before the start of the timeline [rad], (n,)."""
    start: Time
    """Origin of the timeline [s]."""
    end: Time
    """End of what is planned [s]."""
    segments: Count
    """How many segments the timeline has; `Want` fetches them."""
    edit: Count
    """Number of the newest edit in it."""
    now: Time
    """The engine's time [s]."""
    rate: Rate | None = None
    """Rate of the frames that follow [1/s]; None where segments do."""


@dataclass(frozen=True, slots=True, eq=False)
class History:
    """Servlet: a part of the timeline that a `Scene` named."""

    kind: ClassVar[str] = "history"
    version: ClassVar[int] = 1
    edit: int
    index: int
    """Index of the first segment."""
    segments: tuple[PolynomialSegment, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """Servlet: an edit of the timeline, as the segments that it put in.

    The first `first` segments stay, then come `segments`, then those of the base from `tail` on, beginning at
    `tail_start`.
    """

    kind: ClassVar[str] = "change"
    version: ClassVar[int] = 1
    base: int
    """Number of the edit before it."""
    edit: int
    """Its number."""
    command_id: int | None
    """The command that made it, where that's known."""
    first: int
    segments: tuple[PolynomialSegment, ...]
    tail: int | None
    tail_start: float
    """[s]."""
    end: float
    """End of the new timeline [s], for a check."""


@dataclass(frozen=True, slots=True)
class Pulse:
    """Servlet: up to `past`, the timeline with this edit is what happened."""

    kind: ClassVar[str] = "pulse"
    version: ClassVar[int] = 1
    edit: int
    now: float
    """The engine's time [s]."""
    past: float
    """What lies before doesn't change any more [s]; −∞ for an offline engine."""


def _check_number(number: object) -> None:
    if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number < 2**63:
        raise InvalidValueError("number", number, "a number from 1")


Request: TypeAlias = Order | Ask | Follow | Want
"""What a client sends."""
Reply: TypeAlias = Outcome | Answer | Broadcast | Compact | Scene | History | Change | Pulse
"""What a servlet sends."""
