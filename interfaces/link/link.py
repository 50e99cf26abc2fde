"""Both directions of an emulated link, made from one configuration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeAlias, TypeVar

import numpy as np

from interfaces.link.channel import Channel
from interfaces.link.conditions import Conditions, LinkConditions, Service
from interfaces.link.lane import Lane
from interfaces.link.packets import MAX_RECORDS, PacketLog, Totals
from interfaces.link.path import LinkPath
from interfaces.link.stream import Stream

T = TypeVar("T")
U = TypeVar("U")

Direction: TypeAlias = Channel[T] | Stream[T]
"""One direction: datagrams, or a byte stream that sends again."""


@dataclass(frozen=True, slots=True)
class LinkTotals:
    """Sums over all packets."""

    forward: Totals
    backward: Totals


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

    def totals(self) -> LinkTotals:
        """What became of all packets so far."""
        return LinkTotals(self.forward.log.totals(), self.backward.log.totals())


def direction(
    conditions: Conditions, rng: np.random.Generator, *, path: LinkPath | None = None, log: PacketLog | None = None
) -> Channel[T] | Stream[T]:
    """Make one direction: a `Channel` for datagrams, a `Stream` for in-order service."""
    if conditions.service is Service.IN_ORDER:
        return Stream(conditions, rng, path=path, log=log)
    return Channel(conditions, rng, path=path, log=log)
