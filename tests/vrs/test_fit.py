from __future__ import annotations

import numpy as np
import pytest

from vrs.errors import PlanningError
from vrs.planning.fit import fit
from vrs.planning.plan import Plan, end_state
from vrs.segment import State, evaluate

AMPLITUDE = np.array([2.5, -1.0, 0.3])
RATE = np.array([1.0, 3.0, 7.0])


def waves(t):
    phase = np.outer(t, RATE) + 0.3
    s, c = np.sin(phase), np.cos(phase)
    return AMPLITUDE * s, AMPLITUDE * RATE * c, -AMPLITUDE * RATE**2 * s


def sampled(plan: Plan, per_piece: int = 101):
    """Times since the start, and q, there, (k, n)."""
    starts = np.concatenate([[0.0], np.cumsum(plan.durations)[:-1]])
    t = [start + np.linspace(0, h, per_piece) for start, h in zip(starts, plan.durations, strict=True)]
    q = [
        evaluate(a, np.linspace(0, h, per_piece), 0) for a, h in zip(plan.coefficients, plan.durations, strict=True)
    ]
    return np.concatenate(t), np.concatenate(q)


def states_at_joints(plan: Plan) -> list[tuple[State, State]]:
    """The end of each piece and the start of the next."""
    pairs = []
    for i in range(len(plan) - 1):
        a = plan.coefficients[i + 1]
        end = end_state(Plan(plan.durations[i : i + 1], plan.coefficients[i : i + 1]))
        pairs.append((end, State(a[0], a[1], 2 * a[2])))
    return pairs


@pytest.mark.parametrize("tolerance", [1e-6, 1e-10, 1e-12])
def test_it_stays_within_the_tolerance_everywhere(tolerance: float):
    plan = fit(waves, np.array([0.5, 1.0, 4.0]), tolerance)
    t, q = sampled(plan)
    assert np.abs(q - waves(t + 0.5)[0]).max() < 1.5 * tolerance + 1e-14


def test_pieces_share_position_speed_and_acceleration():
    plan = fit(waves, np.linspace(0.0, 3.0, 7))
    for end, start in states_at_joints(plan):
        assert np.abs(end.q - start.q).max() < 1e-14
        assert np.abs(end.qd - start.qd).max() < 1e-12
        assert np.abs(end.qdd - start.qdd).max() < 1e-10


def test_short_pieces_share_them_too():
    plan = fit(waves, 0.3 + np.linspace(0.0, 0.05, 6))
    for end, start in states_at_joints(plan):
        assert np.abs(end.q - start.q).max() < 1e-14
        assert np.abs(end.qd - start.qd).max() < 1e-12
        assert np.abs(end.qdd - start.qdd).max() < 1e-9


def test_it_begins_to_the_bit_and_lasts_as_long_as_the_knots():
    knots = np.array([0.25, 0.75, 2.0])
    plan = fit(waves, knots)
    q, qd, qdd = waves(knots[:1])
    assert np.array_equal(plan.coefficients[0, 0], q[0])
    assert np.array_equal(plan.coefficients[0, 1], qd[0])
    assert np.array_equal(2 * plan.coefficients[0, 2], qdd[0])
    assert plan.duration == pytest.approx(1.75, abs=1e-15)
    assert set(np.round(knots - 0.25, 12)) <= set(np.round([0.0, *np.cumsum(plan.durations)], 12))


def test_polynomials_come_back_as_they_are():
    cubic = np.array([[1.0, -2.0], [0.5, 0.1], [3.0, 0.0], [-1.0, 4.0]])

    def motion(t):
        return tuple(evaluate(cubic, t, order) for order in range(3))

    plan = fit(motion, np.array([0.0, 1.5]))
    assert len(plan) == 1
    assert plan.coefficients.shape[1] <= 6
    assert np.allclose(plan.coefficients[0, :4], cubic, atol=1e-12)


def test_it_halves_only_where_it_must():
    def motion(t):
        x = t[:, None] - 1.0
        r = np.sqrt(x * x + 1e-4)
        return r, x / r, 1e-4 / r**3

    plan = fit(motion, np.array([0.0, 2.0]), 1e-9)
    t, q = sampled(plan)
    assert np.abs(q - motion(t)[0]).max() < 1.5e-9
    assert plan.durations.max() / plan.durations.min() >= 16


def test_a_motion_that_jumps_is_refused():
    def motion(t):
        step = np.where(t < 0.3, 0.0, 1.0)[:, None]
        return step, 0 * step, 0 * step

    with pytest.raises(PlanningError, match=r"0\.(29998|3)"):
        fit(motion, np.array([0.0, 1.0]))
