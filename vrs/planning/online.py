"""Time-optimal moves between any two states through Ruckig, made exact and certified.

Ruckig's own end errors are about 1e-8 and its time synchronisation may pass position limits. So the plan is made
slightly inside the limits, its knots are put on one grid, the controls are repaired until the end is met, and
the result is certified; where it can't be, there's no plan.
"""

from __future__ import annotations

import atexit
import math
from operator import itemgetter
from typing import Any

import numpy as np

from vrs.chunk import State
from vrs.model import Array, Limits
from vrs.planning.bounds import Bounds, bounds
from vrs.planning.certificate import violation
from vrs.planning.cubics import Cubics, integrated
from vrs.planning.plan import Plan, end_state, integrate, packed

_idle: dict[tuple[int, int], list[tuple[Any, Any, Any]]] = {}
"""Planners, trajectories and problems for so many joints and an order: they take half as long to make as to use."""
# nanobind reports instances that outlive the interpreter as leaks.
atexit.register(_idle.clear)

_MARGINS = (0.0, 1e-7, 1e-5, 1e-3)
"""Of the limits. First none: a joint may need all of its jerk to stay below its speed limit."""
_KNOT = 1e-9
_TIME = itemgetter(0)
_ROUNDED = 1e-15
"""Share of a duration that's only rounding."""
_END_ERROR = 2e-10
"""Root of the sum of squares of position [rad], speed [rad/s] and acceleration [rad/s²] missing at a plan's end."""
_AIM = 1e-11
"""The same, where repairs can reach it; in moves of minutes rounding leaves more."""
_DEPENDENT = 1e-12
"""Share of a row of weights that's only rounding."""


def online(start: State, goal: State, speed: float, limits: Limits, *, order: int) -> Plan | None:
    """Plan between two states, all joints arriving together.

    Args:
        start: Where it begins.
        goal: Where it ends; what it demands may raise the speed limit of the move, never beyond limits.qd_max.
        speed: Share v of the speed limits.
        limits: Limits that hold at every instant.
        order: 2 for bounded acceleration, 3 for bounded jerk.

    Returns:
        A certified plan, or None where Ruckig has none or it passes a limit.
    """
    for margin in _MARGINS:
        found = _attempt(start, goal, speed, bounds(limits), margin, order)
        made = None if found is None else _exact(start, goal, *found, order)
        if made is None:
            continue
        if isinstance(made, Cubics):
            sure, plan = made.keeps(limits), made.plan()
        else:
            sure, plan = False, made
        problem = None if sure else violation(plan, limits, jerk=order == 3)
        if problem is None:
            return plan
        if "position" in problem:
            # A way round that a margin of the other limits doesn't shorten.
            return None
    return None


def _attempt(
    start: State, goal: State, speed: float, bound: Bounds, margin: float, order: int
) -> tuple[Array, Array] | None:
    """Ruckig's motion on one grid: durations (m,), controls (m, n); None where it has none."""
    import ruckig

    n = len(start.q)
    idle = _idle.setdefault((n, order), [])
    # Popping and appending are atomic: a set is one caller's while it's used.
    try:
        tools = idle.pop()
    except IndexError:
        tools = ruckig.Ruckig(n), ruckig.Trajectory(n), ruckig.InputParameter(n)
    planner, trajectory, problem = tools
    inside = 1.0 - margin
    qd, qd_end = start.qd.tolist(), goal.qd.tolist()
    problem.current_position, problem.target_position = start.q.tolist(), goal.q.tolist()
    problem.current_velocity, problem.target_velocity = qd, qd_end
    greatest, hardest = bound.qdd_max, bound.qddd_max
    if margin:
        greatest, hardest = (tuple(limit * inside for limit in rate) for rate in (greatest, hardest))
    problem.max_acceleration = greatest
    if order == 3:
        qdd, qdd_end = start.qdd.tolist(), goal.qdd.tolist()
        problem.current_acceleration, problem.max_jerk = qdd, hardest
        ahead, before = _peaks(qd, qdd, hardest), qd_end
        if any(qdd_end):
            # A little beyond is rounding, which the repair makes good; Ruckig allows for none.
            within = [min(max(a, -g), g) for a, g in zip(qdd_end, greatest, strict=True)]
            if math.dist(within, qdd_end) > _AIM:
                return None
            before, qdd_end = _peaks(qd_end, [-a for a in within], hardest), within
        problem.target_acceleration = qdd_end
    else:
        problem.max_jerk = [np.inf] * n
        ahead, before = qd, qd_end
    fastest = []
    for limit, soon, just in zip(bound.qd_max, map(abs, ahead), map(abs, before), strict=True):
        top = speed * limit
        # A joint that is too fast already is left to slow down at once.
        allowed = soon if top * inside < soon <= top * (1.0 + 1e-9) else top * inside
        fastest.append(allowed if allowed > just else just)
    problem.max_velocity = fastest
    try:
        result = planner.calculate(problem, trajectory)
    except ruckig.RuckigError:
        return None
    total = trajectory.duration
    if result not in (ruckig.Result.Working, ruckig.Result.Finished) or not total > _KNOT:
        return None
    found = _on_one_grid(trajectory.profiles[0], total, order)
    idle.append(tools)
    return found


def _peaks(qd: list[float], qdd: list[float], jerk: tuple[float, ...]) -> list[float]:
    """Speeds [rad/s] that a state can't but reach; with its accelerations reversed, that it can't but come from."""
    # A little more, or Ruckig's own rounding finds it beyond.
    return [
        (abs(v) + 0.5 * a * a / j) * (1.0 + 1e-12) if v * a > 0.0 else v
        for v, a, j in zip(qd, qdd, jerk, strict=True)
    ]


def _on_one_grid(profiles: list[Any], total: float, order: int) -> tuple[Array, Array]:
    """Every joint's phases on the union of their knots: durations (m,), controls (m, n)."""
    changes: list[tuple[float, int, float]] = []
    current = [0.0] * len(profiles)
    for joint, profile in enumerate(profiles):
        times, values = profile.t, profile.j if order == 3 else profile.a
        # Looking for more phases takes longer than finding that these fill the time.
        if total - sum(times) > _ROUNDED * total:
            before, after = profile.brake, profile.accel
            if before.duration > 0.0:
                times, values = before.t + times, (before.j if order == 3 else before.a) + values
            if after.duration > 0.0:
                times, values = times + after.t, values[: len(times)] + (after.j if order == 3 else after.a)
        begin = present = 0.0
        # Ruckig gives one acceleration more than times.
        for lasting, value in zip(times, values, strict=False):
            if lasting > 0.0:
                if value != present:
                    present = value
                    if begin > _KNOT:
                        changes.append((begin, joint, value))
                    else:
                        current[joint] = value
                begin += lasting
        changes.append((begin, joint, 0.0))
    # Sorting by one float takes half as long as by tuples.
    changes.sort(key=_TIME)
    durations: list[float] = []
    controls: list[float] = []
    knot = 0.0
    last = total - _KNOT
    for begin, joint, value in changes:
        if begin > knot + _KNOT:
            if begin >= last:
                break
            durations.append(begin - knot)
            controls += current
            knot = begin
        current[joint] = value
    durations.append(total - knot)
    controls += current
    return np.array(durations), packed(controls).reshape(-1, len(profiles))


def _exact(start: State, goal: State, h: Array, control: Array, order: int) -> Cubics | Plan | None:
    """What these controls make, changed as little as meets the goal; None where they can't."""
    aim = [*goal.q.tolist(), *goal.qd.tolist(), *goal.qdd.tolist()][: order * len(goal.q)]
    for _ in range(4):
        made: Cubics | Plan
        if order == 3:
            made = integrated(start, h, control)
            end = made.end
        else:
            made = integrate(start, h, control, 2)
            last = end_state(made)
            end = np.array([last.q, last.qd])
        error = math.dist(aim, end.ravel().tolist())
        if error <= _AIM:
            return made
        control = control + _least_change(h, np.array(aim).reshape(end.shape) - end)
    return made if error <= _END_ERROR else None


def _least_change(h: Array, missing: Array) -> Array:
    """The smallest change of the controls, (m, n), that adds what's missing of q, qd (and qdd) at the end.

    By Gram and Schmidt with a second pass. Not by the normal equations: where one long cruise outweighs the rest,
    they're nearly singular.

    Args:
        h: Durations [s], (m,).
        missing: (2, n), or (3, n) for jerks.
    """
    T = sum(h.tolist())
    share = h * (1.0 / T)
    middle = (1.0 + 0.5 * share) - share.cumsum()
    # What a control does to each derivative at the end, the highest first, in units of T.
    weights = [share, share * middle, share * (0.5 * middle * middle + (1.0 / 24.0) * share * share)]
    change = np.zeros((len(h), missing.shape[1]))
    rows: list[Array] = []
    for k, lacking in enumerate(missing[::-1] / T ** np.arange(1.0, len(missing) + 1.0)[:, None]):
        weight = weights[k]
        row = weight
        for _ in range(2):
            for before in rows:
                row = row - row.dot(before) * before
        length = math.sqrt(row.dot(row))
        if length > _DEPENDENT * math.sqrt(weight.dot(weight)):
            rows.append(row / length)
            change += rows[-1][:, None] * ((lacking - weight.dot(change)) / length)
    return change
