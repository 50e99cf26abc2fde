"""Gamma-distributed delays."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from interfaces.link.congestion import Congestion, correlation_time
from interfaces.link.delay import CORRELATION_TIME, MAX_DELAY, DelaySource, share_of
from vrs.checks import number_in
from vrs.errors import InvalidValueError

SHORTEST = 1e-6
"""Least mean of what's above the smallest delay [s]: of nearly nothing no share can be worked out."""


@dataclass(frozen=True, slots=True)
class GammaDelay:
    """A smallest delay plus a gamma variable; above 3600 s it is clipped.

    The correlation is that of a normal variable z(t) behind it: the delay is the quantile of Φ(z).
    """

    name: str
    mean: float
    """Mean one-way delay [s], at least 1 µs above low, at most 3600."""
    deviation: float
    """Standard deviation [s], from 1/1000 to 10 times mean − low."""
    low: float = 0.0
    """Smallest delay [s], in [0, mean)."""
    correlation_time: float = CORRELATION_TIME
    """Correlation time of z [s], in [0, 3600]; 0 makes the draws independent."""

    def __post_init__(self) -> None:
        number_in("smallest delay", self.low, 0.0, MAX_DELAY, "seconds")
        if not self.low < number_in("mean delay", self.mean, 0.0, MAX_DELAY, "seconds"):
            raise InvalidValueError("mean delay", self.mean, f"more than the smallest, {self.low:g} s")
        above = number_in("mean delay above the smallest", self.mean - self.low, SHORTEST, MAX_DELAY, "seconds")
        number_in("standard deviation", self.deviation, above / 1e3, above * 10, "seconds")
        correlation_time(self.correlation_time)

    @property
    def shape(self) -> float:
        """Shape parameter k of the gamma variable."""
        return ((self.mean - self.low) / self.deviation) ** 2

    def source(self, rng: np.random.Generator) -> DelaySource:
        """Start a sequence of delays from the stationary distribution."""
        return _GammaState(self, rng)

    def quantile(self, share: float) -> float:
        """One-way delay that the given share of packets does not exceed [s]; share in (0, 1)."""
        return self.delay_at(share_of(share), 1.0 - share)

    def delay_at(self, below: float, above: float) -> float:
        """Delay [s] with the shares `below` and `above` = 1 − below on either side of it."""
        from scipy.special import gammainccinv, gammaincinv

        value = gammaincinv(self.shape, below) if below <= above else gammainccinv(self.shape, above)
        return min(self.low + float(value) * (self.mean - self.low) / self.shape, MAX_DELAY)


class _GammaState:
    """State of one link with gamma delays."""

    def __init__(self, profile: GammaDelay, rng: np.random.Generator) -> None:
        self._profile = profile
        self._congestion = Congestion(rng, profile.correlation_time)

    def draw(self, now: float, size: int = 0) -> float | None:  # noqa: ARG002
        z = self._congestion.at(now) / math.sqrt(2.0)
        return self._profile.delay_at(0.5 * math.erfc(-z), 0.5 * math.erfc(z))
