"""Intervals of runs, and which figures of a drive may be compared."""

from __future__ import annotations

import json
import math
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from interfaces.lab.driving.operators import point_ahead, way_left
from interfaces.lab.driving.output import rich_table, summary
from interfaces.lab.driving.run import name_of, paths
from interfaces.lab.driving.sweep import comparable, grouped, paired
from interfaces.lab.statistics import bootstrap, clustered, interval_name, median
from interfaces.runs.drive_run import DriveCase, Row
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


COVERAGE = {
    (5, None): (0.935, 0.90, 0.95), (7, None): (0.935, 0.90, 0.95), (9, None): (0.935, 0.90, 0.95),
    (10, None): (0.85, 0.82, None), (20, None): (0.89, 0.86, None), (50, None): (0.9, 0.88, None),
    (5, median): (0.92, 0.92, 0.9375), (6, median): (0.955, 0.955, 0.96875), (9, median): (0.945, 0.945, 0.9609),
    (20, median): (0.88, 0.88, None),
}  # fmt: skip
"""How often intervals cover at least, of normal and of skewed runs; and in theory."""


@pytest.mark.parametrize(("case", "expected"), COVERAGE.items(), ids=lambda x: str(x[0]))
def test_intervals_cover_as_often_as_is_said(case, expected) -> None:
    (k, statistic), (normal, skewed, theory) = case, expected
    options = () if statistic is None else (statistic,)
    rng = np.random.default_rng(7)
    count = 2000 if k < 10 else 250
    draws = {"normal": rng.normal(3.0, 1.0, (count, k)), "skewed": rng.gamma(4.0, 0.5, (count, k))}
    truth = {"normal": 3.0, "skewed": 2.0 if statistic is None else 0.5 * 3.672060748850897}
    covered = {}
    for name, rows in draws.items():
        found = [bootstrap(row, 1, *options) for row in rows]
        covered[name] = np.mean([e.low <= truth[name] <= e.high for e in found])
        assert all(e.low <= e.value <= e.high for e in found)
    assert covered["normal"] >= normal
    assert covered["skewed"] >= skewed
    if theory is not None:
        assert covered["normal"] == pytest.approx(theory, abs=0.015)
        assert found[0].name == f"{100 * min(found[0].level, 0.95):.0f} %"


@pytest.mark.parametrize("statistic", [None, median])
@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_fewer_than_five_runs_have_a_range_and_no_95_percent(k, statistic) -> None:
    values = np.random.default_rng(k).normal(0.0, 1.0, k)
    found = bootstrap(values, 0, *(() if statistic is None else (statistic,)))
    assert found.interval == (values.min(), values.max())
    assert found.level is None
    assert found.name == interval_name(k) == interval_name(k, of_median=True) == "smallest to largest"


def test_what_few_runs_say_is_called_what_it_is() -> None:
    assert [interval_name(k) for k in (5, 9, 10, 100)] == ["95 %"] * 4
    assert [interval_name(k, of_median=True) for k in (5, 6, 10)] == ["94 %", "95 %", "95 %"]
    # Student's: 2.776 deviations of a mean of five.
    values = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    found = bootstrap(values, 0)
    assert found.high - found.value == pytest.approx(2.776 * math.sqrt(2.5 / 5), abs=1e-3)
    # Three networks a seed: the seeds are what varies.
    assert clustered(np.tile(values[:, None], 3), 0) == pytest.approx(found)


@pytest.mark.parametrize(("runs", "said"), [(3, "smallest to largest"), (5, "94 %"), (12, "95 %")])
def test_the_laboratory_says_what_its_intervals_are(runs: int, said: str) -> None:
    rows = [_row(name, seed) for name in ("I", "II") for seed in range(runs)]
    first, second = grouped(rows)
    found = paired(first, second, "path_error_max")
    assert found is not None
    _, verdict = found
    # All runs differ alike, but three of them are no proof.
    assert verdict == ("unclear" if runs < 5 else "below")
    written = summary(rows, {})
    level = written["groups"][0]["median"]["path_error_max"].get("level", 0.95)
    assert level == {3: None, 5: 0.9375, 12: 0.95}[runs]
    title = str(rich_table(rows).title)
    assert said in title
    assert ("95 %" in title) == (runs > 5)
    json.dumps(found, allow_nan=False)


def _row(architecture: str, seed: int) -> Row:
    value = (1.0 if architecture == "I" else 2.0) + 0.01 * seed
    metrics = PathComparison(*([value] * 8), progress=1.0)
    return Row((architecture, "datagrams", "mon", "bare", "slalom"), seed, metrics, 0, 0, 100, 0.5)


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
    one, other = DriveCase(seed=1), DriveCase(seed=2)
    out = Path("out")
    found = paths([one, other, one], out)
    assert found == [out / "runs" / f"{name_of(one)}.mcap", out / "runs" / f"{name_of(other)}.mcap", None]
