"""The line of the path that is planned: few points, as near to the whole as it needs."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from interfaces.stream.meshcat.committed import SPACING, thinned


@given(st.lists(st.floats(0.01, 0.9), min_size=20, max_size=200), st.integers(0, 2**31))
def test_a_thinned_line_keeps_its_ends_and_no_points_that_crowd(steps: list[float], seed: int) -> None:
    gone = SPACING * np.cumsum([0.0, *steps])
    way = np.random.default_rng(seed).normal(size=3)
    points = gone[:, None] * way / np.linalg.norm(way)
    line = thinned(points)
    assert np.array_equal(line[[0, -1]], points[[0, -1]])
    at = np.linalg.norm(line, axis=1)
    assert np.isin(at.round(12), np.linalg.norm(points, axis=1).round(12)).all()
    between = np.diff(at)
    # A point wherever it has gone on by SPACING, each at most a step late; the last one gives way to the end.
    assert (between > 0).all()
    assert between.max() <= SPACING * (1.5 + 2 * max(steps)) + 1e-12
    assert len(line) <= gone[-1] / SPACING + 2
    assert len(line) < 3 or between[-1] > 0.499 * SPACING


def test_a_line_that_goes_nowhere_has_no_points() -> None:
    assert len(thinned(np.ones((30, 3)))) == 0
