"""Time-optimal moves between any two states through Ruckig, made exact and certified.

Ruckig's own end errors are about 1e-8 and its time synchronisation may pass position limits. So the plan is made
slightly inside the limits, its knots are put on one grid, the controls are repaired until the end is met, and
the result is certified; where it can't be, there's no plan.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vrs.chunk import State
from vrs.model import Array, Limits
from vrs.planning.plan import Plan, end_state, integrate, violation

_MARGINS = (1e-7, 1e-5, 1e-3)
_KNOT = 1e-9
_END_ERROR = 2e-10


def online(start: State, goal: State, speed: float, limits: Limits, *, order: int) -> Plan | None:
    """Plan between two states, all joints arriving together.

    Args:
        start: Where it begins.
        goal: Where it ends; its speed may raise the speed limit of the move, never beyond limits.qd_max.
        speed: Share v of the speed limits.
        limits: Limits that hold at every instant.
        order: 2 for bounded acceleration, 3 for bounded jerk.

    Returns:
        A certified plan, or None where Ruckig has none or it passes a limit.
    """
    for margin in _MARGINS:
        plan = _attempt(start, goal, speed, limits, margin, order)
        if plan is not None and violation(plan, limits, jerk=order == 3) is None:
            return plan
    return None


def _attempt(start: State, goal: State, speed: float, limits: Limits, margin: float, order: int) -> Plan | None:
    import ruckig

    n = len(start.q)
    # Made for each call: nanobind reports instances that outlive the interpreter as leaks.
    planner, trajectory = ruckig.Ruckig(n), ruckig.Trajectory(n)
    inside = 1.0 - margin
    allowed = speed * limits.qd_max
    present = np.where(np.abs(start.qd) <= allowed * (1.0 + 1e-9), np.abs(start.qd), 0.0)
    problem = ruckig.InputParameter(n)
    problem.current_position = start.q.tolist()
    problem.current_velocity = start.qd.tolist()
    problem.target_position = goal.q.tolist()
    problem.target_velocity = goal.qd.tolist()
    problem.max_velocity = np.maximum(np.maximum(allowed * inside, present), np.abs(goal.qd)).tolist()
    problem.max_acceleration = (limits.qdd_max * inside).tolist()
    if order == 3:
        problem.current_acceleration = start.qdd.tolist()
        problem.target_acceleration = goal.qdd.tolist()
        problem.max_jerk = (limits.qddd_max * inside).tolist()
        if (np.abs(goal.qdd) > limits.qdd_max * inside).any():
            return None
    else:
        problem.max_jerk = [np.inf] * n
    try:
        result = planner.calculate(problem, trajectory)
    except ruckig.RuckigError:
        return None
    if result not in (ruckig.Result.Working, ruckig.Result.Finished) or not trajectory.duration > _KNOT:
        return None
    h, control = _on_one_grid(trajectory.profiles[0], trajectory.duration, order)
    return _repaired(start, goal, h, control, order)


def _on_one_grid(profiles: list[Any], total: float, order: int) -> tuple[Array, Array]:
    """Every joint's phases on the union of their knots: durations (m,), controls (m, n)."""
    lasting, values = [], []
    for profile in profiles:
        braking, after = profile.brake, profile.accel
        lasting.append([*braking.t, *profile.t, *after.t])
        if order == 3:
            values.append([*braking.j, *profile.j, *after.j, 0.0])
        else:
            values.append([*braking.a, *profile.a[:7], *after.a, 0.0])
    ends = np.cumsum(np.array(lasting), axis=1)
    knots = np.sort(ends.ravel())
    knots = knots[(knots > _KNOT) & (knots < total - _KNOT)]
    if len(knots):
        knots = knots[np.concatenate([[True], np.diff(knots) > _KNOT])]
    grid = np.concatenate([[0.0], knots, [total]])
    middle = 0.5 * (grid[1:] + grid[:-1])
    phase = (ends[:, None, :] <= middle[:, None]).sum(2)
    return np.diff(grid), np.take_along_axis(np.array(values), phase, axis=1).T


def _repaired(start: State, goal: State, h: Array, control: Array, order: int) -> Plan | None:
    """Change the controls as little as meets the goal at these knots; None where they can't."""
    T = float(h.sum())
    left = T - np.cumsum(h)
    if order == 3:
        effect = [h**3 / 6 + h * h * left / 2 + h * left * left / 2, h * h / 2 + h * left, h]
        scale = np.array([T**-3, T**-2, 1 / T])
    else:
        effect = [h * h / 2 + h * left, h]
        scale = np.array([T**-2, 1 / T])
    M = np.array(effect) * scale[:, None]
    plan = integrate(start, h, control, order)
    for _ in range(2):
        end = end_state(plan)
        error = np.array([goal.q - end.q, goal.qd - end.qd, goal.qdd - end.qdd][:order])
        if not error.any():
            break
        control = control + np.linalg.lstsq(M, error * scale[:, None], rcond=1e-12)[0]
        plan = integrate(start, h, control, order)
    end = end_state(plan)
    short = max(np.abs(goal.q - end.q).max(), np.abs(goal.qd - end.qd).max())
    return plan if short <= _END_ERROR else None
