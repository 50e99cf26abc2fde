"""Deadlines of sans-I/O machines on an asyncio loop."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from vrs.clock import Clock


class Lateness:
    """How late timers fired: what the machine adds to the delays of the model."""

    def __init__(self) -> None:
        self.count = 0
        self.total = self.worst = 0.0

    def add(self, seconds: float) -> None:
        """Count a deadline met `seconds` late."""
        self.count += 1
        self.total += seconds
        self.worst = max(self.worst, seconds)

    @property
    def mean(self) -> float | None:
        """Mean lateness [s]; None before the first deadline."""
        return self.total / self.count if self.count else None


class Timer:
    """Calls back once when a deadline has come, by an injected clock.

    Args:
        clock: Tells the time of the deadlines.
        callback: Called at the deadline, never before.
        lateness: Told by how much later.
    """

    def __init__(self, clock: Clock, callback: Callable[[], None], lateness: Lateness) -> None:
        self._clock, self._callback, self._lateness = clock, callback, lateness
        self._deadline: float | None = None
        self._handle: asyncio.TimerHandle | None = None

    def set(self, deadline: float | None) -> None:
        """Wait for another deadline [s]; None for none."""
        if deadline == self._deadline:
            return
        if self._handle is not None:
            self._handle.cancel()
        self._deadline, self._handle = deadline, None
        if deadline is not None:
            wait = max(0.0, deadline - self._clock.now())
            self._handle = asyncio.get_running_loop().call_later(wait, self._fire)

    def _fire(self) -> None:
        deadline, self._deadline, self._handle = self._deadline, None, None
        if deadline is None:
            return
        late = self._clock.now() - deadline
        if late < 0:
            self.set(deadline)
            return
        self._lateness.add(late)
        self._callback()
