"""The motion filter on board: late commands are put right, missing ones filled in.

Every value carries its sender's stamp. The filter plays values at their stamps plus an offset: the delay of the
fastest packet lately, and `playout`. What comes in time is played with the spacing that it was sent with. Of
commands that come together, late, all but the newest that is due are skipped: the cumulative commands of Fig. 5 are
corrected. What is missing is held, or lies on the line between its neighbours where the later one is there in time.

Source: Kim, Suh, Kim, Oh, Fig. 5; it names both and gives no formula.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from interfaces.rsp.model.elements import Effector, Filling, RobotModel
from vrs.checks import validated, within

Values = tuple[float, ...]
_MOST = 64
"""Values that wait for their time, of an effector."""


@dataclass(frozen=True, slots=True)
@validated
class MotionFilterConfig:
    """How the filter plays."""

    playout: Annotated[float, within(0.0, 1.0, "s")] = 0.02
    """How much later than the fastest packet it plays [s], in [0, 1]: what may be filled in between, and delay."""
    window: Annotated[float, within(0.1, 600.0, "s")] = 10.0
    """Over how long the fastest packet is looked for [s], in [0.1, 600]."""


class Fastest:
    """The least of what was added over the last window, or two."""

    def __init__(self, window: float) -> None:
        """Begin without a value."""
        self._window = window
        self._since = -math.inf
        self._now = self._before = math.inf

    @property
    def value(self) -> float:
        """The least; infinity before the first."""
        return min(self._now, self._before)

    def add(self, value: float, now: float) -> None:
        """Add a value at a time [s]."""
        if now - self._since >= self._window:
            self._before = self._now if now - self._since < 2 * self._window else math.inf
            self._now, self._since = value, now
        else:
            self._now = min(self._now, value)


class _Track:
    """What one effector was told."""

    def __init__(self, effector: Effector) -> None:
        self.linear = effector.filling is Filling.LINEAR
        self.whole = effector.type.whole
        self.stamps: list[float] = [-math.inf]
        self.values: list[Values] = [(effector.initial,) * effector.count]
        self.given = self.values[0]

    def put(self, stamp: float, values: Values) -> None:
        self.stamps.append(stamp)
        self.values.append(values)
        if len(self.stamps) > _MOST:
            del self.stamps[0], self.values[0]

    def at(self, t: float) -> tuple[Values, int]:
        """The values at a sender's time, and how many were skipped on the way."""
        k = bisect_right(self.stamps, t) - 1
        if k > 0:
            del self.stamps[:k], self.values[:k]
        values = self.values[0]
        if self.linear and k >= 0 and len(self.stamps) > 1 and self.stamps[0] > -math.inf:
            share = (t - self.stamps[0]) / (self.stamps[1] - self.stamps[0])
            mixed = (a + share * (b - a) for a, b in zip(values, self.values[1], strict=True))
            values = tuple(float(round(v)) for v in mixed) if self.whole else tuple(mixed)
        return values, max(k - 1, 0)


class MotionFilter:
    """Plays what effectors were told; it knows no clock."""

    def __init__(self, model: RobotModel, config: MotionFilterConfig | None = None) -> None:
        """Begin with the effectors' initial values."""
        self._config = MotionFilterConfig() if config is None else config
        self._tracks = {
            index: _Track(element)
            for index, element in enumerate(model)
            if isinstance(element, Effector) and not element.stream
        }
        self._fastest = Fastest(self._config.window)
        self._newest = -math.inf
        self._stamps: deque[float] = deque(maxlen=_MOST)
        self.playing: float | None = None
        """Stamp of the newest packet whose time has come [s]; None before the first."""
        self.skipped = 0
        """Values that a newer one overtook before their time came."""

    def receive(self, stamp: float, told: Mapping[int, Values], *, now: float, fresh: bool = True) -> None:
        """Take the effectors' values of a packet.

        Args:
            stamp: When it was made, on the sender's clock [s]; one before the last one's counts as that, so that
                whoever sets his clock back is followed all the same.
            told: Values by effector; of the others nothing changed.
            now: When it came, on the robot's clock [s].
            fresh: Whether it was sent when it was made: what is repeated says nothing of the link.
        """
        stamp = max(stamp, math.nextafter(self._newest, math.inf))
        if fresh:
            self._fastest.add(now - stamp, now)
        for index, track in self._tracks.items():
            values = told.get(index)
            if values is not None:
                track.put(stamp, values)
            elif track.linear and track.stamps[-1] > -math.inf:
                # Unchanged up to here: what comes next begins here, not where it was last told.
                if len(track.stamps) > 1 and track.values[-2] == track.values[-1]:
                    track.stamps[-1] = stamp
                else:
                    track.put(stamp, track.values[-1])
        self._newest = stamp
        self._stamps.append(stamp)

    def play(self, now: float) -> dict[int, Values]:
        """What effectors are to do from now on [s], of those for which it changed."""
        t = now - self._fastest.value - self._config.playout
        while self._stamps and self._stamps[0] <= t:
            self.playing = self._stamps.popleft()
        changed = {}
        for index, track in self._tracks.items():
            values, skipped = track.at(t) if t > -math.inf else (track.given, 0)
            self.skipped += skipped
            if values != track.given:
                changed[index] = track.given = values
        return changed

    def set(self, index: int, values: Values) -> None:
        """Let an effector do something else until it's told anew."""
        track = self._tracks[index]
        track.stamps, track.values, track.given = [self._newest], [values], values

    def given(self, index: int) -> Values:
        """What an effector does."""
        return self._tracks[index].given
