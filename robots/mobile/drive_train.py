"""Motors, wheels and encoders, the same for the simulated and for the bare robot."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from robots.mobile.chassis import Chassis, MobileReality
from vrs.checks import finite_array, number_in
from vrs.mobile import DriveLimits

_ROUNDING = 1e-9
"""By how much a command may pass a limit, as a share: limits are computed, too."""


def standard_normals(rng: np.random.Generator) -> Iterator[float]:
    """Yield standard normal numbers one by one; drawn by the block, each costs a tenth."""
    while True:
        yield from rng.standard_normal(256).tolist()


class DriveTrain:
    """Speeds of two wheels from commands (v, ω): ramps, servo lag, slip; and their encoders."""

    def __init__(
        self, chassis: Chassis, reality: MobileReality, limits: DriveLimits, rng: np.random.Generator
    ) -> None:
        """Start at rest; slips and noise are drawn from children of rng."""
        self.chassis, self.reality, self.limits = chassis, reality, limits
        self._slip_noise, self._encoder_noise = (standard_normals(child).__next__ for child in rng.spawn(2))
        dt = reality.dt
        self._dv = limits.a_max * dt if reality.ramps else math.inf
        self._dw = limits.alpha_max * dt if reality.ramps else math.inf
        self._lag = -math.expm1(-dt / chassis.servo_time) if reality.servo_lag else 1.0
        right, left = reality.radius_error
        self.radii = chassis.wheel_radius * (1 + right), chassis.wheel_radius * (1 + left)
        """True radii, right and left [m]."""
        self.base = chassis.wheel_base * (1 + reality.base_error)
        """True wheel base [m]."""
        self._command = (0.0, 0.0)
        self._v = self._w = self._right = self._left = 0.0
        counts = chassis.encoder_counts if reality.encoder_counts == -1 else reality.encoder_counts
        self.counts_a_turn = None if counts is None else counts * chassis.gear
        """Encoder counts a wheel turn; None if angles are read exactly."""
        self._wander = (0.0, 0.0)
        if reality.slip_spread > 0:
            take = self._slip_noise
            self._wander = reality.slip_spread * take(), reality.slip_spread * take()
        self.slips = self._slips()
        """Slip of the right and of the left wheel now."""

    def command(self, v: float, w: float) -> None:
        """Take what to do from now on.

        Raises:
            InvalidValueError: If v [m/s] or w [rad/s] isn't a number within the limits; what went before holds.
        """
        limits = self.limits
        most_v, most_w = limits.v_max * (1 + _ROUNDING), limits.w_max * (1 + _ROUNDING)
        v = number_in("v", v, -most_v, most_v, unit=" m/s")
        self._command = v, number_in("w", w, -most_w, most_w, unit=" rad/s")

    def step(self) -> tuple[float, float]:
        """Go one step on; returns the shafts' speeds over it, right and left [rad/s]."""
        v, w = self._command
        self._v = v = min(max(v, self._v - self._dv), self._v + self._dv)
        self._w = w = min(max(w, self._w - self._dw), self._w + self._dw)
        half, r, lag = 0.5 * w * self.chassis.wheel_base, self.chassis.wheel_radius, self._lag
        right, left = (v + half) / r, (v - half) / r
        if lag < 1.0:
            right = self._right + lag * (right - self._right)
            left = self._left + lag * (left - self._left)
        self._right, self._left = right, left
        return right, left

    def wander(self, dt: float) -> None:
        """Let the slips go on for dt [s], an Ornstein-Uhlenbeck process."""
        spread = self.reality.slip_spread
        if spread > 0:
            keep = math.exp(-dt / self.reality.slip_time)
            fresh, take = spread * math.sqrt(1 - keep * keep), self._slip_noise
            right, left = self._wander
            self._wander = keep * right + fresh * take(), keep * left + fresh * take()
            self.slips = self._slips()

    def read(self, angles: tuple[float, float]) -> tuple[float, float]:
        """Return the encoders' readings of two shaft angles [rad]: whole counts unless they read exactly."""
        if self.counts_a_turn is None:
            return angles
        scale, noise, take = self.counts_a_turn / math.tau, self.reality.encoder_noise, self._encoder_noise
        right, left = (scale * angle + (noise * take() if noise > 0 else 0.0) for angle in angles)
        return float(round(right)), float(round(left))

    def angles(self, reading: tuple[float, float]) -> tuple[float, float]:
        """Return the shaft angles [rad] that belong to readings."""
        if self.counts_a_turn is None:
            return reading
        return reading[0] * math.tau / self.counts_a_turn, reading[1] * math.tau / self.counts_a_turn

    def _slips(self) -> tuple[float, float]:
        right, left = self.reality.slip
        return right + self._wander[0], left + self._wander[1]


def arc(posture: tuple[float, float, float], way: float, turn: float) -> tuple[float, float, float]:
    """Return the posture after an exact arc of a length [m] that turns by an angle [rad].

    Source: Han, Kim, Kim, Kim 2001, eq. (4) and (5), as chord and half angle.
    """
    half = 0.5 * turn
    chord = way * (math.sin(half) / half if abs(half) > 1e-8 else 1.0)
    x, y, theta = posture
    return x + chord * math.cos(theta + half), y + chord * math.sin(theta + half), theta + turn


class Odometry:
    """Dead reckoning from encoder readings with the nominal wheels; it drifts as they differ from the true ones."""

    def __init__(self, train: DriveTrain, posture: tuple[float, float, float]) -> None:
        """Start at a posture with both shafts at zero."""
        self._train = train
        self.posture = posture
        """Where the robot thinks that it is."""
        self._angles = (0.0, 0.0)

    def update(self, reading: tuple[float, float]) -> None:
        """Go on by what the encoders turned since the last reading."""
        right, left = self._train.angles(reading)
        r, base = self._train.chassis.wheel_radius, self._train.chassis.wheel_base
        a, b = r * (right - self._angles[0]), r * (left - self._angles[1])
        self._angles = right, left
        self.posture = arc(self.posture, 0.5 * (a + b), (a - b) / base)


def as_posture(name: str, posture: ArrayLike) -> tuple[float, float, float]:
    """Return x, y [m] within ±1000 and a heading [rad] within ±1000.

    Raises:
        InvalidValueError: If it is anything else.
    """
    allowed = "(x, y, theta): three finite numbers within ±1000"
    array = finite_array(name, posture, (3,), allowed)
    x, y, theta = (number_in(name, value, -1000.0, 1000.0) for value in array.tolist())
    return x, y, theta
