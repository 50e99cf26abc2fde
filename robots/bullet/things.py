"""What stands, walks and opens in a room: boxes, columns, people and doors, with their timetables."""

from __future__ import annotations

import enum
import math
from bisect import bisect_right
from dataclasses import dataclass


def between(times: tuple[float, ...], t: float, *, repeat: bool) -> tuple[int, int, float]:
    """Return the entries of a timetable before and after a time, and how far it is from the one to the other.

    Args:
        times: Ascending [s], one at least.
        t: [s].
        repeat: Whether the timetable begins again when it ended.

    Returns:
        Two numbers of entries, the same before the first and after the last; the share, in [0, 1].
    """
    if repeat and t > times[-1]:
        t = times[0] + math.fmod(t - times[0], times[-1] - times[0])
    k = bisect_right(times, t)
    if k in (0, len(times)):
        end = min(k, len(times) - 1)
        return end, end, 0.0
    return k - 1, k, (t - times[k - 1]) / (times[k] - times[k - 1])


@dataclass(frozen=True, slots=True)
class Block:
    """A box that stands on the floor, a wall among others."""

    name: str
    x: float
    """Of its middle [m]."""
    y: float
    length: float
    """Along its own first axis [m]."""
    width: float
    angle: float
    """Of its first axis [rad]."""
    height: float
    known: bool = True
    """Whether the operator's map has it."""
    start: float = -math.inf
    """It stands there in [start, end) [s]."""
    end: float = math.inf

    def stands(self, t: float) -> bool:
        """Whether it's there at t [s]."""
        return self.start <= t < self.end


@dataclass(frozen=True, slots=True)
class Column:
    """An upright cylinder."""

    name: str
    x: float
    y: float
    radius: float
    height: float
    known: bool = True
    start: float = -math.inf
    """It stands there in [start, end) [s]."""
    end: float = math.inf

    def stands(self, t: float) -> bool:
        """Whether it's there at t [s]."""
        return self.start <= t < self.end


@dataclass(frozen=True, slots=True)
class Person:
    """A cylinder that walks along straight lines between places, at the times that belong to them."""

    name: str
    radius: float
    height: float
    times: tuple[float, ...]
    """Ascending [s]."""
    places: tuple[tuple[float, float], ...]
    """Where at each time [m]."""
    repeat: bool = False
    """Whether the path begins again when it ended; it then ends where it began."""

    def at(self, t: float) -> tuple[float, float]:
        """Where the person is at t [s]; before the first time at the first place, after the last at the last."""
        before, after, share = between(self.times, t, repeat=self.repeat)
        (x0, y0), (x1, y1) = self.places[before], self.places[after]
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)

    @property
    def speed(self) -> float:
        """Fastest that the person walks [m/s]."""
        steps = zip(self.times, self.places, self.times[1:], self.places[1:], strict=False)
        return max((math.dist(p, q) / (b - a) for a, p, b, q in steps), default=0.0)


class DoorKind(enum.StrEnum):
    """How a door opens."""

    HINGED = "hinged"
    """It swings about its first end."""
    SLIDING = "sliding"
    """It slides past its first end."""


@dataclass(frozen=True, slots=True)
class Door:
    """A leaf in a doorway that opens and closes by a timetable, at even speed in between, and stops for nobody."""

    name: str
    kind: DoorKind
    x: float
    """Of its first end, where the hinge is [m]."""
    y: float
    length: float
    """Of the leaf, as wide as the doorway [m]."""
    angle: float
    """From the first end to the other when it's closed [rad]."""
    thickness: float
    height: float
    swing: float
    """Turn when it's quite open, to the left positive [rad]; of a hinged door."""
    times: tuple[float, ...]
    """Ascending [s]."""
    shares: tuple[float, ...]
    """How far it's open at each time, 0 closed, 1 open."""
    repeat: bool = False
    """Whether the timetable begins again when it ended; it then ends as it began."""

    def share(self, t: float) -> float:
        """How far it's open at t [s], in [0, 1]."""
        before, after, share = between(self.times, t, repeat=self.repeat)
        return self.shares[before] + share * (self.shares[after] - self.shares[before])

    def at(self, t: float) -> Block:
        """The leaf as it stands at t [s]."""
        share, half = self.share(t), self.length / 2
        if self.kind is DoorKind.HINGED:
            angle, ahead = self.angle + share * self.swing, half
        else:
            angle, ahead = self.angle, half - share * self.length
        x, y = self.x + ahead * math.cos(angle), self.y + ahead * math.sin(angle)
        return Block(self.name, x, y, self.length, self.thickness, angle, self.height, known=False)

    def still(self, t: float) -> tuple[float, float]:
        """From when to when it stands as it does at t [s]; t and t where it moves."""
        before, after, _ = between(self.times, t, repeat=self.repeat)
        if self.shares[before] != self.shares[after]:
            return t, t
        if len(self.times) == 1 or (not self.repeat and t >= self.times[-1]):
            return t, math.inf
        first, last = self.times[0], self.times[-1]
        if t < first:
            return -math.inf, first
        begun = t - first if not self.repeat else math.fmod(t - first, last - first)
        return t, t + (self.times[after] - first - begun) if after != before else t

    @property
    def speed(self) -> float:
        """Fastest that anything of it moves [m/s]."""
        steps = zip(self.times, self.shares, self.times[1:], self.shares[1:], strict=False)
        fastest = max((abs(q - p) / (b - a) for a, p, b, q in steps), default=0.0)
        return fastest * self.length * (abs(self.swing) if self.kind is DoorKind.HINGED else 1.0)
