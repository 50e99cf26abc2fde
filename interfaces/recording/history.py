"""A timeline's edits as they were recorded, whole or as changes, of polynomials and of arcs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from interfaces.engine_server.journal import SAME, changed, first_unlike
from interfaces.messages import Change
from interfaces.messages.recording import (
    ArcChange,
    ArcEntry,
    ArcHistory,
    ChangeEntry,
    HistoryEntry,
    SegmentEntry,
    segments_of,
)
from vrs.errors import FormatError, InvalidValueError
from vrs.mobile import ArcPiece, ArcTimeline, wrapped
from vrs.segment import HOLD, ArcSegment
from vrs.timeline import Timeline

PART = 256
"""Arcs of one message of a history."""
MOST_CHANGED = 2048
"""Arcs of an edit that's written as one; beyond that the whole timeline is, in parts."""
OFF = 1e-6
"""By how much a posture may differ from where the arcs before it lead [m, rad]."""


def edit_entries(
    before: ArcTimeline, after: ArcTimeline, edit: int, at: float, command_id: int | None
) -> tuple[ArcChange | ArcHistory, ...]:
    """An edit as it stands in a recording; see `interfaces.recording.capture.edit_entries`.

    Where what was shifted along would come back otherwise, by a rounding error, it's the whole timeline.
    """
    since = min(before.index_at(at), after.index_at(at)) - 1
    first = first_unlike(before, after, max(since, 0)) if after.start == before.start else 0
    if after.start != before.start or len(after) - first > MOST_CHANGED:
        return tuple(whole_entries(after, edit, at))
    entry = ArcChange(
        edit=edit,
        base=edit - 1,
        at=at,
        version=after.version,
        first=first,
        segments=_entries(after.segments[first : len(after)]),
        end=after.end,
        command_id=command_id,
    )
    made = changed_arcs(before, entry)
    same = all(made.segment(k) == after.segment(k) for k in range(first, len(after)))
    return (entry,) if same else tuple(whole_entries(after, edit, at))


def whole_entries(timeline: ArcTimeline, edit: int, at: float) -> Iterator[ArcHistory]:
    """A whole timeline as it stands in a recording, in parts."""
    total = len(timeline)
    for index in range(0, max(total, 1), PART):
        yield ArcHistory(
            edit=edit,
            at=at,
            version=timeline.version,
            initial=timeline.initial.tolist(),
            start=timeline.start,
            total=total,
            index=index,
            segments=_entries(timeline.segments[index : index + PART]),
        )


def _entries(arcs: Sequence[ArcSegment]) -> tuple[ArcEntry, ...]:
    """Arcs for the file; the first one's start is always given."""
    end: float | None = None
    found = []
    for arc in arcs:
        start = None if arc.start == end else arc.start
        found.append(ArcEntry(arc.duration, list(arc.posture), arc.v, arc.w, arc.command_id, start))
        end = arc.start + arc.duration
    return tuple(found)


def whole(entry: ArcHistory, parts: Sequence[ArcEntry]) -> ArcTimeline:
    """The timeline that all parts of a history make.

    Raises:
        InvalidValueError: If they make none.
    """
    start, arcs = entry.start, []
    for part in parts:
        start = start if part.start is None else part.start
        x, y, theta = part.posture
        arcs.append(ArcSegment(start, part.duration, (x, y, theta), part.v, part.w, part.command_id))
        start += part.duration
    return ArcTimeline(entry.initial, entry.start, arcs, entry.version)


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


AnyHistory: TypeAlias = HistoryEntry | ArcHistory
AnyChange: TypeAlias = ChangeEntry | ArcChange
AnyTimeline: TypeAlias = Timeline | ArcTimeline


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
        self.broken = False
        """Whether an edit after the newest known one is missing."""

    def add(self, entry: AnyHistory | AnyChange) -> None:
        """Take the next message of the channel.

        Raises:
            FormatError: If it fits nothing.
        """
        try:
            self._history(entry) if isinstance(entry, AnyHistory) else self._change(entry)
        except InvalidValueError as error:
            raise FormatError(self._where, f"edit {entry.edit}: {error}") from None

    def _history(self, entry: AnyHistory) -> None:
        if entry.index == 0:
            self._parts, self._edit = [], entry.edit
        if entry.edit != self._edit or entry.index != len(self._parts):
            self._edit = None
            return
        self._parts += entry.segments
        if len(self._parts) < entry.total:
            return
        self._edit = None
        newest = self.edits[-1] if self.edits else None
        if newest is not None and newest.number >= entry.edit:
            return
        made = whole(entry, self._parts) if isinstance(entry, ArcHistory) else _whole(entry, self._parts)
        self._append(RecordedEdit(entry.edit, entry.at, made, None))
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
        self.edits.append(edit)
        self.times.append(max(edit.at, self.times[-1] if self.times else edit.at))


def _whole(entry: HistoryEntry, parts: Sequence[SegmentEntry]) -> Timeline:
    segments = segments_of(len(entry.initial), entry.start, parts)
    if segments and not all(np.isfinite(segment.coefficients).all() for segment in segments):
        raise InvalidValueError("coefficients", "infinity", "finite")
    return Timeline(entry.initial, entry.start, segments, entry.version)


def _changed(base: Timeline, entry: ChangeEntry) -> Timeline:
    if entry.dof != base.dof:
        raise InvalidValueError("dof", entry.dof, f"{base.dof}")
    segments = segments_of(entry.dof, base.start, entry.segments)
    change = Change(
        entry.edit,
        entry.first,
        entry.end,
        entry.command_id,
        entry.base,
        entry.tail,
        entry.tail_start,
        segments=segments,
    )
    return changed(base, change).with_version(entry.version)
