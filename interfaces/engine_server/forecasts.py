"""What became of predicted frames: confirmed when their time has passed, falsified by the first command."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from interfaces.messages import FrameStatus, FrameVerdict
from vrs.model import Array
from vrs.timeline import Timeline

CHANGED = 1e-9
"""A frame whose joints differ by more [rad] was changed."""

WINDOW = 4096
"""Frames that wait for their time to pass, and verdicts that are kept, at most."""

Culprit: TypeAlias = Callable[[float], int | None]
"""The command by which an edit changed what happens at a time [s]; None where nobody knows."""


class Forecasts:
    """Frames of one reader that showed a time later than the engine's present.

    The past never changes: once its time has passed, a frame that no command changed is confirmed for good. What a
    command changed stays falsified by it, also if a later one brings the same motion back. An edit is compared at
    the times of the frames that wait, whatever its receipt says: all of them at once, 0.1 ms for a hundred.
    """

    def __init__(self, window: int = WINDOW) -> None:
        """Wait for nothing.

        Args:
            window: Most frames that wait, and most verdicts kept, ≥ 1. The oldest is dropped first; it stays
                predicted, and is counted in `dropped`.
        """
        self._window = window
        self._waiting: dict[int, tuple[float, Array]] = {}
        self._times: list[tuple[float, int]] = []
        self._verdicts: dict[int, FrameVerdict] = {}
        self.confirmed = 0
        """Predicted frames that came true."""
        self.falsified = 0
        """Predicted frames that a command changed."""
        self.dropped = 0
        """Predicted frames that weren't watched to the end."""
        self.forgotten = 0
        """Number of the newest of them."""

    def add(self, number: int, t: float, q: Array, *, now: float) -> FrameStatus:
        """Note a frame, and say what it is at first.

        Args:
            number: Its number; higher than those before.
            t: Time it shows [s].
            q: What it shows [rad], (n,); not changed afterwards.
            now: The engine's time [s]; −∞ where no time is past, as in the offline mode.
        """
        if t <= now:
            return FrameStatus.CONFIRMED
        self._waiting[number] = t, q
        heapq.heappush(self._times, (t, number))
        if len(self._waiting) > self._window:
            self.forgotten = next(iter(self._waiting))
            del self._waiting[self.forgotten]
            self.dropped += 1
        if len(self._times) > 2 * self._window:
            self._times = sorted((t, number) for number, (t, _) in self._waiting.items())
        return FrameStatus.PREDICTED

    def edited(self, timeline: Timeline, culprit: Culprit) -> tuple[FrameVerdict, ...]:
        """Compare what waits with a new timeline; the frames that it falsifies.

        Args:
            timeline: As the edit left it.
            culprit: Who is to blame.
        """
        if not self._waiting:
            return ()
        numbers = list(self._waiting)
        t = np.array([waiting[0] for waiting in self._waiting.values()])
        q = np.array([waiting[1] for waiting in self._waiting.values()])
        wrong = np.flatnonzero(np.abs(timeline.sample(t) - q).max(axis=1) > CHANGED)
        found = [FrameVerdict(numbers[i], FrameStatus.FALSIFIED, culprit(float(t[i]))) for i in wrong.tolist()]
        for verdict in found:
            del self._waiting[verdict.number]
            self.falsified += 1
            self._keep(verdict)
        return tuple(found)

    def settle(self, now: float) -> tuple[FrameVerdict, ...]:
        """The frames that are confirmed now that the engine's clock shows `now` [s]."""
        found = []
        while self._times and self._times[0][0] <= now:
            number = heapq.heappop(self._times)[1]
            if self._waiting.pop(number, None) is not None:
                found.append(FrameVerdict(number, FrameStatus.CONFIRMED))
                self.confirmed += 1
                self._keep(found[-1])
        return tuple(found)

    def _keep(self, verdict: FrameVerdict) -> None:
        self._verdicts[verdict.number] = verdict
        if len(self._verdicts) > self._window:
            del self._verdicts[next(iter(self._verdicts))]

    def verdict(self, number: int) -> FrameVerdict | None:
        """What became of a predicted frame; None while it waits, if it never did, or where it's forgotten."""
        return self._verdicts.get(number)

    def waits(self, number: int) -> bool:
        """Whether a frame's time is still to come."""
        return number in self._waiting

    @property
    def oldest(self) -> float:
        """Lowest number that waits; infinity where none does."""
        return next(iter(self._waiting), math.inf)

    @property
    def share_falsified(self) -> float | None:
        """Share of the predicted frames with a verdict that were falsified; None before the first verdict."""
        settled = self.confirmed + self.falsified
        return self.falsified / settled if settled else None
