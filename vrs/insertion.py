"""Insertion: how a planned command changes the timeline. Source: Doulgeri et al., section II-B, eq. (5)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vrs.chunk import HOLD, Piece, State
from vrs.commands import Insertion
from vrs.model import Array
from vrs.planning import Plan
from vrs.timeline import Timeline

MovePlanner = Callable[[State], tuple[Plan, str]]
"""Plans the new move from the state at its start."""
JoinPlanner = Callable[[Array, State], tuple[Plan, str]]
"""Plans from rest at the new target to the state in which the tail begins."""


@dataclass(frozen=True, slots=True)
class Edit:
    """What an insertion makes."""

    timeline: Timeline
    arrival: float
    """When the new move is at its target [s]."""
    shift: float = 0.0
    """Δ of the tail [s]."""
    shifted: tuple[int, ...] = ()
    """Commands whose moves come later."""
    cut: tuple[int, ...] = ()
    """Commands of which segments were dropped or shortened."""
    notes: str = ""


def end_of_move(timeline: Timeline, index: int) -> int:
    """One past the last segment of the move that a segment belongs to.

    A move is one command's segments; the hold in which it spends slack before its joining move is part of it.
    """
    owner = timeline.owner_of(index)
    last = len(timeline) - 1
    while index < last:
        step = 2 if timeline.owner_of(index + 1) == HOLD and index + 1 < last else 1
        if timeline.owner_of(index + step) != owner:
            break
        index += step
    return index + 1


def insert(
    timeline: Timeline,
    t: float,
    how: Insertion,
    command_id: int,
    plan_move: MovePlanner,
    plan_join: JoinPlanner,
) -> Edit:
    """Put a move into the timeline at t.

    The past stays; the interrupted move's rest is dropped; with SPLICE the moves after it follow, shifted as a
    whole by one Δ ≥ 0, behind a joining move. Slack is spent at rest: at the tail's first state or, if that
    state moves, at the new target.

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
    state = timeline.state_before(t)
    plan, note = plan_move(state)
    target = _end_position(plan, state)
    arrival = t + plan.duration
    index = max(timeline.index_at(t), 0) if t < timeline.end else len(timeline)
    dropped_to = len(timeline)
    tail = None
    if index < len(timeline):
        if how is Insertion.REPLACE:
            tail = None
        elif timeline.owner_of(index) == HOLD:
            dropped_to = index if t < timeline.start else index + 1
            tail = dropped_to
        elif t < timeline.start:
            dropped_to = tail = 0
        else:
            dropped_to = tail = end_of_move(timeline, index)
    cut = timeline.owners(index, dropped_to)
    new = Piece(plan.durations.tolist(), plan.rows(), command_id)
    if tail is None or not timeline.owners(tail, len(timeline)):
        return Edit(timeline.edited(t, [new]), arrival, cut=cut, notes=note)
    scheduled = timeline.start_of(tail)
    goal = timeline.state_after(tail)
    join, join_note = plan_join(target, goal)
    joining = Piece(join.durations.tolist(), join.rows(), command_id)
    ready = arrival + join.duration
    slack = scheduled - ready
    pieces = [new, joining]
    if slack > 0:
        moving = bool(goal.qd.any())
        rest = np.array(target if moving else goal.q)[None]
        rest.flags.writeable = False
        pieces.insert(1 if moving else 2, Piece([slack], [rest], HOLD))
    begin = scheduled if slack >= 0 else ready
    after = timeline.edited(t, pieces, tail, begin)
    late = begin - scheduled
    shifted = timeline.owners(tail, len(timeline)) if late > 0 else ()
    return Edit(after, arrival, late, shifted, cut, "; ".join(text for text in (note, join_note) if text))


def _end_position(plan: Plan, state: State) -> Array:
    if len(plan) == 0:
        return state.q
    a, h = plan.coefficients[-1], float(plan.durations[-1])
    value = a[-1]
    for row in a[-2::-1]:
        value = value * h + row
    return np.asarray(value)
