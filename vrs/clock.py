"""Clocks: the only place that reads one. Every clock answers `now()` in seconds of its own timeline."""

from __future__ import annotations

import math
import time
from datetime import UTC, datetime
from typing import Protocol

from vrs.checks import finite, not_before
from vrs.errors import InvalidValueError


class Clock(Protocol):
    """Anything that tells the time of a timeline."""

    def now(self) -> float:
        """Present time [s]; never runs back."""


class ManualClock:
    """A clock that stands until it's moved."""

    def __init__(self, now: float = 0.0) -> None:
        self._now = finite("now", now, "finite seconds")

    def now(self) -> float:
        """Present time [s]."""
        return self._now

    def advance(self, dt: float) -> float:
        """Move on by dt ≥ 0 [s] and return the new time.

        Raises:
            InvalidValueError: If dt is negative or not finite.
        """
        step = finite("dt", dt, "finite seconds ≥ 0")
        if step < 0:
            raise InvalidValueError("dt", dt, "finite seconds ≥ 0")
        self._now += step
        return self._now

    def set(self, now: float) -> None:
        """Move on to `now` [s], not before the present.

        Raises:
            InvalidValueError: If now lies before the present time.
        """
        self._now = not_before("now", now, self._now, "at or after the present, {} s")


class WallClock:
    """Seconds since the clock was made, from the machine's monotonic counter."""

    def __init__(self, now: float = 0.0) -> None:
        self.origin = time.monotonic() - finite("now", now, "finite seconds")
        """The machine's monotonic counter [s] when this clock shows 0; it counts alike in all processes."""

    @classmethod
    def since(cls, origin: float) -> WallClock:
        """Make the very clock of another process of this machine, given its origin."""
        clock = cls()
        clock.origin = finite("origin", origin, "finite seconds")
        return clock

    def now(self) -> float:
        """Present time [s]."""
        return time.monotonic() - self.origin


def seconds_since_1970() -> float:
    """The machine's calendar time [s], which may step: for names and files, never for motion."""
    return time.time()


def utc(seconds: float) -> datetime:
    """What the calendar of UTC has, so long after the beginning of 1970 [s]."""
    return datetime.fromtimestamp(seconds, UTC)


def processor_time() -> float:
    """Processor time of this thread so far [s]: it stands still while others have the processor."""
    return time.thread_time()


class OffsetClock:
    """Another clock, shifted: t_engine = t_user + D. Source: Doulgeri et al., section IV-A."""

    def __init__(self, base: Clock, D: float) -> None:
        self._base = base
        self.D = finite("D", D, "finite seconds")

    def now(self) -> float:
        """Present time [s]."""
        return self._base.now() + self.D


class SlewedClock:
    """Another clock, shifted by a D that changes gently: the clock never runs back and never jumps.

    Its rate stays within [1 − slew, 1 + slew] times its base's. Its reading depends on the base's alone, not on how
    often it's asked.

    Args:
        base: The clock that sets the pace.
        D: Shift at the start [s].
        slew: Largest change of D a second of the base, in (0, 1).

    Raises:
        InvalidValueError: If D isn't finite or slew is out of range.
    """

    def __init__(self, base: Clock, D: float = 0.0, slew: float = 0.05) -> None:
        self._base = base
        self.slew = finite("slew", slew, "in (0, 1)")
        if not 0 < self.slew < 1:
            raise InvalidValueError("slew", slew, "in (0, 1)")
        self._target = finite("D", D, "finite seconds")
        self._rate = 1.0
        self._turn = self._settled = self._base.now()
        self._reading = self._latest = self._turn + self._target

    def now(self) -> float:
        """Present time [s]."""
        self._latest = max(self._latest, self._at(self._base.now()))
        return self._latest

    @property
    def D(self) -> float:
        """Present shift [s]."""
        t = self._base.now()
        return self._at(t) - t

    @property
    def target(self) -> float:
        """The shift that it has or is on the way to [s]."""
        return self._target

    def follow(self, D: float) -> None:
        """From now on move towards the shift D [s], as fast as slew allows.

        To follow another clock, hand over its reading less the base's, as often as that changes.

        Raises:
            InvalidValueError: If D isn't finite.
        """
        target = finite("D", D, "finite seconds")
        t = self._base.now()
        self._reading = self._at(t)
        gap = target - (self._reading - t)
        self._turn, self._settled = t, t + abs(gap) / self.slew
        self._rate = 1 + math.copysign(self.slew, gap)
        self._target = target

    def _at(self, t: float) -> float:
        if t >= self._settled:
            return t + self._target
        return self._reading + self._rate * (t - self._turn)
