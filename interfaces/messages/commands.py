"""Commands on the wire, and receipts."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import inf
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta
from typing_extensions import override

from interfaces.messages.fields import (
    MOST_NAMES,
    Count,
    Joints,
    Message,
    Names,
    Number,
    Text,
    Time,
    Value,
    Wire,
    Word,
    array,
    check_normal,
    numbers,
    plain,
    text,
)
from vrs import commands
from vrs.commands import Command, Frame, Insertion, JointTarget, Motion, PoseTarget, Profile
from vrs.errors import InvalidValueError
from vrs.ledger import Receipt, Status

_Row = Annotated[list[Annotated[float, Meta(ge=-1e6, le=1e6)]], Meta(min_length=4, max_length=4)]
"""Of a pose: whether it's one can be found out without an overflow."""
_Pose = Annotated[list[_Row], Meta(min_length=4, max_length=4)]
_Whole = Annotated[int, Meta(ge=-(10**9), le=10**9)]
_Distance = Annotated[float, Meta(ge=0, le=1e6)]
_Share = Annotated[float, Meta(ge=1e-3, le=1)]
_PLAIN = frozenset(("pace", "acceleration"))
"""Fields of moves that most moves leave at 1."""
ENDLESS = "inf"
"""Infinity, of which JSON knows nothing."""


class JointsWire(Message, frozen=True, omit_defaults=True, gc=False, tag="joints"):
    """`JointTarget`."""

    q: Joints

    def read(self) -> JointTarget:
        """The target."""
        return JointTarget(self.q)


class PoseWire(Message, frozen=True, omit_defaults=True, gc=False, tag="pose"):
    """`PoseTarget`."""

    X: _Pose
    configuration: Word | None = None

    def read(self) -> PoseTarget:
        """The target."""
        return PoseTarget(self.X, self.configuration)


TargetWire: TypeAlias = JointsWire | PoseWire


class AimedWire(Message, frozen=True, omit_defaults=True, gc=False):
    """A command with a target."""

    @override
    @classmethod
    def of(cls, value: Any, packed: bool) -> AimedWire:
        return cls(*[_field(getattr(value, name), packed) for name in cls.__struct_fields__])


def _field(field: Any, packed: bool) -> Any:
    """The wire form of a field of a command with a target."""
    if isinstance(field, JointTarget | PoseTarget):
        return (JointsWire if isinstance(field, JointTarget) else PoseWire).of(field, packed)
    if isinstance(field, np.ndarray):
        return field.tolist()
    return ENDLESS if isinstance(field, float) and field == inf else field


class MoveWire(AimedWire, frozen=True, omit_defaults=True, gc=False, tag="move"):
    """`MotionCommand`."""

    target: TargetWire
    issued_at: Time | None = None
    execute_at: Time | None = None
    speed: _Share = 1.0
    motion: Motion = Motion.JOINT
    profile: Profile = Profile.PARABOLIC
    insertion: Insertion = Insertion.SPLICE
    deviation: _Distance | Literal["inf"] = 0.0
    pace: _Share = 1.0
    acceleration: Annotated[float, Meta(ge=1e-2, le=1)] = 1.0
    tool: _Pose | None = None

    @override
    @classmethod
    def of(cls, value: Any, packed: bool) -> MoveWire:
        fields = {name: _field(getattr(value, name), packed) for name in cls.__struct_fields__}
        # Defaults are left out where they're the very same object, which a float seldom is.
        return cls(**{name: field for name, field in fields.items() if name not in _PLAIN or field != 1.0})

    def read(self) -> commands.MotionCommand:
        """The command."""
        deviation = inf if self.deviation == ENDLESS else float(self.deviation)
        how = self.speed, self.motion, self.profile, self.insertion, deviation, self.pace, self.acceleration
        tool = None if self.tool is None else np.array(self.tool)
        return commands.MotionCommand(self.target.read(), self.issued_at, self.execute_at, *how, tool)


class SteerWire(Message, frozen=True, omit_defaults=True, gc=False, tag="steer"):
    """`SteerCommand`."""

    rates: Joints | None = None
    twist: Annotated[list[Value], Meta(min_length=6, max_length=6)] | None = None
    frame: Frame = Frame.BASE
    issued_at: Time | None = None
    execute_at: Time | None = None

    def read(self) -> commands.SteerCommand:
        """The command."""
        rates, twist = (None if x is None else array(x) for x in (self.rates, self.twist))
        return commands.SteerCommand(rates, twist, self.frame, self.issued_at, self.execute_at)


class DriveWire(Message, frozen=True, omit_defaults=True, gc=False, tag="drive"):
    """`DriveCommand`."""

    v: Value
    w: Value
    duration: Annotated[float, Meta(gt=0, le=1e9)]
    issued_at: Time | None = None
    execute_at: Time | None = None

    def read(self) -> commands.DriveCommand:
        """The command."""
        return commands.DriveCommand(self.v, self.w, self.duration, self.issued_at, self.execute_at)


class RetimeWire(Message, frozen=True, omit_defaults=True, gc=False, tag="retime"):
    """`Retime`."""

    command_id: Number
    execute_at: Time
    issued_at: Time | None = None

    def read(self) -> commands.Retime:
        """The command."""
        return commands.Retime(self.command_id, self.execute_at, self.issued_at)


class CancelWire(Message, frozen=True, omit_defaults=True, gc=False, tag="cancel"):
    """`Cancel`."""

    command_id: Number
    issued_at: Time | None = None
    execute_at: Time | None = None

    def read(self) -> commands.Cancel:
        """The command."""
        return commands.Cancel(self.command_id, self.issued_at, self.execute_at)


class ViaWire(AimedWire, frozen=True, omit_defaults=True, gc=False, tag="via"):
    """`InsertVia`."""

    command_id: Number
    target: TargetWire
    deviation: _Distance = 0.0
    issued_at: Time | None = None
    execute_at: Time | None = None

    def read(self) -> commands.InsertVia:
        """The command."""
        stamps = self.issued_at, self.execute_at
        return commands.InsertVia(self.command_id, self.target.read(), self.deviation, *stamps)


class ScaleWire(Message, frozen=True, omit_defaults=True, gc=False, tag="scale"):
    """`ScaleTime`."""

    factor: Annotated[float, Meta(ge=1e-3, le=1e3)]
    issued_at: Time | None = None
    execute_at: Time | None = None

    def read(self) -> commands.ScaleTime:
        """The command."""
        return commands.ScaleTime(self.factor, self.issued_at, self.execute_at)


class StopWire(Message, frozen=True, omit_defaults=True, gc=False, tag="stop"):
    """`Stop`."""

    issued_at: Time | None = None
    execute_at: Time | None = None

    def read(self) -> commands.Stop:
        """The command."""
        return commands.Stop(self.issued_at, self.execute_at)


class ContinueWire(Message, frozen=True, omit_defaults=True, gc=False, tag="resume"):
    """`vrs.commands.Resume`."""

    issued_at: Time | None = None
    execute_at: Time | None = None

    def read(self) -> commands.Resume:
        """The command."""
        return commands.Resume(self.issued_at, self.execute_at)


class QueryWire(Message, frozen=True, omit_defaults=True, gc=False, tag="query"):
    """`PositionQuery`."""

    t: Time | None = None

    def read(self) -> commands.PositionQuery:
        """The command."""
        return commands.PositionQuery(self.t)


class ParameterWire(Message, frozen=True, omit_defaults=True, gc=False, tag="parameter"):
    """`ParameterChange`."""

    name: Word
    value: bool | _Whole | Value | Word | Joints | None = None

    def read(self) -> commands.ParameterChange:
        """The command."""
        return commands.ParameterChange(self.name, self.value)


CommandWire: TypeAlias = (
    MoveWire | SteerWire | DriveWire | RetimeWire | CancelWire | ViaWire | ScaleWire | StopWire | ContinueWire
    | QueryWire | ParameterWire
)  # fmt: skip


class ReceiptWire(Wire, frozen=True, omit_defaults=True, gc=False):
    """`Receipt`."""

    most_names: ClassVar[int | None] = MOST_NAMES
    """Commands of each kind that it names, at most; None for all."""
    command_id: Count
    status: Status
    issued_at: Time | None = None
    asked_at: Time | None = None
    execute_at: Time | None = None
    end: Time | None = None
    q: Joints | None = None
    reason: Text = ""
    version: Count = 0
    shift: Value = 0.0
    superseded_by: Count | None = None
    """0 for a correction: no command did it."""
    undone: bool = False
    shifted: Names = ()
    superseded: Names = ()
    hindrance: Text = ""

    @classmethod
    def of(cls, receipt: Receipt) -> Self:
        """The form of a receipt; of the commands that it names, the first `most_names` of each kind."""
        return cls(
            receipt.command_id,
            receipt.status,
            receipt.issued_at,
            receipt.asked_at,
            receipt.execute_at,
            receipt.end,
            None if receipt.q is None else numbers(receipt.q),
            text(receipt.reason),
            receipt.version,
            receipt.shift,
            receipt.superseded_by,
            receipt.undone,
            receipt.shifted[: cls.most_names],
            receipt.superseded[: cls.most_names],
            text(receipt.hindrance),
        )

    def read(self) -> Receipt:
        """The receipt."""
        return Receipt(
            self.command_id,
            self.status,
            self.issued_at,
            self.asked_at,
            self.execute_at,
            self.end,
            None if self.q is None else array(self.q),
            self.reason,
            self.version,
            self.shift,
            self.superseded_by,
            self.undone,
            self.shifted,
            self.superseded,
            self.hindrance,
        )


_WIRES: dict[type, type[Message]] = {
    commands.MotionCommand: MoveWire,
    commands.SteerCommand: SteerWire,
    commands.DriveCommand: DriveWire,
    commands.Retime: RetimeWire,
    commands.Cancel: CancelWire,
    commands.InsertVia: ViaWire,
    commands.ScaleTime: ScaleWire,
    commands.Stop: StopWire,
    commands.Resume: ContinueWire,
    commands.PositionQuery: QueryWire,
    commands.ParameterChange: ParameterWire,
}


def command_wire(command: Command | None, packed: bool) -> CommandWire | None:
    """The wire form of a command.

    Raises:
        InvalidValueError: If it's none.
    """
    if command is None:
        return None
    kind = _WIRES.get(type(command))
    if kind is None:
        raise InvalidValueError("command", command, f"one of {', '.join(known.__name__ for known in _WIRES)}")
    return kind.of(command, packed)  # type: ignore[return-value]


_encode = msgspec.msgpack.Encoder(enc_hook=plain).encode


def check_crosses(command: Command) -> None:
    """Check that whoever gets a command over a connection can read it.

    Raises:
        InvalidValueError: If it can't be written, or a reader would refuse it.
    """
    try:
        wire = _reader()(_encode(command_wire(command, packed=True)))
        check_normal(wire, "command")
        wire.read()
    except (msgspec.MsgspecError, OverflowError, TypeError) as error:
        raise InvalidValueError("command", command, f"one that can cross a connection: {error}") from None


@cache
def _reader() -> Callable[[bytes], CommandWire]:
    return msgspec.msgpack.Decoder(CommandWire).decode
