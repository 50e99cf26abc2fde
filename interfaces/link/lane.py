"""One direction of an emulated link whose conditions may change while packets are on their way."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Generic, TypeVar

import numpy as np

from interfaces.link.channel import Channel, Delivery, moment
from interfaces.link.conditions import Conditions, Service
from interfaces.link.packets import PacketLog
from interfaces.link.path import LinkPath
from interfaces.link.stream import Stream
from vrs.commands import finite

T = TypeVar("T")


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
