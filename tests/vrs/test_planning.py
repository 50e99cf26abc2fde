from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots import puma560
from vrs import Engine, JointTarget, Limits, MotionCommand, Profile
from vrs.errors import InvalidValueError, PlanningError
from vrs.planning import jerk_limited, move, overlapped, parabolic, run_up, violation
from vrs.planning.certificate import bounds
from vrs.planning.online import integrated, online
from vrs.planning.parabolic import ParabolicMove, ParabolicTimes, blend, certified, quickest, slowest_joint
from vrs.planning.plan import Plan, empty, end_state, integrate
from vrs.segment import State

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


def jumps(plan: Plan, order: int) -> np.ndarray:
    """Jumps of a derivative at the inner knots, (m − 1,)."""
    found = []
    for i in range(len(plan) - 1):
        before = end_state(Plan(plan.durations[i : i + 1], plan.coefficients[i : i + 1]))
        after = plan.coefficients[i + 1]
        states = ((before.q, after[0]), (before.qd, after[1]), (before.qdd, 2 * after[2]))
        found.append(np.abs(states[order][0] - states[order][1]).max())
    return np.array(found)


def values(plan: Plan, t: np.ndarray) -> np.ndarray:
    """Positions at times from 0 to the end, (k, n), by NumPy's own polynomials."""
    ends = np.cumsum(plan.durations)
    which = np.minimum(np.searchsorted(ends, t, side="right"), len(plan) - 1)
    u = t - (ends - plan.durations)[which]
    return np.array([np.polyval(plan.coefficients[i, ::-1], x) for i, x in zip(which, u, strict=True)])


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
    for order, plan in ((2, integrate(state, h, control)), (3, integrated(state, h, control).plan())):
        for i in range(4):
            before = end_state(Plan(h[i : i + 1], plan.coefficients[i : i + 1]))
            after = plan.coefficients[i + 1]
            assert np.allclose(before.q, after[0])
            assert np.allclose(before.qd, after[1])
            if order == 3:
                assert np.allclose(before.qdd, 2 * after[2])


@pytest.mark.parametrize("profile", PROFILES)
def test_plans_are_smooth_to_rounding(profile: Profile):
    rng = np.random.default_rng(8)
    worst = [0.0, 0.0, 0.0]
    for _ in range(200):
        state, goal = reachable_state(rng), rng.uniform(LIMITS.q_min, LIMITS.q_max)
        if profile is Profile.JERK_LIMITED:
            plan, _ = move(State(goal, ZERO, ZERO), state.q, 1.0, profile, LIMITS)
            state = end_state(Plan(plan.durations[:1], plan.coefficients[:1]))
        plan, note = move(state, goal, float(rng.uniform(0.05, 1.0)), profile, LIMITS)
        assert not note
        for order in range(2 if profile is Profile.PARABOLIC else 3):
            worst[order] = max(worst[order], jumps(plan, order).max(initial=0.0))
    assert max(worst) < 1e-11


def test_a_state_that_needs_all_of_its_jerk_isnt_braked():
    """On the way to full speed the jerk limit leaves no margin: the speed limit would be passed."""
    start, goal = np.full(6, -0.7), np.full(6, 0.7)
    plan = jerk_limited.rest_to_rest(start, goal, 1.0, LIMITS)
    t, ramp = float(plan.durations[0]), 2
    for share in (0.1, 0.5, 0.9):
        h = share * float(plan.durations[ramp])
        state = end_state(Plan(np.array([h]), plan.coefficients[ramp : ramp + 1]))
        again, note = move(state, goal + 0.01, 1.0, Profile.JERK_LIMITED, LIMITS)
        assert not note
        assert violation(again, LIMITS, jerk=True) is None
        assert again.duration < plan.duration - t


def test_redirections_are_hardly_longer_than_time_optimal_ones():
    ruckig = pytest.importorskip("ruckig")
    rng = np.random.default_rng(11)
    ratios = []
    for _ in range(300):
        start, first, goal = rng.uniform(LIMITS.q_min, LIMITS.q_max, (3, 6))
        way = parabolic.rest_to_rest(start, first, 1.0, LIMITS)
        state = end_state(Plan(way.durations[:1] * rng.random(), way.coefficients[:1]))
        problem, best = ruckig.InputParameter(6), ruckig.Trajectory(6)
        problem.current_position, problem.current_velocity = state.q.tolist(), state.qd.tolist()
        problem.target_position = goal.tolist()
        problem.max_velocity, problem.max_acceleration = LIMITS.qd_max.tolist(), LIMITS.qdd_max.tolist()
        problem.max_jerk = [np.inf] * 6
        assert ruckig.Ruckig(6).calculate(problem, best) == ruckig.Result.Working
        ratios.append(move(state, goal, 1.0, Profile.PARABOLIC, LIMITS)[0].duration / best.duration)
    assert np.median(ratios) < 1.0005
    assert np.percentile(ratios, 95) < 1.05
    assert max(ratios) < 2.0


def test_a_blends_own_certificate_is_the_general_one():
    rng = np.random.default_rng(12)
    kinds = set()
    for _ in range(300):
        state, speed = reachable_state(rng), float(rng.uniform(0.05, 1.0))
        goal = np.where(rng.random(6) < 0.3, LIMITS.q_max, rng.uniform(LIMITS.q_min, LIMITS.q_max))
        plan = blend(state, goal, speed, LIMITS)
        if plan is not None:
            kinds.add(len(plan))
            assert violation(plan, LIMITS, jerk=False) is None
            assert np.array_equal(plan.coefficients[0, :2], [state.q, state.qd])
            assert np.abs(end_state(plan).q - goal).max() < 1e-13
            assert np.abs(end_state(plan).qd).max() < 1e-13
    assert kinds == {2, 3}


def test_a_blend_is_certified_apart_from_the_search():
    """One joint at 1 rad/s turns round at 4 rad/s² and goes back at 1 rad/s."""
    one = np.ones(1)
    bound = bounds(Limits(-3 * one, 3 * one, one, 4 * one))
    back = ParabolicMove([0.0], [1.0], [-2.0], [1.0], bound)
    assert quickest(back, slowest_joint(back)) == pytest.approx((2.625, 0.5, 2.25))
    assert len(certified(back, ParabolicTimes(2.625, 0.5, 2.25))) == 3
    for b, last, L in ((0.4, 0.25, 2.2), (0.5, 0.2, 2.25), (0.5, 0.25, 2.0)):
        assert certified(back, ParabolicTimes(L + 0.5 * (b + last), b, L)) is None
    # It would turn at 0.125 rad.
    near = ParabolicMove([2.9], [1.0], [1.0], [1.0], bound)
    assert certified(near, ParabolicTimes(2.525, 0.5, 2.15)) is None
    # A line of 1e-10 s is left out, and nothing jumps.
    short = certified(
        ParabolicMove([0.0], [1.0], [0.075], [1.0], bound), ParabolicTimes(0.35 + 0.35 - 1e-10, 0.5, 0.35)
    )
    assert len(short) == 2
    assert jumps(short, 0).max() < 1e-15


def test_a_turn_beyond_a_limit_is_planned_another_way():
    """Joint 1 runs to its limit and can only just stop; the quickest blend would turn beyond it."""
    qd = np.array([LIMITS.qd_max[0], 0, 0, 0, 0, 0])
    q = ZERO.copy()
    q[0] = LIMITS.q_max[0] - LIMITS.qd_max[0] ** 2 / (2 * LIMITS.qdd_max[0]) - 1e-6
    goal = np.array([0.5, 2.0, -2.0, 2.0, 1.0, 3.0])
    plan, _ = move(State(q, qd, ZERO), goal, 1.0, Profile.PARABOLIC, LIMITS)
    assert violation(plan, LIMITS, jerk=False) is None
    assert np.abs(end_state(plan).q - goal).max() < 1e-10
    q[0] += 2e-6
    with pytest.raises(PlanningError, match="joint 1 would pass its position limit"):
        move(State(q, qd, ZERO), goal, 1.0, Profile.PARABOLIC, LIMITS)


@pytest.mark.parametrize("profile", PROFILES)
def test_positions_outside_the_limits_are_refused_from_rest_too(profile: Profile):
    outside = ZERO.copy()
    outside[3] = LIMITS.q_max[3] + 1e-6
    for start, goal in ((outside, ZERO), (ZERO, outside)):
        with pytest.raises(PlanningError, match="joint 4 would pass its position limit"):
            move(State(start, ZERO, ZERO), goal, 1.0, profile, LIMITS)


def test_going_on_to_the_same_target_costs_no_time():
    q = np.array([1.0, 0.5, -0.7, 0.2, 0.1, -1.0])
    for profile, planner in zip(PROFILES, (parabolic, jerk_limited), strict=True):
        plan = planner.rest_to_rest(ZERO, q, 1.0, LIMITS)
        for i in range(len(plan)):
            elapsed = plan.durations[:i].sum() + 0.4 * plan.durations[i]
            state = end_state(Plan(0.4 * plan.durations[i : i + 1], plan.coefficients[i : i + 1]))
            again, note = move(state, q, 1.0, profile, LIMITS)
            assert not note
            assert again.duration == pytest.approx(plan.duration - elapsed, rel=3e-5)


def test_rows_are_read_only_and_without_leading_zeros():
    a = np.zeros((4, 4, 6))
    a[0, 3, 2], a[1, 1, 0], a[2, 0, 0] = 1.0, 1.0, 1.0
    rows = Plan(np.ones(4), a).rows()
    assert [len(row) for row in rows] == [4, 2, 1, 1]
    assert not any(row.flags.writeable for row in rows)
    assert np.array_equal(rows[1], a[1, :2])


@pytest.mark.parametrize("planner", [parabolic, jerk_limited])
def test_overlapped_moves_superpose_exactly(planner):
    rng = np.random.default_rng(13)
    for share in (0.0, 1e-15, 0.3, 0.999, 1.0):
        start, via, goal = rng.uniform(LIMITS.q_min, LIMITS.q_max, (3, 6))
        first, second = (planner.rest_to_rest(a, b, 0.8, LIMITS) for a, b in ((start, via), (via, goal)))
        delta = share * min(first.duration, second.duration)
        plan = overlapped(first, second, delta)
        begin = first.duration - delta
        assert plan.duration == pytest.approx(begin + second.duration, abs=1e-12)
        t = np.linspace(0, plan.duration, 700)
        one = values(first, np.minimum(t, first.duration))
        two = values(second, np.maximum(t - begin, 0.0))
        assert np.abs(values(plan, t) - (one + two - via)).max() < 1e-12
        assert jumps(plan, 0).max() < 1e-11
        assert jumps(plan, 1).max() < 1e-11
        assert np.array_equal(plan.coefficients[0, 0], start)
        assert np.abs(end_state(plan).q - goal).max() < 1e-12
        assert np.abs(end_state(plan).qd).max() < 1e-12
        assert (plan.durations > 0).all()


def test_overlaps_that_cannot_be_are_refused():
    q = np.full(6, 0.3)
    first, second = parabolic.rest_to_rest(ZERO, q, 1.0, LIMITS), parabolic.rest_to_rest(q, ZERO, 0.5, LIMITS)
    for delta in (-1e-9, first.duration * 1.001, np.nan):
        with pytest.raises(InvalidValueError, match="delta must be from 0 to"):
            overlapped(first, second, delta)
    for other in (
        parabolic.rest_to_rest(q + 1e-6, ZERO, 0.5, LIMITS),
        Plan(second.durations[1:], second.coefficients[1:]),
    ):
        with pytest.raises(InvalidValueError, match="both at rest"):
            overlapped(first, other, 0.01)
    assert overlapped(first, empty(6), 0.0) is first
    assert overlapped(empty(6), second, 0.0) is second
    with pytest.raises(InvalidValueError, match="delta"):
        overlapped(first, empty(6), 0.1)


def test_overlapping_takes_pieces_of_any_degree():
    """One piece of degree 5, rest to rest, overlapped with three of degree 2."""
    s = np.array([0, 0, 0, 10.0, -15.0, 6.0])
    first = Plan(np.array([2.0]), (s / 2.0 ** np.arange(6))[None, :, None] * np.full(6, 0.5))
    second = parabolic.rest_to_rest(np.full(6, 0.5), ZERO, 0.3, LIMITS)
    plan = overlapped(first, second, 1.1)
    t = np.linspace(0, plan.duration, 500)
    want = values(first, np.minimum(t, 2.0)) + values(second, np.maximum(t - 0.9, 0.0)) - 0.5
    assert np.abs(values(plan, t) - want).max() < 1e-12
