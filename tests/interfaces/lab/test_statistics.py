"""Intervals of runs, and which figures of a drive may be compared."""

from __future__ import annotations

import math
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from interfaces.lab.driving.legs import point_ahead, way_left
from interfaces.lab.driving.recorded import name_of, paths
from interfaces.lab.driving.run import Case
from interfaces.lab.driving.sweep import comparable
from interfaces.lab.statistics import bootstrap, clustered, median
from vrs.comparison import PathComparison
from vrs.errors import InvalidValueError


def test_an_interval_is_as_wide_as_theory_says() -> None:
    values = np.random.default_rng(1).normal(3.0, 2.0, 400)
    found = bootstrap(values, 0)
    half = 1.96 * values.std(ddof=1) / math.sqrt(len(values))
    assert found.value == pytest.approx(values.mean())
    assert found.high - found.low == pytest.approx(2 * half, rel=0.05)
    # Of the median of normal values it's wider by √(π/2).
    middle = bootstrap(values, 0, median)
    assert middle.value == pytest.approx(np.median(values))
    assert middle.high - middle.low == pytest.approx(2 * half * math.sqrt(math.pi / 2), rel=0.25)


@pytest.mark.parametrize("values", [[], [1.0, math.nan], [[1.0]]])
def test_there_is_no_interval_of_nothing(values: list[float]) -> None:
    with pytest.raises(InvalidValueError):
        bootstrap(values, 0)
    with pytest.raises(InvalidValueError):
        clustered(values if np.ndim(values) == 1 else [[1.0], [math.inf]], 0)


def test_runs_of_one_seed_are_no_more_news_than_one_of_them() -> None:
    rng = np.random.default_rng(2)
    seeds = rng.normal(3.0, 2.0, 30)
    alone = bootstrap(seeds, 0)
    # Nine runs that say the same: the interval stays what one of each seed gives, in its own unit.
    assert clustered(np.tile(seeds[:, None], 9), 0) == pytest.approx(alone)
    assert clustered(np.tile(seeds[:, None], 9), 0, median) == pytest.approx(bootstrap(seeds, 0, median))
    # Runs that have nothing to do with each other count as so many more.
    free = rng.normal(3.0, 2.0, (30, 9))
    found = clustered(free, 0)
    assert found.value == pytest.approx(free.mean())
    one_by_one = bootstrap(free.ravel(), 0)
    assert found.high - found.low == pytest.approx(one_by_one.high - one_by_one.low, rel=0.3)
    assert found.high - found.low < 0.5 * (alone.high - alone.low)


@pytest.mark.parametrize(("progress", "delay", "speed"), [(0.97, 0.3, 0.2), (0.96, 0.9, None), (None, 0.9, None)])
def test_what_a_robot_never_reached_has_no_delay(progress: float | None, delay: float, speed: float | None) -> None:
    given = {"time_difference_mean": 0.3, "time_difference_bound": 0.9, "speed_error": 0.2, "progress": progress}
    metrics = PathComparison(**{item.name: given.get(item.name, 0.1) for item in fields(PathComparison)})
    assert comparable(metrics, "time_difference_mean") == delay
    assert comparable(metrics, "speed_error") == speed
    # Nor has a robot that stayed where it was a mean distance from the way it was to go.
    assert comparable(metrics, "path_error_mean") == (None if speed is None else 0.1)
    assert comparable(metrics, "path_error_max") == 0.1


def test_what_is_ahead_on_a_line_goes_round_its_corners() -> None:
    line = ((0.0, 0.0), (1.0, 0.0), (1.0, 2.0))
    assert point_ahead(line, 0, 0.25, 0.1, 0.5) == pytest.approx((0.75, 0.0))
    assert point_ahead(line, 0, 0.5, 0.0, 1.0) == pytest.approx((1.0, 0.5))
    assert point_ahead(line, 1, 1.0, 1.9, 1.0) == pytest.approx((1.0, 2.9))
    assert way_left(line, 0, 0.75, 0.0) == pytest.approx(2.25)
    assert way_left(line, 1, 1.1, 1.5) == pytest.approx(0.5)


def test_of_equal_cases_one_is_recorded() -> None:
    one, other = Case(seed=1), Case(seed=2)
    out = Path("out")
    found = paths([one, other, one], out)
    assert found == [out / "runs" / f"{name_of(one)}.mcap", out / "runs" / f"{name_of(other)}.mcap", None]
