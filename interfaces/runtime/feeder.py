"""When the body is fed: whatever is decided, it has before the ticks for which it counts.

It's fed what follows if nobody looks again. So it's also fed where something fell due, though no message came: what
is decided then may be another course, as that the arm needn't brake yet.
"""

from __future__ import annotations

import math
from typing import Protocol

from interfaces.link.round_trip import Ping
from interfaces.runtime.physics import TICK, References
from interfaces.runtime.physics_messages import Fault
from interfaces.teleop import JointReference, Report, RobotHost

FEED = 0.1
"""Longest time between two lots of references [s]."""


class Fed(Protocol):
    """What takes references; see `PhysicsProcess`."""

    def feed(self, reference: JointReference, start: int, *, placed: bool = False) -> bool:
        """Give references from a tick on."""

    def acknowledge(self, fault: Fault) -> None:
        """Let what is fed from now on count."""


class Feeder:
    """Lets a host do what is due, and feeds a body what it's to do; reads no clock."""

    def __init__(self, host: RobotHost, body: Fed, *, now: float) -> None:
        """Begin to feed.

        Args:
            host: What decides, its lead ahead.
            body: What follows.
            now: By the robot's clock [s].
        """
        self._host, self._body = host, body
        self._references = References(host.reference, now=self._ahead(now))
        self._fed, self._stale, self._placed = -math.inf, True, False
        self._fault: Fault | None = None

    def decided(self) -> None:
        """Something was decided, or is about to be: feed at the next `advance`."""
        self._stale = True

    def placed(self, *, now: float) -> None:
        """The arm is held where it was measured: its references may jump there."""
        self._references.restart(now=self._ahead(now))
        self._stale = self._placed = True

    def failed(self, fault: Fault) -> None:
        """The body comes to rest by itself: nothing is fed until it does."""
        self._fault = fault

    def advance(self, *, now: float) -> tuple[Report | Ping, ...]:
        """Do what is due by now [s], and feed the body; say what is to be sent to the operator."""
        self._stale = self._stale or self._host.next_deadline() <= now
        messages = self._host.advance(now=now)
        if self._fault is not None and now >= self._fault.rest_tick * TICK:
            # It rests, and references begin there.
            self._body.acknowledge(self._fault)
            self._references.restart(now=self._ahead(now))
            self._fault, self._stale = None, True
        if self._stale or now >= self._fed + FEED:
            self._feed(now)
        return messages

    def next_deadline(self) -> float:
        """When to `advance` even if nothing comes, by the robot's clock [s]."""
        return min(self._host.next_deadline(), self._fed + FEED)

    def _feed(self, now: float) -> None:
        """Give the body its references, from where it has them for certain."""
        if self._fault is None:
            first, rows = self._references.take(now=self._ahead(now))
            self._body.feed(rows, first, placed=self._placed)
            self._placed = False
        self._fed, self._stale = now, False

    def _ahead(self, now: float) -> float:
        """For when of the body's time is decided at now [s]."""
        return now + self._host.config.lead
