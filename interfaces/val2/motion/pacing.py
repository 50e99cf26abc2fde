"""Monitor speed: the pace of what is scheduled, and of motions to come."""

from __future__ import annotations

import math
from typing import Final

from interfaces.val2.motion.robot import RobotPort
from vrs.commands import ScaleTime

_AGAIN: Final = 0.05
"""After how long a change that was refused is asked for again at the earliest [s]."""


class MonitorSpeed:
    """The monitor speed that is wanted, and that which the timeline has.

    The way to a slower pace takes a while, during which a faster one may be refused; it's asked for again then.
    """

    def __init__(self, robot: RobotPort) -> None:
        self._robot = robot
        self.wanted = self._held = self._asked = 100.0
        self._number: int | None = None
        self._changed = self._again = -math.inf

    @property
    def pace(self) -> float:
        """Of motions that are asked for now."""
        return self._held / 100.0

    @property
    def waits(self) -> bool:
        """Whether a change has no answer yet."""
        return self._number is not None

    def set(self, percent: float, *, now: float) -> None:
        """Want another speed [%], above 0; at most 100 count."""
        self.wanted, self._again = min(max(percent, 0.1), 100.0), now
        self.advance(now=now)

    def advance(self, *, now: float) -> None:
        """Take the answer to what was asked, and ask for what is wanted."""
        self._hear(now)
        if self.wanted == self._held or self.waits or now < self._again:
            return
        if now >= self._robot.timeline.end:
            self._held = self.wanted
            return
        self._asked = self.wanted
        self._number = self._robot.ask(ScaleTime(self.wanted / self._held), now=now)
        self._hear(now)

    def _hear(self, now: float) -> None:
        fate = None if self._number is None else self._robot.fate(self._number, now=now)
        if fate is None:
            return
        self._number = None
        if fate.reason:
            self._again = max(self._changed, now + _AGAIN)
        else:
            self._held = self._asked
            self._changed = now if fate.receipt is None or fate.receipt.end is None else fate.receipt.end

    def next_deadline(self) -> float:
        """When something is to be asked for again [s]; infinity for never."""
        return self._again if self.wanted != self._held and not self.waits else math.inf
