"""Messages of a mobile robot on the wire."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta
from typing_extensions import override

from interfaces.stream import mobile
from interfaces.stream.control import Role
from interfaces.stream.wire.control import MOST_MESSAGES, LeaseWire
from interfaces.stream.wire.tasks import ErrandForm, SightForm, TaskReportForm
from interfaces.teleop.architectures import ArchitectureReport, ArcPacket, CellChanges
from interfaces.teleop.architectures.messages import DriveOrders, DriveReport
from interfaces.teleop.architectures.segments import MOST_REPEATED
from interfaces.teleop.tasks import Doing
from interfaces.wire.fields import (
    Count,
    Epoch,
    Message,
    Number,
    Seconds,
    Stamp,
    Text,
    Time,
    Value,
    Wire,
    Word,
    digits,
    epoch,
    text,
)
from robots.onboard.driving import Drive, Posture
from robots.onboard.supervisor import CellChange
from vrs.checks import normal
from vrs.mobile import DriveLimits
from vrs.segment import ArcSegment

MOST_CELLS = 10_000
"""Cells that a report tells of, at most."""
Metres = Annotated[float, Meta(ge=-1e9, le=1e9)]
Angle = Annotated[float, Meta(ge=-1e9, le=1e9)]
PostureRow = tuple[Metres, Metres, Angle]
"""x, y, θ."""
Speed = Annotated[float, Meta(ge=-1e6, le=1e6)]
DriveRow = tuple[Speed, Speed]
"""v, ω."""
Positive = Annotated[float, Meta(gt=0, le=1e9)]
ArcRow = tuple[Time, Metres, Metres, Angle, Speed, Speed, Seconds]
"""Start, posture there, v, ω, duration."""
Arcs = Annotated[tuple[ArcRow, ...], Meta(max_length=MOST_REPEATED)]
Runs = Annotated[tuple[tuple[Count, Arcs], ...], Meta(max_length=8)]


class DriveLimitsWire(Wire, frozen=True, omit_defaults=True, gc=False):
    """`DriveLimits`."""

    v_max: Positive
    w_max: Positive
    a_max: Positive
    alpha_max: Positive

    @classmethod
    def of(cls, limits: DriveLimits) -> DriveLimitsWire:
        """The wire form."""
        return cls(limits.v_max, limits.w_max, limits.a_max, limits.alpha_max)

    def read(self) -> DriveLimits:
        """The limits."""
        return DriveLimits(self.v_max, self.w_max, self.a_max, self.alpha_max)


class MobileWelcomeWire(Message, frozen=True, omit_defaults=True, gc=False, tag="mobile-welcome"):
    """`MobileWelcome`."""

    protocol: Number
    session: Word
    role: Role
    robot: Word
    limits: DriveLimitsWire
    period: Positive
    holds: Positive
    now: Time
    lease: LeaseWire
    lease_timeout: Annotated[float, Meta(gt=0, le=3600)]
    resumed: bool = False
    instance: Word = ""
    server: Word = ""
    room: Word = ""

    @override
    @classmethod
    def of(cls, value: mobile.MobileWelcome, packed: bool) -> MobileWelcomeWire:
        return cls(
            value.protocol, value.session, value.role, value.robot, DriveLimitsWire.of(value.limits), value.period,
            value.holds, value.now, LeaseWire.of(value.lease, packed), value.lease_timeout, value.resumed,
            value.instance, value.server, value.room,
        )  # fmt: skip

    def read(self) -> mobile.MobileWelcome:
        """What there is."""
        return mobile.MobileWelcome(
            self.session, self.role, self.robot, self.limits.read(), self.period, self.holds, self.now,
            self.lease.read(), self.resumed, self.instance, self.server, self.lease_timeout, self.room,
            self.protocol,
        )  # fmt: skip


class PosturesWire(Message, frozen=True, omit_defaults=True, gc=False, tag="postures"):
    """`Postures`."""

    number: Number
    now: Time
    virtual: PostureRow
    command: DriveRow
    estimate: PostureRow
    t: Time | None = None
    real: PostureRow | None = None
    drive: DriveRow | None = None
    D: Time | None = None
    starved: bool = False
    path_error: Annotated[float, Meta(ge=0, le=1e9)] | None = None
    time_difference: Annotated[float, Meta(ge=0, le=1e9)] | None = None
    epoch: Epoch | None = None
    connected: bool = True
    halted: Text = ""
    drives: Count = 0
    round_trip: Value | None = None
    messages: Annotated[tuple[tuple[Time, Time | None], ...], Meta(max_length=MOST_MESSAGES)] = ()

    @override
    @classmethod
    def of(cls, value: mobile.Postures, packed: bool) -> PosturesWire:
        return cls(
            value.number, value.now, value.virtual, value.command, value.estimate, value.t, value.real, value.drive,
            value.D, value.starved, value.path_error, value.time_difference, digits(value.epoch), value.connected,
            text(value.halted), value.drives, value.round_trip, value.messages[-MOST_MESSAGES:],
        )  # fmt: skip

    def read(self) -> mobile.Postures:
        """Where both are."""
        real = None if self.real is None else Posture(*self.real)
        drive = None if self.drive is None else Drive(*self.drive)
        return mobile.Postures(
            self.number, self.now, Posture(*self.virtual), Drive(*self.command), Posture(*self.estimate), self.t,
            real, drive, self.D, self.starved, self.path_error, self.time_difference, epoch(self.epoch),
            self.connected, self.halted, self.drives, self.round_trip, self.messages,
        )  # fmt: skip


class DriveOrdersWire(Message, frozen=True, omit_defaults=True, gc=False, tag="drive-orders"):
    """`DriveOrders`."""

    epoch: Epoch
    number: Number
    sent_at: Stamp
    began: Time
    complete_until: Time
    start: PostureRow | None = None
    runs: Runs = ()
    tail: Arcs = ()
    errands: Annotated[tuple[ErrandForm, ...], Meta(max_length=16)] = ()

    @override
    @classmethod
    def of(cls, value: DriveOrders, packed: bool) -> DriveOrdersWire:
        packet = value.packet
        runs = tuple((first, _rows(arcs)) for first, arcs in packet.runs)
        errands = tuple(ErrandForm.of(errand) for errand in value.errands)
        stamps = str(value.epoch), value.number, value.sent_at, value.began
        start = None if value.start is None else Posture(*map(normal, value.start))
        return cls(*stamps, packet.complete_until, start, runs, _rows(packet.tail), errands)

    def read(self) -> DriveOrders:
        """The orders."""
        runs = tuple((first, _arcs(rows)) for first, rows in self.runs)
        packet = ArcPacket(runs, self.complete_until, _arcs(self.tail))
        start = None if self.start is None else Posture(*self.start)
        errands = tuple(form.read() for form in self.errands)
        return DriveOrders(epoch(self.epoch), self.number, self.sent_at, self.began, start, packet, errands)


class FollowedWire(Wire, frozen=True, omit_defaults=True, gc=False):
    """`ArchitectureReport` of an architecture."""

    number: Number
    executed: Count
    posture: PostureRow
    received: Count
    seen_at: Time | None = None
    cells: Annotated[tuple[tuple[tuple[Count, Count], Time, bool], ...], Meta(max_length=MOST_CELLS)] = ()

    @classmethod
    def of(cls, value: ArchitectureReport) -> FollowedWire:
        """The wire form."""
        changes = value.changes
        cells = () if changes is None else tuple((c.cell, c.seen, c.occupied) for c in changes.cells)
        seen_at = None if changes is None else changes.time
        return cls(value.number, value.executed, value.posture, value.received, seen_at, cells)

    def read(self) -> ArchitectureReport:
        """The report."""
        cells = tuple(CellChange(*row) for row in self.cells)
        changes = None if self.seen_at is None else CellChanges(self.seen_at, cells)
        return ArchitectureReport(self.number, self.executed, Posture(*self.posture), self.received, changes)


class DriveReportWire(Message, frozen=True, omit_defaults=True, gc=False, tag="drive-report"):
    """`DriveReport`."""

    epoch: Epoch | None
    number: Number
    sent_at: Stamp
    measured_at: Stamp
    posture: PostureRow
    drive: DriveRow
    echo: tuple[Number, Stamp, Stamp] | None = None
    halted: Text = ""
    refused: Text = ""
    report: FollowedWire | None = None
    play: Time | None = None
    D: Time | None = None
    starved: bool = False
    uncertainty: Annotated[float, Meta(ge=0, le=1e12)] | None = None
    world: Time | None = None
    errand: Count = 0
    doing: Doing = Doing.NOTHING
    left: Annotated[float, Meta(ge=0, le=1e9)] | None = None
    tasks: TaskReportForm | None = None
    sight: SightForm | None = None

    @override
    @classmethod
    def of(cls, value: DriveReport, packed: bool) -> DriveReportWire:
        report = None if value.report is None else FollowedWire.of(value.report)
        where = value.sent_at, value.measured_at, value.posture, value.drive, value.echo
        why = text(value.halted), text(value.refused)
        return cls(
            digits(value.epoch), value.number, *where, *why, report, value.play, value.D, value.starved,
            value.uncertainty, value.world, value.errand, value.doing, value.left or None,
            None if value.tasks is None else TaskReportForm.of(value.tasks),
            None if value.sight is None else SightForm.of(value.sight),
        )  # fmt: skip

    def read(self) -> DriveReport:
        """The report."""
        report = None if self.report is None else self.report.read()
        where = self.sent_at, self.measured_at, Posture(*self.posture), Drive(*self.drive), self.echo
        return DriveReport(
            epoch(self.epoch), self.number, *where, self.halted, self.refused, report, self.play, self.D,
            self.starved, self.uncertainty, self.world, self.errand, self.doing, self.left or 0.0,
            None if self.tasks is None else self.tasks.read(), None if self.sight is None else self.sight.read(),
        )  # fmt: skip


def _rows(arcs: tuple[ArcSegment, ...]) -> tuple[ArcRow, ...]:
    rows = ((arc.start, *arc.posture, arc.v, arc.w, arc.duration) for arc in arcs)
    # What is computed of ordinary numbers may be subnormal, which a robot refuses.
    return tuple(tuple(map(normal, row)) for row in rows)  # type: ignore[misc]


def _arcs(rows: tuple[ArcRow, ...]) -> tuple[ArcSegment, ...]:
    return tuple(ArcSegment(start, T, (x, y, theta), v, w) for start, x, y, theta, v, w, T in rows)
