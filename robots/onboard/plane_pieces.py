"""Polynomial pieces in the plane, as arrays and one by one: splines, their derivatives, their nearest points.

A piece is (degree + 1, 2): coefficients of x and y [m] in ascending powers of a parameter u from 0 to 1. The
real roots of a cubic are in closed form.
"""

from __future__ import annotations

import math

import numpy as np

from vrs.model import Array

_TINY = 1e-12
"""A leading coefficient smaller than this share of the largest counts as 0."""
_NEAR = 1e-4
"""The closed form isn't off by more than this, as a share of the roots' size: further away is another root."""
_TWINS = 1e-9
"""Two roots that aren't real by no more than this, as a share of the third one's square, count as one."""
_ROUNDED = 1e-14
"""And those by no more than this times the cube of all roots' mean over the third one: rounding does as much."""


def real_roots(a: float, b: float, c: float, d: float) -> list[float]:
    """Return the real roots of a x³ + b x² + c x + d, in no order; none of a constant.

    Source: Cardano for the root that is farthest from the others, with Viète's cosine where there are three; the
    others are those of the quadratic that is left.
    """
    largest = max(abs(a), abs(b), abs(c), abs(d))
    if abs(a) <= _TINY * largest:
        return _quadratic_roots(b, c, d, largest)
    b, c, d = b / a, c / a, d / a
    # With x = t − b/3 the square goes: t³ + p t + q.
    shift = b / 3
    p, q = c - b * shift, 2 * shift**3 - shift * c + d
    t = _farthest(p, q)
    near = _NEAR * (abs(t) + abs(shift))
    root = _polished(t - shift, near, b, c, d)
    inside = -3 * t * t - 4 * p
    if inside < -_TWINS * t * t - _ROUNDED * abs(shift) ** 3 / max(abs(t), 1e-300):
        return [root]
    half = 0.5 * math.sqrt(max(inside, 0.0))
    return [root, *(_polished(-0.5 * t + side - shift, near, b, c, d) for side in (half, -half))]


def _farthest(p: float, q: float) -> float:
    """The real root of t³ + p t + q that is largest in size; of a pair that is complex, the other."""
    half, third = 0.5 * q, p / 3
    inside = half * half + third**3
    if inside > 0:
        found = math.cbrt(abs(half) + math.sqrt(inside))
        return math.copysign(found - third / found, -half)
    size = math.sqrt(max(-third, 0.0))
    cube = size**3
    if cube == 0:
        return 0.0
    return math.copysign(2 * size * math.cos(math.acos(min(abs(half) / cube, 1.0)) / 3), -half)


def _polished(x: float, near: float, b: float, c: float, d: float) -> float:
    """A step of Newton's method nearer to a root, if it is one and near by: the closed form cancels."""
    slope = (3 * x + 2 * b) * x + c
    value = ((x + b) * x + c) * x + d
    moved = x - value / slope if slope else x
    nearer = abs(((moved + b) * moved + c) * moved + d) < abs(value)
    return moved if nearer and abs(moved - x) <= near else x


def _quadratic_roots(a: float, b: float, c: float, largest: float) -> list[float]:
    if abs(a) <= _TINY * largest:
        return [-c / b] if abs(b) > _TINY * largest else []
    inside = b * b - 4 * a * c
    if inside < 0:
        return []
    far = -0.5 * (b + math.copysign(math.sqrt(inside), b))
    return [far / a, c / far] if far else [0.0]


_NEWTON = 8
"""Most steps to the nearest point of a cubic piece."""
_CLOSE = 1e-14
"""Change of the parameter that ends them."""


def cubic(points: Array) -> Array:
    """Coefficients of a natural cubic spline by chord length, (k − 1, 4, 2), ascending in u from 0 to 1."""
    h = np.hypot(*np.diff(points, axis=0).T)
    slope = np.diff(points, axis=0) / h[:, None]
    bend = np.zeros_like(points)
    if len(points) > 2:
        bend[1:-1] = _tridiagonal(h, 6.0 * np.diff(slope, axis=0))
    h = h[:, None]
    tangent = slope - h * (2 * bend[:-1] + bend[1:]) / 6
    return np.stack([points[:-1], h * tangent, h * h * bend[:-1] / 2, h * h * np.diff(bend, axis=0) / 6], 1)


def _tridiagonal(h: Array, right: Array) -> Array:
    """Second derivatives at the inner points of a natural spline with chords h. Source: Thomas's algorithm."""
    n = len(right)
    diagonal, over = 2.0 * (h[:-1] + h[1:]), h[1:-1]
    share, made = np.zeros(n), np.array(right)
    for k in range(n):
        below = over[k - 1] if k else 0.0
        pivot = diagonal[k] - below * (share[k - 1] if k else 0.0)
        share[k] = over[k] / pivot if k < n - 1 else 0.0
        made[k] = (right[k] - (below * made[k - 1] if k else 0.0)) / pivot
    for k in range(n - 2, -1, -1):
        made[k] -= share[k] * made[k + 1]
    return made


def quadratic(points: Array) -> Array:
    """Coefficients of a quadratic B-spline, (max(k − 2, 1), 3, 2), ascending in u from 0 to 1."""
    if len(points) == 2:
        points = np.array([points[0], points.mean(axis=0), points[1]])
    middles = 0.5 * (points[:-1] + points[1:])
    knots = np.concatenate([points[:1], middles[1:-1], points[-1:]])
    start, control, end = knots[:-1], points[1:-1], knots[1:]
    return np.stack([start, 2 * (control - start), start - 2 * control + end], 1)


def rough_length(piece: Array) -> float:
    """Length of a piece [m], by eight chords."""
    at = evaluated(np.broadcast_to(piece, (9, *piece.shape)), np.linspace(0.0, 1.0, 9))[0]
    return float(np.hypot(*np.diff(at, axis=0).T).sum())


def evaluated(pieces: Array, u: Array) -> tuple[Array, Array, Array]:
    """Places and their first two derivatives, (k, 2) each, of pieces (k, degree + 1, 2) at u (k,)."""
    degree = pieces.shape[-2] - 1
    powers = u[:, None] ** np.arange(degree + 1)
    k = np.arange(1, degree + 1, dtype=np.float64)
    first = pieces[:, 1:] * k[:, None]
    second = first[:, 1:] * k[:-1, None]
    return tuple(np.einsum("kj,kjd->kd", powers[:, : rows.shape[1]], rows) for rows in (pieces, first, second))


def speed(pieces: Array, u: Array) -> Array:
    """|dp/du| at u (k, m) of pieces (k, degree + 1, 2), (k, m)."""
    pieces = pieces.reshape(len(u), -1, 2)
    k = np.arange(1, pieces.shape[1], dtype=np.float64)
    powers = u[..., None] ** (k - 1)
    velocity = np.einsum("kmj,kjd->kmd", powers, pieces[:, 1:] * k[:, None])
    speed: Array = np.hypot(velocity[..., 0], velocity[..., 1])
    return speed


def derivatives(rows: list[list[float]], u: float) -> tuple[tuple[float, float], ...]:
    """Place, first and second derivative of a piece."""
    (ax, ay), (bx, by), (cx, cy) = rows[:3]
    dx, dy = rows[3] if len(rows) == 4 else (0.0, 0.0)
    return (
        (ax + u * (bx + u * (cx + u * dx)), ay + u * (by + u * (cy + u * dy))),
        (bx + u * (2 * cx + 3 * u * dx), by + u * (2 * cy + 3 * u * dy)),
        (2 * cx + 6 * u * dx, 2 * cy + 6 * u * dy),
    )


def squared(rows: list[list[float]], u: float, x: float, y: float) -> float:
    """Squared distance of a piece at u from (x, y) [m²]."""
    at = derivatives(rows, u)[0]
    return (at[0] - x) ** 2 + (at[1] - y) ** 2


def quadratic_nearest(rows: list[list[float]], x: float, y: float) -> list[float]:
    """Where the distance to a quadratic piece is stationary: the roots of a cubic."""
    (ax, ay), (bx, by), (cx, cy) = rows
    px, py = ax - x, ay - y
    return real_roots(
        2 * (cx * cx + cy * cy),
        3 * (bx * cx + by * cy),
        bx * bx + by * by + 2 * (px * cx + py * cy),
        px * bx + py * by,
    )


def cubic_nearest(rows: list[list[float]], x: float, y: float, low: float, high: float) -> list[float]:
    """Where the distance to a cubic piece is stationary between two parameters, by Newton's method."""
    u = 0.5 * (low + high)
    for _ in range(_NEWTON):
        (px, py), (dx, dy), (ddx, ddy) = derivatives(rows, u)
        ex, ey = px - x, py - y
        slope = dx * dx + dy * dy + ex * ddx + ey * ddy
        if slope <= 0:
            break
        moved = min(max(u - (ex * dx + ey * dy) / slope, low), high)
        if abs(moved - u) < _CLOSE:
            break
        u = moved
    return [u]
