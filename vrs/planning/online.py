"""Time-optimal moves between any two states through Ruckig, made exact and certified.

Ruckig's own end errors are about 1e-8 and its time synchronisation may pass position limits. So the plan is made
slightly inside the limits, its knots are put on one grid, the controls are repaired until the end is met, and
the result is certified; where it can't be, there's no plan.

`Cubics` below: pieces of constant jerk on common knots, with their states, certificate and polynomials.
"""

from __future__ import annotations

import atexit
import math
from functools import lru_cache
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from vrs.model import Array, Limits
from vrs.planning.certificate import TOLERANCE, Bounds, bounds, find_violation
from vrs.planning.plan import TAYLOR, Plan, end_state, integrate, packed
from vrs.segment import State


class Cubics(NamedTuple):
    """What a jerk does to a state, as Bernstein coefficients: each piece lies within the hull of its own."""

    h: Array
    """Durations [s], (m,)."""
    points: Array
    """(7, m + 1, n): position, speed, acceleration and jerk at the knots, the inner coefficient of the speed and
    both of the position. What the last knot has no value for is 0 or its position."""

    @property
    def end(self) -> Array:
        """q, qd and qdd at the end, (3, n)."""
        return self.points[:3, -1]

    def keeps(self, limits: Limits) -> bool:
        """Whether every piece lies within the limits at every instant, with the certificate's tolerance."""
        middle, half = _box(limits, len(self.h))
        distance = self.points - middle
        np.abs(distance, distance)
        # Counting is several times quicker than `all`, and NaN isn't inside. Hulls are outside in few plans.
        inside = np.count_nonzero(distance <= half) == distance.size
        return inside or find_violation(self.plan(), limits, jerk=True) is None

    def plan(self) -> Plan:
        """The polynomials."""
        states = self.points[:4, :-1].swapaxes(0, 1)
        return Plan(self.h, np.multiply(states, TAYLOR, np.empty(states.shape)))


def integrated(state: State, h: Array, jerk: Array) -> Cubics:
    """The pieces that follow from a state.

    Args:
        state: Start.
        h: Durations [s], (m,).
        jerk: [rad/s³] of each piece, (m, n).
    """
    m, n = jerk.shape
    points = np.zeros((7, m + 1, n))
    q, qd, qdd, qddd, qd_inner, q_early, q_late = points
    # Arrays of one shape: broadcasting would double what an operation costs.
    third = h.repeat(n).reshape(m, n)
    half = 0.5 * third
    qddd[:m] = jerk
    qdd[0] = state.qdd
    np.multiply(third, jerk, qdd[1:])
    np.add.accumulate(qdd, 0, None, qdd)
    rise, steps = qdd[:m] * half, qd[1:]
    np.multiply(qdd[1:], half, steps)
    steps += rise
    qd[0] = state.qd
    np.add.accumulate(qd, 0, None, qd)
    inner = np.add(qd[:m], rise, qd_inner[:m])
    # A piece covers its duration times the mean of its speed's coefficients.
    third *= 1.0 / 3.0
    early, late, steps = qd[:m] * third, inner * third, q[1:]
    np.multiply(qd[1:], third, steps)
    steps += early
    steps += late
    q[0] = state.q
    np.add.accumulate(q, 0, None, q)
    q_early[m] = q_late[m] = q[m]
    np.add(np.add(q[:m], early, q_early[:m]), late, q_late[:m])
    return Cubics(h, points)


def roots(a: float, b: float, c: float) -> list[float]:
    """Real roots of a u² + b u + c, a = 0 included."""
    square = b * b - 4.0 * a * c
    if square < 0.0:
        return []
    stable = -0.5 * (b + math.copysign(math.sqrt(square), b))
    return [over / under for over, under in ((stable, a), (c, stable)) if under]


@lru_cache(maxsize=128)
def _box(limits: Limits, m: int) -> tuple[Array, Array]:
    """Middle and half of the ranges that limits allow with their tolerances, for each of `Cubics.points`."""
    bound = bounds(limits)
    low, high = np.array(bound.lowest), np.array(bound.highest)
    qd, qdd, qddd = (rate * (1.0 + TOLERANCE) for rate in (limits.qd_max, limits.qdd_max, limits.qddd_max))
    q = 0.5 * (high - low)
    half = np.array([q, qd, qdd, qddd, qd, q, q])
    middle = np.zeros_like(half)
    middle[[0, 5, 6]] = 0.5 * (low + high)
    return np.repeat(middle[:, None], m + 1, axis=1), np.repeat(half[:, None], m + 1, axis=1)


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
        if isinstance(made, Cubics) and made.keeps(limits):
            return made.plan()
        plan = made.plan() if isinstance(made, Cubics) else made
        problem = find_violation(plan, limits, jerk=order == 3)
        if problem is None:
            return plan
        if problem.derivative == 0:
            # A way round that a margin of the other limits doesn't shorten.
            return None
    return None


def _attempt(
    start: State, goal: State, speed: float, bound: Bounds, margin: float, order: int
) -> tuple[Array, Array] | None:
    """Ruckig's motion on one grid: durations (m,), controls (m, n); None where it has none."""
    try:
        import ruckig
    except ImportError:
        # Some machines have no wheel of it; then moves from motion brake first.
        return None
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
            if lasting:
                if value != present:
                    present = value
                    changes.append((begin, joint, value))
                begin += lasting
        changes.append((begin, joint, 0.0))
    # Sorting by one float takes half as long as by tuples.
    changes.sort(key=_TIME)
    durations: list[float] = []
    controls: list[float] = []
    knot, soon = 0.0, _KNOT
    last = total - _KNOT
    for begin, joint, value in changes:
        if begin > soon:
            if begin >= last:
                break
            durations.append(begin - knot)
            controls += current
            knot, soon = begin, begin + _KNOT
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
            made = integrate(start, h, control)
            last = end_state(made)
            end = np.array([last.q, last.qd])
        error = math.dist(aim, end.ravel().tolist())
        if error <= _AIM:
            return made
        control = control + least_change(h, np.array(aim).reshape(end.shape) - end)
    return made if error <= _END_ERROR else None


def least_change(h: Array, missing: Array) -> Array:
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
