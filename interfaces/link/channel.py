"""One direction of an emulated link, without resending."""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from interfaces.link.conditions import MAX_COUNT, Conditions, Service
from interfaces.link.delay import DelayProfile
from interfaces.link.packets import LossReason, PacketLog, PacketRecord
from interfaces.link.path import LinkPath
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
        profile: How long packets take; or all conditions of the direction, whose own delay, service and
            capacity then hold.
        rng: Source of everything random in it.
        service: Order of delivery.
        capacity: Most packets in flight, ≥ 1; what is sent beyond it is lost.
        path: A path to share with other channels instead of one of its own; its conditions decide the fates.
        log: Where to write down what becomes of each packet, instead of a log of its own.
    """

    def __init__(
        self,
        profile: DelayProfile | Conditions,
        rng: np.random.Generator,
        service: Service = Service.IN_ORDER,
        capacity: int = 10_000,
        *,
        path: LinkPath | None = None,
        log: PacketLog | None = None,
    ) -> None:
        if isinstance(profile, Conditions):
            conditions = profile
        else:
            integer_in("capacity", capacity, 1, MAX_COUNT)
            conditions = Conditions(delay=profile, service=Service(service), capacity=capacity)
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
