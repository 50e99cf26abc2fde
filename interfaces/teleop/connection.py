"""Both ends of a connection between an operator's site and a robot's.

The operator's end emulates a link on the way, answers probes and notices silence. The robot's end decides which
operator it follows, and whose clock it goes by.

The robot's own clock is mapped to the operator's session time by probes; the map stays as it is while one operator
is followed, for a map that is slewed would make the robot faster than was certified. What is left is a matter of
the adaptive offset, which needs no clocks at all, and of the age gate, which is told.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from interfaces.engine_server.site import earliest
from interfaces.link import Gauge, Link, LinkConditions
from interfaces.link.clock_sync import ClockSync
from interfaces.link.packets import PacketRecord
from interfaces.link.round_trip import Echo, ProbeConfig, RoundTrip, RoundTripEstimator
from interfaces.messages.control import Ping, Pong
from interfaces.teleop.operator import OperatorSite, R, V_co
from interfaces.teleop.robot import O, RobotSite
from robots.onboard.watchdog import LossPolicy, WatchdogConfig
from vrs.checks import number_in
from vrs.errors import InvalidValueError

LOGGED = 500
"""Records of packets that each way keeps until somebody takes them."""
TOLD = 64
"""Messages to the robot of which `RobotLine.messages` tells at once, at most."""


class SiteLine(Generic[V_co, O, R]):
    """Carries what the operator's site says to a connection, and back. Times are the operator's session time."""

    def __init__(self, operator: OperatorSite[V_co], conditions: LinkConditions, rng: np.random.Generator) -> None:
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
        """Emulate other conditions from now [s] on; what is on its way arrives as it was to: `Channel.change`."""
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


MET = "the robot's site has just met this operator's"
"""Why a robot halts that is met."""
OTHER = "another operator's site came"
"""Why a robot halts whose operator hasn't been heard while another came."""
_LIMIT = 16
"""Messages that wait for the clocks to be compared."""


E = TypeVar("E", bound=RobotSite[Any, Any])


@dataclass(frozen=True, slots=True)
class HostConfig:
    """How a robot's end of a connection behaves."""

    lead: float = 0.02
    """How far ahead of the clock everything is decided [s], in [0, 1]."""
    probes: ProbeConfig = field(default_factory=lambda: ProbeConfig(period=0.1))
    """How the operator's clock is compared with."""
    compared: int = 8
    """Round trips that have come before the operator is followed, in [1, 1000]."""
    patience: float = 3.0
    """After so long [s] from the first round trip fewer are enough, in [0, 60]."""
    silence: float = 2.0
    """An operator who hasn't been heard for so long [s] makes room for another, in [0.1, 60]."""
    halting: WatchdogConfig = field(default_factory=lambda: WatchdogConfig(max_uncertainty=1.0))
    """The watchdog for an operator who asks for `halt`, where the robot would hold by itself."""

    def __post_init__(self) -> None:
        ranges = {"lead": (0.0, 1.0), "compared": (1, 1000), "patience": (0.0, 60.0), "silence": (0.1, 60.0)}
        for name, (low, high) in ranges.items():
            number_in(name, getattr(self, name), low, high)


class Host(Generic[E, O, R]):
    """Follows one operator at a time. Times are of the robot's own clock, unless they're said to be the site's.

    An operator is a session: the same one may come back after a break of the connection, and goes on as the
    watchdog lets it. Another one is followed when the one before hasn't been heard for a while; the robot halts
    first.
    """

    orders: ClassVar[type]
    """What its operators send."""

    def __init__(self, make: Callable[[float], E], config: HostConfig, *, now: float, seed: int = 0) -> None:
        """Stand at rest, and wait for an operator.

        Args:
            make: Makes the robot's site, from an operator's time [s] on, where the robot stands.
            config: How to behave.
            now: By the robot's clock [s].
            seed: Random number in [0, 2**32), new for each life of the robot: echoes of an earlier one don't count.
        """
        self._make, self._hosting, self._seed = make, config, seed
        self.session = ""
        """The operator that is followed; empty before the first."""
        self.site: E | None = None
        """Its site; None until the clocks have been compared."""
        self.offset = 0.0
        """The site's time less the robot's clock [s], the lead aside."""
        self._next = ""
        self._loss: LossPolicy | None = None
        self._next_loss: LossPolicy | None = None
        self._heard = -math.inf
        self._sync = ClockSync()
        self._trips: RoundTripEstimator | None = None
        self._count, self._first = 0, math.inf
        self._waiting: list[O] = []
        self._unsent: list[R | Ping] = []
        self._now = now

    def _left(self, now: float) -> None:
        """The operator is left, with the robot at rest."""

    def watchdog(self, own: WatchdogConfig | None) -> WatchdogConfig | None:
        """What watches over the link to the operator: the operator decides between `halt` and `hold`.

        Args:
            own: What the robot has for operators who leave that to it; None holds.

        Returns:
            The watchdog under `halt`; None under `hold`.
        """
        loss = self._next_loss if self._next else self._loss
        if loss is None:
            return own
        return (own or self._hosting.halting) if loss is LossPolicy.HALT else None

    def hello(self, session: str, *, now: float, link_loss: LossPolicy | None = None) -> str:
        """Let an operator's site in.

        Args:
            session: Random text that names its life.
            now: By the robot's clock [s].
            link_loss: What the robot is to do when the link is lost, as long as this session is followed; None
                leaves it to the robot.

        Returns:
            Why it can't be; empty if it's followed from now on.

        Raises:
            InvalidValueError: If the session is no text of 1 to 64 characters.
        """
        if not isinstance(session, str) or not 1 <= len(session) <= 64:
            raise InvalidValueError("session", session, "1 to 64 characters")
        if session != self.session and now - self._heard < self._hosting.silence:
            return "another operator's site is connected"
        self._heard = now
        if session == self.session:
            self._next = ""
        else:
            self._next, self._next_loss = session, link_loss
            self.halt(OTHER, now=now)
        self._catch_up(now)
        return ""

    def _catch_up(self, now: float) -> None:
        """Do what is due by now; what is to be sent waits for the next `advance`."""
        self._unsent = [*self.advance(now=now)]

    def _begin(self, now: float) -> None:
        """Turn to the next operator: nothing of the one before counts any more."""
        if self.site is not None:
            self._left(now)
        self.session, self._loss, self._next, self.site = self._next, self._next_loss, "", None
        self._sync = ClockSync()
        self._seed = (self._seed + 1) % 2**32
        self._trips = RoundTripEstimator(self._seed, self._hosting.probes, start=now)
        self._count, self._first = 0, math.inf
        self._waiting.clear()

    def site_time(self, t: float) -> float:
        """The site's time when the robot's clock reads t [s]: what's decided then is for the body's t + lead."""
        return t + self.offset + self._hosting.lead

    def receive(self, message: O | Pong, *, now: float) -> None:
        """Take in a message of the operator that is followed."""
        self._heard = now
        self._catch_up(now)
        if self._next or not self.session:
            return
        if isinstance(message, Pong):
            self._compare(message, now)
        elif self.site is None:
            self._waiting = [*self._waiting[-_LIMIT + 1 :], message]
            self._meet(now)
        else:
            self._hear(message, now)

    def _compare(self, pong: Pong, now: float) -> None:
        assert self._trips is not None
        echo = Echo(self._seed, pong.number - 1, pong.t, pong.received, pong.answered)
        trip = self._trips.receive(echo, now=now)
        if isinstance(trip, RoundTrip):
            self._sync.receive(trip)
            self._count += 1
            self._first = min(self._first, now)
            self._meet(now)

    def _meet(self, now: float) -> None:
        """Begin to follow an operator of whom a message is there, once the clocks have been compared."""
        enough = self._count >= self._hosting.compared or now - self._first >= self._hosting.patience
        estimate = self._sync.estimate(now)
        if self.site is not None or not self._waiting or not enough or estimate is None:
            return
        self.offset = estimate.offset
        t = self.site_time(now)
        self.site = self._make(t)
        self.site.join(self._waiting[-1], MET, now=t)
        for orders in self._waiting:
            self._hear(orders, now)
        self._waiting.clear()

    def _hear(self, orders: O, now: float) -> None:
        assert self.site is not None
        estimate = self._sync.estimate(now)
        assert estimate is not None
        # What the operator stamped at a time of its own clock, the site's clock read then.
        correction = self.offset - estimate.offset + self._hosting.lead
        self.site.receive(orders, now=self.site_time(now), correction=correction, uncertainty=estimate.uncertainty)

    def advance(self, *, now: float) -> tuple[R | Ping, ...]:
        """Do what is due by now [s], and say what is to be sent to the operator."""
        messages, self._unsent = self._unsent, []
        if self.site is not None:
            messages += self.site.advance(now=self.site_time(now))
        if self._next and self.rests(now=now):
            messages.clear()
            self._begin(now)
        probe = None if self._trips is None else self._trips.to_send(now=now)
        if probe is not None:
            messages.append(Ping(probe.sequence + 1, probe.sent))
        self._now = now
        return tuple(messages)

    def next_deadline(self) -> float:
        """When there's something to do, by the robot's clock [s]; infinite while nobody is there."""
        times = [math.inf]
        if self.site is not None:
            times.append(self.site.next_deadline() - self.offset - self._hosting.lead)
        if self._trips is not None:
            times.append(self._trips.next_deadline())
        if self._next and self.site is not None:
            times.append(self._now + 0.01)
        if self._unsent:
            times.append(self._now)
        return min(times)

    def rests(self, *, now: float) -> bool:
        """Whether the robot is to stand still already at its time now [s]."""
        return self.site is None or self.site.rests(now=now + self.offset)

    def halt(self, reason: str, *, now: float) -> None:
        """Stop, and wait for a new epoch."""
        if self.site is not None:
            self.site.halt(reason, now=self.site_time(now))

    @property
    def uncertainty(self) -> float:
        """Bound on the error of what is taken for the operator's clock [s]; infinite if nothing is known."""
        estimate = self._sync.estimate(self._now)
        return math.inf if estimate is None else estimate.uncertainty
