"""S-shaped paths at random, and how long a robot takes on one that spends its whole tolerance."""

from __future__ import annotations

from typing import Final

import numpy as np

from robots.onboard.curve import Curve

START: Final = (-0.1, 1.0, 0.0)
"""Where the robot begins: the paper's (x, y, θ) [m, m, rad]."""
BEGIN: Final = (0.0, 1.0)
"""Where every path begins [m]."""
MOST_CURVATURE: Final = 6.0
"""[1/m]."""
T_PRED: Final = (8.0, 9.0)
"""Of the random paths [s]: at most 9, so that the middleware has the time; not much less, as a robot without it
gets to the end of a short path in 15 s, too, swinging (the map has the shorter ones)."""
SHORTER: Final = (6.0, 9.0)
"""Of random paths of which many are shorter [s]."""
SLOWEST: Final = 0.23
"""Round trip that counts in T_pred [s]: the longest median."""
_FLATTER: Final = 0.95
"""How deep an S is beside the one before that bent too much."""


def predicted_time(curve: Curve, tau: float, epsilon: float) -> float:
    """Return T_pred = (τ/ε) ∫ √(1 + κ²) ds [s]: how long the path takes where J = ε all along.

    Args:
        curve: The path.
        tau: Round trip [s].
        epsilon: Tolerance ε.
    """
    s, _, curvature = curve.table
    root = np.sqrt(1.0 + curvature * curvature)
    return tau / epsilon * float(np.sum(np.diff(s) * 0.5 * (root[1:] + root[:-1])))


def s_path(
    seed: int,
    t_pred: float | None = None,
    *,
    within: tuple[float, float] = T_PRED,
    tau: float = SLOWEST,
    epsilon: float = 0.25,
) -> Curve:
    """Draw an S: two bends, one to either side, as a cubic spline from (0, 1) on.

    Shapes that bend more than 6 /m are drawn anew, flatter and flatter: a short path holds no deep S.

    Args:
        seed: Of the shape.
        t_pred: Its predicted time, which sets its size [s]; drawn, unless given.
        within: From where it's drawn, least and most [s].
        tau: Round trip of that time [s].
        epsilon: Tolerance ε of that time.
    """
    rng = np.random.default_rng([seed, 13])
    wanted = float(rng.uniform(*within)) if t_pred is None else t_pred
    depth = 1.0
    while True:
        curve = _sized(_shape(rng, depth), wanted, tau, epsilon)
        if float(curve.table[2].max()) <= MOST_CURVATURE:
            return curve
        depth *= _FLATTER


def _shape(rng: np.random.Generator, depth: float) -> list[tuple[float, float]]:
    """Points of an S from (0, 0) on, about 3 m wide."""
    side = float(rng.choice((-1.0, 1.0)))
    x = np.cumsum(rng.uniform(0.7, 1.3, 3)).tolist()
    first, second = (depth * rng.uniform(0.5, 1.0, 2)).tolist()
    last = depth * float(rng.uniform(-0.3, 0.3))
    return [(0.0, 0.0), (x[0], side * first), (x[1], -side * second), (x[2], last)]


def _sized(points: list[tuple[float, float]], wanted: float, tau: float, epsilon: float) -> Curve:
    """The shape at the size of which T_pred is what is wanted, by bisection: it grows with the size."""
    low, high = 0.05, 50.0
    for _ in range(40):
        scale = (low * high) ** 0.5
        if predicted_time(_scaled(points, scale), tau, epsilon) < wanted:
            low = scale
        else:
            high = scale
    return _scaled(points, low)


def _scaled(points: list[tuple[float, float]], scale: float) -> Curve:
    return Curve([(BEGIN[0] + scale * x, BEGIN[1] + scale * y) for x, y in points])
