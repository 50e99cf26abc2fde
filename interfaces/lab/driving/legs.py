"""What the course of an operator is made of, and where somebody is along a line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LineLeg:
    """To be pursued."""

    points: tuple[tuple[float, float], ...]
    """Two or more [m]."""
    reverse: bool = False


@dataclass(frozen=True, slots=True)
class TurnLeg:
    """On the spot."""

    heading: float
    """Where to [rad]."""


@dataclass(frozen=True, slots=True)
class PauseLeg:
    """Standing."""

    duration: float
    """[s]."""


@dataclass(frozen=True, slots=True)
class GoalLeg:
    """A place to get to, by whatever way."""

    point: tuple[float, float]
    """[m]."""
    patience: float
    """After so long [s] he gives up, and goes on to the next."""


Leg = LineLeg | TurnLeg | PauseLeg | GoalLeg


def share_of(points: Sequence[tuple[float, float]], i: int, x: float, y: float) -> float:
    """How far a point is along the i-th piece, as a share of it."""
    (ax, ay), (bx, by) = points[i], points[i + 1]
    dx, dy = bx - ax, by - ay
    return ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)


def way_left(points: Sequence[tuple[float, float]], i: int, x: float, y: float) -> float:
    """Way left along the line [m]; only as far as it matters to somebody who brakes."""
    share = min(max(share_of(points, i, x, y), 0.0), 1.0)
    left = (1.0 - share) * math.dist(points[i], points[i + 1])
    for k in range(i + 1, len(points) - 1):
        if left > 1.0:
            break
        left += math.dist(points[k], points[k + 1])
    return left


def point_ahead(
    points: Sequence[tuple[float, float]], i: int, x: float, y: float, distance: float
) -> tuple[float, float]:
    """The point a distance [m] ahead; beyond the end on its last piece's line."""
    share = max(share_of(points, i, x, y), 0.0)
    while True:
        (ax, ay), (bx, by) = points[i], points[i + 1]
        length = math.hypot(bx - ax, by - ay)
        if share * length + distance <= length or i == len(points) - 2:
            share += distance / length
            return ax + share * (bx - ax), ay + share * (by - ay)
        distance -= (1.0 - share) * length
        i, share = i + 1, 0.0
