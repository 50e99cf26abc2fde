"""A smooth path in the plane by the way along it: cubic splines through points, or quadratic curves between them.

A *cubic* curve goes through its points and has a continuous curvature; a *quadratic* one touches the polygon of its
points in the middle of each side, its curvature jumps there, and its nearest point is the root of a cubic. A piece
is (degree + 1, 2): coefficients of x and y [m] in ascending powers of a parameter u from 0 to 1.

Path files: points and what becomes of them, a line each.

    path 1                  the format's version, first
    curve cubic             or quadratic, see `CurveKind`; cubic unless given
    0 1                     a point: x and y [m], two or more in the order in which they're passed
    1.5 1.8                 `#` begins a comment
"""

from __future__ import annotations

import enum
import math
from bisect import bisect_right
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vrs.checks import bounded_text, finite_array, word
from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array, frozen_array

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


def _cubic_spline(points: Array) -> Array:
    """Coefficients of a natural cubic spline by chord length, (k − 1, 4, 2), ascending in u from 0 to 1."""
    from scipy.interpolate import CubicSpline

    h = np.hypot(*np.diff(points, axis=0).T)
    spline = CubicSpline(np.concatenate([[0.0], np.cumsum(h)]), points, bc_type="natural")
    return np.asarray(spline.c[::-1].swapaxes(0, 1) * h[:, None, None] ** np.arange(4)[:, None])


def _quadratic_spline(points: Array) -> Array:
    """Coefficients of a quadratic B-spline, (max(k − 2, 1), 3, 2), ascending in u from 0 to 1."""
    if len(points) == 2:
        points = np.array([points[0], points.mean(axis=0), points[1]])
    middles = 0.5 * (points[:-1] + points[1:])
    knots = np.concatenate([points[:1], middles[1:-1], points[-1:]])
    start, control, end = knots[:-1], points[1:-1], knots[1:]
    return np.stack([start, 2 * (control - start), start - 2 * control + end], 1)


def _rough_length(piece: Array) -> float:
    """Length of a piece [m], by eight chords."""
    at = _evaluated(np.broadcast_to(piece, (9, *piece.shape)), np.linspace(0.0, 1.0, 9))[0]
    return float(np.hypot(*np.diff(at, axis=0).T).sum())


def _evaluated(pieces: Array, u: Array) -> tuple[Array, Array, Array]:
    """Places and their first two derivatives, (k, 2) each, of pieces (k, degree + 1, 2) at u (k,)."""
    degree = pieces.shape[-2] - 1
    powers = u[:, None] ** np.arange(degree + 1)
    k = np.arange(1, degree + 1, dtype=np.float64)
    first = pieces[:, 1:] * k[:, None]
    second = first[:, 1:] * k[:-1, None]
    return tuple(np.einsum("kj,kjd->kd", powers[:, : rows.shape[1]], rows) for rows in (pieces, first, second))


def _speeds(pieces: Array, u: Array) -> Array:
    """|dp/du| at u (k, m) of pieces (k, degree + 1, 2), (k, m)."""
    velocity = _evaluated(np.repeat(pieces, u.shape[1], axis=0), u.ravel())[1]
    return np.asarray(np.hypot(*velocity.T).reshape(u.shape))


def _derivatives(rows: list[list[float]], u: float) -> tuple[tuple[float, float], ...]:
    """Place, first and second derivative of a piece."""
    (ax, ay), (bx, by), (cx, cy) = rows[:3]
    dx, dy = rows[3] if len(rows) == 4 else (0.0, 0.0)
    return (
        (ax + u * (bx + u * (cx + u * dx)), ay + u * (by + u * (cy + u * dy))),
        (bx + u * (2 * cx + 3 * u * dx), by + u * (2 * cy + 3 * u * dy)),
        (2 * cx + 6 * u * dx, 2 * cy + 6 * u * dy),
    )


def _squared_distance(rows: list[list[float]], u: float, x: float, y: float) -> float:
    """Squared distance of a piece at u from (x, y) [m²]."""
    at = _derivatives(rows, u)[0]
    return (at[0] - x) ** 2 + (at[1] - y) ** 2


def _quadratic_nearest(rows: list[list[float]], x: float, y: float) -> list[float]:
    """Where the distance to a quadratic piece is stationary: the roots of a cubic."""
    (ax, ay), (bx, by), (cx, cy) = rows
    px, py = ax - x, ay - y
    return real_roots(
        2 * (cx * cx + cy * cy),
        3 * (bx * cx + by * cy),
        bx * bx + by * by + 2 * (px * cx + py * cy),
        px * bx + py * by,
    )


def _cubic_nearest(rows: list[list[float]], x: float, y: float, low: float, high: float) -> list[float]:
    """Where the distance to a cubic piece is stationary between two parameters, by Newton's method."""
    u = 0.5 * (low + high)
    for _ in range(_NEWTON):
        (px, py), (dx, dy), (ddx, ddy) = _derivatives(rows, u)
        ex, ey = px - x, py - y
        slope = dx * dx + dy * dy + ex * ddx + ey * ddy
        if slope <= 0:
            break
        moved = min(max(u - (ex * dx + ey * dy) / slope, low), high)
        if abs(moved - u) < _CLOSE:
            break
        u = moved
    return [u]


MOST_POINTS = 2000
LARGEST = 1e4
"""Largest coordinate [m]."""
_SPACING = 0.01
"""Of the table of points along a curve [m]; wider where it would have too many rows."""
_MOST_ROWS = 100_000
_GAUSS = 0.5 + math.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0
_CUSP = 1e-6
"""Least speed along the parameter, as a share of the mean, below which a curve has a cusp."""


class CurveKind(enum.StrEnum):
    """What becomes of the points."""

    CUBIC = "cubic"
    """A natural cubic spline through them."""
    QUADRATIC = "quadratic"
    """A quadratic B-spline with them as its polygon; it begins at the first and ends at the last."""


class CurvePoint(NamedTuple):
    """A place on a curve."""

    x: float
    """[m]."""
    y: float
    """[m]."""
    theta: float
    """Direction of travel [rad], in [−π, π]."""
    curvature: float
    """dθ/ds [1/m], to the left positive."""


class _Row(NamedTuple):
    """A stretch of a curve, a centimetre or so."""

    piece: int
    u: float
    """Parameter at its start."""
    step: float
    """How far the parameter goes on it."""
    begin: float
    """Speed along the parameter at its start, times the step [m]."""
    end: float
    """The same at its end."""


class Curve:
    """A path (x_p(s), y_p(s)), s the way along it in [0, length]."""

    def __init__(self, points: ArrayLike, kind: CurveKind | str = CurveKind.CUBIC) -> None:
        """Make a curve of points.

        Args:
            points: (k, 2) [m], 2 to 2000, at most 1e4 in size, no two alike one after the other.
            kind: What becomes of them.

        Raises:
            InvalidValueError: If the points aren't such, or the curve has a cusp: it would stop and turn back.
        """
        self.kind = word("kind", kind, CurveKind)
        self.points = _checked(points)
        """As given, (k, 2) [m]."""
        pieces = _cubic_spline(self.points) if self.kind is CurveKind.CUBIC else _quadratic_spline(self.points)
        self._pieces: list[list[list[float]]] = pieces.tolist()
        self._tabulate(pieces)

    def at(self, s: float) -> CurvePoint:
        """Return the place at a way along the curve [m]; before its start or after its end, that one's."""
        piece, u = self._parameter(min(max(s, 0.0), self.length))
        (x, y), (dx, dy), (ddx, ddy) = _derivatives(self._pieces[piece], u)
        speed = math.hypot(dx, dy)
        return CurvePoint(x, y, math.atan2(dy, dx), (dx * ddy - dy * ddx) / speed**3)

    def nearest(self, x: float, y: float, *, around: float | None = None, window: float = math.inf) -> float:
        """Return the way s₀ to the point that is nearest to (x, y), exact to rounding.

        Args:
            x: [m].
            y: [m].
            around: Where on the curve to look [m]; everywhere unless given.
            window: How far from there [m]: where a curve crosses itself, its parts aren't mistaken for one another.

        Source: Tipsuwan, Chow, eq. (5).
        """
        first, last = 0, len(self._s) - 1
        if around is not None and window < self.length:
            first = max(bisect_right(self._s_list, around - window) - 1, 0)
            last = min(bisect_right(self._s_list, around + window), last)
        dx, dy = self._xy[first : last + 1, 0] - x, self._xy[first : last + 1, 1] - y
        row = first + int(np.argmin(dx * dx + dy * dy))
        rows = [k for k in (row - 1, row) if first <= k < last]
        found = [self._nearest_on(k, x, y) for k in rows]
        return min(found)[1]

    def most_curvature(self, start: float, end: float) -> float:
        """Return the largest |κ| between two ways along the curve [1/m], as its table has it."""
        first = max(bisect_right(self._s_list, start) - 1, 0)
        last = bisect_right(self._s_list, end)
        return float(self._bend[first : last + 1].max())

    @property
    def length(self) -> float:
        """Of the whole curve [m]."""
        return self._s_list[-1]

    @property
    def table(self) -> tuple[Array, Array, Array]:
        """Ways s (k,) [m], points (k, 2) [m] and |κ| (k,) [1/m] along the curve, a row a centimetre or so."""
        return self._s, self._xy, self._bend

    def _tabulate(self, pieces: Array) -> None:
        """Lay out rows along the curve: their way, place, curvature, and speed along the parameter."""
        index, u, step = _laid_out(pieces)
        position, velocity, acceleration = _evaluated(pieces[index], u)
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        if speed.min() <= _CUSP * speed.mean():
            raise InvalidValueError(
                "points", self.points, "points whose curve has no cusp: none that turn straight back"
            )
        cross = velocity[:, 0] * acceleration[:, 1] - velocity[:, 1] * acceleration[:, 0]
        self._xy, self._bend = frozen_array(position), frozen_array(np.abs(cross) / speed**3)
        inner = _speeds(pieces[index[:-1]], u[:-1, None] + step[:, None] * _GAUSS)
        self._s = frozen_array(np.concatenate([[0.0], np.cumsum(step * (inner @ _WEIGHTS))]))
        self._s_list: list[float] = self._s.tolist()
        ends = _speeds(pieces[index[:-1]], (u[:-1] + step)[:, None])[:, 0]
        columns = (index[:-1], u[:-1], step, speed[:-1] * step, ends * step)
        self._rows = [_Row(*row) for row in zip(*(column.tolist() for column in columns), strict=True)]

    def _parameter(self, s: float) -> tuple[int, float]:
        """The piece and its parameter at a way along the curve."""
        row = min(bisect_right(self._s_list, s), len(self._rows)) - 1
        piece, u, step, begin, end = self._rows[row]
        # The speed changes evenly within a row, so the way is quadratic in the parameter.
        way, whole = s - self._s_list[row], self._s_list[row + 1] - self._s_list[row]
        way *= 0.5 * (begin + end) / whole
        share = 2 * way / (begin + math.sqrt(max(begin * begin + 2 * (end - begin) * way, 0.0)))
        return piece, u + step * min(share, 1.0)

    def _way(self, row: int, u: float) -> float:
        """The way at a parameter within a row: the inverse of `_parameter`."""
        _, first, step, begin, end = self._rows[row]
        share = (u - first) / step
        way, whole = share * (begin + 0.5 * (end - begin) * share), self._s_list[row + 1] - self._s_list[row]
        return self._s_list[row] + way * whole / (0.5 * (begin + end))

    def _nearest_on(self, row: int, x: float, y: float) -> tuple[float, float]:
        """Squared distance and way of the nearest point within a row."""
        piece, low, step, _, _ = self._rows[row]
        rows = self._pieces[piece]
        high = low + step
        found = (
            _quadratic_nearest(rows, x, y)
            if self.kind is CurveKind.QUADRATIC
            else _cubic_nearest(rows, x, y, low, high)
        )
        best = min(
            (_squared_distance(rows, u, x, y), u) for u in (low, high, *(u for u in found if low < u < high))
        )
        return best[0], self._way(row, best[1])


def _laid_out(pieces: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """Rows along pieces: piece and parameter where each begins, and the last one's end; how far each goes."""
    rough = np.array([_rough_length(piece) for piece in pieces])
    spacing = max(_SPACING, float(rough.sum()) / _MOST_ROWS)
    counts = np.maximum(np.ceil(rough / spacing).astype(int), 4)
    u = np.concatenate([*(np.arange(n) / n for n in counts), np.ones(1)])
    index = np.append(np.repeat(np.arange(len(pieces)), counts), len(pieces) - 1)
    return index, u, np.repeat(1.0 / counts, counts)


def _checked(points: ArrayLike) -> Array:
    allowed = f"2 to {MOST_POINTS} rows of x and y [m], at most {LARGEST:g} in size"
    array = finite_array("points", points, None, allowed)
    if (
        array.ndim != 2
        or array.shape[1] != 2
        or not 2 <= len(array) <= MOST_POINTS
        or np.abs(array).max() > LARGEST
    ):
        raise InvalidValueError("points", points, allowed)
    if (np.hypot(*np.diff(array, axis=0).T) < 1e-6).any():
        raise InvalidValueError("points", points, "rows that differ from the one before by a micrometre or more")
    return array


VERSION = 1
MOST_BYTES = 256 * 1024


def load_curve(path: Path | str) -> Curve:
    """Read a path from a file.

    Raises:
        FormatError: If it can't be read, or isn't one; it names the file, and the line.
    """
    path = Path(path)
    try:
        text = bounded_text(path, MOST_BYTES, "utf-8-sig")
    except OSError as error:
        raise FormatError(path.name, f"can't be read: {error.strerror}") from None
    return read_curve(text, path.name)


def read_curve(text: str, where: str = "path") -> Curve:
    """Read a path.

    Args:
        text: As a path file has it.
        where: What it's called in errors.

    Raises:
        FormatError: If it isn't a path.
    """
    lines = ((number, line.partition("#")[0].split()) for number, line in enumerate(text.splitlines(), 1))
    rows = [(f"{where}, line {number}", words) for number, words in lines if words]
    if not rows or rows[0][1] != ["path", str(VERSION)]:
        raise FormatError(rows[0][0] if rows else where, f"a path begins with the line 'path {VERSION}'")
    kind = CurveKind.CUBIC
    points: list[tuple[float, float]] = []
    for place, words in rows[1:]:
        if words[0] == "curve":
            if points:
                raise FormatError(place, "'curve' stands before the points")
            kind = _kind(place, words)
        else:
            points.append(_point(place, words))
    if not 2 <= len(points) <= MOST_POINTS:
        raise FormatError(where, f"2 to {MOST_POINTS} points are allowed; given: {len(points)}")
    try:
        return Curve(points, kind)
    except InvalidValueError as error:
        raise FormatError(where, f"its points must be {error.allowed}") from None


def _kind(place: str, words: list[str]) -> CurveKind:
    try:
        return CurveKind(" ".join(words[1:]))
    except ValueError:
        allowed = " or ".join(f"'curve {kind}'" for kind in CurveKind)
        raise FormatError(place, f"{allowed} is allowed; given: {' '.join(words)!r}") from None


def _point(place: str, words: list[str]) -> tuple[float, float]:
    try:
        x, y = (float(word) for word in words)
    except ValueError:
        raise FormatError(place, f"a point is two numbers, x and y [m]; given: {' '.join(words)!r}") from None
    if not (math.hypot(x, y) < math.inf and max(abs(x), abs(y)) <= LARGEST):
        raise FormatError(place, f"x and y must be within ±{LARGEST:g} m; given: {' '.join(words)!r}")
    return x, y
