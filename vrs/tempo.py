"""Another pace, stop and resume: edits that keep to the way and change when it is gone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vrs.agenda import Moment
from vrs.chunk import HOLD, Piece, State
from vrs.commands import JointTarget, MotionCommand, Profile, Resume, ScaleTime, Stop
from vrs.errors import PlanningError
from vrs.insertion import Gap, end_of_move, fill, hold, joined, next_move, piece, stay
from vrs.ledger import Change, Entry
from vrs.model import frozen_array
from vrs.pacing import as_plan, composed, halting, paced, remainder, straight_until
from vrs.planning import Plan, stopping, violation
from vrs.planning.plan import end_state
from vrs.receipt import Receipt
from vrs.rescheduling import owner_before, span
from vrs.scheduler import Paused, Scheduler
from vrs.timeline import Timeline

_ROOM = 1e-3
"""Least room [s] to be filled before what follows a stop."""


def scale(plan: Scheduler, command: ScaleTime, now: float | None) -> Receipt:
    """Let what is scheduled run at another pace.

    Raises:
        PlanningError: If a limit would be passed.
    """
    moment = plan.moment(command, now, plan.timeline.start)
    timeline, factor = plan.timeline, command.factor
    t = max(moment.t, timeline.start)
    moment = moment._replace(t=t)
    if factor > 1:
        _check_faster(plan, t, factor)
    for jerk in (False, True):
        law = paced(timeline, t, factor, plan.limits, jerk=jerk)
        ramp = list(composed(timeline, law))
        # Jerk limits bind where any of what the pace changes in keeps them.
        if all(plan.profile(part.command_id) is not Profile.JERK_LIMITED for part in ramp):
            break
    s = law.end if law.durations else t
    pieces = [*ramp, *remainder(timeline, s, factor)]
    after = timeline.edited(t, pieces) if t < timeline.end else timeline.with_version(timeline.version + 1)

    def moved(old: float) -> float:
        if old < t:
            return old
        return t + (law.when(old) if old < s else law.duration + (old - s) / factor)

    change = Change(after.version, plan.ledger.newest + 1, t, frozenset(), moved, stills=False)
    receipt = _receipt(plan, moment, after, t + law.duration, f"{factor:g} times as fast")
    begin = t + law.waits
    if factor != 1 and begin < timeline.end:
        receipt = replace(receipt, shifted_names=plan.named(timeline, max(timeline.index_at(begin), 0), begin))
    plan.timeline = after
    return plan.ledger.accept(receipt, None, timeline, change)


def stop(plan: Scheduler, command: Stop, now: float | None) -> Receipt:
    """Stop along the present motion, from the commanded state, and drop what is scheduled."""
    moment = plan.moment(command, now, plan.timeline.end)
    timeline, t = plan.timeline, moment.t
    number = plan.ledger.newest + 1
    profile = plan.profile(owner_before(timeline, t))
    jerky = profile is Profile.JERK_LIMITED
    state = timeline.state_before(t)
    braking, note = plan.stop_at(t)
    reason = "stood"
    pieces: list[Piece] = []
    if len(braking):
        straight = _straight_stop(plan, state, t) if jerky else None
        if straight is not None:
            way = [piece(straight, owner_before(timeline, t))]
        else:
            way = list(composed(timeline, halting(timeline, t, plan.limits, jerk=jerky)))
        smooth = not jerky or all(plan.smooth(i) for i in {part.command_id for part in way})
        # A plan made under other limits may have no way to stop on that keeps these.
        keeps = violation(as_plan(way, timeline.dof), plan.limits, jerk=jerky) is None
        on_way = sum(sum(part.durations) for part in way)
        if smooth and keeps and stopping.is_prompt(on_way, braking.duration):
            reason = "stopped on its way"
            pieces = [part._replace(command_id=number) for part in way]
        else:
            reason = joined("each joint braked: the limits don't let it keep to its way", note)
            pieces = [piece(braking, number)]
    after = timeline.edited(t, pieces)
    end = t + sum(sum(part.durations) for part in pieces)
    names = plan.named(timeline, max(timeline.index_at(t), 0), t)
    receipt = _receipt(plan, moment, after, end, reason)
    receipt = replace(receipt, q=frozen_array(after.sample(end)), superseded_names=names)
    change = Change(after.version, number, t, None)
    plan.timeline = after
    plan.note_profile(number, profile)
    plan.paused = Paused(after.version, timeline, t)
    return plan.ledger.accept(receipt, None, timeline, change)


def resume(plan: Scheduler, command: Resume, now: float | None) -> Receipt:
    """Go on with what the newest stop interrupted and dropped.

    The interrupted command is planned anew from where the arm stands; what was scheduled after it follows as it
    was, at its time if that can still be.

    Raises:
        PlanningError: If nothing was stopped, or something was commanded since.
    """
    moment = plan.moment(command, now, plan.timeline.end)
    paused, timeline = plan.paused, plan.timeline
    if paused is None or paused.version != timeline.version:
        raise PlanningError("there's nothing to resume: nothing was stopped, or something was commanded since")
    t = max(moment.t, timeline.end)
    old, index = paused.timeline, paused.timeline.index_at(paused.at)
    number = plan.ledger.newest + 1
    owner = old.owner_of(index) if 0 <= index < len(old) else HOLD
    interrupted = plan.ledger.before(owner, paused.version)
    motion = plan.ledger.command(owner)
    segments = None
    if interrupted is not None and interrupted.execute_at is not None:
        segments = span(old, owner, interrupted.execute_at)
    after_it = max(index, 0)
    if segments is not None:
        after_it = segments[1]
    elif owner != HOLD:
        after_it = end_of_move(old, index)
    tail = next_move(old, after_it)
    unfinished = interrupted is not None and interrupted.end is not None and interrupted.end > paused.at
    goes_on = unfinished and motion is not None
    if unfinished and not goes_on and tail is None:
        raise PlanningError(f"there's nothing to resume: command {owner} steered, and its inputs are old")
    joiner = plan.joiner(motion or MotionCommand(JointTarget(old.initial), profile=plan.profile(owner)))
    planner = stay("")
    if motion is not None and interrupted is not None and interrupted.q is not None and goes_on:
        planner = plan.planner(replace(motion, target=JointTarget(interrupted.q)))
    rest = np.zeros(timeline.dof)
    state = State(timeline.state_before(t).q, rest, rest)
    waiting, begin, placed, following = timeline, np.inf, np.inf, None
    if tail is not None:
        # What followed is put behind the present, so that the gap before it can be filled.
        begin = old.start_of(tail)
        placed = max(begin, t + _ROOM)
        followers = [old.segment(i) for i in range(tail, len(old))]
        pieces = [Piece([s.duration], [s.coefficients], s.command_id or HOLD) for s in followers]
        waiting = timeline.edited(t, [hold(placed - t, state.q), *pieces])
        # Counted, not looked up by time: the first of them may be too short to last at its time.
        following = len(waiting) - len(pieces)
    made = fill(waiting, Gap(t, t, state, following), owner or number, planner, joiner)
    after = made.timeline.with_version(timeline.version + 1)
    shift = made.shift + placed - begin if tail is not None else 0.0

    def moved(was: float) -> float:
        return was + shift if was >= begin else was

    change = Change(after.version, number, paused.at, frozenset(), moved, begin)
    lost = [
        i for i in old.owners(max(index, 0), len(old) if tail is None else tail) if not (goes_on and i == owner)
    ]
    others: tuple[Entry, ...] = ()
    if interrupted is not None and goes_on:
        reason = joined("goes on after a stop", made.notes)
        again = replace(interrupted, execute_at=t, end=made.arrival, version=after.version, reason=reason)
        others = ((again, motion),)
    moment = moment._replace(t=t)
    receipt = _receipt(plan, moment, after, made.arrival, joined("resumed", made.notes))
    names = tuple(i for i in lost if not plan.ledger.arrived(i, paused.at))
    receipt = replace(receipt, shift=shift, superseded_names=names)
    plan.timeline = after
    return plan.ledger.reinstate(receipt, timeline, change, others)


def _straight_stop(plan: Scheduler, state: State, t: float) -> Plan | None:
    """A stop at t along a way that's straight in joint space, and long enough; None where it isn't."""
    until = straight_until(plan.timeline, t)
    found = None if until is None else stopping.straight_stop(state, plan.limits)
    if found is None or until is None:
        return None
    ahead, needed = plan.timeline.sample(until) - state.q, end_state(found).q - state.q
    return found if ahead @ state.qd >= needed @ state.qd else None


def _receipt(plan: Scheduler, moment: Moment, after: Timeline, end: float, reason: str) -> Receipt:
    reason = joined(moment.reason, reason)
    number = plan.ledger.newest + 1
    stamps = moment.issued, moment.asked, moment.t
    return Receipt(number, moment.status, *stamps, end, None, reason, after.version)


def _check_faster(plan: Scheduler, t: float, factor: float) -> None:
    """Refuse a pace that passes a limit, and say how fast it could be.

    Raises:
        PlanningError: If it does.
    """
    timeline = plan.timeline

    def problem(pace: float) -> str | None:
        pieces = list(remainder(timeline, t, pace))
        smooth = [part for part in pieces if plan.profile(part.command_id) is Profile.JERK_LIMITED]
        found = violation(as_plan(pieces, timeline.dof), plan.limits, jerk=False)
        return found or violation(as_plan(smooth, timeline.dof), plan.limits, jerk=True)

    found = problem(factor)
    if found is None:
        return
    low, high = 1.0, factor
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if problem(middle) is None else (low, middle)
    raise PlanningError(f"{found}; what is scheduled can run at most {low:.4g} times as fast")
