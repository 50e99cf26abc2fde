"""An emulated link: one direction as datagrams or as a byte stream, and both directions together."""

from __future__ import annotations

import heapq
import math
from collections import deque
from dataclasses import dataclass, replace
from typing import Generic, TypeAlias, TypeVar

import numpy as np

from interfaces.link.conditions import Conditions, LinkConditions, LinkPath, Service
from interfaces.link.packets import MAX_RECORDS, LossReason, PacketLog, PacketRecord
from vrs.checks import integer_in
from vrs.commands import finite
from vrs.errors import InvalidValueError

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Delivery(Generic[T]):
    """A packet that has arrived."""

    payload: T
    sent: float
    """Time of sending [s]."""
    arrived: float
    """Time of arrival [s], ≥ sent."""


class Channel(Generic[T]):
    """A one-way link with delay and loss, without input or output of its own.

    Its in-order service holds back packets that would overtake, but doesn't send lost ones again: those
    behind a lost one don't wait for it, as with sequence numbers on datagrams. A byte stream is `Stream`.

    Args:
        conditions: What it does to packets.
        rng: Source of everything random in it.
        path: A path to share with other channels instead of one of its own; its conditions decide the fates.
        log: Where to write down what becomes of each packet, instead of a log of its own.
    """

    def __init__(
        self,
        conditions: Conditions,
        rng: np.random.Generator,
        *,
        path: LinkPath | None = None,
        log: PacketLog | None = None,
    ) -> None:
        self._conditions = conditions
        self._path = LinkPath(conditions, rng) if path is None else path
        self._flight: list[tuple[float, int, Delivery[T], PacketRecord]] = []
        self._order = 0
        self._sent = -float("inf")
        self._last_arrival = -float("inf")
        self.log = PacketLog() if log is None else log
        """What became of each packet."""

    def send(self, payload: T, now: float, size: int = 0) -> float | None:
        """Put a packet on its way.

        Args:
            payload: What the packet carries.
            now: Time [s], not before that of the packet sent last.
            size: Size of the packet [byte], ≥ 0.

        Returns:
            When it will arrive [s]; None when it is lost. For the record only: no receiver knows it.

        Raises:
            InvalidValueError: If now is not finite, or runs back; or size is no number of bytes.
        """
        now, size = moment("now", now, self._sent), integer_in("size", size, 0, 2**31)
        self._sent = now
        number = self.log.sent(size)
        fate = self._path.fate(now, size)
        if fate.lost is not None or len(self._flight) >= self._conditions.capacity:
            reason = fate.lost or LossReason.CAPACITY
            self.log.settle(PacketRecord(number, size, now, None, reason))
            return None
        arrival = fate.arrivals[0]
        if self._conditions.service is Service.IN_ORDER:
            arrival = self._last_arrival = max(arrival, self._last_arrival)
        self._fly(payload, PacketRecord(number, size, now, arrival))
        for copy in fate.arrivals[1:]:
            self.log.copied()
            if self._conditions.service is Service.IN_ORDER:
                self.log.discarded()
            elif len(self._flight) >= self._conditions.capacity:
                self.log.settle(PacketRecord(number, size, now, None, LossReason.CAPACITY, copy=True))
            else:
                self._fly(payload, PacketRecord(number, size, now, copy, copy=True))
        return arrival

    def _fly(self, payload: T, record: PacketRecord) -> None:
        arrival = record.sent if record.arrived is None else record.arrived
        heapq.heappush(self._flight, (arrival, self._order, Delivery(payload, record.sent, arrival), record))
        self._order += 1

    def receive(self, now: float) -> tuple[Delivery[T], ...]:
        """Take everything that has arrived by now [s], in the order of arrival."""
        arrived: list[Delivery[T]] = []
        while self._flight and self._flight[0][0] <= now:
            _, _, delivery, record = heapq.heappop(self._flight)
            self.log.settle(record)
            arrived.append(delivery)
        return tuple(arrived)

    def next_deadline(self) -> float | None:
        """When the next packet arrives [s]; None when none is in flight."""
        return self._flight[0][0] if self._flight else None

    def in_flight(self) -> int:
        """Packets on their way, copies included."""
        return len(self._flight)

    def change(self, conditions: Conditions) -> None:
        """Let other conditions hold for what is sent from now on; the path's own decide its fate."""
        self._conditions = conditions

    def latest(self) -> float:
        """When the last of what is on its way arrives [s]; −∞ where nothing is."""
        return max((arrival for arrival, *_ in self._flight), default=-float("inf"))


def moment(name: str, value: object, earliest: float) -> float:
    """Return a time that doesn't run back [s].

    Raises:
        InvalidValueError: If it isn't finite, or lies before the earliest.
    """
    now = finite(name, value, "finite seconds")
    if now < earliest:
        raise InvalidValueError(name, now, f"at least {earliest}, the latest time so far")
    return now


LONGEST_TIMEOUT = 60.0
"""Longest wait before a packet is sent again [s]."""


@dataclass(slots=True)
class _Waiting(Generic[T]):
    """A packet that hasn't been delivered."""

    payload: T
    place: int
    """Its place in the order of delivery."""
    number: int
    size: int
    sent: float
    attempts: int = 0
    landed: bool = False
    given_up: bool = False


class Stream(Generic[T]):
    """A byte stream's view of a lossy path, packet by packet, without input or output of its own.

    The model: a lost packet is sent again when `retransmit_after` has passed since it left, then after twice
    that, and so on up to 60 s a wait; each attempt meets the losses, delays and queue of its own moment. The
    receiver delivers in the order of sending, so everything after a lost packet waits for it, then arrives
    with it. After `attempts` losses a packet is given up, and those behind it go on. Second copies are
    discarded. The sender waits where a datagram would find the queue full. Not modelled: acknowledgements
    (a timeout is exact, none is in vain), fast retransmission, congestion control.

    Args:
        conditions: Conditions of the direction.
        rng: Source of everything random in it.
        path: A path to share with other streams instead of one of its own.
        log: Where to write down what becomes of each packet, instead of a log of its own.
    """

    def __init__(
        self,
        conditions: Conditions,
        rng: np.random.Generator,
        *,
        path: LinkPath | None = None,
        log: PacketLog | None = None,
    ) -> None:
        self._conditions = conditions
        self._path = LinkPath(conditions, rng) if path is None else path
        self._waiting: dict[int, _Waiting[T]] = {}
        self._events: list[tuple[float, int, int, bool]] = []
        self._ready: deque[tuple[Delivery[T], PacketRecord]] = deque()
        self._order = self._accepted = self._next = 0
        self._missing = 0
        """Packets whose last attempt was lost."""
        self._hopeless = 0
        """Packets that were given up, and whose turn hasn't come."""
        self._now = self._newest = self._earliest = -math.inf
        self.log = PacketLog() if log is None else log
        """What became of each packet."""
        self.lost = 0
        """Packets that will never be delivered."""

    def send(self, payload: T, now: float, size: int = 0) -> float | None:
        """Put a packet on its way.

        Args:
            payload: What the packet carries.
            now: Time [s], not before that of any earlier call, `receive` included.
            size: Size of the packet [byte], ≥ 0.

        Returns:
            When it will be delivered [s]; None when that isn't known yet, because it or one before it was
            lost and will be sent again, or when it is lost for good. For the record only.

        Raises:
            InvalidValueError: If now is not finite, or runs back; or size is no number of bytes.
        """
        self._advance(moment("now", now, self._now))
        size = integer_in("size", size, 0, 2**31)
        number = self.log.sent(size)
        if self.in_flight() >= self._conditions.capacity:
            self.lost += 1
            self.log.settle(PacketRecord(number, size, now, None, LossReason.CAPACITY))
            return None
        place, self._accepted = self._accepted, self._accepted + 1
        packet = self._waiting[place] = _Waiting(payload, place, number, size, now)
        self._missing += 1
        self._transmit(packet, now)
        return None if self._missing else self._newest

    def receive(self, now: float) -> tuple[Delivery[T], ...]:
        """Take everything that has been delivered by now [s], in the order of sending.

        Raises:
            InvalidValueError: If now is not finite.
        """
        self.advance(now)
        taken: list[Delivery[T]] = []
        while self._ready and self._ready[0][0].arrived <= now:
            delivery, record = self._ready.popleft()
            self.log.settle(record)
            taken.append(delivery)
        return tuple(taken)

    def advance(self, now: float) -> None:
        """Send again what is due by now [s].

        Raises:
            InvalidValueError: If now is not finite.
        """
        self._advance(max(finite("now", now, "finite seconds"), self._now))

    def change(self, conditions: Conditions, *, earliest: float = -math.inf) -> None:
        """Let other conditions hold for what is sent, or sent again, from now on; the path's own decide its fate.

        Args:
            conditions: The new ones; `advance` was called with the time of the change.
            earliest: Nothing that's sent from now on arrives before [s].
        """
        self._conditions, self._earliest = conditions, max(self._earliest, earliest)

    def next_deadline(self) -> float | None:
        """When something arrives or is sent again [s]; a receipt then may still be empty. None when idle."""
        if self._ready:
            return self._ready[0][0].arrived
        return self._events[0][0] if self._events else None

    def in_flight(self) -> int:
        """Packets that haven't been received or given up."""
        return len(self._waiting) - self._hopeless + len(self._ready)

    def _advance(self, now: float) -> None:
        self._now = now
        while self._events and self._events[0][0] <= now:
            t, _, place, lands = heapq.heappop(self._events)
            packet = self._waiting[place]
            if lands:
                packet.landed = True
                self._release(t)
            elif packet.attempts >= self._conditions.attempts:
                self._give_up(packet, t)
            else:
                self.log.resent()
                self._transmit(packet, t)

    def _transmit(self, packet: _Waiting[T], t: float) -> None:
        """Send a packet, for the first time or again."""
        packet.attempts += 1
        fate = self._path.fate(t, packet.size, waits=True)
        if fate.arrivals:
            self._missing -= 1
            arrival = max(fate.arrivals[0], self._earliest)
            self._newest = max(self._newest, arrival)
            self._at(arrival, packet.place, lands=True)
            for _ in fate.arrivals[1:]:
                self.log.copied()
                self.log.discarded()
        else:
            timeout = self._conditions.retransmit_after * 2.0 ** min(packet.attempts - 1, 16)
            self._at(fate.departure + min(timeout, LONGEST_TIMEOUT), packet.place, lands=False)

    def _at(self, t: float, place: int, *, lands: bool) -> None:
        heapq.heappush(self._events, (t, self._order, place, lands))
        self._order += 1

    def _give_up(self, packet: _Waiting[T], t: float) -> None:
        packet.given_up = True
        self._hopeless += 1
        self.lost += 1
        self._missing -= 1
        self._newest = max(self._newest, t)
        self.log.settle(
            PacketRecord(
                packet.number, packet.size, packet.sent, None, LossReason.GIVEN_UP, attempts=packet.attempts
            )
        )
        self._release(t)

    def _release(self, t: float) -> None:
        """Deliver what is next in order, now that a packet has come or been given up at t [s]."""
        while (packet := self._waiting.get(self._next)) is not None:
            if not (packet.landed or packet.given_up):
                return
            del self._waiting[self._next]
            self._next += 1
            if packet.given_up:
                self._hopeless -= 1
                continue
            record = PacketRecord(packet.number, packet.size, packet.sent, t, attempts=packet.attempts)
            self._ready.append((Delivery(packet.payload, packet.sent, t), record))


class Lane(Generic[T]):
    """One direction: datagrams by a `Channel`, a byte stream by a `Stream`, both on one path.

    What was sent before a change arrives as it was to arrive then: datagrams when they were, the packets of an
    in-order service in their order. One of those that was lost before is sent again under the conditions of that
    moment. Of what is sent in order after a change nothing overtakes what was sent before it. With one seed, the
    same packets and the same changes at the same times, the same arrives at the same times.

    Args:
        conditions: What it does at first; `service` says which of the two carries.
        rng: Source of everything random in it.
        log: Where to write down what becomes of each packet, instead of a log of its own.
    """

    def __init__(self, conditions: Conditions, rng: np.random.Generator, *, log: PacketLog | None = None) -> None:
        self.conditions = conditions
        """What it does now."""
        self.log = PacketLog() if log is None else log
        """What became of each packet."""
        self._rng = rng
        self._path = LinkPath(conditions, rng)
        self._channel: Channel[T] | None = None
        self._stream: Stream[T] | None = None
        self._now = -math.inf
        self._open()

    def _open(self) -> None:
        """Have what carries under the conditions."""
        conditions, log = self.conditions, self.log
        if conditions.service is Service.IN_ORDER:
            self._stream = self._stream or Stream(conditions, self._rng, path=self._path, log=log)
        else:
            self._channel = self._channel or Channel(conditions, self._rng, path=self._path, log=log)

    def change(self, conditions: Conditions, now: float) -> None:
        """Let other conditions hold for what is sent, or sent again, from now on.

        Args:
            conditions: The new ones. What isn't another one keeps its state: congestion, a burst of losses.
            now: Time [s], not before that of any earlier call.

        Raises:
            InvalidValueError: If now is not finite, or runs back.
        """
        self._advance(moment("now", now, self._now))
        self.conditions = conditions
        self._path.change(conditions)
        self._open()
        latest = -math.inf
        if self._channel is not None:
            self._channel.change(replace(conditions, service=Service.DATAGRAM))
            latest = self._channel.latest()
        if self._stream is not None:
            self._stream.change(conditions, earliest=latest)

    def _advance(self, now: float) -> None:
        """Let what is due by now be sent again first: on one path everything has its turn in time."""
        self._now = now
        if self._stream is not None:
            self._stream.advance(now)

    def send(self, payload: T, now: float, size: int = 0) -> float | None:
        """Put a packet on its way; see `Channel.send` and `Stream.send`."""
        if self.conditions.service is Service.IN_ORDER:
            assert self._stream is not None
            arrival = self._stream.send(payload, now, size)
            self._now = now
            return arrival
        assert self._channel is not None
        if self._stream is not None:
            self._advance(moment("now", now, self._now))
        arrival = self._channel.send(payload, now, size)
        self._now = now
        return arrival

    def receive(self, now: float) -> tuple[Delivery[T], ...]:
        """Take everything that has arrived by now [s], in the order of arrival."""
        if self._stream is None or self._channel is None:
            return (self._stream or self._channel).receive(now)  # type: ignore[union-attr]
        self._now = max(finite("now", now, "finite seconds"), self._now)
        both = (*self._channel.receive(now), *self._stream.receive(now))
        return tuple(sorted(both, key=lambda delivery: delivery.arrived))

    def next_deadline(self) -> float | None:
        """When something arrives or is sent again [s]; a receipt then may still be empty. None when idle."""
        times = (None if line is None else line.next_deadline() for line in (self._channel, self._stream))
        return min((t for t in times if t is not None), default=None)

    def in_flight(self) -> int:
        """Packets on their way, copies included."""
        return sum(line.in_flight() for line in (self._channel, self._stream) if line is not None)


U = TypeVar("U")

Direction: TypeAlias = Channel[T] | Stream[T]
"""One direction: datagrams, or a byte stream that sends again."""


class Link(Generic[T, U]):
    """Two directions, T from the operator to the robot, U back, without input or output of their own.

    Args:
        conditions: What each direction does at first; see `Lane`.
        rng: Source of everything random in it; the directions draw independently.
        keep: Most records that each direction's log keeps until they're taken.
    """

    def __init__(self, conditions: LinkConditions, rng: np.random.Generator, *, keep: int = MAX_RECORDS) -> None:
        there, back = rng.spawn(2)
        self.forward: Lane[T] = Lane(conditions.forward, there, log=PacketLog(keep))
        self.backward: Lane[U] = Lane(conditions.backward, back, log=PacketLog(keep))

    @property
    def conditions(self) -> LinkConditions:
        """What each direction does now."""
        return LinkConditions(self.forward.conditions, self.backward.conditions)

    def change(self, conditions: LinkConditions, now: float) -> None:
        """Let other conditions hold for what is sent from now [s] on; see `Lane.change`."""
        self.forward.change(conditions.forward, now)
        self.backward.change(conditions.backward, now)

    def next_deadline(self) -> float | None:
        """When the next packet arrives in either direction, or is sent again [s]; None when both are idle."""
        both = (self.forward.next_deadline(), self.backward.next_deadline())
        return min((t for t in both if t is not None), default=None)
