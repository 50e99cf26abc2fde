"""How real a simulated mobile robot is."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from robots.bullet.reality import Payload
from vrs.checks import number_in
from vrs.errors import InvalidValueError

Pair = tuple[float, float]
"""Of the right and of the left wheel."""

_RANGES = {
    "slip_spread": (0.0, 0.2),
    "slip_time": (0.01, 1000.0),
    "base_error": (-0.2, 0.2),
    "friction": (0.02, 2.0),
    "rolling": (0.0, 20.0),
    "encoder_noise": (0.0, 1000.0),
    "gravity": (0.1, 100.0),
    "dt": (1e-4, 0.02),
}


@dataclass(frozen=True, slots=True)
class MobileReality:
    """What the simulated robot has of a real one. The default is all of it; `MobileReality.ideal()` none.

    Natural slip hardly exists in PyBullet between friction 0.3 and 0.1, so slip is said here.
    """

    slip: Pair = (0.004, 0.006)
    """Share of the way that each wheel loses against the floor, right and left, in [-0.5, 0.5]."""
    slip_spread: float = 0.004
    """Standard deviation of what each slip wanders by, in [0, 0.2]."""
    slip_time: float = 1.0
    """Correlation time of the wandering [s], in [0.01, 1000]."""
    radius_error: Pair = (0.002, -0.001)
    """By how much the wheels' radii, right and left, are greater than nominal, as shares, in [-0.2, 0.2]."""
    base_error: float = 0.005
    """By how much the wheel base is greater than nominal, as a share, in [-0.2, 0.2]."""
    friction: float = 0.7
    """Coulomb friction between tyres and floor, in [0.02, 2]."""
    rolling: float = 1.0
    """Resistance of the casters as a multiple of the nominal, in [0, 20]."""
    servo_lag: bool = True
    """Whether wheels follow with their servos' time constant."""
    ramps: bool = True
    """Whether speeds change within a_max and the turning acceleration; without, they jump."""
    torque_limits: bool = True
    """Whether the drives' torques end at their limits."""
    encoder_counts: int | None = -1
    """Counts a motor turn, 1 to 10,000,000; -1 takes the chassis's, None reads angles exactly."""
    encoder_noise: float = 0.5
    """Standard deviation of a reading [counts], in [0, 1000]."""
    payload: Payload | None = None
    """What the robot carries; its centre counts in the robot's frame, and nobody tells the servos."""
    gravity: float = 9.81
    """Acceleration of free fall [m/s²], in [0.1, 100]."""
    dt: float = 1 / 240
    """Step of physics and servos [s], in [1e-4, 0.02]."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if item.type == "bool" and not isinstance(value, bool):
                raise InvalidValueError(item.name, value, "True or False")
        for name, (low, high) in _RANGES.items():
            object.__setattr__(self, name, number_in(name, getattr(self, name), low, high))
        for name, most in (("slip", 0.5), ("radius_error", 0.2)):
            object.__setattr__(self, name, _pair(name, getattr(self, name), most))
        counts = self.encoder_counts
        if counts is not None and (
            isinstance(counts, bool)
            or not isinstance(counts, int)
            or not (counts == -1 or 1 <= counts <= 10_000_000)
        ):
            raise InvalidValueError("encoder_counts", counts, "None, -1 or an integer in [1, 10000000]")
        if self.payload is not None and not isinstance(self.payload, Payload):
            raise InvalidValueError("payload", self.payload, "a Payload or None")

    @classmethod
    def ideal(cls, *, dt: float = 1 / 240) -> MobileReality:
        """Wheels that are as they should be, roll and turn at once as told: the virtual robot's model."""
        return cls(
            slip=(0.0, 0.0),
            slip_spread=0.0,
            radius_error=(0.0, 0.0),
            base_error=0.0,
            rolling=0.0,
            servo_lag=False,
            ramps=False,
            torque_limits=False,
            encoder_counts=None,
            encoder_noise=0.0,
            dt=dt,
        )

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> MobileReality:
        """Return a robot of its own from a workshop, for runs over many robots.

        Radii within 0.3 %, the base within 1 % and mean slips of 0.5 % ± 0.3 % (standard deviations, cut off at
        three): what Borenstein and Feng 1996 report of robots that nobody calibrated is of this size.
        """
        right, left, base, slip_right, slip_left = np.clip(rng.standard_normal(5), -3.0, 3.0).tolist()
        return cls(
            radius_error=(0.003 * right, 0.003 * left),
            base_error=0.01 * base,
            slip=(0.005 + 0.003 * slip_right, 0.005 + 0.003 * slip_left),
        )


def _pair(name: str, value: object, most: float) -> Pair:
    allowed = f"two numbers, right and left, in [{-most:g}, {most:g}]"
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        raise InvalidValueError(name, value, allowed)
    return number_in(name, value[0], -most, most), number_in(name, value[1], -most, most)
