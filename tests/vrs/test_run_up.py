"""Plans to a state in motion, and the last resorts of plans from one."""

from __future__ import annotations

import numpy as np
import pytest

from robots import puma560
from vrs import Profile
from vrs.errors import PlanningError
from vrs.planning import Plan, move, run_up, violation
from vrs.planning.parabolic import blend
from vrs.planning.plan import end_state
from vrs.segment import State

LIMITS = puma560.model().limits
ZERO = np.zeros(6)
PROFILES = (Profile.PARABOLIC, Profile.JERK_LIMITED)


def moving(rng: np.random.Generator, profile: Profile) -> State:
    """A state within a random move at full speed."""
    start, goal = rng.uniform(LIMITS.q_min, LIMITS.q_max, (2, 6))
    plan, _ = move(State(start, ZERO, ZERO), goal, 1.0, profile, LIMITS)
    i = int(rng.integers(len(plan)))
    state = end_state(Plan(plan.durations[i : i + 1] * rng.random(), plan.coefficients[i : i + 1]))
    return state if profile is Profile.JERK_LIMITED else State(state.q, state.qd, ZERO)


@pytest.mark.parametrize("profile", PROFILES)
def test_it_begins_at_rest_meets_the_state_and_does_not_jump(profile: Profile):
    rng = np.random.default_rng(1)
    order = 2 if profile is Profile.PARABOLIC else 3
    for _ in range(150):
        start, goal = rng.uniform(LIMITS.q_min, LIMITS.q_max), moving(rng, profile)
        speed = float(rng.uniform(0.05, 1.0))
        plan, note = run_up(start, goal, speed, profile, LIMITS)
        assert not note
        assert violation(plan, LIMITS, jerk=order == 3) is None
        at = State(start, ZERO, ZERO)
        for h, a in zip(plan.durations, plan.coefficients, strict=True):
            begins = (a[0], a[1], 2.0 * a[2])[:order]
            assert np.abs(np.subtract(begins, (at.q, at.qd, at.qdd)[:order])).max() < 1e-11
            at = end_state(Plan(np.array([h]), a[None]))
        want = (goal.q, goal.qd, goal.qdd)[:order]
        assert np.abs(np.subtract((at.q, at.qd, at.qdd)[:order], want)).max() < 1e-11
        assert np.array_equal(plan.coefficients[0, :2], [start, ZERO])


def test_a_parabolic_one_is_a_blend_in_times_mirror():
    rng = np.random.default_rng(2)
    kinds = set()
    for _ in range(150):
        goal = moving(rng, Profile.PARABOLIC)
        start = np.clip(goal.q + rng.choice([0.1, 1.0]) * rng.normal(size=6), LIMITS.q_min, LIMITS.q_max)
        back = blend(goal, start, 1.0, LIMITS, back=True)
        ahead = blend(State(goal.q, -goal.qd, ZERO), start, 1.0, LIMITS)
        assert (back is None) == (ahead is None)
        if back is not None and goal.qd.any():
            kinds.add(len(back))
            assert back.duration == pytest.approx(ahead.duration, rel=1e-12)
            end = end_state(back)
            assert np.abs(np.subtract((end.q, end.qd), (goal.q, goal.qd))).max() < 1e-13
    assert kinds == {2, 3}


@pytest.mark.parametrize("profile", PROFILES)
def test_v_is_raised_only_as_far_as_the_state_demands(profile: Profile):
    rng = np.random.default_rng(3)
    raised, shorter = 0, []
    for _ in range(100):
        start, goal = rng.uniform(LIMITS.q_min, LIMITS.q_max), moving(rng, profile)
        plan, _ = run_up(start, goal, 0.2, profile, LIMITS)
        # A state that slows down comes from a greater speed.
        slows = np.where(goal.qd * goal.qdd < 0, goal.qdd**2 / (2.0 * LIMITS.qddd_max), 0.0)
        top = np.maximum(0.2 * LIMITS.qd_max, np.abs(goal.qd) + slows)
        assert violation(plan, with_speed(top * (1.0 + 1e-9)), jerk=False) is None
        raised += bool((top > 0.2 * LIMITS.qd_max).any())
        if profile is Profile.PARABOLIC and (np.abs(goal.qd) > 0.5 * LIMITS.qd_max).any():
            # Raised no less either: slowing down to 0.2 first, as a redirection does, would take longer.
            low = blend(State(goal.q, -goal.qd, ZERO), start, 0.2, LIMITS)
            high = blend(goal, start, 0.2, LIMITS, back=True)
            if low is not None and high is not None:
                shorter.append(high.duration / low.duration)
    assert raised > 50
    assert profile is Profile.JERK_LIMITED or np.median(shorter) < 0.9


def with_speed(qd_max: np.ndarray) -> object:
    return type(LIMITS)(LIMITS.q_min, LIMITS.q_max, qd_max, LIMITS.qdd_max, LIMITS.qddd_max)


@pytest.mark.parametrize("over", [1.0, 1.0 + 1e-15])
def test_a_jerk_limited_state_on_its_limits_is_met_by_cubics(over: float):
    """Joint 1 slows down from full speed; joint 2 has its full acceleration, but for rounding."""
    slowing = 0.5 * LIMITS.qdd_max[0]
    qd = np.array([LIMITS.qd_max[0] - slowing**2 / (2.0 * LIMITS.qddd_max[0]), 0.1, 0, 0, 0, 0])
    qdd = np.array([-slowing, LIMITS.qdd_max[1] * over, 0, 0, 0, 0])
    goal = State(np.array([0.5, -0.3, 0.2, 0.1, 0.0, 0.3]), qd, qdd)
    plan, note = run_up(ZERO, goal, 1.0, Profile.JERK_LIMITED, LIMITS)
    assert not note
    assert violation(plan, LIMITS, jerk=True) is None


# Joint 1 nears its limit slowly, where it has to stay: a common blend crawls.
CRAWLING = State(
    np.array([-2.78902359, 3.19389838, -0.12185711, 2.71472286, 0.0635788, 0.00755634]),
    np.array([-0.14155497, 0.0, 0.01931904, -0.11031219, -0.24581147, 0.12151841]),
    ZERO,
)
CORNER = np.array([LIMITS.q_min[0], 2.55616116, -0.84792762, LIMITS.q_max[3], -0.57815369, -1.98214426])


def test_a_blend_twice_as_long_as_through_rest_is_not_taken():
    speed = 0.58864411619836
    slow = blend(CRAWLING, CORNER, speed, LIMITS)
    plan, _ = move(CRAWLING, CORNER, speed, Profile.PARABOLIC, LIMITS)
    assert plan.duration < 0.5 * slow.duration
    goal = State(CRAWLING.q, -CRAWLING.qd, ZERO)
    slow = blend(goal, CORNER, speed, LIMITS, back=True)
    plan, _ = run_up(CORNER, goal, speed, Profile.PARABOLIC, LIMITS)
    assert plan.duration < 0.5 * slow.duration
    assert np.abs(end_state(plan).q - goal.q).max() < 1e-10


@pytest.mark.parametrize("profile", PROFILES)
def test_a_state_faster_than_a_limit_is_neither_left_nor_met(profile: Profile):
    state = State(ZERO, LIMITS.qd_max * [1.0 + 1e-6, 0, 0, 0, 0, 0], ZERO)
    for goal in (np.full(6, 0.7), np.full(6, -0.7)):
        with pytest.raises(PlanningError, match="from this state: joint 1 would pass its speed limit"):
            move(state, goal, 1.0, profile, LIMITS)
        with pytest.raises(PlanningError, match=r"the run-up .* joint 1 would pass its speed limit"):
            run_up(goal, state, 1.0, profile, LIMITS)


@pytest.mark.parametrize("profile", PROFILES)
def test_a_run_up_from_outside_the_limits_is_refused(profile: Profile):
    outside = ZERO.copy()
    outside[3] = LIMITS.q_max[3] + 1e-6
    for goal in (State(ZERO, ZERO, ZERO), State(ZERO, 0.1 * LIMITS.qd_max, ZERO)):
        with pytest.raises(PlanningError, match="joint 4 would pass its position limit"):
            run_up(outside, goal, 1.0, profile, LIMITS)
