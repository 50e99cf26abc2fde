"""Exact quantiles and mean of the newest values: a sliding window, bounded in number and in age."""

from __future__ import annotations

import math
from bisect import bisect_left, insort
from collections import deque

from vrs.checks import finite, integer_in
from vrs.errors import InvalidValueError

MAX_CAPACITY = 100_000
LARGEST = 1e12
"""Largest magnitude of a value."""
_FRACTION_BITS = 64
_SCALE = 2.0**_FRACTION_BITS


class SlidingQuantiles:
    """Order statistics of the newest values.

    An update takes O(log n) comparisons, and moves a part of a sorted list. The mean comes from a fixed-point sum:
    what enters and leaves cancels exactly, and nothing accumulates, however long it runs.

    Args:
        capacity: Most values kept, in [1, 100,000].
        horizon: Age at which a value leaves the window [s], > 0; infinite for never. Ages are as of the newest
            value: through an outage the window keeps what it has.

    Raises:
        InvalidValueError: If an argument is out of range.
    """

    def __init__(self, capacity: int, horizon: float = math.inf) -> None:
        integer_in("capacity", capacity, 1, MAX_CAPACITY)
        if not horizon > 0:
            raise InvalidValueError("horizon", horizon, "seconds > 0")
        self._capacity, self._horizon = capacity, horizon
        self._newest = -math.inf
        self._values: deque[tuple[float, float]] = deque()
        self._ordered: list[float] = []
        """The same, ascending: to move a part of it costs less than a tree of Python objects would."""
        self._sum = 0

    def __len__(self) -> int:
        return len(self._values)

    def add(self, value: float, *, now: float) -> None:
        """Take in a value.

        Args:
            value: Any finite number, at most 1e12 in size.
            now: Time [s], not before that of the value added last.

        Raises:
            InvalidValueError: If the value is out of range, or now isn't finite or runs back.
        """
        value, now = finite("value", value), finite("now", now, "finite seconds")
        if abs(value) > LARGEST:
            raise InvalidValueError("value", value, f"at most {LARGEST:g} in size")
        if now < self._newest:
            raise InvalidValueError("now", now, f"at least {self._newest}, the time of the last value")
        self._newest = now
        values = self._values
        while values and (len(values) == self._capacity or now - values[0][0] >= self._horizon):
            self._forget(values.popleft()[1])
        values.append((now, value))
        insort(self._ordered, value)
        self._sum += int(value * _SCALE)

    def clear(self) -> None:
        """Forget every value, as when the clock that they were measured with has stepped."""
        self._values.clear()
        self._ordered.clear()
        self._sum = 0

    @property
    def mean(self) -> float | None:
        """Arithmetic mean; None of an empty window."""
        return self._sum / (len(self._values) << _FRACTION_BITS) if self._values else None

    @property
    def median(self) -> float | None:
        """The middle value, or the mean of the two in the middle; None of an empty window."""
        return self.quantile(0.5)

    @property
    def minimum(self) -> float | None:
        """The smallest value; None of an empty window."""
        return self._ordered[0] if self._values else None

    @property
    def maximum(self) -> float | None:
        """The largest value; None of an empty window."""
        return self._ordered[-1] if self._values else None

    def quantile(self, share: float) -> float | None:
        """Value that the given share of the window doesn't exceed, linear between neighbours (as `numpy.quantile`).

        Args:
            share: In [0, 1].

        Returns:
            The quantile; None of an empty window.

        Raises:
            InvalidValueError: If share is out of range.

        Source: Hyndman and Fan, Sample quantiles in statistical packages (1996), definition 7.
        """
        if not 0 <= share <= 1:
            raise InvalidValueError("share", share, "in [0, 1]")
        if not self._values:
            return None
        place = (len(self._values) - 1) * share
        index = int(place)
        low, rest = self._ordered[index], place - index
        if rest == 0:
            return low
        high = self._ordered[index + 1]
        # From the nearer neighbour, as NumPy does: then the quantile never decreases with the share.
        return low + (high - low) * rest if rest < 0.5 else high - (high - low) * (1 - rest)

    def _forget(self, value: float) -> None:
        del self._ordered[bisect_left(self._ordered, value)]
        self._sum -= int(value * _SCALE)
