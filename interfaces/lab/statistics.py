"""Means, medians and their 95 % bootstrap intervals."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from vrs.errors import InvalidValueError
from vrs.model import Array

RESAMPLES = 4000
"""Samples drawn again for an interval."""


class Estimate(NamedTuple):
    """A figure over runs, with its 95 % bootstrap interval."""

    value: float
    low: float
    high: float

    @property
    def interval(self) -> tuple[float, float]:
        """Both ends."""
        return self.low, self.high

    @property
    def is_below_zero(self) -> bool:
        """Whether the interval lies below zero and doesn't touch it: of differences A − B, that A < B."""
        return self.high < 0


def _mean(values: Array) -> Array:
    return np.asarray(values.mean(axis=-1))


def median(values: Array) -> Array:
    """The median of each row, (..., k) to (...)."""
    return np.asarray(np.median(values, axis=-1))


def bootstrap(values: ArrayLike, seed: int, statistic: Callable[[Array], Array] = _mean) -> Estimate:
    """A statistic of runs, and the interval that resampling the runs gives it.

    Args:
        values: A figure a run, (k,), k ≥ 1; no two runs of one seed, which aren't independent: see `clustered`.
        seed: Seed of the resampling.
        statistic: From (..., k) to (...); the mean unless given.

    Raises:
        InvalidValueError: If there are no values, or one isn't finite.
    """
    sample = np.asarray(values, dtype=np.float64)
    if sample.ndim != 1:
        raise InvalidValueError("values", sample, "finite numbers, one a run")
    return clustered(sample[:, None], seed, statistic)


def clustered(values: ArrayLike, seed: int, statistic: Callable[[Array], Array] = _mean) -> Estimate:
    """A statistic of runs of which some share a seed, and the interval that resampling the seeds gives it.

    Runs of one seed under several networks have the same operator, so they go well or badly together: drawn one
    by one, as if each were news, they'd make the interval too narrow. All runs of a seed are drawn at once.

    Args:
        values: A figure a run, (k, m): m runs of each of k seeds, k, m ≥ 1.
        seed: Seed of the resampling.
        statistic: From (..., k m) to (...); the mean unless given.

    Raises:
        InvalidValueError: If there are no values, or one isn't finite.
    """
    sample = np.asarray(values, dtype=np.float64)
    if sample.ndim != 2 or not sample.size or not np.isfinite(sample).all():
        raise InvalidValueError("values", sample, "finite numbers, one a run")
    picks = np.random.default_rng(seed).integers(0, len(sample), (RESAMPLES, len(sample)))
    low, high = np.quantile(statistic(sample[picks].reshape(RESAMPLES, -1)), (0.025, 0.975))
    return Estimate(float(statistic(sample.ravel())), float(low), float(high))
