"""Straight lines of the tool: what's refused and why, other models, rotation vectors."""

from __future__ import annotations

import numpy as np
import pytest

from robots import puma560
from vrs import Profile
from vrs.errors import PlanningError
from vrs.model import Limits, RobotModel
from vrs.planning.jerk_limited import stop
from vrs.planning.line import line, obstacle
from vrs.planning.path import Course, rotation_vector, rotations, trace
from vrs.planning.plan import Plan, end_state
from vrs.segment import State, evaluate

MODEL = puma560.model()
LIMITS = MODEL.limits
NOMINAL = np.array([0.2, 0.8, -2.9, 0.3, 0.8, -0.4])


def plan_from_rest(q, X, *, model=MODEL, **asked) -> Plan:
    state = State(np.asarray(q, dtype=float), np.zeros(6), np.zeros(6))
    return line(state, X, 1.0, Profile.PARABOLIC, model, model.limits, **asked)[0]


def moved(q, way):
    X = MODEL.forward(q)
    X[:3, 3] += way
    return X


def refusal(q, X, **asked) -> str:
    with pytest.raises(PlanningError) as refused:
        plan_from_rest(q, X, **asked)
    return str(refused.value)


def test_a_line_out_of_the_workspace_is_refused():
    reason = refusal(NOMINAL, moved(NOMINAL, (1.0, 0.0, 0.0)))
    assert "leaves the workspace" in reason
    assert "joint" in reason
    metres = float(reason.split(" m from")[0].split()[-1])
    share = float(reason.split(" % of it")[0].split("(")[-1]) / 100.0
    assert share == pytest.approx(metres, rel=0.02)
    inside = MODEL.forward(NOMINAL)
    inside[0, 3] += 0.99 * metres
    assert len(MODEL.inverse(inside, within_limits=False))
    inside[0, 3] += 0.02 * metres
    assert len(MODEL.inverse(inside, within_limits=False)) == 0


def test_a_line_across_a_limit_is_refused_with_its_place():
    limited = Limits(LIMITS.q_min, np.where(np.arange(6) == 0, 0.4, LIMITS.q_max), LIMITS.qd_max, LIMITS.qdd_max)
    model = puma560.model(limits=limited)
    reason = refusal(NOMINAL, moved(NOMINAL, (0.0, 0.4, 0.0)), model=model)
    assert "joint 1 would pass its limit of 22.9183 deg" in reason
    metres = float(reason.split(" m from")[0].split()[-1])
    X = moved(NOMINAL, (0.0, metres, 0.0))
    assert MODEL.inverse_near(X, NOMINAL)[0] == pytest.approx(0.4, abs=1e-3)


def bent(q5: float):
    return np.array([0.2, 0.8, -2.9, 0.3, q5, -0.4])


def test_a_line_through_a_straight_wrist_is_refused():
    wrist = MODEL.forward(bent(0.0)) @ np.linalg.inv(MODEL.forward(bent(0.4)))
    X = wrist @ MODEL.forward(bent(0.0))
    X[:3, 3] = MODEL.forward(NOMINAL)[:3, 3]
    reason = refusal(bent(0.4), X)
    assert "singularity" in reason
    assert "joint 4" in reason
    assert 40.0 < float(reason.split(" % of")[0].split()[-1]) < 50.0


def condition(q):
    J = MODEL.jacobian(q)
    J[:3] /= 0.4318
    return np.linalg.cond(J)


def test_arriving_at_a_singular_pose_is_refused_and_just_short_of_it_not():
    X = MODEL.forward(bent(0.0))
    X[:3, 3] = MODEL.forward(bent(0.4))[:3, 3]
    assert "singularity" in refusal(bent(0.4), X)
    angles = np.linspace(0.4, 0.0, 400)
    near = next(a for a in angles if condition(bent(a)) > 95)
    assert condition(bent(near)) < 100
    plan = plan_from_rest(bent(0.4), MODEL.forward(bent(near)))
    assert np.abs(end_state(plan).q - bent(near)).max() < 1e-8


def test_the_middle_of_a_line_counts_as_much_as_its_samples():
    """Lines that pass a straight wrist ever nearer: refused exactly where the condition number says so."""
    agreed = 0
    for aside in np.geomspace(0.005, 0.5, 25):
        start, goal = bent(0.3), bent(0.3)
        start[3] -= 1.5
        goal[3] += np.pi - aside - 1.5
        goal[5] -= np.pi - aside
        X = MODEL.forward(goal)
        q = MODEL.follow(_turned(MODEL.forward(start), X, 2001), start)
        if np.isnan(q).any() or (q > LIMITS.q_max).any() or (q < LIMITS.q_min).any():
            continue
        J = MODEL.jacobian(q)
        J[:, :3] /= 0.4318
        worst = np.linalg.cond(J).max()
        if abs(worst - 100.0) < 0.5:
            continue
        agreed += 1
        if worst > 100.0:
            assert "singularity" in refusal(start, X)
        else:
            plan_from_rest(start, X)
    assert agreed > 5


def _turned(X0, X1, k: int):
    x = np.linspace(0.0, 1.0, k)[:, None]
    X = np.tile(X0, (k, 1, 1))
    X[:, :3, :3] = rotations(x * rotation_vector(X1[:3, :3] @ X0[:3, :3].T)) @ X0[:3, :3]
    X[:, :3, 3] += x * (X1[:3, 3] - X0[:3, 3])
    return X


def test_a_peak_between_samples_is_seen():
    start, goal = bent(0.3), bent(0.3)
    start[3], goal[3], goal[5] = -1.2, 1.75, goal[5] - 2.95
    X = MODEL.forward(goal)
    y = np.concatenate([X[:3, 3], rotation_vector(MODEL.forward(start)[:3, :3] @ X[:3, :3].T)])
    path = trace(Course(y, y, X), start, MODEL, None, pieces=4, halvings=10, free=False, tolerance=1e-12)
    s = np.linspace(0.0, 1.0, 4001)
    c = np.array([condition(q) for q in path.value(s)[:, 0]])
    assert c.max() > 105.0
    # The nearest samples on either side are past the peak, though not far from it.
    near = np.flatnonzero(c > 75.0)
    few = np.concatenate([s[: near[0] : 400], s[near[[0, -1]]], s[near[-1] + 1 :: 400], [1.0]])
    few = np.repeat(np.unique(few), 2)[:-1]
    q = path.value(few)[:, 0]
    assert max(condition(at) for at in q) < 100.0
    found = obstacle(path, few, q, MODEL, LIMITS)
    assert found is not None
    assert "singularity" in found


def test_a_line_that_begins_near_a_singularity_may_not_come_nearer():
    start, goal = bent(0.012), bent(0.3)
    start[3], goal[3], goal[5] = 0.0, 2.6, goal[5] - 2.6
    assert condition(start) > 100.0
    assert "singularity" in refusal(start, MODEL.forward(goal))
    goal[3], goal[5] = 0.5, bent(0.3)[5] - 0.5
    assert len(plan_from_rest(start, MODEL.forward(goal))) > 0


@pytest.mark.parametrize("growth", [-0.95, -0.3, 0.0, 0.3, 0.95])
@pytest.mark.parametrize("rate", [-0.5, -0.05, 0.0, 0.05, 0.5])
def test_a_smooth_stop_ends_at_rest_whichever_way_the_arm_accelerates(rate: float, growth: float):
    q = np.array([0.2, 0.8, -2.2, 0.3, 0.2, -0.4])
    state = State(q, rate * LIMITS.qd_max, growth * LIMITS.qdd_max)
    plan, notes = stop(state, Profile.JERK_LIMITED, LIMITS)
    assert notes == ()
    if len(plan):
        end = end_state(plan)
        assert np.abs(end.qd).max() < 1e-12
        assert np.abs(end.qdd).max() < 1e-9
        assert np.array_equal(plan.coefficients[0, :3], [q, state.qd, 0.5 * state.qdd])


def test_another_configuration_is_refused_and_the_same_isn_t():
    X = moved(NOMINAL, (0.0, 0.1, 0.0))
    own = MODEL.configuration(NOMINAL)
    assert len(plan_from_rest(NOMINAL, X, configuration=own.lower())) > 0
    other = own.replace("RIGHTY", "LEFTY")
    reason = refusal(NOMINAL, X, configuration=other)
    assert own in reason
    assert other in reason
    start = NOMINAL + np.array([0.0, 0.0, 0.0, -1.3, 0.0, 0.0])
    assert "can't change configuration" in refusal(start, MODEL.forward(start), configuration="NOFLIP")


def test_a_joint_target_is_met_to_the_bit_and_another_solution_refused():
    X = moved(NOMINAL, (0.0, 0.2, -0.1))
    X[:3, :3] = rotations(np.array([[0.1, 0.2, 0.0]]))[0] @ X[:3, :3]
    q = MODEL.inverse_near(X, NOMINAL)
    plan = plan_from_rest(NOMINAL, X, q_goal=q)
    assert np.abs(end_state(plan).q - q).max() < 1e-14
    for other in MODEL.inverse(X):
        if np.abs(other - q).max() > 1e-3:
            reason = refusal(NOMINAL, X, q_goal=other)
            assert "another solution" in reason
            assert "joint" in reason
    start = MODEL.forward(NOMINAL)
    assert "another solution" in refusal(NOMINAL, start, q_goal=MODEL.inverse(start)[-1])


class Gantry:
    """Three prismatic joints along the axes: a model of another size, whose best times are known."""

    name = "gantry"
    prismatic = (0, 1, 2)
    limits = Limits(np.full(3, -2.0), np.full(3, 2.0), np.array([1.0, 2.0, 3.0]), np.array([4.0, 4.0, 8.0]))
    poses = {"nominal": np.zeros(3)}  # noqa: RUF012
    tool_speed = 0.5
    tool_turn_speed = 1.0
    characteristic_length = 1.0

    def forward(self, q):
        q = np.asarray(q)
        X = np.zeros((*q.shape[:-1], 4, 4))
        X[...] = np.eye(4)
        X[..., :3, 3] = q
        return X

    def links(self, q):
        raise NotImplementedError

    def jacobian(self, q):
        J = np.zeros((*np.shape(q)[:-1], 6, 3))
        J[..., :3, :] = np.eye(3)
        return J

    def inverse(self, X, within_limits=True):
        return X[None, :3, 3]

    def inverse_near(self, X, q, configuration=None):
        return X[:3, 3]

    def follow(self, X, q, configuration=None):
        good = np.abs(X[:, :3, :3] - np.eye(3)).max((1, 2)) < 1e-9
        return np.where(np.logical_and.accumulate(good)[:, None], X[:, :3, 3], np.nan)

    def configuration(self, q):
        return ""


def test_any_model_will_do_and_the_time_is_the_least():
    model = Gantry()
    assert isinstance(model, RobotModel)
    start, goal = np.array([0.1, -0.2, 0.3]), np.array([0.1, 0.8, 0.3])
    state = State(start, np.zeros(3), np.zeros(3))
    plan, _ = line(state, model.forward(goal), 1.0, Profile.PARABOLIC, model, model.limits)
    # Parabola, line, parabola at 0.5 m/s and 4 m/s².
    assert plan.duration == pytest.approx(1.0 / 0.5 + 0.5 / 4.0, rel=1e-2)
    for a, h in zip(plan.coefficients, plan.durations, strict=True):
        q = evaluate(a, np.linspace(0.0, h, 50), 0)
        assert np.abs(q[:, [0, 2]] - start[[0, 2]]).max() < 1e-9
    short, _ = line(
        state, model.forward(start + np.array([0.0, 0.01, 0.0])), 1.0, Profile.PARABOLIC, model, model.limits
    )
    assert short.duration == pytest.approx(2.0 * (0.01 / 4.0) ** 0.5, rel=1e-2)
    smooth, _ = line(state, model.forward(goal), 1.0, Profile.JERK_LIMITED, model, model.limits)
    assert smooth.duration == pytest.approx(1.0 / 0.5 + 0.5 / 4.0 + 0.1, rel=2e-2)


def test_rotation_vectors_are_precise_at_every_angle():
    rng = np.random.default_rng(8)
    for angle in (0.0, 1e-12, 1e-6, 1e-3, 1.0, 3.0, np.pi - 1e-3, np.pi - 1e-9, np.pi):
        axis = rng.normal(size=3)
        r = angle * axis / np.linalg.norm(axis)
        R = rotations(r[None])[0]
        assert np.abs(R @ R.T - np.eye(3)).max() < 1e-15 * 10
        assert np.abs(rotations(rotation_vector(R)[None])[0] - R).max() < 1e-14
        assert np.linalg.norm(rotation_vector(R)) == pytest.approx(angle, abs=1e-14)
