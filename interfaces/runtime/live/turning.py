"""What wakes a state machine in an event loop: something came, or its deadline is there."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable

from vrs.clock import Clock

LONGEST = 0.25
"""Longest time between two turns [s]."""


class Turning:
    """Calls `turn` when it's due and when it's asked for, never twice at once; it says when it's due next."""

    def __init__(self, clock: Clock, turn: Callable[[float], float | None]) -> None:
        """Begin with `start`.

        Args:
            clock: Whose time is given to `turn`, and in which deadlines are.
            turn: Does what is due by a time [s]; returns when something is due next [s], or None.
        """
        self._clock, self._turn = clock, turn
        self._timer: asyncio.TimerHandle | None = None
        self._asked = False
        self.running = False
        self.latest = 0.0
        """How late the latest deadline of all was noticed [s]."""

    def start(self) -> None:
        """Turn from now on; where the loop runs."""
        self.running = True
        self.soon()

    def stop(self) -> None:
        """Turn no more."""
        self.running = False
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def soon(self) -> None:
        """Turn as soon as the loop comes round."""
        if self.running and not self._asked:
            self._asked = True
            asyncio.get_running_loop().call_soon(self._now)

    def _now(self) -> None:
        self._asked = False
        if not self.running:
            return
        deadline = self._turn(self._clock.now())
        if self._timer is not None:
            self._timer.cancel()
        wait = LONGEST if deadline is None or math.isinf(deadline) else deadline - self._clock.now()
        due = self._clock.now() + max(wait, 0.0)
        self._timer = asyncio.get_running_loop().call_later(min(max(wait, 0.0), LONGEST), self._timed, due)

    def _timed(self, due: float) -> None:
        self.latest = max(self.latest, self._clock.now() - due)
        self._now()
