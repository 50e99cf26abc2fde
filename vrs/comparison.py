"""How far two robots are apart: joint and tool errors, best lag, tool path and time difference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vrs.errors import InvalidValueError
from vrs.model import Array, RobotModel

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
    a, b = _histories(q_a, q_b)
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


def resample(t: Array, values: Array, t_new: Array) -> Array:
    """Values (k, d) known at ascending times t (k,), linear in between and held outside, at t_new (m,)."""
    columns = [np.interp(t_new, t, values[:, i]) for i in range(values.shape[1])]
    return np.stack(columns, axis=1)


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
    """Constant lag L that brings q_follower(t + L) nearest to q_leader(t), in the joints' squared error.

    Args:
        t: Evenly spaced times [s], (k,).
        q_leader: Joint values [rad], (k, n).
        q_follower: Joint values [rad], (k, n).
        longest: Largest lag looked at, either way [s]; at most half of the record.

    Returns:
        L [s], positive where the follower is late, refined below a step by a parabola; None where either of
        them stays in its place, which fits every lag.

    Raises:
        InvalidValueError: If the shapes differ or a value isn't finite.
    """
    a, b = _histories(q_leader, q_follower)
    if min(float(np.ptp(q, axis=0).max()) for q in (a, b)) <= _STILL:
        return None
    times = np.asarray(t, dtype=np.float64)
    step = float(times[-1] - times[0]) / (len(times) - 1)
    reach = min(round(longest / step), len(times) // 2)
    lags = np.arange(-reach, reach + 1)
    cost = np.array([_lag_cost(a, b, int(lag)) for lag in lags])
    # Of equal costs the smallest lag is meant.
    i = int(np.lexsort((np.abs(lags), cost))[0])
    offset = 0.0
    if 0 < i < len(lags) - 1:
        left, here, right = cost[i - 1 : i + 2]
        curvature = left - 2 * here + right
        offset = float(0.5 * (left - right) / curvature) if curvature > 0 else 0.0
    return (float(lags[i]) + offset) * step


def _lag_cost(a: Array, b: Array, lag: int) -> float:
    leader = a[: len(a) - lag] if lag >= 0 else a[-lag:]
    follower = b[lag:] if lag >= 0 else b[: len(b) + lag]
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
    """Path error and time difference by a causal, monotone match of the follower to the leader's path.

    The match j(t) is a non-decreasing cell along the leader's path, reached by the leader no later than t,
    that advances by at most 2 v_max dt a step and has the smallest sum of squared distances. It is exact:
    dynamic programming over the whole record, ties going to the smaller advance.

    Args:
        t: Ascending times [s], (k,), k ≥ 2.
        p_leader: Points of the leader [m], (k, d).
        p_follower: Points of the follower [m], (k, d).
        v_max: Largest speed of the leader [m/s], > 0.
        cell: Length of a cell of path [m], > 0.
        dt: Step of the match [s], > 0.
        v_min: Speed of the leader below which no delay is counted [m/s], > 0.

    Returns:
        The comparison; with a leader that moves less than two cells only the path error is defined.

    Raises:
        InvalidValueError: If shapes differ, or a value isn't finite or positive where it must be.
    """
    leader, follower = _histories(p_leader, p_follower)
    times = np.asarray(t, dtype=np.float64)
    if times.shape != (len(leader),) or len(times) < 2 or not (np.diff(times) > 0).all():
        raise InvalidValueError("t", times.shape, f"ascending times, shape ({len(leader)},), two or more")
    for name, value in (("v_max", v_max), ("cell", cell), ("dt", dt), ("v_min", v_min)):
        if not 0 < value < np.inf:
            raise InvalidValueError(name, value, "positive and finite")
    grid = times[0] + dt * np.arange(int(np.floor((times[-1] - times[0]) / dt + 1e-9)) + 1)
    follower = resample(times, follower, grid)

    s_of_t = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(leader, axis=0), axis=1))))
    cells = int(np.floor(s_of_t[-1] / cell + 1e-9)) + 1
    s = cell * np.arange(cells, dtype=np.float64)
    t_leader = _first_arrival(times, s_of_t, s)
    path = resample(times, leader, t_leader)
    if cells < 3:
        distance = np.linalg.norm(follower - path[0], axis=1)
        return PathComparison(*_spread(distance), None, None, None, None, None, None)

    match = _match(grid, follower, t_leader, path, max(1, round(2 * v_max * dt / cell)))
    s_all = np.append(s, s_of_t[-1])
    distance, s_follower = _project(follower, np.vstack((path, leader[-1])), s_all, match)
    reached = np.arange(cells) <= match[-1]
    window = (-dt, dt + 0.5 * cell / v_min)
    t_follower = _arrivals(grid, match, s_follower, s[reached], window)

    # The start is reached by definition; a cell beside a standstill says nothing about delay.
    moving = np.zeros(cells, dtype=bool)
    moving[1:-1] = 2 * cell > v_min * (t_leader[2:] - t_leader[:-2])
    counted = moving & reached
    late = t_follower[counted[reached]] - t_leader[counted]
    bounded = np.concatenate((late, grid[-1] - t_leader[moving & ~reached]))
    mean, p95, largest = _spread(distance)
    return PathComparison(
        path_error_mean=mean,
        path_error_p95=p95,
        path_error_max=largest,
        time_difference_mean=float(late.mean()) if late.size else None,
        time_difference_sd=float(late.std()) if late.size else None,
        time_difference_max=float(late.max()) if late.size else None,
        time_difference_bound=float(bounded.mean()) if bounded.size else None,
        speed_error=_speed_error(t_leader[reached], t_follower, 10, cell),
        progress=float(match[-1] / (cells - 1)),
    )


def _match(t: Array, follower: Array, t_leader: Array, path: Array, advance: int) -> NDArray[np.intp]:
    """Best matched cell at every time, (k,)."""
    cells = len(path)
    known = np.searchsorted(t_leader, t + 1e-9, side="right")
    cost = np.full(cells, np.inf)
    cost[0] = 0.0
    steps = np.zeros((len(t), cells), dtype=np.min_scalar_type(advance))
    padded = np.full(cells + advance, np.inf)
    for k in range(len(t)):
        n = int(known[k])
        padded[advance:] = cost
        best, step = cost[:n].copy(), steps[k, :n]
        if k:
            for a in range(1, advance + 1):
                other = padded[advance - a : advance - a + n]
                better = other < best
                best[better] = other[better]
                step[better] = a
        cost[:n] = best + np.sum((path[:n] - follower[k]) ** 2, axis=1)
    match = np.empty(len(t), dtype=np.intp)
    match[-1] = int(np.argmin(cost))
    for k in range(len(t) - 1, 0, -1):
        match[k - 1] = match[k] - int(steps[k, match[k]])
    return match


def _project(follower: Array, path: Array, s_path: Array, match: NDArray[np.intp]) -> tuple[Array, Array]:
    """Distance to the polyline beside each matched cell, and the path length of the nearest point."""
    distance, s = np.full(len(follower), np.inf), np.zeros(len(follower))
    for start in (match - 1, match):
        low = np.clip(start, 0, len(path) - 2)
        along = path[low + 1] - path[low]
        squared = np.maximum(np.sum(along**2, axis=1), 1e-300)
        share = np.clip(np.sum((follower - path[low]) * along, axis=1) / squared, 0.0, 1.0)
        gap = np.linalg.norm(follower - path[low] - share[:, None] * along, axis=1)
        nearer = gap < distance
        distance[nearer], s[nearer] = (
            gap[nearer],
            (s_path[low] + share * (s_path[low + 1] - s_path[low]))[nearer],
        )
    return distance, s


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


def _speed_error(t_leader: Array, t_follower: Array, window: int, cell: float) -> float | None:
    edges = np.arange(0, len(t_leader), window)
    if len(edges) < 2:
        return None
    spans = [np.maximum(np.diff(times[edges]), 1e-9) for times in (t_leader, t_follower)]
    speeds = [window * cell / span for span in spans]
    return float(np.mean(np.abs(speeds[1] - speeds[0])))


def _spread(distance: Array) -> tuple[float, float, float]:
    return float(distance.mean()), float(np.quantile(distance, 0.95)), float(distance.max())


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _histories(a: ArrayLike, b: ArrayLike) -> tuple[Array, Array]:
    first, second = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if first.ndim != 2 or first.shape != second.shape or not len(first):
        raise InvalidValueError("histories", (first.shape, second.shape), "of one shape (k, n), k ≥ 1")
    if not (np.isfinite(first).all() and np.isfinite(second).all()):
        raise InvalidValueError("histories", "NaN or infinity", "finite")
    return first, second
