"""Means and medians over runs, and their intervals.

Of ten runs or more the interval is the bootstrap's. Resampling few runs gives too narrow ones: of five to nine runs
the interval of a mean is Student's, that of a median lies between two of the runs, whatever the distribution. Fewer
than five have no interval of 95 %: theirs goes from the smallest to the largest, and is called that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from vrs.errors import InvalidValueError
from vrs.model import Array

RESAMPLES = 4000
"""Samples drawn again for an interval."""
ENOUGH = 10
"""Runs of which the bootstrap makes the interval, at least."""
FEWEST = 5
"""Runs that have an interval, at least; of fewer it's their range."""
LEVEL = 0.95
"""How often an interval is to cover what it's of."""
RANGE = "smallest to largest"
"""What the interval of fewer than five runs is."""


class Estimate(NamedTuple):
    """A figure over runs, with its interval."""

    value: float
    low: float
    high: float
    level: float | None = LEVEL
    """How often such an interval covers, by its making; None of the range of too few runs."""

    @property
    def interval(self) -> tuple[float, float]:
        """Both ends."""
        return self.low, self.high

    @property
    def name(self) -> str:
        """What the interval is, for people."""
        return RANGE if self.level is None else f"{100 * min(self.level, LEVEL):.0f} %"

    @property
    def is_below_zero(self) -> bool:
        """Whether the interval lies below zero and doesn't touch it: of differences A − B, that A < B.

        Of fewer than five runs that says of these alone that all lie below zero.
        """
        return self.high < 0


def interval_name(runs: int, *, of_median: bool = False) -> str:
    """What the intervals of means or medians of so many runs are, for people."""
    return bootstrap(np.zeros(max(runs, 1)), 0, median if of_median else _mean).name


def _mean(values: Array) -> Array:
    return np.asarray(values.mean(axis=-1))


def median(values: Array) -> Array:
    """The median of each row, (..., k) to (...)."""
    return np.asarray(np.median(values, axis=-1))


def bootstrap(values: ArrayLike, seed: int, statistic: Callable[[Array], Array] = _mean) -> Estimate:
    """A statistic of runs with its interval, from ten runs on by resampling them.

    Args:
        values: A figure a run, (k,), k ≥ 1; no two runs of one seed, which aren't independent: see `clustered`.
        seed: Seed of the resampling.
        statistic: From (..., k) to (...), `median` or one that adds up as the mean does, which it is unless given.

    Raises:
        InvalidValueError: If there are no values, or one isn't finite.
    """
    sample = np.asarray(values, dtype=np.float64)
    if sample.ndim != 1:
        raise InvalidValueError("values", sample, "finite numbers, one a run")
    return clustered(sample[:, None], seed, statistic)


def ratio(ours: ArrayLike, others: ArrayLike, seed: int) -> Estimate:
    """A figure by another's, the geometric mean over runs, with its interval.

    Args:
        ours: A figure a run, (k,), above zero.
        others: The other's of the same runs, (k,), above zero.
        seed: Seed of the resampling.
    """
    found = bootstrap(np.log(ours) - np.log(others), seed)
    return Estimate(math.exp(found.value), math.exp(found.low), math.exp(found.high), found.level)


def clustered(values: ArrayLike, seed: int, statistic: Callable[[Array], Array] = _mean) -> Estimate:
    """A statistic of runs of which some share a seed, with its interval, from ten seeds on by resampling them.

    Runs of one seed under several networks have the same operator, so they go well or badly together: drawn one
    by one, as if each were news, they'd make the interval too narrow. All runs of a seed are drawn at once.

    Args:
        values: A figure a run, (k, m): m runs of each of k seeds, k, m ≥ 1.
        seed: Seed of the resampling.
        statistic: From (..., k m) to (...); see `bootstrap`.

    Raises:
        InvalidValueError: If there are no values, or one isn't finite.
    """
    sample = np.asarray(values, dtype=np.float64)
    if sample.ndim != 2 or not sample.size or not np.isfinite(sample).all():
        raise InvalidValueError("values", sample, "finite numbers, one a run")
    value = float(statistic(sample.ravel()))
    if len(sample) < ENOUGH:
        return _of_few(value, np.sort(statistic(sample)), of_median=statistic is median)
    picks = np.random.default_rng(seed).integers(0, len(sample), (RESAMPLES, len(sample)))
    low, high = np.quantile(statistic(sample[picks].reshape(RESAMPLES, -1)), (0.025, 0.975))
    return Estimate(value, float(low), float(high))


def _of_few(value: float, seeds: Array, *, of_median: bool) -> Estimate:
    """The interval of the figures of a few seeds, ascending, (k,)."""
    k = len(seeds)
    if k < FEWEST:
        return Estimate(value, float(seeds[0]), float(seeds[-1]), None)
    if not of_median:
        half = float(stdtrit(k - 1, 0.5 * (1 + LEVEL)) * seeds.std(ddof=1) / math.sqrt(k))
        return Estimate(value, value - half, value + half)
    # Of independent runs, so many lie below their median as heads fall in k throws.
    outside = [2 * sum(math.comb(k, i) for i in range(r)) / 2**k for r in range(k // 2 + 1)]
    r = max((r for r in range(1, len(outside)) if outside[r] <= 1 - LEVEL), default=1)
    return Estimate(value, min(float(seeds[r - 1]), value), max(float(seeds[k - r]), value), 1 - outside[r])
