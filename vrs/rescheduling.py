"""Edits of scheduled moves: another time, none at all, another way."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import TypeAlias

import numpy as np

from vrs.chunk import HOLD, Piece, State
from vrs.insertion import Edit, Gap, JoinPlanner, MovePlanner, end_of_move, fill, hold, next_move, piece
from vrs.planning import Plan
from vrs.planning.plan import end_state
from vrs.timeline import Timeline

Stopper: TypeAlias = Callable[[float], tuple[Plan, str]]
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
    stop, note = stopper(cut)
    stopped = end_state(stop).q
    braking = piece(stop, owner_before(timeline, cut))
    ready = cut + stop.duration
    lead = (braking, hold(start - ready, stopped)) if start > ready else (braking,)
    rest = np.zeros_like(stopped)
    return Gap(cut, max(start, ready), State(stopped, rest, rest), tail, lead, note)
