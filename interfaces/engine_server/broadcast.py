"""The streaming server near the engine: frames at a rate, each made once and shared by many viewers.

Source: Doulgeri, Zikos, Delopoulos, sections III and VI-B.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice
from typing import TypeVar

from interfaces.engine_server.forecasts import WINDOW, Forecasts
from interfaces.engine_server.journal import Journal
from interfaces.messages import Broadcast, Compact, Frame, FrameStatus, FrameVerdict, Verdicts
from interfaces.messages.compact import MOST_FRAMES, CompactEncoder, CompactFrame, packed
from vrs.checks import finite
from vrs.engine import Engine
from vrs.errors import InvalidValueError
from vrs.model import frozen_array

MOST_VIEWERS = 1024
"""Viewers of one broadcaster."""

RANGES = 64
"""Most ranges of falsified frames in a message."""

KEY_PERIOD = 5.0
"""A key frame goes to each viewer of compact frames at least once in this time [s]."""

DUE = 2e-9
"""How much too early [s] a deadline counts as reached: engine times are whole nanoseconds."""


class FrameSlot:
    """A viewer's place: the newest frame, and nothing else, however slow the viewer is."""

    def __init__(self) -> None:
        self._newest: Broadcast | None = None
        self.missed = 0
        """Frames that were never taken."""

    def put(self, message: Broadcast) -> None:
        """Put the newest frame in place of what's there."""
        self.missed += self._newest is not None
        self._newest = message

    def take(self) -> Broadcast | None:
        """Take the newest frame; None where there's none that wasn't taken."""
        message, self._newest = self._newest, None
        return message

    def __bool__(self) -> bool:
        return self._newest is not None

    def begin_again(self) -> None:
        """Do nothing: each frame stands for itself."""


class CompactSlot:
    """The place of a viewer of compact frames: those of its next message, never more.

    What it would have to build on a frame that it wasn't sent, begins with a key frame, and that doesn't wait.
    """

    def __init__(self, encoder: CompactEncoder, rate: float, delay: float) -> None:
        """Wait for frames.

        Args:
            encoder: The broadcaster's.
            rate: Frames a second.
            delay: How long a frame may wait for others that go in the same message [s].
        """
        self._encoder = encoder
        self._size = min(1 + int(delay * rate + 1e-6), MOST_FRAMES)
        self._key_every = KEY_PERIOD * rate
        self._key_at = 0.0
        self._broken = True
        self._frames: list[CompactFrame] = []
        self._known: Sequence[tuple[int, int, int | None]] = ()
        self._since = 1
        self._verdicts = Verdicts(1, 0)
        self.missed = 0
        """Frames that were never taken."""

    def put(self, message: Broadcast) -> None:
        """Put a frame behind those that wait; where there's no room, in their place."""
        frame = self._encoder.add(message.frame)
        self._broken |= frame.delta is None
        if len(self._frames) >= self._size or frame.delta is None:
            self._broken |= bool(self._frames)
            self.missed += len(self._frames)
            self._frames.clear()
        self._frames.append(frame)
        self._verdicts = message.verdicts

    def take(self) -> Compact | None:
        """Take the next message; None where it isn't complete."""
        if not self:
            return None
        number, verdicts = self._frames[-1].number, self._verdicts
        key = self._broken or number >= self._key_at
        data = packed(self._frames, number - verdicts.through, key=key)
        since = self._newly_since(number, key)
        known = () if key else set(self._known)
        falsified = tuple(found for found in verdicts.falsified if found not in known)
        self._known = verdicts.falsified
        if key:
            self._broken, self._key_at = False, number + self._key_every
        self._frames.clear()
        return Compact(data, since, falsified)

    def _newly_since(self, number: int, key: bool) -> int | None:
        """Number of the oldest frame that something is known of, where the viewer can't tell by itself."""
        since = self._verdicts.since
        plain = 1 if key else self._since
        if since <= max(plain, number - WINDOW + 1):
            self._since = plain
            return None
        self._since = since
        return since

    def __bool__(self) -> bool:
        return len(self._frames) >= self._size or (self._broken and bool(self._frames))

    def begin_again(self) -> None:
        """Send a key frame next: the viewer lacks a frame."""
        self._broken = True


Slot = TypeVar("Slot", FrameSlot, CompactSlot)


class Broadcaster:
    """Transmits g(t_c + lead) periodically, t_c being the engine's time.

    With `lead` = D_f + D_b this is the paper's predicted transmission. Each frame says whether it's predicted, and
    later messages say what became of it.
    """

    def __init__(self, source: Engine | Journal, *, rate: float, lead: float = 0.0) -> None:
        """Begin at the next `advance`.

        Args:
            source: The engine, or its journal where others serve it too.
            rate: Frames a second, 0.1 to 1000.
            lead: How far ahead of the engine's time the frames are [s], −60 to 60; it may be changed.

        Raises:
            InvalidValueError: If rate or lead is out of range.
        """
        self.rate = finite("rate", rate, "0.1 to 1000 frames a second")
        if not 0.1 <= self.rate <= 1000:
            raise InvalidValueError("rate", rate, "0.1 to 1000 frames a second")
        self.lead = lead
        self.journal = source if isinstance(source, Journal) else Journal(source)
        self._edit = self.journal.look()
        self._forecasts = Forecasts()
        self.falsified: list[FrameVerdict] = []
        """Frames that turned out wrong, the last ones."""
        self._ranges: tuple[tuple[int, int, int | None], ...] = ()
        self._since = 1
        self._slots: list[FrameSlot | CompactSlot] = []
        self._encoder = CompactEncoder(self.rate)
        self._begun: float | None = None
        self._beat = 0
        self.number = 0
        """Number of the newest frame."""
        self.skipped = 0
        """Frames that weren't made because `advance` came too late for them."""

    @property
    def lead(self) -> float:
        """How far ahead of the engine's time the frames are [s]."""
        return self._lead

    @lead.setter
    def lead(self, value: float) -> None:
        lead = finite("lead", value, "−60 to 60 s")
        if abs(lead) > 60:
            raise InvalidValueError("lead", value, "−60 to 60 s")
        self._lead = lead

    @property
    def share_falsified(self) -> float | None:
        """Share of the predicted frames with a verdict that a command falsified; None before the first verdict."""
        return self._forecasts.share_falsified

    @property
    def viewers(self) -> int:
        """How many viewers there are."""
        return len(self._slots)

    def join(self) -> FrameSlot:
        """Give a viewer a place.

        Raises:
            InvalidValueError: If there are too many.
        """
        return self._joined(FrameSlot())

    def join_compact(self, delay: float = 0.0) -> CompactSlot:
        """Give a place to a viewer that wants its frames compact.

        Args:
            delay: How long a frame may wait for others that go in the same message [s].

        Raises:
            InvalidValueError: If there are too many.
        """
        return self._joined(CompactSlot(self._encoder, self.rate, delay))

    def _joined(self, slot: Slot) -> Slot:
        if len(self._slots) >= MOST_VIEWERS:
            raise InvalidValueError("viewers", len(self._slots) + 1, f"at most {MOST_VIEWERS} a broadcaster")
        self._slots.append(slot)
        return slot

    def leave(self, slot: FrameSlot | CompactSlot) -> None:
        """Give a place back; one that was given back already is none."""
        self._slots = [other for other in self._slots if other is not slot]

    def next_deadline(self) -> float | None:
        """When the next frame is due [s], in the engine's time; None before the first `advance`."""
        return None if self._begun is None else self._begun + self._beat / self.rate

    def advance(self, *, now: float) -> tuple[Broadcast, ...]:
        """Make the frame that is due, and put it into every slot.

        Args:
            now: The engine's time [s].

        Returns:
            The message, or nothing. Frames that are overdue aren't made up for: there's never a burst.
        """
        if self._begun is None:
            self._begun = now
        due = self._begun + self._beat / self.rate
        if now < due - DUE:
            return ()
        late = int((now - due + DUE) * self.rate)
        self.skipped += late
        self._beat += 1 + late
        message = self._make(now)
        for slot in self._slots:
            slot.put(message)
        return (message,)

    def _make(self, now: float) -> Broadcast:
        self._catch_up()
        t = now + self._lead
        q = frozen_array(self.journal.engine.timeline.sample(t))
        self.number += 1
        status = self._forecasts.add(self.number, t, q, now=self.journal.past)
        frame = Frame(self.number, t, now, q, status)
        through = int(min(self._forecasts.oldest - 1, self.number))
        since = max(self._since, self.number - WINDOW + 1, self._forecasts.forgotten + 1)
        return Broadcast.showing(frame, Verdicts(since, through, self._ranges))

    def _catch_up(self) -> None:
        found = 0
        newest = self.journal.look()
        for edit in self.journal.since(self._edit):
            self._forecasts.settle(edit.at)
            verdicts = self._forecasts.edited(edit.timeline, edit.culprit)
            found += len(verdicts)
            self.falsified.extend(verdicts)
        self._edit = newest
        self._forecasts.settle(self.journal.past)
        oldest = self.number + 1 - WINDOW
        if found or (self._ranges and self._ranges[0][0] < oldest):
            self.falsified = [verdict for verdict in self.falsified if verdict.number >= oldest]
            self._ranges, left_out = ranges(self.falsified)
            self._since = max(self._since, left_out + 1)

    def status(self, number: int) -> FrameVerdict | None:
        """What became of a predicted frame; None while that's open, if it never was, or where it's forgotten."""
        self._catch_up()
        return self._forecasts.verdict(number)


def ranges(falsified: Iterable[FrameVerdict]) -> tuple[tuple[tuple[int, int, int | None], ...], int]:
    """Verdicts as ranges of numbers, the newest 64; and the highest number that's left out, or 0."""
    found: list[tuple[int, int, int | None]] = []
    for verdict in sorted(falsified, key=lambda verdict: verdict.number):
        if found and found[-1][1] == verdict.number - 1 and found[-1][2] == verdict.falsified_by:
            found[-1] = found[-1][0], verdict.number, verdict.falsified_by
        else:
            found.append((verdict.number, verdict.number, verdict.falsified_by))
    left_out = max((last for _, last, _ in islice(found, max(len(found) - RANGES, 0))), default=0)
    return tuple(found[-RANGES:]), left_out


def status_of(number: int, verdicts: Verdicts) -> FrameVerdict | None:
    """What a message says of a frame that was predicted; None where it says nothing."""
    for first, last, command_id in verdicts.falsified:
        if first <= number <= last:
            return FrameVerdict(number, FrameStatus.FALSIFIED, command_id)
    if verdicts.since <= number <= verdicts.through:
        return FrameVerdict(number, FrameStatus.CONFIRMED)
    return None
