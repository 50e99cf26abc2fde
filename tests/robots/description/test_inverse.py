"""Inverse kinematics of described arms: found, exact, within limits, near, smooth; closed by forward kinematics."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from robots.description.arm import arm_model
from robots.description.description import Mimic
from tests.robots.description.described import R, arm, described, joined, shifted
from tests.robots.description.test_kinematics import chains, somewhere
from vrs.errors import InvalidValueError, UnreachablePoseError

SHARES = {"panda": 0.995, "iiwa": 0.995, "rail": 0.995, "xarm6": 0.98, "puma": 0.98, "al5d": 0.98, "five": 0.98,
          "scara": 0.98, "flat": 0.98, "gantry": 1.0, "knob": 1.0, "snake": 0.98}  # fmt: skip


@pytest.mark.parametrize("name", SHARES)
def test_random_poses_are_found_within_the_limits(name: str):
    model = arm(name)
    poses = model.forward(somewhere(model, 200, seed=1))
    found = []
    for X in poses:
        try:
            found.append(model.inverse_near(X, model.poses["nominal"]))
        except UnreachablePoseError:
            continue
        assert np.abs(model.forward(found[-1]) - X).max() < 1e-6
    assert len(found) >= SHARES[name] * len(poses)
    assert (np.array(found) >= model.limits.q_min).all()
    assert (np.array(found) <= model.limits.q_max).all()


@pytest.mark.parametrize("name", ["panda", "xarm6", "five"])
def test_the_same_question_has_the_same_answer(name: str):
    one = arm(name)
    other = arm_model(one.description, one.tip)
    poses = one.forward(somewhere(one, 20, seed=2))
    for X in poses[::-1]:
        other.inverse_near(X, one.poses["nominal"])
    for X in poses:
        assert (one.inverse_near(X, one.poses["nominal"]) == other.inverse_near(X, one.poses["nominal"])).all()


@pytest.mark.parametrize("name", ["panda", "iiwa", "rail", "xarm6", "al5d", "five", "scara"])
def test_a_pose_nearby_is_reached_by_joints_nearby(name: str):
    model = arm(name)
    rng = np.random.default_rng(3)
    middle, half = 0.5 * (model.limits.q_min + model.limits.q_max), 0.5 * (model.limits.q_max - model.limits.q_min)
    for q in middle + 0.7 * half * rng.uniform(-1, 1, (40, len(half))):
        if np.linalg.cond(model.jacobian(q)) > 30:
            continue
        assert np.abs(model.inverse_near(model.forward(q), q) - q).max() < 1e-9
        X = model.forward(q + rng.uniform(-0.02, 0.02, len(q)) * np.minimum(half, 1.0))
        assert np.abs(model.inverse_near(X, q) - q).max() < 0.3


def test_a_redundant_arm_at_a_limit_gives_way_with_its_other_joints():
    model = arm("iiwa")
    rng = np.random.default_rng(4)
    passed = near = 0
    starts = somewhere(model, 60, seed=5) * 0.6
    for q in starts:
        for j in rng.choice(7, 2, replace=False):
            q[j] = np.copysign(model.limits.q_max[j], q[j])
        X = model.forward(np.clip(q + rng.uniform(-0.2, 0.2, 7), model.limits.q_min, model.limits.q_max))
        J = model.jacobian(q)
        way = np.concatenate([X[:3, 3] - model.forward(q)[:3, 3], rotation_vector(X, model.forward(q))])
        least = q + np.linalg.pinv(J) @ way
        passed += bool((np.abs(least) > model.limits.q_max).any())
        there = model.inverse_near(X, q)
        assert (np.abs(there) <= model.limits.q_max).all()
        near += bool(np.abs(there - q).max() < 1.0)
    assert passed > 20
    assert near >= 55


def rotation_vector(X, Y):
    return Rotation.from_matrix(X[:3, :3] @ Y[:3, :3].T).as_rotvec()


def test_joints_of_a_redundant_arm_near_their_limits_move_less():
    model = arm("panda")
    q = np.array([0.0, 0.3, 0.0, -1.8, 0.2, 2.0, 0.0])
    q[2] = 0.9 * model.limits.q_max[2]
    X = np.repeat(model.forward(q)[None], 2, axis=0)
    X[1, 1, 3] += 0.02
    J = model.jacobian(q)
    least = np.linalg.pinv(J) @ [0, 0.02, 0, 0, 0, 0]
    led = model.follow(X, q)[1] - q
    assert np.abs(model.forward(q + led) - X[1]).max() < 1e-9
    assert abs(led[2]) < 0.3 * abs(least[2])


def test_turns_are_those_that_the_limits_admit():
    model = arm("xarm6")
    q = np.array([5.5, -0.5, -1.0, 5.8, 0.8, -5.9])
    assert np.abs(model.inverse_near(model.forward(q), q) - q).max() < 1e-9
    from_zero = model.inverse_near(model.forward(q), np.array([0, -0.5, -1.0, 0, 0.8, 0]))
    assert np.abs(from_zero).max() < np.pi


@pytest.mark.parametrize("name", ["five", "al5d", "scara"])
def test_fewer_joints_reach_the_position_with_the_nearest_orientation(name: str):
    model = arm(name)
    rng = np.random.default_rng(6)
    for q in somewhere(model, 8, seed=7) * 0.5:
        if np.linalg.svd(model.jacobian(q)[:3], compute_uv=False)[-1] < 0.02:
            continue
        X = model.forward(q)
        X[:3, :3] = Rotation.from_rotvec(rng.uniform(-0.4, 0.4, 3)).as_matrix() @ X[:3, :3]
        found = model.inverse_near(X, q)

        def miss(p, X=X):
            return 3.0 - np.trace(model.forward(p)[:3, :3].T @ X[:3, :3])

        def away(p, X=X):
            return model.forward(p)[:3, 3] - X[:3, 3]

        limits = list(zip(model.limits.q_min, model.limits.q_max, strict=True))
        best = minimize(
            miss, q, method="SLSQP", bounds=limits, constraints={"type": "eq", "fun": away},
            options={"ftol": 1e-14, "maxiter": 300},
        )  # fmt: skip
        assert np.abs(away(found)).max() < 1e-9
        assert miss(found) < best.fun + 1e-6


@settings(max_examples=40, deadline=None)
@given(chains())
def test_any_chains_own_pose_is_reached(made):
    description, q = made
    model = arm_model(description, description.joints[-1].child)
    q = np.clip(q, model.limits.q_min, model.limits.q_max)
    X = model.forward(q)
    there = model.inverse_near(X, q)
    assert np.abs(model.forward(there) - X).max() < 1e-8 * (1.0 + np.abs(X).max())
    led = model.follow(np.stack([X, X]), q)
    assert np.abs(led - q).max() < 1e-6


@pytest.mark.parametrize("name", ["panda", "iiwa", "rail", "snake"])
def test_where_a_redundant_arm_is_led_depends_on_the_pose_alone(name: str):
    model = arm(name)
    q = model.poses["nominal"]
    X = np.repeat(model.forward(q)[None], 40, axis=0)
    X[:, :3, 3] += np.linspace(0, 1, 40)[:, None] * [0.05, 0.1, -0.1]
    led = model.follow(X, q)
    assert np.abs(led[0] - q).max() < 1e-9
    assert np.abs(model.forward(led) - X).max() < 1e-9
    assert np.abs(np.diff(led, axis=0)).max() < 0.05
    assert np.abs(model.follow(X[[39, 12, 25]], q) - led[[39, 12, 25]]).max() < 1e-9
    beside = led[-1] + 0.1 * np.linalg.svd(model.jacobian(led[-1]))[2][-1]
    goal = model.follow(X[-1:], beside)[0]
    assert np.abs(goal - led[-1]).max() > 0.02
    toward = model.follow(X, np.stack([q, goal]))
    assert np.abs(toward[0] - q).max() < 1e-9
    assert np.abs(toward[-1] - goal).max() < 1e-6
    assert np.abs(model.forward(toward) - X).max() < 1e-9


def test_a_path_that_leaves_the_workspace_ends():
    for name in ("panda", "xarm6", "five"):
        model = arm(name)
        q = model.poses["nominal"]
        X = np.repeat(model.forward(q)[None], 30, axis=0)
        X[:, 0, 3] += np.linspace(0, 1.5, 30)
        led = model.follow(X, q)
        lost = np.isnan(led).any(axis=1)
        first = int(lost.argmax())
        assert 0 < first < 29
        assert lost[first:].all()
        assert np.abs(model.forward(led[:first]) - X[:first])[:, :3, 3].max() < 1e-9


def test_several_solutions_are_listed():
    model = arm("xarm6")
    q = np.array([0.3, -0.5, -0.8, 0.4, 0.7, -0.2])
    X = model.forward(q)
    found = model.inverse(X)
    assert len(found) >= 4
    assert np.abs(model.forward(found) - X).max() < 1e-8
    assert np.abs(found - q).max(axis=1).min() < 1e-8
    assert (found <= model.limits.q_max).all()
    assert len(model.inverse(X, within_limits=False)) >= len(found)
    assert model.inverse(shifted((9, 9, 9))).shape == (0, 6)


def test_what_cant_be_reached_is_said_with_the_reason():
    model = arm("gantry")
    with pytest.raises(UnreachablePoseError, match=r"joint 2 would be at 0\.7 m, beyond 0\.5 m"):
        model.inverse_near(shifted((0.1, 0.7, 0.2)), model.poses["nominal"])
    for name in ("panda", "xarm6", "five", "flat"):
        with pytest.raises(UnreachablePoseError, match="no solution was found from 32 starts"):
            arm(name).inverse_near(shifted((3, 0, 3)), arm(name).poses["nominal"])
    for wrong in (np.eye(3), 2 * np.eye(4), np.diag([1, 1, -1, 1]), np.full((4, 4), np.nan)):
        with pytest.raises(InvalidValueError):
            model.inverse_near(wrong, [0, 0, 0])
    with pytest.raises(InvalidValueError, match="no names of configurations"):
        model.inverse_near(np.eye(4), [0, 0, 0], "RIGHTY")


def test_joints_that_follow_others_are_reckoned_with():
    axes = [(0, 0, 1), (0, 1, 0), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0)]
    joints = [
        joined(f"j{k}", R, f"l{k}", f"l{k + 1}", shifted((0.05, 0.02, 0.2)), axis, (-2, 2),
               mimic=Mimic("j1", -1.0, 0.3) if k == 3 else None)
        for k, axis in enumerate(axes)
    ]  # fmt: skip
    model = arm_model(described("parallel", joints, [f"l{k}" for k in range(8)]), "l7")
    assert model.limits.dof == 6
    for X in model.forward(somewhere(model, 20, seed=8)):
        q = model.inverse_near(X, model.poses["nominal"])
        assert np.abs(model.forward(q) - X).max() < 1e-8
