"""Messages between the operator's site and the robot's, on the wire."""

from __future__ import annotations

from typing import Annotated, Generic

from msgspec import Meta
from typing_extensions import override

from interfaces.messages.commands import CommandWire, ReceiptWire, command_wire
from interfaces.messages.fields import (
    Count,
    Digits,
    Joints,
    Message,
    Number,
    Stamp,
    Text,
    Time,
    Value,
    Wire,
    array,
    epoch,
    numbers,
    text,
)
from interfaces.messages.segments import C, Dof, Planned, rows, segments_of
from interfaces.messages.sites import AGAIN, NEW, RANGES, LogEntry, Orders, PlanPart, Report, Sample

MOST_ENTRIES = 4096
"""Entries or receipts in one message, at most."""


class EntryWire(Wire, frozen=True, omit_defaults=True, gc=False):
    """`LogEntry`."""

    number: Number
    at: Time
    command_id: Count
    command: CommandWire | None = None

    @classmethod
    def of(cls, entry: LogEntry, packed: bool) -> EntryWire:
        """The wire form."""
        return cls(entry.number, entry.at, entry.command_id, command_wire(entry.command, packed))

    def read(self) -> LogEntry:
        """The entry."""
        return LogEntry(
            self.number, self.at, None if self.command is None else self.command.read(), self.command_id
        )


class OrdersWire(Message, frozen=True, omit_defaults=True, gc=False, tag="orders"):
    """`Orders`."""

    epoch: Digits
    number: Number
    sent_at: Stamp
    newest: Count
    complete_until: Time
    epoch_began: Time
    heard: Count = 0
    entries: Annotated[tuple[EntryWire, ...], Meta(max_length=MOST_ENTRIES)] = ()
    wanted: Annotated[tuple[tuple[Number, Number], ...], Meta(max_length=RANGES)] = ()
    halted: Text = ""

    @override
    @classmethod
    def of(cls, value: Orders, packed: bool) -> OrdersWire:
        times = value.newest, value.complete_until, value.epoch_began
        entries = tuple(EntryWire.of(entry, packed) for entry in value.entries)
        own, halted = (str(value.epoch), value.number, value.sent_at), text(value.halted)
        return cls(*own, *times, value.heard, entries, value.wanted, halted)

    def read(self) -> Orders:
        """The orders."""
        times = self.newest, self.complete_until, self.epoch_began
        entries = tuple(entry.read() for entry in self.entries)
        own = epoch(self.epoch), self.number, self.sent_at
        return Orders(*own, *times, self.heard, entries, self.wanted, self.halted)


class PlanPartWire(Wire, Generic[C], frozen=True, omit_defaults=True, gc=False):
    """`PlanPart`."""

    version: Count
    since: Time
    initial: Joints
    dof: Dof = 0
    start: Time = 0.0
    segments: Planned[C] = ()

    @classmethod
    def of(cls, plan: PlanPart, packed: bool) -> PlanPartWire[C]:
        """The wire form."""
        return cls(plan.version, plan.since, numbers(plan.initial), *rows(plan.segments, packed))

    def read(self) -> PlanPart:
        """The plan."""
        segments = segments_of(self.dof, self.start, self.segments)
        return PlanPart(self.version, self.since, array(self.initial), segments)


class SampleWire(Wire, frozen=True, array_like=True, gc=False):
    """`Sample`, as an array."""

    number: Number
    t: Stamp
    play: Time
    q: Joints
    reference: Joints | None = None

    @classmethod
    def of(cls, value: Sample) -> SampleWire:
        """The sample on the wire."""
        reference = None if value.reference is None else numbers(value.reference)
        return cls(value.number, value.t, value.play, numbers(value.q), reference)

    def read(self) -> Sample:
        """The sample."""
        reference = None if self.reference is None else array(self.reference)
        return Sample(self.number, self.t, self.play, array(self.q), reference)


class ReportWire(Message, Generic[C], frozen=True, omit_defaults=True, gc=False, tag="report"):
    """`Report`."""

    epoch: Digits
    number: Number
    sent_at: Stamp
    executed: Count
    play: Time
    pace: Value
    q: Joints
    measured_at: Stamp
    q_at: Time
    echo: tuple[Number, Stamp, Stamp] | None = None
    halted: Text = ""
    receipts: Annotated[tuple[tuple[Number, ReceiptWire], ...], Meta(max_length=MOST_ENTRIES)] = ()
    plan: PlanPartWire[C] | None = None
    reference: Joints | None = None
    uncertainty: Annotated[float, Meta(ge=0, le=1e12)] | None = None
    samples: Annotated[tuple[SampleWire, ...], Meta(max_length=NEW + AGAIN)] = ()
    oldest: Count = 0

    @override
    @classmethod
    def of(cls, value: Report, packed: bool) -> ReportWire[C]:
        return cls(
            str(value.epoch),
            value.number,
            value.sent_at,
            value.executed,
            value.play,
            value.pace,
            numbers(value.q),
            value.measured_at,
            value.q_at,
            value.echo,
            text(value.halted),
            tuple((number, ReceiptWire.of(receipt)) for number, receipt in value.receipts),
            None if value.plan is None else PlanPartWire.of(value.plan, packed),
            None if value.reference is None else numbers(value.reference),
            value.uncertainty,
            tuple(map(SampleWire.of, value.samples)),
            value.oldest,
        )

    def read(self) -> Report:
        """The report."""
        return Report(
            epoch(self.epoch),
            self.number,
            self.sent_at,
            self.echo,
            self.executed,
            self.play,
            self.pace,
            array(self.q),
            self.measured_at,
            self.q_at,
            self.halted,
            tuple((number, receipt.read()) for number, receipt in self.receipts),
            None if self.plan is None else self.plan.read(),
            None if self.reference is None else array(self.reference),
            self.uncertainty,
            tuple(one.read() for one in self.samples),
            self.oldest,
        )
