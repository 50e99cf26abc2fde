"""The scheduler: f, eq. (1), and edits of a timeline under causality, with receipts. Time is an argument.

`BaseScheduler` has what arms and mobile robots share: when an edit acts, its receipt, taking it back. `Scheduler`
is the arms'; `vrs.mobile.scheduler` has the other one.

One concept in over 600 lines: each command and edit acts on the same timeline, ledger and limits.

Source: Doulgeri, Zikos, Delopoulos, section II-B.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from enum import Enum
from functools import partial
from math import inf
from operator import add, attrgetter
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from typing_extensions import override

from vrs.anchoring import Anchored, anchored
from vrs.commands import (
    Alter,
    Cancel,
    DriveCommand,
    Frame,
    Grip,
    Insertion,
    InsertVia,
    JointTarget,
    Lateness,
    MotionCommand,
    PlanEdit,
    Profile,
    Resume,
    Retime,
    ScaleTime,
    SteerCommand,
    Stop,
)
from vrs.errors import InvalidValueError, PlanningError, UnreachablePoseError
from vrs.insertion import (
    Edit,
    Gap,
    JoinPlanner,
    MovePlanner,
    braked,
    end_of_move,
    fill,
    gap_at,
    hold,
    insert,
    lengthened,
    move_before,
    moved,
    next_move,
    owner_before,
    piece,
    removed,
    room,
    span,
    stay,
)
from vrs.ledger import ARRIVED, MOST_KNOWN, Change, Ledger, LedgerEntry, Names, Receipt, Standing, Status
from vrs.model import Array, Limits, RobotModel, frozen_array
from vrs.moves import Passer, join, move
from vrs.notes import Note, NoteCode, Notes, is_rough, text_of
from vrs.pacing import as_plan, composed, halting, paced, remainder, segment_at, straight_until
from vrs.planning import Plan, altering, rounding, steering
from vrs.planning.certificate import violation
from vrs.planning.jerk_limited import is_prompt_stop, stop, straight_stop
from vrs.planning.path import tooled
from vrs.planning.plan import end_position, end_state
from vrs.segment import HOLD, Piece, State, shifted
from vrs.timeline import BaseTimeline, Timeline

TimelineT = TypeVar("TimelineT", bound=BaseTimeline[Any])

REFUSALS = (PlanningError, UnreachablePoseError, InvalidValueError)
"""What planning raises when a command can't be."""

Edited: TypeAlias = MotionCommand | DriveCommand | SteerCommand | PlanEdit | Grip
"""What changes a timeline, or what the hand does along it."""

_NAMED_AT_ONCE = 64
"""Segments whose commands are named at once; those of longer runs when somebody asks."""


class EditTiming(NamedTuple):
    """When an edit acts, and what its receipt says of that."""

    t: float
    issued: float | None
    asked: float | None
    status: Status
    notes: Notes


class BaseScheduler(Generic[TimelineT]):
    """A timeline, the policy for late commands, and a ledger of receipts."""

    def __init__(self, timeline: TimelineT, ledger: Ledger[TimelineT], lateness: Lateness) -> None:
        self.timeline = timeline
        self.ledger = ledger
        self.lateness = lateness

    @contextmanager
    def atomic(self) -> Iterator[None]:
        """Put everything back as it was, receipts too, if what is done meanwhile raises."""
        saved = vars(self).copy()
        with self.ledger.atomic():
            try:
                yield
            except BaseException:
                vars(self).update(saved)
                raise

    def brake(self, t: float, command_id: int) -> tuple[TimelineT, Notes]:
        """What is scheduled, with the robot braking from t [s] on for a command; and what must be said of it."""
        raise NotImplementedError

    def execute(self, command: Edited, now: float | None) -> Receipt:
        """Carry out a command or an edit of what is scheduled.

        Args:
            command: Of a form that fits the robot.
            now: Present time [s]; None offline.

        Returns:
            Its receipt, or that of the command that it edits; rejected, with nothing changed, where it can't be.

        Raises:
            UnknownCommandError: If it names a command that has no receipt.
        """
        try:
            return self.carry_out(command, now)
        except REFUSALS as error:
            issued, asked = now if command.issued_at is None else command.issued_at, command.execute_at
            if not isinstance(command, (Retime, Cancel, InsertVia)):
                return self.reject(issued, asked, str(error))
            number, version = command.command_id, self.timeline.version
            return Receipt(number, Status.REJECTED, issued, asked, reason=str(error), version=version)

    def carry_out(self, command: Edited, now: float | None) -> Receipt:
        """The same where it can be.

        Raises:
            PlanningError: If it can't, as any of `REFUSALS`.
        """
        raise NotImplementedError

    def timing(self, command: Edited, now: float | None, soonest: float) -> EditTiming:
        """When a command acts: as asked, else as soon as it can; a late one at once or, by the other policy, not.

        A late motion begins after the segment that is under way.

        Args:
            command: The command.
            now: Present time [s]; None offline.
            soonest: As soon as it can, offline [s].

        Raises:
            PlanningError: If it's late and the policy rejects, or if it was to act before it was issued.
        """
        issued, asked = command.issued_at, command.execute_at
        if now is None:
            return EditTiming(soonest if asked is None else asked, issued, asked, Status.ACCEPTED, ())
        issued = now if issued is None else issued
        t = max(now, issued) if asked is None else asked
        if t < issued:
            raise PlanningError(f"t_exec = {t:.9g} s lies before t_iss = {issued:.9g} s")
        if t >= now:
            return EditTiming(t, issued, asked, Status.ACCEPTED, ())
        late = f"t_exec = {t:.9g} s had passed at {now:.9g} s"
        if self.lateness is Lateness.REJECT and not isinstance(command, Stop):
            raise PlanningError(late)
        if isinstance(command, (MotionCommand, DriveCommand)):
            t = self.end_of_active(now)
            return EditTiming(t, issued, asked, Status.POSTPONED, (Note(NoteCode.LATE_POSTPONED, (late, t)),))
        return EditTiming(now, issued, asked, Status.POSTPONED, (Note(NoteCode.LATE_AT_ONCE, (late,)),))

    @staticmethod
    def entry(
        command_id: int,
        timing: EditTiming,
        span: tuple[float, float],
        version: int,
        notes: Notes,
        *,
        q: Array | None = None,
        command: MotionCommand | None = None,
        **more: Any,
    ) -> LedgerEntry:
        """What is to be known of a command.

        Args:
            command_id: Its number.
            timing: When it acts.
            span: When its motion begins and ends [s].
            version: Of the timeline that it makes.
            notes: What the user must know of it, beside what its timing says.
            q: Joints of its target [rad], (n,).
            command: The motion command that it is.
            **more: Other fields of its receipt.
        """
        notes = timing.notes + notes
        receipt = Receipt(
            command_id, timing.status, timing.issued, timing.asked, *span, q, text_of(notes), version, **more
        )
        return LedgerEntry(receipt, command, notes)

    def touched(self, edit: Edit[TimelineT], t: float) -> tuple[Names, Names]:
        """Commands that an edit from t on shifts, and commands that it drops or cuts short."""
        before = self.timeline
        shifted: Names = ()
        if edit.shift > ARRIVED and edit.tail is not None:
            shifted = self.named(before, edit.tail, t)
        if edit.dropped is None:
            return shifted, self.named(before, max(before.index_at(t), 0), t)
        return shifted, tuple(i for i in edit.dropped if not self.ledger.arrived(i, t))

    def accept(
        self,
        entry: LedgerEntry,
        edit: Edit[TimelineT],
        at: float,
        *,
        appended: bool = False,
        others: tuple[LedgerEntry, ...] = (),
    ) -> Receipt:
        """Put an edit in force, and write its receipt down.

        Args:
            entry: Of the command that made the edit.
            edit: What it did.
            at: Earliest time that the edit changed [s].
            appended: Whether all that was scheduled stays.
            others: Other moves that were planned anew.
        """
        before, self.timeline = self.timeline, edit.timeline
        change = None
        if not appended:
            dropped = None if edit.dropped is None else frozenset(edit.dropped)
            moved = partial(add, edit.shift) if edit.shift > 0 else None
            change = Change(edit.timeline.version, entry.receipt.command_id, at, dropped, moved)
        return self.ledger.accept(entry, before, change, others)

    def named(self, timeline: TimelineT, index: int, t: float) -> Names:
        """Commands that arrive after t and have segments from an index on."""
        # Joining moves may stand there first whose commands have arrived.
        if len(timeline) - index > _NAMED_AT_ONCE:
            return partial(_names, self.ledger, timeline, index, t)
        return tuple(i for i in timeline.owners(index, len(timeline)) if not self.ledger.arrived(i, t))

    def reject(
        self, issued: float | None, asked: float | None, reason: str, refusal: Enum | None = None
    ) -> Receipt:
        """Answer a command that can't be."""
        return self.ledger.reject(issued, asked, reason, self.timeline.version, refusal)

    def end_of_active(self, now: float) -> float:
        """End of the segment that is valid now; in a hold, or where none is, now."""
        timeline = self.timeline
        index = timeline.index_at(now)
        if 0 <= index < len(timeline) and timeline.owner_of(index) != HOLD:
            return timeline.start_of(index + 1)
        return now

    def undo(self, now: float | None) -> Receipt | None:
        """Take back the newest edit; see `vrs.engine.Engine.undo`."""
        last = self.ledger.last
        if last is None:
            return None
        version = self.timeline.version + 1
        if now is None or now <= last.at:
            taken, self.timeline = self.timeline, last.before.with_version(version)
            return self.ledger.take_back(version, taken)
        if now >= self.timeline.end:
            return None
        self.timeline, notes = self.brake(now, last.command_id)
        return self.ledger.break_off(Change(version, last.command_id, now, None), notes)

    def redo(self, now: float | None) -> Receipt:
        """Take back the newest undo; see `vrs.engine.Engine.redo`."""
        undone = self.ledger.undone(self.timeline.version)
        if undone is None:
            why = "there's nothing to redo: nothing was undone, or something was commanded since"
            return self.reject(now, None, why)
        if now is not None and now > undone.at:
            why = f"command {undone.command_id} can't be redone: its time, {undone.at:.6g} s, has passed"
            return self.reject(now, None, why)
        self.timeline = undone.before.with_version(self.timeline.version + 1)
        return self.ledger.bring_back(self.timeline.version)

    def undo_refusal(self, now: float | None) -> str:
        """Why there's nothing to take back; see `vrs.engine.Engine.undo_refusal`."""
        last = self.ledger.last
        if last is None:
            return self.ledger.settled
        if now is None or now <= last.at or now < self.timeline.end:
            return ""
        return f"command {last.command_id} is over: what has happened can't be taken back"


def _names(ledger: Ledger[Any], timeline: BaseTimeline[Any], index: int, t: float) -> tuple[int, ...]:
    """Commands that have segments from an index on, and hadn't arrived at t when the timeline was edited."""
    return tuple(i for i in timeline.owners(index, len(timeline)) if not ledger.arrived(i, t, timeline.version + 1))


FRESH = 0.2
"""Age [s] at which a steering input ends."""

_ROOM = 1e-3
"""Least room [s] to be filled before what follows a stop."""


MOST_GRIPS = 4096
"""What the hand was told and is remembered, at most."""


class HandGoal(NamedTuple):
    """What the hand is told at a time."""

    t: float
    """[s]."""
    opening: float
    """[m]; infinity for as far as it goes."""


class Paused(NamedTuple):
    """What a stop interrupted."""

    version: int
    """Version of the timeline that the stop made: any later edit makes it the past."""
    timeline: Timeline
    """As it was before."""
    at: float
    """When the stop began [s]."""


class Alteration(NamedTuple):
    """An offset that's added to what is planned."""

    command_id: int
    version: int
    """Of the timeline that has the offset in it: any edit that doesn't renew it ends it."""
    start: float
    """When the first one began [s]."""
    planned: Timeline
    """Without the offset from the newest one on; what came before is as it was."""
    rejoins: float
    """From here on the timeline is as it's planned [s]."""
    course: altering.Course
    given: Sequence[altering.Given]
    """The newest offsets."""
    lag: float
    """How much later than they were issued they count, as they come so late [s]."""
    frame: Frame
    tool: Array | None
    stays: bool


class Scheduler(BaseScheduler[Timeline]):
    """What an engine has planned: a timeline, the limits in force, and a ledger of receipts."""

    def __init__(self, model: RobotModel, timeline: Timeline, ledger: Ledger[Timeline], lateness: Lateness) -> None:
        super().__init__(timeline, ledger, lateness)
        self.model = model
        self.limits = model.limits
        self.paused: Paused | None = None
        self.profiles: dict[int, Profile] = {}
        """Of commands that are no motion commands."""
        self.session: tuple[int, int, float] | None = None
        """Steering inputs in a row: their command, the version of the timeline that the newest made, when the first
        began [s]."""
        self.alteration: Alteration | None = None
        """The newest; it's in force while the timeline is of its version."""
        self.grips: tuple[HandGoal, ...] = (HandGoal(-inf, inf),)
        """What the hand was told, by time; it begins open."""

    @override
    def carry_out(self, command: Edited, now: float | None) -> Receipt:
        if self.alteration is None or isinstance(command, (SteerCommand, Alter, Stop, Resume, Grip)):
            return self._act(command, now)
        return self._under_offset(partial(self._act, command, now), now)

    def _act(self, command: Edited, now: float | None) -> Receipt:
        match command:
            case MotionCommand():
                return self._move(command, now)
            case Retime():
                return self._retime(command, now)
            case Cancel():
                return self._cancel(command, now)
            case InsertVia():
                return self._insert_via(command, now)
            case ScaleTime():
                return self._scale(command, now)
            case SteerCommand():
                return self._steer(command, now)
            case Alter():
                return self._alter(command, now)
            case Stop():
                return self._stop(command, now)
            case Resume():
                return self._resume(command, now)
            case Grip():
                return self._grip(command, now)
        raise InvalidValueError("command", command, f"for an arm: {self.model.name} has joints and no wheels")

    def _move(self, command: MotionCommand, now: float | None) -> Receipt:
        end = self.timeline.end
        timing = self.timing(command, now, end)
        t, appends = timing.t, command.insertion is Insertion.APPEND
        if appends and t < end:
            t = end
            if timing.asked is not None:
                notes = (*timing.notes, Note(NoteCode.APPENDED, (t,)))
                timing = timing._replace(status=Status.POSTPONED, notes=notes)
        command_id = self.ledger.newest + 1
        if command.deviation > 0:
            edit = self._passing(command, t, command_id, now)
        else:
            planner, joiner = self.planner(command), self.joiner(command)
            edit = insert(self.timeline, t, command.insertion, command_id, planner, joiner)
        appended, t = appends and edit.start == t, edit.start
        shifted, dropped = ((), ()) if appended else self.touched(edit, t)
        target = frozen_array(edit.target) if edit.target.flags.writeable else edit.target
        entry = self.entry(
            command_id, timing, (t, edit.arrival), edit.timeline.version, edit.notes, q=target, command=command,
            shift=edit.shift, shifted_names=shifted, superseded_names=dropped,
        )  # fmt: skip
        return self.accept(entry, edit, t, appended=appended)

    def _passing(self, command: MotionCommand, t: float, command_id: int, now: float | None) -> Edit[Timeline]:
        """Insert a move that begins before the one that ends at t is over, and passes its target at a distance.

        Args:
            command: The command, its deviation above 0.
            t: Where it would begin if it stopped [s].
            command_id: Of the command.
            now: Present time [s]; None offline.

        Raises:
            PlanningError: If it can't be planned.
        """
        gap, dropped = gap_at(self.timeline, t, command.insertion)
        planner, joiner = self.planner(command), self.joiner(command)
        found = move_before(self.timeline, t, -inf if now is None else now, cut=command.deviation == inf)
        # A smooth move that was cut a moment after its start has no speed yet, but an acceleration.
        moving = gap.state.qd.any() or (gap.state.qdd.any() and found is not None and self.smooth(found[2]))
        if found is None or moving:
            made = fill(self.timeline, gap, command_id, planner, joiner, dropped)
            if command.deviation == inf:
                return made
            return made._replace(notes=(*made.notes, Note(NoteCode.NOTHING_TO_ROUND)))
        first, begin, passed_by = found
        rest = np.zeros_like(gap.state.q)
        gap = gap._replace(state=State(gap.state.q, rest, rest))
        second, target, notes = planner(gap.state)
        before = self.ledger.command(passed_by)
        smooth = command.profile is not Profile.JERK_LIMITED or self.smooth(passed_by)
        passer = Passer(
            self.model, self.limits, self.timeline, self.planner, command, gap, t, passed_by, before, smooth, now
        )
        if command.deviation == inf:
            start, plan, notes = passer.continuous(first, second, begin, notes)
        else:
            start, plan, notes = passer.rounded(first, begin, replace(command, target=JointTarget(target)))
        if start < t and dropped is not None:
            dropped = (passed_by, *dropped)
        gap = gap._replace(cut=start, start=start)
        return fill(self.timeline, gap, command_id, lambda _: (plan, target, notes), joiner, dropped)

    def planner(self, command: MotionCommand, limits: Limits | None = None) -> MovePlanner:
        """Plan a command's move, under the limits in force now or others."""
        return partial(move, command, self.model, self.limits if limits is None else limits)

    def joiner(self, command: MotionCommand) -> JoinPlanner:
        """Plan a joining move at a command's speed and by its profile."""
        return partial(join, command, self.limits)

    def stop_at(self, t: float) -> tuple[Plan, Notes]:
        """Plan a stop of each joint at t [s], jerk-limited where the motion is; and what must be said of it."""
        profile = self.profile(owner_before(self.timeline, t))
        return stop(self.timeline.state_before(t), profile, self.limits)

    def profile(self, command_id: int) -> Profile:
        """By which profile a command moves the arm."""
        made = self.profiles.get(command_id)
        if made is not None:
            return made
        command = self.ledger.command(command_id)
        return Profile.PARABOLIC if command is None else command.profile

    def note_profile(self, command_id: int, profile: Profile) -> None:
        """Write down by which profile a command that's no motion command moves the arm."""
        if self.profiles.get(command_id) is not profile:
            # Another dictionary: `atomic` puts the one before back.
            self.profiles = {**self.profiles, command_id: profile}

    def smooth(self, command_id: int) -> bool:
        """Whether a command moves the arm with bounded jerk throughout."""
        return self.profile(command_id) is Profile.JERK_LIMITED and not is_rough(self.ledger.notes(command_id))

    def _steer(self, command: SteerCommand, now: float | None) -> Receipt:
        """Go on, from now, as a hand asks; inputs in a row with nothing else between are one command."""
        timing = self.timing(command, now, self.timeline.end)
        t, issued = timing.t, timing.issued
        hold = FRESH - (0.0 if issued is None else max(t - issued, 0.0))
        if hold <= 0:
            raise PlanningError(f"the input is {FRESH - hold:.3g} s old; it moves nothing from {FRESH} s on")
        state = self.timeline.state_before(t)
        plan, notes, hindrance = steering.steer(
            state, command.rates, command.twist, command.frame, hold, self.model, self.limits
        )
        before, session = self.timeline, self.session
        rests = not state.qd.any() and not state.qdd.any()
        if session is not None and (session[1] != before.version or t < session[2] or (rests and t < before.end)):
            session = None
        command_id, _, start = (self.ledger.newest + 1, 0, t) if session is None else session
        after = before
        if len(plan) or t < before.end or session is None:
            after = lengthened(before, t, piece(plan, command_id))
        if after is before:
            stands = self.ledger.receipt(command_id)
            if stands.hindrance != hindrance:
                stands = replace(stands, hindrance=hindrance)
                self.ledger.rewrite(stands)
            return stands
        target = end_position(plan) if len(plan) else state.q
        self.note_profile(command_id, Profile.JERK_LIMITED)
        self.session = command_id, after.version, start
        end = t + plan.duration
        edit = Edit(after, t, end, target, dropped=None)
        superseded = self.touched(edit, t)[1] if session is None else ()
        entry = self.entry(
            command_id, timing, (start, end), after.version, notes, q=frozen_array(target), hindrance=hindrance,
            superseded_names=superseded,
        )  # fmt: skip
        return self.accept(entry, edit, t) if session is None else self._go_on(entry, after)

    def _go_on(self, entry: LedgerEntry, after: Timeline) -> Receipt:
        """Put what a command in force does now in the place of what it did."""
        self.timeline = after
        self.ledger.rewrite(entry.receipt, entry.notes)
        return entry.receipt

    def _alter(self, command: Alter, now: float | None) -> Receipt:
        """Add an offset to what is planned; such commands in a row with nothing else between are one.

        Raises:
            PlanningError: If it's too old, or the limits leave no room for it; what was in force goes on then.
        """
        begins, given = now if command.execute_at is None else command.execute_at, command.issued_at
        if given is not None and begins is not None and given > begins:
            # A clock that's ahead of this one says for when it's meant, not when it begins.
            command = replace(command, issued_at=begins)
        timing = self.timing(command, now, self.timeline.end)
        t = timing.t
        given = t if given is None else given
        if t - given >= FRESH:
            raise PlanningError(f"the offset is {t - given:.3g} s old; it moves nothing from {FRESH} s on")
        before, known = self.timeline, self._offset_at(t)
        if command.offset is None:
            if known is None:
                raise PlanningError("there's no offset that could become a part of the plan")
            self.timeline, self.alteration = before.with_version(before.version + 1), None
            stands = replace(self.ledger.receipt(known.command_id), version=before.version + 1)
            self.ledger.rewrite(stands)
            return stands
        if known is not None and not (known.frame is command.frame and _same_tool(known.tool, command.tool)):
            known = None
        if known is None:
            number = self.ledger.newest + 1
            known = Alteration(
                number, before.version, t, before, t, altering.STILL, (), 0.0, command.frame, command.tool,
                command.stays,
            )  # fmt: skip
        elif given + known.lag < known.given[-1][0] + altering.APART:
            return self.ledger.receipt(known.command_id)
        lag = known.lag if t - given - known.lag <= altering.PROMPT else t - given
        again = altering.remembered(known.given, command.offset, given + lag)
        known = known._replace(given=again, stays=command.stays, lag=lag)
        after, known, notes = self._with_offset(before, known, t, before.version + 1)
        entry = self.entry(
            known.command_id, timing, (known.start, known.rejoins), after.version, notes, hindrance=text_of(notes)
        )
        self.alteration = known
        if known.command_id in self.ledger:
            return self._go_on(entry, after)
        return self.accept(entry, Edit(after, t, known.rejoins, before.state_before(t).q), t, appended=True)

    def _offset_at(self, t: float) -> Alteration | None:
        """The offset that's in force at a time [s]; None where there's none, or it has gone back to nothing."""
        known = self.alteration
        if known is None or known.version != self.timeline.version:
            return None
        return known if t < known.rejoins or known.course.at(np.array([t])).any() else None

    def _with_offset(
        self, timeline: Timeline, known: Alteration, t: float, version: int
    ) -> tuple[Timeline, Alteration, Notes]:
        """What is planned, with an offset from t on.

        Args:
            timeline: As it is until t.
            known: The offset, and what is planned.
            t: When it begins to count [s].
            version: Of the timeline that's made.

        Raises:
            PlanningError: If the limits leave no room for it.
        """
        window = _window(known.planned, t, t + altering.LONGEST)
        ends = max(known.given[-1][0] + altering.DELAY, t) if known.given else t
        jerk = any(self.profile(owner) is Profile.JERK_LIMITED for owner in window.owners)
        task = altering.Task(known.frame, known.tool, self.model, self.limits)
        made = altering.alter(
            window, timeline.state_before(t), known.course.at(np.array([t]))[0], known.given, task,
            stays=known.stays, over=known.stays and known.planned.end <= ends, jerk=jerk,
        )  # fmt: skip
        owners = [window.owners[i] or known.command_id for i in made.segments]
        pieces = [
            Piece([h], [row], owner)
            for h, row, owner in zip(made.plan.durations.tolist(), made.plan.rows(), owners, strict=True)
        ]
        end = float(made.course.knots[-1])
        after = _rejoined(timeline, known.planned, t, pieces, end, known.rejoins).with_version(version)
        known = known._replace(version=version, course=made.course, rejoins=end)
        return after, known, (Note(NoteCode.OFFSET_LATE),) if made.late else ()

    def _under_offset(self, edit: Callable[[], Receipt], now: float | None) -> Receipt:
        """Let an edit change what is planned while an offset is added to that.

        Where the offset doesn't fit onto what it makes, the edit is one of the path with the offset, which ends.
        """
        known = None if now is None else self._offset_at(now)
        if known is None or now is None:
            return edit()
        before, newest = self.timeline, self.ledger.newest
        planned = _rejoined(before, known.planned, now, [], now, known.rejoins).with_version(before.version)
        self.timeline = planned
        try:
            receipt = edit()
        finally:
            if self.timeline is planned:
                self.timeline = before
        if self.timeline is before:
            return receipt
        known = known._replace(planned=self.timeline, rejoins=now)
        try:
            found = self._with_offset(self.timeline, known, now, self.timeline.version)
        except PlanningError:
            self.ledger.take_back(before.version)
            self.timeline, self.ledger.newest = before, newest
            return edit()
        self.timeline, self.alteration, _ = found
        return receipt

    @override
    def undo(self, now: float | None) -> Receipt | None:
        last, known = self.ledger.last, self.alteration
        fresh = last is None or known is None or known.command_id >= last.command_id
        if now is None or last is None or known is None or fresh or now > last.at:
            return super().undo(now)
        # What lies before has another past since then: only what was still to come is put back.
        timeline, version = self.timeline, self.timeline.version + 1
        known = self._offset_at(now)
        planned = _rejoined(timeline, last.before, now, [], now, inf).with_version(version)
        if known is not None:
            try:
                found = self._with_offset(planned, known._replace(planned=planned, rejoins=now), now, version)
            except PlanningError:
                self.timeline, notes = self.brake(now, last.command_id)
                return self.ledger.break_off(Change(version, last.command_id, now, None), notes)
            planned, self.alteration, _ = found
        self.timeline = planned
        return self.ledger.take_back(version)

    def brake(self, t: float, command_id: int) -> tuple[Timeline, Notes]:
        """What is scheduled, with each joint braking from t on; and what must be said of it."""
        stop, notes = self.stop_at(t)
        self.note_profile(command_id, self.profile(owner_before(self.timeline, t)))
        return self.timeline.edited(t, [piece(stop, command_id)]), notes

    @property
    def steered(self) -> tuple[int, float] | None:
        """The command that the next steering input may go on with, and when it began [s]."""
        if self.session is None or self.session[1] != self.timeline.version:
            return None
        command_id, _, start = self.session
        return command_id, start

    def go_on_steering(self, command_id: int, start: float) -> None:
        """Let the next steering input go on with a command that began at a time [s]."""
        self.session = command_id, self.timeline.version, start

    def _motion(self, receipt: Receipt) -> MotionCommand:
        """The command of a move, with the arm solution that it got.

        Raises:
            PlanningError: If it was no motion command.
        """
        command = self.ledger.command(receipt.command_id)
        if command is None or receipt.q is None:
            raise PlanningError(f"command {receipt.command_id} is no move that can be planned anew")
        return replace(command, target=JointTarget(receipt.q), insertion=Insertion.SPLICE)

    def _retime(self, command: Retime, now: float | None) -> Receipt:
        receipt = self.ledger.receipt(command.command_id)
        timing = self.timing(command, now, command.execute_at)
        t = timing.t
        start, _ = _scheduled(receipt, -np.inf if now is None else now)
        segments = span(self.timeline, receipt.command_id, start)
        if now is not None and min(start, self._first(segments)) < now:
            raise PlanningError(f"command {receipt.command_id} began at {start:.6g} s")
        motion = self._motion(receipt)
        planner, joiner = self.planner(motion), self.joiner(motion)
        notes = (*timing.notes, Note(NoteCode.RETIMED, (start,)))
        if segments is not None:
            earliest, latest = room(self.timeline, *segments)
            if earliest <= t < latest:
                made = moved(self.timeline, *segments, t, receipt.command_id, planner, joiner, self.stop_at)
                at = min(start, t, self.timeline.start_of(segments[0]))
                return self.accept(self._as_planned(receipt, motion, made, timing, notes, at), made, at)
        # It goes past another move: it's taken out, and commanded again at its new time.
        before = self.timeline
        taken, more = self._take_out(receipt, start, now)
        try:
            made = insert(self.timeline, t, Insertion.SPLICE, receipt.command_id, planner, joiner)
        except REFUSALS:
            self.ledger.take_back(before.version)
            self.timeline = before
            raise
        planned = self._as_planned(receipt, motion, made, timing, notes, t)
        answer, notes = planned.receipt, planned.notes + more
        answer = replace(
            answer,
            shift=taken.shift + made.shift,
            shifted_names=partial(_united, taken, answer, "shifted"),
            superseded_names=partial(_united, taken, answer, "superseded"),
            reason=text_of(notes),
        )
        accepted = self.accept(LedgerEntry(answer, motion, notes), made, t)
        self.ledger.fuse()
        return accepted

    def _as_planned(
        self,
        receipt: Receipt,
        motion: MotionCommand,
        made: Edit[Timeline],
        timing: EditTiming,
        notes: Notes,
        at: float,
    ) -> LedgerEntry:
        """A command after it was planned anew, by an edit that changes nothing before a time."""
        shifted, dropped = self.touched(made, at)
        notes += made.notes
        receipt = replace(
            receipt,
            status=timing.status,
            execute_at=made.start,
            end=made.arrival,
            q=frozen_array(made.target),
            reason=text_of(notes),
            version=made.timeline.version,
            shift=made.shift,
            shifted_names=shifted,
            superseded_names=dropped,
        )
        return LedgerEntry(receipt, motion, notes)

    def _cancel(self, command: Cancel, now: float | None) -> Receipt:
        receipt = self.ledger.receipt(command.command_id)
        timing = self.timing(command, now, -np.inf)
        start, _ = _scheduled(receipt, timing.t)
        return self._take_out(receipt, max(start, timing.t), now)[0]

    def _first(self, segments: tuple[int, int] | None) -> float:
        """The knot at which a move begins [s]: its receipt's time may lie a rounding later."""
        return np.inf if segments is None else self.timeline.start_of(segments[0])

    def _take_out(self, receipt: Receipt, t: float, now: float | None) -> tuple[Receipt, Notes]:
        """Take a move out of the plan from t on; the one after it goes from where the arm then stands.

        Returns:
            The receipt of the move, and what must be said of the moves around it.
        """
        timeline = self.timeline
        segments = span(timeline, receipt.command_id, receipt.execute_at if receipt.execute_at is not None else t)
        started = receipt.execute_at is not None and receipt.execute_at < t
        started = started or (now is not None and self._first(segments) < now)
        note = Note(NoteCode.CANCELLED_FROM, (t,)) if started else Note(NoteCode.CANCELLED)
        others: tuple[LedgerEntry, ...] = ()
        if segments is None:
            made = Edit(timeline.with_version(timeline.version + 1), t, t, timeline.state_before(t).q)
        else:
            # Receipts' times are rounded: what hasn't begun is taken out from its first segment on.
            gap, following = removed(timeline, *segments, t if started else -np.inf, self.stop_at)
            if following is None:
                made = Edit(timeline.edited(gap.cut, gap.lead), gap.start, gap.start, gap.state.q, notes=gap.notes)
            else:
                made, others = self._replanned(gap, following, receipt.command_id)
        shifted, dropped = self.touched(made, t)
        notes = (note, *made.notes)
        answer = replace(
            receipt,
            reason=text_of(notes),
            version=made.timeline.version,
            undone=True,
            shift=made.shift,
            shifted_names=shifted,
            superseded_names=dropped,
        )
        entry = LedgerEntry(answer, self.ledger.command(receipt.command_id), notes)
        return self.accept(entry, made, t, others=others), made.notes

    def _replanned(
        self, gap: Gap, following: int, cancelled: int
    ) -> tuple[Edit[Timeline], tuple[LedgerEntry, ...]]:
        """Plan the move that begins with a segment anew, from where a gap leaves the arm."""
        timeline = self.timeline
        other = timeline.owner_of(following)
        try:
            receipt = self.ledger.receipt(other)
            motion = self._motion(receipt)
            _scheduled(receipt, gap.cut)
            made = fill(timeline, gap, other, self.planner(motion), self.joiner(motion))
        except (*REFUSALS, LookupError):
            # It can't be planned from there: the arm goes to where it begins.
            note = Note(NoteCode.LEADS_ON, (other,))
            gap = braked(timeline, gap, following, self.stop_at)
            join = self.joiner(MotionCommand(JointTarget(gap.state.q), profile=self.profile(cancelled)))
            return fill(timeline, gap, cancelled, stay((note,)), join), ()
        notes = (Note(NoteCode.REPLANNED, (cancelled,)), *made.notes)
        shifted = replace(
            receipt,
            execute_at=made.start,
            end=made.arrival,
            reason=text_of(notes),
            version=made.timeline.version,
        )
        return made, (LedgerEntry(shifted, self.ledger.command(other), notes),)

    def _insert_via(self, command: InsertVia, now: float | None) -> Receipt:
        receipt = self.ledger.receipt(command.command_id)
        timing = self.timing(command, now, -np.inf)
        start, end = _scheduled(receipt, timing.t)
        t = max(start, timing.t)
        timeline, motion = self.timeline, self._motion(receipt)
        segments = span(timeline, receipt.command_id, start)
        if segments is None or t >= end:
            raise PlanningError(f"command {receipt.command_id} has no move left that could go by a via")
        to_via = replace(motion, target=command.target)

        def by_way(state: State) -> tuple[Plan, Array, Notes]:
            _, via, _ = self.planner(to_via)(state)
            rest = State(via, np.zeros_like(via), np.zeros_like(via))
            there = replace(motion, target=JointTarget(via))

            def plans(limits: Limits) -> tuple[Plan, Plan, Notes]:
                first, _, first_notes = self.planner(there, limits)(state)
                second, _, second_notes = self.planner(motion, limits)(rest)
                return first, second, first_notes + second_notes

            seen = tooled(self.model, motion.tool)
            way = rounding.rounded(plans, command.deviation, seen, self.limits, motion.profile)
            led = Note(NoteCode.BY_A_VIA, (command.deviation, *via.tolist()))
            return way.whole, frozen_array(receipt.q if receipt.q is not None else via), (led, *way.notes)

        gap = Gap(t, t, timeline.state_before(t), next_move(timeline, segments[1]))
        made = fill(timeline, gap, receipt.command_id, by_way, self.joiner(motion))
        made = made._replace(start=start)
        return self.accept(self._as_planned(receipt, motion, made, timing, timing.notes, t), made, t)

    def _scale(self, command: ScaleTime, now: float | None) -> Receipt:
        """Let what is scheduled run at another pace.

        Raises:
            PlanningError: If a limit would be passed.
        """
        timing = self.timing(command, now, self.timeline.start)
        timeline, factor = self.timeline, command.factor
        t = max(timing.t, timeline.start)
        if factor > 1:
            self._check_faster(t, factor)
        for jerk in (False, True):
            law = paced(timeline, t, factor, self.limits, jerk=jerk)
            ramp = list(composed(timeline, law))
            # Jerk limits bind where any of what the pace changes in keeps them.
            if all(self.profile(part.command_id) is not Profile.JERK_LIMITED for part in ramp):
                break
        s = law.end if law.durations else t
        pieces = [*ramp, *remainder(timeline, s, factor)]
        after = timeline.edited(t, pieces) if t < timeline.end else timeline.with_version(timeline.version + 1)

        def moved(old: float) -> float:
            if old < t:
                return old
            return t + (law.when(old) if old < s else law.duration + (old - s) / factor)

        number, begin = self.ledger.newest + 1, t + law.waits
        shifted: Names = ()
        change = Change(after.version, number, t, frozenset(), moved, stills=False)
        if factor != 1 and begin < timeline.end:
            shifted = self.named(timeline, max(timeline.index_at(begin), 0), begin)
        notes = (Note(NoteCode.AT_A_PACE, (factor,)),)
        entry = self.entry(number, timing, (t, t + law.duration), after.version, notes, shifted_names=shifted)
        self.timeline = after
        return self.ledger.accept(entry, timeline, change)

    def _stop(self, command: Stop, now: float | None) -> Receipt:
        """Stop along the present motion, from the commanded state, and drop what is scheduled."""
        timing = self.timing(command, now, self.timeline.end)
        timeline, t = self.timeline, timing.t
        number = self.ledger.newest + 1
        profile = self.profile(owner_before(timeline, t))
        jerky = profile is Profile.JERK_LIMITED
        state = timeline.state_before(t)
        braking, more = self.stop_at(t)
        notes: Notes = (Note(NoteCode.STOOD),)
        pieces: list[Piece] = []
        if len(braking):
            straight = self._straight_stop(state, t) if jerky else None
            if straight is not None:
                way = [piece(straight, owner_before(timeline, t))]
            else:
                way = list(composed(timeline, halting(timeline, t, self.limits, jerk=jerky)))
            smooth = not jerky or all(self.smooth(i) for i in {part.command_id for part in way})
            # A plan made under other limits may have no way to stop on that keeps these.
            keeps = violation(as_plan(way, timeline.dof), self.limits, jerk=jerky) is None
            on_way = sum(sum(part.durations) for part in way)
            if smooth and keeps and is_prompt_stop(on_way, braking.duration):
                notes = (Note(NoteCode.STOPPED_ON_WAY),)
                pieces = [part._replace(command_id=number) for part in way]
            else:
                notes = (Note(NoteCode.EACH_JOINT_BRAKED), *more)
                pieces = [piece(braking, number)]
        after = timeline.edited(t, pieces)
        end = t + sum(sum(part.durations) for part in pieces)
        edit = Edit(after, t, end, frozen_array(after.sample(end)), dropped=None)
        _, names = self.touched(edit, t)
        entry = self.entry(number, timing, (t, end), after.version, notes, q=edit.target, superseded_names=names)
        self.note_profile(number, profile)
        self.paused = Paused(after.version, timeline, t)
        self.grips = tuple(goal for goal in self.grips if goal.t <= t)
        return self.accept(entry, edit, t)

    def _grip(self, command: Grip, now: float | None) -> Receipt:
        """Let the hand do something at a time."""
        timing = self.timing(command, now, self.timeline.end)
        t, number = timing.t, self.ledger.newest + 1
        entry = self.entry(number, timing, (t, t), self.timeline.version, ())
        place = bisect_right(self.grips, t, key=attrgetter("t"))
        grips = (*self.grips[:place], HandGoal(t, command.opening), *self.grips[place:])
        self.grips = grips[-MOST_GRIPS:]
        self.ledger.note(entry)
        self.ledger.newest = number
        return entry.receipt

    def opening(self, t: ArrayLike) -> Array:
        """What the hand is told by times [s], () or (k,): its opening [m], infinity for as far as it goes."""
        known, grips = np.array([goal.t for goal in self.grips]), np.array([goal.opening for goal in self.grips])
        return np.asarray(grips[np.maximum(np.searchsorted(known, t, side="right") - 1, 0)])

    def _resume(self, command: Resume, now: float | None) -> Receipt:
        """Go on with what the newest stop interrupted and dropped.

        The interrupted command is planned anew from where the arm stands; what was scheduled after it follows as it
        was, at its time if that can still be.

        Raises:
            PlanningError: If nothing was stopped, or something was commanded since.
        """
        timing = self.timing(command, now, self.timeline.end)
        paused, timeline = self.paused, self.timeline
        if paused is None or paused.version != timeline.version:
            raise PlanningError("there's nothing to resume: nothing was stopped, or something was commanded since")
        t = max(timing.t, timeline.end)
        old, index = paused.timeline, paused.timeline.index_at(paused.at)
        number = self.ledger.newest + 1
        owner = old.owner_of(index) if 0 <= index < len(old) else HOLD
        interrupted = self.ledger.receipt(owner, before=paused.version) if owner in self.ledger else None
        motion = self.ledger.command(owner)
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
        joiner = self.joiner(motion or MotionCommand(JointTarget(old.initial), profile=self.profile(owner)))
        planner = stay(())
        if motion is not None and interrupted is not None and interrupted.q is not None and goes_on:
            planner = self.planner(replace(motion, target=JointTarget(interrupted.q)))
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
        others: tuple[LedgerEntry, ...] = ()
        if interrupted is not None and goes_on:
            notes = (Note(NoteCode.GOES_ON), *made.notes)
            again = replace(
                interrupted, execute_at=t, end=made.arrival, version=after.version, reason=text_of(notes)
            )
            others = (LedgerEntry(again, motion, notes),)
        names = tuple(i for i in lost if not self.ledger.arrived(i, paused.at))
        entry = self.entry(
            number, timing, (t, made.arrival), after.version, (Note(NoteCode.RESUMED), *made.notes), shift=shift,
            superseded_names=names,
        )  # fmt: skip
        self.timeline = after
        return self.ledger.reinstate(entry, timeline, change, others)

    def _straight_stop(self, state: State, t: float) -> Plan | None:
        """A stop at t along a way that's straight in joint space, and long enough; None where it isn't."""
        until = straight_until(self.timeline, t)
        found = None if until is None else straight_stop(state, self.limits)
        if found is None or until is None:
            return None
        ahead, needed = self.timeline.sample(until) - state.q, end_state(found).q - state.q
        return found if ahead @ state.qd >= needed @ state.qd else None

    def _check_faster(self, t: float, factor: float) -> None:
        """Refuse a pace that passes a limit, and say how fast it could be.

        Raises:
            PlanningError: If it does.
        """
        timeline = self.timeline

        def problem(pace: float) -> str | None:
            pieces = list(remainder(timeline, t, pace))
            smooth = [part for part in pieces if self.profile(part.command_id) is Profile.JERK_LIMITED]
            found = violation(as_plan(pieces, timeline.dof), self.limits, jerk=False)
            return found or violation(as_plan(smooth, timeline.dof), self.limits, jerk=True)

        found = problem(factor)
        if found is None:
            return
        low, high = 1.0, factor
        for _ in range(20):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if problem(middle) is None else (low, middle)
        raise PlanningError(f"{found}; what is scheduled can run at most {low:.4g} times as fast")

    def anchor(self, truth: Timeline, t: float) -> Anchored:
        """Let what is scheduled go over into another timeline from t on; see `vrs.anchoring.anchored`.

        Commands that have moves in the other timeline stand, at the times that they have there; the others are
        superseded. Nothing can be taken back past this.
        """
        before = self.timeline
        made = anchored(before, truth, t, self.limits)
        times: dict[int, tuple[float, float]] = {}
        for index in range(max(truth.index_at(t), 0), len(truth)):
            owner = truth.owner_of(index)
            if owner != HOLD:
                start, _ = times.get(owner, (truth.start_of(index), t))
                times[owner] = start, truth.start_of(index + 1)
        version = before.version + 1
        self.timeline = made.timeline.with_version(version)
        self.ledger.rebase(Change(version, 0, t, None), times)
        return replace(made, timeline=self.timeline)

    def standing(self, now: float) -> Standing:
        """How it stands at a time [s]; what costs no more than what is scheduled."""
        timeline, ledger = self.timeline, self.ledger
        first = max(timeline.index_at(now) - 1, 0)
        last = min(len(timeline), first + MOST_KNOWN)
        names = dict.fromkeys(timeline.owners(first, last))
        session = self.steered
        if session is not None:
            names.setdefault(session[0])
        for command_id in ledger.stills_from(now):
            names.setdefault(command_id)
        known = tuple(
            LedgerEntry(
                ledger.receipt(command_id),
                ledger.command(command_id),
                ledger.notes(command_id),
                profile=self.profile(command_id),
            )
            for command_id in sorted(names)[-MOST_KNOWN:]
            if command_id != HOLD and command_id in ledger
        )
        return Standing(ledger.newest, self.lateness, self.limits, session, known, float(self.opening(now)))

    def take_up(self, stand: Standing) -> None:
        """Go on from there; it was just made on the same timeline."""
        self.ledger.newest = stand.newest
        self.lateness, self.limits = stand.lateness, stand.limits
        self.grips = (HandGoal(-inf, stand.opening),)
        for one in stand.known:
            self.ledger.note(one)
            if one.command is None and one.profile is not None:
                self.note_profile(one.receipt.command_id, one.profile)
        if stand.steered is not None and stand.steered[0] in self.ledger:
            self.go_on_steering(*stand.steered)


def _same_tool(one: Array | None, other: Array | None) -> bool:
    return one is other or (one is not None and other is not None and np.array_equal(one, other))


def _window(planned: Timeline, t: float, end: float) -> altering.Window:
    """What is planned from t to an end [s]; after all of it, of standing there."""
    index = planned.index_at(t)
    starts, rows, owners, now = [t], [], [], t
    while now < end:
        begin, a, owner, until = segment_at(planned, index)
        rows.append(shifted(a, t - begin) if now == t and t > begin > -inf else a)
        owners.append(owner)
        now = min(until, end)
        starts.append(now)
        index += 1
    filled = np.zeros((len(rows), max(len(a) for a in rows), planned.dof))
    for place, a in zip(filled, rows, strict=True):
        place[: len(a)] = a
    return altering.Window(np.array(starts), filled, owners)


def _rejoined(
    timeline: Timeline, planned: Timeline, t: float, pieces: list[Piece], s: float, rejoins: float
) -> Timeline:
    """A timeline until t, then pieces that last until s, then what is planned.

    Args:
        timeline: What stays until t [s].
        planned: What comes from s on.
        t: See above.
        pieces: See above.
        s: See above [s].
        rejoins: From here on the timeline is as it's planned, so that the two share it [s].
    """
    index = planned.index_at(s)
    while index < len(planned):
        begin, a, owner, end = segment_at(planned, index)
        if begin >= max(rejoins, s):
            middle = 0.5 * (begin + end)
            return timeline.edited(t, pieces, timeline.index_at(middle), begin)
        late = max(s - begin, 0.0)
        if end - begin - late > 0:
            pieces.append(Piece([end - begin - late], [shifted(a, late) if late > 0 else a], owner))
        index += 1
    return timeline.edited(t, pieces)


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


def _united(first: Receipt, second: Receipt, names: str) -> tuple[int, ...]:
    """Commands that either of two edits names, except the one that's edited."""
    both = (*getattr(first, names), *getattr(second, names))
    return tuple(dict.fromkeys(i for i in both if i != first.command_id))
