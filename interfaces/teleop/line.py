"""The operator's end of a connection to a robot: an emulated link on the way, probes answered, silence noticed."""

from __future__ import annotations

import math
from collections import deque
from typing import Generic, Protocol, TypeAlias, TypeVar

import numpy as np

from interfaces.engine_server.site import earliest
from interfaces.link import Gauge, Link, LinkConditions
from interfaces.link.packets import PacketRecord
from interfaces.link.round_trip import Ping, Pong
from interfaces.teleop.messages import Orders, Report
from interfaces.teleop.operator import OperatorSite

O = TypeVar("O")  # noqa: E741 - orders
R = TypeVar("R")
O_co = TypeVar("O_co", covariant=True)
R_contra = TypeVar("R_contra", contravariant=True)


class OrderSource(Protocol[O_co, R_contra]):
    """An operator's site: what gives orders, and hears reports. Times are the operator's [s]."""

    def advance(self, *, now: float) -> tuple[O_co, ...]:
        """Do what is due, and say what is to be sent."""

    def receive(self, report: R_contra, *, now: float) -> None:
        """Take in a report."""

    def next_deadline(self) -> float:
        """When there's something to do."""

    def measure_anew(self, *, now: float) -> None:
        """Forget what was measured of the way: it's another one."""


S = TypeVar("S", bound=OrderSource)  # type: ignore[type-arg]

LOGGED = 500
"""Records of packets that each way keeps until somebody takes them."""
TOLD = 64
"""Messages to the robot of which `RobotLine.messages` tells at once, at most."""


class SiteLine(Generic[S, O, R]):
    """Carries what the operator's site says to a connection, and back. Times are the operator's session time."""

    def __init__(self, operator: S, conditions: LinkConditions, rng: np.random.Generator) -> None:
        """Begin without a connection.

        Args:
            operator: The operator's site.
            conditions: What is emulated on the way, both ways.
            rng: Source of everything random in that.
        """
        self.operator = operator
        self.link: Link[O | Pong, R | Ping] = Link(conditions, rng, keep=LOGGED)
        self._messages: deque[tuple[float, float | None]] = deque(maxlen=TOLD)
        self.there, self.back = Gauge(), Gauge()
        """What the emulation does to packets, each way."""
        self.link.forward.log.told, self.link.backward.log.told = self._settled, self.back.add
        self.connected = False
        """Whether there's a connection to send on."""
        self.heard = -math.inf
        """When something came from the robot last [s]."""

    def receive(self, message: R | Ping, *, now: float) -> None:
        """Take a message off the connection: it's delayed, and may be lost, as the link has it."""
        self.link.backward.send(message, now)

    def advance(self, *, now: float) -> tuple[O | Pong, ...]:
        """Do what is due by now [s], and say what is to be put on the connection."""
        for delivery in self.link.backward.receive(now):
            self._take(delivery.payload, now)
        for orders in self.operator.advance(now=now):
            self.link.forward.send(orders, now)
        ready = tuple(delivery.payload for delivery in self.link.forward.receive(now))
        return ready if self.connected else ()

    def _take(self, message: R | Ping, now: float) -> None:
        self.heard = now
        if isinstance(message, Ping):
            self.link.forward.send(Pong(message.number, message.t, now, now), now)
        else:
            self.operator.receive(message, now=now)

    def _settled(self, packet: PacketRecord) -> None:
        self.there.add(packet)
        if not packet.copy:
            self._messages.append((packet.sent, packet.arrived))

    def messages(self) -> tuple[tuple[float, float | None], ...]:
        """Messages to the robot since the last call: when each was sent and arrived [s]; None for a lost one.

        What they need beyond the emulated link isn't in it.
        """
        messages = tuple(self._messages)
        self._messages.clear()
        return messages

    def change(self, conditions: LinkConditions, *, now: float) -> None:
        """Emulate other conditions from now [s] on; what is on its way arrives as it was to. See `Lane.change`."""
        before = self.link.conditions
        self.link.change(conditions, now)
        if conditions.forward != before.forward:
            self.there.since = now
        if conditions.backward != before.backward:
            self.back.since = now
        self.operator.measure_anew(now=now)

    def next_deadline(self) -> float | None:
        """When something is due [s]."""
        return earliest(self.operator.next_deadline(), self.link.next_deadline())

    def silence(self, *, now: float) -> float:
        """For how long nothing has been heard of the robot [s]; infinite before the first time."""
        return now - self.heard


RobotLine: TypeAlias = SiteLine[OperatorSite, Orders, Report]
"""To an arm."""
