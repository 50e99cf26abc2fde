"""The command filter: gives back to late commands the spacing that they were issued with.

The coupled DEVS model of Han, Kim, Kim, Kim, eq. (11)–(13). What arrives is queued; the generator takes one
command at a time and gives it out an interval after it took it: the sampling time T, or in the modified filter of
Fig. 8 the processing time T_p. A command that finds the filter empty is thus given out one interval after it came.

What happens at one instant: the queue passes on, then commands arrive, then the generator gives out. That's the
model's Select, which prefers the queue, the component that arrivals go to.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Annotated, Generic, TypeVar

from vrs.checks import not_before, validated, within

Command = TypeVar("Command")


@dataclass(frozen=True, slots=True)
@validated
class CommandFilterConfig:
    """How a command filter works."""

    interval: Annotated[float, within(1e-6, 60.0, "s")] = 0.1
    """Time advance of the busy generator [s]: T, or T_p where it's modified, in [1e-6, 60]."""
    capacity: Annotated[int, within(1, 10000000)] = 36_000
    """Most commands in the filter, in [1, 10⁷]: queued, in the generator, or given out and not yet fetched."""


class CommandFilter(Generic[Command]):
    """A queue and a generator. It knows no clock; whoever drives it calls `advance` at `next_deadline`."""

    def __init__(self, config: CommandFilterConfig | None = None) -> None:
        """Start empty."""
        self._config = CommandFilterConfig() if config is None else config
        self._queue: deque[Command] = deque()
        self._outputs: list[tuple[float, Command]] = []
        self._busy: list[Command] = []
        self._due = math.inf
        self._now = -math.inf
        self.refused = 0
        """Commands that came when the filter was full. Each leaves a hole in what the robot drives."""

    def __len__(self) -> int:
        """How many commands are in the filter."""
        return len(self._queue) + len(self._busy) + len(self._outputs)

    @property
    def waiting(self) -> int:
        """n, how many commands are queued."""
        return len(self._queue)

    def receive(self, command: Command, *, now: float) -> bool:
        """Take in a command; what is due at the same time comes after it.

        Args:
            command: Anything.
            now: Time [s], not before the last one.

        Returns:
            Whether it was taken. A full filter refuses the newest command and counts it; an older one would be
            missed just as much, and its place in the order with it.

        Raises:
            InvalidValueError: If the time runs backwards or isn't finite.
        """
        self._run(self._time(now), inclusive=False)
        if len(self) >= self._config.capacity:
            self.refused += 1
            return False
        self._queue.append(command)
        if not self._busy:
            self._pass(now)
        return True

    def advance(self, *, now: float) -> list[tuple[float, Command]]:
        """Do what is due by now [s].

        Returns:
            What was given out since the last call, in order: when [s], and the command.

        Raises:
            InvalidValueError: If the time runs backwards or isn't finite.
        """
        self._run(self._time(now), inclusive=True)
        outputs, self._outputs = self._outputs, []
        return outputs

    def next_deadline(self) -> float | None:
        """When the next command is given out [s]; None while the filter is empty."""
        if self._outputs:
            return self._outputs[0][0]
        return self._due if self._busy else None

    def _time(self, now: float) -> float:
        self._now = not_before("now", now, self._now, "{} or later: time doesn't run backwards")
        return self._now

    def _run(self, now: float, *, inclusive: bool) -> None:
        while self._due < now or (inclusive and self._due == now):
            t, self._due = self._due, math.inf
            self._outputs.append((t, self._busy.pop()))
            if self._queue:
                self._pass(t)

    def _pass(self, t: float) -> None:
        self._busy.append(self._queue.popleft())
        self._due = t + self._config.interval
