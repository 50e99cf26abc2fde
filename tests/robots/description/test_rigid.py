"""Masses of a described arm: links between the joints that move are one; what is missing is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robots.description.assumptions import SPEED_TIME, completed
from robots.description.description import Description, Joint, JointKind, Link, Mimic
from robots.description.rigid import rigid_chain
from vrs.model import Array

UP = np.array([0.0, 0.0, 1.0])


def at(x: float, y: float, z: float, turn: Array | None = None) -> Array:
    X = np.eye(4)
    X[:3, 3] = x, y, z
    if turn is not None:
        X[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    return X


def brick(name: str, mass: float) -> Link:
    return Link(name, mass, np.array([0.01, 0.02, 0.03]), np.diag([0.01, 0.02, 0.025]) * mass)


def arm() -> Description:
    """A turning post, a bracket fixed to it, a slide, and a hand whose fingers close together."""
    names = ("base", "post", "bracket", "slide", "hand", "left", "right", "lamp")
    links = {name: brick(name, mass) for name, mass in zip(names, (9, 4, 1, 2, 0.5, 0.1, 0.1, 0.3), strict=True)}
    turn, slide = JointKind.REVOLUTE, JointKind.PRISMATIC
    joints = (
        Joint("waist", turn, "base", "post", at(0, 0, 0.2), UP, -3, 3, 2, effort=50, damping=0.5, friction=0.1),
        Joint("screws", JointKind.FIXED, "post", "bracket", at(0.1, 0, 0.3, np.array([0.0, 1.2, 0.0]))),
        Joint("rail", slide, "bracket", "slide", at(0, 0.05, 0), UP, 0.1, 0.5, 1, effort=80),
        Joint("wrist", turn, "slide", "hand", at(0, 0, 0.1), np.array([1.0, 0, 0]), -1, 1, 1, effort=9),
        Joint("thumb", slide, "hand", "left", at(0, 0.02, 0.05), np.array([0, 1.0, 0]), 0.01, 0.04),
        Joint("finger", slide, "hand", "right", at(0, -0.02, 0.05), UP, mimic=Mimic("thumb", -1.0, 0.005)),
        Joint("eye", turn, "post", "lamp", at(0, 0, 0.5), np.array([0, 1.0, 0]), -1, 1),
    )
    return Description("post", links, joints)


def height(description: Description, q: dict[str, float]) -> float:
    """Potential energy over g [kg m], by hand: every link's own mass where its own frame is."""
    poses, total = {description.root: np.eye(4)}, 0.0
    for joint in description.joints:
        moved = np.eye(4)
        if joint.kind is JointKind.PRISMATIC:
            moved[:3, 3] = q.get(joint.name, 0.0) * joint.axis
        elif joint.kind is not JointKind.FIXED:
            moved[:3, :3] = Rotation.from_rotvec(q.get(joint.name, 0.0) * joint.axis).as_matrix()
        poses[joint.child] = poses[joint.parent] @ joint.X @ moved
    for name, link in description.links.items():
        total += link.mass * float((poses[name] @ np.append(link.centre, 1.0))[2])
    return total


def test_what_hangs_on_joints_that_nobody_moves_goes_with_the_link_before() -> None:
    description = arm()
    chain = rigid_chain(description, "hand")
    assert [link.prismatic for link in chain.links] == [False, True, False]
    assert [link.inertia.mass for link in chain.links] == pytest.approx([4 + 1 + 0.3, 2, 0.5 + 0.1 + 0.1])
    assert [link.effort for link in chain.links] == [50, 80, 9]
    assert (chain.links[0].viscous, chain.links[0].coulomb) == (0.5, (0.1, -0.1))
    # Torques at rest are the slope of the potential energy, fingers resting at their limit and their offset.
    rest, names = {"thumb": 0.01, "finger": 0.005}, ("waist", "rail", "wrist")
    rng = np.random.default_rng(0)
    for q in rng.uniform(-1, 1, (5, 3)):
        tau = chain.inverse_dynamics(q[None], np.zeros((1, 3)), np.zeros((1, 3)), gravity=9.81)[0]
        for j in range(3):
            ends = [
                height(description, dict(zip(names, q + h * np.eye(3)[j], strict=True)) | rest)
                for h in (1e-5, -1e-5)
            ]
            assert tau[j] == pytest.approx(9.81 * (ends[0] - ends[1]) / 2e-5, abs=1e-6)


def test_a_tip_further_in_carries_what_is_beyond_it() -> None:
    chain = rigid_chain(arm(), "slide")
    assert [link.inertia.mass for link in chain.links] == pytest.approx([5.3, 2.7])


def test_efforts_and_drives_are_those_that_are_said() -> None:
    description = arm()
    said = {"rail": {"effort": None}, "waist": {"armature": 0.3}}
    joints = tuple(replace(joint, **said.get(joint.name, {})) for joint in description.joints)
    chain = rigid_chain(replace(description, joints=joints), "hand")
    assert [link.effort for link in chain.links] == [50, np.inf, 9]
    assert [link.armature for link in chain.links] == [0.3, 0.0, 0.0]


def weak(effort: float | None, acceleration: float | None = None) -> Description:
    """The arm with another effort of its slide."""
    description = arm()
    said = {"effort": effort, "qdd_max": acceleration}
    joints = (replace(joint, **said) if joint.name == "rail" else joint for joint in description.joints)
    return replace(description, joints=tuple(joints))


def test_accelerations_that_are_assumed_are_such_as_the_efforts_give() -> None:
    done = completed(weak(18.0), "hand")
    moving = [joint for joint in done.chain("hand") if joint.moves]
    effort = np.array([joint.effort for joint in moving])
    low, high, speed, acceleration = np.array([(j.q_min, j.q_max, j.qd_max, j.qdd_max) for j in moving]).T
    times = speed / acceleration
    assert times.max() == pytest.approx(times.min())
    assert times[0] > 1.2 * SPEED_TIME
    assert any(f"reached in {times[0]:g} s, as the efforts don't give more" in note for note in done.notes)
    rng = np.random.default_rng(5)
    q, qd = rng.uniform(low, high, (500, 3)), rng.uniform(-speed, speed, (500, 3))
    qdd = acceleration * rng.choice([-1, 1], (500, 3))
    asked = np.abs(rigid_chain(done, "hand").inverse_dynamics(q, qd, qdd, gravity=done.gravity))
    assert (asked <= effort).all(axis=1).mean() > 0.9
    for description in (weak(None), weak(8000.0)):
        done = completed(description, "hand")
        assert [j.qd_max / j.qdd_max for j in done.chain("hand") if j.moves] == pytest.approx([SPEED_TIME] * 3)
    stated = next(joint for joint in completed(weak(18.0, 3.0), "hand").joints if joint.name == "rail")
    assert stated.qdd_max == 3.0
