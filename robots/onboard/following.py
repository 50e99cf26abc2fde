"""Whether a robot measures sound numbers, and is where it was commanded to be.

What a sensor reads is looked at before anything else uses it. A single bad reading is left out: what was measured
before it stands. Bad readings for `BLIND` seconds are a fault: an arm brakes from its commanded state, as nobody
knows the measured one, and a mobile robot stops.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from robots.onboard.driving import Posture
from vrs.model import Array, Limits, unit_of

BLIND = 0.05
"""So long a robot goes on without a sound measurement [s]."""
_BEYOND = math.pi
"""A joint may read so far beyond its limits [rad]: it hit something, or its encoder is off."""
_BEYOND_M = 0.5
"""And a prismatic joint [m]."""
_FASTEST = 1e3
"""No joint is faster [rad/s, m/s]; one that hits something has moments of 34."""
_STRONGEST = 1e6
"""No drive is stronger [N m, N]."""
_ROUNDING = 1e-9
"""Of times [s]."""


@dataclass(frozen=True, slots=True)
class SensorFault:
    """What was measured is no sound number."""

    joint: int | None
    """Index of the first bad joint; None where the number of joints is wrong."""
    given: str
    """What it read."""

    def __str__(self) -> str:
        """Say it in a line."""
        if self.joint is None:
            return f"the encoders read {self.given}"
        return f"the encoder of joint {self.joint + 1} reads {self.given}"


@dataclass(frozen=True, slots=True)
class FollowingAbort:
    """A robot isn't where it should be."""

    joint: int
    """Index of the joint that is furthest away."""
    error: float
    """Its distance from the reference, in `unit`."""
    tolerance: float
    """What was allowed, in `unit`."""
    unit: str = "rad"
    """`rad`, or `m` of a prismatic joint."""

    def __str__(self) -> str:
        """Say it in a line."""
        away, limit = f"{self.error:.3g} {self.unit}", f"{self.tolerance:g} {self.unit}"
        return f"joint {self.joint + 1} is {away} from where it should be, more than {limit}"


Violation: TypeAlias = FollowingAbort | SensorFault
"""What is measured that a robot stops for."""


class SensorMonitor:
    """Looks at what was measured before anybody uses it, and knows for how long it hasn't been sound."""

    __slots__ = ("_bounds", "_fault", "_since")

    def __init__(self, limits: Limits, prismatic: Collection[int] = ()) -> None:
        """Take the joints' limits, and which of them are prismatic."""
        n = limits.dof
        units = [unit_of(j, prismatic) for j in range(n)]
        beyond = [_BEYOND_M if unit == "m" else _BEYOND for unit in units]
        self._bounds = (
            ((limits.q_min - beyond).tolist(), (limits.q_max + beyond).tolist(), units),
            ([-_FASTEST] * n, [_FASTEST] * n, [f"{unit}/s" for unit in units]),
            ([-_STRONGEST] * n, [_STRONGEST] * n, ["N" if unit == "m" else "N m" for unit in units]),
        )
        self._fault: SensorFault | None = None
        self._since = 0.0

    def look(self, q: object, qd: object = None, tau: object = None, *, now: float) -> bool:
        """Look at one measurement; nobody else is to use one that isn't sound.

        Args:
            q: Joints [rad], (n,).
            qd: Their speeds [rad/s], (n,); None isn't looked at.
            tau: Their drives' torques [N m], (n,); None or an empty list isn't looked at.
            now: [s].

        Returns:
            Whether it's sound.
        """
        tau = None if isinstance(tau, (list, tuple)) and not tau else tau
        fault = None
        for values, bounds in zip((q, qd, tau), self._bounds, strict=True):
            if fault is None and (values is not None or values is q):
                fault = _fault(values, *bounds)
        if self._fault is None:
            self._since = now
        self._fault = fault
        return fault is None

    def blind(self, *, now: float) -> SensorFault | None:
        """What is wrong with what is measured, where it has been so for `BLIND` seconds by now [s]."""
        return self._fault if now - self._since >= BLIND - _ROUNDING else None


def too_far(q_ref: Array, q: Array, tolerance: float, prismatic: Collection[int] = ()) -> FollowingAbort | None:
    """Compare sound measured joints with their references.

    Args:
        q_ref: Commanded [rad], (n,).
        q: Measured [rad], (n,).
        tolerance: How far a joint may be away [rad], a prismatic one [m].
        prismatic: Which are, from 0.

    Returns:
        The joint that is furthest away, where that's too far; None if none is.
    """
    away = np.abs(q - q_ref)
    joint = int(away.argmax())
    if away[joint] <= tolerance:
        return None
    return FollowingAbort(joint, float(away[joint]), tolerance, unit_of(joint, prismatic))


def _fault(values: object, low: Sequence[float], high: Sequence[float], units: Sequence[str]) -> SensorFault | None:
    """The first number that isn't in its range; None if all are."""
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if not isinstance(values, (list, tuple)) or len(values) != len(low):
        given = len(values) if isinstance(values, (list, tuple)) else "no"
        return SensorFault(None, f"{given} numbers, not {len(low)}")
    for joint, (value, least, most) in enumerate(zip(values, low, high, strict=True)):
        # NaN is in no range.
        if not isinstance(value, (int, float)) or not least <= value <= most:
            return SensorFault(joint, f"{value} {units[joint]}"[:60])
    return None


_FEW = 8
"""Numbers that are looked at one by one."""
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
        few: Iterable[object] = values if isinstance(values, tuple) else (values,)
        if isinstance(values, np.ndarray) and values.size <= _FEW:
            few = values.ravel().tolist()
        for value in few:
            if type(value) is not float or not low <= value <= high:
                break
        else:
            # Arrays take five times as long for a few numbers.
            return self.note(sensor, "", now=now)
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
        if not self._since:
            return ""
        lasting = (
            f"the {sensor} reads {bad}"
            for sensor, (since, last, bad) in self._since.items()
            if last - since >= BLIND - _ROUNDING
        )
        return next(lasting, "")


class PositionSource(Protocol):
    """Whatever says where a robot is."""

    def posture(self) -> Posture:
        """(x, y, θ) [m, m, rad], now."""


class SoundPosition:
    """Tells a robot where it is as something else does, as long as that is sound; else where it was last."""

    def __init__(self, position: PositionSource, clock: Callable[[], float]) -> None:
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
