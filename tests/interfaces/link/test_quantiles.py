"""Sliding quantiles against NumPy on the same window."""

from __future__ import annotations

import math
import time
from collections import deque

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.link.quantiles import SlidingQuantiles
from vrs.errors import InvalidValueError

SHARES = (0.0, 0.05, 1 / 3, 0.5, 0.9, 0.95, 0.999, 1.0)
VALUES = st.one_of(
    st.floats(-1e12, 1e12),
    st.integers(-3, 3).map(float),  # many equal values
    st.floats(0, 1),
)


def window_of(values, capacity, horizon):
    """The values that a window should hold, by the definition."""
    newest = values[-1][0]
    return [v for t, v in values[-capacity:] if newest - t < horizon]


def check(window, expected):
    assert len(window) == len(expected)
    assert (window.minimum, window.maximum) == (min(expected), max(expected))
    assert window.mean == pytest.approx(math.fsum(expected) / len(expected), rel=1e-15, abs=1e-18)
    assert window.median == window.quantile(0.5)
    rounding = 4 * math.ulp(max(map(abs, expected)))
    for share, quantile in zip(SHARES, np.quantile(expected, SHARES), strict=True):
        assert abs(window.quantile(share) - quantile) <= rounding


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0, 5), VALUES), min_size=1, max_size=40),
    st.integers(1, 20),
    st.sampled_from([0.5, 3.0, 20.0, math.inf]),
)
def test_every_window_is_numpys(steps, capacity, horizon):
    window, values, now = SlidingQuantiles(capacity, horizon), [], 0.0
    for dt, value in steps:
        now += dt
        window.add(value, now=now)
        values.append((now, value))
        check(window, window_of(values, capacity, horizon))


@pytest.mark.parametrize("shape", ["random", "rising", "falling", "equal", "heavy", "sawtooth"])
def test_long_runs(shape):
    rng = np.random.default_rng(7)
    n, capacity = 30_000, 5000
    values = {
        "random": rng.random(n),
        "rising": np.arange(n) + rng.random(n),
        "falling": -np.arange(n) + rng.random(n),
        "equal": np.repeat(0.25, n),
        "heavy": np.minimum(np.exp(6 + 2.4 * rng.standard_normal(n)) / 1e3, 343),
        "sawtooth": np.arange(n) % 3000 + rng.integers(0, 3, n),
    }[shape].tolist()
    window, last = SlidingQuantiles(capacity), deque(maxlen=capacity)
    for i, value in enumerate(values):
        window.add(value, now=float(i))
        last.append(value)
        if i % 1499 == 0:
            check(window, list(last))
    check(window, list(last))


def test_nothing_accumulates():
    """After a million delays of up to 343 s, the mean of small ones is exact again."""
    window, rng = SlidingQuantiles(8), np.random.default_rng(1)
    for i, value in enumerate((343 * rng.random(20_000)).tolist() + [1e-3] * 8):
        window.add(value, now=float(i))
    assert window.mean == 1e-3


def test_quantile_never_decreases_with_the_share():
    window = SlidingQuantiles(10)
    for i, value in enumerate((0.1, 0.1 + 2**-54, 0.3, 1e9)):
        window.add(value, now=float(i))
    found = [window.quantile(share) for share in np.linspace(0, 1, 1001)]
    assert found == sorted(found)


def test_the_horizon_is_half_open_and_outages_keep_what_there_is():
    window = SlidingQuantiles(10, horizon=2.0)
    window.add(5.0, now=0.0)
    window.add(1.0, now=1.999)
    assert len(window) == 2
    window.add(1.0, now=2.0)
    assert (len(window), window.maximum) == (2, 1.0)
    window.add(7.0, now=1000.0)
    assert (len(window), window.median) == (1, 7.0)


def test_an_empty_window_knows_nothing():
    window = SlidingQuantiles(3)
    window.add(1.0, now=0.0)
    window.clear()
    assert (window.mean, window.median, window.minimum, window.maximum, window.quantile(1)) == (None,) * 5
    window.add(2.0, now=0.0)
    assert (window.mean, window.median) == (2.0, 2.0)


@pytest.mark.parametrize(
    "act",
    [
        lambda w: w.add(math.nan, now=1.0),
        lambda w: w.add(math.inf, now=1.0),
        lambda w: w.add(1e13, now=1.0),
        lambda w: w.add("1", now=1.0),
        lambda w: w.add(1.0, now=math.nan),
        lambda w: w.add(1.0, now=-1.0),
        lambda w: w.quantile(1.1),
        lambda w: w.quantile(math.nan),
        lambda _: SlidingQuantiles(0),
        lambda _: SlidingQuantiles(True),
        lambda _: SlidingQuantiles(2.5),
        lambda _: SlidingQuantiles(5, horizon=0.0),
        lambda _: SlidingQuantiles(5, horizon=math.nan),
    ],
)
def test_nonsense_is_refused_and_changes_nothing(act):
    window = SlidingQuantiles(3)
    window.add(1.0, now=0.0)
    with pytest.raises(InvalidValueError):
        act(window)
    assert (len(window), window.mean, window.maximum) == (1, 1.0, 1.0)


@pytest.mark.parametrize("shape", ["random", "rising"])
def test_an_update_in_a_large_window_costs_little_more_than_in_a_small_one(shape):
    """Best of several, in one run: 20 times the window costs less than 4 times as much."""
    rng = np.random.default_rng(0)
    cost = {}
    for capacity in (500, 10_000):
        values = rng.random(capacity + 20_000)
        values = (values if shape == "random" else np.sort(values)).tolist()
        window = SlidingQuantiles(capacity)
        for i in range(capacity):
            window.add(values[i], now=0.0)
        laps = []
        for lap in range(10):
            begin = time.process_time()
            for value in values[capacity + 2000 * lap : capacity + 2000 * (lap + 1)]:
                window.add(value, now=0.0)
            laps.append((time.process_time() - begin) / 2000)
        cost[capacity] = min(laps)
    assert cost[10_000] < 4 * cost[500]
