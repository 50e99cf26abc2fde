"""What a link does to packets, as values: one frozen configuration for each direction."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from typing import Annotated

from interfaces.link.delay import MAX_DELAY, ConstantDelay, DelayProfile
from interfaces.link.losses import BernoulliLoss, GilbertElliottLoss, LossModel
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
    """Order of delivery. In order means sent again until it arrives: see `Stream`."""
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
