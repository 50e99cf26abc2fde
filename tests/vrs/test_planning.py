from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots import puma560
from vrs import Engine, JointTarget, MotionCommand, Profile
from vrs.chunk import State
from vrs.planning import jerk_limited, move, parabolic, run_up, violation
from vrs.planning.online import online
from vrs.planning.plan import Plan, end_state, integrate

LIMITS = puma560.model().limits
ZERO = np.zeros(6)
PROFILES = (Profile.PARABOLIC, Profile.JERK_LIMITED)


def reachable_state(rng: np.random.Generator) -> State:
    """A moving state that some plan within the limits passes through."""
    start, goal = rng.uniform(LIMITS.q_min, LIMITS.q_max, (2, 6))
    plan, _ = move(State(start, ZERO, ZERO), goal, 1.0, PROFILES[rng.integers(2)], LIMITS)
    i = int(rng.integers(len(plan)))
    h = float(plan.durations[i] * rng.random())
    return end_state(Plan(np.array([h]), plan.coefficients[i : i + 1]))


def test_from_rest_it_is_the_papers_three_segments():
    q = np.array([1.0, 0.5, -0.7, 0.2, 0.1, -1.0])
    plan = parabolic.rest_to_rest(ZERO, q, 1.0, LIMITS)
    assert len(plan) == 3
    assert np.array_equal(plan.coefficients[1][2], ZERO)
    rate = (LIMITS.qd_max / np.abs(q)).min()
    growth = (LIMITS.qdd_max / np.abs(q)).min()
    assert plan.duration == pytest.approx(1 / rate + rate / growth, rel=1e-12)
    assert plan.durations[0] == plan.durations[2]


def test_short_moves_have_two_segments_and_still_one_no_segment():
    assert len(parabolic.rest_to_rest(ZERO, np.full(6, 0.01), 1.0, LIMITS)) == 2
    assert len(parabolic.rest_to_rest(ZERO, ZERO, 1.0, LIMITS)) == 0
    assert len(jerk_limited.rest_to_rest(ZERO, ZERO, 1.0, LIMITS)) == 0


def test_redirecting_in_the_linear_part_gives_figure_1():
    engine = Engine(puma560.model(), q=np.array([0, 0.5, -1.5, 0, 0.3, 0]))
    first = engine.execute(MotionCommand(JointTarget([1.5, 1.2, -2.5, 0.5, 0.8, 0.5]), execute_at=0.0))
    s1, s2, _ = engine.timeline.segments
    t = s2.start + 0.4 * s2.duration
    engine.execute(MotionCommand(JointTarget([1.2, 0.2, -1.0, 0.9, -0.3, 1.0]), execute_at=t))
    new = engine.timeline.segments
    assert len(new) == 5
    assert new[0] == s1
    assert np.array_equal(new[1].coefficients, s2.coefficients)
    assert new[2].start == pytest.approx(t, abs=1e-12)
    assert [segment.degree for segment in new] == [2, 1, 2, 1, 2]
    assert engine.receipt(first.command_id).superseded_by == 2


@pytest.mark.parametrize("profile", PROFILES)
def test_plans_from_any_state_arrive_together_within_every_limit(profile: Profile):
    rng = np.random.default_rng(4)
    for _ in range(300):
        state = reachable_state(rng)
        goal = rng.uniform(LIMITS.q_min, LIMITS.q_max)
        speed = float(rng.uniform(0.05, 1.0))
        plan, note = move(state, goal, speed, profile, LIMITS)
        assert violation(plan, LIMITS, jerk=profile is Profile.JERK_LIMITED and not note) is None
        end = end_state(plan)
        assert np.abs(end.q - goal).max() < 1e-10
        assert np.abs(end.qd).max() < 1e-10
        assert np.allclose(plan.coefficients[0, 0], state.q, atol=1e-15)
        assert np.allclose(plan.coefficients[0, 1], state.qd, atol=1e-12)


def test_speed_scales_the_speed_and_not_the_acceleration():
    q = np.array([1.0, 0.5, -0.7, 0.2, 0.1, -1.0])
    for v in (0.1, 0.5, 1.0):
        plan = parabolic.rest_to_rest(ZERO, q, v, LIMITS)
        assert np.max(np.abs(plan.coefficients[1][1]) / LIMITS.qd_max) == pytest.approx(v)
        assert np.max(np.abs(2 * plan.coefficients[0][2]) / LIMITS.qdd_max) == pytest.approx(1.0)


@given(st.floats(1e-9, 5.0), st.floats(0.01, 1.0))
@settings(max_examples=200, deadline=None)
def test_jerk_limited_rest_to_rest_is_as_fast_as_ruckig(distance: float, speed: float):
    ruckig = pytest.importorskip("ruckig")
    q = np.clip(np.full(6, distance) * np.array([1, 0.5, -0.4, 0.3, 0.1, -1]), LIMITS.q_min, LIMITS.q_max)
    ours = jerk_limited.rest_to_rest(ZERO, q, speed, LIMITS)
    problem = ruckig.InputParameter(1)
    problem.current_position, problem.target_position = [0.0], [1.0]
    moving = np.abs(q) > 0
    bounds = (speed * LIMITS.qd_max, LIMITS.qdd_max, LIMITS.qddd_max)
    rate, growth, jerk = (float((b[moving] / np.abs(q)[moving]).min()) for b in bounds)
    problem.max_velocity, problem.max_acceleration, problem.max_jerk = [rate], [growth], [jerk]
    theirs = ruckig.Trajectory(1)
    if ruckig.Ruckig(1).calculate(problem, theirs) == ruckig.Result.Working:
        assert ours.duration == pytest.approx(theirs.duration, rel=1e-6)
    assert violation(ours, LIMITS, jerk=True) is None


@pytest.mark.parametrize("profile", PROFILES)
def test_a_run_up_meets_a_moving_state(profile: Profile):
    rng = np.random.default_rng(5)
    met = 0
    for _ in range(200):
        goal = reachable_state(rng)
        start = rng.uniform(LIMITS.q_min, LIMITS.q_max)
        plan, _ = run_up(start, goal, 0.5, profile, LIMITS)
        assert violation(plan, LIMITS, jerk=False) is None
        end = end_state(plan)
        assert np.abs(end.q - goal.q).max() < 1e-9
        assert np.abs(end.qd - goal.qd).max() < 1e-9
        met += 1
    assert met == 200


@pytest.mark.parametrize("order", [2, 3])
def test_ruckigs_plans_are_repaired_to_rounding(order: int):
    rng = np.random.default_rng(6)
    ends = []
    for _ in range(200):
        state = reachable_state(rng)
        goal = State(rng.uniform(LIMITS.q_min, LIMITS.q_max), ZERO, ZERO)
        plan = online(state, goal, 1.0, LIMITS, order=order)
        if plan is not None:
            ends.append(np.abs(end_state(plan).q - goal.q).max())
    assert len(ends) > 100
    assert max(ends) < 1e-11


def test_the_certificate_sees_each_kind_of_violation():
    def plan(a: list[float], h: float = 1.0) -> Plan:
        coefficients = np.zeros((1, 4, 6))
        coefficients[0, :, 0] = a
        return Plan(np.array([h]), coefficients)

    v, a, j = LIMITS.qd_max[0], LIMITS.qdd_max[0], LIMITS.qddd_max[0]
    assert violation(plan([0, v, 0, 0]), LIMITS, jerk=True) is None
    assert "speed" in violation(plan([0, v * (1 + 1e-8), 0, 0]), LIMITS, jerk=True)
    assert "acceleration" in violation(plan([0, 0, a / 2 * (1 + 1e-8), 0], 0.1), LIMITS, jerk=True)
    assert "jerk" in violation(plan([0, 0, 0, j / 6 * (1 + 1e-8)], 0.01), LIMITS, jerk=True)
    assert violation(plan([0, 0, 0, j / 6 * (1 + 1e-8)], 0.01), LIMITS, jerk=False) is None
    # The excursion lies between the ends: 2.79 rad is the limit, the parabola's top 2.8.
    top = 2.8
    assert "position" in violation(plan([top - 0.25, 1.0, -1.0, 0], 1.0), LIMITS, jerk=False)
    assert "finite" in violation(plan([0, np.nan, 0, 0]), LIMITS, jerk=False)


def test_braking_stops_every_joint_at_its_own_knot():
    qd = LIMITS.qd_max * np.array([1, -0.5, 0, 0.2, -1, 0.7])
    plan = parabolic.brake(State(ZERO, qd, ZERO), LIMITS)
    assert np.abs(end_state(plan).qd).max() < 1e-14
    assert plan.duration == pytest.approx((np.abs(qd) / LIMITS.qdd_max).max())
    assert np.allclose(end_state(plan).q, qd * np.abs(qd) / (2 * LIMITS.qdd_max))


def test_integration_follows_the_control():
    rng = np.random.default_rng(7)
    h, control = rng.uniform(0.1, 1, 5), rng.normal(size=(5, 6))
    state = State(rng.normal(size=6), rng.normal(size=6), rng.normal(size=6))
    for order in (2, 3):
        plan = integrate(state, h, control, order)
        for i in range(4):
            before = end_state(Plan(h[i : i + 1], plan.coefficients[i : i + 1]))
            after = plan.coefficients[i + 1]
            assert np.allclose(before.q, after[0])
            assert np.allclose(before.qd, after[1])
            if order == 3:
                assert np.allclose(before.qdd, 2 * after[2])
