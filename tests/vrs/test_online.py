from __future__ import annotations

import numpy as np
import pytest

from robots import puma560
from vrs import Limits, Profile
from vrs.planning import Plan, move, parabolic
from vrs.planning.online import least_change, online
from vrs.planning.plan import parabolas
from vrs.segment import State

LIMITS = puma560.model().limits
ZERO = np.zeros(6)


def effects(h: np.ndarray, order: int) -> np.ndarray:
    """What each piece's control does to q, qd (and qdd) at the end, (order, m), by exact integration."""
    left = h.sum() - h.cumsum()
    rows = [h * (left + 0.5 * h), h]
    if order == 3:
        rows.insert(0, h * (0.5 * left * left + 0.5 * left * h + h * h / 6.0))
    return np.array(rows)


@pytest.mark.parametrize("order", [2, 3])
def test_the_least_change_meets_what_is_missing_and_is_the_least(order: int):
    rng = np.random.default_rng(0)
    for k in range(200):
        h = rng.uniform(1e-3, 1.0, rng.integers(order, 30))
        if k % 2:
            # One long cruise outweighs the rest.
            h[rng.integers(len(h))] = 10.0 ** rng.uniform(1, 3)
        W, missing = effects(h, order), rng.normal(size=(order, 6)) * 1e-8
        change = least_change(h, missing)
        scale = np.abs(W).sum(1)[:, None] * np.abs(change).max(0)
        assert (np.abs(W @ change - missing) <= 1e-13 * scale + 1e-22).all()
        # The least of all is a combination of the rows.
        units = W / np.linalg.norm(W, axis=1)[:, None]
        outside = change - units.T @ np.linalg.lstsq(units.T, change, rcond=None)[0]
        assert np.abs(outside).max() <= 1e-14 * np.linalg.cond(units) * np.abs(change).max()


def test_pieces_too_few_for_all_are_changed_as_far_as_they_can_be():
    """One can't add speed and position apart from each other; two can't add acceleration, too."""
    change = least_change(np.array([2.0]), np.array([[5.0], [6.0]]))
    assert change == pytest.approx(np.array([[3.0]]))
    rng = np.random.default_rng(3)
    for _ in range(50):
        h, x = rng.uniform(0.1, 1.0, 2), rng.normal(size=(2, 6))
        assert least_change(h, effects(h, 3) @ x) == pytest.approx(x, abs=1e-11)


def test_what_was_planned_before_leaves_no_trace():
    rng = np.random.default_rng(1)
    one = np.ones(1)
    small = Limits(-3 * one, 3 * one, one, 4 * one)
    starts = [State(*(0.2 * rng.uniform(-1, 1, (3, 6)) * [[1.0], [1.0], [0.5]])) for _ in range(5)]
    goals = rng.uniform(LIMITS.q_min, LIMITS.q_max, (5, 6))
    made: list[list[Plan]] = []
    for _ in range(2):
        plans = []
        for start, q in zip(starts, goals, strict=True):
            for order in (3, 2):
                found = online(start, State(q, ZERO, ZERO), 0.7, LIMITS, order=order)
                if found is not None:
                    plans.append(found)
            # Other joints, limits and accelerations, and one that fails, in between.
            assert online(State(0 * one, 0.3 * one, one), State(one, 0 * one, 0 * one), 1.0, small, order=3)
            assert online(State(0 * one, 9 * one, one), State(one, 0 * one, 0 * one), 1.0, small, order=3) is None
        made.append(plans)
    assert len(made[0]) >= 8
    for a, b in zip(*made, strict=True):
        assert np.array_equal(a.durations, b.durations)
        assert np.array_equal(a.coefficients, b.coefficients)


@pytest.mark.parametrize("profile", list(Profile))
def test_plans_know_which_coefficients_are_zero(profile: Profile):
    rng = np.random.default_rng(2)
    known = 0
    for _ in range(100):
        start, via, goal = rng.uniform(LIMITS.q_min, LIMITS.q_max, (3, 6))
        via = np.where(rng.random(6) < 0.3, 0.5 * start, 0.5 * via)
        first, _ = move(State(start, ZERO, ZERO), via, 1.0, profile, LIMITS)
        moving = State(via, 0.3 * rng.uniform(-1, 1, 6) * LIMITS.qd_max, ZERO)
        for plan in (first, move(moving, goal, 1.0, profile, LIMITS)[0]):
            orders = [max(np.flatnonzero(a.any(axis=1)), default=0) + 1 for a in plan.coefficients]
            if plan.orders is not None:
                known += 1
                assert list(plan.orders) == orders
            assert [len(row) for row in plan.rows()] == orders
    assert known >= 100


def test_parabolas_that_stand_or_do_not_bend_are_of_lower_degree():
    zero, one = [0.0, 0.0], [0.0, 1.0]
    plan = parabolas([1.0, 2.0, 3.0], [one, one, one, one, one, zero, one, zero, zero])
    assert [len(row) for row in plan.rows()] == [3, 2, 1]
    assert plan.durations.tolist() == [1.0, 2.0, 3.0]
    assert plan.coefficients[1].tolist() == [one, one, zero]
    assert parabolic.rest_to_rest(ZERO, LIMITS.q_max, 1.0, LIMITS).orders
