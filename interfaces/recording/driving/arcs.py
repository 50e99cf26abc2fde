"""Edits of a mobile robot's timeline as they stand in a recording, and back."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from interfaces.engine_server.journal import SAME, first_unlike
from interfaces.recording.driving.messages import ArcChange, ArcEntry, ArcHistory
from vrs.errors import InvalidValueError
from vrs.mobile import ArcPiece, ArcTimeline, wrapped
from vrs.segment import HOLD, ArcSegment

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
    made = changed(before, entry)
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


def changed(base: ArcTimeline, entry: ArcChange) -> ArcTimeline:
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
