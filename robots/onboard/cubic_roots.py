"""Real roots of a cubic, in closed form."""

from __future__ import annotations

import math

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
