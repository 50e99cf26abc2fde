"""The match is the best there is: held against a plain dynamic programme without any shortcut."""

from __future__ import annotations

import numpy as np
import pytest

from vrs.comparison import best_match, match_paths, resample
from vrs.model import Array


def plainly(t: Array, follower: Array, t_leader: Array, path: Array, advance: int) -> tuple[list[int], float]:
    """Every cell at every time, in Python; ties go to the smaller advance."""
    cells = len(path)
    cost = [[float("inf")] * cells for _ in t]
    came = [[0] * cells for _ in t]
    for k, now in enumerate(t):
        for j in range(cells):
            if t_leader[j] > now + 1e-9:
                break
            apart = float(np.sum((path[j] - follower[k]) ** 2))
            if k == 0:
                cost[k][j] = apart if j == 0 else float("inf")
                continue
            for a in range(min(advance, j) + 1):
                if cost[k - 1][j - a] + apart < cost[k][j]:
                    cost[k][j], came[k][j] = cost[k - 1][j - a] + apart, a
    j = int(np.argmin(cost[-1]))
    total = cost[-1][j]
    match = [j]
    for k in range(len(t) - 1, 0, -1):
        j -= came[k][j]
        match.append(j)
    return match[::-1], total


@pytest.mark.parametrize("seed", range(12))
def test_the_match_is_that_of_a_plain_programme(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells, steps, advance = 60, 80, 5
    turn = np.cumsum(rng.normal(0.0, 0.15, cells))
    path = 0.01 * np.cumsum(np.column_stack([np.cos(turn), np.sin(turn)]), axis=0)
    t = 0.05 * np.arange(steps)
    t_leader = np.sort(rng.uniform(0.0, 2.5, cells))
    t_leader[0] = 0.0
    place = np.clip(np.cumsum(rng.uniform(0.0, 1.6, steps)) - 8.0, 0.0, cells - 1.0)
    follower = np.column_stack([np.interp(place, np.arange(cells), path[:, i]) for i in (0, 1)])
    follower += rng.normal(0.0, (0.0, 0.004, 0.2)[seed % 3], follower.shape)
    expected, total = plainly(t, follower, t_leader, path, advance)
    match = best_match(t, follower, t_leader, path, advance)
    assert match.tolist() == expected
    assert np.sum((path[match] - follower) ** 2) == pytest.approx(total, rel=1e-12)


def test_standing_on_equal_cells_takes_the_smaller_advance() -> None:
    path = np.zeros((6, 2))
    follower = np.zeros((5, 2))
    match = best_match(np.arange(5) * 0.05, follower, np.zeros(6), path, 5)
    assert match.tolist() == [0, 0, 0, 0, 0]


def test_a_match_tells_the_delay_cell_by_cell() -> None:
    t = np.arange(0.0, 30.0, 0.05)
    x = 0.3 * np.clip(t, 0.0, 20.0)
    leader = np.column_stack([x, np.zeros_like(x)])
    follower = np.column_stack([0.3 * np.clip(t - 2.0, 0.0, 20.0), np.full_like(x, 0.04)])
    found = match_paths(t, leader, follower)
    cells, late = found.time_difference
    assert len(cells) == len(late) > 590
    assert late == pytest.approx(2.0, abs=0.02)
    assert found.distance == pytest.approx(0.04, abs=1e-9)


def test_a_narrow_curve_is_not_cut() -> None:
    t = np.arange(0.0, 20.0, 0.01)
    angle = 2.0 * np.minimum(t, 15.0)
    leader = 0.03 * np.stack((np.cos(angle), np.sin(angle), 0.1 * angle), axis=1)
    follower = resample(t, leader, t - 0.5)
    match = match_paths(t, leader, follower)
    # A chord from cell to cell would be 0.4 mm off.
    assert match.distance.max() < 2e-6
