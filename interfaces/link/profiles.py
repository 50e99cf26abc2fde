"""Delay profiles: how long a packet takes one way, and whether it arrives.

The measured rows are Han, Kim, Kim and Kim (2001), tables 1 and 2, as d = min + min(L, max − min) with L
log-normal. Packets close in time meet the same congestion: ln L is a first-order autoregression.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist
from typing import Protocol

import numpy as np

from interfaces.link.trace import read_trace
from vrs.errors import InvalidValueError

MAX_DELAY = 3600.0
"""Longest one-way delay that a profile may hold [s]."""
CORRELATION_TIME = 2.0
"""Time constant of ln L [s]."""
LUNAR_ROUND_TRIP = 2.56
"""Earth to Moon and back [s]."""


class DelaySource(Protocol):
    """Delays of successive packets; it holds the state of the link's congestion."""

    def draw(self, now: float) -> float | None:
        """One-way delay of a packet sent at now [s], ≥ 0; None when it is lost."""


class DelayProfile(Protocol):
    """A way in which a link delays packets."""

    @property
    def name(self) -> str:
        """The profile as the command line spells it."""

    def source(self, rng: np.random.Generator) -> DelaySource:
        """Start a sequence of delays."""

    def quantile(self, share: float) -> float:
        """One-way delay that the given share of arriving packets does not exceed [s]."""


@dataclass(frozen=True, slots=True)
class ConstantDelay:
    """Every packet takes equally long."""

    name: str
    delay: float
    """One-way delay [s], in [0, 3600]."""

    def __post_init__(self) -> None:
        if not 0 <= self.delay <= MAX_DELAY:
            raise InvalidValueError("delay", self.delay, f"seconds in [0, {MAX_DELAY:g}]")

    def source(self, rng: np.random.Generator) -> DelaySource:  # noqa: ARG002
        """Start a sequence of delays; nothing about them is random."""
        return self

    def quantile(self, share: float) -> float:  # noqa: ARG002
        """The delay, for every share [s]."""
        return self.delay

    def draw(self, now: float) -> float | None:  # noqa: ARG002
        """The delay, at every time [s]."""
        return self.delay


@dataclass(frozen=True, slots=True)
class HeavyTailedDelay:
    """Clipped log-normal delay with correlated congestion."""

    name: str
    mu: float
    """Mean of ln L, L in milliseconds."""
    sigma: float
    """Standard deviation of ln L, > 0."""
    low: float
    """Smallest delay [s]."""
    high: float
    """Largest delay [s]."""
    correlation_time: float = CORRELATION_TIME
    """Time constant of the autoregression of ln L [s], > 0."""

    def delay(self, z: float) -> float:
        """Delay [s] where ln L lies z standard deviations above its mean."""
        return self.low + min(math.exp(self.mu + self.sigma * z) / 1e3, self.high - self.low)

    def source(self, rng: np.random.Generator) -> DelaySource:
        """Start a sequence of delays from the stationary distribution."""
        return _Congestion(self, rng)

    def quantile(self, share: float) -> float:
        """One-way delay that the given share of packets does not exceed [s]; share in (0, 1)."""
        if not 0 < share < 1:
            raise InvalidValueError("share", share, "in (0, 1)")
        return self.delay(NormalDist().inv_cdf(share))


class _Congestion:
    """State of one heavy-tailed link."""

    def __init__(self, profile: HeavyTailedDelay, rng: np.random.Generator) -> None:
        self._profile, self._rng = profile, rng
        self._z = 0.0
        self._sent: float | None = None

    def draw(self, now: float) -> float | None:
        gap = math.inf if self._sent is None else max(0.0, now - self._sent)
        rho = math.exp(-gap / self._profile.correlation_time)
        self._z = rho * self._z + math.sqrt(1.0 - rho * rho) * float(self._rng.standard_normal())
        self._sent = now
        return self._profile.delay(self._z)


@dataclass(frozen=True, slots=True)
class TraceDelay:
    """Recorded delays, a row a packet; after the last row the first comes again."""

    name: str
    delays: tuple[float | None, ...]
    """One-way delays [s]; None is a lost packet. Not empty."""

    def source(self, rng: np.random.Generator) -> DelaySource:  # noqa: ARG002
        """Start at the first row."""
        return _Replay(self.delays)

    def quantile(self, share: float) -> float:
        """Smallest recorded delay that the share of arriving packets keeps within [s]; 0 if none arrives."""
        arriving = sorted(d for d in self.delays if d is not None)
        return arriving[max(0, math.ceil(share * len(arriving)) - 1)] if arriving else 0.0


class _Replay:
    """Position in a trace."""

    def __init__(self, delays: tuple[float | None, ...]) -> None:
        self._delays, self._row = delays, 0

    def draw(self, now: float) -> float | None:  # noqa: ARG002
        delay = self._delays[self._row]
        self._row = (self._row + 1) % len(self._delays)
        return delay


_MEASURED = {
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

ALLOWED = (
    f"none, constant:S (S seconds in [0, {MAX_DELAY:g}]), {', '.join(_MEASURED)}, lunar, "
    "or trace:FILE.csv with a delay_s column"
)
"""What a delay profile may be, in words."""


def delay_profile(text: str) -> DelayProfile:
    """Read a delay profile as the command line spells it.

    Args:
        text: `none`, `constant:S`, `domain`, `country`, `mon` to `fri`, `lunar` or `trace:FILE.csv`.

    Returns:
        The profile; its delays are one way.

    Raises:
        InvalidValueError: If text is none of these.
        FormatError: If a trace file can't be read as one.
    """
    kind, colon, argument = text.partition(":")
    if text in _MEASURED:
        return _MEASURED[text]
    if text == "none":
        return ConstantDelay(text, 0.0)
    if text == "lunar":
        return ConstantDelay(text, LUNAR_ROUND_TRIP / 2)
    if kind == "trace" and argument:
        return TraceDelay(text, read_trace(Path(argument), longest=MAX_DELAY))
    if kind == "constant" and colon:
        try:
            delay = float(argument)
        except ValueError:
            delay = math.nan
        if 0 <= delay <= MAX_DELAY:
            return ConstantDelay(text, delay)
    raise InvalidValueError("delay profile", text, ALLOWED)
