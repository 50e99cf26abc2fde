"""A scan held against a map from a posture, beam by beam: what the map explains, and what contradicts it.

A beam that ends before the map's first wall met something that the map doesn't have. One that goes on behind it
contradicts the map: nothing that's put into a room makes a wall transparent.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robots.onboard.gsp_map import Lines, cast_lines
from robots.onboard.laser import Points
from vrs.model import Array

CLOSE = 0.03
"""A beam that ends so near where it should, or within three deviations of the noise, is explained [m]."""
THROUGH = 0.15
"""One that goes so much too far, and more than five deviations, contradicts [m]."""
MOST_BEAMS = 91
"""Beams of a scan that are looked at."""


class Evidence(NamedTuple):
    """Shares of the beams."""

    explained: float
    """End at the map's first line."""
    before: float
    """End before it."""
    through: float
    """Go on behind it."""
    blank: float
    """Look where the map has nothing."""


def evidence(lines: Lines, points: Points, posture: tuple[float, float, float], noise: float) -> Evidence:
    """Hold a scan against a map.

    Args:
        lines: Of the map.
        points: What was seen, in the robot's frame.
        posture: Where the robot would be, (x, y, θ) [m, m, rad].
        noise: Standard deviation of a range [m].
    """
    step = max(1, math.ceil(len(points.beams) / MOST_BEAMS))
    ranges = points.ranges[::step]
    if not len(ranges):
        return Evidence(0.0, 0.0, 0.0, 1.0)
    expected = expected_ranges(lines, points.origins[::step], points.ways[::step], posture)
    return judged(ranges - expected, noise)


def expected_ranges(lines: Lines, origins: Array, ways: Array, posture: tuple[float, float, float]) -> Array:
    """How far beams in the robot's frame would go in a map [m], (k,), inf where they'd meet nothing."""
    x, y, theta = posture
    c, s = math.cos(theta), math.sin(theta)
    turn = np.array([[c, s], [-s, c]])
    return cast_lines(lines.ends, origins @ turn + (x, y), ways @ turn)


def judged(difference: Array, noise: float) -> Evidence:
    """Shares of beams by how much farther they went than expected [m], (k,), −inf where nothing was."""
    close, far = max(CLOSE, 3 * noise), max(THROUGH, 5 * noise)
    explained = float(np.mean(np.abs(difference) <= close))
    blank = float(np.mean(difference == -np.inf))
    return Evidence(explained, float(np.mean(difference < -close)) - blank, float(np.mean(difference > far)), blank)
