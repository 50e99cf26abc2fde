"""What wakes a state machine in an asyncio loop: its deadline is there, or something came."""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable

from vrs.clock import Clock

LONGEST = 0.25
"""Longest time between two turns [s], if nothing else is said."""
AGAIN = 0.05
"""Time after which a turn that failed is tried again [s]."""
TOLD = 20
"""Failures of which the log tells."""
_LOG = logging.getLogger(__name__)


class TimerLateness:
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

    def __init__(self, clock: Clock, callback: Callable[[], None], lateness: TimerLateness) -> None:
        self._clock, self._callback, self.lateness = clock, callback, lateness
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
        self.lateness.add(late)
        self._callback()


class Turning:
    """Calls `turn` when it's due and when it's asked for, never twice at once; it says when it's due next."""

    def __init__(self, clock: Clock, turn: Callable[[float], float | None], *, longest: float = LONGEST) -> None:
        """Begin with `start`.

        Args:
            clock: Whose time is given to `turn`, and in which deadlines are.
            turn: Does what is due by a time [s]; returns when something is due next [s], or None.
            longest: Longest time between two turns [s]; may be infinite.
        """
        self._clock, self._turn, self._longest = clock, turn, longest
        self._asked = False
        self.running = False
        self.failures = 0
        """Turns that raised."""
        self.lateness = TimerLateness()
        """How late turns began that were due; a deadline that was past already counts from when it was known."""
        self._timer = Timer(clock, self._now, self.lateness)

    def start(self) -> None:
        """Turn from now on; where the loop runs."""
        self.running = True
        self.soon()

    def stop(self) -> None:
        """Turn no more."""
        self.running = False
        self._timer.set(None)

    def soon(self) -> None:
        """Turn as soon as the loop comes round."""
        if self.running and not self._asked:
            self._asked = True
            asyncio.get_running_loop().call_soon(self._now)

    def _now(self) -> None:
        self._asked = False
        if not self.running:
            return
        try:
            deadline = self._turn(self._clock.now())
        except Exception:  # noqa: BLE001 - whatever it is, the next turn comes
            # Whoever waits for the next turn gets it: a robot must not wait for ever for what failed once.
            self.failures += 1
            if self.failures <= TOLD:
                _LOG.exception("a turn failed; it's tried again in %g s", AGAIN)
            deadline = self._clock.now() + AGAIN
        now = self._clock.now()
        due = now + self._longest
        if deadline is not None:
            due = min(max(deadline, now), due)
        self._timer.set(due if due < math.inf else None)
