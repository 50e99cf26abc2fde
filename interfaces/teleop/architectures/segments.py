"""What the operator's site sends a mobile robot: arcs of his path, numbered, with the braking tail after them.

Both transports carry the same packets. Over an ordered stream each arc goes once, and waits for those before it.
In datagrams every arc is repeated until the robot has said that it has it, so that any packet that arrives makes
up for all that were lost or are late.
"""

from __future__ import annotations

import enum
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from interfaces.link.conditions import Service
from vrs.segment import ArcSegment

HEADER = 44
"""Number of the first arc, time and posture at its start, and how many follow [byte]."""
ARC = 24
"""v, ω and duration of an arc [byte]."""
MOST_REPEATED = 600
"""Most arcs in a datagram's message: a minute's. With more missing, the oldest and the newest halves."""
MOST_EARLY = 36_000
"""Most arcs that wait for those before them; what comes beyond is left out, and repeated by the sender."""


class Transport(enum.StrEnum):
    """How packets go to the robot."""

    STREAM = "stream"
    """An ordered byte stream: a late packet holds back all after it."""
    DATAGRAMS = "datagrams"
    """Datagrams; each repeats what the robot hasn't acknowledged."""

    @property
    def service(self) -> Service:
        """What the link promises about order."""
        return Service.IN_ORDER if self is Transport.STREAM else Service.DATAGRAM


@dataclass(frozen=True, slots=True)
class ArcPacket:
    """Arcs of the operator's path."""

    runs: tuple[tuple[int, tuple[ArcSegment, ...]], ...]
    """Runs of consecutive arcs, each with the number of its first."""
    complete_until: float
    """No later packet changes the path before this time [s]."""
    tail: tuple[ArcSegment, ...] = ()
    """How the virtual robot brakes from there, unless the operator goes on."""

    @property
    def size(self) -> int:
        """What it takes on the wire [byte]."""
        return 8 + HEADER * len(self.runs) + ARC * (len(self.tail) + sum(len(arcs) for _, arcs in self.runs))


class Sender:
    """Makes packets of the arcs that the operator has driven."""

    def __init__(self, transport: Transport) -> None:
        """Start with nothing to send."""
        self._repeats = transport is Transport.DATAGRAMS
        self._arcs: deque[ArcSegment] = deque()
        self._first = 0

    @property
    def count(self) -> int:
        """Arcs added so far."""
        return self._first + len(self._arcs)

    def add(self, arc: ArcSegment) -> None:
        """Take the next arc."""
        self._arcs.append(arc)

    def acknowledge(self, count: int) -> None:
        """Take it that the robot has the first `count` arcs; what it said before may be more."""
        while self._first < min(count, self.count):
            self._arcs.popleft()
            self._first += 1

    def packet(self, complete_until: float, tail: Sequence[ArcSegment] = ()) -> ArcPacket:
        """Make a packet of what the robot may lack.

        Args:
            complete_until: Up to when the path is final [s].
            tail: The braking after it.
        """
        arcs, half = tuple(self._arcs), MOST_REPEATED // 2
        runs = [(self._first, arcs)] if arcs else []
        if not self._repeats:
            self.acknowledge(self.count)
        elif len(arcs) > MOST_REPEATED:
            runs = [(self._first, arcs[:half]), (self.count - half, arcs[-half:])]
        return ArcPacket(tuple(runs), complete_until, tuple(tail))


class Receiver:
    """Gives the arcs in their order, each once, as soon as all before it are there."""

    def __init__(self) -> None:
        """Start with none."""
        self._early: dict[int, ArcSegment] = {}
        self.count = 0
        """Arcs given so far, to be acknowledged."""

    def receive(self, packet: ArcPacket) -> list[ArcSegment]:
        """Take in a packet; return the arcs whose turn it is."""
        taken: list[ArcSegment] = []
        for first, arcs in packet.runs:
            start = max(self.count - first, 0)
            if first <= self.count:
                taken += arcs[start:]
                self.count += len(arcs[start:])
            else:
                room = MOST_EARLY - len(self._early)
                self._early.update((first + k, arc) for k, arc in enumerate(arcs[: max(room, 0)]))
        while self._early:
            arc = self._early.pop(self.count, None)
            if arc is None:
                self._early = {k: early for k, early in self._early.items() if k > self.count}
                break
            taken.append(arc)
            self.count += 1
        return taken
