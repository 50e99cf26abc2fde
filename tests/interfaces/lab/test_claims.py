"""What a claim asks for follows from its bar, and a table's columns stand at its cells."""

from __future__ import annotations

import pytest

from interfaces.lab.claims import Claim, Table, above, at_least, at_most, below_zero, none_of
from interfaces.lab.statistics import Estimate

WIDE = Estimate(1.0, 0.5, 2.0)


def test_a_bar_of_a_number_is_met_or_missed() -> None:
    assert at_most("gap [m]", "Fig. 1", 1e-9, 1e-9) == Claim("gap [m]", "Fig. 1", "≤ 1e-9", 1e-9, True)
    assert at_most("late", "Fig. 1", 0.02, 0.03, note=", a frame").expected == "≤ 0.02, a frame"
    assert [at_most("", "", 1, x, slack=1e-9).holds for x in (1.0, 1 + 9e-10, 1 + 2e-9)] == [True, True, False]
    assert [at_least("", "", 0.97, x).holds for x in (0.96, 0.97)] == [False, True]
    assert [above("", "", 0, x).holds for x in (0, 1)] == [False, True]
    assert (at_least("", "", 0.97, 1.0).expected, above("", "", 0, 1).expected) == ("≥ 0.97", "> 0")


def test_of_an_estimate_the_nearer_end_of_its_interval_counts() -> None:
    assert at_most("", "", 2.0, WIDE) == Claim("", "", "≤ 2", 1.0, True, (0.5, 2.0))
    assert not at_most("", "", 1.9, WIDE).holds
    assert [at_least("", "", bar, WIDE).holds for bar in (0.5, 0.6)] == [True, False]
    assert [above("", "", bar, WIDE).holds for bar in (0.4, 0.5)] == [True, False]
    assert [below_zero("", "", Estimate(-1.0, -2.0, high)).holds for high in (-0.1, 0.0)] == [True, False]


def test_none_are_found_only_where_there_was_something_to_look_at() -> None:
    assert none_of("lost", "", 0) == Claim("lost", "", 0, 0, True)
    assert not none_of("lost", "", 1).holds
    assert not none_of("changed", "", 0, of=0).holds


def test_a_tables_columns_are_named_at_its_cells() -> None:
    rows = [(("hand", name), ("lag s", lag), ("max", lag), ("max", None)) for name, lag in (("1", 0.1), ("2", 0.2))]
    made = Table.of("lags", "Lags", rows)
    assert made == Table(
        "lags", "Lags", ("hand", "lag s", "max", "max"), (("1", 0.1, 0.1, None), ("2", 0.2, 0.2, None))
    )
    with pytest.raises(ValueError, match="too many values"):
        Table.of("lags", "Lags", [rows[0], rows[1][::-1]])
