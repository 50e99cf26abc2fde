"""Ways that aren't to the goal: out of where the robot can't turn, and near to what blocks its way."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from robots.onboard.driving import Posture
from robots.onboard.path import Arc
from robots.onboard.routes import Point, Route, RouteMap
from vrs.mobile import advanced, wrapped

_CURVES = (0.0, 0.6, -0.6, 1.2, -1.2, 2.0, -2.0, 3.5, -3.5)
"""Curvatures that are tried to get out of a narrow place [1/m]."""
_STEP, _FARTHEST = 0.04, 1.6
"""Ways on them [m]: between two, and the longest."""
_ALONG = 0.1
"""Between places on a way at which it's looked whether it's free [m]."""
_EACH = 5
"""Of so many of them one is tried."""
_NEAR = 0.5
"""Who is so near to where he looks from [m], and turned there within as much [rad], stays."""


def way_out(
    roads: RouteMap,
    posture: Posture,
    seen: ArrayLike,
    room: Callable[[Posture, float, int], float],
    *,
    least: float = 0.0,
) -> Arc | None:
    """The shortest curve to a place where the robot can turn.

    Args:
        roads: The known ways.
        posture: Where it is.
        seen: Places at which something newly stands [m], (k, 2).
        room: Tells how far [m] there's room from a posture along a curvature [1/m], forward (1) or back (−1).
        least: Shorter ones aren't taken [m], unless there's no other: those that didn't help.

    Returns:
        A curve; None if there's none.
    """
    curves = [
        Arc(k * sense, s, sense)
        for k in _CURVES
        for sense in (1, -1)
        for s in np.arange(2 * _STEP, min(room(posture, k, sense) - _STEP, _FARTHEST), _STEP).tolist()
    ]
    if not curves:
        return None
    ends = [advanced(posture, arc.direction, arc.curvature, arc.length)[:2] for arc in curves]
    free = np.flatnonzero(roads.turns_at(ends, blocked=seen)).tolist()
    return min((curves[k] for k in free), key=lambda arc: (arc.length < least, arc.length), default=None)


def approach(
    roads: RouteMap, start: tuple[float, float, float], goal: Point, seen: ArrayLike
) -> tuple[Route, float] | None:
    """The way to where the robot sees whether what blocks its way is still there.

    Args:
        roads: The known ways.
        start: Posture of the robot, (x, y, θ) [m, m, rad].
        goal: Where it can't go as things stand [m].
        seen: Places at which something newly stands [m], (k, 2).

    Returns:
        A route, and the heading at its end [rad]; None if the robot is there, or can't get nearer.
    """
    here = start[:2]
    known = roads.route(here, goal)
    if not isinstance(known, Route):
        return None
    places = known.places(_ALONG)
    free = roads.turns_at(places, blocked=seen)
    # Up to where it's blocked, and back to where there's a way to; in narrow places it can't turn anyway.
    shut = ~free & roads.turns_at(places)
    last = int(np.argmax(shut)) if shut.any() else len(places)
    for k in np.flatnonzero(free[:last])[::-_EACH].tolist():
        place = float(places[k, 0]), float(places[k, 1])
        dx, dy = (places[min(k + _EACH, len(places) - 1)] - places[k]).tolist()
        heading = math.atan2(dy, dx) if dx or dy else start[2]
        near = math.dist(place, here) < _NEAR
        if near and abs(wrapped(heading - start[2])) < _NEAR:
            return None
        found = roads.route(here, here if near else place, blocked=seen)
        if isinstance(found, Route):
            return found, heading
    return None
