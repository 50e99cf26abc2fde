"""How far a robot goes astray while a command is late: the performance measure J, and the largest gain it allows.

A robot that keeps (v, ω) for a delay τ moves by Δx, Δy and turns by Δθ. With v = K and ω = 2 A K, u = K τ, eq. (26)
is

    J = √((1 − cos Δθ) / (2 A²) + Δθ²) = u √(sinc²(A u) + 4 A²),    Δθ = 2 A u,

which depends on A and u alone and goes to u as A goes to 0. J rises from u = 0 as long as |Δθ| < π, and is over π
from there on: for a tolerance ε ≤ π the gains with J ≤ ε are those with u ≤ u*, the only root below π / (2 |A|).
Since sinc is at most 1, and J is at least u for ε ≤ 3,

    ε / √(1 + 4 A²) ≤ u* ≤ ε.

Source: Tipsuwan, Chow, eq. (20)–(26).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from robots.onboard.driving import Drive
from vrs.checks import number_in
from vrs.mobile.model import sinc
from vrs.model import Array

LARGEST_EPSILON = 3.0
"""Largest tolerance ε: beyond π, gains above the first root would meet it again."""
_STEPS = 30
"""Most steps to the root; five do as a rule."""
_CLOSE = 1e-15
"""Relative change of a step that ends the search."""


def tolerance(epsilon: float) -> float:
    """Check a tolerance ε.

    Raises:
        InvalidValueError: If it isn't in [1e-6, 3].
    """
    return number_in("epsilon", epsilon, 1e-6, LARGEST_EPSILON)


def drive_measure(drive: Drive, tau: float) -> float:
    """Return J of a drive that is kept for a time τ [s]; a turn on the spot has one, too."""
    turned = sinc(0.5 * drive.w * tau)
    return tau * math.hypot(drive.v * turned, drive.w)


def optimal_way(A: float, epsilon: float) -> float:
    """Return u*: the largest u = K τ with J(A, u) ≤ ε [m].

    Args:
        A: Quadratic factor [1/m], finite.
        epsilon: Tolerance ε, in [1e-6, 3].
    """
    turn = 2 * abs(A)
    low, high = epsilon / math.hypot(1.0, turn), epsilon
    return _root(abs(A), turn, epsilon, low, min(high, math.pi / turn) if turn else high)


def optimal_gain(A: float, tau: float, epsilon: float) -> float:
    """Return K* = u*/τ: the largest gain with J ≤ ε [m/s].

    Args:
        A: Quadratic factor [1/m], finite.
        tau: Delay [s], positive.
        epsilon: Tolerance ε, in [1e-6, 3].
    """
    return optimal_way(A, epsilon) / tau


def optimal_ways(A: ArrayLike, epsilon: float) -> Array:
    """Return u* of an array of A [1/m]."""
    factors = np.asarray(A, dtype=np.float64)
    found = np.array([optimal_way(one, epsilon) for one in factors.ravel().tolist()])
    return found.reshape(factors.shape)


def _root(size: float, turn: float, epsilon: float, low: float, high: float) -> float:
    """Newton's method on J² − ε², kept within a bracket."""
    u = low
    for _ in range(_STEPS):
        x = turn * u
        way = u * sinc(size * u)
        excess = way * way + x * x - epsilon * epsilon
        if excess > 0:
            high = u
        else:
            low = u
        slope = 2 * u * sinc(x) + 2 * turn * x
        moved = u - excess / slope
        if not low <= moved <= high:
            moved = 0.5 * (low + high)
        if abs(moved - u) <= _CLOSE * u:
            return moved
        u = moved
    return u
