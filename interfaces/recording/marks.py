"""What a seek bar marks: commands, what became of them, what they made of the plan, stops, corrections."""

from __future__ import annotations

import enum
from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterator, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Final

import numpy as np

from interfaces.messages.recording import Anchor, CommandRecord, Placement, RunEvent
from interfaces.runs.twin_run import correction_text
from vrs.commands import DriveCommand, Motion, MotionCommand
from vrs.ledger import Receipt, Status
from vrs.model import Array
from vrs.record import Record
from vrs.timeline import Timeline

if TYPE_CHECKING:
    from interfaces.recording.history import AnyTimeline, RecordedEdit
    from interfaces.recording.recording import Deed, Recording

CHANGED: Final = 1e-9
"""A predicted position that is off by more [rad] was falsified."""
_SAMPLES: Final = 201
"""Times at which two plans are compared, besides the middles of their segments."""
_SEGMENTS: Final = 256
"""Segments whose middles are looked at, at most."""


class MarkKind(enum.StrEnum):
    """What a mark tells."""

    COMMAND = "command"
    """A command was accepted."""
    POSTPONED = "postponed"
    """A command came later than was asked for, on either robot."""
    REJECTED = "rejected"
    """A command was rejected, by either robot."""
    FALSIFIED = "falsified"
    """A command changed what had been planned: who was shown it before, saw what didn't come true."""
    CORRECTED = "corrected"
    """The virtual robot was put where the real one was going."""
    STOPPED = "stopped"
    """The real robot stopped by itself, its watchdog or a tolerance."""
    LINK = "link"
    """Messages were lost or late, the link came or went, or was changed."""
    OTHER = "other"
    """A load, an end that wasn't reached."""


OF_EVENTS: Final = {
    "corrected": MarkKind.CORRECTED,
    "halted": MarkKind.STOPPED,
    "diverged": MarkKind.REJECTED,
    "late": MarkKind.POSTPONED,
    "lost": MarkKind.LINK,
    "slowed": MarkKind.LINK,
    "waited": MarkKind.LINK,
    "up": MarkKind.LINK,
    "down": MarkKind.LINK,
    "rerouted": MarkKind.LINK,
    "collision": MarkKind.STOPPED,
}
"""Kinds of events, as they are marked; all others are `OTHER`."""

_OF_STATUS: Final = {
    Status.ACCEPTED: MarkKind.COMMAND,
    Status.POSTPONED: MarkKind.POSTPONED,
    Status.REJECTED: MarkKind.REJECTED,
}
_WORDS: Final = {"via": "via point", "scale": "time scaling", "retime": "another time for a command"}
"""What commands are called where the word of the wire isn't plain."""


class Mark(Record, frozen=True, omit_defaults=True, gc=False):
    """Something that happened at a time."""

    t: float
    """When, on the recording's timeline [s]."""
    kind: MarkKind
    text: str
    """What happened, one line."""
    span: tuple[float, float] | None = None
    """What part of the timeline it's about [s], if it's about one."""
    command_id: int | None = None


_when = attrgetter("t")


class MarkReader:
    """The marks of a recording, by time; read on as it grows, and a bounded number of steps at a time."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self.marks: Sequence[Mark] = ()
        """Those that were read so far."""
        self._told: list[Mark] = []
        self._happened: list[Mark] = []
        self._commands = self._edits = self._events = 0
        self.version = 0
        """Counts up whenever there are more marks."""

    def read(self, most: int | None = None) -> bool:
        """Read on.

        Args:
            most: Most commands and edits to look at; None for all there are.

        Returns:
            Whether there is more to read.
        """
        recording, found = self._recording, list[Mark]()
        commands, edits, events = recording.commands, recording.edits, recording.events
        left = len(commands) + len(edits) if most is None else most
        for entry in commands[self._commands : self._commands + left]:
            found += _told(entry, self._recording.prismatic)
            self._commands += 1
            left -= 1
        while left > 0 and self._edits < len(edits):
            edit = edits[self._edits]
            if self._edits:
                found += _changed(edits[self._edits - 1], edit)
            self._edits += 1
            left -= 1
        # Events may be written long after they happened: those that are there may not be the first ones.
        if len(events) != self._events:
            self._events = len(events)
            self._happened = [mark for event in events for mark in _happened(event)]
        elif not found:
            return self._commands < len(commands) or self._edits < len(edits)
        self._told += found
        self.marks = sorted((*self._told, *self._happened), key=_when)
        self.version += 1
        return self._commands < len(commands) or self._edits < len(edits)

    def passed(self, since: float, until: float) -> Sequence[Mark]:
        """The marks after one place, up to another [s], in that order: backwards where that's earlier."""
        if until >= since:
            return self.marks[
                bisect_right(self.marks, since, key=_when) : bisect_right(self.marks, until, key=_when)
            ]
        return self.marks[bisect_left(self.marks, until, key=_when) : bisect_left(self.marks, since, key=_when)][
            ::-1
        ]

    def latest(self, t: float) -> Mark | None:
        """The newest mark at a time [s]; None before the first."""
        count = bisect_right(self.marks, t, key=_when)
        return self.marks[count - 1] if count else None

    def beside(self, t: float, *, back: bool) -> Mark | None:
        """The next mark after a time [s], or the last one before it; None where there's none."""
        marks = self.marks
        index = bisect_left(marks, t - 1e-6, key=_when) - 1 if back else bisect_right(marks, t + 1e-6, key=_when)
        return self.marks[index] if 0 <= index < len(self.marks) else None


def falsified(before: AnyTimeline, after: AnyTimeline, at: float) -> tuple[float, float] | None:
    """What an edit changed of what had been planned.

    Args:
        before: The plan before it.
        after: The plan that it made.
        at: When it was made [s].

    Returns:
        From when to when [s] the positions of both differ, before the end of the first; None if they don't.
    """
    low, high = max(at, before.start), before.end
    if not low < high:
        return None
    times = [np.linspace(low, high, _SAMPLES)]
    for timeline in (before, after):
        first = max(timeline.index_at(low), 0)
        starts = _starts(timeline, first, min(first + _SEGMENTS, len(timeline)))
        times.append(0.5 * (starts[1:] + starts[:-1]))
    t = np.unique(np.concatenate(times))
    t = t[(t >= low) & (t <= high)]
    differs = np.flatnonzero(np.abs(before.sample(t) - after.sample(t)).max(axis=1) > CHANGED)
    if not len(differs):
        return None
    return float(t[max(differs[0] - 1, 0)]), float(t[differs[-1]])


def _starts(timeline: AnyTimeline, low: int, high: int) -> Array:
    """Starts of the segments low to high − 1 [s]."""
    if isinstance(timeline, Timeline):
        return timeline.knots(low, high)[0]
    return np.array([timeline.start_of(index) for index in range(low, high)])


def clock_text(t: float) -> str:
    """A time [s] as pages write it, such as 1:05.25."""
    hundredths = round(abs(t) * 100)
    return f"{'−' if t < 0 else ''}{hundredths // 6000}:{hundredths % 6000 / 100:05.2f}"


def _changed(before: RecordedEdit, edit: RecordedEdit) -> Iterator[Mark]:
    """The mark of an edit, where it changed what had been planned."""
    span = falsified(before.timeline, edit.timeline, edit.at)
    if span is not None:
        who = "a correction" if edit.command_id is None else f"command {edit.command_id}"
        text = f"{who} changed what was planned from {clock_text(span[0])} to {clock_text(span[1])}"
        yield Mark(edit.at, MarkKind.FALSIFIED, text, span, edit.command_id)


def _happened(event: RunEvent) -> Iterator[Mark]:
    """The mark of an event; corrections are among the commands, exactly."""
    kind = OF_EVENTS.get(event.kind, MarkKind.OTHER)
    if kind is not MarkKind.CORRECTED:
        yield Mark(event.t, kind, event.text)


def _told(entry: Deed, prismatic: Collection[int]) -> Iterator[Mark]:
    """The mark of a command, or of what put the virtual robot elsewhere."""
    if isinstance(entry, Anchor):
        text = correction_text(entry.end, np.asarray(entry.error), entry.reason, prismatic)
        yield Mark(entry.at, MarkKind.CORRECTED, text, (entry.at, entry.end))
    elif isinstance(entry, Placement):
        if not entry.along:
            yield Mark(entry.at, MarkKind.CORRECTED, "the virtual robot was put where the real one stands")
    elif entry.receipt is not None and not _usual(entry):
        receipt = entry.receipt
        start, end = receipt.execute_at, receipt.end
        span = None if start is None or end is None else (start, end)
        yield Mark(entry.at, _OF_STATUS[receipt.status], _described(entry, receipt), span, receipt.command_id)


def _usual(entry: CommandRecord) -> bool:
    """Whether it's one of the many by which somebody drives."""
    accepted = entry.receipt is not None and entry.receipt.status is Status.ACCEPTED
    return accepted and isinstance(entry.command, DriveCommand)


def _described(entry: CommandRecord, receipt: Receipt) -> str:
    """A command and what became of it at first, in a line."""
    command = entry.command
    if command is None:
        return f"command {receipt.command_id} was taken back"
    tag = str(type(command).__struct_config__.tag)
    straight = isinstance(command, MotionCommand) and command.motion is Motion.LINE
    text = (
        f"command {receipt.command_id} ({'straight line' if straight else _WORDS.get(tag, tag)}): {receipt.status}"
    )
    if receipt.execute_at is not None and receipt.end is not None:
        text += f", {clock_text(receipt.execute_at)} to {clock_text(receipt.end)}"
    return f"{text}: {receipt.reason}" if receipt.reason else text
