"""Edits of a timeline as messages: what an edit put in, and a history in parts."""

from __future__ import annotations

from itertools import groupby
from typing import Any

from interfaces.messages import Change, History
from vrs.errors import InvalidValueError
from vrs.segment import HOLD, Piece
from vrs.timeline import Timeline
from vrs.track import Track
from vrs.tree import Leaf

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
    return [History(edit, cut, timeline.segments[cut : cut + PART]) for cut in cuts]


def difference(base: Timeline, new: Timeline, since: float, *, edit: int, command_id: int | None) -> Change | None:
    """An edit as what it put in between what stays and what is shifted.

    Timelines share what an edit left as it was, so that a long plan costs little.

    Args:
        base: The timeline before the edit.
        new: The timeline after it.
        since: Nothing changed before this time [s].
        edit: Number of the edit.
        command_id: Who made it.

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
    )


def first_unlike(base: Track[Any], new: Track[Any], index: int) -> int:
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


def changed(base: Timeline, message: Change) -> Timeline:
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
