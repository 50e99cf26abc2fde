"""The joint controller: feed-forward at the reference plus proportional-derivative feedback on the encoders.

    τ = τ_ff(q*, q̇*, q̈*) + K_p e + K_d ė,   e = q* - q,   K_p = J ω²,   K_d = 2 ζ ω J

with fixed joint inertias J, ω = 2π times the bandwidth, and ė a first-order low-passed difference of e: one
encoder count in one step would else read as 0.1 rad/s. There is no integral part: with stiction it hunts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import TypeAlias

from vrs.checks import number_in
from vrs.model import Array

FeedForward: TypeAlias = Callable[[Array, Array, Array], Array]
"""Torques [N m] of references q [rad], qd [rad/s], qdd [rad/s²], all (k, n), row by row."""


@dataclass(frozen=True, slots=True)
class ServoGains:
    """How hard the servo pulls; the same for every payload."""

    bandwidth_hz: float = 12.0
    """Undamped natural frequency of the position loop [Hz], 0.1 to 30."""
    damping: float = 0.8
    """Damping ratio ζ of the position loop, 0.1 to 3."""
    derivative_hz: float = 80.0
    """Corner of the low-pass on the error's rate [Hz], 1 to 500."""
    friction: float = 0.5
    """Share of the nominal friction that the feed-forward makes good, 0 to 1; 1 knows it perfectly."""

    def __post_init__(self) -> None:
        ranges = {"bandwidth_hz": (0.1, 30.0), "damping": (0.1, 3.0), "derivative_hz": (1.0, 500.0)}
        for item in fields(self):
            low, high = ranges.get(item.name, (0.0, 1.0))
            object.__setattr__(self, item.name, number_in(item.name, getattr(self, item.name), low, high))


class Servo:
    """One controller for all joints of an arm; it knows positions in, torques out, and no clock."""

    def __init__(
        self,
        gains: ServoGains,
        *,
        inertia: Sequence[float],
        feedforward: FeedForward,
        q: Sequence[float],
        dt: float,
    ) -> None:
        """Start holding a position.

        Args:
            gains: The gains.
            inertia: Joint inertias J that the gains are made for [kg m²], n of them.
            feedforward: Torques of a reference, row by row.
            q: Reference before the first one is given [rad], n values.
            dt: Time between two calls of `torques` [s].
        """
        omega = 2 * math.pi * gains.bandwidth_hz
        self._kp = [j * omega**2 for j in inertia]
        self._kd = [2 * gains.damping * omega * j for j in inertia]
        blend = 1.0 - math.exp(-2 * math.pi * gains.derivative_hz * dt)
        self._keep, self._gain = 1.0 - blend, blend / dt
        self._feedforward = feedforward
        self.hold(q)

    def hold(self, q: Sequence[float]) -> None:
        """Take q [rad] as reference and forget the past errors."""
        self._target: Sequence[float] = [float(x) for x in q]
        self._error: list[float] | None = None
        self._error_rate = [0.0] * len(self._target)

    def feedforward(self, q_ref: Array, qd_ref: Array, qdd_ref: Array) -> Array:
        """Return the feed-forward of a block of references [N m], (k, n), without changing state."""
        return self._feedforward(q_ref, qd_ref, qdd_ref)

    def torques(
        self, measured: Sequence[float], feedforward: Sequence[float], target: Sequence[float]
    ) -> list[float]:
        """Close the loop for one step.

        Args:
            measured: Encoder readings now [rad].
            feedforward: Row of `feedforward` for the step that begins now [N m].
            target: Reference for the end of this step [rad]; it is compared with the next reading.

        Returns:
            Drive torques for this step [N m], not limited.
        """
        error = [r - y for r, y in zip(self._target, measured, strict=True)]
        keep, gain = self._keep, self._gain
        before = error if self._error is None else self._error
        rates = [keep * d + gain * (e - o) for d, e, o in zip(self._error_rate, error, before, strict=True)]
        self._error, self._error_rate, self._target = error, rates, target
        return [
            u + p * e + k * d for u, p, e, k, d in zip(feedforward, self._kp, error, self._kd, rates, strict=True)
        ]
