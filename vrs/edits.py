"""Edits of the plan: retime, cancel, a via, another pace, stop and resume, under the same causality as moves."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from vrs import tempo
from vrs.agenda import Moment
from vrs.chunk import State
from vrs.commands import (
    Cancel,
    Insertion,
    InsertVia,
    JointTarget,
    MotionCommand,
    PlanEdit,
    Retime,
    ScaleTime,
    Stop,
)
from vrs.errors import PlanningError
from vrs.insertion import Edit, Gap, fill, insert, joined, next_move, stay
from vrs.ledger import Entry
from vrs.model import Array, Limits, frozen_array
from vrs.planning import Plan, rounding
from vrs.receipt import Receipt, Status
from vrs.rescheduling import braked, moved, removed, room, span
from vrs.scheduler import REFUSALS, Scheduler
from vrs.timeline import Timeline


def edit(plan: Scheduler, command: PlanEdit, now: float | None) -> Receipt:
    """Carry out an edit of the plan.

    Args:
        plan: What it's to change.
        command: The edit.
        now: Present time [s]; None offline.

    Returns:
        The receipt of the command that was edited, or of the edit; rejected, with nothing changed, where it
        can't be.

    Raises:
        UnknownCommandError: If it names a command that has no receipt.
    """
    if isinstance(command, (Retime, Cancel, InsertVia)):
        receipt = plan.ledger.receipt(command.command_id)
        issued = command.issued_at if command.issued_at is not None else now
        try:
            if isinstance(command, Retime):
                return _retime(plan, command, receipt, now)
            if isinstance(command, Cancel):
                return _cancel(plan, command, receipt, now)
            return _insert_via(plan, command, receipt, now)
        except REFUSALS as error:
            version = plan.timeline.version
            asked = command.execute_at
            return Receipt(receipt.command_id, Status.REJECTED, issued, asked, reason=str(error), version=version)
    try:
        if isinstance(command, ScaleTime):
            return tempo.scale(plan, command, now)
        if isinstance(command, Stop):
            return tempo.stop(plan, command, now)
        return tempo.resume(plan, command, now)
    except REFUSALS as error:
        issued = command.issued_at if command.issued_at is not None else now
        return plan.reject(issued, command.execute_at, str(error))


def _scheduled(receipt: Receipt, t: float) -> tuple[float, float]:
    """Start and end of a move that isn't over at t [s].

    Raises:
        PlanningError: If there's none.
    """
    start, end, name = receipt.execute_at, receipt.end, f"command {receipt.command_id}"
    if receipt.undone:
        raise PlanningError(f"{name} was taken back")
    if receipt.superseded_by is not None:
        raise PlanningError(f"{name} was superseded by command {receipt.superseded_by}")
    if start is None or end is None:
        raise PlanningError(f"{name} was rejected")
    if end < t:
        raise PlanningError(f"{name} is over: it arrived at {end:.6g} s")
    return start, end


def _motion(plan: Scheduler, receipt: Receipt) -> MotionCommand:
    """The command of a move, with the arm solution that it got.

    Raises:
        PlanningError: If it was no motion command.
    """
    command = plan.ledger.command(receipt.command_id)
    if command is None or receipt.q is None:
        raise PlanningError(f"command {receipt.command_id} is no move that can be planned anew")
    return replace(command, target=JointTarget(receipt.q), insertion=Insertion.SPLICE)


def _retime(plan: Scheduler, command: Retime, receipt: Receipt, now: float | None) -> Receipt:
    moment = plan.moment(command, now, command.execute_at)
    t = moment.t
    start, _ = _scheduled(receipt, -np.inf if now is None else now)
    segments = span(plan.timeline, receipt.command_id, start)
    if now is not None and min(start, _first(plan, segments)) < now:
        raise PlanningError(f"command {receipt.command_id} began at {start:.6g} s")
    motion = _motion(plan, receipt)
    planner, joiner = plan.planner(motion), plan.joiner(motion)
    reason = joined(moment.reason, f"retimed from {start:.6g} s")
    if segments is not None:
        earliest, latest = room(plan.timeline, *segments)
        if earliest <= t < latest:
            made = moved(plan.timeline, *segments, t, receipt.command_id, planner, joiner, plan.stop_at)
            at = min(start, t, plan.timeline.start_of(segments[0]))
            return plan.accept(_as_planned(plan, receipt, made, moment, reason, at), motion, made, at)
    # It goes past another move: it's taken out, and commanded again at its new time.
    before = plan.timeline
    taken = _take_out(plan, receipt, start, now)
    try:
        made = insert(plan.timeline, t, Insertion.SPLICE, receipt.command_id, planner, joiner)
    except REFUSALS:
        plan.ledger.take_back(before.version)
        plan.timeline = before
        raise
    answer = _as_planned(plan, receipt, made, moment, reason, t)
    answer = replace(
        answer,
        shift=taken.shift + made.shift,
        shifted_names=partial(_united, taken, answer, "shifted"),
        superseded_names=partial(_united, taken, answer, "superseded"),
        reason=joined(answer.reason, taken.reason.removeprefix("cancelled; ").removeprefix("cancelled")),
    )
    accepted = plan.accept(answer, motion, made, t)
    plan.ledger.fuse()
    return accepted


def _united(first: Receipt, second: Receipt, names: str) -> tuple[int, ...]:
    """Commands that either of two edits names, except the one that's edited."""
    both = (*getattr(first, names), *getattr(second, names))
    return tuple(dict.fromkeys(i for i in both if i != first.command_id))


def _as_planned(
    plan: Scheduler, receipt: Receipt, made: Edit[Timeline], moment: Moment, reason: str, at: float
) -> Receipt:
    """A command's receipt after it was planned anew, by an edit that changes nothing before a time."""
    shifted, dropped = plan.touched(made, at)
    return replace(
        receipt,
        status=moment.status,
        execute_at=made.start,
        end=made.arrival,
        q=frozen_array(made.target),
        reason=joined(reason, made.notes),
        version=made.timeline.version,
        shift=made.shift,
        shifted_names=shifted,
        superseded_names=dropped,
    )


def _cancel(plan: Scheduler, command: Cancel, receipt: Receipt, now: float | None) -> Receipt:
    moment = plan.moment(command, now, -np.inf)
    start, _ = _scheduled(receipt, moment.t)
    return _take_out(plan, receipt, max(start, moment.t), now)


def _first(plan: Scheduler, segments: tuple[int, int] | None) -> float:
    """The knot at which a move begins [s]: its receipt's time may lie a rounding later."""
    return np.inf if segments is None else plan.timeline.start_of(segments[0])


def _take_out(plan: Scheduler, receipt: Receipt, t: float, now: float | None) -> Receipt:
    """Take a move out of the plan from t on; the one after it goes from where the arm then stands."""
    timeline = plan.timeline
    segments = span(timeline, receipt.command_id, receipt.execute_at if receipt.execute_at is not None else t)
    started = receipt.execute_at is not None and receipt.execute_at < t
    started = started or (now is not None and _first(plan, segments) < now)
    reason = f"cancelled from {t:.6g} s on" if started else "cancelled"
    others: tuple[Entry, ...] = ()
    if segments is None:
        made = Edit(timeline.with_version(timeline.version + 1), t, t, timeline.state_before(t).q)
    else:
        # Receipts' times are rounded: what hasn't begun is taken out from its first segment on.
        gap, following = removed(timeline, *segments, t if started else -np.inf, plan.stop_at)
        if following is None:
            made = Edit(timeline.edited(gap.cut, gap.lead), gap.start, gap.start, gap.state.q, notes=gap.note)
        else:
            made, others = _replanned(plan, gap, following, receipt.command_id)
    shifted, dropped = plan.touched(made, t)
    answer = replace(
        receipt,
        reason=joined(reason, made.notes),
        version=made.timeline.version,
        undone=True,
        shift=made.shift,
        shifted_names=shifted,
        superseded_names=dropped,
    )
    return plan.accept(answer, plan.ledger.command(receipt.command_id), made, t, others=others)


def _replanned(
    plan: Scheduler, gap: Gap, following: int, cancelled: int
) -> tuple[Edit[Timeline], tuple[Entry, ...]]:
    """Plan the move that begins with a segment anew, from where a gap leaves the arm."""
    timeline = plan.timeline
    other = timeline.owner_of(following)
    try:
        receipt = plan.ledger.receipt(other)
        motion = _motion(plan, receipt)
        _scheduled(receipt, gap.cut)
        made = fill(timeline, gap, other, plan.planner(motion), plan.joiner(motion))
    except (*REFUSALS, LookupError):
        # It can't be planned from there: the arm goes to where it begins.
        note = f"the arm still goes to where command {other} begins"
        gap = braked(timeline, gap, following, plan.stop_at)
        join = plan.joiner(MotionCommand(JointTarget(gap.state.q), profile=plan.profile(cancelled)))
        return fill(timeline, gap, cancelled, stay(note), join), ()
    text = f"goes from elsewhere, as command {cancelled} was cancelled"
    shifted = replace(
        receipt,
        execute_at=made.start,
        end=made.arrival,
        reason=joined(text, made.notes),
        version=made.timeline.version,
    )
    return made, ((shifted, plan.ledger.command(other)),)


def _insert_via(plan: Scheduler, command: InsertVia, receipt: Receipt, now: float | None) -> Receipt:
    moment = plan.moment(command, now, -np.inf)
    start, end = _scheduled(receipt, moment.t)
    t = max(start, moment.t)
    timeline, motion = plan.timeline, _motion(plan, receipt)
    segments = span(timeline, receipt.command_id, start)
    if segments is None or t >= end:
        raise PlanningError(f"command {receipt.command_id} has no move left that could go by a via")
    to_via = replace(motion, target=command.target)

    def by_way(state: State) -> tuple[Plan, Array, str]:
        _, via, _ = plan.planner(to_via)(state)
        rest = State(via, np.zeros_like(via), np.zeros_like(via))
        there = replace(motion, target=JointTarget(via))

        def plans(limits: Limits) -> tuple[Plan, Plan, str]:
            first, _, first_note = plan.planner(there, limits)(state)
            second, _, second_note = plan.planner(motion, limits)(rest)
            return first, second, joined(first_note, second_note)

        way = rounding.rounded(plans, command.deviation, plan.model, plan.limits, motion.profile)
        return way.whole, frozen_array(receipt.q if receipt.q is not None else via), way.note

    gap = Gap(t, t, timeline.state_before(t), next_move(timeline, segments[1]))
    made = fill(timeline, gap, receipt.command_id, by_way, plan.joiner(motion))
    made = made._replace(start=start)
    reason = joined(moment.reason, "goes by a via")
    return plan.accept(_as_planned(plan, receipt, made, moment, reason, t), motion, made, t)
