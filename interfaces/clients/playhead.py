"""A viewer's own place in time: play, pause, step, rewind, seek, rate, loop, go live."""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass

from vrs.checks import finite
from vrs.errors import InvalidValueError

FASTEST = 10.0
"""Quickest rate of play [timeline s / user s]; to rewind rates are negative."""

SHORTEST = 0.01
"""A loop is at least so long [s]."""

QUICKEST = 0.5
"""Going live takes at least so long [s]."""

SLEW = 0.1
"""How fast the live edge is corrected, at most [s/s]."""

LIVE_WINDOW = 5.0
"""Messages older than one to two of these [s] don't count for the live edge."""


class Mode(enum.StrEnum):
    """What a play head does."""

    LIVE = "live"
    """It shows the newest there is."""
    PLAYING = "playing"
    """It runs at its rate."""
    PAUSED = "paused"
    """It stands."""
    CATCHING_UP = "catching-up"
    """It's on its way to the newest there is."""


class LiveEdge:
    """The newest time that there is to see, by the user's clock, from messages that were underway.

    The quickest message of the last 5 to 10 s counts: late ones don't hold it back. Once known it doesn't jump:
    it's corrected by at most 0.1 s a second, so that it never runs back.
    """

    def __init__(self) -> None:
        self._newer: float | None = None
        self._older: float | None = None
        self._turned = 0.0
        self._aim = 0.0
        self._offset: float | None = None
        self._at = 0.0

    def heard(self, t: float, *, now: float) -> None:
        """Note that at the user's time now [s] a message came that was about t [s]."""
        offset = self._offset_at(now)
        if self._newer is None or now - self._turned >= LIVE_WINDOW:
            self._older, self._newer, self._turned = self._newer, t - now, now
        else:
            self._newer = max(self._newer, t - now)
        self._aim = self._newer if self._older is None else max(self._newer, self._older)
        self._offset, self._at = self._aim if offset is None else offset, now

    def at(self, now: float) -> float | None:
        """The newest time [s] at the user's time now [s]; None before the first message."""
        offset = self._offset_at(now)
        return None if offset is None else now + offset

    def _offset_at(self, now: float) -> float | None:
        if self._offset is None:
            return None
        most = SLEW * max(now - self._at, 0.0)
        return self._offset + min(max(self._aim - self._offset, -most), most)


@dataclass(frozen=True, slots=True)
class _Running:
    """Running from a place at a rate."""

    since: float
    place: float
    rate: float
    loop: tuple[float, float] | None = None
    """A range that it doesn't leave once it's there [s]."""

    def at(self, now: float) -> float:
        """Where it is [s]."""
        place = self.place + self.rate * (now - self.since)
        if self.loop is None:
            return place
        start, end = self.loop
        if self.rate > 0 and place >= end:
            return start + (place - end) % (end - start)
        if self.rate < 0 and place < start:
            return end - (start - place) % (end - start)
        return place


@dataclass(frozen=True, slots=True)
class _Chase:
    """Closing a gap to the live edge: a cubic in time, that ends without a gap and at its pace."""

    before: _Running
    """What it does until it begins."""
    since: float
    duration: float
    gap: float
    slope: float
    """Rate at which the gap changes at first [s/s]."""

    def left(self, now: float) -> float:
        """What is left of the gap [s]."""
        s = min(max((now - self.since) / self.duration, 0.0), 1.0)
        return (1 - s) ** 2 * (self.gap * (1 + 2 * s) + self.duration * self.slope * s)


class PlayHead:
    """Where a viewer is in time. It starts live, and moves only as its own viewer says.

    While it goes live it doesn't jump: its rate stays within ±10, but for the live edge's own corrections, and from
    behind it never runs back. Played on to the live edge, it stays there, live.

    In a loop what runs forwards goes on from the loop's start when it comes to its end, and backwards the other way
    round; what is sought behind the end runs on freely, and so does what is sought before the start and runs back.
    """

    def __init__(
        self, live: Callable[[float], float | None], span: Callable[[], tuple[float, float] | None]
    ) -> None:
        """Begin at the live edge.

        Args:
            live: The newest time [s] at a user's time [s]; None while that isn't known, −∞ where nothing is live:
                then it begins at the start, and never goes live.
            span: Start and end of the timeline [s]; None while that isn't known.
        """
        self._live, self._span = live, span
        self._motion: _Running | _Chase | None = None
        self.mode = Mode.LIVE
        """What it does; only read."""
        self.loop: tuple[float, float] | None = None
        """Start and end of the loop [s]; None without one. Only read."""
        self.rate = 1.0
        """Rate of play [timeline s / user s], negative to rewind; only read."""

    def position(self, now: float) -> float | None:
        """The time to show [s] at the user's time now [s]; None while nothing is known of the live edge."""
        place, arrived = self._place(now)
        if arrived:
            self._motion, self.mode = None, Mode.LIVE
        return place

    def ahead(self, t_user: float) -> float | None:
        """The time to show [s] at a user's time to come [s], if nobody moves it; None while that isn't known."""
        return self._place(t_user)[0]

    def _place(self, now: float) -> tuple[float | None, bool]:
        """Where it is, and whether it has come to the live edge."""
        live, motion = self._live(now), self._motion
        if live is None or motion is None:
            return (self._start() if live == -math.inf else live), False
        if isinstance(motion, _Chase) and now >= motion.since:
            arrived = now >= motion.since + motion.duration
            return (live if arrived else live - motion.left(now)), arrived
        run = motion.before if isinstance(motion, _Chase) else motion
        place = run.at(now)
        if run.rate > 1 and run.loop is None and run.place < live <= place:
            return live, True
        return self._within(place, live), False

    def _start(self) -> float | None:
        span = self._span()
        return None if span is None else span[0]

    def _run(self, now: float, place: float, rate: float) -> _Running:
        """A run from a place, bound by the loop unless it has left that behind."""
        loop = self.loop
        bound = loop is not None and (place <= loop[1] if rate > 0 else place >= loop[0])
        return _Running(now, place, rate, loop if bound and rate else None)

    def _within(self, place: float, live: float) -> float:
        span = self._span()
        return place if span is None else min(max(place, span[0]), max(span[1], live))

    def play(self, *, now: float, rate: float | None = None) -> None:
        """Run at a rate from where it is.

        Args:
            now: The user's time [s].
            rate: −10 to 10, but not 0: `pause` is for that; the rate that was last set unless given.

        Raises:
            InvalidValueError: If rate is out of range, or 0.
        """
        allowed = "−10 to 10, but not 0"
        rate = finite("rate", self.rate if rate is None else rate, allowed)
        if rate == 0 or abs(rate) > FASTEST:
            raise InvalidValueError("rate", rate, allowed)
        self.rate = rate
        self._move(now, rate, Mode.PLAYING)

    def pause(self, *, now: float) -> None:
        """Stand where it is."""
        self._move(now, 0.0, Mode.PAUSED)

    def step(self, dt: float, *, now: float) -> None:
        """Stand dt [s] further on, or back where it's negative."""
        dt = finite("dt", dt, "finite seconds")
        self.pause(now=now)
        if self.mode is Mode.PAUSED:
            place = self.position(now)
            assert place is not None
            self.seek(place + dt, now=now)

    def set_loop(self, start: float, end: float, *, now: float) -> None:
        """Loop a range. What is outside goes to its start, or to its end where it rewinds; what was live plays.

        Args:
            start: Where the range begins [s]; what lies outside the timeline is left out.
            end: Where it ends [s].
            now: The user's time [s].

        Raises:
            InvalidValueError: If less than 0.01 s is left of it.
        """
        allowed = f"a range of at least {SHORTEST} s in the timeline"
        start, end = finite("loop", start, allowed), finite("loop", end, allowed)
        live, span, given = self._live(now), self._span(), (start, end)
        if span is not None:
            high = span[1] if live is None else max(span[1], live)
            start, end = max(start, span[0]), min(end, high)
        if end - start < SHORTEST - 1e-9:
            raise InvalidValueError("loop", given, allowed)
        place = self.position(now)
        self.loop = start, end
        if place is None:
            return
        inside = self.mode in {Mode.PAUSED, Mode.PLAYING} and start <= place <= end
        self.seek(place if inside else end if self.rate < 0 else start, now=now)

    def clear_loop(self, *, now: float) -> None:
        """Loop no more; it goes on as it does."""
        place = self.position(now)
        self.loop = None
        if place is not None and self.mode is Mode.PLAYING:
            self._motion = _Running(now, place, self.rate)

    def rewind(self, *, now: float, rate: float = 1.0) -> None:
        """Run backwards at a rate above 0, 10 at most."""
        self.play(now=now, rate=-abs(rate))

    def set_rate(self, rate: float, *, now: float) -> None:
        """Change the rate; what stands or is live stays so until it plays.

        Raises:
            InvalidValueError: If rate is out of range.
        """
        mode, motion = self.mode, self._motion
        self.play(now=now, rate=rate)
        if mode is not Mode.PLAYING:
            self.mode, self._motion = mode, motion

    def seek(self, t: float, *, now: float) -> None:
        """Go to a time [s] at once, past or planned.

        What stood stands there; all else plays on from there at its rate, and isn't live any more.
        """
        t = finite("t", t, "finite seconds")
        self.position(now)
        standing = self.mode is Mode.PAUSED
        self.mode = Mode.PAUSED if standing else Mode.PLAYING
        live = self._live(now)
        place = t if live is None else self._within(t, live)
        self._motion = self._run(now, place, 0.0 if standing else self.rate)

    def go_live(self, *, now: float, wait: float = 0.0) -> float:
        """Catch up with the live edge, and loop no more. Where nothing is live, nothing happens.

        A gap g, in the past or ahead, takes max(0.5 s, 1.5 g / 8).

        Args:
            now: The user's time [s].
            wait: How long it goes on as before, at first [s], for what's needed to come.

        Returns:
            The user's time when it will be live [s].
        """
        place, live = self.position(now), self._live(now)
        if live == -math.inf:
            return now
        self.loop = None
        if place is None or live is None or self.mode is Mode.LIVE:
            self._motion, self.mode = None, Mode.LIVE
            return now
        rate, since = self._pace(now), now + wait
        before = _Running(now, place, rate)
        live = live + wait
        gap = live - self._within(place + rate * wait, live)
        duration = max(QUICKEST, 1.5 * abs(gap) / (FASTEST - 2.0))
        steepest = 3.0 * abs(gap) / duration
        slope = min(max(1.0 - rate, -1.0), 1.0)
        slope = max(slope, -steepest) if gap > 0 else min(max(slope, 0.0), steepest)
        self._motion, self.mode = _Chase(before, since, duration, gap, slope), Mode.CATCHING_UP
        return since + duration

    def _pace(self, now: float) -> float:
        motion = self._motion
        if isinstance(motion, _Chase) and now > motion.since:
            h = 1e-6
            return 1.0 - (motion.left(now) - motion.left(now - h)) / h
        run = motion.before if isinstance(motion, _Chase) else motion
        return 1.0 if run is None else run.rate

    def _move(self, now: float, rate: float, mode: Mode) -> None:
        place = self.position(now)
        if place is None:
            self._motion, self.mode = None, Mode.LIVE
        else:
            self._motion, self.mode = self._run(now, place, rate), mode
