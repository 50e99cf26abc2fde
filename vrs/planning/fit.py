"""Polynomials of a smooth motion: few pieces that share position, speed and acceleration at their ends."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from vrs.errors import PlanningError
from vrs.model import Array
from vrs.planning.plan import Plan

Motion: TypeAlias = Callable[[Array], tuple[Array, Array, Array]]
"""Times (k,) [s] to q, qd, qdd, each (k, n)."""
Parts: TypeAlias = Callable[[NDArray[np.intp], Array], tuple[Array, Array, Array]]
"""Parts (k,) and times since their starts (k,) [s] to q, qd, qdd, each (k, n)."""

DEGREES: Final = (5, 7, 9, 12)
"""Degrees to try, the lowest that does is taken."""
SAMPLES: Final = 15
"""Times within a piece at which the motion is asked for: enough to fit the highest degree and to judge it."""
HALVINGS_MAX: Final = 16
"""How often a piece may be halved."""

NODES: Final[Array] = 0.5 - 0.5 * np.cos(np.pi * (np.arange(SAMPLES) + 0.5) / SAMPLES)
"""Those times, as shares of the piece's duration: Chebyshev points, (15,)."""


@cache
def _maps(degree: int) -> tuple[Array, Array]:
    """What a degree makes of a piece's deviation from the parabola of its start, as two matrices.

    The first leads from end deviation, speed, acceleration and samples, (18,), to the powers from 3 on,
    (degree - 2, 18); the second from the same to what's left at the samples, (15, 18).
    """
    from numpy.polynomial import chebyshev, polynomial

    # A quintic takes the three end conditions; (4 u (1 - u))³ times a series is what leaves all six alone.
    ends = np.array([[10.0, -4.0, 0.5], [-15.0, 7.0, -1.0], [6.0, -3.0, 0.5]])
    powers = NODES[:, None] ** np.arange(3, degree + 1)
    quintic = np.zeros((degree - 2, 3))
    quintic[:3] = ends
    coefficients = np.hstack([quintic, np.zeros((degree - 2, SAMPLES))])
    order = degree - 5
    if order > 0:
        window = (4.0 * NODES * (1.0 - NODES)) ** 3
        basis = window[:, None] * chebyshev.chebvander(2.0 * NODES - 1.0, order - 1)
        solve = np.linalg.pinv(basis) @ np.hstack([-powers @ quintic, np.eye(SAMPLES)])
        bump = polynomial.polypow([0.0, 4.0, -4.0], 3)
        for j in range(order):
            series = polynomial.Polynomial([0.0])
            for k, factor in enumerate(chebyshev.cheb2poly([0.0] * j + [1.0])):
                series = series + factor * polynomial.Polynomial([-1.0, 2.0]) ** k
            term = polynomial.polymul(bump, series.coef)[3:]
            coefficients[: len(term)] += np.outer(term, solve[j])
    residual = powers @ coefficients
    residual[:, 3:] -= np.eye(SAMPLES)
    return coefficients, residual


def pieces(
    h: Array, start: tuple[Array, Array, Array], end: tuple[Array, Array, Array], samples: Array, tolerance: float
) -> tuple[Array, Array]:
    """Fit one polynomial each to m pieces of a motion.

    Args:
        h: Durations [s], (m,).
        start: q, qd, qdd at the starts, each (m, n); met to the bit.
        end: The same at the ends, met to rounding.
        samples: q at NODES, (m, 15, n).
        tolerance: Largest deviation at the samples.

    Returns:
        Coefficients in ascending powers of the time since each start, (m, 13, n), of the lowest degree that does,
        and the deviations that they leave, (m,).
    """
    m, n = start[0].shape
    width = h[:, None]
    q0, v0, a0 = start[0], start[1] * width, 0.5 * start[2] * width * width
    u = NODES[:, None]
    data = np.empty((m, 3 + SAMPLES, n))
    data[:, 0] = end[0] - (q0 + v0 + a0)
    data[:, 1] = end[1] * width - (v0 + 2.0 * a0)
    data[:, 2] = end[2] * width * width - 2.0 * a0
    data[:, 3:] = samples - (q0[:, None] + u * (v0[:, None] + u * a0[:, None]))
    a = np.zeros((m, DEGREES[-1] + 1, n))
    left = np.full(m, np.inf)
    for degree in DEGREES:
        open_ = np.flatnonzero(~(left <= tolerance))
        if len(open_) == 0:
            break
        coefficients, residual = _maps(degree)
        given = data[open_]
        left[open_] = np.abs(residual @ given).max((1, 2))
        a[open_, 3 : degree + 1] = coefficients @ given
    _meet(a, data)
    scale = width[:, None] ** np.arange(a.shape[1])[None, :, None]
    a /= scale
    a[:, 0], a[:, 1], a[:, 2] = start[0], start[1], 0.5 * start[2]
    return a, left


def _meet(a: Array, data: Array) -> None:
    """Correct the powers 3 to 5, in place, so that the end conditions are met to rounding."""
    k = np.arange(3.0, a.shape[1])[:, None]
    high = a[:, 3:]
    e0 = data[:, 0] - high.sum(1)
    e1 = data[:, 1] - (k * high).sum(1)
    e2 = data[:, 2] - (k * (k - 1.0) * high).sum(1)
    a[:, 3] += 10.0 * e0 - 4.0 * e1 + 0.5 * e2
    a[:, 4] += -15.0 * e0 + 7.0 * e1 - e2
    a[:, 5] += 6.0 * e0 - 3.0 * e1 + 0.5 * e2


def fit(function: Motion, knots: Array, tolerance: float = 1e-10) -> Plan:
    """Turn a smooth motion into polynomial pieces of degree 12 or less.

    Pieces share q, qd and qdd at their ends; the first begins with the motion's q, qd and qdd to the bit. Pieces
    that don't fit are halved.

    Args:
        function: The motion: times (k,) [s] to q, qd, qdd, each (k, n). It must be smooth between knots.
        knots: Times [s], (m + 1,), strictly increasing; where a derivative of the motion jumps, there's a knot.
        tolerance: Largest deviation of q from the motion [rad], at least 1e-13; judged at 15 times a piece.

    Returns:
        The plan, its pieces between the knots or halves of such.

    Raises:
        PlanningError: If pieces don't fit after HALVINGS_MAX halvings.
    """
    knots = np.asarray(knots, dtype=np.float64)
    return fit_parts(lambda part, u: function(knots[part] + u), np.diff(knots), tolerance)


def fit_parts(function: Parts, durations: Array, tolerance: float = 1e-10) -> Plan:
    """Turn a motion that is given part by part into polynomial pieces, as `fit` does.

    Args:
        function: Parts (k,) and times since their starts (k,) [s] to q, qd, qdd, each (k, n). What it says of
            the end of one part and of the start of the next may differ, as where the acceleration jumps.
        durations: Of the parts [s], (m,), positive.
        tolerance: Largest deviation of q from the motion [rad].

    Raises:
        PlanningError: If pieces don't fit after HALVINGS_MAX halvings.
    """
    part = np.arange(len(durations))
    low, high = np.zeros(len(durations)), np.asarray(durations, dtype=np.float64)
    done: list[tuple[NDArray[Any], ...]] = []
    for _ in range(HALVINGS_MAX + 1):
        m, h = len(part), high - low
        u = np.concatenate([low, high, (low[:, None] + h[:, None] * NODES).ravel()])
        q, qd, qdd = function(np.concatenate([part, part, np.repeat(part, SAMPLES)]), u)
        start, end = (q[:m], qd[:m], qdd[:m]), (q[m : 2 * m], qd[m : 2 * m], qdd[m : 2 * m])
        a, left = pieces(h, start, end, q[2 * m :].reshape(m, SAMPLES, -1), tolerance)
        good = left <= tolerance
        done.append((part[good], low[good], h[good], a[good]))
        if good.all():
            break
        part, low, high = part[~good], low[~good], high[~good]
        middle = 0.5 * (low + high)
        part, low, high = np.repeat(part, 2), _in_turn(low, middle), _in_turn(middle, high)
    else:
        when = float(np.sum(durations[: part[0]]) + low[0])
        raise PlanningError(
            f"the motion {when:.6g} s after its start can't be put into polynomials to {tolerance:g}"
        )
    parts, lows, h, a = (np.concatenate(values) for values in zip(*done, strict=True))
    order = np.lexsort((lows, parts))
    a = a[order]
    used = np.flatnonzero(a.any((0, 2)))
    return Plan(h[order], a[:, : int(used[-1]) + 1 if len(used) else 1])


def _in_turn(x: Array, y: Array) -> Array:
    """Elements of x and y in turn."""
    both: Array = np.stack([x, y], axis=1).ravel()
    return both
