"""An emulated link: one direction as datagrams or as a byte stream, and both directions together."""

from __future__ import annotations

import heapq
import math
from collections import deque
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from interfaces.link.conditions import Conditions, LinkConditions, LinkPath, Service
from interfaces.link.packets import MAX_RECORDS, LossReason, PacketLog, PacketRecord
from vrs.checks import finite, integer_in, not_before

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Delivery(Generic[T]):
    """A packet that has arrived."""

    payload: T
    sent: float
    """Time of sending [s]."""
    arrived: float
    """Time of arrival [s], ≥ sent."""


_LATEST = "at least {}, the latest time so far"


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


class Channel(Generic[T]):
    """One direction of a link, datagrams or a byte stream, without input or output of its own.

    Datagrams arrive as they come: each may be lost, come twice, overtake.

    In order the model is a byte stream's, packet by packet: a lost packet is sent again when `retransmit_after` has
    passed since it left, then after twice that, and so on up to 60 s a wait; each attempt meets the losses, delays
    and queue of its own moment. The receiver delivers in the order of sending, so everything after a lost packet
    waits for it, then arrives with it. After `attempts` losses a packet is given up, and those behind it go on.
    Second copies are discarded. The sender waits where a datagram would find the queue full. Not modelled:
    acknowledgements (a timeout is exact, none is in vain), fast retransmission, congestion control.

    What was sent before a change of conditions arrives as it was to arrive then: datagrams when they were, the
    packets of an in-order service in their order. One of those that was lost before is sent again under the
    conditions of that moment. Of what is sent in order after a change nothing overtakes what was sent before it.
    With one seed, the same packets and the same changes at the same times, the same arrives at the same times.

    Args:
        conditions: What it does at first.
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
        self.conditions = conditions
        """What it does now."""
        self.log = PacketLog() if log is None else log
        """What became of each packet."""
        self.lost = 0
        """Packets of the byte stream that will never be delivered."""
        self._path = LinkPath(conditions, rng) if path is None else path
        self._now = self._newest = self._earliest = -math.inf
        self._order = 0
        self._flight: list[tuple[float, int, Delivery[T], PacketRecord]] = []
        """Datagrams on their way."""
        self._waiting: dict[int, _Waiting[T]] = {}
        """Packets of the byte stream, by their places."""
        self._events: list[tuple[float, int, int, bool]] = []
        """When which of them lands, or is sent again."""
        self._ready: deque[tuple[Delivery[T], PacketRecord]] = deque()
        self._accepted = self._next = 0
        self._missing = 0
        """Packets whose last attempt was lost."""
        self._hopeless = 0
        """Packets that were given up, and whose turn hasn't come."""

    def change(self, conditions: Conditions, now: float) -> None:
        """Let other conditions hold for what is sent, or sent again, from now on.

        Args:
            conditions: The new ones. What isn't another one keeps its state: congestion, a burst of losses.
            now: Time [s], not before that of any earlier call.

        Raises:
            InvalidValueError: If now is not finite, or runs back.
        """
        self._advance(not_before("now", now, self._now, _LATEST))
        self.conditions = conditions
        self._path.change(conditions)
        self._earliest = max([self._earliest, *(arrival for arrival, *_ in self._flight)])

    def send(self, payload: T, now: float, size: int = 0) -> float | None:
        """Put a packet on its way.

        Args:
            payload: What the packet carries.
            now: Time [s], not before that of the packet sent last, nor, in order, of any look.
            size: Size of the packet [byte], ≥ 0.

        Returns:
            When it will arrive [s]; None when it is lost, or when that isn't known yet, because in a byte stream
            it or one before it was lost and will be sent again. For the record only: no receiver knows it.

        Raises:
            InvalidValueError: If now is not finite, or runs back; or size is no number of bytes.
        """
        now, size = not_before("now", now, self._now, _LATEST), integer_in("size", size, 0, 2**31)
        self._advance(now)
        number = self.log.sent(size)
        if self.conditions.service is Service.IN_ORDER:
            return self._queue(payload, number, now, size)
        fate = self._path.fate(now, size)
        if fate.lost is not None or len(self._flight) >= self.conditions.capacity:
            self.log.settle(PacketRecord(number, size, now, None, fate.lost or LossReason.CAPACITY))
            return None
        arrival = fate.arrivals[0]
        self._fly(payload, now, arrival, PacketRecord(number, size, now, arrival))
        for copy in fate.arrivals[1:]:
            self.log.sums.copies += 1
            if len(self._flight) >= self.conditions.capacity:
                self.log.settle(PacketRecord(number, size, now, None, LossReason.CAPACITY, copy=True))
            else:
                self._fly(payload, now, copy, PacketRecord(number, size, now, copy, copy=True))
        return arrival

    def _fly(self, payload: T, now: float, arrival: float, record: PacketRecord) -> None:
        heapq.heappush(self._flight, (arrival, self._order, Delivery(payload, now, arrival), record))
        self._order += 1

    def _queue(self, payload: T, number: int, now: float, size: int) -> float | None:
        """Put a packet behind those of the byte stream."""
        if self.in_flight() - len(self._flight) >= self.conditions.capacity:
            self.lost += 1
            self.log.settle(PacketRecord(number, size, now, None, LossReason.CAPACITY))
            return None
        place, self._accepted = self._accepted, self._accepted + 1
        packet = self._waiting[place] = _Waiting(payload, place, number, size, now)
        self._missing += 1
        self._transmit(packet, now)
        return None if self._missing else self._newest

    def receive(self, now: float) -> tuple[Delivery[T], ...]:
        """Take everything that has arrived by now [s], in the order of arrival.

        Raises:
            InvalidValueError: If it's in order, and now is not finite.
        """
        if self._events or self.conditions.service is Service.IN_ORDER:
            self._advance(max(finite("now", now, "finite seconds"), self._now))
        taken: list[Delivery[T]] = []
        while self._flight and self._flight[0][0] <= now:
            _, _, delivery, record = heapq.heappop(self._flight)
            self.log.settle(record)
            taken.append(delivery)
        while self._ready and self._ready[0][0].arrived <= now:
            delivery, record = self._ready.popleft()
            self.log.settle(record)
            taken.append(delivery)
        if len(taken) > 1:
            taken.sort(key=lambda delivery: delivery.arrived)
        return tuple(taken)

    def next_deadline(self) -> float | None:
        """When something arrives or is sent again [s]; a receipt then may still be empty. None when idle."""
        streamed = self._ready[0][0].arrived if self._ready else self._events[0][0] if self._events else None
        times = (self._flight[0][0] if self._flight else None, streamed)
        return min((t for t in times if t is not None), default=None)

    def in_flight(self) -> int:
        """Packets that haven't been received or given up, copies included."""
        return len(self._flight) + len(self._waiting) - self._hopeless + len(self._ready)

    def _advance(self, now: float) -> None:
        self._now = now
        while self._events and self._events[0][0] <= now:
            t, _, place, lands = heapq.heappop(self._events)
            packet = self._waiting[place]
            if lands:
                packet.landed = True
                self._release(t)
            elif packet.attempts >= self.conditions.attempts:
                self._give_up(packet, t)
            else:
                self.log.sums.resent += 1
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
                self.log.sums.copies += 1
                self.log.sums.discarded += 1
        else:
            timeout = self.conditions.retransmit_after * 2.0 ** min(packet.attempts - 1, 16)
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


U = TypeVar("U")


class Link(Generic[T, U]):
    """Two directions, T from the operator to the robot, U back, without input or output of their own.

    Args:
        conditions: What each direction does at first; see `Channel`.
        rng: Source of everything random in it; the directions draw independently.
        keep: Most records that each direction's log keeps until they're taken.
    """

    def __init__(self, conditions: LinkConditions, rng: np.random.Generator, *, keep: int = MAX_RECORDS) -> None:
        there, back = rng.spawn(2)
        self.forward: Channel[T] = Channel(conditions.forward, there, log=PacketLog(keep))
        self.backward: Channel[U] = Channel(conditions.backward, back, log=PacketLog(keep))

    @property
    def conditions(self) -> LinkConditions:
        """What each direction does now."""
        return LinkConditions(self.forward.conditions, self.backward.conditions)

    def change(self, conditions: LinkConditions, now: float) -> None:
        """Let other conditions hold for what is sent from now [s] on; see `Channel.change`."""
        self.forward.change(conditions.forward, now)
        self.backward.change(conditions.backward, now)

    def next_deadline(self) -> float | None:
        """When the next packet arrives in either direction, or is sent again [s]; None when both are idle."""
        both = (self.forward.next_deadline(), self.backward.next_deadline())
        return min((t for t in both if t is not None), default=None)
