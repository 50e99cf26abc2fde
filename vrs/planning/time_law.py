"""When the parameter of a path is where: the fastest law within the limits, and a smooth one made of it.

Between knots the square of the parameter's speed is linear in the parameter, so its acceleration is constant
there and the law is a parabola of time. Source: Pham, Pham, "A new approach to time-optimal path parameterization
based on reachability analysis", IEEE T-RO 34(3), 2018; here the limits hold at many samples of each interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vrs.errors import PlanningError
from vrs.model import Array

_STEEP: Final = 1e-9
_ROUNDS: Final = 60


@dataclass(frozen=True, slots=True, eq=False)
class TimeLaw:
    """A parameter over time, piece by piece."""

    durations: Array
    """[s], (m,), positive."""
    coefficients: Array
    """(m, 4), ascending powers of the time since each piece's start."""
    smooth: bool = False
    """Whether its acceleration is continuous."""

    @property
    def duration(self) -> float:
        """Of the whole [s]."""
        return float(self.durations.sum())

    def value(self, part: NDArray[np.intp], u: Array) -> Array:
        """The parameter and its first three derivatives, (4, k), at times u (k,) [s] of pieces (k,)."""
        a, b, c, d = self.coefficients[part].T
        d3 = 3.0 * d
        growth = c + d3 * u
        return np.array(
            [a + u * (b + u * (c + u * d)), b + u * (c + growth), 2.0 * growth, 2.0 * d3],
        )


def fastest(
    s: Array, knots: NDArray[np.intp], first: Array, second: Array, acceleration: Array, cap: Array, start: float
) -> Array:
    """The fastest law on a path that ends at rest.

    Args:
        s: Parameters of the samples, (k,), increasing.
        knots: Which samples are knots, (m + 1,), the first and the last among them.
        first: q' at the samples, (k, n).
        second: q'' at the samples, (k, n).
        acceleration: Largest acceleration [rad/s²], (n,).
        cap: Largest square of the parameter's speed at the samples, (k,). A law of few knots needs that of many
            for a cap: speed gained too early has to be paid for dearly.
        start: Square of its speed at the beginning.

    Returns:
        The square of its speed at the knots, (m + 1,).

    Raises:
        PlanningError: If the limits can't be kept from this start.
    """
    rows = _rows(s, knots, first / acceleration, second / acceleration, cap)
    m = len(rows)
    most = np.empty(m + 1)
    most[m] = 0.0
    for k in range(m - 1, -1, -1):
        most[k] = _largest(*rows[k], float(cap[knots[k]]), float(most[k + 1]))
    if start > most[0] * (1.0 + 1e-9):
        raise PlanningError("the arm is too fast to stay on the path")
    best = np.empty(m + 1)
    best[0] = start
    for k, (p, g) in enumerate(rows):
        best[k + 1] = max(min(float((p - g * best[k]).min()), most[k + 1]), 0.0)
    if not (best[1:-1] > 0).all():
        raise PlanningError("the arm can't go on along the path")
    return best


def few_knots(s: Array, squares: Array, marks: NDArray[np.intp], tolerance: float) -> NDArray[np.intp]:
    """Choose knots between which squares of speed are nearly linear.

    Args:
        s: Parameters, (k,).
        squares: Squares of the parameter's speed there, (k,).
        marks: Indices that are knots anyway, the first and the last among them.
        tolerance: Largest deviation, as a share of the square.
    """
    kept, open_ = [0], [(int(i), int(j)) for i, j in pairwise(marks)][::-1]
    while open_:
        i, j = open_.pop()
        if j > i + 1:
            inner = slice(i + 1, j)
            line = squares[i] + (squares[j] - squares[i]) / (s[j] - s[i]) * (s[inner] - s[i])
            error = np.abs(line - squares[inner]) / (squares[inner] + 1e-9 * squares.max())
            k = int(error.argmax())
            if error[k] > tolerance:
                open_ += [(i + 1 + k, j), (i, i + 1 + k)]
                continue
        kept.append(j)
    return np.array(kept)


def _rows(s: Array, knots: NDArray[np.intp], first: Array, second: Array, cap: Array) -> list[tuple[Array, Array]]:
    """Limits of each interval as (p, g): with x and y the squares at its ends, |y + g x| <= p."""
    counts = np.diff(knots) + 1
    which = np.repeat(np.arange(len(counts)), counts)
    offset = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    at = knots[which] + offset
    width = (s[knots[1:]] - s[knots[:-1]])[which]
    share = ((s[at] - s[knots[which]]) / width)[:, None]
    bend, slope = second[at], first[at] / (2.0 * width)[:, None]
    # The cap at an interval's first knot bounds x itself, not a row of both.
    A = np.hstack([bend * (1.0 - share) - slope, np.where(share > 0, 1.0 - share, 0.0) / cap[at][:, None]])
    B = np.hstack([bend * share + slope, share / cap[at][:, None]])
    sign = np.where(B < 0, -1.0, 1.0)
    B = np.maximum(np.abs(B), _STEEP)
    p, g = 1.0 / B, sign * A / B
    ends = np.cumsum(counts)
    return [(p[b - c : b].ravel(), g[b - c : b].ravel()) for b, c in zip(ends, counts, strict=True)]


def _largest(p: Array, g: Array, x: float, top: float) -> float:
    """The largest x from which some y in [0, top] keeps |y + g x| <= p; Newton's method, from above."""
    for _ in range(_ROUNDS):
        way = g * x
        room, depth = p - way, p + way
        i, j = int(room.argmin()), int(depth.argmin())
        upper, lower = room.item(i), -depth.item(j)
        high, fall = (top, 0.0) if top <= upper else (upper, g.item(i))
        low, rise = (0.0, 0.0) if lower <= 0.0 else (lower, -g.item(j))
        excess, slope = low - high, rise + fall
        if excess <= 1e-13 * (high + top) or slope <= 0.0:
            break
        x = max(x - excess / slope, 0.0)
    return x


def parabolas(s: Array, squares: Array) -> TimeLaw:
    """The law of squares of speed at knots s, (m + 1,) each."""
    speed = np.sqrt(squares)
    h = 2.0 * np.diff(s) / (speed[:-1] + speed[1:])
    half = 0.25 * np.diff(squares) / np.diff(s)
    return TimeLaw(h, np.stack([s[:-1], speed[:-1], half, np.zeros_like(half)], axis=1))


def smoothed(law: TimeLaw, width: float) -> TimeLaw:
    """The moving average of a law that ends at rest over a time [s]: cubic pieces, continuous acceleration.

    A law that begins at a speed must keep it for half that time; it's then begun there and at that speed.
    """
    h, a = law.durations, law.coefficients
    t = np.concatenate([[0.0], np.cumsum(h)])
    end = float(a[-1, 0] + h[-1] * (a[-1, 1] + h[-1] * a[-1, 2]))
    # The integral of the parameter up to the knots: what the average's parameter is made of.
    area = np.concatenate([[0.0], np.cumsum(h * (a[:, 0] + h * (a[:, 1] / 2.0 + h * a[:, 2] / 3.0)))])

    def integrals(x: Array) -> Array:
        """Area under the law, the law and its speed, (3, k)."""
        i = np.searchsorted(t[1:-1], x, side="right")
        u = np.minimum(x - t[i], h[i])
        c = a[i].T
        before = u < 0.0
        c[2, before] = 0.0
        s = np.array(
            [
                area[i] + u * (c[0] + u * (c[1] / 2.0 + u * c[2] / 3.0)),
                c[0] + u * (c[1] + u * c[2]),
                c[1] + 2.0 * u * c[2],
            ]
        )
        over = x >= t[-1]
        s[0, over], s[1, over], s[2, over] = area[-1] + end * (x[over] - t[-1]), end, 0.0
        return s

    begin = 0.5 * width if a[0, 1] else 0.0
    knots = np.sort(np.concatenate([t, t + width, [begin]]))
    knots = knots[knots >= begin]
    knots = knots[np.concatenate([[True], np.diff(knots) > 1e-6 * width])]
    knots[-1] = t[-1] + width
    both = integrals(np.concatenate([knots, knots - width]))
    average = (both[:, : len(knots)] - both[:, len(knots) :]) / width
    steps = np.diff(knots)
    jerk = np.diff(average[2]) / steps
    return TimeLaw(steps, np.stack([*average[:2, :-1], 0.5 * average[2, :-1], jerk / 6.0], axis=1), smooth=True)
