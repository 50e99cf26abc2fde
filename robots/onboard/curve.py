"""A smooth path in the plane by the way along it: cubic splines through points, or quadratic curves between them.

A *cubic* curve goes through its points and has a continuous curvature; a *quadratic* one touches the polygon of its
points in the middle of each side, its curvature jumps there, and its nearest point is the root of a cubic.

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

from robots.onboard import plane_pieces as pieces_of
from robots.text_files import bounded_text
from vrs.checks import finite_array, one_of
from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array, frozen_array

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
        self.kind = CurveKind(one_of("kind", kind, list(CurveKind)))
        self.points = _checked(points)
        """As given, (k, 2) [m]."""
        pieces = pieces_of.cubic(self.points) if self.kind is CurveKind.CUBIC else pieces_of.quadratic(self.points)
        self._pieces: list[list[list[float]]] = pieces.tolist()
        self._tabulate(pieces)

    def at(self, s: float) -> CurvePoint:
        """Return the place at a way along the curve [m]; before its start or after its end, that one's."""
        piece, u = self._parameter(min(max(s, 0.0), self.length))
        (x, y), (dx, dy), (ddx, ddy) = pieces_of.derivatives(self._pieces[piece], u)
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
        position, velocity, acceleration = pieces_of.evaluated(pieces[index], u)
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        if speed.min() <= _CUSP * speed.mean():
            raise InvalidValueError(
                "points", self.points, "points whose curve has no cusp: none that turn straight back"
            )
        cross = velocity[:, 0] * acceleration[:, 1] - velocity[:, 1] * acceleration[:, 0]
        self._xy, self._bend = frozen_array(position), frozen_array(np.abs(cross) / speed**3)
        inner = pieces_of.speed(pieces[index[:-1]], u[:-1, None] + step[:, None] * _GAUSS)
        self._s = frozen_array(np.concatenate([[0.0], np.cumsum(step * (inner @ _WEIGHTS))]))
        self._s_list: list[float] = self._s.tolist()
        ends = pieces_of.speed(pieces[index[:-1]], (u[:-1] + step)[:, None])[:, 0]
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
            pieces_of.quadratic_nearest(rows, x, y)
            if self.kind is CurveKind.QUADRATIC
            else pieces_of.cubic_nearest(rows, x, y, low, high)
        )
        best = min(
            (pieces_of.squared(rows, u, x, y), u) for u in (low, high, *(u for u in found if low < u < high))
        )
        return best[0], self._way(row, best[1])


def _laid_out(pieces: Array) -> tuple[NDArray[np.intp], Array, Array]:
    """Rows along pieces: piece and parameter where each begins, and the last one's end; how far each goes."""
    rough = np.array([pieces_of.rough_length(piece) for piece in pieces])
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
