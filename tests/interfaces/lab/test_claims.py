"""What a claim asks for follows from its bar, and a table's columns stand at its cells."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest

from interfaces.lab.claims import (
    Claim,
    Counterfactual,
    Table,
    Verdict,
    above,
    all_of,
    at_least,
    at_most,
    below_zero,
    none_of,
)
from interfaces.lab.statistics import Estimate

WIDE = Estimate(1.0, 0.5, 2.0)


def test_a_bar_of_a_number_is_met_or_missed() -> None:
    assert at_most("gap [m]", "Fig. 1", 1e-9, 1e-9) == Claim("gap [m]", "Fig. 1", "≤ 1e-9", 1e-9, True)
    assert at_most("late", "Fig. 1", 0.02, 0.03, note=", a frame").expected == "≤ 0.02, a frame"
    assert [at_most("", "", 1, x, slack=1e-9).met for x in (1.0, 1 + 9e-10, 1 + 2e-9)] == [True, True, False]
    assert [at_least("", "", 0.97, x).met for x in (0.96, 0.97)] == [False, True]
    assert [above("", "", 0, x).met for x in (0, 1)] == [False, True]
    assert (at_least("", "", 0.97, 1.0).expected, above("", "", 0, 1).expected) == ("≥ 0.97", "> 0")


def test_of_an_estimate_the_nearer_end_of_its_interval_counts() -> None:
    assert at_most("", "", 2.0, WIDE) == Claim("", "", "≤ 2", 1.0, True, (0.5, 2.0))
    assert not at_most("", "", 1.9, WIDE).met
    assert [at_least("", "", bar, WIDE).met for bar in (0.5, 0.6)] == [True, False]
    assert [above("", "", bar, WIDE).met for bar in (0.4, 0.5)] == [True, False]
    assert [below_zero("", "", Estimate(-1.0, -2.0, high)).met for high in (-0.1, 0.0)] == [True, False]


def test_none_are_found_only_where_there_was_something_to_look_at() -> None:
    assert none_of("lost", "", 0) == Claim("lost", "", 0, 0, True)
    assert not none_of("lost", "", 1).met
    assert not none_of("changed", "", 0, of=0).met


@pytest.mark.parametrize(
    ("make", "good", "bad"),
    [
        (partial(at_most, "", "", 2.0), 1.0, 3.0),
        (partial(at_least, "", "", 2.0), 3.0, 1.0),
        (partial(above, "", "", 2.0), 3.0, 2.0),
        (partial(none_of, "", ""), 0, 1),
        (partial(all_of, "", "", of=5), 5, 4),
    ],
)
def test_what_would_be_so_without_it_isnt_shown(make: Any, good: float, bad: float) -> None:
    shown, anyway = (make(good, without=("switched off", figure)) for figure in (bad, good))
    assert (shown.verdict, anyway.verdict, make(good).verdict) == (
        Verdict.HOLDS, Verdict.NOT_SHOWN, Verdict.NOT_SHOWN,
    )  # fmt: skip
    assert [make(bad, without=("switched off", figure)).verdict for figure in (bad, good)] == [Verdict.FAILS] * 2
    assert shown.counterfactual == Counterfactual("switched off", bad, met=False)
    assert (shown.holds, anyway.holds, shown.is_ours) == (True, False, False)


def test_without_it_no_end_of_the_interval_may_keep_the_bar() -> None:
    cases = [(bar, at_most("", "", bar, 0.0, without=("off", WIDE)).verdict) for bar in (0.4, 0.5, 1.5, 3.0)]
    assert [verdict is Verdict.HOLDS for _, verdict in cases] == [True, False, False, False]
    less = Estimate(-1.0, -2.0, -0.1)
    assert below_zero("", "", less, without=("off", WIDE)).holds
    assert not below_zero("", "", less, without=("off", Estimate(1.0, -0.1, 2.0))).holds


def test_a_tables_columns_are_named_at_its_cells() -> None:
    rows = [(("hand", name), ("lag s", lag), ("max", lag), ("max", None)) for name, lag in (("1", 0.1), ("2", 0.2))]
    made = Table.of("lags", "Lags", rows)
    assert made == Table(
        "lags", "Lags", ("hand", "lag s", "max", "max"), (("1", 0.1, 0.1, None), ("2", 0.2, 0.2, None))
    )
    with pytest.raises(ValueError, match="too many values"):
        Table.of("lags", "Lags", [rows[0], rows[1][::-1]])
