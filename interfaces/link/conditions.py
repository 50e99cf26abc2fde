"""What one direction of a link does to packets: its conditions, and the path that applies them.

Several channels and streams may share a path, as flows share a link.
"""

from __future__ import annotations

import enum
import math
from collections import deque
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from interfaces.link.delays import MAX_DELAY, ConstantDelay, DelayProfile
from interfaces.link.losses import BernoulliLoss, GilbertElliottLoss, LossModel
from interfaces.link.packets import LossReason
from vrs.checks import number_in, validated, within
from vrs.errors import InvalidValueError

MAX_COUNT = 10_000_000
"""Largest of the limits on packets."""


class Service(enum.StrEnum):
    """What the link promises about order."""

    IN_ORDER = "in-order"
    """No packet overtakes an earlier one: it waits for it, as in a byte stream."""
    DATAGRAM = "datagram"
    """Packets arrive as they come."""


@dataclass(frozen=True, slots=True)
@validated
class Conditions:
    """One direction of a link."""

    delay: DelayProfile = field(default_factory=lambda: ConstantDelay("none", 0.0))
    """How long packets take; it may lose some (a trace does)."""
    loss: LossModel = field(default_factory=lambda: BernoulliLoss(0.0))
    """Which packets are lost on the way."""
    duplicate: Annotated[float, within(0.0, 1.0)] = 0.0
    """Probability that a packet that isn't lost arrives twice, in [0, 1]. The copy takes another way: its
    delay comes from the same profile, with congestion of its own."""
    reorder: Annotated[float, within(0.0, 1.0)] = 0.0
    """Probability that a packet is held back by `reorder_by`, beyond what delays make of the order, in [0, 1]."""
    reorder_by: float = 0.05
    """How long it is held back [s], in [0, 3600]."""
    bandwidth: float = math.inf
    """Rate at which packets enter the link [bit/s], ≥ 1; infinite when sizes cost nothing. A packet of M
    bytes takes 8 M/bandwidth, and waits until those before it are through."""
    queue_packets: Annotated[int, within(1, MAX_COUNT)] = 1000
    """Most packets that wait for the bandwidth or are entering, 1 to 10,000,000; a datagram beyond is dropped."""
    queue_bytes: Annotated[int, within(1, 2**40)] = 16_777_216
    """Most bytes that wait for the bandwidth or are entering, ≥ 1; a datagram beyond is dropped."""
    capacity: Annotated[int, within(1, MAX_COUNT)] = 10_000
    """Most packets that a channel or stream holds, 1 to 10,000,000; what is sent beyond is lost."""
    service: Service = Service.DATAGRAM
    """Order of delivery. In order means sent again until it arrives: see `Channel`."""
    retransmit_after: float = 1.0
    """How long after a packet of an in-order service was lost it is sent again [s], in [0.001, 60]; twice as
    long after each further loss of the same packet, up to 60 s. RFC 6298's smallest."""
    attempts: Annotated[int, within(1, 1000)] = 15
    """How often a packet of an in-order service is sent before it is given up, 1 to 1000."""

    def __post_init__(self) -> None:
        if not isinstance(self.loss, BernoulliLoss | GilbertElliottLoss):
            raise InvalidValueError("loss", self.loss, "a BernoulliLoss or a GilbertElliottLoss")
        number_in("reorder_by", self.reorder_by, 0.0, MAX_DELAY, "seconds")
        if self.bandwidth != math.inf:
            number_in("bandwidth", self.bandwidth, 1.0, 1e15, "bit/s")
        number_in("retransmit_after", self.retransmit_after, 1e-3, 60.0, "seconds")
        try:
            object.__setattr__(self, "service", Service(self.service))
        except ValueError:
            allowed = " or ".join(repr(str(service)) for service in Service)
            raise InvalidValueError("service", self.service, allowed) from None


@dataclass(frozen=True, slots=True)
class LinkConditions:
    """Both directions of a link."""

    forward: Conditions = field(default_factory=Conditions)
    """From the operator to the robot."""
    backward: Conditions = field(default_factory=Conditions)
    """From the robot to the operator."""

    @classmethod
    def symmetric(cls, conditions: Conditions) -> LinkConditions:
        """The same conditions both ways, each way with draws of its own."""
        return cls(conditions, conditions)


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
        delay = self._delays(departure, size)
        if self._losses() or delay is None:
            return PacketOutcome(departure, (), LossReason.ON_THE_WAY)
        if conditions.reorder > 0 and self._reorder.random() < conditions.reorder:
            delay += conditions.reorder_by
        arrival = departure + delay
        if conditions.duplicate > 0 and self._duplicate.random() < conditions.duplicate:
            other = self._other_delays(departure, size)
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
