"""How far a live mobile robot is from its path, and how much later than the path it is there."""

from __future__ import annotations

import math
from collections import deque
from itertools import islice
from typing import NamedTuple

from robots.onboard.driving import Posture
from vrs.segment import ArcSegment

BACK, AHEAD = 8, 60
"""How many pieces of the path behind the place before, and ahead of it, are looked at."""
KEPT = 12_000
"""Pieces that are kept: ten minutes of a command's two a tenth of a second."""
_SAME = 1e-6
"""Places nearer than this are one [m]."""
_STANDS, _REACHED = 0.15, 0.04
"""A path stands where it stays for longer [s], and a robot has reached that from so near [m]."""


class Deviation(NamedTuple):
    """How a robot is on its path."""

    path_error: float
    """Distance from the nearest place of the path near the one before [m]."""
    time_difference: float
    """How much later than the path's it is there [s], ≥ 0."""


class _Point(NamedTuple):
    t: float
    x: float
    y: float
    left: float
    """When the path goes on from here [s]: later than t where it stands."""


class PathDeviation:
    """Matches postures to a path that grows: how far a robot is from it, and how much later.

    The laboratory matches whole paths afterwards (`vrs.comparison`); live, each measured posture is matched to the
    nearest place of the path near the place before.
    """

    def __init__(self, t: float, posture: Posture) -> None:
        """Begin a path at a time [s] and a place."""
        self._points: deque[_Point] = deque([_Point(t, posture.x, posture.y, t)])
        self._at = 0
        self.place = t
        """Time on the path of the newest match [s]."""

    def add(self, arc: ArcSegment) -> None:
        """Let the path go on by an arc."""
        for t in (arc.start + 0.5 * arc.duration, arc.end):
            x, y, _ = (float(value) for value in arc.value(t))
            last = self._points[-1]
            if math.hypot(x - last.x, y - last.y) <= _SAME:
                self._points[-1] = last._replace(left=t)
            else:
                self._points.append(_Point(t, x, y, t))
        while len(self._points) > KEPT:
            self._points.popleft()
            self._at = max(self._at - 1, 0)

    def match(self, posture: Posture, measured_at: float) -> Deviation:
        """Where a robot is on the path.

        Args:
            posture: Of the robot.
            measured_at: When it was there [s], by the path's clock.
        """
        first = max(self._at - BACK, 0)
        near = list(islice(self._points, first, self._at + AHEAD))
        best, found, at = math.inf, near[0], 0
        for k, point in enumerate(near):
            place = point if k + 1 == len(near) else _beside(point, near[k + 1], posture)
            distance = math.hypot(place.x - posture.x, place.y - posture.y)
            if distance < best:
                best, found, at = distance, place, k
        self._at, self.place = first + at, found.t
        # Near to where the path stands a robot is there, whatever the noise of its posture says.
        stands = (p for p in near[at : at + 4] if p.left - p.t > _STANDS)
        reached = [p for p in stands if math.hypot(p.x - found.x, p.y - found.y) < _REACHED]
        if reached and reached[-1] is self._points[-1]:
            return Deviation(best, 0.0)
        return Deviation(best, max(0.0, measured_at - max([found.left, *(p.left for p in reached)])))


def _beside(a: _Point, b: _Point, posture: Posture) -> _Point:
    """The place on the piece from a to b that is nearest to a posture; b itself is the next piece's."""
    x, y = b.x - a.x, b.y - a.y
    share = ((posture.x - a.x) * x + (posture.y - a.y) * y) / (x * x + y * y)
    if not 0.0 < share < 1.0:
        return a
    t = a.left + share * (b.t - a.left)
    return _Point(t, a.x + share * x, a.y + share * y, t)
