"""One direction of an emulated link with in-order service: what is lost is sent again, and holds back the rest."""

from __future__ import annotations

import heapq
import math
from collections import deque
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from interfaces.link.channel import Delivery, moment
from interfaces.link.conditions import Conditions
from interfaces.link.packets import LossReason, PacketLog, PacketRecord
from interfaces.link.path import LinkPath
from vrs.checks import integer_in
from vrs.commands import finite

T = TypeVar("T")

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
