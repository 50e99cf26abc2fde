"""How far a robot gets on curves until its outline touches one of some points.

For a curvature the way is exact: seen from the robot, a point goes round the centre of rotation, and where its
circle meets a side of the outline is known in closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vrs.checks import number_in
from vrs.model import Array

_STRAIGHT = 1e-4
"""Curvatures of less [1/m] are driven as this one: over a metre it's 0.05 mm beside."""
CREEP = 0.01
"""How much nearer the outline may come to a point that's within the clearance already [m]."""
ROUNDING = 1e-6
"""Lengths that differ by less [m] are taken as equal where points are left out."""


@dataclass(frozen=True, slots=True)
class Outline:
    """A rectangle round the robot, seen from the middle of its driving axle."""

    front: float
    """[m], in [0.005, 5]."""
    rear: float
    """[m], in [0.005, 5]."""
    half_width: float
    """[m], in [0.005, 5]."""

    def __post_init__(self) -> None:
        for name in ("front", "rear", "half_width"):
            number_in(name, getattr(self, name), 0.005, 5.0)


def free_ways(points: Array, curvatures: Array, outline: Outline, clearance: float, sense: int = 1) -> Array:
    """Ways until an outline touches a point.

    Args:
        points: In the robot's frame [m], (m, 2).
        curvatures: Of the curves [1/m], (n,), to the left positive.
        outline: Of the robot.
        clearance: Distance from it that counts as touching [m]; a point that's within it already may come nearer by
            `CREEP`.
        sense: 1 forward, −1 in reverse.

    Returns:
        For each curvature [m], (n,); infinity where nothing is ever touched.
    """
    if not len(points):
        return np.full(len(curvatures), np.inf)
    x, y = points[:, 0] * sense, points[:, 1]
    front, rear = (outline.front, outline.rear)[::sense]
    half = outline.half_width
    beyond = np.hypot(np.maximum(np.maximum(x - front, -rear - x), 0), np.maximum(np.abs(y) - half, 0))
    if ((beyond <= 0) & (x > 0)).any():
        return np.zeros(len(curvatures))
    margin = np.minimum(clearance, np.maximum(beyond - CREEP, 0))
    k = np.where(np.abs(curvatures) < _STRAIGHT, np.copysign(_STRAIGHT, curvatures), curvatures)
    # A reversing robot goes forward in a mirror, and turns the other way there.
    k = k * sense
    centre = (1 / k)[:, None]
    radius = np.hypot(x, y - centre)
    # Points nearer to the centre of rotation or further from it than any of the outline are never touched.
    inner = np.abs(centre) - half - clearance - ROUNDING
    outer = np.hypot(max(front, rear) + clearance, np.abs(centre) + half + clearance) + ROUNDING
    curve, point = np.nonzero((radius >= inner) & (radius <= outer))
    ways = np.full(len(curvatures), np.inf)
    if not len(curve):
        return ways
    k, centre, radius = k[curve], centre[curve, 0], radius[curve, point]
    x, y, margin = x[point], y[point], margin[point]
    # Front and rear are met at ± an angle, the sides at an angle and what it lacks to π.
    ends = np.stack([front + margin, -rear - margin])
    sides = np.stack([half + margin, -half - margin])
    with np.errstate(invalid="ignore", divide="ignore"):
        across, beside = np.arccos(ends / radius), np.arcsin((sides - centre) / radius)
    solution = np.concatenate([across, -across, beside, math.pi - beside])
    met = np.concatenate([centre + radius * np.sin(solution[:4]), radius * np.cos(solution[4:])])
    low, high = np.repeat([sides[1], ends[1]], 4, axis=0), np.repeat([sides[0], ends[0]], 4, axis=0)
    inside = (met >= low - 1e-9) & (met <= high + 1e-9)
    turned = np.remainder((np.arctan2(y - centre, x) - solution) * np.sign(k), math.tau)
    np.minimum.at(ways, curve, np.where(inside, turned / np.abs(k), np.inf).min(axis=0))
    return ways
