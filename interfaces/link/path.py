"""What one direction of a link does to a packet: its bandwidth, losses, delays and copies.

Several channels and streams may share a path, as flows share a link.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from interfaces.link.conditions import Conditions
from interfaces.link.packets import LossReason


@dataclass(frozen=True, slots=True)
class PacketOutcome:
    """What becomes of a packet."""

    departure: float
    """When its last bit entered the link [s]; of a dropped packet, when it was sent."""
    arrivals: tuple[float, ...]
    """When it arrives, and its copy [s], earliest first; empty when it is lost."""
    lost: LossReason | None = None
    """Why it is lost."""


class LinkPath:
    """Decides the fate of packets in the order in which they are sent.

    Each impairment draws from a stream of its own: switching one on leaves what the others do as it was,
    so that two runs with one seed differ by that impairment alone.

    Args:
        conditions: What it does; `service`, `capacity` and resending are the business of channels.
        rng: Source of the delays, and of the seeds of everything else random.
    """

    def __init__(self, conditions: Conditions, rng: np.random.Generator) -> None:
        loss, reorder, duplicate, another_way = rng.spawn(4)
        self._conditions = conditions
        self._rng, self._loss, self._another_way = rng, loss, another_way
        self._delays = conditions.delay.source(rng)
        self._losses = conditions.loss.source(loss)
        self._reorder, self._duplicate = reorder, duplicate
        self._other_delays = conditions.delay.source(another_way)
        self._queue: deque[tuple[float, int]] = deque()
        self._queued_bytes = 0
        self._free = self._now = -math.inf

    def change(self, conditions: Conditions) -> None:
        """Let other conditions decide from now on; what isn't another one goes on, and keeps its state."""
        before, self._conditions = self._conditions, conditions
        if conditions.delay != before.delay:
            self._delays = conditions.delay.source(self._rng)
            self._other_delays = conditions.delay.source(self._another_way)
        if conditions.loss != before.loss:
            self._losses = conditions.loss.source(self._loss)

    def fate(self, now: float, size: int = 0, *, waits: bool = False) -> PacketOutcome:
        """Decide the fate of a packet.

        Args:
            now: When it is sent [s]; a time before that of the last packet counts as that one.
            size: Its size [byte].
            waits: Whether its sender holds it back while the queue is full, as a byte stream's does,
                instead of losing it.
        """
        now = self._now = max(now, self._now)
        conditions = self._conditions
        departure = self._enter(now, size, waits=waits)
        if departure is None:
            return PacketOutcome(now, (), LossReason.QUEUE)
        delay = self._delays.draw(departure, size)
        if self._losses.lost() or delay is None:
            return PacketOutcome(departure, (), LossReason.ON_THE_WAY)
        if conditions.reorder > 0 and self._reorder.random() < conditions.reorder:
            delay += conditions.reorder_by
        arrival = departure + delay
        if conditions.duplicate > 0 and self._duplicate.random() < conditions.duplicate:
            other = self._other_delays.draw(departure, size)
            if other is not None:
                return PacketOutcome(departure, (min(arrival, departure + other), max(arrival, departure + other)))
        return PacketOutcome(departure, (arrival,))

    def _enter(self, now: float, size: int, *, waits: bool) -> float | None:
        """When the packet's last bit has entered the link [s]; None when the queue is full."""
        conditions = self._conditions
        if conditions.bandwidth == math.inf:
            return now
        while self._queue and self._queue[0][0] <= now:
            self._queued_bytes -= self._queue.popleft()[1]
        full = len(self._queue) >= conditions.queue_packets
        if not waits and (full or self._queued_bytes + size > conditions.queue_bytes):
            return None
        self._free = max(now, self._free) + 8.0 * size / conditions.bandwidth
        self._queue.append((self._free, size))
        self._queued_bytes += size
        return self._free
