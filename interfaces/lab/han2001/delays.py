"""Tables 1 and 2: delays that were measured every minute for a day, and the profiles that stand for them."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from interfaces.lab.claims import OWN_BAR, Claim, Findings, Study, Table, at_least
from interfaces.lab.statistics import Estimate, bootstrap, median
from interfaces.link.delays import MEASURED
from vrs.model import Array


class Row(NamedTuple):
    """A row of a table [s]."""

    table: int
    mean: float
    deviation: float
    low: float
    high: float


PRINTED: Final = {
    "domain": Row(1, 0.020, 0.0517, 0.006, 0.89),
    "country": Row(1, 4.194, 22.5, 0.039, 343.0),
    "mon": Row(2, 0.531, 1.42, 0.048, 15.0),
    "tue": Row(2, 6.880, 28.9, 0.045, 343.0),
    "wed": Row(2, 1.480, 7.77, 0.044, 154.0),
    "thu": Row(2, 1.030, 4.16, 0.045, 68.0),
    "fri": Row(2, 0.779, 2.59, 0.049, 35.0),
}
"""As the paper has them."""
A_DAY: Final = 1440
"""Measurements, one a minute."""
FITTED: Final = 2.0
"""By how much a mean or a deviation may be off, as it was printed with two or three digits [%]."""
GRID: Final = 20_000
"""Points of an integral."""


def moments(profile: str) -> tuple[float, float]:
    """Mean and standard deviation of a profile's delays [s]."""
    # The middles of pieces of the same probability.
    shares = (np.arange(GRID) + 0.5) / GRID
    delays = np.array([MEASURED[profile].quantile(share) for share in shares.tolist()])
    return float(delays.mean()), float(delays.std())


def days(profile: str, study: Study) -> Array:
    """Delays of a day, a row a seed, (k, 1440) [s]."""
    made = []
    for seed in range(study.seed, study.seed + study.runs):
        source = MEASURED[profile].source(np.random.default_rng([seed, 17]))
        made.append([source(60.0 * minute, 0) for minute in range(A_DAY)])
    return np.array(made, dtype=np.float64)


def normal_days(row: Row, study: Study) -> Array:
    """The same of a normal distribution of the table's mean and deviation, (k, 1440) [s]."""
    seeds = range(study.seed, study.seed + study.runs)
    return np.array([np.random.default_rng([seed, 19]).normal(row.mean, row.deviation, A_DAY) for seed in seeds])


def work(study: Study, _case: str) -> Findings:
    """What is fitted, and what comes of it by itself: how long the longest delay of a day is."""
    fitted, tails, rows = dict[int, list[float]](), [], []
    for profile, row in PRINTED.items():
        mean, deviation = moments(profile)
        off = max(abs(mean / row.mean - 1), abs(deviation / row.deviation - 1))
        fitted.setdefault(row.table, []).append(100 * off)
        ours, normal = (_longest(made, row, study) for made in (days(profile, study), normal_days(row, study)))
        tails.append(
            at_least(
                f"{profile}: the longest delay of a day, one a minute, as a share of the table's, median",
                f"Table {row.table}; {OWN_BAR}", 0.5, ours,
                ("a normal distribution of that mean and deviation", normal),
            )
        )  # fmt: skip
        rows.append((profile, row.mean, mean, row.deviation, deviation, row.high, ours.value * row.high))
    inputs = tuple(
        Claim(
            "means and standard deviations, to which the profiles are fitted: largest deviation [%]",
            f"Table {table}", f"≤ {FITTED:g}", max(off), max(off) <= FITTED,
        )
        for table, off in fitted.items()
    )  # fmt: skip
    columns = (
        "row", "mean [s]", "ours [s]", "standard deviation [s]", "ours [s]", "longest [s]",
        "ours, of a day, median [s]",
    )  # fmt: skip
    return Findings((*inputs, *tails), (Table("delays", "Tables 1 and 2", columns, tuple(rows)),))


def _longest(made: Array, row: Row, study: Study) -> Estimate:
    return bootstrap(made.max(axis=1) / row.high, study.seed, median)
