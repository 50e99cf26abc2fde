"""How far two robots are apart: joint and tool errors, best lag, tool path and time difference.

The follower is matched to the path of the leader causally, monotonically and exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vrs.errors import InvalidValueError
from vrs.model import Array, RobotModel

_BEAM = 0.25
"""How much more than the best a cell may cost in the search for a match to compare with [m²]."""
_PRUNED = 8
"""After so many steps cells are given up."""
_POINTS = 50
"""Points of the leader that are kept in a cell, at most, beside its ends."""


@dataclass(frozen=True, slots=True, eq=False)
class PathMatch:
    """A follower matched to a leader's path, in full: what `compare_paths` sums up."""

    t: Array
    """Times of the match [s], (k,)."""
    distance: Array
    """Distance of the follower to the leader's path at those times [m], (k,); NaN where it wasn't measured."""
    s: Array
    """Cells along the leader's path [m], (n,)."""
    t_leader: Array
    """When the leader first reached each cell [s], (n,)."""
    t_follower: Array
    """When the follower first reached each cell that it reached [s], (m,), m ≤ n; NaN where it came there
    unmeasured."""
    moving: NDArray[np.bool_]
    """Whether the leader moves at each cell, so that a delay there means something, (n,)."""

    @property
    def time_difference(self) -> tuple[Array, Array]:
        """Cells [m] and how much later the follower reached them [s], where the leader moves."""
        counted = self.moving[: len(self.t_follower)] & np.isfinite(self.t_follower)
        late = self.t_follower - self.t_leader[: len(counted)]
        return self.s[: len(counted)][counted], np.asarray(late[counted], dtype=np.float64)


def match_paths(
    t: ArrayLike,
    p_leader: ArrayLike,
    p_follower: ArrayLike,
    *,
    v_max: float = 0.5,
    cell: float = 0.01,
    dt: float = 0.05,
    v_min: float = 0.02,
) -> PathMatch:
    """Match a follower to a leader's path, causally and monotonically.

    The match j(t) is a non-decreasing cell along the leader's path, reached by the leader no later than t,
    that advances by at most 2 v_max dt a step and has the smallest sum of squared distances. It is exact:
    dynamic programming over the whole record, ties going to the smaller advance. Where the follower wasn't measured
    it costs nothing, wherever it is.

    Args:
        t: Ascending times [s], (k,), k ≥ 2.
        p_leader: Points of the leader [m], (k, d).
        p_follower: Points of the follower [m], (k, d); rows of NaN where it wasn't measured.
        v_max: Largest speed of the leader [m/s], > 0.
        cell: Length of a cell of path [m], > 0.
        dt: Step of the match [s], > 0.
        v_min: Speed of the leader below which no delay is counted [m/s], > 0.

    Returns:
        The match; of a leader that moves less than two cells, the distances alone.

    Raises:
        InvalidValueError: If shapes differ, nothing was measured, or a value isn't finite or positive where it must
            be.
    """
    leader, follower = histories(p_leader, p_follower, gaps=True)
    times = np.asarray(t, dtype=np.float64)
    if times.shape != (len(leader),) or len(times) < 2 or not (np.diff(times) > 0).all():
        raise InvalidValueError("t", times.shape, f"ascending times, shape ({len(leader)},), two or more")
    for name, value in (("v_max", v_max), ("cell", cell), ("dt", dt), ("v_min", v_min)):
        if not 0 < value < np.inf:
            raise InvalidValueError(name, value, "positive and finite")
    grid = times[0] + dt * np.arange(int(np.floor((times[-1] - times[0]) / dt + 1e-9)) + 1)
    follower = resample(times, follower, grid)
    seen = measured_rows(follower)
    if not seen.any():
        raise InvalidValueError("p_follower", "gaps alone", f"measured for {dt} s on end at least once")

    s_of_t = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(leader, axis=0), axis=1))))
    cells = int(np.floor(s_of_t[-1] / cell + 1e-9)) + 1
    s = cell * np.arange(cells, dtype=np.float64)
    t_leader = _first_arrival(times, s_of_t, s)
    path = resample(times, leader, t_leader)
    # The start is reached by definition; a cell beside a standstill says nothing about delay.
    moving = np.zeros(cells, dtype=bool)
    if cells < 3:
        distance = np.linalg.norm(follower - path[0], axis=1)
        return PathMatch(grid, distance, s, t_leader, t_leader[:1], moving)
    moving[1:-1] = 2 * cell > v_min * (t_leader[2:] - t_leader[:-2])
    match = best_match(grid, follower, t_leader, path, max(1, round(2 * v_max * dt / cell)))
    distance, s_follower = _project(follower, *_polyline(s, path, s_of_t, leader), s, match)
    window = (-dt, dt + 0.5 * cell / v_min)
    if seen.all():
        t_follower = _arrivals(grid, match, s_follower, s[: match[-1] + 1], window)
    else:
        s_follower = np.interp(grid, grid[seen], s_follower[seen])
        t_follower = _arrivals(grid, match, s_follower, s[: match[-1] + 1], window)
        step = np.clip(np.searchsorted(grid, t_follower), 1, len(grid) - 1)
        first = np.searchsorted(match, np.arange(len(t_follower)), side="left")
        t_follower[~(seen[step - 1] & seen[step] & seen[first])] = np.nan
    return PathMatch(grid, distance, s, t_leader, t_follower, moving)


def measured_rows(values: Array) -> NDArray[np.bool_]:
    """Which rows (k, d) are measured, and not NaN, (k,)."""
    return np.asarray(np.isfinite(values).all(axis=1))


def resample(t: Array, values: Array, t_new: Array) -> Array:
    """Values (k, d) known at ascending times t (k,), linear in between and held outside, at t_new (m,)."""
    columns = [np.interp(t_new, t, values[:, i]) for i in range(values.shape[1])]
    return np.stack(columns, axis=1)


def best_match(t: Array, follower: Array, t_leader: Array, path: Array, advance: int) -> NDArray[np.intp]:
    """Best matched cell at every time, (k,).

    Exact, but without the cells that can't lie on the best match: those whose cost, with the least that is still
    to come, is more than that of a match which is known.
    """
    known = np.searchsorted(t_leader, t + 1e-9, side="right")
    rest = _least_to_come(follower, path)
    least = float(rest[0]) + float(_squares(path[:1], follower[0])[0])
    total = _greedy(follower, path, known, advance)
    if total > least + _BEAM:
        # A better bound is worth its search.
        beam = _search(follower, path, known, advance, lambda _, cost: float(cost.min()) + _BEAM)
        total = min(total, beam[1])
    enough = total * (1 + 1e-9) + 1e-12
    match, _ = _search(follower, path, known, advance, lambda k, _: enough - float(rest[k]))
    return match


def _greedy(follower: Array, path: Array, known: NDArray[np.intp], advance: int) -> float:
    """Cost of the match that goes to the nearest cell within reach at each time."""
    j, total = 0, float(_squares(path[:1], follower[0])[0])
    for k in range(1, len(follower)):
        squares = _squares(path[j : min(j + advance + 1, int(known[k]))], follower[k])
        step = int(squares.argmin())
        j, total = j + step, total + float(squares[step])
    return total


def _least_to_come(follower: Array, path: Array) -> Array:
    """Sum of the squared distances to the nearest cell after each time, (k,)."""
    from scipy.spatial import KDTree

    seen = measured_rows(follower)
    squares = np.zeros(len(follower))
    squares[seen] = KDTree(path).query(follower[seen])[0] ** 2
    return np.asarray(np.append(np.cumsum(squares[:0:-1])[::-1], 0.0), dtype=np.float64)


def _squares(path: Array, point: Array) -> Array:
    """Squared distances of cells, (m, d), to a point of the follower, (d,), (m,); 0 where it wasn't measured."""
    apart = path - point
    squares: Array = np.einsum("ij,ij->i", apart, apart)
    return squares if np.isfinite(point[0]) else np.zeros(len(path))


def _search(
    follower: Array, path: Array, known: NDArray[np.intp], advance: int, bound: Callable[[int, Array], float]
) -> tuple[NDArray[np.intp], float]:
    """The best match among cells whose cost at time k is within `bound(k, costs)`, and its cost."""
    low, cost = 0, _squares(path[:1], follower[0])
    costs = [(low, cost)]
    for k in range(1, len(follower)):
        high = min(low + len(cost) + advance, int(known[k]))
        best = _least_of_window(cost, advance)[: high - low]
        cost = best + _squares(path[low:high], follower[k])
        costs.append((low, cost))
        if k % _PRUNED == 0:
            alive = np.flatnonzero(cost <= bound(k, cost))
            cost = cost[alive[0] : alive[-1] + 1]
            low += int(alive[0])
            costs[-1] = low, cost
    match = np.empty(len(follower), dtype=np.intp)
    match[-1] = low + int(np.argmin(cost))
    for k in range(len(follower) - 1, 0, -1):
        low, before = costs[k - 1]
        place = int(match[k]) - low
        # Backwards: of equals the smallest advance is the first.
        window = before[max(place - advance, 0) : place + 1][::-1]
        match[k - 1] = match[k] - int(np.argmin(window)) - max(place + 1 - len(before), 0)
    return match, float(cost.min())


def _least_of_window(cost: Array, advance: int) -> Array:
    """Least of each cost and the `advance` before it, (n,) to (n + advance,)."""
    padded = np.full(len(cost) + 2 * advance, np.inf)
    padded[advance : advance + len(cost)] = cost
    least, width = padded, 1
    while 2 * width <= advance + 1:
        least = np.minimum(least[:-width], least[width:])
        width *= 2
    rest = advance + 1 - width
    return np.minimum(least[: len(least) - rest], least[rest:]) if rest else least


def _polyline(s: Array, path: Array, s_of_t: Array, leader: Array) -> tuple[Array, Array]:
    """The leader's path with what was recorded between its cells: lengths (m,), ascending, and points (m, d)."""
    _, first = np.unique(np.floor(s_of_t * (_POINTS / s[1])), return_index=True)
    recorded = np.append(first, len(leader) - 1)
    along, place = np.unique(np.concatenate((s, s_of_t[recorded])), return_index=True)
    return along, np.vstack((path, leader[recorded]))[place]


def _project(
    follower: Array, along: Array, points: Array, s: Array, match: NDArray[np.intp]
) -> tuple[Array, Array]:
    """Distance to the path between the neighbours of each matched cell, and the length up to the nearest point.

    Args:
        follower: Points of the follower [m], (k, d).
        along: Lengths of the path up to its points [m], (m,), ascending.
        points: Its points [m], (m, d).
        s: Lengths up to its cells [m], (n,), all of them in `along`.
        match: The matched cells, (k,).
    """
    distance, nearest = np.full(len(follower), np.inf), np.zeros(len(follower))
    distance[~measured_rows(follower)] = np.nan
    ends = np.append(s, along[-1])
    first = np.searchsorted(along, ends[np.maximum(match - 1, 0)])
    last = np.maximum(np.searchsorted(along, ends[match + 1]) - 1, first)
    for step in range(int((last - first).max()) + 1):
        low = np.minimum(first + step, last)
        piece = points[low + 1] - points[low]
        squared = np.maximum(np.sum(piece**2, axis=1), 1e-300)
        share = np.clip(np.sum((follower - points[low]) * piece, axis=1) / squared, 0.0, 1.0)
        gap = np.linalg.norm(follower - points[low] - share[:, None] * piece, axis=1)
        nearer = gap < distance
        distance[nearer] = gap[nearer]
        nearest[nearer] = (along[low] + share * (along[low + 1] - along[low]))[nearer]
    return distance, nearest


def _arrivals(t: Array, match: NDArray[np.intp], s_follower: Array, s: Array, window: tuple[float, float]) -> Array:
    """Times at which the follower first reaches each s, refined below a step by the projected path length."""
    first = t[np.searchsorted(match, np.arange(len(s)), side="left")]
    # The mean of both monotone envelopes is unbiased under noise; a running maximum alone comes early.
    upper = np.maximum.accumulate(s_follower)
    lower = np.minimum.accumulate(s_follower[::-1])[::-1]
    crossing = _first_arrival(t, np.asarray((upper + lower) / 2, dtype=np.float64), s)
    return np.clip(crossing, first + window[0], first + window[1])


def _first_arrival(t: Array, s_of_t: Array, s: Array) -> Array:
    """First time at which the non-decreasing s_of_t (k,) reaches each s (m,), at latest the last time."""
    i = np.clip(np.searchsorted(s_of_t, s, side="left"), 0, len(t) - 1)
    low = np.maximum(i - 1, 0)
    rise = s_of_t[i] - s_of_t[low]
    share = np.where(rise > 0, (s - s_of_t[low]) / np.where(rise > 0, rise, 1.0), 1.0)
    return np.asarray(t[low] + np.clip(share, 0.0, 1.0) * (t[i] - t[low]), dtype=np.float64)


def histories(a: ArrayLike, b: ArrayLike, *, gaps: bool = False) -> tuple[Array, Array]:
    """Two histories as arrays of one shape (k, n), k ≥ 1; with `gaps` the second may have rows of NaN.

    Raises:
        InvalidValueError: If the shapes differ or a value isn't finite.
    """
    first, second = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if first.ndim != 2 or first.shape != second.shape or not len(first):
        raise InvalidValueError("histories", (first.shape, second.shape), "of one shape (k, n), k ≥ 1")
    unknown = np.isnan(second).all(axis=1) if gaps else np.zeros(len(second), dtype=bool)
    if not (np.isfinite(first).all() and np.isfinite(second[~unknown]).all()):
        raise InvalidValueError("histories", "NaN or infinity", "finite")
    return first, second


_STILL = 1e-6
"""Values that change by no more are at rest [rad, or their unit]."""


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """Errors between two joint histories, sample by sample."""

    joint_rms: Array
    """Root mean square error of each joint [rad], (n,)."""
    joint_max: Array
    """Largest error of each joint [rad], (n,)."""
    tool_rms: float
    """Root mean square distance of the tools [m]."""
    tool_max: float
    """Largest distance of the tools [m]."""
    angle_rms: float
    """Root mean square angle between the tools [rad]."""
    angle_max: float
    """Largest angle between the tools [rad]."""


@dataclass(frozen=True, slots=True)
class PathComparison:
    """Path error and time difference of a follower on a leader's path; None where undefined."""

    path_error_mean: float | None
    """Mean distance to the leader's path over time [m]."""
    path_error_p95: float | None
    """95 % quantile of that distance [m]."""
    path_error_max: float | None
    """Largest distance [m]."""
    time_difference_mean: float | None
    """Mean delay of the follower over the path that it reached [s]."""
    time_difference_sd: float | None
    """Standard deviation of the delay along the path [s]."""
    time_difference_max: float | None
    """Largest delay [s]."""
    time_difference_bound: float | None
    """Mean delay with the path not reached counted at the end of the record: a lower bound [s]."""
    speed_error: float | None
    """Mean difference of speeds over windows of ten cells [m/s]."""
    progress: float | None
    """Share of the leader's path that the follower reached."""


def agreement(model: RobotModel, q_a: ArrayLike, q_b: ArrayLike) -> Agreement:
    """Compare two joint histories row by row.

    Args:
        model: The robot of both.
        q_a: Joint values [rad], (k, n), k ≥ 1.
        q_b: Joint values [rad], of the same shape.

    Returns:
        Joint errors, and tool errors in the base frame.

    Raises:
        InvalidValueError: If the shapes differ or a value isn't finite.
    """
    a, b = histories(q_a, q_b)
    error = np.abs(a - b)
    X_a, X_b = model.forward(a), model.forward(b)
    distance = np.linalg.norm(X_a[:, :3, 3] - X_b[:, :3, 3], axis=1)
    # The Frobenius norm of R_a − R_b is 2 √2 sin(angle / 2): exact near zero, where arccos of a trace is not.
    chord = np.linalg.norm(X_a[:, :3, :3] - X_b[:, :3, :3], axis=(1, 2))
    angle = 2 * np.arcsin(np.minimum(chord / np.sqrt(8.0), 1.0))
    return Agreement(
        joint_rms=np.sqrt(np.mean(error**2, axis=0)),
        joint_max=error.max(axis=0),
        tool_rms=_rms(distance),
        tool_max=float(distance.max()),
        angle_rms=_rms(angle),
        angle_max=float(angle.max()),
    )


def shifted(t: Array, values: Array, offset: float) -> Array:
    """Values at t + offset: (k, d) on an evenly spaced grid t (k,), held outside.

    An offset of whole steps moves rows without any interpolation.
    """
    step = float(t[-1] - t[0]) / (len(t) - 1)
    whole = round(offset / step)
    if abs(offset - whole * step) > 1e-9 * max(1.0, abs(offset)):
        return resample(t, values, t + offset)
    return values[np.clip(np.arange(len(t)) + whole, 0, len(t) - 1)]


def best_lag(t: ArrayLike, q_leader: ArrayLike, q_follower: ArrayLike, longest: float = 10.0) -> float | None:
    """Constant lag L that brings q_follower(t + L) nearest to q_leader(t), in the joints' mean squared error.

    Args:
        t: Evenly spaced times [s], (k,).
        q_leader: Joint values [rad], (k, n).
        q_follower: Joint values [rad], (k, n); rows of NaN where it wasn't measured.
        longest: Largest lag looked at, either way [s]; at most half of the record.

    Returns:
        L [s], positive where the follower is late, refined below a step by a parabola; None where either of
        them stays in its place, which fits every lag, or nothing was measured.

    Raises:
        InvalidValueError: If the shapes differ or a value isn't finite.
    """
    a, b = histories(q_leader, q_follower, gaps=True)
    seen = measured_rows(b)
    if not seen.any() or min(float(np.ptp(q, axis=0).max()) for q in (a, b[seen])) <= _STILL:
        return None
    times = np.asarray(t, dtype=np.float64)
    step = float(times[-1] - times[0]) / (len(times) - 1)
    reach = min(round(longest / step), len(times) // 2)
    lags = np.arange(-reach, reach + 1)
    cost = np.array([_lag_cost(a, b, int(lag), None if seen.all() else seen) for lag in lags])
    # Of equal costs the smallest lag is meant.
    i = int(np.lexsort((np.abs(lags), cost))[0])
    offset = 0.0
    if 0 < i < len(lags) - 1:
        left, here, right = cost[i - 1 : i + 2]
        curvature = left - 2 * here + right
        offset = float(0.5 * (left - right) / curvature) if curvature > 0 else 0.0
    return (float(lags[i]) + offset) * step


def _lag_cost(a: Array, b: Array, lag: int, seen: NDArray[np.bool_] | None) -> float:
    """Mean squared error at a lag of so many steps; infinite where nothing was measured. `seen`: None for all."""
    leader = a[: len(a) - lag] if lag >= 0 else a[-lag:]
    follower = b[lag:] if lag >= 0 else b[: len(b) + lag]
    if seen is not None:
        kept = seen[lag:] if lag >= 0 else seen[: len(seen) + lag]
        if not kept.any():
            return np.inf
        leader, follower = leader[kept], follower[kept]
    return float(np.mean((leader - follower) ** 2))


def compare_paths(
    t: ArrayLike,
    p_leader: ArrayLike,
    p_follower: ArrayLike,
    *,
    v_max: float = 0.5,
    cell: float = 0.01,
    dt: float = 0.05,
    v_min: float = 0.02,
) -> PathComparison:
    """Path error and time difference of a follower on a leader's path, by `match_paths`.

    Args:
        t: Ascending times [s], (k,), k ≥ 2.
        p_leader: Points of the leader [m], (k, d).
        p_follower: Points of the follower [m], (k, d); rows of NaN where it wasn't measured, which count nowhere.
        v_max: Largest speed of the leader [m/s], > 0.
        cell: Length of a cell of path [m], > 0.
        dt: Step of the match [s], > 0.
        v_min: Speed of the leader below which no delay is counted [m/s], > 0.

    Returns:
        The comparison; with a leader that moves less than two cells only the path error is defined.

    Raises:
        InvalidValueError: If shapes differ, or a value isn't finite or positive where it must be.
    """
    return summed_up(match_paths(t, p_leader, p_follower, v_max=v_max, cell=cell, dt=dt, v_min=v_min))


def summed_up(match: PathMatch) -> PathComparison:
    """The figures of a match, of what was measured alone."""
    distance = match.distance[np.isfinite(match.distance)]
    mean, p95, largest = float(distance.mean()), float(np.quantile(distance, 0.95)), float(distance.max())
    cells, reached = len(match.s), len(match.t_follower)
    if cells < 3:
        return PathComparison(mean, p95, largest, None, None, None, None, None, None)
    late = match.time_difference[1]
    unreached = match.t_leader[reached:][match.moving[reached:]]
    bounded = np.concatenate((late, match.t[-1] - unreached))
    return PathComparison(
        path_error_mean=mean,
        path_error_p95=p95,
        path_error_max=largest,
        time_difference_mean=float(late.mean()) if late.size else None,
        time_difference_sd=float(late.std()) if late.size else None,
        time_difference_max=float(late.max()) if late.size else None,
        time_difference_bound=float(bounded.mean()) if bounded.size else None,
        speed_error=_speed_error(match.t_leader[:reached], match.t_follower, 10, float(match.s[1])),
        progress=float((reached - 1) / (cells - 1)),
    )


def _speed_error(t_leader: Array, t_follower: Array, window: int, cell: float) -> float | None:
    edges = np.arange(0, len(t_leader), window)
    spans = [np.maximum(np.diff(times[edges]), 1e-9) for times in (t_leader, t_follower)]
    known = np.isfinite(spans[1])
    if not known.any():
        return None
    spans = [span[known] for span in spans]
    speeds = [window * cell / span for span in spans]
    return float(np.mean(np.abs(speeds[1] - speeds[0])))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
