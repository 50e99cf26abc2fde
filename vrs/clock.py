"""Clocks: the only place that reads one. Every clock answers `now()` in seconds of its own timeline."""

from __future__ import annotations

import time
from typing import Protocol

from vrs.commands import finite
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
        time_ = finite("now", now, "finite seconds")
        if time_ < self._now:
            raise InvalidValueError("now", now, f"at or after the present, {self._now} s")
        self._now = time_


class WallClock:
    """Seconds since the clock was made, from the machine's monotonic counter."""

    def __init__(self, now: float = 0.0) -> None:
        self._origin = time.monotonic() - finite("now", now, "finite seconds")

    def now(self) -> float:
        """Present time [s]."""
        return time.monotonic() - self._origin


class OffsetClock:
    """Another clock, shifted: t_engine = t_user + D. Source: Doulgeri et al., section IV-A."""

    def __init__(self, base: Clock, D: float) -> None:
        self._base = base
        self.D = finite("D", D, "finite seconds")

    def now(self) -> float:
        """Present time [s]."""
        return self._base.now() + self.D
