"""The plans of one command: its check against the robot, its arm solution, its moves at its speed and pace.

Or of two commands: a move may begin before the one before it is over, so that the arm doesn't stop between them.

Source: Doulgeri, Zikos, Delopoulos, sections II-A and II-B.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf
from typing import TypeAlias, TypeVar

import numpy as np

from vrs import planning
from vrs.commands import (
    Alter,
    DriveCommand,
    Grip,
    InsertVia,
    JointTarget,
    Motion,
    MotionCommand,
    ParameterChange,
    PlanEdit,
    PositionQuery,
    Profile,
    Redo,
    SteerCommand,
    Target,
)
from vrs.errors import InvalidValueError, PlanningError
from vrs.insertion import Gap, MovePlanner
from vrs.model import Array, Limits, RobotModel
from vrs.notes import Note, NoteCode, Notes
from vrs.planning import Plan, rounding
from vrs.planning.path import Tooled, tooled
from vrs.planning.plan import end_position, slowed
from vrs.planning.rounding import braking, continuous, starting
from vrs.segment import State
from vrs.timeline import Timeline

_SPATIAL = 6
"""Joints of an arm whose tool can be offset in every direction."""

Checked: TypeAlias = MotionCommand | SteerCommand | PlanEdit | Grip | Redo | PositionQuery | ParameterChange
"""A command that an engine for an arm takes."""


def check(command: object, model: RobotModel) -> Checked:
    """Return the command if its form fits the robot.

    Raises:
        InvalidValueError: If it's no command for an arm of this many joints.
    """
    if isinstance(command, DriveCommand):
        raise InvalidValueError("command", command, f"for an arm: {model.name} has joints and no wheels")
    if not isinstance(command, Checked):
        allowed = "a MotionCommand, SteerCommand, Grip, Redo, PositionQuery, ParameterChange or an edit of the plan"
        raise InvalidValueError("command", command, allowed)
    n = model.limits.dof
    if isinstance(command, (MotionCommand, InsertVia)):
        target = command.target
        if isinstance(target, JointTarget) and target.q.shape != (n,):
            raise InvalidValueError("target q", target.q, f"of shape ({n},) for {model.name}")
    if isinstance(command, Alter) and n != _SPATIAL:
        raise InvalidValueError("command", command, f"for an arm of {_SPATIAL} joints: {model.name} has {n}")
    if isinstance(command, SteerCommand) and command.rates is not None and command.rates.shape != (n,):
        raise InvalidValueError("rates", command.rates, f"of shape ({n},) for {model.name}")
    return command


def solve(target: Target, model: RobotModel, q: Array) -> Array:
    """Joints of a target, (n,) [rad]; a pose is resolved nearest to the arm at q.

    Raises:
        OutOfLimitsError: If a joint target lies outside the position limits.
        UnreachablePoseError: If a pose has no arm solution within the limits.
        InvalidValueError: If the configuration isn't one.
    """
    if isinstance(target, JointTarget):
        model.limits.check(target.q, model.prismatic)
        return target.q
    solution = model.inverse_near(target.X, q, target.configuration)
    model.limits.check(solution, model.prismatic)
    return solution


_CONTINUOUS = 0.5
"""Share of the acceleration that moves of a continuous path take: two of them overlap."""

_SLACK = 1.0 + 1e-9
"""What a limit is multiplied by to be kept: rounding."""

_Rest = TypeVar("_Rest")


def move(command: MotionCommand, model: RobotModel, limits: Limits, state: State) -> tuple[Plan, Array, Notes]:
    """Plan a command's move from any state, at a pace as at pace 1 and then slowed.

    Args:
        command: The command.
        model: The robot.
        limits: Limits that hold at every instant.
        state: Start.

    Returns:
        The plan, the joints where it ends, and what the user must know of it.

    Raises:
        PlanningError: If no plan keeps the limits.
        UnreachablePoseError: If the target has no arm solution.
    """
    if is_plain(command):
        return _planned(command, command.speed, model, limits, state)

    def plan(speed: float, allowed: Limits, start: State) -> tuple[Plan, tuple[Array, Notes]]:
        made, q, notes = _planned(command, speed, model, allowed, start)
        return made, (q, notes)

    made, (q, notes), hasty = _within_scaled_limits(command, limits, state, plan)
    return made, q, notes + hasty


def join(command: MotionCommand, limits: Limits, q: Array, goal: State) -> tuple[Plan, Notes]:
    """Plan, as a command moves, from rest at q to the state in which a scheduled move begins; see `move`.

    Raises:
        PlanningError: If no plan keeps the limits.
    """
    if is_plain(command):
        return planning.run_up(q, goal, command.speed, command.profile, limits)

    def plan(speed: float, allowed: Limits, state: State) -> tuple[Plan, Notes]:
        return planning.run_up(q, state, speed, command.profile, allowed)

    made, notes, hasty = _within_scaled_limits(command, limits, goal, plan)
    return made, notes + hasty


def is_plain(command: MotionCommand) -> bool:
    """Whether a command takes the limits as they are."""
    return command.pace == 1.0 and command.acceleration == 1.0 and command.deviation < inf


def _within_scaled_limits(
    command: MotionCommand,
    limits: Limits,
    state: State,
    plan: Callable[[float, Limits, State], tuple[Plan, _Rest]],
) -> tuple[Plan, _Rest, Notes]:
    """Plan within a command's share of the limits, at its pace; else, from a moving arm, within all of them."""
    pace = command.pace
    allowed = scale_limits(limits, command.acceleration * (_CONTINUOUS if command.deviation == inf else 1.0))
    quick = _time_scaled(state, pace)
    moving = bool(state.qd.any() or state.qdd.any())
    if not moving or _keeps(quick, allowed, command.profile):
        try:
            made, rest = plan(command.speed, allowed, quick)
        except PlanningError:
            if not moving:
                raise
        else:
            return (made if pace == 1.0 or not len(made) else slowed(made, 1.0 / pace)), rest, ()
    made, rest = plan(command.speed * pace, limits, state)
    return made, rest, (Note(NoteCode.FULL_LIMITS),)


def _keeps(state: State, limits: Limits, profile: Profile) -> bool:
    """Whether a state keeps limits as far as a profile asks for that."""
    fast = bool((np.abs(state.qd) > _SLACK * limits.qd_max).any())
    smooth = profile is Profile.JERK_LIMITED
    return not fast and not (smooth and bool((np.abs(state.qdd) > _SLACK * limits.qdd_max).any()))


@lru_cache(maxsize=64)
def scale_limits(limits: Limits, share: float) -> Limits:
    """Limits with a share of their acceleration and jerk; the same value for the same limits, which is kept."""
    if share == 1.0:
        return limits
    return replace(limits, qdd_max=share * limits.qdd_max, qddd_max=share * limits.qddd_max)


def _time_scaled(state: State, pace: float) -> State:
    """A state as it is where time runs 1/pace times as fast."""
    return state if pace == 1.0 else State(state.q, state.qd / pace, state.qdd / (pace * pace))


def _planned(
    command: MotionCommand, speed: float, model: RobotModel, limits: Limits, state: State
) -> tuple[Plan, Array, Notes]:
    profile, target = command.profile, command.target
    if command.motion is Motion.LINE:
        from vrs.planning.line import line

        seen = tooled(model, command.tool)
        if isinstance(target, JointTarget):
            model.limits.check(target.q, model.prismatic)
            X = seen.forward(target.q)
            plan, notes = line(state, X, speed, profile, seen, limits, q_goal=target.q)
            return plan, target.q, notes
        X = target.X @ seen.tool if isinstance(seen, Tooled) else target.X
        plan, notes = line(state, X, speed, profile, seen, limits, configuration=target.configuration)
        return plan, end_position(plan) if len(plan) else state.q, notes
    # The arm solution is chosen from where the arm will be at the final execution time.
    q = solve(target, model, state.q)
    plan, notes = planning.move(state, q, speed, profile, limits)
    return plan, q, notes


_SAME = 1e-15
"""Times that differ by less, as a share of them or of a second, are one."""


@dataclass(frozen=True, slots=True, eq=False)
class Passer:
    """One command that passes the end of another; times are those of its pace, as if at 1.

    What it makes is when the move begins [s], its plan, and what must be said of it.
    """

    model: RobotModel
    limits: Limits
    """In force."""
    timeline: Timeline
    """As it is before the command."""
    planner: Callable[[MotionCommand, Limits], MovePlanner]
    """Plans moves of commands under limits."""
    command: MotionCommand
    """Its deviation above 0."""
    gap: Gap
    """What it's to fill if it stopped; the arm rests there."""
    t: float
    """Where it would begin if it stopped [s]."""
    passed_by: int
    """Id of the command before it."""
    before: MotionCommand | None
    """That command, if it's known."""
    smooth: bool
    """Whether that one moves smoothly, if it matters."""
    now: float | None
    """Present time [s]; None offline."""

    @property
    def jerky(self) -> bool:
        """Whether jerk limits bind."""
        return self.command.profile is Profile.JERK_LIMITED

    @property
    def mixed(self) -> Notes:
        """What must be said where the move before isn't smooth."""
        return (Note(NoteCode.ROUNDED_WITH_PARABOLAS),) if self.jerky and not self.smooth else ()

    def at_full_pace(self, plan: Plan) -> Plan:
        """A plan as it is where time runs 1/pace times as fast."""
        return plan if self.command.pace == 1.0 or not len(plan) else slowed(plan, self.command.pace)

    def at_pace(self, plan: Plan) -> Plan:
        """The other way round."""
        return plan if self.command.pace == 1.0 or not len(plan) else slowed(plan, 1.0 / self.command.pace)

    def slower_first(self, limits: Limits, begin: float) -> tuple[Plan, Notes] | None:
        """The move before, planned anew within other limits; None where it isn't known."""
        if self.before is None:
            return None
        again = replace(self.before, target=JointTarget(self.gap.state.q))
        slow, _, notes = self.planner(again, limits)(self.timeline.state_before(begin))
        return self.at_full_pace(slow), notes

    def rounded(self, first: Plan, begin: float, onward: MotionCommand) -> tuple[float, Plan, Notes]:
        """Overlap as far as the deviation and the limits allow."""
        command = self.command
        quick = self.at_full_pace(first)

        def plans(limits: Limits) -> tuple[Plan, Plan, Notes]:
            second, _, notes = self.planner(onward, limits)(self.gap.state)
            second = self.at_full_pace(second)
            again = None if limits is self.limits else self.slower_first(limits, begin)
            slow, more = (quick, ()) if again is None else again
            return slow, second, more + notes + self.mixed

        model = tooled(self.model, command.tool)
        way = rounding.rounded(plans, command.deviation, model, self.limits, command.profile)
        if way.first is not quick:
            return begin, self.at_pace(way.whole), way.notes
        start = max(self._before(way.delta), begin)
        rest = rounding.later(way.whole, way.first.duration - way.delta)
        return start, self.at_pace(rest), way.notes

    def continuous(self, first: Plan, second: Plan, begin: float, notes: Notes) -> tuple[float, Plan, Notes]:
        """Begin where the move before begins to brake; where both can't have their acceleration, it gets half."""
        t, command, pace, limits = self.t, self.command, self.command.pace, self.limits
        quick, onward = self.at_full_pace(first), self.at_full_pace(second)
        notes += self.mixed
        if not len(second):
            return t, second, notes
        ready = starting(onward, limits, _straight(command, self.model))
        known = _straight(self.before, self.model)
        most = inf if self.now is None else (t - self.now) * pace
        delta, plan = continuous(
            quick, onward, most, (braking(quick, limits, known), ready), limits, jerk=self.jerky
        )
        if delta > 0.0:
            return self._at(max(self._before(delta), begin), plan, delta, notes)
        again = None
        if self.before is not None and self.before.deviation < inf and (self.now is None or begin >= self.now):
            again = self.slower_first(scale_limits(limits, 0.5), begin)
        if again is not None:
            slow, more = again
            ramps = braking(slow, limits, known), ready
            delta, plan = continuous(slow, onward, inf, ramps, limits, jerk=self.jerky)
            if delta > 0.0:
                lead = _until(slow, slow.duration - delta)
                return self._at(begin, lead.then(plan), delta, more + notes)
        return t, second, (*notes, Note(NoteCode.STOPS_AT_VIA))

    def _before(self, delta: float) -> float:
        """The time from which an overlap [s] is left; a knot where one is as near as rounding leaves it."""
        timeline, start = self.timeline, self.t - delta / self.command.pace
        index = timeline.index_at(start)
        for knot in (timeline.start_of(max(index, 0)), timeline.start_of(min(index + 1, len(timeline)))):
            if abs(knot - start) <= _SAME * max(1.0, abs(start)):
                return knot
        return start

    def _at(self, start: float, plan: Plan, delta: float, notes: Notes) -> tuple[float, Plan, Notes]:
        passed = Note(NoteCode.BEGINS_BEFORE, (delta / self.command.pace, self.passed_by))
        return start, self.at_pace(plan), (*notes, passed)


def _straight(command: MotionCommand | None, model: RobotModel) -> RobotModel | None:
    """Whose tool goes straight in a command; None where the joints do."""
    if command is None or command.motion is not Motion.LINE:
        return None
    return tooled(model, command.tool)


def _until(plan: Plan, t: float) -> Plan:
    """What of a plan comes before t [s]."""
    ends: Array = np.cumsum(plan.durations)
    k = min(int(np.searchsorted(ends, t)), len(plan) - 1)
    h = np.array(plan.durations[: k + 1])
    h[k] -= ends[k] - t
    keep = k + 1 if h[k] > 0.0 else k
    return Plan(h[:keep], plan.coefficients[:keep])
