"""Joining a line from a moving state: the blend of Fig. 1 in task space, or a stop.

Source: Doulgeri et al., section II-B and Fig. 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import sqrt
from typing import Final

import numpy as np

from vrs.model import Array, Limits, RobotModel
from vrs.planning.certificate import violation
from vrs.planning.course import Course, rotation_vector, turning
from vrs.planning.path import DERIVATIVES, NODES
from vrs.planning.plan import Plan, empty, integrate
from vrs.segment import State

_TIMES: Final = (0.3, 0.5, 0.75, 1.0, 1.4, 2.0, 3.0)
"""Blend times to try, in times of what stopping takes and of what reaching full speed takes."""
_RATES: Final = (1.0, 0.6, 0.3)
"""Speeds at which to meet the line, as shares of its nominal speed."""
_MEET_MAX: Final = 0.9
_LOOKS: Final = 12
"""Blends that are looked at closely."""
_LENIENT: Final = 2.0
"""Of jerk limits at the beginning of a blend, where bending is left out."""


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    """A moving start in the task space of a goal: y and its derivatives by time, (6,) each."""

    y: Array
    rate: Array
    growth: Array
    goal: Array


def courses(
    state: State, goal: Array, speed: float, model: RobotModel, limits: Limits, *, smooth: bool = False
) -> Iterator[tuple[Course, float]]:
    """Yield blends onto the line to a goal that keep the limits at an even rate, the quickest first.

    With blend time b the tool goes on from (y0, y0') with the parabola that meets, at time b, the line from the
    corner y0 + y0' b/2 to the goal, at speed x' along it: x = x' b/2. A smooth blend is the quartic that also
    begins with y0'' and ends without acceleration; its corner is y0 + y0' b/2 + y0'' b²/12.

    Args:
        state: Start, moving.
        goal: Pose at the end, (4, 4).
        speed: Share v of the tool's nominal speeds.
        model: The robot.
        limits: Joint limits.
        smooth: Whether the acceleration is to be continuous and the jerk within its limits.

    Yields:
        The course, and the blend time [s].
    """
    task = _moving(state, goal, model)
    options: list[tuple[float, float, Course]] = []
    for b, share in product(_times(state, limits, smooth=smooth), _RATES):
        corner = task.y + 0.5 * b * task.rate
        if smooth:
            corner = corner + b * b / 12.0 * task.growth
        nominal = _nominal(corner, goal, speed, model)
        x = share * nominal * b / 2.0
        if 1e-6 < x < _MEET_MAX:
            # The time of the rest at nominal speed, as if it stopped at once; good enough to sort by.
            cost = b + (1.0 - x) / nominal + (1.0 - share) * b
            options.append((cost, b, _blend(task, corner, x, b, smooth=smooth)))
    for _, b, course in _promising(options, state, task, model, limits, smooth=smooth)[:_LOOKS]:
        if _fits(course, b, state, model, limits, smooth=smooth):
            yield course, b


def _times(state: State, limits: Limits, *, smooth: bool) -> list[float]:
    """Blend times to try [s]."""
    stopping = float((np.abs(state.qd) / limits.qdd_max).max())
    reaching = float((limits.qd_max / limits.qdd_max).min())
    if smooth:
        ramp = float((limits.qdd_max / limits.qddd_max).max())
        return [k * (unit + ramp) for k in _TIMES for unit in (stopping, reaching)]
    return [k * unit for k in _TIMES for unit in (stopping, reaching)]


def _blend(task: _Task, corner: Array, x: float, b: float, *, smooth: bool) -> Course:
    """The course of a blend of b seconds that meets the line at x."""
    line = np.concatenate([task.goal[:3, 3] - corner[:3], -corner[3:]])
    before, after, growth = b * task.rate, 2.0 * x * line, b * b * task.growth
    step = after - before
    rows = [task.y, before, 0.5 * step]
    if smooth:
        rows = [task.y, before, 0.5 * growth, step - 2.0 / 3.0 * growth, 0.25 * growth - 0.5 * step]
    return Course(task.y, corner, task.goal, meet=x, bend=np.array(rows))


def _promising(
    options: list[tuple[float, float, Course]],
    state: State,
    task: _Task,
    model: RobotModel,
    limits: Limits,
    *,
    smooth: bool,
) -> list[tuple[float, float, Course]]:
    """Options whose accelerations (of smooth ones: whose jerks) keep the limits at the beginning, in order."""
    if not options:
        return []
    bends = [(course.bend, b) for _, b, course in options if course.bend is not None]
    if smooth:
        change = np.array([6.0 * bend[3] / b**3 for bend, b in bends])
        change[:, 3:] = change[:, 3:] @ _rates(task.y[3:]).T
        J = model.jacobian(state.q)
        load = np.abs(np.linalg.lstsq(J, change.T, rcond=None)[0].T) / (_LENIENT * limits.qddd_max)
    else:
        growth = np.array([2.0 * bend[2] / (b * b) for bend, b in bends])
        load = np.abs(_accelerations(state, task, growth, model)) / limits.qdd_max
    kept = [option for option, one in zip(options, load.max(axis=1).tolist(), strict=True) if one <= 1.0]
    return sorted(kept, key=lambda option: option[0])


def _moving(state: State, goal: Array, model: RobotModel) -> _Task:
    """The start in task space."""
    X = model.forward(state.q)
    J = model.jacobian(state.q)
    twist = J @ state.qd
    r = rotation_vector(X[:3, :3] @ goal[:3, :3].T)
    rates = _rates(r)
    rate = np.concatenate([twist[:3], np.linalg.solve(rates, twist[3:])])
    task = _Task(np.concatenate([X[:3, 3], r]), rate, np.zeros(6), goal)
    growth = J @ state.qdd - _drift(state, task, model)
    growth[3:] = np.linalg.solve(rates, growth[3:])
    return _Task(task.y, rate, growth, goal)


def _rates(r: Array) -> Array:
    """From the rate of a rotation vector, (3,), to the angular velocity, (3, 3)."""
    return turning(np.tile(r, (3, 1)), np.eye(3)).T


def _drift(state: State, task: _Task, model: RobotModel) -> Array:
    """What bending alone makes of the accelerations: J qdd = (growth, by _rates) + drift, (6,)."""
    step = np.array([[-1e-5], [1e-5]])
    J = model.jacobian(state.q + step * state.qd)
    drift: Array = ((J[0] - J[1]) / 2e-5) @ state.qd
    r, rate = task.y[3:], task.rate[3:]
    velocity = turning(r + step * rate, np.tile(rate, (2, 1)))
    drift[3:] += (velocity[1] - velocity[0]) / 2e-5
    return drift


def _accelerations(state: State, task: _Task, growth: Array, model: RobotModel) -> Array:
    """Joint accelerations at the beginning of courses, (k, n) [rad/s²], of second derivatives of y, (k, 6)."""
    wanted = growth.copy()
    wanted[:, 3:] = growth[:, 3:] @ _rates(task.y[3:]).T
    wanted += _drift(state, task, model)
    return np.asarray(np.linalg.lstsq(model.jacobian(state.q), wanted.T, rcond=None)[0].T, dtype=np.float64)


def _nominal(corner: Array, goal: Array, speed: float, model: RobotModel) -> float:
    """Speed of x on the line from a corner to a goal [1/s]."""
    way, turn = goal[:3, 3] - corner[:3], corner[3:]
    linear, angular = sqrt(way @ way), sqrt(turn @ turn)
    return speed / max(linear / model.tool_speed, angular / model.tool_turn_speed, 1e-9)


def _fits(course: Course, b: float, state: State, model: RobotModel, limits: Limits, *, smooth: bool) -> bool:
    """Say whether the joints keep the limits on a blend of b seconds; judged at its nodes."""
    q = model.follow(course.poses(0.5 + 0.5 * NODES), state.q)
    if not np.abs(q[0] - state.q).max() < 1e-6:
        return False
    if ((q < limits.q_min) | (q > limits.q_max)).any():
        return False
    bounds = (limits.qd_max, limits.qdd_max, limits.qddd_max)
    return all(
        bool((np.abs(DERIVATIVES[k] @ q) <= (1.0 + 1e-6) * bounds[k] * (0.5 * b) ** (k + 1)).all())
        for k in range(3 if smooth else 2)
    )


def smooth_stop(state: State, limits: Limits) -> Plan | None:
    """Each joint to rest as fast as its acceleration and jerk limits allow; None where that passes a limit."""
    v, a, top, J = state.qd, state.qdd, limits.qdd_max, limits.qddd_max
    # Where the speed would end if the acceleration went to zero at once tells which way to accelerate.
    sign = np.where(v + a * np.abs(a) / (2.0 * J) > 0, -1.0, 1.0)
    v, a = v * sign, a * sign
    peak = np.sqrt(np.maximum(0.5 * a * a - J * v, 0.0))
    peak = np.minimum(peak, top)
    rise, fall = np.maximum(peak - a, 0.0) / J, peak / J
    steady = np.maximum(-v - (2.0 * peak * peak - a * a) / (2.0 * J), 0.0)
    steady = np.where(peak > 0, steady / np.where(peak > 0, peak, 1.0), 0.0)
    ends = np.cumsum([rise, steady, fall], axis=0)
    knots = np.unique(np.concatenate([[0.0], ends.ravel()]))
    knots = knots[np.concatenate([[True], np.diff(knots) > 1e-12])]
    if len(knots) < 2:
        return empty(len(v))
    middle = 0.5 * (knots[1:] + knots[:-1])[:, None]
    jerk = np.where(middle < ends[0], J, np.where((middle > ends[1]) & (middle < ends[2]), -J, 0.0)) * sign
    plan = integrate(state, np.diff(knots), jerk, 3)
    return plan if violation(plan, limits, jerk=True) is None else None
