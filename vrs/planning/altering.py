"""Altering: an offset of the tool is added to what is planned, given anew again and again while the arm moves.

Offsets come with the times for which they were meant, evenly or not. Each is reached `DELAY` after its time, so
that the one after it is known when the way to it begins: through all of them goes a curve with a continuous
acceleration, quintic from one to the next. Behind the newest it fades to nothing, or it ends there at rest where
nothing else moves the arm. The sum of plan and offset is turned into joints knot by knot, by inverse kinematics and
two derivatives of it; between knots the joints go along quintics again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vrs.commands import Frame
from vrs.errors import PlanningError
from vrs.model import Array, Limits, RobotModel
from vrs.planning.certificate import violation
from vrs.planning.path import rotations, tooled, turning
from vrs.planning.plan import Plan
from vrs.segment import State

DELAY = 0.056
"""An offset is there so long after it was given [s]."""
PROMPT = 0.028
"""Offsets of which one comes later than this after it was given [s] count from then on so much later."""
FADE = 0.4
"""How long an offset that isn't renewed takes to go back to nothing, at least [s]."""
LINGER = 0.1
"""How long one that's to stay is stayed at before that [s]."""
_LONGER = (1.0, 2.0, 4.0)
"""How much longer that may take where the limits ask for it."""
_LATER = (0.09, 0.16, 0.3, 0.6, 1.4)
"""How long the way to an offset may take that can't be reached in time [s]."""
_REMEMBERED = 6
"""Offsets in a row that the way through the next depends on."""
_STEP = 0.06
"""Longest quintic of the joints [s]."""
_SHORTEST = 5e-4
"""A shorter piece is no quintic of its own: dividing by its duration would amplify rounding [s]."""
APART = 1e-3
"""Offsets nearer in time than this are one [s]."""
_NEAR = 0.012
"""An offset that's to be reached sooner is left to the way that leads there, where another one is known [s]."""
_NUDGE = 1e-5
"""Step of the time derivative of the Jacobian [s]."""
_CLOSE = 1e-6
"""Distance from the goal [m, rad] from which one more step of Newton's method leaves rounding alone."""
_STEPS = 8

Given = tuple[float, Array]
"""When an offset was given [s], and what: a translation [m] and a rotation vector [rad], (6,)."""


class Course(NamedTuple):
    """An offset over time; before its start it stands, and after its end."""

    knots: Array
    """(m + 1,) [s]."""
    coefficients: Array
    """(m, 6, 6): ascending powers of the time since each knot."""

    def at(self, t: Array) -> Array:
        """Offsets, their rates and accelerations at times, (k, 3, 6)."""
        i = np.clip(np.searchsorted(self.knots, t, side="right") - 1, 0, len(self.coefficients) - 1)
        u = np.clip(t, self.knots[0], self.knots[-1]) - self.knots[i]
        found = states(self.coefficients[i], u)
        found[(t < self.knots[0]) | (t > self.knots[-1]), 1:] = 0.0
        return found

    def then(self, later: Course) -> Course:
        """It, and one that begins where it ends."""
        knots = np.concatenate([self.knots, later.knots[1:]])
        return Course(knots, np.concatenate([self.coefficients, later.coefficients]))


STILL = Course(np.zeros(2), np.zeros((1, 6, 6)))
"""No offset."""


def states(a: Array, u: Array) -> Array:
    """Values and two derivatives of polynomials, (k, 3, n), of coefficients (k, K, n) at (k,)."""
    k = np.arange(a.shape[1])
    powers = u[:, None] ** k
    found = np.empty((len(a), 3, a.shape[2]))
    found[:, 0] = np.einsum("ik,ikn->in", powers, a)
    found[:, 1] = np.einsum("ik,ikn->in", powers[:, :-1], a[:, 1:] * k[1:, None])
    found[:, 2] = np.einsum("ik,ikn->in", powers[:, :-2], a[:, 2:] * (k[2:] * k[1:-1])[:, None])
    return found


def quintics(h: Array, start: Array, end: Array) -> Array:
    """Coefficients of quintics, (m, 6, n), of durations (m,) from states (m, 3, n) to states (m, 3, n)."""
    w = h[:, None]
    q0, v0, a0 = start[:, 0], start[:, 1] * w, 0.5 * start[:, 2] * w * w
    d = end[:, 0] - q0 - v0 - a0
    v, a = end[:, 1] * w - v0 - 2.0 * a0, end[:, 2] * w * w - 2.0 * a0
    c = np.stack([q0, v0, a0, 10 * d - 4 * v + 0.5 * a, -15 * d + 7 * v - a, 6 * d - 3 * v + 0.5 * a], axis=1)
    c /= (w ** np.arange(6))[:, :, None]
    c[:, 0], c[:, 1], c[:, 2] = start[:, 0], start[:, 1], 0.5 * start[:, 2]
    return c


def ahead(given: Sequence[Given], t: float) -> list[tuple[float, Array]]:
    """Times and states, (3, 6), by which an offset has to go from t on: those that were given and aren't reached.

    Each is passed at the speed of the parabola through it and its neighbours, the newest at that of the parabola
    through those before it.
    """
    found = []
    for i, (when, value) in enumerate(given):
        newest = i + 1 == len(given)
        if when + DELAY <= t + (APART if newest else _NEAR):
            continue
        rate, bend = np.zeros(6), np.zeros(6)
        if i:
            before = when - given[i - 1][0]
            rate = (value - given[i - 1][1]) / before
            if not newest:
                after = given[i + 1][0] - when
                bend = 2.0 * ((given[i + 1][1] - value) / after - rate) / (before + after)
                rate = rate + 0.5 * bend * before
            elif i > 1:
                sooner = given[i - 1][0] - given[i - 2][0]
                rate = rate + (rate - (given[i - 1][1] - given[i - 2][1]) / sooner) * before / (before + sooner)
        found.append((when + DELAY, np.stack([value, rate, bend])))
    return found


def remembered(given: Sequence[Given], value: Array, t: float) -> tuple[Given, ...]:
    """The newest offsets with another one; before the first there was none.

    Args:
        given: Before.
        value: The offset, (6,).
        t: When it was given [s].
    """
    if not given:
        still = np.zeros(6)
        given = ((t - DELAY, still), (t - 0.5 * DELAY, still))
    elif t - given[-1][0] > FADE:
        return ((t, value),)
    return (*given, (t, value))[-_REMEMBERED:]


def _ways(
    t: float, state: Array, given: Sequence[Given], stays: bool, over: bool
) -> Iterator[tuple[Course, Sequence[Course], bool]]:
    """Ways of an offset from a state on, the one that's asked for first; how each may end; whether it's late.

    Args:
        t: When they begin [s].
        state: Offset, rate, acceleration at t, (3, 6).
        given: What was given, the newest last.
        stays: Whether it comes to rest at the newest.
        over: Whether it stays there for good then; else it goes back to nothing.
    """
    rest = np.zeros((3, 6))
    rest[0] = given[-1][1]
    wanted = ahead(given, t) or [(t + DELAY, rest)]
    # Where the limits don't let it go through all of them, those before the newest are given up first.
    in_time = [wanted[i:] for i in range(len(wanted))]
    for through in (*in_time, *([(t + later, rest)] for later in _LATER)):
        knots = np.array([t, *(when for when, _ in through)])
        passed = np.stack([state, *(there for _, there in through)])
        course = Course(knots, quintics(np.diff(knots), passed[:-1], passed[1:]))
        # One that's to stay comes to rest first, even where it goes back after that.
        leads = [] if not stays or np.array_equal(rest, passed[-1]) else [(LINGER, rest)]
        ends: list[Course] = []
        for h in (FADE * longer for longer in _LONGER):
            led = leads if over else [*leads, (h, np.zeros((3, 6)))]
            if not led or (not stays and not passed[-1].any()):
                break
            there = np.stack([passed[-1], *(state for _, state in led)])
            lasts = np.array([lasting for lasting, _ in led])
            marks = knots[-1] + np.concatenate([[0.0], np.cumsum(lasts)])
            ends.append(Course(marks, quintics(lasts, there[:-1], there[1:])))
            if over:
                break
        yield course, ends, through[-1] is not wanted[-1]


class Window(NamedTuple):
    """What is planned for a while: polynomials that follow each other."""

    starts: Array
    """(m + 1,): of each, and the end of the last [s]."""
    coefficients: Array
    """(m, K, n), ascending powers of the time since each start."""
    owners: Sequence[int]
    """A command a segment."""


class Altered(NamedTuple):
    """What is planned, with an offset on it."""

    course: Course
    """Of the offset."""
    plan: Plan
    """Quintics that last as long as the course."""
    segments: list[int]
    """The segment of the window to which each belongs."""
    late: bool
    """Whether the limits don't let the offset be reached in time."""


class Task(NamedTuple):
    """What an offset is to an arm."""

    frame: Frame
    """Axes of the offset: the base's, or those of `tool` as it's planned to be."""
    tool: Array | None
    """The tool's tip in the frame of the last link, (4, 4); None for that link."""
    model: RobotModel
    """The arm, of six joints."""
    limits: Limits
    """In force."""


LONGEST = _LATER[-1] + DELAY + LINGER + FADE * _LONGER[-1]
"""No course lasts longer [s]."""


def alter(
    window: Window,
    start: State,
    offset: Array,
    given: Sequence[Given],
    task: Task,
    *,
    stays: bool,
    over: bool,
    jerk: bool,
) -> Altered:
    """Go on from now with offsets that were given.

    Args:
        window: What is planned from now on, for `LONGEST`.
        start: The arm's state now.
        offset: Offset, rate, acceleration now, (3, 6).
        given: What was given, the newest last.
        task: What it is to the arm.
        stays: Whether the offset comes to rest at the newest.
        over: Whether it stays there for good then, as nothing else moves the arm; else it goes back to nothing.
        jerk: Whether the jerk limits bind.

    Raises:
        PlanningError: If no way of the offset keeps the limits.
    """
    found = "no way to it was found"
    model = tooled(task.model, task.tool)
    for head, ends, late in _ways(float(window.starts[0]), offset, given, stays, over):
        for end in ends or (None,):
            course = head if end is None else head.then(end)
            try:
                plan, segments = _altered(window, start, course, task.frame, model)
            except PlanningError as error:
                found = str(error)
                break
            m = int(np.searchsorted(np.cumsum(plan.durations), head.knots[-1] - head.knots[0] - 1e-9)) + 1
            problem = violation(Plan(plan.durations[:m], plan.coefficients[:m]), task.limits, jerk=jerk)
            if problem is not None:
                found = problem
                break
            problem = violation(Plan(plan.durations[m:], plan.coefficients[m:]), task.limits, jerk=jerk)
            if problem is None:
                return Altered(course, plan, segments, late)
            found = problem
    raise PlanningError(f"the limits leave no room for the offset: {found}")


def _altered(
    window: Window, begin: State, course: Course, frame: Frame, model: RobotModel
) -> tuple[Plan, list[int]]:
    """What is planned with an offset on it, and the segment of the window of each quintic.

    Raises:
        PlanningError: If the arm can't go there.
    """
    t, indexes = _knots(window, course)
    low, high = t[:-1], t[1:]
    both = np.concatenate([low, high])
    index = np.concatenate([indexes, indexes])
    planned = states(window.coefficients[index], both - window.starts[index])
    found = _displaced(planned, course.at(both), frame, model)
    m = len(low)
    start, end, h = found[:m], found[m:], high - low
    start[0, 0], start[0, 1] = begin.q, begin.qd
    a = quintics(h, start, end)
    for i in np.flatnonzero(h < _SHORTEST).tolist():
        # What a piece too short for a quintic leaves over goes into the next one.
        a[i, 3:] = 0.0
        if i + 1 < m:
            here = states(a[i : i + 1], h[i : i + 1])
            here[0, 2] = start[i + 1, 2]
            start[i + 1] = here[0]
            a[i + 1] = quintics(h[i + 1 : i + 2], start[i + 1 : i + 2], end[i + 1 : i + 2])[0]
    return Plan(h, a), indexes.tolist()


def _knots(window: Window, course: Course) -> tuple[Array, Array]:
    """Where quintics begin and end [s], (m + 1,), and the segment of the window of each, (m,)."""
    begin, end = float(course.knots[0]), float(course.knots[-1])
    inner = np.concatenate([window.starts[1:-1], course.knots[1:-1]])
    marks = np.unique(np.concatenate([[begin], inner[(inner > begin) & (inner < end)], [end]]))
    t: list[float] = [begin]
    for mark in marks[1:].tolist():
        parts = int((mark - t[-1]) / _STEP) + 1
        first = t[-1]
        t += [first + (mark - first) * k / parts for k in range(1, parts)]
        t.append(mark)
    knots = np.array(t)
    middle = 0.5 * (knots[:-1] + knots[1:])
    index = np.clip(np.searchsorted(window.starts, middle, side="right") - 1, 0, len(window.owners) - 1)
    return knots, index


def _displaced(planned: Array, offset: Array, frame: Frame, model: RobotModel) -> Array:
    """Joint states, (k, 3, n), of joint states with offsets of the tool, (k, 3, 6)."""
    q, qd, qdd = planned[:, 0], planned[:, 1], planned[:, 2]
    X, J = model.forward(q), model.jacobian(q)
    V = _times(J, qd)
    A = _times(J, qdd) + _bend(model, q, qd)
    R, p = X[:, :3, :3], X[:, :3, 3]
    w, alpha = V[:, 3:], A[:, 3:]
    E = rotations(offset[:, 0, 3:])
    turn, turn_rate = _turns(offset[:, :, 3:])
    way = offset[:, :, :3]
    goal = np.empty_like(X[:, :3])
    twist, bent = np.empty_like(V), np.empty_like(A)
    if frame is Frame.BASE:
        goal[:, :, 3] = p + way[:, 0]
        twist[:, :3], bent[:, :3] = V[:, :3] + way[:, 1], A[:, :3] + way[:, 2]
        goal[:, :, :3] = E @ R
        carried = _times(E, w)
        twist[:, 3:] = turn + carried
        bent[:, 3:] = turn_rate + np.cross(turn, carried) + _times(E, alpha)
    else:
        r, rd, rdd = (_times(R, way[:, k]) for k in range(3))
        goal[:, :, 3] = p + r
        twist[:, :3] = V[:, :3] + np.cross(w, r) + rd
        bent[:, :3] = A[:, :3] + np.cross(alpha, r) + np.cross(w, np.cross(w, r) + 2.0 * rd) + rdd
        goal[:, :, :3] = R @ E
        own = _times(R, turn)
        twist[:, 3:] = w + own
        bent[:, 3:] = alpha + np.cross(w, own) + _times(R, turn_rate)
    there, J = _solved(model, goal, q, _misses(goal, X[:, :3]), J)
    found = np.empty_like(planned)
    found[:, 0] = there
    found[:, 1] = _solve(J, twist)
    found[:, 2] = _solve(J, bent - _bend(model, there, found[:, 1]))
    return found


def _bend(model: RobotModel, q: Array, qd: Array) -> Array:
    """The Jacobian's rate of change times the joints' rates, (k, 6)."""
    k = len(q)
    J = model.jacobian(np.concatenate([q + _NUDGE * qd, q - _NUDGE * qd]))
    return _times(J[:k] - J[k:], qd) / (2.0 * _NUDGE)


def _solved(model: RobotModel, goal: Array, q: Array, miss: Array, J: Array) -> tuple[Array, Array]:
    """Joints that put the tool at poses, (k, 3, 4), from nearby ones on, and their Jacobians.

    Raises:
        PlanningError: If they aren't found.
    """
    for _ in range(_STEPS):
        q = q + _solve(J, miss)
        last = float(np.abs(miss).max())
        J = model.jacobian(q)
        if last < _CLOSE:
            return q, J
        miss = _misses(goal, model.forward(q)[:, :3])
        if not np.abs(miss).max() < 1.0:
            break
    raise PlanningError("the arm can't follow the offset to where it leads")


def _misses(goal: Array, X: Array) -> Array:
    """What leads poses (k, 3, 4) to others nearby: translations and rotation vectors, (k, 6)."""
    R = goal[:, :, :3] @ X[:, :, :3].transpose(0, 2, 1)
    turn = 0.5 * np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1)
    return np.concatenate([goal[:, :, 3] - X[:, :, 3], turn], axis=1)


def _turns(r: Array) -> tuple[Array, Array]:
    """Angular velocities and accelerations, (k, 3) each, of rotation vectors and their derivatives, (k, 3, 3)."""
    value, rate, bend = r[:, 0], r[:, 1], r[:, 2]
    if not r.any():
        return np.zeros_like(value), np.zeros_like(value)
    step = 1e-4
    later = turning(value + step * rate, rate + step * bend)
    sooner = turning(value - step * rate, rate - step * bend)
    return turning(value, rate), (later - sooner) / (2.0 * step)


def _times(R: Array, v: Array) -> Array:
    return np.asarray(np.einsum("kij,kj->ki", R, v))


def _solve(J: Array, v: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(J, v[:, :, None])[:, :, 0])
    except np.linalg.LinAlgError:
        raise PlanningError("the arm can't follow the offset through a singularity") from None
