"""Messages of the four interfaces and of the server submodule on the wire: `interfaces.messages`."""

from __future__ import annotations

import math
from typing import Annotated, Generic

from msgspec import UNSET, Meta, UnsetType
from typing_extensions import override

from interfaces.messages import (
    Answer,
    Broadcast,
    Change,
    Frame,
    FrameStatus,
    History,
    Order,
    Outcome,
    Pulse,
    Verdicts,
)
from interfaces.messages.commands import CommandWire, ReceiptWire, command_wire
from interfaces.messages.fields import (
    CommandId,
    Count,
    Digits,
    Joints,
    Message,
    Number,
    Text,
    Time,
    array,
    digits,
    epoch,
    numbers,
    text,
)
from interfaces.messages.requests import Range
from interfaces.messages.segments import C, Dof, Segments, rows, segments_of


class OrderWire(Message, frozen=True, omit_defaults=True, gc=False, tag="order"):
    """`Order`."""

    number: Number
    command: CommandWire | None = None
    epoch: Digits | None = None

    @override
    @classmethod
    def of(cls, value: Order, packed: bool) -> OrderWire:
        return cls(value.number, command_wire(value.command, packed), digits(value.epoch))

    def read(self) -> Order:
        """The order."""
        command = None if self.command is None else self.command.read()
        return Order(self.number, command, epoch(self.epoch))


class OutcomeWire(Message, frozen=True, omit_defaults=True, gc=False, tag="outcome"):
    """`Outcome`."""

    number: Number
    made_at: Time
    receipt: ReceiptWire | None = None
    refusal: Text = ""
    revision: Count = 0

    @override
    @classmethod
    def of(cls, value: Outcome, packed: bool) -> OutcomeWire:
        receipt = None if value.receipt is None else ReceiptWire.of(value.receipt)
        return cls(value.number, value.made_at, receipt, text(value.refusal), value.revision)

    def read(self) -> Outcome:
        """The outcome."""
        receipt = None if self.receipt is None else self.receipt.read()
        return Outcome(self.number, receipt, self.refusal, self.revision, self.made_at)


class AnswerWire(Message, frozen=True, omit_defaults=True, gc=False, tag="answer"):
    """`Answer`, its frame's fields among its own."""

    number: Count
    t: Time
    made_at: Time
    q: Joints
    status: FrameStatus
    now: Time
    falsified_by: CommandId | None = None

    @override
    @classmethod
    def of(cls, value: Answer, packed: bool) -> AnswerWire:
        frame = value.frame
        q, status = numbers(frame.q), frame.status
        return cls(frame.number, frame.t, frame.made_at, q, status, value.now, frame.falsified_by)

    def read(self) -> Answer:
        """The answer."""
        q = array(self.q)
        return Answer(Frame(self.number, self.t, self.made_at, q, self.status, self.falsified_by), self.now)


class BroadcastWire(Message, frozen=True, omit_defaults=True, gc=False, tag="broadcast"):
    """`Broadcast`, the fields of its frame and of its verdicts among its own."""

    number: Count
    t: Time
    made_at: Time
    q: Joints
    since: Count
    through: Count
    status: FrameStatus = FrameStatus.PREDICTED
    falsified_by: CommandId | None = None
    falsified: Annotated[tuple[Range, ...], Meta(max_length=256)] = ()

    @override
    @classmethod
    def of(cls, value: Broadcast, packed: bool) -> BroadcastWire:
        frame, verdicts = value.frame, value.verdicts
        return cls(
            frame.number,
            frame.t,
            frame.made_at,
            frame.q.tolist(),
            verdicts.since,
            verdicts.through,
            frame.status,
            frame.falsified_by,
            verdicts.falsified,
        )

    def read(self) -> Broadcast:
        """The frame and its verdicts."""
        frame = Frame(self.number, self.t, self.made_at, array(self.q), self.status, self.falsified_by)
        return Broadcast(frame, Verdicts(self.since, self.through, self.falsified))


class HistoryWire(Message, Generic[C], frozen=True, omit_defaults=True, gc=False, tag="history"):
    """`History`."""

    edit: Count
    index: Count
    dof: Dof = 0
    start: Time = 0.0
    segments: Segments[C] = ()

    @override
    @classmethod
    def of(cls, value: History, packed: bool) -> HistoryWire[C]:
        return cls(value.edit, value.index, *rows(value.segments, packed))

    def read(self) -> History:
        """The part of a history."""
        return History(self.edit, self.index, segments_of(self.dof, self.start, self.segments))


class ChangeWire(Message, Generic[C], frozen=True, omit_defaults=True, gc=False, tag="change"):
    """`Change`; `base` is left out where it's the edit before, `tail_start` where it's the end."""

    edit: Number
    first: Count
    end: Time
    command_id: CommandId | None = None
    base: Count | None = None
    tail: Count | None = None
    tail_start: Time | None = None
    dof: Dof = 0
    start: Time = 0.0
    segments: Segments[C] = ()

    @override
    @classmethod
    def of(cls, value: Change, packed: bool) -> ChangeWire[C]:
        base = None if value.base == value.edit - 1 else value.base
        tail_start = None if value.tail_start == value.end else value.tail_start
        known = value.edit, value.first, value.end, value.command_id, base, value.tail, tail_start
        return cls(*known, *rows(value.segments, packed))

    def read(self) -> Change:
        """The edit."""
        base = self.edit - 1 if self.base is None else self.base
        tail_start = self.end if self.tail_start is None else self.tail_start
        segments = segments_of(self.dof, self.start, self.segments)
        return Change(base, self.edit, self.command_id, self.first, segments, self.tail, tail_start, self.end)


class PulseWire(Message, frozen=True, omit_defaults=True, gc=False, tag="pulse"):
    """`Pulse`; `past` is left out where it's now, and null for −∞."""

    edit: Count
    now: Time
    past: Time | UnsetType | None = UNSET

    @override
    @classmethod
    def of(cls, value: Pulse, packed: bool) -> PulseWire:
        past = UNSET if value.past == value.now else None if value.past == -math.inf else value.past
        return cls(value.edit, value.now, past)

    def read(self) -> Pulse:
        """The pulse."""
        past = self.now if self.past is UNSET else -math.inf if self.past is None else self.past
        return Pulse(self.edit, self.now, past)
