"""The rows that the body has yet to follow."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from interfaces.runtime.tick_loop import KEPT, RowBuffer
from vrs.model import Array


class Keeper:
    """The rule of the buffer, in a dictionary."""

    def __init__(self) -> None:
        self.rows: dict[int, Array] = {}
        self.starts: list[int] = []

    def put(self, start: int, rows: Array) -> None:
        self.rows = {k: row for k, row in self.rows.items() if k < start}
        self.rows.update({start + i: row for i, row in enumerate(rows)})

    def at(self, tick: int) -> Array | None:
        before = [k for k in self.rows if k <= tick]
        if not before:
            return None
        row = self.rows[max(before)]
        if max(before) == tick:
            return row
        return None if row[1].any() else np.stack([row[0], 0 * row[1], 0 * row[2]])


@given(st.lists(st.tuples(st.integers(-3, 25), st.integers(1, 12), st.booleans()), max_size=40))
def test_later_rows_count_instead_of_earlier_ones(blocks: list[tuple[int, int, bool]]) -> None:
    buffer, keeper, rng = RowBuffer(), Keeper(), np.random.default_rng(len(blocks))
    for tick, (ahead, count, rests) in enumerate(blocks):
        block = rng.uniform(-1, 1, (count, 3, 2))
        block[-1, 1] *= not rests
        assert buffer.put(tick + ahead, block)
        keeper.put(tick + ahead, block)
        expected, taken = keeper.at(tick), buffer.take(tick, 3)
        assert (expected is None) == (taken is None)
        if taken is not None:
            assert 1 <= len(taken) <= 3
            for i, row in enumerate(taken):
                assert np.array_equal(row, keeper.at(tick + i))  # type: ignore[arg-type]
        kept = {start + i: row for start, part in buffer.kept(tick) for i, row in enumerate(part)}
        assert sorted(kept) == [k for k in sorted(keeper.rows) if k <= tick]
        assert all(np.array_equal(row, keeper.rows[k]) for k, row in kept.items())


def test_rows_are_kept_for_a_while_after_their_tick() -> None:
    buffer = RowBuffer()
    assert buffer.put(0, np.zeros((2 * KEPT, 3, 1)))
    assert buffer.put(2 * KEPT, np.zeros((1, 3, 1)))
    tick = 2 * KEPT + 10
    assert [(start, len(rows)) for start, rows in buffer.kept(tick)] == [(2 * KEPT, 1), (tick - KEPT, KEPT - 10)]
