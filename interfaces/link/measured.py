"""The measured rows: Han, Kim, Kim and Kim (2001), tables 1 and 2.

As d = min + min(L, max − min) with L log-normal; the parameters are those for which mean and standard
deviation of d match the rows *after* clipping. ln L is a first-order autoregression.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Annotated

import numpy as np

from interfaces.link.congestion import Congestion, correlation_time
from interfaces.link.delay import CORRELATION_TIME, MAX_DELAY, DelaySource, share_of
from vrs.checks import number_in, validated, within
from vrs.errors import InvalidValueError


@dataclass(frozen=True, slots=True)
@validated
class HeavyTailedDelay:
    """Clipped log-normal delay with correlated congestion."""

    name: str
    mu: Annotated[float, within(-50.0, 50.0)]
    """Mean of ln L, L in milliseconds; in [−50, 50]."""
    sigma: float
    """Standard deviation of ln L, in (0, 10]."""
    low: float
    """Smallest delay [s], ≥ 0."""
    high: float
    """Largest delay [s], in (low, 3600]."""
    correlation_time: float = CORRELATION_TIME
    """Time constant of the autoregression of ln L [s], in [0, 3600]; 0 makes the draws independent."""

    def __post_init__(self) -> None:
        if number_in("sigma", self.sigma, 0.0, 10.0) == 0:
            raise InvalidValueError("sigma", self.sigma, "in (0, 10]")
        number_in("low", self.low, 0.0, MAX_DELAY, "seconds")
        if not self.low < number_in("high", self.high, 0.0, MAX_DELAY, "seconds"):
            raise InvalidValueError("high", self.high, f"more than low, {self.low} s")
        correlation_time(self.correlation_time)

    def delay(self, z: float) -> float:
        """Delay [s] where ln L lies z standard deviations above its mean."""
        return self.low + min(math.exp(self.mu + self.sigma * z) / 1e3, self.high - self.low)

    def source(self, rng: np.random.Generator) -> DelaySource:
        """Start a sequence of delays from the stationary distribution."""
        return _HeavyTailState(self, rng)

    def quantile(self, share: float) -> float:
        """One-way delay that the given share of packets does not exceed [s]; share in (0, 1)."""
        return self.delay(NormalDist().inv_cdf(share_of(share)))


class _HeavyTailState:
    """State of one heavy-tailed link."""

    def __init__(self, profile: HeavyTailedDelay, rng: np.random.Generator) -> None:
        self._profile = profile
        self._congestion = Congestion(rng, profile.correlation_time)

    def draw(self, now: float, size: int = 0) -> float | None:  # noqa: ARG002
        return self._profile.delay(self._congestion.at(now))


MEASURED = {
    profile.name: profile
    for profile in (
        HeavyTailedDelay("domain", 0.82, 1.94, 0.006, 0.89),
        HeavyTailedDelay("country", 5.23, 2.62, 0.039, 343.0),
        HeavyTailedDelay("mon", 4.52, 1.89, 0.048, 15.0),
        HeavyTailedDelay("tue", 6.24, 2.40, 0.045, 343.0),
        HeavyTailedDelay("wed", 4.60, 2.38, 0.044, 154.0),
        HeavyTailedDelay("thu", 4.72, 2.14, 0.045, 68.0),
        HeavyTailedDelay("fri", 4.69, 2.01, 0.049, 35.0),
    )
}
"""The rows by name: table 1's regions, table 2's days."""
