"""What crosses between a client and the servlet near the engine: frozen values with a kind and a version.

Numbers count from 1 and belong to one client. Times are in the engine's time; the engine's time and the user's are
the same timeline, shifted by D, so that stamps cross as they are (Doulgeri, Zikos, Delopoulos, section IV-A).
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, NamedTuple, TypeAlias, get_args

import msgspec
from msgspec import Meta
from msgspec.structs import replace
from typing_extensions import override

from interfaces.messages.fields import (
    CommandId,
    Count,
    Epoch,
    Leased,
    Message,
    Number,
    Party,
    Rate,
    Share,
    Text,
    Time,
    Word,
    check_normal,
    cut,
    plain,
    rich,
)
from interfaces.messages.segments import Dof, Segmented, Segments
from vrs.checks import finite
from vrs.commands import Command, MotionCommand
from vrs.errors import InvalidValueError
from vrs.ledger import Receipt
from vrs.model import Array
from vrs.record import Record, set_field

if TYPE_CHECKING:
    Before: TypeAlias = int
    When: TypeAlias = float
    Past: TypeAlias = float
else:
    Before = Count | None
    When = Time | None
    Past = Time | msgspec.UnsetType | None

LONGEST_DELAY: Final = 0.1
"""Compact frames wait no longer for others that go in the same message [s]."""


_KINDS: tuple[type, ...] = get_args(Command)
_encode = msgspec.msgpack.Encoder(enc_hook=plain).encode


def check_command(command: object) -> None:
    """Check that it's a command.

    Raises:
        InvalidValueError: If it isn't.
    """
    if not isinstance(command, _KINDS):
        raise InvalidValueError("command", command, f"one of {', '.join(kind.__name__ for kind in _KINDS)}")


def portable(receipt: Receipt, most: int | None = None) -> Receipt:
    """Return a receipt that holds nothing of the engine: names found, texts as long as they're read.

    Args:
        receipt: As an engine gave it.
        most: Names of each kind, the first ones; None for all.
    """
    found: Receipt = cut(receipt.named(most))
    return found


def check_crosses(command: Command) -> None:
    """Check that whoever gets a command over a connection can read it.

    Raises:
        InvalidValueError: If it can't be written, or a reader would refuse it.
    """
    check_command(command)
    try:
        data = _encode(command)
        check_normal(msgspec.msgpack.decode(data), _reader()(data), "command")
    except (msgspec.MsgspecError, OverflowError, TypeError) as error:
        raise InvalidValueError("command", command, f"one that can cross a connection: {error}") from None


@cache
def _reader() -> Callable[[bytes], Command]:
    return msgspec.msgpack.Decoder(Command, dec_hook=rich).decode


class FrameStatus(enum.StrEnum):
    """How far a frame can be trusted."""

    PREDICTED = "predicted"
    """It shows a time that the engine's clock hasn't passed, as far as is known: a command may change it."""
    CONFIRMED = "confirmed"
    """The engine's clock has passed the time it shows, and what it shows came true."""
    FALSIFIED = "falsified"
    """A command has changed what happens at the time it shows."""


class RefusalCode(enum.StrEnum):
    """Why a command isn't carried out, as far as clients decide by it."""

    OTHER = "other"
    """What the text says; from a peer of another age perhaps one of these."""
    OVERRULED = "overruled"
    """Another session has commanded since the lease was shared: it's to be shared again."""
    NOT_FOLLOWING = "not-following"
    """The real robot has stopped by itself, or is gone."""

    @classmethod
    @override
    def _missing_(cls, value: object) -> RefusalCode:
        return cls.OTHER


class Refusal(NamedTuple):
    """Why a command isn't carried out."""

    text: str
    """For people."""
    code: RefusalCode = RefusalCode.OTHER


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


NAMED: Final = 256
"""Commands whose names are told to who has just come, at most."""
Label = Annotated[str, Meta(max_length=60)]
"""What people call a command."""


class CommandName(Record, frozen=True, omit_defaults=True, gc=False):
    """What a command is, and what people call it; of several of one command each counts from its time on."""

    command_id: CommandId
    t: Time
    """From this session time on [s]: steering goes one way, then another."""
    kind: Word
    """Type of the command."""
    label: Label = ""
    """As the order said."""
    speed: Share = 1.0
    """Of a move, as it was commanded."""

    @classmethod
    def of(cls, command: Command, label: str, command_id: int, t: float) -> CommandName:
        """Name a command from a time [s] on."""
        name = cls(command_id, t, str(command.__struct_config__.tag), label)
        return replace(name, speed=command.speed) if isinstance(command, MotionCommand) else name


class Order(Leased, frozen=True, omit_defaults=True, gc=False, tag="order"):
    """Carry out a command. It's sent again until its outcome comes, and carried out once."""

    sender: ClassVar[Party] = Party.HOLDER
    number: Number
    """Orders are carried out in the order of their numbers; a stop doesn't wait."""
    command: Command | None = None
    """None: take back the newest accepted command."""
    epoch: Epoch | None = None
    """Of the control lease; None where none is needed, as on an engine in this process."""
    label: Label = ""
    """What people call the command; all who follow the timeline are told."""

    def __post_init__(self) -> None:
        _check_number(self.number)
        if self.command is not None:
            check_command(self.command)
        super().__post_init__()


class Ask(Message, frozen=True, omit_defaults=True, gc=False, tag="ask"):
    """g(t). Sent again with the same number, it asks what has become of that frame."""

    sender: ClassVar[Party] = Party.CLIENT
    number: Number
    """The client's own, each used once."""
    t: Time | None = None
    """[s]; absent: now."""

    def __post_init__(self) -> None:
        _check_number(self.number)
        if self.t is not None:
            finite("t", self.t, "None or finite seconds")


class Follow(Message, frozen=True, omit_defaults=True, gc=False, tag="follow"):
    """The scene, then what follows; one at a time counts, another number replaces it."""

    sender: ClassVar[Party] = Party.CLIENT
    number: Number
    form: ViewForm
    """`segments`: the timeline and each edit of it; `frames`: positions; `compact`: positions in few bytes."""
    rate: Rate | None = None
    """Of frames [1/s]: the broadcaster with the nearest one is taken."""
    delay: Annotated[float, Meta(ge=0, le=LONGEST_DELAY)] = 0.0
    """Of compact frames: how long one may wait for others that go in the same message [s]."""

    def __post_init__(self) -> None:
        _check_number(self.number)
        if self.rate is not None:
            finite("rate", self.rate, "None or frames a second")
        if not 0 <= finite("delay", self.delay, "0 to 0.1 s") <= LONGEST_DELAY:
            raise InvalidValueError("delay", self.delay, "0 to 0.1 s")


class Want(Message, frozen=True, omit_defaults=True, gc=False, tag="want"):
    """Segments of the scene of that edit, from that one on; without `index` all edits after that one."""

    sender: ClassVar[Party] = Party.CLIENT
    edit: Count
    """Of the newest edit that the client has, or of the scene."""
    index: Count | None = None
    """First segment that it lacks."""


class Outcome(Message, frozen=True, omit_defaults=True, gc=False, eq=False, tag="outcome"):
    """What became of an order; again when a later command changed that."""

    sender: ClassVar[Party] = Party.SERVER
    number: Number
    """Of the order."""
    made_at: Time
    """The engine's time [s]."""
    receipt: Receipt | None = None
    """None where it was refused, there was nothing to take back, or the command gives no receipt."""
    refusal: Text = ""
    """Why it wasn't taken at all, `no lease: …` where the epoch isn't in force, or why nothing is taken back."""
    revision: Count = 0
    """Counts up with each change of the receipt, from 0."""
    code: RefusalCode = RefusalCode.OTHER
    """Why it was refused or rejected, where clients decide by it."""


class Answer(Message, frozen=True, omit_defaults=True, gc=False, eq=False, tag="answer"):
    """The frame that was asked for, with its status as it is now."""

    sender: ClassVar[Party] = Party.SERVER
    number: Count
    """Of the `Ask`."""
    t: Time
    """Time that the frame shows [s]."""
    made_at: Time
    """The engine's time when it was made [s]."""
    q: Array
    """Joints [rad]."""
    status: FrameStatus
    now: Time
    """The engine's time when this was sent [s]."""
    falsified_by: CommandId | None = None
    """Id of the first command that changed what happens at `t`; None where none did, or nobody knows which."""

    @classmethod
    def showing(cls, frame: Frame, now: float) -> Answer:
        """The answer that shows a frame."""
        return cls(frame.number, frame.t, frame.made_at, frame.q, frame.status, now, frame.falsified_by)

    @property
    def frame(self) -> Frame:
        """The frame."""
        return Frame(self.number, self.t, self.made_at, self.q, self.status, self.falsified_by)


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


Range: TypeAlias = tuple[Count, Count, CommandId | None]
"""First and last number of frames that were falsified, and the command."""


class Broadcast(Message, frozen=True, omit_defaults=True, gc=False, eq=False, tag="broadcast"):
    """The newest frame of a broadcaster, and what became of earlier ones."""

    sender: ClassVar[Party] = Party.SERVER
    number: Count
    """Counts the broadcaster's frames."""
    t: Time
    """Time that the frame shows [s]."""
    made_at: Time
    """The engine's time when it was made [s]."""
    q: Array
    """Joints [rad]."""
    since: Count
    """Number of the first frame of which anything is known; what became of older ones isn't."""
    through: Count
    """Frames from `since` to this one are confirmed, but for those in `falsified`; later ones are predicted."""
    status: FrameStatus = FrameStatus.PREDICTED
    """How far it could be trusted when it was made."""
    falsified_by: CommandId | None = None
    """Id of the first command that changed what happens at `t`; None where none did, or nobody knows which."""
    falsified: Annotated[tuple[Range, ...], Meta(max_length=256)] = ()
    """[first, last, command]: numbers of frames that were falsified, and the command that did it, or null."""

    @classmethod
    def showing(cls, frame: Frame, verdicts: Verdicts) -> Broadcast:
        """The message with a frame and verdicts."""
        what = frame.number, frame.t, frame.made_at, frame.q, verdicts.since, verdicts.through
        return cls(*what, frame.status, frame.falsified_by, verdicts.falsified)

    @property
    def frame(self) -> Frame:
        """The frame."""
        return Frame(self.number, self.t, self.made_at, self.q, self.status, self.falsified_by)

    @property
    def verdicts(self) -> Verdicts:
        """What became of earlier frames."""
        return Verdicts(self.since, self.through, self.falsified)


class Compact(Message, frozen=True, omit_defaults=True, gc=False, tag="compact"):
    """The newest frames of a broadcaster in compact form, and what became of earlier ones."""

    sender: ClassVar[Party] = Party.SERVER
    q: Annotated[bytes, Meta(min_length=2, max_length=32768)]
    """1 to 16 frames that follow each other: *bin* in msgpack, in JSON base64 with padding (RFC 4648)."""
    since: Count | None = None
    """As in `Broadcast`; absent: what was told last, with a key frame 1."""
    falsified: Annotated[tuple[Range, ...], Meta(max_length=256)] = ()
    """As in `Broadcast`: what is new since the message before; with a key frame all that are known."""


class Scene(Message, frozen=True, omit_defaults=True, gc=False, eq=False, tag="scene"):
    """What there is to see, for one who has just come."""

    sender: ClassVar[Party] = Party.SERVER
    number: Number
    """Of the `Follow`."""
    robot: Word
    """Name of the robot's model."""
    initial: Array
    """Joints before the start [rad]."""
    start: Time
    """Origin of the timeline [s]."""
    end: Time
    """End of what is planned [s]."""
    segments: Count
    """How many it has; `Want` fetches them."""
    edit: Count
    """Number of its newest edit."""
    now: Time
    """Session time [s]."""
    rate: Rate | None = None
    """Of the frames that follow [1/s]; absent for segments."""
    names: Annotated[tuple[CommandName, ...], Meta(max_length=NAMED)] = ()
    """Of the newest commands, oldest first; absent for frames."""


class History(Segmented, Message, frozen=True, omit_defaults=True, gc=False, eq=False, tag="history"):
    """A part of the timeline that a `Scene` named."""

    sender: ClassVar[Party] = Party.SERVER
    edit: Count
    """Of that scene."""
    index: Count
    """Index of the first segment."""
    dof: Dof = 0
    """Joints of the segments."""
    start: Time = 0.0
    """Start of the first segment [s]."""
    segments: Segments = ()
    """In their order; see above."""


class Change(Segmented, Message, frozen=True, omit_defaults=True, gc=False, eq=False, tag="change"):
    """An edit: the first segments of its base stay, `segments` come next, then those of the base from `tail` on."""

    absent: ClassVar[Mapping[str, str]] = {"base": "edit - 1", "tail_start": "end"}
    sender: ClassVar[Party] = Party.SERVER
    edit: Number
    """Its number."""
    first: Count
    """So many segments of the base stay as they are."""
    end: Time
    """End of the new timeline [s], for a check, to 10⁻⁹."""
    command_id: CommandId | None = None
    """The command that made it, where that's known."""
    base: Before = None  # type: ignore[assignment]
    """Number of the edit that it builds on."""
    tail: Count | None = None
    """Index, in the base, of the first segment that comes after the new ones; None: none does."""
    tail_start: When = None  # type: ignore[assignment]
    """When that one starts now [s]; it and all after it are shifted alike, to rounding (10⁻¹² s)."""
    dof: Dof = 0
    """Joints of the segments."""
    start: Time = 0.0
    """Start of the first segment [s]."""
    segments: Segments = ()
    """These come after the first ones."""
    name: CommandName | None = None
    """What the command is called, where that's new."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.base is None:
            set_field(self, "base", self.edit - 1)
        if self.tail_start is None:
            set_field(self, "tail_start", self.end)

    @override
    def as_written(self, packed: bool) -> Change:
        message = super().as_written(packed)
        if self.base == self.edit - 1:
            set_field(message, "base", None)
        if self.tail_start == self.end:
            set_field(message, "tail_start", None)
        return message


class Pulse(Message, frozen=True, omit_defaults=True, gc=False, tag="pulse"):
    """Every 0.1 s: up to `past`, the timeline with this edit is what happened."""

    absent: ClassVar[Mapping[str, str]] = {"past": "now"}
    sender: ClassVar[Party] = Party.SERVER
    edit: Count
    """The newest."""
    now: Time
    """The engine's time [s]."""
    past: Past = msgspec.UNSET  # type: ignore[assignment]
    """What lies before doesn't change any more [s]; null: −∞, of an offline engine."""

    def __post_init__(self) -> None:
        if not isinstance(self.past, float):
            set_field(self, "past", -math.inf if self.past is None else float(self.now))

    @override
    def as_written(self, _packed: bool) -> Pulse:
        if self.past not in {self.now, -math.inf}:
            return self
        message = copy(self)
        set_field(message, "past", msgspec.UNSET if self.past == self.now else None)
        return message


def _check_number(number: object) -> None:
    if isinstance(number, bool) or not isinstance(number, int) or not 1 <= number < 2**63:
        raise InvalidValueError("number", number, "a number from 1")


Request: TypeAlias = Order | Ask | Follow | Want
"""What a client sends."""
Reply: TypeAlias = Outcome | Answer | Broadcast | Compact | Scene | History | Change | Pulse
"""What a servlet sends."""
