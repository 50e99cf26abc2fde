"""Insertion: how a planned command changes the timeline. Source: Doulgeri et al., section II-B, eq. (5).

A scheduled move gets another time or another way, or is taken out, by the same rules.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np

from vrs.commands import Insertion
from vrs.model import Array
from vrs.notes import Notes
from vrs.planning import Plan, empty
from vrs.planning.plan import end_state, stacked
from vrs.segment import HOLD, Packed, Piece, State, shifted
from vrs.timeline import BaseTimeline, Timeline

MovePlanner = Callable[[State], tuple[Plan, Array, Notes]]
"""Plans the new move from the state at its start: the plan, the joints where it ends, what the user must know."""
JoinPlanner = Callable[[Array, State], tuple[Plan, Notes]]
"""Plans from rest at the new target to the state in which the tail begins."""

_Row = TypeVar("_Row")
_TimelineT = TypeVar("_TimelineT", bound=BaseTimeline[Any])

_SLIVER = 1e-12
"""Duration [s] below which a segment is only rounding."""

_SAME = 1e-12
"""Difference of coefficients [rad / s**power] that's only rounding."""

_MET = 1e-9
"""Difference of accelerations [rad/s²] that's only rounding."""

_ROUNDED_MOST = 64
"""Segments of a move that the next one may overlap."""


class Gap(NamedTuple):
    """Where a move goes: what stays before it and what follows it."""

    cut: float
    """What lies before stays [s]."""
    start: float
    """Start of the move [s], at or after the cut."""
    state: State
    """At the start."""
    tail: int | None
    """Index of the first segment that follows; None where no move follows."""
    lead: tuple[Piece, ...] = ()
    """What comes between the cut and the start."""
    notes: Notes = ()
    """What the user must know of that."""


class Edit(NamedTuple, Generic[_TimelineT]):
    """What an insertion makes."""

    timeline: _TimelineT
    start: float
    """When the new move begins [s]."""
    arrival: float
    """When it's at its target [s]."""
    target: Array
    """Where it arrives [rad], (n,)."""
    shift: float = 0.0
    """Δ of the tail [s]."""
    tail: int | None = None
    """Index, in the timeline before, of the first segment that follows; None for none."""
    dropped: tuple[int, ...] | None = ()
    """Commands of which segments were dropped or shortened; None for all that arrive later."""
    notes: Notes = ()
    """What the user must know of it."""


def next_move(timeline: BaseTimeline[Any], index: int) -> int | None:
    """The first segment from an index on that isn't a hold; None if there's none."""
    if index < len(timeline) and timeline.owner_of(index) == HOLD:
        index = timeline.end_of_run(index)
    return index if index < len(timeline) else None


def end_of_move(timeline: BaseTimeline[Any], index: int) -> int:
    """One past the last segment of the move that a segment belongs to.

    A move is one command's segments; holds in which it spends slack before its joining move are part of it.
    """
    return _around(timeline, index, timeline.owner_of(index))[0]


def _around(timeline: BaseTimeline[Any], index: int, owner: int) -> tuple[int, bool]:
    """The end of the move that a command's segment belongs to, and whether another one follows."""
    count = len(timeline)
    while True:
        end = following = timeline.end_of_run(index)
        if following == count:
            return end, False
        other = timeline.owner_of(following)
        if other == HOLD:
            following = timeline.end_of_run(following)
            if following == count:
                return end, False
            other = timeline.owner_of(following)
        if other != owner:
            return end, True
        index = following


def insert(
    timeline: Timeline,
    t: float,
    how: Insertion,
    command_id: int,
    plan_move: MovePlanner,
    plan_join: JoinPlanner,
) -> Edit[Timeline]:
    """Put a move into the timeline at t.

    The past stays; the interrupted move's rest is dropped; with SPLICE the moves after it follow, shifted as a
    whole by one Δ ≥ 0, behind a joining move.

    Args:
        timeline: What is scheduled.
        t: Start of the new move [s].
        how: SPLICE or REPLACE; APPEND is REPLACE at the end.
        command_id: Owner of the new segments.
        plan_move: See MovePlanner.
        plan_join: See JoinPlanner.

    Raises:
        PlanningError: If a planner has no plan.
    """
    gap, dropped = gap_at(timeline, t, how)
    return fill(timeline, gap, command_id, plan_move, plan_join, dropped)


def gap_at(timeline: Timeline, t: float, how: Insertion) -> tuple[Gap, tuple[int, ...] | None]:
    """The gap that a move at t makes for itself, and the commands that lose segments to it; see Edit."""
    tail, dropped = tail_at(timeline, t, how)
    return Gap(t, t, timeline.state_before(t), tail), dropped


def tail_at(timeline: BaseTimeline[Any], t: float, how: Insertion) -> tuple[int | None, tuple[int, ...] | None]:
    """The first segment that follows a move at t, and the commands that lose segments to it; see Gap and Edit."""
    tail: int | None = None
    dropped: tuple[int, ...] | None = ()
    if t < timeline.end and len(timeline):
        index = max(timeline.index_at(t), 0)
        owner = timeline.owner_of(index)
        if how is Insertion.REPLACE:
            dropped = None
        elif owner == HOLD or t < timeline.start:
            tail = index if t < timeline.start else index + 1
            tail = None if next_move(timeline, tail) is None else tail
        else:
            end, goes_on = _around(timeline, index, owner)
            tail, dropped = end if goes_on else None, (owner,)
    return tail, dropped


def move_before(
    timeline: Timeline, t: float, earliest: float, *, cut: bool = False
) -> tuple[Plan, float, int] | None:
    """The move that ends at t, as far as it begins at `earliest` or later; when, and its command.

    Args:
        timeline: What is scheduled.
        t: When the move ends [s].
        earliest: When the first of its segments begins [s].
        cut: Whether a segment that is under way at the earliest time counts too.
    """
    index = len(timeline) if t >= timeline.end else timeline.index_at(t)
    last = index - 1
    if last < 0 or timeline.start_of(index) != t or timeline.owner_of(last) == HOLD:
        return None
    owner, low = timeline.owner_of(last), last
    while low > 0 and timeline.owner_of(low - 1) == owner and last - low < _ROUNDED_MOST:
        low -= 1
    run = range(low, index)
    segments = [timeline.segment(i) for i in run if timeline.start_of(i + 1 if cut else i) >= earliest]
    if not segments:
        return None
    plan = stacked([s.duration for s in segments], [s.coefficients for s in segments], timeline.dof)
    return plan, segments[0].start, owner


def fill(
    timeline: Timeline,
    gap: Gap,
    command_id: int,
    plan_move: MovePlanner,
    plan_join: JoinPlanner,
    dropped: tuple[int, ...] | None = (),
) -> Edit[Timeline]:
    """Put a move into a gap, with a joining move to what follows.

    Slack is spent at rest: at the tail's first state or, if that state moves, at the new target.

    Args:
        timeline: What is scheduled.
        gap: Where the move goes.
        command_id: Owner of the new segments.
        plan_move: See MovePlanner.
        plan_join: See JoinPlanner.
        dropped: Commands that lose segments to the gap; see Edit.

    Raises:
        PlanningError: If a planner has no plan.
    """
    plan, target, notes = plan_move(gap.state)
    arrival = gap.start + plan.duration
    pieces: list[Piece | Packed] = [*gap.lead, packed(plan, command_id)]
    tail = gap.tail
    if tail is None:
        after = timeline.edited(gap.cut, pieces)
        return Edit(after, gap.start, arrival, target, dropped=dropped, notes=gap.notes + notes)
    scheduled = timeline.start_of(tail)
    goal = timeline.state_after(tail)
    moving = any(goal.qd.tolist())
    if not moving and timeline.owner_of(tail) != command_id:
        # Moves of different commands meet at rest with whatever acceleration; within one it mustn't jump.
        goal = goal._replace(qdd=goal.qd)
    join, more = plan_join(target, goal)
    joining = packed(join, command_id)
    ready = arrival + join.duration
    slack = scheduled - ready
    if slack > 0:
        moving = moving or _pushes_off(join, goal)
        rest = hold(slack, target if moving else goal.q)
        pieces += [rest, joining] if moving else [joining, rest]
    else:
        pieces.append(joining)
    after = timeline.edited(gap.cut, pieces, tail, scheduled if slack >= 0 else ready)
    return Edit(after, gap.start, arrival, target, max(-slack, 0.0), tail, dropped, gap.notes + notes + more)


def _pushes_off(join: Plan, goal: State) -> bool:
    """Whether a joining move ends with the acceleration of what follows, so that no rest fits between them."""
    if not len(join) or not any(goal.qdd.tolist()):
        return False
    return bool(np.abs(end_state(join).qdd - goal.qdd).max() <= _MET)


def stay(notes: Notes) -> MovePlanner:
    """Plan to stay where the arm is."""
    return lambda state: (empty(len(state.q)), state.q, notes)


def piece(plan: Plan, command_id: int) -> Piece:
    """A plan as a piece for an edit, without segments too short to end later than they start."""
    return Piece(*_without_slivers(plan.durations.tolist(), plan.rows()), command_id)


def packed(plan: Plan, command_id: int) -> Packed:
    """The same, as a timeline keeps it."""
    return Packed(*_without_slivers(plan.durations.tolist(), plan.packed_rows()), command_id)


def _without_slivers(durations: list[float], rows: list[_Row]) -> tuple[list[float], list[_Row]]:
    if not durations or min(durations) >= _SLIVER:
        return durations, rows
    kept = [i for i, h in enumerate(durations) if h >= _SLIVER]
    return [durations[i] for i in kept], [rows[i] for i in kept]


def lengthened(timeline: Timeline, t: float, new: Piece) -> Timeline:
    """Put a piece at t; where its first segment goes on as the command's present one, that one is lengthened."""
    index = timeline.index_at(t)
    if new.durations and 0 <= index < len(timeline) and timeline.owner_of(index) == new.command_id:
        present = timeline.segment(index)
        late = t - present.start
        if late > 0 and _goes_on(present.coefficients, late, new.coefficients[0]):
            durations = [late + new.durations[0], *new.durations[1:]]
            rows = [present.coefficients, *new.coefficients[1:]]
            return timeline.edited(present.start, [Piece(durations, rows, new.command_id)])
    return timeline.edited(t, [new])


def _goes_on(coefficients: Array, late: float, other: Array) -> bool:
    """Whether other coefficients are the same polynomials in powers of the time since `late` [s]."""
    # The highest power stays what it is: most that differ differ there.
    if coefficients.shape != other.shape or np.abs(coefficients[-1] - other[-1]).max() > _SAME:
        return False
    return bool(np.abs(shifted(coefficients, late) - other).max() <= _SAME)


def hold(duration: float, q: Array) -> Piece:
    """A hold at q, (n,) [rad], for a duration [s]."""
    rest = np.array(q)[None]
    rest.flags.writeable = False
    return Piece([duration], [rest], HOLD)


Stopper: TypeAlias = Callable[[float], tuple[Plan, Notes]]
"""Plans a stop at a time of the plan: the stop, and what the user must know of it."""

_ROUNDING = 1e-9
"""Receipts' times [s] may lie this much before the knot that they mean."""


def span(timeline: Timeline, command_id: int, start: float) -> tuple[int, int] | None:
    """First segment of a command's move that begins at a time, and one past its last; None if it has none.

    What the command moved before that, until a stop, isn't part of it.
    """
    low = high = max(timeline.index_at(start), 0)
    while low > 0 and start - timeline.start_of(low - 1) <= _ROUNDING:
        low -= 1
    while high < len(timeline) and timeline.start_of(high + 1) - start <= _ROUNDING:
        high += 1
    near = sorted(range(low, high + 1), key=lambda i: abs(timeline.start_of(i) - start))
    for index in (*near, high + 1):
        if index >= len(timeline) or timeline.owner_of(index) != command_id:
            continue
        if index < high and start - timeline.start_of(index) > _ROUNDING:
            continue
        return index, end_of_move(timeline, index)
    return None


def room(timeline: Timeline, low: int, high: int) -> tuple[float, float]:
    """Times [s] between which a move, segments low to high − 1, can begin without passing another one."""
    held = low > 0 and timeline.owner_of(low - 1) == HOLD
    following = next_move(timeline, high)
    earliest = timeline.start_of(low - 1 if held else low)
    return earliest, float("inf") if following is None else timeline.start_of(following)


def moved(
    timeline: Timeline,
    low: int,
    high: int,
    t: float,
    command_id: int,
    plan_move: MovePlanner,
    plan_join: JoinPlanner,
    stopper: Stopper,
) -> Edit[Timeline]:
    """Let a move, segments low to high − 1, begin at t, in the room that it has.

    Holds next to it give and take; only where they don't suffice does what follows come later. If the arm moves
    where the move began, it brakes there and waits.

    Raises:
        PlanningError: If a planner has no plan.
    """
    start = timeline.start_of(low)
    gap = _waiting(timeline, min(start, t), t, next_move(timeline, high), stopper)
    return fill(timeline, gap, command_id, plan_move, plan_join)


def removed(timeline: Timeline, low: int, high: int, t: float, stopper: Stopper) -> tuple[Gap, int | None]:
    """The gap that a move, segments low to high − 1, leaves from t on, and where the next move begins.

    If the arm moves at t, it brakes. The gap ends where the next move begins, and its tail is what comes after
    that one: it has to be planned anew from where the arm now stands.
    """
    cut = max(timeline.start_of(low), t)
    following = next_move(timeline, high)
    if following is None:
        return _waiting(timeline, cut, -inf, None, stopper), None
    after = next_move(timeline, end_of_move(timeline, following))
    return _waiting(timeline, cut, timeline.start_of(following), after, stopper), following


def braked(timeline: Timeline, gap: Gap, tail: int, stopper: Stopper) -> Gap:
    """The same gap before another tail, with the arm at rest where it leaves it."""
    if gap.lead or not gap.state.qd.any():
        return gap._replace(tail=tail)
    return _waiting(timeline, gap.cut, -inf, tail, stopper)


def owner_before(timeline: Timeline, t: float) -> int:
    """Command of the segment that is valid just before t, or HOLD."""
    index = len(timeline) if t >= timeline.end else timeline.index_at(t)
    if index == len(timeline) or timeline.start_of(max(index, 0)) >= t:
        index -= 1
    return timeline.owner_of(index) if index >= 0 else HOLD


def _waiting(timeline: Timeline, cut: float, start: float, tail: int | None, stopper: Stopper) -> Gap:
    """A gap that opens at the cut: the arm brakes if it moves, and stands until the start, if that lies later."""
    state = timeline.state_before(cut)
    if cut == start or not state.qd.any():
        lead: tuple[Piece, ...] = (hold(start - cut, state.q),) if start > cut else ()
        return Gap(cut, max(start, cut), state, tail, lead)
    stop, notes = stopper(cut)
    stopped = end_state(stop).q
    braking = piece(stop, owner_before(timeline, cut))
    ready = cut + stop.duration
    lead = (braking, hold(start - ready, stopped)) if start > ready else (braking,)
    rest = np.zeros_like(stopped)
    return Gap(cut, max(start, ready), State(stopped, rest, rest), tail, lead, notes)
