"""The period T at which a local system sends, fitted to the link while it runs.

What a sender can change of a link is the queue that it makes itself. The least round trip over half a second, less
the least over the last minute, is what always waits in queues, whatever the jitter. While that is too much and
doesn't fall, the period is made longer; where it's little, shorter again, down to what was asked for. A link that
is slow by itself doesn't get better by fewer packets: if the longest period hasn't helped, the least one is taken
for a while.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from interfaces.rsp.motion_filter import Fastest
from vrs.checks import validated, within
from vrs.errors import InvalidValueError


@dataclass(frozen=True, slots=True)
@validated
class PeriodConfig:
    """Within what T is chosen."""

    least: Annotated[float, within(1e-3, 1.0)] = 0.02
    """T on a good link [s], in [0.001, 1]."""
    most: Annotated[float, within(1e-3, 1.0)] = 0.2
    """T at most [s], from `least` to 1."""
    adaptive: bool = True
    """Whether it's fitted at all."""
    window: Annotated[float, within(0.1, 60.0)] = 0.5
    """Over how long a least round trip is taken [s], in [0.1, 60]."""
    base: Annotated[float, within(1.0, 3600.0)] = 60.0
    """Over how long the link's own is looked for [s], in [1, 3600]."""
    queue: Annotated[float, within(1e-3, 10.0)] = 0.05
    """Standing queue that is too long [s], in [0.001, 10]."""
    longer: Annotated[float, within(1.0, 4.0)] = 1.5
    """What T is multiplied by then, in (1, 4]."""
    shorter: Annotated[float, within(0.1, 1.0)] = 0.9
    """And otherwise, in [0.1, 1)."""
    steps: Annotated[int, within(1, 20)] = 8
    """Windows at the longest T in which the queue must have fallen, 1 to 20."""
    rest: Annotated[float, within(0.0, 3600.0)] = 20.0
    """How long T is left at its least after it hadn't [s], in [0, 3600]."""

    def __post_init__(self) -> None:
        if self.most < self.least:
            raise InvalidValueError("most", self.most, f"at least {self.least:g} s, the least period")


class PeriodControl:
    """Chooses T; it knows no clock."""

    def __init__(self, config: PeriodConfig | None = None) -> None:
        """Begin with the least period."""
        self._config = PeriodConfig() if config is None else config
        self.T = self._config.least
        """Period [s]."""
        self._base = Fastest(self._config.base)
        self._least = math.inf
        self._until = -math.inf
        self._tried = 0
        self._before = math.inf
        self._rest = self._since = -math.inf

    def round_trip(self, seconds: float, *, now: float) -> None:
        """Take a packet's round trip [s], known at a time [s]."""
        config = self._config
        if not config.adaptive:
            return
        if self._until == -math.inf:
            self._until = now + config.window
        self._base.add(seconds, now)
        self._least = min(self._least, seconds)
        if now < self._until:
            return
        least, self._least = self._least, math.inf
        queue = least - self._base.value
        self._until = now + config.window
        falls, self._before = queue < 0.8 * self._before, queue
        if queue <= config.queue:
            self.T, self._tried = max(config.least, config.shorter * self.T), 0
        elif now >= self._rest and not falls:
            self._slow_down(least, now)

    def _slow_down(self, round_trip: float, now: float) -> None:
        """Make the period longer; at its longest give up when that doesn't help, once it could have been seen."""
        config = self._config
        if config.most > self.T:
            self._since = now
        self._tried = self._tried + 1 if config.most <= self.T else 0
        self.T = min(config.most, config.longer * self.T)
        if self._tried >= config.steps and now - self._since > 2 * round_trip:
            self.T, self._tried, self._rest = config.least, 0, now + config.rest
