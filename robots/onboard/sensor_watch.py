"""Which sensors of a mobile robot read rubbish: it's left out, and where it lasts the robot is to stop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from robots.onboard.driving import Posture
from robots.onboard.following import BLIND

_ROUNDING = 1e-9
"""Of times [s]."""
_FARTHEST = 1e4
"""No robot takes itself to be further away [m, rad]."""


class SensorWatch:
    """Looks at readings before anybody uses them."""

    def __init__(self) -> None:
        """All is well."""
        self._since: dict[str, tuple[float, float, str]] = {}

    def see(
        self, sensor: str, values: ArrayLike, low: float, high: float, *, now: float, endless: bool = False
    ) -> bool:
        """Look at a reading.

        Args:
            sensor: Which, for people.
            values: Any numbers.
            low: Least that is sound.
            high: Largest that is sound.
            now: [s].
            endless: Whether infinity is sound, as of a beam that met nothing.

        Returns:
            Whether all of it is sound; else nobody is to use it.
        """
        try:
            read = np.asarray(values, np.float64).ravel()
        except (TypeError, ValueError):
            return self.note(sensor, "no numbers", now=now)
        sound = (read >= low) & (read <= high)
        if endless:
            sound |= read == np.inf
        return self.note(sensor, "" if sound.all() else f"{read[~sound][0]:g}", now=now)

    def note(self, sensor: str, bad: str, *, now: float) -> bool:
        """Take what a reading at now [s] was found to be, empty for sound; whether it was."""
        if not bad:
            self._since.pop(sensor, None)
        else:
            since = self._since[sensor][0] if sensor in self._since else now
            self._since[sensor] = since, now, bad
        return not bad

    @property
    def fault(self) -> str:
        """What has been bad for `BLIND` seconds, from one reading to another; empty if nothing."""
        lasting = (
            f"the {sensor} reads {bad}"
            for sensor, (since, last, bad) in self._since.items()
            if last - since >= BLIND - _ROUNDING
        )
        return next(lasting, "")


class Tells(Protocol):
    """Whatever tells a robot where it is."""

    def posture(self) -> Posture:
        """(x, y, θ) [m, m, rad], now."""


class SoundPosition:
    """Tells a robot where it is as something else does, as long as that is sound; else where it was last."""

    def __init__(self, position: Tells, clock: Callable[[], float]) -> None:
        """Take what tells, and the time [s]; a robot that never knew its place is at the origin."""
        self._position, self._clock = position, clock
        self._watch, self._last = SensorWatch(), Posture(0.0, 0.0, 0.0)

    def posture(self) -> Posture:
        """(x, y, θ) [m, m, rad], now."""
        there = self._position.posture()
        if self._watch.see("position", there, -_FARTHEST, _FARTHEST, now=self._clock()):
            self._last = there
        return self._last

    @property
    def fault(self) -> str:
        """Why nobody knows where it is; empty if that's known."""
        return self._watch.fault
