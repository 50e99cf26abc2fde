"""The virtual environment: eq. (16)–(17) against a literal evaluation in small steps, and rays against boxes."""

from __future__ import annotations

import math
import random
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vrs.errors import InvalidValueError
from vrs.mobile import Grid, VirtualEnvironment, cast

close = partial(np.testing.assert_allclose, rtol=0.0)

BLOCK = [(5, 5), (5, 6), (6, 5), (6, 6)]


def made(shape=(12, 10), **more):
    return VirtualEnvironment(shape, gamma=1.0, **more)


def test_the_papers_size_is_the_default():
    assert VirtualEnvironment().occupied(0.0).shape == (125, 61)


def test_an_isolated_cell_dies_at_once():
    environment = made()
    assert environment.add([(3, 3)], 1.0) == ((3, 3),)
    assert not environment.occupied(1.0).any()
    assert not environment.lifetimes(1.0).any()


def test_a_block_lives_as_long_as_its_neighbours_let_it():
    environment = made()
    environment.add(BLOCK, 1.0)
    assert environment.lifetimes(2.0)[5, 5] == pytest.approx(math.exp(-1 / 3))
    assert environment.obstacles(3.99) == tuple(BLOCK)
    assert environment.occupied(3.99).sum() == 4
    assert not environment.occupied(4.0).any()


def test_what_is_seen_again_lives_anew_and_what_is_forgotten_is_gone():
    environment = made()
    environment.add(BLOCK, 1.0)
    environment.add(BLOCK, 3.0)
    assert environment.occupied(5.9).sum() == 4
    assert environment.forget([(5, 5), (0, 0)], 5.9) == ((5, 5),)
    # Two neighbours each are left, for 2 s from 3 s on, which is over.
    assert not environment.occupied(5.9).any()


def test_walls_stay_and_count_as_neighbours():
    walls = np.zeros((12, 10), bool)
    walls[0] = True
    environment = made(walls=walls)
    environment.add([(1, 4), (0, 4)], 0.0)
    environment.forget([(0, 4)], 0.0)
    assert environment.occupied(2.9).sum() == 11
    assert environment.occupied(3.0).sum() == 10
    corner = made(walls=walls)
    corner.add([(1, 0)], 0.0)
    assert corner.occupied(1.9)[1, 0]
    assert not corner.occupied(2.0)[1, 0]


@pytest.mark.parametrize("seed", range(6))
def test_any_history_is_the_printed_formula(seed):
    """Cells by eq. (16)–(17) at every event of a fine grid of times, neighbours counted as they are."""
    rng = random.Random(seed)
    m, n, step, gamma, threshold = 9, 8, 0.125, 1.0, math.exp(-1.0)
    walls = np.array([[rng.random() < 0.1 for _ in range(n)] for _ in range(m)])
    environment = VirtualEnvironment((m, n), gamma=gamma, threshold=threshold, walls=walls)
    cells, born = walls.copy(), {}

    def settle(t):
        while True:
            around = np.zeros((m, n))
            padded = np.pad(cells.astype(float), 1)
            for p in range(3):
                for q in range(3):
                    around += padded[p : p + m, q : q + n]
            around -= cells
            # ≤ with rounding: a lifetime that's at its threshold is over.
            dead = []
            for c, t0 in born.items():
                L = math.exp(-(t - t0) / (gamma * around[c])) if around[c] else 0.0
                if threshold * (1 + 1e-12) >= L:
                    dead.append(c)
            if not dead:
                return
            for c in dead:
                del born[c]
                cells[c] = False

    for k in range(80):
        t = k * step
        if rng.random() < 0.3:
            p, q = rng.randrange(m - 2), rng.randrange(n - 2)
            seen = [(p + a, q + b) for a in range(3) for b in range(3) if rng.random() < 0.7]
            environment.add(seen, t)
            for c in seen:
                if not walls[c]:
                    born[c], cells[c] = t, True
        if rng.random() < 0.1:
            gone = (rng.randrange(m), rng.randrange(n))
            environment.forget([gone], t)
            if born.pop(gone, None) is not None:
                cells[gone] = False
        settle(t)
        np.testing.assert_array_equal(environment.occupied(t), cells, err_msg=f"{t}")


def test_nothing_outlives_the_longest():
    environment = made()
    environment.add([(p, q) for p in range(12) for q in range(10)], 0.0)
    assert environment.longest == pytest.approx(8.0)
    assert not environment.occupied(environment.longest).any()


def test_time_runs_forward_and_cells_are_in_the_grid():
    environment = made()
    environment.add(BLOCK, 2.0)
    seen = environment.occupied(2.0)
    with pytest.raises(InvalidValueError, match="back"):
        environment.occupied(1.0)
    with pytest.raises(InvalidValueError, match="within"):
        environment.add([(12, 0)], 3.0)
    with pytest.raises(InvalidValueError, match="within"):
        environment.forget([(0, -1)], 3.0)
    with pytest.raises(InvalidValueError, match="finite"):
        environment.add(BLOCK, math.nan)
    assert environment.now == 2.0
    with pytest.raises(ValueError, match="read-only"):
        seen[0, 0] = True
    environment.add([(0, 0), (0, 1)], 2.5)
    assert not seen[0, 0]


@pytest.mark.parametrize(
    "bad", [{"cell": 0}, {"gamma": -1}, {"threshold": 1.0}, {"shape": (0, 5)}, {"walls": np.zeros((2, 2), bool)}]
)
def test_what_makes_no_environment_is_refused(bad):
    with pytest.raises(InvalidValueError):
        VirtualEnvironment(**{"shape": (12, 10), **bad})


def boxes(grid, occupied, origin, angles, reach):
    """Where rays enter boxes, one by one, by their slabs."""
    found = []
    for angle in angles:
        way = np.array([math.cos(angle), math.sin(angle)])
        nearest = reach
        for low in grid.corners(np.argwhere(occupied)):
            with np.errstate(divide="ignore"):
                ts = np.sort([(low - origin) / way, (low + grid.cell - origin) / way], axis=0)
            enter, leave = ts[0].max(), ts[1].min()
            if max(enter, 0.0) < leave:
                nearest = min(nearest, max(enter, 0.0))
        found.append(nearest)
    return np.array(found)


@settings(deadline=None, max_examples=150)
@given(st.integers(0, 10**6), st.floats(0.05, 0.5), st.floats(0.2, 20.0))
def test_rays_end_where_they_enter_the_nearest_box(seed, cell, reach):
    rng = np.random.default_rng(seed)
    grid = Grid((9, 7), cell, rng.uniform(-2, 2, 2))
    occupied = rng.random((9, 7)) < rng.choice([0.02, 0.2, 0.6])
    origin = grid.origin + cell * rng.uniform(-4, 13, 2)
    angles = rng.uniform(-7, 7, 12)
    expected = boxes(grid, occupied, origin, angles, reach)
    close(cast(grid, occupied, origin, angles, reach), expected, atol=1e-9)


@pytest.mark.parametrize(
    ("angle", "distance"), [(0.0, 2.0), (math.pi, 2.0), (math.pi / 2, 1.5), (-math.pi / 2, 9.0)]
)
def test_rays_along_the_grid(angle, distance):
    occupied = np.zeros((8, 8), bool)
    occupied[5, 3] = occupied[0, 3] = occupied[3, 5] = True
    got = cast(Grid((8, 8), 1.0), occupied, (3.0, 3.5), [angle], 9.0)
    assert got == pytest.approx([distance])


def test_an_origin_on_a_line_sees_both_ways():
    occupied = np.zeros((8, 8), bool)
    occupied[2, 3] = True
    grid = Grid((8, 8), 1.0)
    assert cast(grid, occupied, (3.0, 3.5), [math.pi], 9.0) == pytest.approx([0.0])
    assert cast(grid, occupied, (2.5, 3.5), [1.0], 9.0) == pytest.approx([0.0])
    environment = made()
    environment.add(BLOCK, 0.0)
    assert environment.cast((0.05, 0.55), [0.0], 3.0, 0.0) == pytest.approx([0.45])


def test_what_was_seen_earlier_lives_from_then():
    environment = made()
    environment.add(BLOCK, 3.0, formed=dict.fromkeys(BLOCK[:2], 1.0))
    # Three neighbours each: the first two die at 4 s, the others a second after having one neighbour each.
    assert environment.obstacles(3.9) == tuple(BLOCK)
    assert environment.obstacles(4.0) == ()
    again = made()
    again.add(BLOCK, 3.0)
    again.add(BLOCK, 3.5, formed=dict.fromkeys(BLOCK, 2.0))
    assert again.obstacles(5.9) == tuple(BLOCK)
    for wrong in (4.1, math.nan, math.inf):
        with pytest.raises(InvalidValueError):
            again.add(BLOCK, 4.0, formed={BLOCK[0]: wrong})
