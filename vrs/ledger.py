"""Receipts of commands, and the ledger of what later edits made of them.

An edit in the middle of a long plan moves or drops thousands of commands. Writing that into each receipt would
take longer than planning, so an edit leaves one `Change` behind, and a receipt is worked out when it's asked for.

With the commands they are what an engine knows besides its timeline, so that another one can go on from there.
"""

from __future__ import annotations

import enum
from bisect import bisect_left, insort
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np
from msgspec import field
from msgspec.structs import replace

from vrs.commands import Lateness, MotionCommand, Profile
from vrs.errors import UnknownCommandError
from vrs.model import Array, Limits
from vrs.notes import Note, NoteCode, Notes, text_of
from vrs.record import Count, Number, Record, Text, Time, Value
from vrs.timeline import BaseTimeline

if TYPE_CHECKING:
    Names: TypeAlias = tuple[int, ...] | Callable[[], tuple[int, ...]]
else:
    Names = tuple[Number, ...]
"""Command ids, or what finds them when somebody asks: naming a long tail takes time that a command hasn't got.

Only those that were found can be written.
"""


class Status(enum.StrEnum):
    """Outcome of a command."""

    ACCEPTED = "accepted"
    POSTPONED = "postponed"
    REJECTED = "rejected"


class Receipt(Record, frozen=True, omit_defaults=True, gc=False, eq=False):
    """What became of a command; it belongs to one version of the timeline."""

    command_id: Count
    """Names the command from now on, from 1; rejected commands have an id, too."""
    status: Status
    issued_at: Time | None = None
    """Issue time [s]; None where none was given to an offline engine."""
    asked_at: Time | None = None
    """Execution time that was asked for [s]; None where none was."""
    execute_at: Time | None = None
    """Start of the motion [s]; None when rejected."""
    end: Time | None = None
    """Arrival [s]; None when rejected."""
    q: Array | None = None
    """Joints of the target [rad], (n,), poses resolved; None when rejected, or where there's no target."""
    reason: Text = ""
    """Why it was postponed or rejected, or what else the user must know."""
    version: Count = 0
    """Version of the timeline that the command made, or left when rejected."""
    shift: Value = field(default_factory=float)
    """Δ by which the commands in `shifted` were shifted [s]."""
    superseded_by: Count | None = None
    """Id of the later command that cut this one short or dropped it, 0 for a correction; None while it stands."""
    undone: bool = False
    """Whether it was taken back or cancelled."""
    shifted_names: Names = field(default=(), name="shifted")
    """Ids of commands whose moves now come at another time."""
    superseded_names: Names = field(default=(), name="superseded")
    """Ids of commands that won't arrive any more, wholly or in part."""
    hindrance: Text = ""
    """Of a steering input that's accepted: what keeps the arm from going as asked, and what leads away from it.

    That's a singularity or a joint's limit. Of an offset: that the limits don't let it be reached in time.
    """

    @property
    def shifted(self) -> tuple[int, ...]:
        """`shifted_names`, found."""
        return self.shifted_names if isinstance(self.shifted_names, tuple) else self.shifted_names()

    @property
    def superseded(self) -> tuple[int, ...]:
        """`superseded_names`, found."""
        return self.superseded_names if isinstance(self.superseded_names, tuple) else self.superseded_names()

    def named(self, most: int | None = None) -> Receipt:
        """The same receipt with its names found, the first `most` of each kind."""
        shifted, superseded = self.shifted[:most], self.superseded[:most]
        if shifted is self.shifted_names and superseded is self.superseded_names:
            return self
        return replace(self, shifted_names=shifted, superseded_names=superseded)

    @property
    def is_still(self) -> bool:
        """Whether the command's target is where the arm stood anyway: it has no segments."""
        return self.q is not None and self.end == self.execute_at

    @property
    def stands(self) -> bool:
        """Whether the command is to be carried out as the receipt says, or was."""
        return self.end is not None and self.superseded_by is None and not self.undone


UNDO_DEPTH = 1000
"""Commands that can be taken back, one after the other; each keeps a timeline alive."""

ARRIVED = 1e-9
"""A command that's this near to its end [s] has arrived: ends are sums of durations, and rounded."""

_TimelineT = TypeVar("_TimelineT", bound=BaseTimeline[Any])

TimeMap: TypeAlias = Callable[[float], float]
"""New time of what was scheduled at a time."""


class LedgerEntry(NamedTuple):
    """What a ledger knows of a command."""

    receipt: Receipt
    command: MotionCommand | None = None
    """The motion command that it answers; None where it was something else."""
    notes: Notes = ()
    """What its reason is the text of; empty where it was rejected."""
    refusal: enum.Enum | None = None
    """Why somebody outside the engine refused it; None where nobody did, or no code was given."""
    profile: Profile | None = None
    """By which profile it moves the arm, where an engine that goes on elsewhere must be told; else None."""


class Change(NamedTuple):
    """What an edit did to commands other than its own."""

    version: int
    """Version of the timeline that the edit made."""
    by: int
    """Command that did it."""
    at: float
    """Commands that arrived before this time [s] aren't touched."""
    dropped: frozenset[int] | None = frozenset()
    """Commands cut short or dropped; None for all of them."""
    moved: TimeMap | None = None
    """New times of the others; None where they stay."""
    since: float = -inf
    """Commands that begin before this time [s] are dropped too."""
    stills: bool = True
    """Whether commands to where the arm stood anyway are dropped too: they have no segments that could be kept."""


class Undo(NamedTuple, Generic[_TimelineT]):
    """What is needed to take an edit back."""

    command_id: int
    at: float
    """Nothing before this time was edited [s]."""
    before: _TimelineT
    changes: tuple[int, tuple[Change, ...]]
    """Where in the log it wrote, and what stood there."""
    overwritten: dict[int, LedgerEntry | None]
    """Entries as they were; None for what wasn't there."""
    stills: tuple[tuple[int, tuple[tuple[float, int], ...]], ...]
    """Where in the list of stills it changed something, and what stood there; put back one after the other."""


class Ledger(Generic[_TimelineT]):
    """Receipts by command id, as later edits left them."""

    def __init__(self, newest: int) -> None:
        self.newest = newest
        """Highest id given out."""
        self.entries: dict[int, LedgerEntry] = {}
        """By command id, in the order of the commands."""
        self._restore: list[Callable[[], object]] | None = None
        """Puts back, last first, what was written over since `atomic` began; None outside."""
        self.changes: list[Change] = []
        """What each edit changed of the commands before it, in order."""
        self.versions: list[int] = []
        """Of the timeline, one a change, ascending."""
        self.stills: list[tuple[float, int]] = []
        """Holds: when each ended [s], and its command's id."""
        self.undo_steps: deque[Undo[_TimelineT]] = deque(maxlen=UNDO_DEPTH)
        """What takes the last edits back, the newest last."""
        self.redo_steps: list[tuple[Undo[_TimelineT], Undo[_TimelineT]]] = []
        """What was taken back, and what brings that back, the newest last."""
        self.redo_version = 0
        """Version of the timeline to which they belong: any edit makes it the past."""
        self.settled = ""
        """Why edits before the newest ones can't be taken back any more; empty where all can."""

    @contextmanager
    def atomic(self) -> Iterator[None]:
        """Put everything back as it was, if what is done meanwhile raises."""
        if self._restore is not None:
            yield
            return
        saved = self.newest, self.stills[:], self.undo_steps.copy(), self.settled
        redo = self.redo_steps[:], self.redo_version
        self._restore = []
        try:
            yield
        except BaseException:
            self.newest, self.stills, self.undo_steps, self.settled = saved
            self.redo_steps, self.redo_version = redo
            while self._restore:
                self._restore.pop()()
            raise
        finally:
            self._restore = None

    def _set(self, entry: LedgerEntry) -> LedgerEntry | None:
        """Write an entry down; what it writes over."""
        command_id = entry.receipt.command_id
        old = self.entries.get(command_id)
        if self._restore is not None:
            absent = partial(self.entries.pop, command_id, None)
            self._restore.append(absent if old is None else partial(self.entries.update, {command_id: old}))
        self.entries[command_id] = entry
        return old

    def __contains__(self, command_id: object) -> bool:
        return command_id in self.entries

    def receipt(self, command_id: int, *, before: float = inf) -> Receipt:
        """The current truth of a command, or what it was before a version of the timeline.

        Raises:
            UnknownCommandError: If there's no receipt of that id.
        """
        try:
            receipt = self.entries[command_id].receipt
        except (KeyError, TypeError):
            raise UnknownCommandError(command_id, self.newest) from None
        for change in self.changes[bisect_left(self.versions, receipt.version + 1) :]:
            if not receipt.stands or change.version >= before:
                break
            receipt = _after(receipt, change)
        return receipt

    def arrived(self, command_id: int, t: float, version: float = inf) -> bool:
        """Whether a command was at its target, or was to be when it was cut short, at t or before.

        Args:
            command_id: The command.
            t: A time [s].
            version: As it was before this version of the timeline; as it's now, by default.
        """
        entry = self.entries.get(command_id)
        if entry is None:
            return False
        receipt = entry.receipt
        start, end = receipt.execute_at, receipt.end
        if start is None or end is None:
            return True
        if not self.versions or self.versions[-1] <= receipt.version:
            return end <= t + ARRIVED
        for change in self.changes[bisect_left(self.versions, receipt.version + 1) :]:
            if change.version >= version:
                break
            if end <= change.at + ARRIVED:
                end = min(end, change.at)
                continue
            if change.dropped is None or command_id in change.dropped or start < change.since:
                break
            if change.moved is not None:
                start, end = change.moved(start), change.moved(end)
        return end <= t + ARRIVED

    def command(self, command_id: int) -> MotionCommand | None:
        """The motion command of an id; None where it was something else or isn't known."""
        entry = self.entries.get(command_id)
        return None if entry is None else entry.command

    def notes(self, command_id: int) -> Notes:
        """What a user must know of a command; empty where there's nothing, or no receipt of that id."""
        entry = self.entries.get(command_id)
        return () if entry is None else entry.notes

    def all(self) -> tuple[Receipt, ...]:
        """Every receipt, in the order of the ids."""
        receipts = [entry.receipt for entry in self.entries.values()]
        if not self.changes:
            return tuple(receipts)
        # One pass over the changes with all receipts at once: plans and logs may both be long.
        end = np.array([np.nan if not r.stands or r.end is None else r.end for r in receipts])
        version = np.array([r.version for r in receipts])
        for change in self.changes:
            for i in np.flatnonzero((end >= change.at) & (version < change.version)).tolist():
                receipts[i] = _after(receipts[i], change)
                now = receipts[i].end
                end[i] = now if receipts[i].stands and now is not None else np.nan
        return tuple(receipts)

    def stills_from(self, t: float) -> tuple[int, ...]:
        """Commands from a time [s] on to where the arm stands anyway: no segment is theirs."""
        return tuple(command_id for _, command_id in self.stills[bisect_left(self.stills, (t, 0)) :])

    def note(self, entry: LedgerEntry) -> None:
        """Write down a command of another ledger, which can't be taken back here."""
        self._write((entry,))

    def reject(
        self,
        issued: float | None,
        asked: float | None,
        reason: str,
        version: int,
        refusal: enum.Enum | None = None,
    ) -> Receipt:
        """Give out a receipt for a command that can't be."""
        self.newest += 1
        receipt = Receipt(self.newest, Status.REJECTED, issued, asked, reason=reason, version=version)
        self._set(LedgerEntry(receipt, refusal=refusal))
        return receipt

    def accept(
        self,
        entry: LedgerEntry,
        before: _TimelineT,
        change: Change | None,
        others: Collection[LedgerEntry] = (),
    ) -> Receipt:
        """Write down an accepted edit.

        Args:
            entry: Its receipt is of a new id or of one that's written over.
            before: The timeline before it.
            change: What it did to other commands; None for nothing.
            others: Other commands that were planned anew.

        Returns:
            The receipt; commands to where the arm stood anyway are added to what it superseded.
        """
        receipt = entry.receipt
        at = change.at if change is not None else receipt.execute_at or before.end
        first = bisect_left(self.stills, (at, 0))
        later = tuple(self.stills[first:])
        if change is not None and later:
            if change.stills:
                again = {other.receipt.command_id for other in others}
                dropped = (*receipt.superseded, *(i for _, i in later if i not in again))
                receipt = replace(receipt, superseded_names=dropped)
                entry = entry._replace(receipt=receipt)
                del self.stills[first:]
            elif change.moved is not None:
                self.stills[first:] = [(change.moved(t), i) for t, i in later]
        overwritten = self._write((*others, entry))
        log, stills = (len(self.changes), ()), ((first, later),)
        self.undo_steps.append(Undo(receipt.command_id, at, before, log, overwritten, stills))
        if change is not None:
            self._write_log(len(self.changes), (change,))
        self.newest = max(self.newest, receipt.command_id)
        return receipt

    def reinstate(
        self, entry: LedgerEntry, before: _TimelineT, change: Change, others: Iterable[LedgerEntry] = ()
    ) -> Receipt:
        """Write down an edit that brings back what the newest one dropped.

        Args:
            entry: What is known of it.
            before: The timeline before it.
            change: Where the commands that come back are now; it takes the place of the change that dropped them.
                Commands to where the arm stood anyway don't come back.
            others: Commands that were planned anew.
        """
        stop = self.undo_steps[-1]
        index, _ = stop.changes
        log = tuple(self.changes[index:])
        self._write_log(index, (change,))
        stills = tuple(i for _, there in stop.stills for _, i in there)
        receipt = entry.receipt
        if stills:
            receipt = replace(receipt, superseded_names=(*receipt.superseded, *stills))
            entry = entry._replace(receipt=receipt)
        # The stop itself isn't moved.
        stopped = self.entries[stop.command_id]
        stopped = stopped._replace(receipt=replace(stopped.receipt, version=change.version))
        overwritten = self._write((*others, stopped, entry))
        at = receipt.execute_at or change.at
        self.undo_steps.append(Undo(receipt.command_id, at, before, (index, log), overwritten, ()))
        self.newest = max(self.newest, receipt.command_id)
        return receipt

    def _note_still(self, receipt: Receipt) -> None:
        if receipt.is_still and receipt.stands and receipt.end is not None:
            insort(self.stills, (receipt.end, receipt.command_id))

    def _write(self, entries: Iterable[LedgerEntry]) -> dict[int, LedgerEntry | None]:
        """Write entries down, and return what they write over."""
        overwritten = {}
        for entry in entries:
            overwritten[entry.receipt.command_id] = self._set(entry)
            self._note_still(entry.receipt)
        return overwritten

    def _write_log(self, index: int, changes: tuple[Change, ...]) -> None:
        """Let the log go on with these changes from an index on."""
        if self._restore is not None:
            for log in (self.changes, self.versions):
                self._restore.append(partial(log.__setitem__, slice(index, None), log[index:]))
        self.changes[index:] = changes
        self.versions[index:] = [change.version for change in changes]

    def rewrite(self, receipt: Receipt, notes: Notes | None = None) -> None:
        """Write over a receipt of a command that goes on, and its notes unless they're None, without a way back."""
        old, command, known, *_ = self.entries[receipt.command_id]
        if old.is_still and old.end is not None and (old.end, old.command_id) in self.stills:
            self.stills.remove((old.end, old.command_id))
        self._set(LedgerEntry(receipt, command, known if notes is None else notes))
        self._note_still(receipt)

    @property
    def last(self) -> Undo[_TimelineT] | None:
        """The newest edit that can be taken back."""
        return self.undo_steps[-1] if self.undo_steps else None

    def take_back(self, version: int, taken: _TimelineT | None = None) -> Receipt:
        """Forget the newest edit; its own command's receipt says that it's undone.

        Args:
            version: Version of the timeline that the undoing makes.
            taken: The timeline before that, to be redone; None where it can't be.
        """
        undo = self.undo_steps.pop()
        mine, command = self.receipt(undo.command_id), self.command(undo.command_id)
        back = self._put_back(undo)
        if taken is not None:
            if self.redo_version != taken.version:
                self.redo_steps.clear()
            self.redo_steps.append((undo, back._replace(before=taken)))
            self.redo_version = version
        if undo.overwritten[undo.command_id] is not None:
            return self.receipt(undo.command_id)
        notes = (Note(NoteCode.UNDONE),)
        mine = replace(mine, reason=text_of(notes), version=version, undone=True)
        self._set(LedgerEntry(mine, command, notes))
        return mine

    def undone(self, version: int) -> Undo[_TimelineT] | None:
        """What brings back the newest edit that was taken back; None where there's none, or a later edit.

        Args:
            version: Of the timeline as it is.
        """
        return self.redo_steps[-1][1] if self.redo_steps and self.redo_version == version else None

    def bring_back(self, version: int) -> Receipt:
        """Write down again what `undone` gave.

        Args:
            version: Version of the timeline that this makes.
        """
        undo, back = self.redo_steps.pop()
        self._put_back(back)
        self.undo_steps.append(undo)
        self.redo_version = version
        return self.receipt(undo.command_id)

    def _put_back(self, step: Undo[_TimelineT]) -> Undo[_TimelineT]:
        """Let entries, log and stills be again what they were; what leads from there to what they are now."""
        index, changes = step.changes
        known: dict[int, LedgerEntry | None] = {i: self.entries[i] for i in step.overwritten}
        log, stills = (index, tuple(self.changes[index:])), []
        self._write_log(index, changes)
        for first, there in step.stills:
            stills.append((first, tuple(self.stills[first:])))
            self.stills[first:] = there
        for entry in step.overwritten.values():
            if entry is not None:
                self._set(entry)
        return step._replace(changes=log, overwritten=known, stills=tuple(reversed(stills)))

    def fuse(self) -> None:
        """Make the newest two edits one, to be taken back together."""
        second, first = self.undo_steps.pop(), self.undo_steps.pop()
        self.undo_steps.append(
            first._replace(
                at=min(first.at, second.at),
                overwritten={**second.overwritten, **first.overwritten},
                stills=(*second.stills, *first.stills),
            )
        )

    def rebase(self, change: Change, times: dict[int, tuple[float, float]]) -> None:
        """Write down that the plan is another one from `change.at` on; what came before can't be taken back.

        Args:
            change: What it does to commands that aren't in the new plan.
            times: Start and end [s], in the new plan, of commands that are.
        """
        for command_id, (start, end) in times.items():
            if command_id in self:
                receipt, entry = self.receipt(command_id), self.entries[command_id]
                now = replace(receipt, execute_at=start, end=end, version=change.version)
                self._set(entry._replace(receipt=replace(now, superseded_by=None, undone=False)))
        self._settle(
            change,
            f"the plan was put right at {change.at:.6g} s, since the real robot was going elsewhere: what was "
            "commanded before can't be taken back",
        )

    def break_off(self, change: Change, notes: Notes) -> Receipt:
        """Write down that the newest edit is taken back from `change.at` on, and all that was scheduled with it.

        Args:
            change: What that does to other commands.
            notes: What the user must know of it besides.
        """
        undo = self.undo_steps[-1]
        # What came before it can't be taken back any more: its timeline has another past.
        self._settle(
            change,
            f"command {undo.command_id} was under way when it was taken back, at {change.at:.6g} s: what was "
            "commanded before it can't be taken back",
        )
        notes = (Note(NoteCode.UNDONE_FROM, (change.at,)), *notes)
        mine = replace(self.receipt(undo.command_id), reason=text_of(notes), version=change.version, undone=True)
        self._set(LedgerEntry(mine, self.command(undo.command_id), notes))
        return mine

    def _settle(self, change: Change, why: str) -> None:
        """Write a change down, behind which nothing can be taken back, and why."""
        self._write_log(len(self.changes), (change,))
        self.undo_steps.clear()
        self.redo_steps.clear()
        self.settled = why
        del self.stills[bisect_left(self.stills, (change.at, 0)) :]


def _after(receipt: Receipt, change: Change) -> Receipt:
    """A standing receipt after one more edit."""
    start, end = receipt.execute_at, receipt.end
    if start is None or end is None:
        return receipt
    still = receipt.is_still
    if end < change.at if still else end <= change.at + ARRIVED:
        # It was cut by so little that it has arrived; a later change of pace mustn't part end and cut.
        return receipt if still or end <= change.at else replace(receipt, end=change.at)
    gone = change.dropped is None or receipt.command_id in change.dropped or start < change.since
    if gone or (still and change.stills):
        return replace(receipt, superseded_by=change.by, version=change.version)
    if change.moved is None:
        return receipt
    start, end = change.moved(start), change.moved(end)
    return replace(receipt, execute_at=start, end=end, version=change.version)


MOST_KNOWN = 2000
"""Commands that an engine's standing holds, at most: the first ones to come."""


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """What the next commands of an engine depend on, besides its timeline.

    What could be taken back, and what a stop interrupted, is no part of it: an undo or a resume of what was before
    finds nothing.
    """

    newest: int
    """Highest command id given out, ≥ 0."""
    lateness: Lateness
    limits: Limits
    """In force."""
    steered: tuple[int, float] | None = None
    """The command that the next steering input goes on with, and when that began [s]."""
    known: tuple[LedgerEntry, ...] = ()
    opening: float = inf
    """What the hand is told [m]; infinity: as far open as it goes."""
