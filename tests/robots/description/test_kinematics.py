"""Kinematics of described arms, beside PyBullet, exponentials of matrices and finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from robots.description.arm import arm_model
from robots.description.description import JointKind, Mimic
from robots.description.geometry import compiled, geometry
from tests.robots.description.described import C, P, R, arm, described, file, joined, shifted
from vrs.errors import InvalidValueError
from vrs.model import RobotModel

ARMS = ("panda", "iiwa", "xarm6", "al5d", "puma", "scara", "rail", "gantry", "knob", "snake")


def somewhere(model, k=5, seed=0):
    return np.random.default_rng(seed).uniform(model.limits.q_min, model.limits.q_max, (k, model.limits.dof))


@pytest.mark.parametrize("name", ["panda", "iiwa", "xarm6"])
def test_pybullet_puts_the_tip_where_the_model_does(name: str):
    import pybullet

    path, tip = file(name)
    model = arm(name)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = pybullet.loadURDF(str(path), useFixedBase=True, physicsClientId=client)
        infos = [pybullet.getJointInfo(body, k, client) for k in range(pybullet.getNumJoints(body, client))]
        index = {info[1].decode(): info[0] for info in infos}
        link = next(info[0] for info in infos if info[12].decode() == tip)
        free = [info[1].decode() for info in infos if info[3] >= 0]
        for q in somewhere(model):
            for joint, value in zip(model.joints, q, strict=True):
                pybullet.resetJointState(body, index[joint], value, physicsClientId=client)
            state = pybullet.getLinkState(body, link, computeForwardKinematics=True, physicsClientId=client)
            X = model.forward(q)
            assert X[:3, 3] == pytest.approx(np.array(state[4]), abs=1e-6)
            assert np.abs(X[:3, :3] - Rotation.from_quat(state[5]).as_matrix()).max() < 1e-6
            at = [pybullet.getJointState(body, index[joint], client)[0] for joint in free]
            still = [0.0] * len(free)
            rows = pybullet.calculateJacobian(body, link, [0.0] * 3, at, still, still, physicsClientId=client)
            own = [free.index(joint) for joint in model.joints]
            assert np.abs(np.vstack(rows)[:, own] - model.jacobian(q)).max() < 1e-6
    finally:
        pybullet.disconnect(client)


@pytest.mark.parametrize("name", ARMS)
def test_the_compiled_kinematics_are_the_same(name: str):
    model = arm(name)
    same = compiled(geometry(model.description, model.tip))
    for q in somewhere(model):
        assert np.abs(same.forward(q) - model.forward(q)).max() < 1e-14
        assert np.abs(same.jacobian(q) - model.jacobian(q)).max() < 1e-14


def motion(joint, value):
    """By the exponential of its twist."""
    twist = np.zeros((4, 4))
    if joint.kind is P:
        twist[:3, 3] = joint.axis
    elif joint.kind is not JointKind.FIXED:
        twist[:3, :3] = -np.cross(joint.axis, np.eye(3))
    return expm(value * twist)


number = st.floats(-1, 1)
vector = st.tuples(number, number, number)


@st.composite
def chains(draw):
    """1 to 12 joints that move, with fixed ones between and perhaps one that follows another, and their values."""
    kinds = draw(st.lists(st.sampled_from([R, R, C, P, JointKind.FIXED]), min_size=1, max_size=16))
    moving = [k for k, kind in enumerate(kinds) if kind is not JointKind.FIXED][:12]
    kinds = [kind if k in moving else JointKind.FIXED for k, kind in enumerate(kinds)] + [R] * (not moving)
    moving = moving or [len(kinds) - 1]
    follower = draw(st.sampled_from(moving)) if len(moving) > 1 else -1
    leader = draw(st.sampled_from([k for k in moving if k != follower]))
    joints = []
    for k, kind in enumerate(kinds):
        axis = np.add(draw(vector), (0, 0, 1.5))
        mimic = Mimic(f"j{leader}", draw(number), draw(number)) if k == follower else None
        X = shifted(draw(vector), draw(vector))
        joints.append(joined(f"j{k}", kind, f"l{k}", f"l{k + 1}", X, axis / np.linalg.norm(axis), mimic=mimic))
    q = np.array([draw(st.floats(-3, 3)) for k in moving if k != follower])
    return described("random", joints, [f"l{k}" for k in range(len(joints) + 1)]), q


@settings(max_examples=60, deadline=None)
@given(chains())
def test_any_chain_moves_as_the_exponentials_of_its_twists_say(made):
    description, q = made
    model = arm_model(description, description.joints[-1].child)
    assert isinstance(model, RobotModel)
    assert model.limits.dof == len(q)
    values = dict(zip(model.joints, q.tolist(), strict=True))
    X, after = np.eye(4), [np.eye(4)]
    for joint in description.joints:
        value = values.get(joint.name, 0.0)
        if joint.mimic is not None:
            value = joint.mimic.multiplier * values[joint.mimic.joint] + joint.mimic.offset
        X = X @ joint.X @ motion(joint, value)
        if joint.moves:
            after.append(X)
    size = 1.0 + np.abs(X).max()
    links = model.links(q)
    assert np.abs(model.forward(q) - X).max() < 1e-12 * size
    assert np.abs(links - [*after[:-1], X]).max() < 1e-12 * size
    step = 1e-6 * np.eye(len(q))
    ahead, behind = model.forward(q + step), model.forward(q - step)
    linear = (ahead[:, :3, 3] - behind[:, :3, 3]) / 2e-6
    turn = (ahead[:, :3, :3] - behind[:, :3, :3]) / 2e-6 @ X[:3, :3].T
    angular = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
    J = model.jacobian(q)
    assert np.abs(J - np.concatenate([linear, angular], axis=1).T).max() < 1e-7 * size
    rows = np.stack([q, -q])
    assert (model.forward(rows)[0] == model.forward(q)).all()
    assert (model.jacobian(rows)[0] == J).all()
    assert (model.links(rows)[0] == links).all()


def test_what_an_arm_follows_is_said():
    words = {
        name: arm(name).follows for name in ("panda", "xarm6", "al5d", "five", "scara", "flat", "gantry", "knob")
    }
    assert words == {
        "panda": "position and orientation", "xarm6": "position and orientation",
        "al5d": "position and 1 of 3 angles", "five": "position and 2 of 3 angles",
        "scara": "position and 1 of 3 angles", "flat": "2 of 3 coordinates and 1 of 3 angles",
        "gantry": "position", "knob": "1 of 3 angles",
    }  # fmt: skip


def test_poses_are_the_chains_and_within_its_limits():
    model = arm("iiwa")
    condition = np.linalg.cond(model.jacobian(model.poses["nominal"]))
    assert condition < 30
    stated = {"home": {model.joints[1]: 9.0}, "open": {"a finger": 1.0}}
    named = arm_model(replace(model.description, poses=stated), model.tip).poses
    assert set(named) == {"home", "nominal"}
    assert (named["home"] == named["nominal"]).all()
    assert named["home"][1] == model.limits.q_max[1]


def test_what_is_no_arm_is_refused():
    model = arm("iiwa")
    with pytest.raises(InvalidValueError, match="1 to 12 joints that move; this one: 0"):
        arm_model(model.description, model.description.root)
    with pytest.raises(InvalidValueError, match="a link of iiwa"):
        arm_model(model.description, "nothing")
    with pytest.raises(InvalidValueError, match="tool_speed must be stated"):
        arm_model(replace(model.description, tool_speed=None), model.tip)
    first, *others = model.description.joints
    for change, text in (
        ({"qdd_max": None}, "qdd_max of .* must be stated"),
        ({"mimic": Mimic("j9")}, "a joint of iiwa"),
        ({"mimic": Mimic(first.name)}, "doesn't follow itself"),
    ):
        joints = [first, *others]
        k = next(k for k, joint in enumerate(joints) if joint.moves)
        joints[k] = replace(joints[k], **change)
        if "itself" in text:
            joints[k] = replace(joints[k], mimic=Mimic(joints[k].name))
        with pytest.raises(InvalidValueError, match=text):
            arm_model(replace(model.description, joints=tuple(joints)), model.tip)
    for wrong in (np.zeros(6), np.full(7, np.nan), np.zeros((1, 1, 7))):
        with pytest.raises(InvalidValueError, match=r"shape \(7,\) or \(k, 7\)"):
            model.forward(wrong)
