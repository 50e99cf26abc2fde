"""One direction of an emulated link."""

from __future__ import annotations

import enum
import heapq
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from interfaces.link.profiles import DelayProfile
from vrs.commands import finite
from vrs.errors import InvalidValueError

T = TypeVar("T")


class Service(enum.StrEnum):
    """What the link promises about order."""

    IN_ORDER = "in-order"
    """No packet overtakes an earlier one: it waits for it, as in a byte stream."""
    DATAGRAM = "datagram"
    """Packets arrive as they come."""


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

    Args:
        profile: How long packets take.
        rng: Source of everything random in it.
        service: Order of delivery.
        capacity: Most packets in flight, ≥ 1; what is sent beyond it is lost.
    """

    def __init__(
        self,
        profile: DelayProfile,
        rng: np.random.Generator,
        service: Service = Service.IN_ORDER,
        capacity: int = 10_000,
    ) -> None:
        if capacity < 1:
            raise InvalidValueError("capacity", capacity, "an integer, at least 1")
        self._source = profile.source(rng)
        self._service = Service(service)
        self._capacity = capacity
        self._flight: list[tuple[float, int, Delivery[T]]] = []
        self._count = 0
        self._sent = -float("inf")
        self._last_arrival = -float("inf")

    def send(self, payload: T, now: float) -> float | None:
        """Put a packet on its way.

        Args:
            payload: What the packet carries.
            now: Time [s], not before that of the packet sent last.

        Returns:
            When it will arrive [s]; None when it is lost. For the record only: no receiver knows it.

        Raises:
            InvalidValueError: If now is not finite, or runs back.
        """
        now = finite("now", now, "finite seconds")
        if now < self._sent:
            raise InvalidValueError("now", now, f"at least {self._sent}, the time of the last sending")
        self._sent = now
        delay = self._source.draw(now)
        if delay is None or len(self._flight) >= self._capacity:
            return None
        arrival = now + delay
        if self._service is Service.IN_ORDER:
            arrival = self._last_arrival = max(arrival, self._last_arrival)
        heapq.heappush(self._flight, (arrival, self._count, Delivery(payload, now, arrival)))
        self._count += 1
        return arrival

    def receive(self, now: float) -> tuple[Delivery[T], ...]:
        """Take everything that has arrived by now [s], in the order of arrival."""
        arrived: list[Delivery[T]] = []
        while self._flight and self._flight[0][0] <= now:
            arrived.append(heapq.heappop(self._flight)[2])
        return tuple(arrived)

    def next_deadline(self) -> float | None:
        """When the next packet arrives [s]; None when none is in flight."""
        return self._flight[0][0] if self._flight else None
