"""Play-back of one recording, or of two on aligned clocks: either way, at any rate; no clock, no screen."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np

from interfaces.clients.playhead import LiveEdge, Mode, PlayHead
from interfaces.recording.figures import Pursuit
from interfaces.recording.kinds import ARM
from interfaces.recording.marks import Mark, MarkReader
from interfaces.recording.recording import Recording, check_alike
from interfaces.stream.meshcat.committed import Committed
from vrs.checks import finite
from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array

_T = TypeVar("_T")

FASTEST: Final = 8.0
"""Quickest rate of play-back [timeline s / user s], either way."""
FRAME: Final = 1.0 / 60.0
"""A step [s]."""
LAG: Final = 0.6
"""How far live play-back stays behind what is in the file [s]: a file grows by chunks."""
POLL: Final = 0.1
"""How often a file is asked whether it has grown [s]."""
QUIET: Final = 3.0
"""A file that hasn't grown for so long [s] isn't being written."""
LOOKED_AT: Final = 64
"""Commands and edits that are looked at for marks in one turn."""


class Align(enum.StrEnum):
    """What two recordings have in common."""

    TIMELINE = "timeline"
    """The timeline: equal times are shown together."""
    BEGAN = "began"
    """The calendar: what happened at once is shown together."""
    START = "start"
    """Their beginnings."""


@dataclass(frozen=True, slots=True, eq=False)
class PlaybackFrame:
    """What one recording shows at an instant."""

    t: float
    """On the recording's own timeline [s]."""
    q_virtual: Array | None
    """Joints of the virtual robot, g(t) [rad], (n,), or its posture; None where a lost part of the file may have
    changed them."""
    q_real: Array | None
    """Joints of the real robot as measured, between two samples linear [rad], (n,), or its true posture; None where
    none were."""
    play: float | None
    """The time of the timeline at which the real robot is [s]; of a mobile robot, by the place on the path."""
    error: float | None
    """Largest difference between the real robot and g(play), of a joint that turns [rad]; of a mobile robot, its
    path error [m]."""
    unit: str = "rad"
    """Of the error."""

    @property
    def behind(self) -> float | None:
        """How far the real robot is behind the virtual one [s]."""
        return None if self.play is None else self.t - self.play


@dataclass(frozen=True, slots=True, eq=False)
class PlaybackMoment:
    """What is shown at an instant."""

    t: float
    """On the first recording's timeline [s]."""
    frames: tuple[PlaybackFrame, ...]
    """One for each recording."""


class _AtEqualTime:
    """How a real robot follows a virtual one: compared at equal timeline time."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording

    def play(self, t: float) -> float:
        """The time of the timeline at which the real robot is at a time [s]."""
        return float(self._recording.play(t))

    def error(self, _t: float, q_real: Array, play: float) -> float | None:
        """The largest difference of a joint that turns [rad]; where none does, of any [m]."""
        q, prismatic = self._recording.virtual(play), self._recording.prismatic
        some = slice(None) if len(prismatic) in (0, len(q)) else [j for j in range(len(q)) if j not in prismatic]
        return float(np.abs(q_real - q)[some].max()) if np.isfinite(q).all() else None


class PlaybackTrack:
    """A recording in a play-back."""

    def __init__(self, recording: Recording, shift: float) -> None:
        self.recording, self.marks = recording, MarkReader(recording)
        self.shift = shift
        """The play-back's time less the recording's own [s]."""
        self._follower = _AtEqualTime(recording) if recording.kind is ARM else Pursuit(recording)
        self.problem = ""
        """What of the file makes no sense, the first line of it; empty where all does."""
        self._more = True

    def poll(self) -> bool:
        """Whether the file has grown since the last time."""
        if self.recording.end is not None:
            return False
        grown = self._read(self.recording.poll)
        self._more = self._more or bool(grown)
        return bool(grown)

    def look(self, most: int | None = None) -> None:
        """Look for marks; see `MarkReader.read`."""
        if self._more:
            self._more = bool(self._read(lambda: self.marks.read(most)))

    def _read(self, read: Callable[[], _T]) -> _T | None:
        """What is read; None where it makes no sense: what else is in the file is played."""
        try:
            return read()
        except FormatError as error:
            self.problem = self.problem or str(error)
            return None

    @property
    def span(self) -> tuple[float, float]:
        """From when to when there's something, in the play-back's time [s]."""
        start, end = self.recording.span
        return start + self.shift, end + self.shift

    def frame(self, t: float) -> PlaybackFrame:
        """What is there at a time of the play-back [s]."""
        own = t - self.shift
        recording = self.recording
        unit = recording.unit
        q_virtual = self._known(recording.virtual, own)
        q_real = self._known(recording.real, own)
        if q_real is None:
            return PlaybackFrame(own, q_virtual, None, None, None, unit)
        play = self._read(lambda: self._follower.play(own))
        error = None if play is None else self._read(lambda: self._follower.error(own, q_real, play))
        return PlaybackFrame(own, q_virtual, q_real, play, error, unit)

    def committed(self, frame: PlaybackFrame) -> Committed | None:
        """Where the real robot was going, as the plan was known then; None where it isn't there."""
        if frame.play is None:
            return None
        timeline = self._read(lambda: self.recording.timeline_at(frame.t))
        return None if timeline is None else Committed(timeline, frame.play)

    def _known(self, joints: Callable[[float], Array], t: float) -> Array | None:
        q = self._read(lambda: joints(t))
        return q if q is not None and np.isfinite(q).all() else None


class Playback:
    """A play head over recordings. It begins at the start, and stands.

    What has an end stops there; a file that's still being written is followed, and can be watched live.
    """

    def __init__(self, recordings: Sequence[Recording], *, align: Align = Align.TIMELINE) -> None:
        """Play back.

        Args:
            recordings: One or two; whoever opened them closes them.
            align: What two of them have in common.

        Raises:
            InvalidValueError: If there are more, or of robots of two kinds, or one of two to be aligned by the
                calendar doesn't know it.
        """
        if not 1 <= len(recordings) <= 2:
            raise InvalidValueError("recordings", len(recordings), "1 or 2")
        check_alike(recordings)
        self.tracks = tuple(
            PlaybackTrack(recording, _shift(recordings[0], recording, align)) for recording in recordings
        )
        self._edge = LiveEdge()
        self.growing = False
        """Whether a file is being written."""
        self._grown = self._due = -math.inf
        self.span = self._spanned()
        """From when to when there's something [s]."""
        self.head = PlayHead(self._live, lambda: self.span)
        self.head.pause(now=0.0)

    @property
    def mode(self) -> Mode:
        """What the play head does."""
        return self.head.mode

    @property
    def rate(self) -> float:
        """How fast time is shown to go now [timeline s / user s]; the rate that was set where it stands."""
        return 1.0 if self.mode is Mode.LIVE else self.head.rate

    def place(self, *, now: float) -> float:
        """The time that is shown [s]."""
        place = self.head.position(now)
        start, end = self.span
        return start if place is None else min(max(place, start), end)

    def play(self, *, now: float, rate: float | None = None) -> None:
        """Run from here; from the end, or backwards from the start, it runs from the other side.

        Args:
            now: The user's time [s].
            rate: −8 to 8, but not 0; the rate that was last set unless given.

        Raises:
            InvalidValueError: If rate is out of range, or 0.
        """
        rate = checked_rate(self.head.rate if rate is None else rate)
        place, (start, end) = self.place(now=now), self.span
        if rate > 0 and place >= end and not self.growing:
            self.head.seek(start, now=now)
        elif rate < 0 and place <= start:
            self.head.seek(end, now=now)
        self.head.play(now=now, rate=rate)

    def pause(self, *, now: float) -> None:
        """Stand."""
        self.seek(self.place(now=now), now=now)
        self.head.pause(now=now)

    def set_rate(self, rate: float, *, now: float) -> None:
        """Change the rate; what stands stands, and runs at it when it plays.

        Raises:
            InvalidValueError: If rate is out of range, or 0.
        """
        self.head.set_rate(checked_rate(rate), now=now)

    def step(self, dt: float, *, now: float) -> None:
        """Stand dt [s] further on, or back where it's negative."""
        self.head.step(dt, now=now)

    def seek(self, t: float, *, now: float) -> None:
        """Go to a time [s], the nearest there is; what stood stands there, all else plays on."""
        start, end = self.span
        self.head.seek(min(max(finite("t", t, "finite seconds"), start), end), now=now)

    def seek_mark(self, *, back: bool, now: float) -> Mark | None:
        """Go to the next mark, or to the last one before; the mark, or None where there's none."""
        place = self.place(now=now)
        found = []
        for track in self.tracks:
            mark = track.marks.beside(place - track.shift, back=back)
            if mark is not None:
                found.append((mark.t + track.shift, mark))
        if not found:
            return None
        t, mark = (max if back else min)(found, key=lambda pair: pair[0])
        self.seek(t, now=now)
        return mark

    def set_loop(self, start: float, end: float, *, now: float) -> None:
        """Loop a range [s]; see `PlayHead.set_loop`."""
        self.head.set_loop(start, end, now=now)

    def clear_loop(self, *, now: float) -> None:
        """Loop no more."""
        self.head.clear_loop(now=now)

    def go_live(self, *, now: float) -> float:
        """Catch up with what is being written; when it will be there [s].

        Raises:
            InvalidValueError: If nothing is being written.
        """
        if not self.growing:
            raise InvalidValueError("live", "go live", "a recording that is being written")
        return self.head.go_live(now=now)

    def advance(self, *, now: float) -> PlaybackMoment:
        """What is shown now [s]."""
        self._look(now)
        for track in self.tracks:
            track.look(LOOKED_AT)
        place = self.place(now=now)
        if self.mode is Mode.PLAYING and self._at_an_end(place):
            self.head.pause(now=now)
        return self.moment(place)

    def moment(self, t: float) -> PlaybackMoment:
        """What is shown at a time [s]."""
        return PlaybackMoment(t, tuple(track.frame(t) for track in self.tracks))

    def read_marks(self) -> None:
        """Read all marks now, however long it takes."""
        for track in self.tracks:
            track.look()

    def _at_an_end(self, place: float) -> bool:
        (start, end), loop, rate = self.span, self.head.loop, self.head.rate
        if rate > 0:
            return place >= end and not self.growing and (loop is None or loop[1] < end)
        return place <= start and (loop is None or loop[0] > start)

    def _live(self, now: float) -> float:
        live = self._edge.at(now) if self.growing else None
        return -math.inf if live is None else live

    def _spanned(self) -> tuple[float, float]:
        spans = [track.span for track in self.tracks]
        return min(start for start, _ in spans), max(end for _, end in spans)

    def _look(self, now: float) -> None:
        """Find out whether the files have grown."""
        if now < self._due:
            return
        self._due = now + POLL
        grown = [track.poll() for track in self.tracks]
        if any(grown):
            shown = self.place(now=now)
            self.span = self._spanned()
            newest = self.span[1] - LAG
            if not self.growing:
                # What was shown of it already isn't taken back.
                self._edge, newest = LiveEdge(), max(newest, shown)
            self._grown, self.growing = now, True
            self._edge.heard(newest, now=now)
        ended = all(track.recording.end is not None for track in self.tracks)
        if self.growing and (ended or now - self._grown > QUIET):
            self._stop_growing(now)

    def _stop_growing(self, now: float) -> None:
        """What was live plays on to the end."""
        mode, place = self.mode, self.place(now=now)
        self.growing = False
        if mode in {Mode.LIVE, Mode.CATCHING_UP}:
            self.head.seek(place, now=now)
            self.head.play(now=now, rate=1.0)


def checked_rate(rate: object) -> float:
    """A rate of play-back.

    Raises:
        InvalidValueError: If it isn't a number from −8 to 8, or is 0.
    """
    allowed = "−8 to 8, but not 0"
    number = finite("rate", rate, allowed)
    if number == 0 or abs(number) > FASTEST:
        raise InvalidValueError("rate", rate, allowed)
    return number


def _shift(first: Recording, recording: Recording, align: Align) -> float:
    """What is added to a recording's time to get the play-back's [s]."""
    if align is Align.TIMELINE or recording is first:
        return 0.0
    one, other = first.session, recording.session
    if align is Align.START:
        return one.t - other.t
    if one.began is None or other.began is None:
        raise InvalidValueError("align", str(align), "timeline, for recordings that don't know the calendar")
    return (other.began - other.t) - (one.began - one.t)
