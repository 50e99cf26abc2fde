"""The certificate that a plan keeps the limits at every instant, for polynomials of degree 31 or less.

A polynomial lies within the hull of its Bernstein coefficients. Where the hulls keep the limits, that is the
proof. Where one doesn't, degrees up to 3 are decided by their exact extremes, higher ones by halving the piece
until its hull keeps the limits or an end of a half passes one.
Source: Farouki and Rajan, Algorithms for polynomials in Bernstein form, 1988.

What it needs of a robot's limits again and again is made once for each `Limits` value.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from vrs.errors import PlanningError
from vrs.model import Array, Limits
from vrs.planning.plan import Plan

TOLERANCE = 5e-10
"""Relative overshoot that a certificate lets pass: rounding, half of what the laws allow."""


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """Limits as plain floats: for six joints these are several times quicker than arrays."""

    qd_max: tuple[float, ...]
    """[rad/s]."""
    qdd_max: tuple[float, ...]
    """[rad/s²]."""
    qddd_max: tuple[float, ...]
    """[rad/s³]."""
    lowest: tuple[float, ...]
    """q_min [rad], less the tolerance."""
    highest: tuple[float, ...]
    """q_max [rad] and the tolerance."""
    slack: tuple[Array, Array]
    """What a tolerance is relative to at q_min and at q_max [rad], (n,) each, at least 1."""

    def check_inside(self, q: list[float]) -> None:
        """Raise PlanningError unless q [rad] lies within the position limits."""
        for j, value in enumerate(q):
            if not self.lowest[j] <= value <= self.highest[j]:
                raise PlanningError(f"joint {j + 1} would pass its position limit")


@lru_cache(maxsize=64)
def bounds(limits: Limits) -> Bounds:
    """The bounds of limits, which are compared by identity."""
    at_low, at_high = abs(limits.q_min).clip(1.0), abs(limits.q_max).clip(1.0)
    return Bounds(
        tuple(limits.qd_max.tolist()),
        tuple(limits.qdd_max.tolist()),
        tuple(limits.qddd_max.tolist()),
        tuple((limits.q_min - TOLERANCE * at_low).tolist()),
        tuple((limits.q_max + TOLERANCE * at_high).tolist()),
        (at_low, at_high),
    )


MAX_DEGREE = 31
"""Of a piece that can be certified."""

_LET_PASS = 9e-10
"""Relative overshoot of a hull that halving lets pass."""
_PASSED = 6e-10
"""Relative overshoot of a point that halving refuses; far enough below _LET_PASS to come to an end."""
_NOISE = 1e-10
"""Largest relative rounding error that leaves both figures true."""
HALVINGS = 60
"""After which a piece is as short as rounding; the gap between the figures above ends it long before."""
_NAMES = ("position", "speed", "acceleration", "jerk")


class Violation(NamedTuple):
    """A limit that a plan passes, or may pass."""

    text: str
    derivative: int | None = None
    """Of which derivative, 0 for the position; None where the plan can't be certified at all."""


def violation(plan: Plan, limits: Limits, *, jerk: bool) -> str | None:
    """Say in words what `find_violation` finds."""
    found = find_violation(plan, limits, jerk=jerk)
    return None if found is None else found.text


def find_violation(plan: Plan, limits: Limits, *, jerk: bool) -> Violation | None:
    """Find which limit a plan passes, at any instant; None if it keeps them all.

    An overshoot of 5e-10 or less, relative to the limit (for positions to 1 rad, where that is more), passes; one
    of 1e-9 or more never does.

    Args:
        plan: What to certify, of degree 31 or less.
        limits: Position, speed, acceleration and, if asked for, jerk limits.
        jerk: Whether the jerk limits bind.
    """
    h, a = plan.durations, plan.coefficients
    if len(h) == 0:
        return None
    degree = a.shape[1] - 1
    if degree > MAX_DEGREE:
        return Violation(f"a plan of degree {degree} can't be certified: {MAX_DEGREE} is the highest")
    form, box = _form(degree, 4 if jerk else 3), _box(limits, degree, 4 if jerk else 3)
    with np.errstate(invalid="ignore", over="ignore", under="ignore"):
        c = _shares(a, h, form)
        hull = (form.matrix @ c.reshape(len(c), -1)).reshape(c.shape)
        hidden = None
        if degree > 3 and _noise(c, form, box):
            exact = _shares(a.astype(np.longdouble), h.astype(np.longdouble), form)
            hidden = _noise(exact, form, box)
            hull = (form.precise @ exact.reshape(len(c), -1)).reshape(c.shape).astype(np.float64)
        distance = hull - box.middle
        inside = np.abs(distance, out=distance) <= box.half
    if inside.all() and min(h.tolist()) > 0 and not hidden:
        return None
    if not np.isfinite(a).all() or not np.isfinite(h).all() or not (h > 0).all():
        return Violation("the plan isn't finite")
    if degree <= 3:
        doubtful = ~inside.all(axis=(0, 2))
        return _exact(a[doubtful], h[doubtful, None], limits, jerk)
    return hidden or _halved(hull, inside, form, box)


class _Form(NamedTuple):
    """How the coefficients of one degree become those of Bernstein, position to jerk one below the other."""

    source: NDArray[np.int64]
    """Which power of the polynomial each row starts from."""
    exponents: Array
    """0 to the degree, (degree + 1, 1)."""
    powers: NDArray[np.int64]
    """Which power of the duration each row is multiplied by."""
    matrix: Array
    """Block-diagonal: factors of differentiation and change of basis, none negative."""
    precise: NDArray[np.longdouble]
    """The same, of more digits."""
    first: tuple[int, ...]
    """Where the rows of each derivative begin, and the end."""


@lru_cache(maxsize=2 * MAX_DEGREE + 2)
def _form(degree: int, orders: int) -> _Form:
    first = [0]
    for order in range(orders):
        first.append(first[-1] + max(degree - order, 0) + 1)
    rows = first[-1]
    source, powers = np.zeros((2, rows), dtype=np.int64)
    precise = np.zeros((rows, rows), dtype=np.longdouble)
    for order in range(min(degree + 1, orders)):
        n, begin = degree - order, first[order]
        block = slice(begin, begin + n + 1)
        source[block] = np.arange(order, degree + 1)
        powers[block] = np.arange(n + 1)
        for i in range(n + 1):
            for k in range(i + 1):
                factor = math.comb(i, k) * math.perm(k + order, order)
                precise[begin + i, begin + k] = np.longdouble(factor) / math.comb(n, k)
    exponents = np.arange(degree + 1.0)[:, None]
    return _Form(source, exponents, powers, precise.astype(np.float64), precise, tuple(first))


class _Box(NamedTuple):
    """Limits of each row of a form, (rows, 1, n)."""

    middle: Array
    half: Array
    """With the tolerance."""
    low: Array
    high: Array
    low_scale: Array
    """What an overshoot is relative to."""
    high_scale: Array
    scale: Array
    """The smaller of them, (rows, n)."""


@lru_cache(maxsize=64)
def _box(limits: Limits, degree: int, orders: int) -> _Box:
    rows = np.diff(_form(degree, orders).first)
    ends = (limits.qd_max, limits.qdd_max, limits.qddd_max)[: orders - 1]

    def spread(position: Array, *others: Array) -> Array:
        return np.repeat(np.array([position, *others]), rows, axis=0)[:, None, :]

    low, high = spread(limits.q_min, *(-end for end in ends)), spread(limits.q_max, *ends)
    low_scale = spread(np.abs(limits.q_min).clip(1.0), *ends)
    high_scale = spread(np.abs(limits.q_max).clip(1.0), *ends)
    bottom, top = low - TOLERANCE * low_scale, high + TOLERANCE * high_scale
    scale = np.minimum(low_scale, high_scale)[:, 0]
    return _Box(0.5 * (bottom + top), 0.5 * (top - bottom), low, high, low_scale, high_scale, scale)


_Real = TypeVar("_Real", np.float64, np.longdouble)


def _shares(a: NDArray[_Real], h: NDArray[_Real], form: _Form) -> NDArray[_Real]:
    """Position to jerk as ascending powers of the share of each piece: (rows, m, n)."""
    c = a.swapaxes(0, 1).take(form.source, axis=0)
    c *= (h**form.exponents).take(form.powers, axis=0)[:, :, None]
    return c


def _noise(c: NDArray[_Real], form: _Form, box: _Box) -> Violation | None:
    """Find where cancellation of large coefficients hides more than the tolerances."""
    # A sum of products of rounded factors, by Higham's bound.
    share = (len(form.exponents) + 4) * float(np.finfo(c.dtype).eps) / 2.0
    error = share * (form.matrix @ np.abs(c).max(axis=1).astype(np.float64)) / box.scale
    if not error.max() > _NOISE:
        return None
    row, joint = np.unravel_index(int(np.argmax(error)), error.shape)
    order = int(np.searchsorted(form.first, row, side="right")) - 1
    return Violation(f"joint {joint + 1}: rounding hides whether its {_NAMES[order]} limit is kept", order)


def _halved(hull: Array, inside: NDArray[np.bool_], form: _Form, box: _Box) -> Violation | None:
    """Decide by de Casteljau's halving what the hulls of whole pieces left open."""
    for order in range(len(form.first) - 1):
        rows = slice(form.first[order], form.first[order + 1])
        segments, joints = np.nonzero(~inside[rows].all(axis=0))
        if len(joints) == 0:
            continue
        one = rows.start
        low, high = box.low[one, 0], box.high[one, 0]
        low_scale, high_scale = box.low_scale[one, 0], box.high_scale[one, 0]
        control = hull[rows, segments, joints].T
        left, right = _halves(control.shape[1] - 1)
        for _ in range(HALVINGS):
            if len(control) == 0:
                break
            above = (control - high[joints, None]) / high_scale[joints, None]
            below = (low[joints, None] - control) / low_scale[joints, None]
            over = np.maximum(above, below)
            at_ends = np.maximum(over[:, 0], over[:, -1])
            worst = int(np.argmax(at_ends))
            if at_ends[worst] > _PASSED:
                return Violation(f"joint {joints[worst] + 1} would pass its {_NAMES[order]} limit", order)
            open_ = over.max(axis=1) > _LET_PASS
            control, joints = control[open_], joints[open_]
            control = np.concatenate([control @ left.T, control @ right.T])
            joints = np.concatenate([joints, joints])
        else:
            return Violation(
                f"joint {joints[0] + 1}: can't decide whether its {_NAMES[order]} limit is kept", order
            )
    return None


@lru_cache(maxsize=MAX_DEGREE + 1)
def _halves(degree: int) -> tuple[Array, Array]:
    """Matrices that make the Bernstein coefficients of both halves."""
    left = np.array([[math.comb(i, k) * 0.5**i for k in range(degree + 1)] for i in range(degree + 1)])
    return left, left[::-1, ::-1].copy()


def _exact(a: Array, h: Array, limits: Limits, jerk: bool) -> Violation | None:
    """Degree 3 or less: positions at the roots of the velocity, velocities at the roots of the acceleration."""
    c0, c1, c2, c3 = (a[:, k] if k < a.shape[1] else np.zeros_like(a[:, 0]) for k in range(4))
    zero = np.zeros_like(c0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        flat = -c2 / (3.0 * c3)
        root = np.sqrt(c2 * c2 - 3.0 * c1 * c3)
        # The stable pair of roots of c1 + 2 c2 u + 3 c3 u²; it covers c3 = 0 too.
        big = -(c2 + np.copysign(root, c2))
        turns = np.stack([big / (3.0 * c3), c1 / big, zero, zero + h])
        flats = np.stack([flat, zero, zero + h])
    turns = np.clip(np.where(np.isfinite(turns), turns, 0.0), 0.0, h)
    flats = np.clip(np.where(np.isfinite(flats), flats, 0.0), 0.0, h)
    q = c0 + turns * (c1 + turns * (c2 + turns * c3))
    qd = np.abs(c1 + flats * (2.0 * c2 + flats * 3.0 * c3))
    qdd = np.maximum(np.abs(2.0 * c2), np.abs(2.0 * c2 + 6.0 * h * c3))
    over = [
        (0, (q - limits.q_max).max((0, 1)) / np.maximum(1.0, np.abs(limits.q_max))),
        (0, (limits.q_min - q).max((0, 1)) / np.maximum(1.0, np.abs(limits.q_min))),
        (1, qd.max((0, 1)) / limits.qd_max - 1.0),
        (2, qdd.max(0) / limits.qdd_max - 1.0),
    ]
    if jerk:
        over.append((3, np.abs(6.0 * c3).max(0) / limits.qddd_max - 1.0))
    for order, excess in over:
        if excess.max() > TOLERANCE:
            return Violation(f"joint {int(np.argmax(excess)) + 1} would pass its {_NAMES[order]} limit", order)
    return None
