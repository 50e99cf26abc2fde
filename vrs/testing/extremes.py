"""Exact extremes of polynomials, apart from the certificates of planning: an independent judge of limits."""

from __future__ import annotations

from math import perm

import numpy as np

from vrs.model import Array

_CUBIC = 4
_GRID = 6
"""Points of the first grid for each coefficient of a polynomial."""
_ZOOMS = 2
"""Times that the neighbourhood of a grid's best point is looked at, each a quarter as wide as the one before."""
_STEPS = 3
"""Steps by Newton's rule after that."""


def values(a: Array, u: Array, order: int) -> Array:
    """Derivatives of polynomials, each at its own time.

    Args:
        a: Coefficients in ascending powers, (m, K, n).
        u: Times since each polynomial's start [s], (m,) or (..., m, n).
        order: Of the derivative.

    Returns:
        (m, n), or the shape of u.
    """
    x = u[:, None] if u.ndim == 1 else u
    total = np.zeros(np.broadcast_shapes(x.shape, a[:, 0].shape))
    for k in range(a.shape[1] - 1, order - 1, -1):
        total = total * x + perm(k, order) * a[:, k]
    return total


def extremes(a: Array, h: Array, order: int) -> tuple[Array, Array]:
    """Lowest and highest value of polynomials' derivatives on [0, h].

    Cubic polynomials by the roots of their derivatives; others on a grid, its best points refined.

    Args:
        a: Coefficients in ascending powers, (m, K, n).
        h: Durations [s], (m,).
        order: Of the derivative, 0 to 3.

    Returns:
        (m, n) each.
    """
    if a.shape[1] > _CUBIC and not a[:, _CUBIC:].any():
        a = a[:, :_CUBIC]
    if a.shape[1] <= _CUBIC:
        return _of_cubics(a, h, order)
    high = a[:, _CUBIC:].any((1, 2))
    lowest, highest = np.empty_like(a[:, 0]), np.empty_like(a[:, 0])
    lowest[~high], highest[~high] = _of_cubics(a[~high, :_CUBIC], h[~high], order)
    lowest[high], highest[high] = -_highest(-a[high], h[high], order), _highest(a[high], h[high], order)
    return lowest, highest


def _of_cubics(a: Array, h: Array, order: int) -> tuple[Array, Array]:
    c = np.zeros((len(a), _CUBIC, a.shape[2]))
    c[:, : a.shape[1]] = a
    u = np.broadcast_to(h[:, None], c[:, 0].shape)
    moments = [np.zeros_like(u), u]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        if order == 0:
            spread = np.sqrt(c[:, 2] ** 2 - 3 * c[:, 3] * c[:, 1])
            # Both roots by the sum that doesn't cancel: c3 may be next to nothing.
            stable = -(c[:, 2] + np.copysign(spread, c[:, 2]))
            moments += [stable / (3 * c[:, 3]), c[:, 1] / stable]
        elif order == 1:
            moments.append(-c[:, 2] / (3 * c[:, 3]))
        m = np.array(moments)
        found = values(c, np.clip(np.where(np.isfinite(m), m, 0.0), 0.0, u), order)
    return found.min(0), found.max(0)


def _highest(a: Array, h: Array, order: int) -> Array:
    """Highest value on [0, h], (m, n), by a grid and its refinement."""
    K = a.shape[1]
    # Closer together at both ends, where polynomials of a high degree turn most.
    share = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, _GRID * K + 1))
    scaled = a * h[:, None, None] ** np.arange(K)[:, None]
    basis = np.array([[perm(k, order) * x ** (k - order) if k >= order else 0.0 for k in range(K)] for x in share])
    at = np.argmax(basis @ scaled, 1)
    best = share[at]
    gaps = np.diff(share)
    width = np.maximum(np.append(gaps, 0.0)[at], np.insert(gaps, 0, 0.0)[at])
    near = np.linspace(-1.0, 1.0, 9)[:, None, None]
    x = best
    for _ in range(_ZOOMS):
        places = np.clip(x + width * near, 0.0, 1.0)
        place = np.argmax(values(a, places * h[:, None], order), 0)[None]
        x = np.take_along_axis(places, place, 0)[0]
        width = 0.25 * width
    highest: Array = values(a, x * h[:, None], order)
    u, room = x * h[:, None], width * h[:, None]
    low, high = np.maximum(u - room, 0.0), np.minimum(u + room, h[:, None])
    for _ in range(_STEPS):
        slope, bend = values(a, u, order + 1), values(a, u, order + 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.where(bend < 0, slope / bend, 0.0)
        u = np.clip(u - step, low, high)
        highest = np.maximum(highest, values(a, u, order))
    return highest
