"""A timeline's edits as they were recorded, whole or as changes, of polynomials and of arcs."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from interfaces.engine_server.journal import SAME, changed, difference, first_unlike
from interfaces.messages.recording import ArcChange, ArcHistory, ChangeEntry, HistoryEntry, following
from vrs.clock import ManualClock
from vrs.engine import Engine, MobileEngine
from vrs.errors import FormatError, InvalidValueError
from vrs.mobile import ArcPiece, ArcTimeline, wrapped
from vrs.model import Array
from vrs.segment import HOLD
from vrs.timeline import Timeline

PART = 256
"""Segments of one message of a history."""
MOST_CHANGED = 2048
"""Segments of an edit that's written as one; beyond that the whole timeline is, in parts."""
OFF = 1e-6
"""By how much a posture may differ from where the arcs before it lead [m, rad]."""

AnyChange: TypeAlias = ChangeEntry | ArcChange
AnyEdit: TypeAlias = HistoryEntry | AnyChange
AnyTimeline: TypeAlias = Timeline | ArcTimeline


def edit_entries(
    before: AnyTimeline, after: AnyTimeline, edit: int, at: float, command_id: int | None, *, cut: int = 0
) -> tuple[AnyEdit, ...]:
    """An edit as it stands in a recording.

    Args:
        before: The timeline before it.
        after: The timeline after it.
        edit: Its number, from 1.
        at: The engine's time [s]: nothing changed before that.
        command_id: Who made it, if a command did.
        cut: First segment that the recording has; edits lie after it.
    """
    entry: AnyChange | None
    if isinstance(before, ArcTimeline):
        assert isinstance(after, ArcTimeline)
        entry = _arc_change(before, after, edit, at, command_id)
    else:
        entry = _change(before, arm_timeline(after), edit, at, command_id, cut)
    return whole_entries(after, edit, at, cut=cut) if entry is None else (entry,)


def _change(
    before: Timeline, after: Timeline, edit: int, at: float, command_id: int | None, cut: int
) -> ChangeEntry | None:
    """An arm's edit; None where the whole timeline says it shorter."""
    change = difference(before, after, at, edit=edit, command_id=command_id)
    if change is None or len(change.segments) > MOST_CHANGED:
        return None
    tail = None if change.tail is None else change.tail - cut
    same = {name: getattr(change, name) for name in ("edit", "base", "segments", "tail_start", "end", "command_id")}
    return ChangeEntry(at=at, version=after.version, first=change.first - cut, dof=after.dof, tail=tail, **same)


def _arc_change(
    before: ArcTimeline, after: ArcTimeline, edit: int, at: float, command_id: int | None
) -> ArcChange | None:
    """A mobile robot's edit; None where what was shifted along would come back otherwise, by a rounding error."""
    if after.start != before.start or not np.array_equal(after.initial, before.initial):
        return None
    since = min(before.index_at(at), after.index_at(at)) - 1
    first = first_unlike(before, after, max(since, 0))
    if len(after) - first > MOST_CHANGED:
        return None
    entry = ArcChange(
        edit=edit,
        base=edit - 1,
        at=at,
        version=after.version,
        first=first,
        segments=after.segments[first : len(after)],
        end=after.end,
        command_id=command_id,
    )
    made = changed_arcs(before, entry)
    return entry if all(made.segment(k) == after.segment(k) for k in range(first, len(after))) else None


def whole_entries(timeline: AnyTimeline, edit: int, at: float, *, cut: int = 0) -> tuple[HistoryEntry, ...]:
    """A whole timeline as it stands in a recording, in parts; from a segment on, where `cut` isn't 0."""
    total = len(timeline)
    start = timeline.start_of(cut) if cut else timeline.start
    initial = timeline.sample(start) if cut else timeline.initial
    arcs = isinstance(timeline, ArcTimeline)
    return tuple(
        (ArcHistory if arcs else HistoryEntry)(
            edit=edit,
            at=at,
            version=timeline.version,
            initial=tuple(initial.tolist()) if arcs else initial,  # type: ignore[arg-type]
            start=start,
            total=total - cut,
            index=index - cut,
            segments=timeline.segments[index : index + PART],  # type: ignore[arg-type]
        )
        for index in range(cut, max(total, cut + 1), PART)
    )


def changed_arcs(base: ArcTimeline, entry: ArcChange) -> ArcTimeline:
    """The timeline that a change makes of its base.

    Raises:
        InvalidValueError: If it doesn't fit.
    """
    if not 0 <= entry.first <= len(base):
        raise InvalidValueError("first", entry.first, f"0 to {len(base)}")
    drives = [ArcPiece(arc.duration, arc.v, arc.w, arc.command_id or HOLD) for arc in entry.segments]
    made = base.edited(base.start_of(entry.first), drives).with_version(entry.version)
    for k, arc in enumerate(entry.segments, entry.first):
        x, y, theta = made.segment(k).posture
        off = max(abs(arc.posture[0] - x), abs(arc.posture[1] - y), abs(wrapped(arc.posture[2] - theta)))
        if not off <= OFF:
            raise InvalidValueError(f"posture of arc {k}", arc.posture, f"({x}, {y}, {theta})")
    if not math.isfinite(made.end) or abs(made.end - entry.end) > SAME * max(1.0, abs(entry.end)):
        raise InvalidValueError("change", entry.end, f"one that ends at {made.end} s")
    return made


def arm_timeline(timeline: AnyTimeline) -> Timeline:
    """The timeline of an arm."""
    assert isinstance(timeline, Timeline)
    return timeline


@dataclass(frozen=True, slots=True, eq=False)
class RecordedEdit:
    """A timeline, and who made it of the one before."""

    number: int
    """Counts edits, from 1; 0 is what the recording began with."""
    at: float
    """The engine's clock [s]."""
    timeline: AnyTimeline
    """Of an arm, or of a mobile robot."""
    command_id: int | None
    """None where that isn't known, or a correction made it."""


class Chain:
    """Applies edits in turn; after a missing one, nothing until the whole timeline comes again."""

    def __init__(self, where: str) -> None:
        self._where = where
        self._parts: list[Any] = []
        self._edit: int | None = None
        self.edits: list[RecordedEdit] = []
        """Those that are known."""
        self.times: list[float] = []
        """When they were made [s], never descending."""
        self.drives: list[AnyTimeline] = []
        """The newest timeline of each drive, see `sampled`; of an arm there's one."""
        self.broken = False
        """Whether an edit after the newest known one is missing."""

    def add(self, entry: AnyEdit) -> None:
        """Take the next message of the channel.

        Raises:
            FormatError: If it fits nothing.
        """
        try:
            self._history(entry) if isinstance(entry, HistoryEntry) else self._change(entry)
        except InvalidValueError as error:
            raise FormatError(self._where, f"edit {entry.edit}: {error}") from None

    def _history(self, entry: HistoryEntry) -> None:
        if entry.index == 0:
            self._parts, self._edit = [], entry.edit
        if entry.edit != self._edit or entry.index != len(self._parts):
            self._edit = None
            return
        self._parts += following(entry.segments, self._parts[-1].end if self._parts else entry.start)
        if len(self._parts) < entry.total:
            return
        self._edit = None
        newest = self.edits[-1] if self.edits else None
        if newest is not None and newest.number >= entry.edit:
            return
        self._append(RecordedEdit(entry.edit, entry.at, whole(entry, self._parts), None))
        self.broken = False

    def _change(self, entry: AnyChange) -> None:
        newest = self.edits[-1] if self.edits else None
        if newest is None or self.broken or entry.base != newest.number:
            self.broken = self.broken or newest is None or entry.edit > newest.number
            return
        base: Any = newest.timeline
        if isinstance(entry, ArcChange) != isinstance(base, ArcTimeline):
            raise InvalidValueError("change", "one of another kind of robot", "of the timeline's own")
        made = changed_arcs(base, entry) if isinstance(entry, ArcChange) else _changed(base, entry)
        self._append(RecordedEdit(entry.edit, entry.at, made, entry.command_id))

    def _append(self, edit: RecordedEdit) -> None:
        if self.drives and edit.timeline.start <= self.drives[-1].start:
            self.drives.pop()
        self.drives.append(edit.timeline)
        self.edits.append(edit)
        self.times.append(max(edit.at, self.times[-1] if self.times else edit.at))


def placed(engine: Engine, posture: Sequence[float], clock: ManualClock) -> Engine:
    """A virtual base that begins a drive, now.

    Args:
        engine: What it was before; ids of commands count on.
        posture: Where it stands, (x, y, θ) [m, m, rad].
        clock: The session's.

    Raises:
        InvalidValueError: If the engine is an arm's, or the posture is none.
    """
    lateness = engine.scheduler.lateness
    made = MobileEngine(engine.model, posture=posture, clock=clock, lateness=lateness)  # type: ignore[arg-type]
    made.count_from(engine.newest)
    return made


def sampled(drives: Sequence[AnyTimeline], t: ArrayLike) -> Array:
    """Where the virtual robot is, of timelines each of which counts from where it starts.

    Args:
        drives: One or more, by their starts; before its start the first one counts.
        t: [s], scalar or (k,).

    Returns:
        Joints or postures, (n,) or (k, n).
    """
    if len(drives) == 1:
        return drives[0].sample(t)
    moments = np.asarray(t)
    if not moments.ndim:
        return drives[max(bisect_right(drives, float(moments), key=attrgetter("start")) - 1, 0)].sample(t)
    found: Array = np.empty((len(moments), len(drives[0].initial)))
    which = np.searchsorted([drive.start for drive in drives[1:]], moments, side="right")
    for index in np.unique(which).tolist():
        found[which == index] = drives[index].sample(moments[which == index])
    return found


def whole(entry: HistoryEntry, parts: Sequence[Any]) -> AnyTimeline:
    """The timeline that the segments of all parts of a history make.

    Raises:
        InvalidValueError: If they make none.
    """
    kind = ArcTimeline if isinstance(entry, ArcHistory) else Timeline
    return kind(entry.initial, entry.start, parts, entry.version)


def _changed(base: Timeline, entry: ChangeEntry) -> Timeline:
    if entry.dof != base.dof:
        raise InvalidValueError("dof", entry.dof, f"{base.dof}")
    return changed(base, entry).with_version(entry.version)
