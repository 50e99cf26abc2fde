"""The slow randomness of a link: packets close in time meet the same congestion."""

from __future__ import annotations

import math

import numpy as np

from interfaces.link.delay import MAX_DELAY
from vrs.checks import number_in

LONGEST = MAX_DELAY
"""Longest correlation time [s]."""
SHORTEST = 1e-6
"""Shortest one but 0 [s]."""


def correlation_time(value: float) -> float:
    """Check a correlation time [s]; 0 means independent draws.

    Raises:
        InvalidValueError: If it isn't 0 or in [1e-6, 3600].
    """
    if number_in("correlation time", value, 0.0, LONGEST, "seconds") == 0:
        return value
    return number_in("correlation time", value, SHORTEST, LONGEST, "0, or seconds")


class Congestion:
    """A standard normal variable z(t) with the autocorrelation exp(−|Δt|/τ), sampled as time goes on.

    Args:
        rng: Source of the randomness; one standard normal a sample.
        tau: Correlation time τ [s]; 0 makes every sample independent, two at the same instant too.
    """

    def __init__(self, rng: np.random.Generator, tau: float) -> None:
        self._rng, self._tau = rng, tau
        self._z = 0.0
        self._last: float | None = None

    def at(self, now: float) -> float:
        """The value at now [s]; a time before the last one counts as that one."""
        gap = math.inf if self._last is None else max(0.0, now - self._last)
        rho = math.exp(-gap / self._tau) if self._tau > 0 else 0.0
        self._z = rho * self._z + math.sqrt(1.0 - rho * rho) * float(self._rng.standard_normal())
        self._last = now if self._last is None else max(now, self._last)
        return self._z
