"""Straight lines in a scan: split and merge, then weighted least squares.

A scan is cut where neighbours are too far apart, then cut on where it bends, by the chord of each piece and
distances that are averaged over neighbours, so that noise doesn't cut. Each piece is fitted at right angles to
itself, every point with the doubt that its range gives it in that direction; points that lie off are left out, and
neighbours that tell the same line become one. A fit says how sure its line is, and how large the noise of the
ranges seems to be.

Sources: Kim, Han, Kim, Kim 2002, section 3.1; split and merge after Pavlidis and Horowitz 1974; the break between
two points after Borges and Aldon 2004.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robots.onboard.gsp_map import Lines
from robots.onboard.laser import Points
from vrs.checks import validated, within
from vrs.mobile import wrapped
from vrs.model import Array

_SMOOTH = 5
"""Points that are averaged before a piece is cut."""
_ENDS = 3
"""Points at either end that make the chord."""
_GRAZING = 0.15
"""Least share of a range's noise that counts across a line: a beam along a wall isn't exact."""
_MOST_TRIMMED = 0.15
"""Largest share of a line that's left out at either end."""
_ROUNDS = 3
"""Of least squares, points that are off being left out in between."""
_SAME = 9.2
"""Two lines are one if they differ by less than this, squared and normalised: 99 % of two degrees of freedom."""


@dataclass(frozen=True, slots=True)
@validated
class ExtractionConfig:
    """What counts as a line."""

    noise: Annotated[float, within(1e-4, 0.2)] = 0.015
    """Standard deviation of a range to begin with [m], in [1e-4, 0.2]; then what the fits say."""
    points: Annotated[int, within(3, 1000)] = 8
    """Least number of points of a line, in [3, 1000]."""
    length: Annotated[float, within(0.05, 10.0)] = 0.25
    """Least length of a line [m], in [0.05, 10]."""
    shallowest: Annotated[float, within(0.02, 0.7)] = math.radians(8)
    """Least angle between a beam and the wall that it still follows [rad], in [0.02, 0.7]."""
    bend: Annotated[float, within(1e-3, 1.0)] = 0.015
    """What a piece may bend by beside 1.7 deviations of the noise [m], in [1e-3, 1]."""
    outliers: Annotated[float, within(1.5, 10.0)] = 3.0
    """A point that's off by more deviations isn't of the line, in [1.5, 10]."""
    rough: Annotated[float, within(1.1, 100.0)] = 2.0
    """A piece whose mean square is so many times that of the noise is no line, in [1.1, 100]."""


class Fit(NamedTuple):
    """A line through some points."""

    x: float
    """Of the weighted centre [m]."""
    y: float
    angle: float
    """Direction [rad]; the scanner is on the left."""
    low: float
    """Where it begins and ends from the centre [m]."""
    high: float
    across: float
    """Variance along the normal [m²]."""
    turn: float
    """Variance of the direction [rad²]."""
    points: int
    """Points that are on it."""
    squares: float
    """Sum of the squares of what they're off, in deviations."""


def extract(points: Points, config: ExtractionConfig, noise: float | None = None) -> tuple[Lines, float]:
    """Find the lines in a scan.

    Args:
        points: Of the scan, in the order of its beams.
        config: What counts as a line.
        noise: Standard deviation of the ranges [m]; the config's unless given.

    Returns:
        The lines, in the frame of the points; and the standard deviation of the ranges, as these lines show it [m],
        nan if there are none.
    """
    sigma = config.noise if noise is None else noise
    fits: list[Fit] = []
    for first, last in _clusters(points, config, sigma):
        fits += _pieces(points, first, last, config, sigma)
    free = sum(fit.points - 2 for fit in fits)
    if not fits or free <= 0:
        return Lines.none(), math.nan
    rows = np.array(fits)
    lines = Lines.of(rows[:, :3], rows[:, 3:5], rows[:, 5:7], rows[:, 7])
    return lines, sigma * math.sqrt(float(rows[:, 8].sum()) / free)


def _clusters(points: Points, config: ExtractionConfig, sigma: float) -> list[tuple[int, int]]:
    """Runs of points with no gap, as half-open ranges."""
    places, beams = points.places, points.beams
    if len(places) < config.points:
        return []
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    ranges = points.ranges
    skipped = np.diff(beams)
    turn = _beam_step(points) * skipped
    near = np.minimum(ranges[1:], ranges[:-1])
    most = near * np.sin(turn) / np.sin(np.maximum(config.shallowest - turn, 0.5 * config.shallowest)) + 4 * sigma
    cuts = np.flatnonzero((steps > most) | (skipped > 6)) + 1
    bounds = [0, *cuts.tolist(), len(places)]
    return [(a, b) for a, b in pairwise(bounds) if b - a >= config.points]


def _beam_step(points: Points) -> float:
    """Angle between two beams [rad], as the directions of the first and the last have it."""
    if points.beams[-1] == points.beams[0]:
        return 0.0
    first, last = points.ways[0], points.ways[-1]
    whole = math.atan2(last[1], last[0]) - math.atan2(first[1], first[0])
    return abs(wrapped(whole) if whole > math.pi else whole) / int(points.beams[-1] - points.beams[0])


def _pieces(points: Points, first: int, last: int, config: ExtractionConfig, sigma: float) -> list[Fit]:
    """Lines of one run, cut where it bends, those that are one merged."""
    places = points.places
    cuts: list[tuple[int, int]] = []
    waiting = [(first, last)]
    most = config.bend + 1.7 * sigma
    while waiting:
        a, b = waiting.pop()
        if b - a < config.points:
            continue
        at = _bend(places[a:b], most)
        if at is None:
            cuts.append((a, b))
        else:
            waiting += [(a + at, b), (a, a + at)]
    fits: list[tuple[Fit, int, int]] = []
    for a, b in cuts:
        fit = fitted(points, a, b, config, sigma)
        if fit is None:
            continue
        if fits and a - fits[-1][2] <= 2 and _alike(fits[-1][0], fit):
            whole = fitted(points, fits[-1][1], b, config, sigma)
            if whole is not None:
                fits[-1] = (whole, fits[-1][1], b)
                continue
        fits.append((fit, a, b))
    return [fit for fit, _, _ in fits if fit.high - fit.low >= config.length]


def _bend(places: Array, most: float) -> int | None:
    """Where points bend away from their chord by more than so much [m]; None if they don't."""
    ends = min(_ENDS, len(places) // 3)
    begin, end = places[:ends].mean(axis=0), places[-ends:].mean(axis=0)
    x, y = (end - begin).tolist()
    length = math.hypot(x, y)
    if length < 1e-6:
        return len(places) // 2
    off = ((places[:, 1] - begin[1]) * x - (places[:, 0] - begin[0]) * y) / length
    sums = np.concatenate([[0.0], np.cumsum(off)])
    half = _SMOOTH // 2
    k = np.arange(len(off))
    low, high = np.maximum(k - half, 0), np.minimum(k + half + 1, len(off))
    smooth = np.abs((sums[high] - sums[low]) / (high - low))
    at = int(np.argmax(smooth))
    if smooth[at] <= most:
        return None
    return min(max(at, 1), len(places) - 1)


class _Least(NamedTuple):
    """A line by weighted least squares."""

    x: float
    y: float
    angle: float
    along: Array
    """Where all points are along it, from the weighted centre [m], (k,)."""
    squares: Array
    """What all points are off, squared and in their own deviations, (k,)."""
    total: float
    """Sum of the weights of those that count [1/m²]."""
    lever: float
    """The same times the squares of where they are along."""


def fitted(points: Points, first: int, last: int, config: ExtractionConfig, sigma: float) -> Fit | None:
    """Fit a line to points first to last − 1; None if they don't make one."""
    places, ways = points.places[first:last], points.ways[first:last]
    line = _through(places)
    kept = last_kept = inner = _inner(places, line, config, sigma)
    found: _Least | None = None
    for _ in range(_ROUNDS):
        found = _least(places, ways, line, kept, sigma)
        if found is None:
            return None
        line = found.x, found.y, found.angle
        near = found.squares < config.outliers**2
        if int((inner & near).sum()) < config.points:
            return None
        last_kept, kept = kept, inner & near
    assert found is not None
    count, squares = int(last_kept.sum()), float(found.squares[last_kept].sum())
    if squares > config.rough * (count - 2) or count < 0.7 * int(inner.sum()):
        return None
    ox, oy = points.origins[first].tolist()
    x, y, angle = line
    low, high = float(found.along[near].min()), float(found.along[near].max())
    if math.cos(angle) * (oy - y) - math.sin(angle) * (ox - x) < 0:
        angle, low, high = angle + math.pi, -high, -low
    return Fit(x, y, wrapped(angle), low, high, 1 / found.total, 1 / found.lever, count, squares)


def _through(places: Array) -> tuple[float, float, float]:
    """Centre and direction of points by total least squares."""
    x, y = places.mean(axis=0).tolist()
    dx, dy = places[:, 0] - x, places[:, 1] - y
    return x, y, 0.5 * math.atan2(2 * float(dx @ dy), float(dx @ dx - dy @ dy))


def _inner(
    places: Array, line: tuple[float, float, float], config: ExtractionConfig, sigma: float
) -> NDArray[np.bool_]:
    """Points that aren't at the ends: there those of the next wall look as if they were of this one."""
    x, y, angle = line
    along = (places - (x, y)) @ (math.cos(angle), math.sin(angle))
    low, high = float(along.min()), float(along.max())
    trim = min(config.bend + 1.7 * sigma, _MOST_TRIMMED * (high - low))
    inner = (along >= low + trim) & (along <= high - trim)
    return inner if int(inner.sum()) >= config.points else np.ones(len(places), dtype=np.bool_)


def _least(
    places: Array, ways: Array, line: tuple[float, float, float], kept: NDArray[np.bool_], sigma: float
) -> _Least | None:
    """Improve a line by the points that count; None if they are at one place."""
    x, y, angle = line
    c, s = math.cos(angle), math.sin(angle)
    dx, dy = places[:, 0] - x, places[:, 1] - y
    along, off = c * dx + s * dy, c * dy - s * dx
    share = c * ways[:, 1] - s * ways[:, 0]
    weight = 1 / (sigma * sigma * np.maximum(share * share, _GRAZING * _GRAZING))
    counted = np.where(kept, weight, 0.0)
    total = float(counted.sum())
    middle, mean = float(counted @ along) / total, float(counted @ off) / total
    along = along - middle
    lever = float(counted @ (along * along))
    if lever <= 0:
        return None
    slope = float(counted @ (along * (off - mean))) / lever
    left = off - mean - slope * along
    x, y = x + c * middle - s * mean, y + s * middle + c * mean
    return _Least(x, y, angle + math.atan(slope), along, left * left * weight, total, lever)


def _alike(one: Fit, other: Fit) -> bool:
    """Whether two fits are of one line."""
    turn = wrapped(other.angle - one.angle)
    dx, dy = other.x - one.x, other.y - one.y
    c, s = math.cos(one.angle), math.sin(one.angle)
    along, off = c * dx + s * dy, c * dy - s * dx
    doubt = one.across + other.across + along * along * one.turn
    return off * off / doubt + turn * turn / (one.turn + other.turn) < _SAME
