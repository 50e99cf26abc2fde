"""The edits of an engine's timeline, one by one, and as messages: who changed what, and a history in parts."""

from __future__ import annotations

import math
from collections import OrderedDict, deque
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby, islice
from typing import TYPE_CHECKING, Any

import msgspec

from interfaces.messages import Change, History, Order, Outcome, RefusalCode
from interfaces.messages.fields import MOST_NAMES
from interfaces.messages.requests import NAMED, CommandName, portable
from vrs.commands import Cancel, Command, Grip, InsertVia, Redo, Retime
from vrs.engine import Engine
from vrs.errors import InvalidValueError, UnknownCommandError, VrsError
from vrs.ledger import Receipt, Status
from vrs.segment import HOLD, Piece
from vrs.timeline import BaseTimeline, Timeline
from vrs.tree import Leaf

if TYPE_CHECKING:
    from interfaces.messages.recording import ChangeEntry

PART = 64
"""Segments of one message of a history: of six joints and a usual degree some 10 kB."""

MOST_CHANGED = 128
"""Segments of an edit that is sent as one; beyond that a history in parts is."""

AHEAD = 4
"""Parts of a history that are sent for one request."""

SAME = 1e-9
"""Times that differ by less [s] are the same."""

_Place = tuple[Leaf, int, float]
"""A segment's leaf, its index there, and the leaf's offset [s]."""


def parts(edit: int, timeline: Timeline, index: int) -> list[History]:
    """The next parts of a history from a segment on.

    Args:
        edit: Number that the history has.
        timeline: The history.
        index: First segment that's lacking.
    """
    first = max(index, 0)
    cuts = range(first, min(first + AHEAD * PART, len(timeline)), PART)
    return [History(edit, cut, segments=timeline.segments[cut : cut + PART]) for cut in cuts]


def difference(
    base: Timeline,
    new: Timeline,
    since: float,
    *,
    edit: int,
    command_id: int | None,
    name: CommandName | None = None,
) -> Change | None:
    """An edit as what it put in between what stays and what is shifted.

    Timelines share what an edit left as it was, so that a long plan costs little.

    Args:
        base: The timeline before the edit.
        new: The timeline after it.
        since: Nothing changed before this time [s].
        edit: Number of the edit.
        command_id: Who made it.
        name: What that command is called, where it's new.

    Returns:
        The message; None where the timeline begins elsewhere now.
    """
    if new.start != base.start:
        return None
    first = first_unlike(base, new, max(min(base.index_at(since), new.index_at(since)) - 1, 0))
    kept = _kept_tail(base, new, min(len(base), len(new)) - first)
    tail = len(base) - kept if kept else None
    last = len(new) - kept
    segments = new.segments[first:last]
    return Change(
        base=edit - 1,
        edit=edit,
        command_id=command_id,
        first=first,
        segments=segments,
        tail=tail,
        tail_start=new.start_of(last),
        end=new.end,
        name=name,
    )


def first_unlike(base: BaseTimeline[Any], new: BaseTimeline[Any], index: int) -> int:
    """The first segment from an index on in which two timelines differ: what they share is passed over at once."""
    most = min(len(base), len(new))
    while index < most:
        a, b = base._locate(index), new._locate(index)
        leaf, i, offset = a
        if leaf is b[0] and (i, offset) == b[1:]:
            index += leaf.count - i
        elif _alike(a, b):
            index += 1
        else:
            return index
    return most


def _kept_tail(base: Timeline, new: Timeline, most: int) -> int:
    """How many segments at their ends two timelines have in common, but for one shift; `most` at most."""
    kept = 0
    while kept < most:
        a, b = base._locate(len(base) - 1 - kept), new._locate(len(new) - 1 - kept)
        if not _alike(a, b):
            return kept
        kept += a[1] + 1 if a[0] is b[0] and a[1] == b[1] else 1
    return most


def _alike(a: _Place, b: _Place) -> bool:
    """Whether two segments are the same, wherever they start: there are no gaps between segments."""
    (leaf_a, i, _), (leaf_b, k, _) = a, b
    return (
        leaf_a.durations[i] == leaf_b.durations[k]
        and leaf_a.owners[i] == leaf_b.owners[k]
        and leaf_a.rows[i] == leaf_b.rows[k]
    )


def changed(base: Timeline, message: Change | ChangeEntry) -> Timeline:
    """The timeline that a change makes of its base.

    Raises:
        InvalidValueError: If it doesn't fit.
    """
    if not 0 <= message.first <= len(base) or (message.tail is not None and not 0 <= message.tail <= len(base)):
        raise InvalidValueError("change", message, f"for a timeline of {len(base)} segments")
    pieces = []
    for owner, run in groupby(message.segments, key=lambda segment: segment.command_id):
        segments = tuple(run)
        durations = [segment.duration for segment in segments]
        pieces.append(Piece(durations, [segment.coefficients for segment in segments], owner or HOLD))
    cut = base.start_of(message.first)
    result = base.edited(cut, pieces, message.tail, message.tail_start)
    if abs(result.end - message.end) > SAME * max(1.0, abs(message.end)):
        raise InvalidValueError("change", message.end, f"one that ends at {result.end} s")
    return result


KEPT = 256
"""Edits that are kept. Timelines share what they have in common."""

HISTORIES = 64
"""Parts of histories that are kept for whoever asks for the same."""


@dataclass(frozen=True, eq=False)
class TimelineEdit:
    """A timeline, and what made it of the one before."""

    number: int
    """Counts edits, from 1."""
    before: Timeline
    timeline: Timeline
    command_id: int | None
    """The command that made it; None where the journal didn't see that."""
    at: float
    """Nothing changed before this time [s]: the engine's when its timeline was still the one before; −∞ offline."""
    others: tuple[tuple[float, int], ...] = ()
    """Commands that came meanwhile and begin at these times [s], where the journal saw only what they made."""
    name: CommandName | None = None
    """What the command is called, where that's new."""

    @cached_property
    def change(self) -> Change | None:
        """The edit as a message; None where the timeline begins elsewhere now."""
        return difference(
            self.before, self.timeline, self.at, edit=self.number, command_id=self.command_id, name=self.name
        )

    def culprit(self, t: float) -> int | None:
        """The command by which this edit changed what happens at t [s].

        Where several commands made it that the journal didn't see, the first of them that begins by then.
        """
        if self.command_id is not None:
            return self.command_id
        begun = [command_id for start, command_id in self.others if start <= t]
        if begun:
            return begun[0]
        index = self.timeline.index_at(t)
        owner = self.timeline.owner_of(index) if 0 <= index < len(self.timeline) else 0
        return owner or None


def _name_of(order: Order, t: float) -> CommandName | None:
    """What an order's command is called from a time [s] on; None where it edits another, which keeps its name."""
    if order.command is None or isinstance(order.command, Retime | Cancel | InsertVia | Redo):
        return None
    return CommandName.of(order.command, order.label, 0, t)


class Journal:
    """The newest edits of one engine.

    What goes through `execute` is written down exactly, when somebody looks or before the next command. What others
    do to the engine is found then, as one edit for all that was done since.
    """

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self._timeline = engine.timeline
        ids = (receipt.command_id for receipt in engine.receipts)
        owners = self._timeline.owners(0, len(self._timeline))
        self._newest = max((*ids, *owners), default=0)
        self.edits: deque[TimelineEdit] = deque(maxlen=KEPT)
        self._parts: OrderedDict[tuple[int, int], list[History]] = OrderedDict()
        self.names: deque[CommandName] = deque(maxlen=NAMED)
        """What the newest commands are called that came as orders, oldest first."""
        self._named: CommandName | None = None
        """The newest of them where it was given since `look`."""
        self._done: Receipt | None = None
        """What `execute` did since `look`."""
        self._seen = self.past
        """The engine's time at the newest `look` [s]: nothing changed before it since."""
        self.number = 0
        """Number of the newest edit; 0 before the first."""

    @property
    def past(self) -> float:
        """What lies before this time doesn't change any more [s]: the present; −∞ for an offline engine."""
        return -math.inf if self.engine.clock is None else self.engine.now()

    @property
    def is_current(self) -> bool:
        """Whether this is what the engine does now: of one elsewhere, whether it's heard."""
        return True

    def execute(self, command: Command | None) -> Receipt | None:
        """Let the engine carry out a command, or take back its newest where it's None.

        Returns:
            The receipt; None where there is none.

        Raises:
            VrsError: As `Engine.execute`.
        """
        self.look()
        result = self.engine.undo() if command is None else self.engine.execute(command)
        # It's done: from here on nothing may raise.
        self._done = result if isinstance(result, Receipt) else None
        return self._done

    def carry_out(self, order: Order, *, now: float) -> Outcome:
        """Let the engine carry out a client's order, see `interfaces.engine_server.servlet.Commander`."""
        engine = self.engine
        try:
            why = engine.undo_refusal() if order.command is None else ""
            name = _name_of(order, engine.now())
            receipt = self.execute(order.command)
        except VrsError as error:
            return Outcome(order.number, now, None, str(error))
        if name is not None and receipt is not None and receipt.status is not Status.REJECTED:
            last = self.names[-1] if self.names else None
            if last is None or (last.command_id, last.label) != (receipt.command_id, name.label):
                # The hand does at its time what it's told now; motion is another one from now on.
                begin = receipt.execute_at if isinstance(order.command, Grip) else None
                t = name.t if begin is None else begin
                self._named = msgspec.structs.replace(name, command_id=receipt.command_id, t=t)
                self.names.append(self._named)
        if receipt is None:
            return Outcome(order.number, now, None, why)
        known = engine.refusal(receipt.command_id) if receipt.status is Status.REJECTED else None
        code = known if isinstance(known, RefusalCode) else RefusalCode.OTHER
        try:
            receipt = portable(receipt, MOST_NAMES)
        except Exception:  # noqa: BLE001 - the command is carried out, whatever keeps the others from being named
            receipt = msgspec.structs.replace(receipt, shifted_names=(), superseded_names=())
        return Outcome(order.number, now, receipt, code=code)

    def look(self) -> int:
        """Write down what was done to the engine, here or by others; the number of the newest edit."""
        done, timeline = self._done, self.engine.timeline
        if done is not None and timeline.version == done.version:
            # What moves no joint has a name that's told, too: a grip.
            if timeline is not self._timeline or self._named is not None:
                self._write(timeline, done.command_id, ())
            self._newest = max(self._newest, done.command_id)
        elif timeline is not self._timeline:
            begun, newest = [], self._newest
            while True:
                try:
                    receipt = self.engine.receipt(newest + 1)
                except UnknownCommandError:
                    break
                newest += 1
                if receipt.status is not Status.REJECTED and receipt.execute_at is not None:
                    begun.append((receipt.execute_at, receipt.command_id))
            alone = timeline.version == self._timeline.version + 1 and len(begun) == 1
            self._write(timeline, begun[0][1] if alone else None, () if alone else tuple(begun))
            self._newest = newest
        self._done, self._named, self._seen = None, None, self.past
        return self.number

    def _write(self, timeline: Timeline, command_id: int | None, others: tuple[tuple[float, int], ...]) -> None:
        number, name = self.number + 1, self._named
        edit = TimelineEdit(number, self._timeline, timeline, command_id, self._seen, others, name)
        self.edits.append(edit)
        self._timeline, self.number = timeline, edit.number

    def parts(self, edit: int, timeline: Timeline, index: int) -> list[History]:
        """The next parts of a history from a segment on; made once for all who ask, the newest ones.

        Args:
            edit: Number that the history has.
            timeline: The history.
            index: First segment that's lacking.
        """
        key = edit, index
        found = self._parts.get(key)
        if found is None:
            found = self._parts[key] = parts(edit, timeline, index)
            if len(self._parts) > HISTORIES:
                self._parts.popitem(last=False)
        return found

    def since(self, number: int) -> tuple[TimelineEdit, ...]:
        """The edits after one, oldest first; where they aren't all kept, the newest alone, by nobody known."""
        missing = self.look() - number
        if missing > len(self.edits):
            return (replace(self.edits[-1], command_id=None, others=()),)
        return tuple(islice(self.edits, len(self.edits) - missing, None)) if missing > 0 else ()
