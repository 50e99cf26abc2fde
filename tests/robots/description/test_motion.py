"""The engine with arms of other numbers of joints than six: lines, steering, vias, stops; limits always kept."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.robots.description.described import arm, shifted
from vrs import (
    Engine,
    Insertion,
    JointTarget,
    ManualClock,
    Motion,
    MotionCommand,
    PoseTarget,
    Profile,
    Status,
    SteerCommand,
)  # fmt: skip
from vrs.commands import Frame

ARMS = ("panda", "iiwa", "xarm6", "al5d", "five", "scara", "rail", "flat", "gantry", "knob", "snake")
LINE = Motion.LINE


def track(model, engine, end=None):
    """Joints along a timeline, after a look at every limit."""
    t = np.linspace(0.0, engine.timeline.end if end is None else end, 2001)
    q, qd, qdd = (engine.timeline.sample(t, derivative=k) for k in range(3))
    limits = model.limits
    assert (q >= limits.q_min - 1e-9).all()
    assert (q <= limits.q_max + 1e-9).all()
    assert (np.abs(qd) <= limits.qd_max * (1 + 1e-9)).all()
    assert (np.abs(qdd) <= limits.qdd_max * (1 + 1e-9)).all()
    return q


def off_line(p, way):
    """How far places, (k, 3), are from a line through the first of them."""
    size = np.linalg.norm(way)
    along = np.outer((p - p[0]) @ way, way) / size**2 if size else 0.0
    return np.linalg.norm(p - p[0] - along, axis=1).max()


def goals(model, k, seed=0, share=0.4):
    """Joint values around the nominal ones."""
    q = model.poses["nominal"]
    step = np.minimum(share, 0.3 * (model.limits.q_max - model.limits.q_min))
    found = q + step * np.random.default_rng(seed).uniform(-1, 1, (k, len(q)))
    return np.clip(found, 0.98 * model.limits.q_min, 0.98 * model.limits.q_max)


@pytest.mark.parametrize("profile", Profile)
@pytest.mark.parametrize("name", ARMS)
def test_lines_are_straight_and_end_where_they_should(name: str, profile: Profile):
    model = arm(name)
    q = model.poses["nominal"]
    begin = model.forward(q)
    for goal in goals(model, 3):
        X = model.forward(goal)
        for target in (PoseTarget(X), JointTarget(goal)):
            engine = Engine(model, q=q, clock=None)
            receipt = engine.execute(MotionCommand(target=target, motion=LINE, profile=profile))
            assert receipt.status is Status.ACCEPTED, receipt.reason
            way = track(model, engine)
            poses = model.forward(way)
            assert off_line(poses[:, :3, 3], X[:3, 3] - begin[:3, 3]) < 1e-6
            assert np.abs(poses[-1] - X).max() < 1e-6
            if isinstance(target, JointTarget):
                assert np.abs(way[-1] - goal).max() < 1e-9
        axis = Rotation.from_matrix(X[:3, :3] @ begin[:3, :3].T).as_rotvec()
        if name in ("panda", "xarm6", "snake"):
            turned = Rotation.from_matrix(poses[:, :3, :3] @ begin[:3, :3].T).as_rotvec()
            assert off_line(turned, axis) < 1e-6


@pytest.mark.parametrize("name", ["five", "scara", "al5d"])
def test_a_line_to_an_orientation_that_cant_be_is_straight_all_the_same(name: str):
    model = arm(name)
    q, goal = model.poses["nominal"], goals(model, 1)[0]
    X = model.forward(goal) @ shifted((0, 0, 0), (0.2, 0.1, -0.1))
    engine = Engine(model, q=q, clock=None)
    assert engine.execute(MotionCommand(target=PoseTarget(X), motion=LINE)).status is Status.ACCEPTED
    p = model.forward(track(model, engine))[:, :3, 3]
    assert off_line(p, X[:3, 3] - p[0]) < 1e-6
    assert np.abs(p[-1] - X[:3, 3]).max() < 1e-6


@pytest.mark.parametrize("name", ["panda", "iiwa"])
def test_a_long_line_of_a_redundant_arm_is_straight_too(name: str):
    model = arm(name)
    q = model.poses["nominal"]
    begin = model.forward(q)
    accepted = 0
    for goal in goals(model, 12, seed=2, share=0.9):
        engine = Engine(model, q=q, clock=None)
        if engine.execute(MotionCommand(target=JointTarget(goal), motion=LINE)).status is Status.ACCEPTED:
            accepted += 1
            way = track(model, engine)
            p = model.forward(way)[:, :3, 3]
            assert np.abs(way[-1] - goal).max() < 1e-9
            assert off_line(p, model.forward(goal)[:3, 3] - begin[:3, 3]) < 1e-6
    assert accepted >= 11


FREE = {"al5d": (2,), "scara": (1,), "flat": (1,), "knob": ()}
"""Axes along which the tool can go from the nominal pose; every one unless given."""


@pytest.mark.parametrize("name", ARMS)
def test_the_tool_is_steered_straight(name: str):
    model = arm(name)
    q = model.poses["nominal"]
    for axis in FREE.get(name, range(3)):
        clock = ManualClock(0.0)
        engine = Engine(model, q=q, clock=clock)
        twist = np.zeros(6)
        twist[axis] = -0.1 if name != "gantry" else 0.1
        for _ in range(20):
            engine.execute(SteerCommand(twist=twist, frame=Frame.BASE))
            clock.advance(0.05)
        p = model.forward(track(model, engine))[:, :3, 3]
        assert (p[-1] - p[0]) @ twist[:3] > 0.5 * 0.1**2
        assert off_line(p, twist[:3]) < 1e-5


@pytest.mark.parametrize("name", ["puma", "xarm6", "panda", "iiwa"])
def test_the_tool_is_steered_straight_to_where_the_way_ends_and_says_why(name: str):
    model = arm(name)
    q = model.poses["nominal"]
    for axis in range(3):
        clock = ManualClock(0.0)
        engine = Engine(model, q=q, clock=clock)
        twist = np.zeros(6)
        twist[axis] = 0.25
        for _ in range(160):
            receipt = engine.execute(SteerCommand(twist=twist, frame=Frame.BASE))
            clock.advance(0.05)
        p = model.forward(track(model, engine))[:, :3, 3]
        assert off_line(p, twist[:3]) < 1e-5
        assert np.linalg.norm(model.jacobian(q) @ engine.timeline.sample(clock.now(), derivative=1)) < 0.01
        assert "jog" in receipt.hindrance


def test_a_redundant_arm_is_steered_with_joints_that_are_far_from_their_limits():
    model = arm("panda")
    q = np.array([0.0, 0.3, 0.0, -1.8, 0.2, 2.0, 0.0])
    q[2] = 0.9 * model.limits.q_max[2]
    clock = ManualClock(0.0)
    engine = Engine(model, q=q, clock=clock)
    for _ in range(10):
        engine.execute(SteerCommand(twist=np.array([0, 0.05, 0, 0, 0, 0]), frame=Frame.BASE))
        clock.advance(0.05)
    led = track(model, engine)[-1]
    gone = model.forward(led)[1, 3] - model.forward(q)[1, 3]
    least = np.linalg.pinv(model.jacobian(q)) @ [0, gone, 0, 0, 0, 0]
    assert gone > 0.02
    assert abs(led[2] - q[2]) < 0.3 * abs(least[2])


def test_what_few_joints_cant_do_is_said():
    for name, twist, text in (
        ("knob", [0.1, 0, 0, 0, 0, 0], "its only joint can't move the tool that way"),
        ("gantry", [0, 0, 0, 0.1, 0, 0], "the arm's 3 joints can't move the tool that way"),
    ):
        engine = Engine(arm(name), q=arm(name).poses["nominal"], clock=ManualClock(0.0))
        receipt = engine.execute(SteerCommand(twist=np.array(twist), frame=Frame.BASE))
        assert text in receipt.hindrance
        assert engine.timeline.end == 0.0


def test_a_limit_on_the_way_of_a_line_is_named():
    model = arm("rail")
    engine = Engine(model, q=model.poses["nominal"], clock=None)
    X = model.forward(model.poses["nominal"])
    X[0, 3] += 3.0
    receipt = engine.execute(MotionCommand(target=PoseTarget(X), motion=LINE))
    assert receipt.status is Status.REJECTED
    assert "no straight line" in receipt.reason
    assert "joint" in receipt.reason


@pytest.mark.parametrize("name", ["panda", "rail", "al5d", "flat"])
def test_moves_are_spliced_passed_stopped_and_taken_back(name: str):
    model = arm(name)
    first, second, third, fourth = goals(model, 4, seed=3)
    engine = Engine(model, q=model.poses["nominal"], clock=(clock := ManualClock(0.0)))
    for profile in Profile:
        for goal, insertion in ((first, Insertion.APPEND), (second, Insertion.SPLICE), (third, Insertion.REPLACE)):
            for target, motion in ((PoseTarget(model.forward(goal)), LINE), (JointTarget(goal), Motion.JOINT)):
                command = MotionCommand(
                    target=target, motion=motion, profile=profile, insertion=insertion, deviation=0.01,
                    execute_at=None if insertion is Insertion.APPEND else clock.now() + 0.3,
                )  # fmt: skip
                receipt = engine.execute(command)
                assert receipt.status in (Status.ACCEPTED, Status.POSTPONED), receipt.reason
            clock.advance(0.4)
    engine.undo()
    tool = shifted((0.02, 0.0, 0.05), (0.3, 0.0, 0.0)) if name in ("panda", "rail") else None
    target = JointTarget(fourth)
    assert engine.execute(MotionCommand(target=target, motion=LINE, tool=tool)).status is not Status.REJECTED
    clock.advance(0.5)
    engine.stop()
    q = track(model, engine)
    assert np.abs(np.diff(q, axis=0)).max() < 0.1
