"""The agenda: one track that is planned, its receipts, and the causality of edits. It's given the time.

What moves the robot, and how it brakes, is for its kinds to say: `vrs.scheduler` for arms, `vrs.mobile.driver` for
mobile robots.

Source: Doulgeri, Zikos, Delopoulos, section II-B.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from operator import add
from typing import Any, Generic, NamedTuple, TypeVar

from vrs.commands import DriveCommand, Lateness, MotionCommand, PlanEdit, SteerCommand, Stop
from vrs.errors import PlanningError
from vrs.insertion import Edit
from vrs.ledger import ARRIVED, Change, Entry, Ledger, Names, Receipt, Status
from vrs.segment import HOLD
from vrs.track import Track

TrackT = TypeVar("TrackT", bound=Track[Any])

_NAMED_AT_ONCE = 64
"""Segments whose commands are named at once; those of longer runs when somebody asks."""


class Moment(NamedTuple):
    """When an edit acts, and what its receipt says of that."""

    t: float
    issued: float | None
    asked: float | None
    status: Status
    reason: str


class Agenda(Generic[TrackT]):
    """A track, the policy for late commands, and a ledger of receipts."""

    def __init__(self, timeline: TrackT, ledger: Ledger[TrackT], lateness: Lateness) -> None:
        self.timeline = timeline
        self.ledger = ledger
        self.lateness = lateness

    @contextmanager
    def atomic(self) -> Iterator[None]:
        """Put everything back as it was, receipts too, if what is done meanwhile raises."""
        saved = vars(self).copy()
        try:
            with self.ledger.atomic():
                yield
        except BaseException:
            vars(self).update(saved)
            raise

    def brake(self, t: float, command_id: int) -> tuple[TrackT, str]:
        """What is scheduled, with the robot braking from t [s] on for a command; and what must be said of it."""
        raise NotImplementedError

    def moment(self, command: PlanEdit | SteerCommand, now: float | None, soonest: float) -> Moment:
        """When an edit acts: as asked, else as soon as it can; a late one at once or, by the other policy, not.

        Args:
            command: The edit.
            now: Present time [s]; None offline.
            soonest: As soon as it can, offline [s].

        Raises:
            PlanningError: If it's late and the policy rejects, or if it was to act before it was issued.
        """
        asked = _as_asked(command, now, soonest if now is None else now)
        if now is None or asked.t >= now:
            return asked
        late = _passed(asked.t, now)
        if self.lateness is Lateness.REJECT and not isinstance(command, Stop):
            raise PlanningError(late)
        return asked._replace(t=now, status=Status.POSTPONED, reason=f"{late}: at once")

    def beginning(self, command: MotionCommand | DriveCommand, now: float | None, soonest: float) -> Moment:
        """When a motion begins: as asked, else as soon as it can; a late one after the segment that is under way.

        By the other policy a late one doesn't begin at all.

        Args:
            command: The motion.
            now: Present time [s]; None offline.
            soonest: As soon as it can, offline [s]; with a clock not before now, nor before it was issued.

        Raises:
            PlanningError: If it's late and the policy rejects, or if it was to begin before it was issued.
        """
        asked = _as_asked(command, now, soonest)
        if now is None or asked.t >= now:
            return asked
        late = _passed(asked.t, now)
        if self.lateness is Lateness.REJECT:
            raise PlanningError(late)
        t = self.end_of_active(now)
        return asked._replace(t=t, status=Status.POSTPONED, reason=f"{late}: postponed to {t:.9g} s")

    def touched(self, edit: Edit[TrackT], t: float) -> tuple[Names, Names]:
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
        receipt: Receipt,
        command: MotionCommand | None,
        edit: Edit[TrackT],
        at: float,
        *,
        appended: bool = False,
        others: tuple[Entry, ...] = (),
    ) -> Receipt:
        """Put an edit in force, and write its receipt down.

        Args:
            receipt: Of the command that made the edit.
            command: That command, where it's a motion.
            edit: What it did.
            at: Earliest time that the edit changed [s].
            appended: Whether all that was scheduled stays.
            others: Receipts and commands of other moves that were planned anew.
        """
        before, self.timeline = self.timeline, edit.timeline
        change = None
        if not appended:
            dropped = None if edit.dropped is None else frozenset(edit.dropped)
            moved = partial(add, edit.shift) if edit.shift > 0 else None
            change = Change(edit.timeline.version, receipt.command_id, at, dropped, moved)
        return self.ledger.accept(receipt, command, before, change, others)

    def named(self, timeline: TrackT, index: int, t: float) -> Names:
        """Commands that arrive after t and have segments from an index on."""
        # Joining moves may stand there first whose commands have arrived.
        if len(timeline) - index > _NAMED_AT_ONCE:
            return partial(_names, self.ledger, timeline, index, t)
        return tuple(i for i in timeline.owners(index, len(timeline)) if not self.ledger.arrived(i, t))

    def reject(self, issued: float | None, asked: float | None, reason: str) -> Receipt:
        """Answer a command that can't be."""
        return self.ledger.reject(issued, asked, reason, self.timeline.version)

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
            self.timeline = last.before.with_version(version)
            return self.ledger.take_back(version)
        if now >= self.timeline.end:
            return None
        self.timeline, note = self.brake(now, last.command_id)
        return self.ledger.break_off(Change(version, last.command_id, now, None), note)

    def undo_refusal(self, now: float | None) -> str:
        """Why there's nothing to take back; see `vrs.engine.Engine.undo_refusal`."""
        last = self.ledger.last
        if last is None:
            return self.ledger.settled
        if now is None or now <= last.at or now < self.timeline.end:
            return ""
        return f"command {last.command_id} is over: what has happened can't be taken back"


def _names(ledger: Ledger[Any], timeline: Track[Any], index: int, t: float) -> tuple[int, ...]:
    """Commands that have segments from an index on, and hadn't arrived at t when the timeline was edited."""
    return tuple(i for i in timeline.owners(index, len(timeline)) if not ledger.arrived(i, t, timeline.version + 1))


def _as_asked(
    command: MotionCommand | DriveCommand | SteerCommand | PlanEdit, now: float | None, soonest: float
) -> Moment:
    """When a command is to act, be that late or not.

    Args:
        command: The command.
        now: Present time [s]; None offline.
        soonest: When, if it doesn't say so [s]; with a clock not before now, nor before it was issued.

    Raises:
        PlanningError: If it was to act before it was issued.
    """
    issued, asked = command.issued_at, command.execute_at
    if now is None:
        return Moment(soonest if asked is None else asked, issued, asked, Status.ACCEPTED, "")
    issued = now if issued is None else issued
    t = max(soonest, now, issued) if asked is None else asked
    if t < issued:
        raise PlanningError(f"t_exec = {t:.9g} s lies before t_iss = {issued:.9g} s")
    return Moment(t, issued, asked, Status.ACCEPTED, "")


def _passed(t: float, now: float) -> str:
    """Say that a command is late."""
    return f"t_exec = {t:.9g} s had passed at {now:.9g} s"
