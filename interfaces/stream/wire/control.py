"""Control messages on the wire: `interfaces.messages.control`."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta
from typing_extensions import override

from interfaces.messages import control
from interfaces.messages.control import LinkFigures, Ping, Pong, ProblemCode, Role
from interfaces.messages.fields import (
    Count,
    Epoch,
    Joints,
    Message,
    Name,
    Number,
    Stamp,
    Text,
    Time,
    Value,
    Wire,
    Word,
    array,
    digits,
    epoch,
    numbers,
    text,
)
from interfaces.stream.wire.messages import Rate
from robots.onboard.lease import LeaseEnd, LeaseState
from vrs.errors import InvalidValueError
from vrs.model import Limits

Share = Annotated[float, Meta(ge=0, le=1)]
Span = Annotated[float, Meta(ge=0, le=1e9)]


class WayWire(Wire, frozen=True, omit_defaults=True, gc=False):
    """`DirectionConditions`."""

    delay: Word
    loss: Word = "0"
    service: Word = "datagram"

    @classmethod
    def of(cls, value: control.DirectionConditions) -> WayWire:
        """The wire form."""
        return cls(value.delay, value.loss, value.service)

    def read(self) -> control.DirectionConditions:
        """The conditions."""
        return control.DirectionConditions(self.delay, self.loss, self.service)


class SurveyWire(Message, frozen=True, omit_defaults=True, gc=False, tag="survey"):
    """`Survey`."""

    number: Number

    def read(self) -> control.Survey:
        """The question."""
        return control.Survey(self.number)


class ImpairWire(Message, frozen=True, omit_defaults=True, gc=False, tag="impair"):
    """`Impair`."""

    number: Number
    epoch: Epoch
    forward: WayWire | None = None
    backward: WayWire | None = None

    @override
    @classmethod
    def of(cls, value: control.Impair, packed: bool) -> ImpairWire:
        there, back = (None if way is None else WayWire.of(way) for way in (value.forward, value.backward))
        return cls(value.number, str(value.epoch), there, back)

    def read(self) -> control.Impair:
        """The request."""
        there, back = (None if way is None else way.read() for way in (self.forward, self.backward))
        return control.Impair(self.number, epoch(self.epoch), there, back)


class MeasuredWire(Wire, frozen=True, omit_defaults=True, gc=False):
    """`LinkFigures`."""

    packets: Count = 0
    lost: Share | None = None
    median: Span | None = None
    p95: Span | None = None
    span: Span | None = None

    @classmethod
    def of(cls, value: LinkFigures) -> MeasuredWire:
        """The wire form."""
        return cls(value.packets, value.lost, value.median, value.p95, value.span)

    def read(self) -> LinkFigures:
        """What was measured."""
        return LinkFigures(self.packets, self.lost, self.median, self.p95, self.span)


class NetworkWire(Message, frozen=True, omit_defaults=True, gc=False, tag="network"):
    """`Network`."""

    forward: WayWire
    backward: WayWire
    there: MeasuredWire
    back: MeasuredWire
    round_trip: MeasuredWire
    seed: Count = 0
    changed_at: Time | None = None
    changed_by: Word = ""
    robot: Word = ""
    problem: Text = ""
    clock: Span | None = None
    link_loss: Word = ""
    timeout: Span | None = None
    max_age: Span | None = None
    offset: Time | None = None
    advice: Text = ""
    answers: Number | None = None

    @override
    @classmethod
    def of(cls, value: control.Network, packed: bool) -> NetworkWire:
        there, back, trip = (MeasuredWire.of(found) for found in (value.there, value.back, value.round_trip))
        return cls(
            WayWire.of(value.forward), WayWire.of(value.backward), there, back, trip, value.seed, value.changed_at,
            value.changed_by, value.robot[:200], text(value.problem), value.clock, value.link_loss, value.timeout,
            value.max_age, value.offset, text(value.advice), value.answers,
        )  # fmt: skip

    def read(self) -> control.Network:
        """How the way to the robot is."""
        there, back, trip = self.there.read(), self.back.read(), self.round_trip.read()
        return control.Network(
            self.forward.read(), self.backward.read(), there, back, trip, self.seed, self.changed_at,
            self.changed_by, self.robot, self.problem, self.clock, self.link_loss, self.timeout, self.max_age,
            self.offset, self.advice, self.answers,
        )  # fmt: skip


MOST_MESSAGES = 64
"""Messages to the robot that a state tells of, at most."""
MOST_LATE = 128
"""Measurements that a state tells late, at most."""


class HelloWire(Message, frozen=True, omit_defaults=True, gc=False, tag="hello"):
    """`Hello`."""

    protocol: Number
    role: Role
    name: Name
    token: Word | None = None
    session: Word | None = None
    link_loss: Word | None = None

    def read(self) -> control.Hello:
        """Who it is."""
        return control.Hello(self.role, self.name, self.token, self.session, self.protocol, self.link_loss)


class LeaseWire(Message, frozen=True, omit_defaults=True, gc=False, tag="lease"):
    """`Lease`."""

    state: LeaseState
    epoch: Epoch | None = None
    holder: Name | None = None
    yours: bool = False
    answers: Number | None = None
    ended: LeaseEnd | None = None
    shared: bool = False

    @override
    @classmethod
    def of(cls, value: control.Lease, packed: bool) -> LeaseWire:
        number = None if value.epoch is None else str(value.epoch)
        return cls(value.state, number, value.holder, value.yours, value.answers, value.ended, value.shared)

    def read(self) -> control.Lease:
        """The lease."""
        number = None if self.epoch is None else epoch(self.epoch)
        return control.Lease(self.state, number, self.holder, self.yours, self.answers, self.ended, self.shared)


class LimitsWire(Wire, frozen=True, omit_defaults=True, gc=False):
    """`Limits`."""

    q_min: Joints
    q_max: Joints
    qd_max: Joints
    qdd_max: Joints
    qddd_max: Joints

    @classmethod
    def of(cls, limits: Limits) -> LimitsWire:
        """The wire form."""
        return cls(*[numbers(getattr(limits, name)) for name in cls.__struct_fields__])

    def read(self) -> Limits:
        """The limits."""
        return Limits(*[array(getattr(self, name)) for name in self.__struct_fields__])


Poses = Annotated[dict[Name, Joints], Meta(max_length=100)]


class WelcomeWire(Message, frozen=True, omit_defaults=True, gc=False, tag="welcome"):
    """`Welcome`."""

    protocol: Number
    session: Word
    role: Role
    robot: Word
    dof: Annotated[int, Meta(ge=1, le=64)]
    limits: LimitsWire
    poses: Poses
    now: Time
    lease: LeaseWire
    lease_timeout: Annotated[float, Meta(gt=0, le=3600)]
    rates: Annotated[tuple[Rate, ...], Meta(max_length=100)] = ()
    resumed: bool = False
    instance: Word = ""
    server: Word = ""

    @override
    @classmethod
    def of(cls, value: control.Welcome, packed: bool) -> WelcomeWire:
        return cls(
            value.protocol,
            value.session,
            value.role,
            value.robot,
            value.limits.dof,
            LimitsWire.of(value.limits),
            {name: numbers(q) for name, q in value.poses.items()},
            value.now,
            LeaseWire.of(value.lease, packed),
            value.lease_timeout,
            value.rates,
            value.resumed,
            value.instance,
            value.server,
        )

    def read(self) -> control.Welcome:
        """What there is."""
        widths = {len(q) for q in self.poses.values()} | {len(self.limits.q_min)}
        if widths != {self.dof}:
            raise InvalidValueError("dof", self.dof, f"as wide as limits and poses, {sorted(widths)}")
        return control.Welcome(
            self.session,
            self.role,
            self.robot,
            self.limits.read(),
            {name: array(q) for name, q in self.poses.items()},
            self.now,
            self.lease.read(),
            self.rates,
            self.resumed,
            self.instance,
            self.server,
            self.lease_timeout,
            self.protocol,
        )


class AttachedWire(Message, frozen=True, omit_defaults=True, gc=False, tag="attached"):
    """`Attached`."""

    protocol: Number
    robot: Word
    q: Joints
    link_loss: Word
    timeout: Annotated[float, Meta(gt=0, le=3600)]
    offset: Time | None = None
    instance: Word = ""
    server: Word = ""
    max_age: Annotated[float, Meta(gt=0, le=3600)] | None = None
    architecture: Word = ""
    room: Word = ""

    def read(self) -> control.Attached:
        """What the robot is."""
        return control.Attached(
            self.robot, array(self.q), self.link_loss, self.timeout, self.offset, self.instance, self.server,
            self.protocol, self.max_age, self.architecture, self.room,
        )  # fmt: skip


class PingWire(Message, frozen=True, omit_defaults=True, gc=False, tag="ping"):
    """`Ping`."""

    number: Number
    t: Stamp

    def read(self) -> Ping:
        """The probe."""
        return Ping(self.number, self.t)


class PongWire(Message, frozen=True, omit_defaults=True, gc=False, tag="pong"):
    """`Pong`."""

    number: Number
    t: Stamp
    received: Stamp
    answered: Stamp

    def read(self) -> Pong:
        """The echo."""
        return Pong(self.number, self.t, self.received, self.answered)


class AcquireWire(Message, frozen=True, omit_defaults=True, gc=False, tag="acquire"):
    """`Acquire`."""

    number: Number

    def read(self) -> control.Acquire:
        """The request."""
        return control.Acquire(self.number)


class TakeOverWire(Message, frozen=True, omit_defaults=True, gc=False, tag="take-over"):
    """`TakeOver`."""

    number: Number

    def read(self) -> control.TakeOver:
        """The request."""
        return control.TakeOver(self.number)


class ShareWire(Message, frozen=True, omit_defaults=True, gc=False, tag="share"):
    """`Share`."""

    number: Number
    session: Word

    def read(self) -> control.Share:
        """The request."""
        return control.Share(self.number, self.session)


class HoldersWire(Message, frozen=True, omit_defaults=True, gc=False):
    """A request of who holds the lease."""

    number: Number
    epoch: Epoch

    @override
    @classmethod
    def of(cls, value: control.Release | control.Resume, packed: bool) -> HoldersWire:
        return cls(value.number, str(value.epoch))


class ReleaseWire(HoldersWire, frozen=True, omit_defaults=True, gc=False, tag="release"):
    """`Release`."""

    def read(self) -> control.Release:
        """The request."""
        return control.Release(self.number, epoch(self.epoch))


class ResumeWire(HoldersWire, frozen=True, omit_defaults=True, gc=False, tag="resume"):
    """`Resume`."""

    def read(self) -> control.Resume:
        """The request."""
        return control.Resume(self.number, epoch(self.epoch))


class BeatWire(Message, frozen=True, omit_defaults=True, gc=False, tag="beat"):
    """`Beat`."""

    epoch: Epoch

    @override
    @classmethod
    def of(cls, value: control.Beat, packed: bool) -> BeatWire:
        return cls(str(value.epoch))

    def read(self) -> control.Beat:
        """The heartbeat."""
        return control.Beat(epoch(self.epoch))


class ProblemWire(Message, frozen=True, omit_defaults=True, gc=False, tag="problem"):
    """`Problem`."""

    code: ProblemCode
    text: Text
    number: Number | None = None
    fatal: bool = False

    @override
    @classmethod
    def of(cls, value: control.Problem, packed: bool) -> ProblemWire:
        return cls(value.code, text(value.text), value.number, value.fatal)

    def read(self) -> control.Problem:
        """The problem."""
        return control.Problem(self.code, self.text, self.number, self.fatal)


class StateWire(Message, frozen=True, omit_defaults=True, gc=False, tag="state"):
    """`State`."""

    number: Number
    t: Time
    q: Joints
    play: Time
    pace: Value
    D: Time
    following_error: Value
    epoch: Epoch | None = None
    connected: bool = True
    halted: Text = ""
    corrections: Count = 0
    reference: Joints | None = None
    round_trip: Value | None = None
    messages: Annotated[tuple[tuple[Time, Time | None], ...], Meta(max_length=MOST_MESSAGES)] = ()
    late: Annotated[tuple[tuple[Time, Joints], ...], Meta(max_length=MOST_LATE)] = ()

    @override
    @classmethod
    def of(cls, value: control.State, packed: bool) -> StateWire:
        where = value.play, value.pace, value.D, value.following_error
        rest = digits(value.epoch), value.connected, text(value.halted), value.corrections
        reference = None if value.reference is None else numbers(value.reference)
        late = tuple((t, numbers(q)) for t, q in value.late[-MOST_LATE:])
        link = value.round_trip, value.messages[-MOST_MESSAGES:], late
        return cls(value.number, value.t, numbers(value.q), *where, *rest, reference, *link)

    def read(self) -> control.State:
        """The state."""
        where = self.play, self.pace, self.D, self.following_error
        rest = epoch(self.epoch), self.connected, self.halted, self.corrections
        reference = None if self.reference is None else array(self.reference)
        link = self.round_trip, self.messages, tuple((t, array(q)) for t, q in self.late)
        return control.State(self.number, self.t, array(self.q), *where, *rest, reference, *link)
