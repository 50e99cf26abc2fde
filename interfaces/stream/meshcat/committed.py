"""The committed path: where the real robot's tool will go, cut into pieces of half a second."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from vrs.checks import validated, within
from vrs.mobile import ArcTimeline
from vrs.model import Array
from vrs.timeline import Timeline

PIECE = 0.5
"""Timeline time of a piece, and between two ticks [s]."""
STEP = 0.025
"""Time between two points [s]."""
HORIZON = 20.0
"""How far ahead the path is drawn [s]."""
SAME = 1e-4
"""Points of the tool nearer than this are one [m]."""
SPACING = 4e-3
"""Least distance between two points of the line, but for its ends [m]."""
DISC, SMALL_DISC, BALL = 0.021, 0.012, 0.016
"""Radius of the tick of a whole second, of that of a half, and of the ball at the end [m]."""


@dataclass(frozen=True, slots=True, eq=False)
@validated
class Committed:
    """What the real robot is committed to."""

    timeline: Timeline | ArcTimeline
    """The operator's."""
    play: Annotated[float, within(-1e9, 1e9)]
    """The time of that timeline at which the real robot is [s], within ±1e9."""


@dataclass(frozen=True, slots=True, eq=False)
class CommittedPiece:
    """The path's part in [index * PIECE, (index + 1) * PIECE)."""

    index: int
    points: Array
    """The line [m], (k, 3): none, or at least two of which no two in a row are equal."""
    marks: tuple[tuple[Array, float], ...]
    """Pose of each mark, (4, 4), its z along the path, and radius of its disc, or minus that of a ball [m]."""
    t: float | None
    """Time of the last mark if it's to be labelled [s]; else None."""
    ends: bool
    """Whether the arm comes to rest here, with nothing planned after it."""

    def __bool__(self) -> bool:
        """Whether there's anything to see."""
        return bool(len(self.points) or self.marks)

    def equals(self, other: CommittedPiece) -> bool:
        """Whether both look the same."""
        return self is other or (
            (self.index, self.t, self.ends) == (other.index, other.t, other.ends)
            and len(self.marks) == len(other.marks)
            and all(
                a[1] == b[1] and np.array_equal(a[0], b[0]) for a, b in zip(self.marks, other.marks, strict=True)
            )
            and np.array_equal(self.points, other.points)
        )


class CommittedPath:
    """The path of one plan, sampled once; pieces of equal motion are equal, whatever else the plan holds."""

    def __init__(self, tool_at: Callable[[Array], Array], timeline: Timeline | ArcTimeline, play: float) -> None:
        """Sample a plan.

        Args:
            tool_at: Says where the drawn point is [m], (k, 3), at what the plan gives, (k, n).
            timeline: The plan.
            play: Where the path begins [s].
        """
        self._tool_at, self._timeline = tool_at, timeline
        self.first = math.floor(play / PIECE)
        end = min(timeline.end, play + HORIZON)
        last = max(self.first, math.ceil(end / PIECE) - 1)
        per = round(PIECE / STEP)
        self._t = np.arange(self.first * per, (last + 1) * per + 1) * STEP
        q = np.atleast_2d(timeline.sample(self._t))
        self._points = self._tool_at(q)
        moving = np.abs(q - q[-1]).max(axis=1) > 1e-9
        rest = float(self._t[np.flatnonzero(moving)[-1] + 1]) if moving.any() else float(self._t[0])
        self._bounded = end < timeline.end
        """Whether the plan goes on after what is drawn."""
        self.end = end if self._bounded else min(end, rest)
        """Where the path ends [s]."""
        self._whole: dict[int, CommittedPiece] = {}

    def reaches(self, play: float) -> bool:
        """Whether it still does for a robot at that time [s]: begun before it, and cut not too near after it."""
        return play >= self.first * PIECE and (not self._bounded or self.end >= play + HORIZON - 2.0)

    def pieces(self, play: float) -> tuple[CommittedPiece, ...]:
        """The pieces from the real robot's time on [s]; none where it's at the end."""
        if play >= self.end:
            return ()
        last = math.ceil(self.end / PIECE) - 1
        first = max(self.first, math.floor(play / PIECE))
        return tuple(self._piece(index, play) for index in range(first, last + 1))

    def _piece(self, index: int, play: float) -> CommittedPiece:
        """A piece from play on; those that lie wholly ahead are made once."""
        if play > index * PIECE:
            return self._make(index, play)
        if index not in self._whole:
            self._whole[index] = self._make(index, index * PIECE)
        return self._whole[index]

    def _make(self, index: int, play: float) -> CommittedPiece:
        per = round(PIECE / STEP)
        low = (index - self.first) * per
        t, points = self._t[low : low + per + 1], self._points[low : low + per + 1]
        ends = not self._bounded and index * PIECE < self.end <= (index + 1) * PIECE
        begun = play > t[0]
        if begun:
            points = np.vstack([self._tool_at(np.atleast_2d(self._timeline.sample(play))), points[t > play + 1e-9]])
        line = thinned(points)
        marks: list[tuple[Array, float]] = []
        whole = index % round(1 / PIECE) == 0
        arrived = low > 0 and bool(np.linalg.norm(self._points[low] - self._points[low - per]) > SAME)
        if not begun and arrived:
            marks.append((self._across(low), DISC if whole else SMALL_DISC))
        label = float(t[0]) if marks and whole else None
        if ends:
            X = np.eye(4)
            X[:3, 3] = points[-1]
            marks.append((X, -BALL))
            label = self.end
        return CommittedPiece(index, line, tuple(marks), label, ends)

    def _across(self, k: int) -> Array:
        """Pose of a tick at point k, its z along the path there."""
        for reach in (1, 10):
            way = self._points[min(k + reach, len(self._points) - 1)] - self._points[max(k - reach, 0)]
            length = float(np.linalg.norm(way))
            if length > SAME:
                break
        else:
            way, length = np.array([0.0, 0.0, 1.0]), 1.0
        z = way / length
        x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
        x /= np.linalg.norm(x)
        X = np.eye(4)
        X[:3, 0], X[:3, 1], X[:3, 2], X[:3, 3] = x, np.cross(z, x), z, self._points[k]
        return X


def thinned(points: Array) -> Array:
    """The line's ends, and between them a point wherever it has gone on by SPACING."""
    gone = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    if gone[-1] <= SAME:
        return np.empty((0, 3))
    keep = np.diff(np.floor(gone / SPACING), prepend=-1.0) > 0
    # The end stands for the point before it, unless that's the start.
    keep[1:] &= gone[-1] - gone[1:] > 0.5 * SPACING
    keep[-1] = True
    return points[keep]
