"""Straight-line moves of the tool, planned as joint polynomials.

The joints along the line are found first, as functions of a parameter; then the fastest time law within the
limits; then polynomials of both together, which are what is certified. A moving arm is led onto the line by the
blend of Fig. 1 in task space, or it stops first. Source: Doulgeri et al., section II-B.

What bars a line, a position limit or a singularity, is named with the joint and the place.

One concept in over 600 lines: a line from rest, and the ways onto it from a moving state.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import sqrt
from typing import Final

import numpy as np

from vrs.commands import Profile
from vrs.errors import PlanningError, UnresolvedError
from vrs.model import Array, Limits, RobotModel, for_people
from vrs.notes import Note, NoteCode, Notes
from vrs.planning import parabolic
from vrs.planning.along import Samples, Traversal, sampled
from vrs.planning.certificate import violation
from vrs.planning.jerk_limited import rest_to_rest as smooth_rest_to_rest
from vrs.planning.jerk_limited import stop
from vrs.planning.path import (
    DERIVATIVES,
    NODES,
    RESOLVED,
    Course,
    Path,
    bare,
    rotation_vector,
    stuck,
    trace,
    turning,
)
from vrs.planning.plan import Plan, empty, end_state
from vrs.planning.redundancy import TASK
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


def blend_courses(
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
    start = _moving(state, goal, model)
    y, rate, growth = start
    options: list[tuple[float, float, Course]] = []
    for b, share in product(_times(state, limits, smooth=smooth), _RATES):
        corner = y + 0.5 * b * rate
        if smooth:
            corner = corner + b * b / 12.0 * growth
        nominal = _nominal(corner, goal, speed, model)
        x = share * nominal * b / 2.0
        if 1e-6 < x < _MEET_MAX:
            # The time of the rest at nominal speed, as if it stopped at once; good enough to sort by.
            cost = b + (1.0 - x) / nominal + (1.0 - share) * b
            options.append((cost, b, _blend(start, corner, goal, x, b, smooth=smooth)))
    for _, b, course in _promising(options, state, start, model, limits, smooth=smooth)[:_LOOKS]:
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


def _blend(start: Array, corner: Array, goal: Array, x: float, b: float, *, smooth: bool) -> Course:
    """The course of a blend of b seconds that meets the line at x."""
    line = np.concatenate([goal[:3, 3] - corner[:3], -corner[3:]])
    y, before, after, growth = start[0], b * start[1], 2.0 * x * line, b * b * start[2]
    step = after - before
    rows = [y, before, 0.5 * step]
    if smooth:
        rows = [y, before, 0.5 * growth, step - 2.0 / 3.0 * growth, 0.25 * growth - 0.5 * step]
    return Course(y, corner, goal, meet=x, bend=np.array(rows))


def _promising(
    options: list[tuple[float, float, Course]],
    state: State,
    start: Array,
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
        change[:, 3:] = change[:, 3:] @ _rates(start[0, 3:]).T
        J = model.jacobian(state.q)
        load = np.abs(np.linalg.lstsq(J, change.T, rcond=None)[0].T) / (_LENIENT * limits.qddd_max)
    else:
        growth = np.array([2.0 * bend[2] / (b * b) for bend, b in bends])
        load = np.abs(_accelerations(state, start, growth, model)) / limits.qdd_max
    kept = [option for option, one in zip(options, load.max(axis=1).tolist(), strict=True) if one <= 1.0]
    return sorted(kept, key=lambda option: option[0])


def _moving(state: State, goal: Array, model: RobotModel) -> Array:
    """The start in the task space of a goal: y and its first two derivatives by time, (3, 6)."""
    X = model.forward(state.q)
    J = model.jacobian(state.q)
    twist = J @ state.qd
    r = rotation_vector(X[:3, :3] @ goal[:3, :3].T)
    rates = _rates(r)
    rate = np.concatenate([twist[:3], np.linalg.solve(rates, twist[3:])])
    y = np.concatenate([X[:3, 3], r])
    growth = J @ state.qdd - _drift(state, y, rate, model)
    growth[3:] = np.linalg.solve(rates, growth[3:])
    return np.array([y, rate, growth])


def _rates(r: Array) -> Array:
    """From the rate of a rotation vector, (3,), to the angular velocity, (3, 3)."""
    return turning(np.tile(r, (3, 1)), np.eye(3)).T


def _drift(state: State, y: Array, rate: Array, model: RobotModel) -> Array:
    """What bending alone makes of the accelerations: J qdd = (growth, by _rates) + drift, (6,)."""
    step = np.array([[-1e-5], [1e-5]])
    J = model.jacobian(state.q + step * state.qd)
    drift: Array = ((J[0] - J[1]) / 2e-5) @ state.qd
    velocity = turning(y[3:] + step * rate[3:], np.tile(rate[3:], (2, 1)))
    drift[3:] += (velocity[1] - velocity[0]) / 2e-5
    return drift


def _accelerations(state: State, start: Array, growth: Array, model: RobotModel) -> Array:
    """Joint accelerations of blends at their beginning, (k, n) [rad/s²], of second derivatives of y, (k, 6)."""
    wanted = growth.copy()
    wanted[:, 3:] = growth[:, 3:] @ _rates(start[0, 3:]).T
    wanted += _drift(state, start[0], start[1], model)
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


SINGULAR: Final = 100.0
"""Condition number, linear rows of the Jacobian divided by the model's length, above which a path is refused."""

_SLACK: Final = 5e-10
_CLOSE: Final = 0.5


def condition(model: RobotModel, q: Array) -> Array:
    """Condition numbers of the Jacobian at q, (k, n), its linear rows divided by the model's length: (k,).

    Numbers below half of SINGULAR may be given as an upper bound.
    """
    J = bare(model).jacobian(q)
    J[:, :3] /= model.characteristic_length
    if J.shape[1] != J.shape[2]:
        return _exact(J)
    with np.errstate(all="ignore"):
        inverse = _inverse(J)
        bound: Array = np.sqrt((J * J).sum((1, 2)) * (inverse * inverse).sum((1, 2)))
    doubtful = ~(bound < _CLOSE * SINGULAR)
    if doubtful.any():
        bound[doubtful] = _exact(J[doubtful])
    return bound


def _inverse(J: Array) -> Array:
    try:
        return np.asarray(np.linalg.inv(J), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.full(J.shape, np.inf)


def _exact(J: Array) -> Array:
    values = np.linalg.svd(J, compute_uv=False)
    with np.errstate(divide="ignore"):
        ratio: Array = values[:, 0] / values[:, -1]
    return ratio


def obstacle(path: Path, s: Array, q: Array, model: RobotModel, limits: Limits) -> str | None:
    """Say what bars a path first; None if nothing does.

    A path may begin at a singularity if it leaves it, its condition number falling until it's below SINGULAR.

    Args:
        path: The path.
        s: Parameters of samples, (k,), increasing, both ends included.
        q: Joints there [rad], (k, n).
        model: The robot.
        limits: Position limits.
    """
    every = np.append(np.arange(0, len(s) - 1, 2), len(s) - 1)
    found = [_limit(path, s, q, limits, model), _singularity(path, s[every], q[every], model)]
    return min((one for one in found if one is not None), default=(0.0, None))[1]


def _limit(path: Path, s: Array, q: Array, limits: Limits, model: RobotModel) -> tuple[float, str] | None:
    excess = np.maximum(q - limits.q_max, limits.q_min - q)
    outside = np.flatnonzero((excess > _SLACK).any(1))
    if not len(outside):
        return None
    i = int(outside[0])
    j = int(excess[i].argmax())
    bound = float(limits.q_max[j] if q[i, j] > limits.q_max[j] else limits.q_min[j])
    where = float(s[i])
    if i and excess[i, j] > excess[i - 1, j]:
        where -= float((s[i] - s[i - 1]) * min(excess[i, j] / (excess[i, j] - excess[i - 1, j]), 1.0))
    most, unit = for_people(j, bound, model.prismatic)
    return where, f"joint {j + 1} would pass its limit of {most:.6g} {unit} at {path.course.place(where)}"


def _singularity(path: Path, s: Array, q: Array, model: RobotModel) -> tuple[float, str] | None:
    c = condition(model, q)
    near = np.flatnonzero(c > _CLOSE * SINGULAR)
    if not len(near):
        return None
    # A peak between samples: look closer round each that stands out.
    peaks = [i for i in near if 0 < i < len(c) - 1 and c[i] >= c[i - 1] and c[i] >= c[i + 1]]
    if peaks:
        extra = np.concatenate([np.linspace(s[i - 1], s[i + 1], 19)[1:-1] for i in peaks])
        more = path.value(extra)[:, 0]
        s, q = np.concatenate([s, extra]), np.concatenate([q, more])
        order = np.argsort(s, kind="stable")
        s, q = s[order], q[order]
        c = np.concatenate([c, condition(model, more)])[order]
    above = c > SINGULAR
    if not above.any():
        return None
    leaving = 0
    while leaving < len(c) and above[leaving] and (leaving == 0 or c[leaving] <= c[leaving - 1] * (1.0 + 1e-6)):
        leaving += 1
    bad = np.flatnonzero(above[leaving:])
    if not len(bad):
        return None
    first = leaving + int(bad[0])
    worst = first + int(c[first:].argmax())
    joint = stuck(model, q[first])
    return float(s[first]), (
        f"it passes too near a singularity, where joint {joint + 1} turns too fast, at "
        f"{path.course.place(float(s[first]))}: condition number up to {c[worst]:.3g}, at most {SINGULAR:g} allowed"
    )


NEGLIGIBLE: Final = 1e-12
"""A way [m] and a turn [rad] below which there's nothing to move."""
STANDING: Final = 7e-7
"""How far the tool may stir [m, rad] while joints turn on the spot."""

_HARD: Final = 1e5
"""Condition number from which on a pose may count as one that leaves joints free."""
_RESTING: Final = 1e-11
"""Speed [rad/s], and acceleration [rad/s²], that rounding leaves of rest."""
_PIECES: Final = 8.0
"""Series to begin with for each radian, or characteristic length, of a line."""
_TRIALS: Final = 4
"""Blends that are planned in full before the arm brakes instead."""
_SAME: Final = 1e-6
"""Difference of joint values [rad] under which two solutions of a pose are one."""


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    """What a line is asked for."""

    goal: Array
    speed: float
    profile: Profile
    model: RobotModel
    limits: Limits
    q_goal: Array | None
    configuration: str | None


def line(
    state: State,
    X_goal: Array,
    speed: float,
    profile: Profile,
    model: RobotModel,
    limits: Limits,
    *,
    q_goal: Array | None = None,
    configuration: str | None = None,
) -> tuple[Plan, Notes]:
    """Plan from any state to rest at a pose, the tool on a straight line.

    The tool turns evenly about one axis, the shorter way. From a moving state a blend leads onto the line; where
    none is found that keeps the limits, the arm brakes and the line starts where it stopped.

    Args:
        state: Start.
        X_goal: Pose to reach, (4, 4).
        speed: Share v of the tool's nominal speeds and of the joints' speed limits, in (0, 1].
        profile: Time law.
        model: The robot.
        limits: Limits that hold at every instant.
        q_goal: Joint solution of X_goal to arrive at [rad], (n,); None takes what the line leads to.
        configuration: Words of the configuration that the line must be in; None keeps the arm's own.

    Returns:
        The plan, whose last position is the joint solution that was reached, and what the user must know of it.

    Raises:
        PlanningError: If the line leaves the workspace, crosses a limit, passes or ends too near a singularity,
            or needs another configuration; the message names the joint and the place.
        UnreachablePoseError: If the arm is there, but not in the configuration asked for, which has no solution.
    """
    task = _Task(_proper(X_goal), speed, profile, model, limits, q_goal, configuration)
    jerky = profile is Profile.JERK_LIMITED
    if np.abs(state.qd).max() <= _RESTING and not (jerky and np.abs(state.qdd).max() > _RESTING):
        return _from_rest(state.q, task)
    blended = _blended(state, task)
    if blended is not None:
        return blended
    braking, notes = _stopped(state, task)
    plan, more = _from_rest(end_state(braking).q if len(braking) else state.q, task)
    return braking.then(plan), (*notes, *more)


def _proper(X: Array) -> Array:
    """The pose with the nearest orthonormal rotation."""
    U, _, Vt = np.linalg.svd(X[:3, :3])
    proper = np.array(X, dtype=np.float64)
    proper[:3, :3] = U @ Vt
    return proper


def _vector(X: Array, goal: Array) -> Array:
    """Position and rotation vector relative to the goal's orientation, (6,)."""
    return np.concatenate([X[:3, 3], rotation_vector(X[:3, :3] @ goal[:3, :3].T)])


def _from_rest(q: Array, task: _Task) -> tuple[Plan, Notes]:
    model = task.model
    hardness = float(condition(model, q[None])[0])
    start = _snapped(q, model) if hardness > _HARD else q
    free = hardness > _HARD and bool(np.abs(start - q).max() <= STANDING)
    if not free:
        start = q
    y = _vector(model.forward(start), task.goal)
    course = Course(y, y, task.goal)
    if max(course.length, course.angle) <= NEGLIGIBLE:
        _check_arrival(q, task)
        if task.configuration is not None:
            other = model.inverse_near(task.goal, q, task.configuration)
            if np.abs(other - q).max() > _SAME:
                raise PlanningError(_other(q, other, task))
        return empty(len(q)), ()
    path = _traced(course, start, task, hardness, free=free)
    samples = sampled(path)
    begin, end = samples.joints[[0, -1], 0]
    if np.abs(begin - q).max() > _SAME and not free:
        raise PlanningError(_other(q, begin, task))
    _check(path, samples, task)
    turn = empty(len(q))
    notes: Notes = ()
    if free and np.abs(begin - q).max() > NEGLIGIBLE:
        turn = _turned(q, begin, task)
        if np.abs(begin - q).max() > _SAME:
            notes = (_turn_note(q, begin),)
    else:
        begin = q
    end = _check_arrival(end, task)
    traversal = Traversal(path, samples, begin, end, task.speed, model, task.limits)
    plan = traversal.jerk_limited() if task.profile is Profile.JERK_LIMITED else traversal.parabolic()
    return turn.then(plan), notes


def _other(q: Array, begin: Array, task: _Task) -> str:
    """Why a line that would begin at other joints, (n,), than q is none."""
    own, other = task.model.configuration(q), task.model.configuration(begin)
    return f"a line can't change configuration: the arm is {own}, asked for is {other}"


def _traced(course: Course, q: Array, task: _Task, hardness: float, *, free: bool) -> Path:
    """The joints along a course that begins at a pose of a condition number, which leaves joints free or not."""
    # Rounding in a pose makes that much of itself in the joints.
    tolerance = max(RESOLVED, 1e-15 * min(hardness, 1e6))
    size = max(course.length / task.model.characteristic_length, course.angle)
    pieces = min(1 + int(_PIECES * size), 4)
    try:
        return trace(
            course,
            q,
            task.model,
            task.configuration,
            pieces=pieces,
            halvings=12 - pieces // 2,
            free=free,
            tolerance=tolerance,
            q_goal=task.q_goal,
        )
    except UnresolvedError:
        if hardness <= SINGULAR:
            raise
    graded = Course(course.start, course.corner, course.goal, power=2)
    return trace(
        graded,
        q,
        task.model,
        task.configuration,
        pieces=4,
        halvings=24,
        free=free,
        tolerance=tolerance,
        q_goal=task.q_goal,
    )


def _check(path: Path, samples: Samples, task: _Task) -> None:
    problem = obstacle(path, samples.s, samples.joints[:, 0], task.model, task.limits)
    if problem is not None:
        raise PlanningError(f"no straight line: {problem}")


def _check_arrival(q: Array, task: _Task) -> Array:
    """The joints to arrive at: those that were asked for, if q is the same solution."""
    wanted = task.q_goal
    if wanted is None:
        return q
    difference = np.abs(wanted - q)
    j = int(difference.argmax())
    if difference[j] <= _SAME:
        return wanted
    own, other = task.model.configuration(q), task.model.configuration(wanted)
    words = f", {own} instead of {other}" if own != other else ""
    (at, unit), (asked, _) = (for_people(j, float(x[j]), task.model.prismatic) for x in (q, wanted))
    raise PlanningError(
        f"the line arrives at another solution of the pose: joint {j + 1} at {at:.6g} {unit}, "
        f"asked for is {asked:.6g} {unit}{words}"
    )


def _snapped(q: Array, model: RobotModel) -> Array:
    """The exactly singular joints next to q, (n,), which is all but singular."""
    step = 1e-6
    for _ in range(3):
        trials = np.concatenate([q[None], q + step * np.eye(len(q)), q - step * np.eye(len(q))])
        J = bare(model).jacobian(trials)
        J[:, :3] /= model.characteristic_length
        U, _, Vt = np.linalg.svd(J[0])
        last = min(J.shape[1:]) - 1
        least = np.einsum("i,kij,j->k", U[:, last], J, Vt[last])
        slope = (least[1 : len(q) + 1] - least[len(q) + 1 :]) / (2.0 * step)
        if abs(least[0]) < 1e-14 or slope @ slope < 1e-6:
            break
        q = q - slope * (least[0] / (slope @ slope))
    return q


def _turned(q: Array, begin: Array, task: _Task) -> Plan:
    """Turn joints that a singular pose leaves free to where the path needs them, the tool standing."""
    steps = q + np.linspace(0.0, 1.0, 33)[:, None] * (begin - q)
    X = task.model.forward(steps)
    if np.abs(X - X[0]).max() > 1.5 * STANDING:
        raise PlanningError(
            f"no straight line: from this singular pose joint {int(np.abs(begin - q).argmax()) + 1} would have to "
            "jump at its beginning (0 % of it)"
        )
    rest_to_rest = smooth_rest_to_rest if task.profile is Profile.JERK_LIMITED else parabolic.rest_to_rest
    return rest_to_rest(q, begin, task.speed, task.limits)


def _turn_note(q: Array, begin: Array) -> Note:
    joints = [str(j + 1) for j in np.flatnonzero(np.abs(begin - q) > _SAME)]
    return Note(NoteCode.TURNS_ON_THE_SPOT, (" and ".join(joints),))


def _blended(state: State, task: _Task) -> tuple[Plan, Notes] | None:
    """A blend onto the line and the line; None where none is found that keeps the limits.

    A redundant arm has none: what its joints do beside moving the tool would have to end first.
    """
    model, limits = task.model, task.limits
    if limits.dof > TASK or not float(condition(model, state.q[None])[0]) < SINGULAR:
        return None
    smooth = task.profile is Profile.JERK_LIMITED
    tried = 0
    for course, b in blend_courses(state, task.goal, task.speed, model, limits, smooth=smooth):
        tried += 1
        if tried > _TRIALS:
            break
        try:
            path = trace(
                course, state.q, model, task.configuration, pieces=3, halvings=8, free=False, tolerance=RESOLVED
            )
            samples = sampled(path)
            _check(path, samples, task)
            begin, end = samples.joints[[0, -1], 0]
            if np.abs(begin - state.q).max() > _SAME:
                return None
            end = _check_arrival(end, task)
            growth = state.qdd if smooth else None
            traversal = Traversal(path, samples, state.q, end, task.speed, model, limits, state.qd, growth, 1.0 / b)
            plan = traversal.joined_smoothly() if smooth else traversal.parabolic()
        except PlanningError:
            continue
        return plan, (Note(NoteCode.JOINS_LINE, (_met(course),)),)
    return None


def _met(course: Course) -> str:
    """The place where a blend meets the line, from its beginning."""
    if course.length > NEGLIGIBLE:
        return f"{course.meet * course.length:.4g} m"
    return f"{np.degrees(course.meet * course.angle):.4g} deg"


def _stopped(state: State, task: _Task) -> tuple[Plan, Notes]:
    """Brake, with bounded jerk where that's asked for and goes."""
    plan, rough = stop(state, task.profile, task.limits)
    problem = violation(plan, task.limits, jerk=task.profile is Profile.JERK_LIMITED and not rough)
    if problem is not None:
        raise PlanningError(f"no stop before the line: {problem}")
    notes: Notes = (Note(NoteCode.BRAKED_BEFORE_LINE),)
    return plan, (*notes, Note(NoteCode.NO_SMOOTH_STOP_BEFORE_LINE)) if rough else notes
