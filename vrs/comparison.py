"""How far two robots are apart: joint and tool errors, best lag, tool path and time difference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vrs.model import Array, RobotModel
from vrs.path_matching import PathMatch, histories, match_paths, measured_rows, resample

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
    mean, p95, largest = _spread(match.distance[np.isfinite(match.distance)])
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


def _spread(distance: Array) -> tuple[float, float, float]:
    return float(distance.mean()), float(np.quantile(distance, 0.95)), float(distance.max())


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
