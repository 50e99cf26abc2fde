"""Values on 80 columns."""

from __future__ import annotations

import pytest

from interfaces.val2.monitor import layout
from interfaces.val2.printer import print_expression
from interfaces.val2.syntax import Number, Variable


@pytest.mark.parametrize(
    ("value", "decimals", "shown"),
    [(-0.001, 2, "0.00"), (-0.0, 0, "0"), (-0.005001, 2, "-0.01"), (0.0, 3, "0.000"), (-1.5, 1, "-1.5")],
)
def test_nothing_is_never_below_zero(value: float, decimals: int, shown: str) -> None:
    assert layout.fixed(value, decimals) == shown


def test_a_text_stays_on_its_line() -> None:
    assert layout.visible("a\x1b[2J\r\n\u202eé b") == "a·[2J···é b"
    assert layout.values({"$x": "a\nb"}) == ['$x = "a·b"']


def test_a_variable_is_written_with_its_indices() -> None:
    indices = tuple(map(Number, (1.0, -2.0, 0.5)))
    assert print_expression(Variable("a", indices)) == "a[1,-2,0.5]"
    assert print_expression(Variable("#p")) == "#p"


def test_words_stand_in_order_down_the_columns() -> None:
    words = [f"word{n:02}" for n in range(21)]
    lines = layout.in_columns(reversed(words))
    assert len(lines) == 3
    assert [line.split() for line in lines] == [words[0::3], words[1::3], words[2::3]]
    assert max(map(len, lines)) <= layout.WIDTH
    assert layout.in_columns([]) == []
