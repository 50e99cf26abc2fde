"""The virtual robot never enters an occupied cell, and still gets somewhere."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import numpy as np
import pytest

from robots import ipr
from vrs.errors import InvalidValueError
from vrs.mobile import Avoidance, Grid, advanced

MODEL = ipr.model()
T = MODEL.period


def clearance(grid, occupied, point):
    """Distance of a point to the nearest occupied cell [m]."""
    low = grid.corners(np.argwhere(occupied))
    if not len(low):
        return math.inf
    gap = np.maximum(np.maximum(low - point, point - (low + grid.cell)), 0.0)
    return float(np.hypot(*gap.T).min())


def run(avoidance, grid, occupied, posture, inputs):
    """Drive, and look at ten instants of each period: the smallest clearance, the commands, the postures."""
    before, least, commands, path = (0.0, 0.0), math.inf, [], [posture]
    for asked in inputs:
        u = avoidance.command(asked, before, posture, grid, occupied)
        for k in range(1, 11):
            x, y, _ = advanced(posture, *u, T * k / 10)
            least = min(least, clearance(grid, occupied, (x, y)))
        posture, before = advanced(posture, *u, T), u
        commands.append(u)
        path.append(posture)
    return least, commands, path


@pytest.mark.parametrize("seed", range(12))
def test_in_random_worlds_it_never_enters_an_occupied_cell(seed):
    rng = random.Random(seed)
    cells = np.random.default_rng(seed)
    grid = Grid((50, 40), 0.1, (-1.0, -2.0))
    occupied = cells.random((50, 40)) < rng.choice([0.005, 0.02, 0.05])
    radius = rng.choice([0.1, 0.2, 0.39])
    avoidance = Avoidance(MODEL.limits, radius, T)
    start = next(
        (x, y) for x, y in cells.uniform((-0.5, -1.5), (3.5, 1.5), (4000, 2)).tolist()
        if clearance(grid, occupied, (x, y)) > radius
    )  # fmt: skip
    inputs, asked = [], (0.0, 0.0)
    for k in range(150):
        if k % 12 == 0:
            asked = (rng.choice([0.5, 0.5, -0.5, rng.uniform(-0.5, 0.5)]), rng.uniform(-1, 1) * rng.choice([0, 1]))
        inputs.append(asked)
    posture = (*start, rng.uniform(-4, 4))
    least, commands, _ = run(avoidance, grid, occupied, posture, inputs)
    assert least >= radius - 1e-9
    stairs = [(0.0, 0.0), *commands]
    for (v, w), (after_v, after_w) in pairwise(stairs):
        assert abs(after_v - v) <= MODEL.limits.a_max * T * (1 + 1e-8)
        assert abs(after_w - w) <= MODEL.limits.alpha_max * T * (1 + 1e-8)
        assert not MODEL.limits.refusal(after_v, after_w)


def wall_ahead(gap=None):
    occupied = np.zeros((60, 60), bool)
    occupied[40] = True
    if gap is not None:
        occupied[40, gap] = False
    return Grid((60, 60), 0.1), occupied


def test_it_stops_before_a_wall_and_near_it():
    grid, occupied = wall_ahead()
    occupied[:, 24:26] = occupied[:, 35:37] = True
    avoidance = Avoidance(MODEL.limits, 0.3, T)
    least, commands, path = run(avoidance, grid, occupied, (1.0, 3.0, 0.0), [(0.5, 0.0)] * 200)
    assert 0.3 <= least <= 0.36
    assert abs(commands[-1][0]) < 1e-2
    _, _, path = run(avoidance, grid, occupied, path[-1], [(-0.5, 0.0)] * 40)
    assert path[-1][0] < 3.0


def test_it_may_back_away_from_a_wall():
    grid, occupied = wall_ahead()
    avoidance = Avoidance(MODEL.limits, 0.3, T)
    _, commands, path = run(avoidance, grid, occupied, (3.69, 3.0, 0.0), [(-0.5, 0.0)] * 20)
    assert commands[-1][0] == pytest.approx(-0.5)
    assert path[-1][0] < 3.3


def test_a_cell_that_appears_under_the_robot_lets_it_go():
    grid, occupied = wall_ahead()
    avoidance = Avoidance(MODEL.limits, 0.3, T)
    _, _, path = run(avoidance, grid, occupied, (3.8, 3.0, 0.0), [(-0.5, 0.0)] * 20)
    assert path[-1][0] < 3.4
    least, _, _ = run(avoidance, grid, occupied, (3.8, 3.0, 0.0), [(0.5, 0.0)] * 20)
    assert least >= 0.2 - 1e-6


def test_it_goes_past_a_block_in_its_way():
    occupied = np.zeros((80, 60), bool)
    occupied[35:38, 29:31] = True
    grid = Grid((80, 60), 0.1)
    avoidance = Avoidance(MODEL.limits, 0.3, T)
    least, _, path = run(avoidance, grid, occupied, (1.0, 3.0, 0.0), [(0.4, 0.0)] * 150)
    assert least >= 0.3 - 1e-9
    assert max(abs(y - 3.0) for _, y, _ in path) > 0.35
    assert path[-1][0] > 4.2


def test_in_the_open_it_does_what_is_asked():
    grid, occupied = Grid((30, 30), 0.1), np.zeros((30, 30), bool)
    avoidance = Avoidance(MODEL.limits, 0.3, T)
    assert avoidance.command((0.3, 0.2), (0.3, 0.2), (1.5, 1.5, 1.0), grid, occupied) == (0.3, 0.2)
    assert avoidance.command((0.0, 0.7), (0.0, 0.7), (1.5, 1.5, 1.0), grid, occupied) == (0.0, 0.7)


def test_what_makes_no_avoidance_is_refused():
    with pytest.raises(InvalidValueError, match="radius"):
        Avoidance(MODEL.limits, 0.0)
    with pytest.raises(InvalidValueError, match="sectors"):
        Avoidance(MODEL.limits, 0.3, sectors=2)
