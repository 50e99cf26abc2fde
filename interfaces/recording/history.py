"""The edits of a recorded timeline, put together again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from interfaces.engine_server.journal import changed
from interfaces.messages import Change
from interfaces.recording.driving import arcs
from interfaces.recording.driving.messages import ArcChange, ArcHistory
from interfaces.recording.messages import ChangeEntry, HistoryEntry, SegmentEntry, segments_of
from vrs.errors import FormatError, InvalidValueError
from vrs.mobile import ArcTimeline
from vrs.timeline import Timeline

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
        made = arcs.whole(entry, self._parts) if isinstance(entry, ArcHistory) else _whole(entry, self._parts)
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
        made = arcs.changed(base, entry) if isinstance(entry, ArcChange) else _changed(base, entry)
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
        entry.base, entry.edit, entry.command_id, entry.first, segments, entry.tail, entry.tail_start, entry.end
    )
    return changed(base, change).with_version(entry.version)
