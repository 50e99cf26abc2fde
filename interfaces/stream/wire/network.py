"""The emulated way to the robot, on the wire."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta
from typing_extensions import override

from interfaces.link.gauge import LinkFigures
from interfaces.stream import network
from interfaces.wire.fields import Count, Epoch, Message, Number, Text, Time, Wire, Word, epoch, text

Share = Annotated[float, Meta(ge=0, le=1)]
Span = Annotated[float, Meta(ge=0, le=1e9)]


class WayWire(Wire, frozen=True, omit_defaults=True, gc=False):
    """`DirectionConditions`."""

    delay: Word
    loss: Word = "0"
    service: Word = "datagram"

    @classmethod
    def of(cls, value: network.DirectionConditions) -> WayWire:
        """The wire form."""
        return cls(value.delay, value.loss, value.service)

    def read(self) -> network.DirectionConditions:
        """The conditions."""
        return network.DirectionConditions(self.delay, self.loss, self.service)


class SurveyWire(Message, frozen=True, omit_defaults=True, gc=False, tag="survey"):
    """`Survey`."""

    number: Number

    def read(self) -> network.Survey:
        """The question."""
        return network.Survey(self.number)


class ImpairWire(Message, frozen=True, omit_defaults=True, gc=False, tag="impair"):
    """`Impair`."""

    number: Number
    epoch: Epoch
    forward: WayWire | None = None
    backward: WayWire | None = None

    @override
    @classmethod
    def of(cls, value: network.Impair, packed: bool) -> ImpairWire:
        there, back = (None if way is None else WayWire.of(way) for way in (value.forward, value.backward))
        return cls(value.number, str(value.epoch), there, back)

    def read(self) -> network.Impair:
        """The request."""
        there, back = (None if way is None else way.read() for way in (self.forward, self.backward))
        return network.Impair(self.number, epoch(self.epoch), there, back)


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
    def of(cls, value: network.Network, packed: bool) -> NetworkWire:
        there, back, trip = (MeasuredWire.of(found) for found in (value.there, value.back, value.round_trip))
        return cls(
            WayWire.of(value.forward), WayWire.of(value.backward), there, back, trip, value.seed, value.changed_at,
            value.changed_by, value.robot[:200], text(value.problem), value.clock, value.link_loss, value.timeout,
            value.max_age, value.offset, text(value.advice), value.answers,
        )  # fmt: skip

    def read(self) -> network.Network:
        """How the way to the robot is."""
        there, back, trip = self.there.read(), self.back.read(), self.round_trip.read()
        return network.Network(
            self.forward.read(), self.backward.read(), there, back, trip, self.seed, self.changed_at,
            self.changed_by, self.robot, self.problem, self.clock, self.link_loss, self.timeout, self.max_age,
            self.offset, self.advice, self.answers,
        )  # fmt: skip
