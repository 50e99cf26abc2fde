"""A hand that grasps by friction, against what mechanics says of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from numpy.typing import ArrayLike

from robots import load
from robots.bullet.grasping import GraspingArm, GraspWorld, finger_poses, fingered, grasping
from robots.robot import ArmBody, Fingers, exact_arm
from robots.things import Scene, Thing, pose_matrix, read_scene
from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array

G, DT = 9.81, 1e-3
FINGERS = Fingers(stroke=0.1, force=20.0, speed=0.5, thickness=0.01, width=0.02, length=0.1)
SIDE = 0.05
LOW = 0.085
"""Height of the hand with the box between its fingers [m]."""


def hand_at(height: float, aside: float = 0.0) -> Array:
    """The hand points down."""
    X = np.diag((1.0, -1.0, -1.0, 1.0))
    X[:3, 3] = 0.0, aside, height
    return X


def box(mass: float, friction: float, at: tuple[float, float, float] = (0.0, 0.0, SIDE / 2)) -> Thing:
    return Thing("box", at, box=(SIDE, SIDE, SIDE), mass=mass, friction=friction)


def grasped(thing: Thing, path: Callable[[float], tuple[float, float]], length: float) -> Array:
    """Grasp a box on the floor, and take the hand along a path (aside, up) [m]: where the box is by it, (k, 3)."""
    with GraspWorld(FINGERS, Scene(0.0, (thing,)), hand_at(LOW), dt=DT) as world:
        world.grip(0.0)
        for _ in range(400):
            world.step(hand_at(LOW))
        assert world.held() == 0
        assert world.opening == pytest.approx(SIDE, abs=5e-4)
        found = []
        for k in range(1, round(length / DT) + 1):
            aside, up = path(k * DT)
            world.step(hand_at(LOW + up, aside))
            found.append(np.array(world.poses()[0][:3]) - (0.0, aside, LOW + up))
        return np.array(found)


FALL, RAMP, HOLD = 0.2, 0.2, 0.15
"""A hand falls with a box and closes, takes up its weight, and goes on [s]."""


def slid(mass: float, friction: float, up: float, aside: float = 0.0) -> Array:
    """Close a hand around a box while both fall; accelerate it [m/s²]: where the box is by the hand, (k, 3)."""
    falls = Scene(-9.0, (box(mass, friction, (0.0, 0.0, 0.0)),))
    share = np.clip((DT * np.arange(1, round((FALL + RAMP + HOLD) / DT) + 1) - FALL) / RAMP, 0.0, 1.0)
    a = np.column_stack([0 * share, aside * share, -G + (G + up) * share])
    p = np.cumsum(DT * np.cumsum(DT * a, axis=0), axis=0) + hand_at(LOW - SIDE / 2)[:3, 3]
    with GraspWorld(FINGERS, falls, hand_at(LOW - SIDE / 2), dt=DT) as world:
        world.grip(0.0)
        found = []
        for x, y, z in p.tolist():
            X = hand_at(z, y)
            world.step(X)
            found.append(np.array(world.poses()[0][:3]) - (x, y, z))
        return np.array(found)[-round(HOLD / DT) :]


@pytest.mark.needs("pybullet")
@pytest.mark.parametrize("friction", [0.3, 0.8])
@pytest.mark.parametrize("acceleration", [0.0, 4.0, 12.0])
def test_friction_holds_what_twice_mu_F_bears_and_no_more(friction: float, acceleration: float) -> None:
    # Both fingers press with F: the box stays if m (g + a) ≤ 2 μ F, within 2 %; else it slides with what is left.
    bears = 2.0 * friction * FINGERS.force / (G + acceleration)
    assert np.ptp(slid(0.98 * bears, friction, acceleration)[:, 2]) < 1e-4
    for much in (1.02, 1.15):
        z = slid(much * bears, friction, acceleration)[:, 2]
        left = 2.0 * np.polyfit(DT * np.arange(len(z)), z, 2)[0]
        assert left == pytest.approx(
            -(1.0 - 1.0 / much) * (G + acceleration), rel=0.02, abs=0.02 * (G + acceleration)
        )
        assert z[0] - z[-1] > 1e-3


@pytest.mark.needs("pybullet")
def test_what_is_swung_too_fast_slips() -> None:
    # Gravity pulls downwards and the swing aside: friction holds each by itself up to 2 μ F.
    mass, friction = 0.8, 0.5
    bears = 2.0 * friction * FINGERS.force / mass
    assert np.ptp(slid(mass, friction, 0.0, 0.95 * bears)[:, 1]) < 1e-4
    assert np.ptp(slid(mass, friction, 0.0, 1.1 * bears)[:, 1]) > 5e-3


@pytest.mark.needs("pybullet")
def test_what_is_held_or_lies_doesnt_creep() -> None:
    held = slid(0.5, 0.6, 0.0)
    assert np.ptp(held, axis=0).max() < 1e-6
    lifted = grasped(box(0.5, 0.6), lambda t: (0.0, 0.05 * min(t, 1.0)), 5.0)
    assert np.abs(lifted[-1] - lifted[1200]).max() < 2.5e-4
    things = (box(0.5, 0.6, (0.3, 0.0, SIDE / 2)), Thing("can", (0.3, 0.2, 0.05), cylinder=(0.03, 0.1), mass=0.3))
    with GraspWorld(FINGERS, Scene(0.0, things), hand_at(0.5), dt=DT) as world:
        for _ in range(300):
            world.step(hand_at(0.5))
        before = np.array(world.poses())
        for _ in range(5000):
            world.step(hand_at(0.5))
        assert np.abs(np.array(world.poses()) - before).max() < 1e-4


@pytest.mark.needs("pybullet")
def test_things_fall_and_push_each_other_as_mechanics_says() -> None:
    # A fall is ½ g t²; then one box slides into another without friction: together they keep the momentum.
    one, other = (
        box(0.2, 0.0, (-0.2, 0.3, 0.5)),
        Thing("other", (0.0, 0.3, 0.5), box=(0.1,) * 3, mass=0.6, friction=0),
    )
    with GraspWorld(FINGERS, Scene(-5.0, (one, other)), hand_at(3.0), dt=DT) as world:
        steps = 500
        for _ in range(steps):
            world.step(hand_at(3.0))
        fallen = 0.5 - np.array(world.poses())[:, 2]
        # PyBullet steps semi-implicitly: half a step more than the integral.
        assert fallen == pytest.approx(0.5 * G * (steps * DT) * (steps + 1) * DT, abs=1e-6)
    with GraspWorld(FINGERS, Scene(0.0, (one, other)), hand_at(3.0), gravity=0.0, dt=DT) as world:
        world.push(0, (0.2, 0.0, 0.0))
        masses = np.array([0.2, 0.6])
        for _ in range(400):
            before = np.array(world.poses())[:, :3]
            world.step(hand_at(3.0))
            v = (np.array(world.poses())[:, :3] - before) / DT
            assert masses @ v == pytest.approx((0.2, 0.0, 0.0), abs=1e-9)
        assert v[1, 0] > 0.1


@pytest.mark.needs("pybullet")
def test_a_hand_opens_and_closes_at_its_speed_and_lets_go() -> None:
    with GraspWorld(FINGERS, Scene(0.0, (box(0.3, 0.7),)), hand_at(LOW), dt=DT) as world:
        world.grip(0.08)
        for _ in range(20):
            world.step(hand_at(LOW))
        assert world.opening == pytest.approx(0.09, abs=2e-3)
        world.grip(0.0)
        for _ in range(300):
            world.step(hand_at(LOW))
        for k in range(500):
            world.step(hand_at(LOW + 2e-4 * k))
        assert world.held() == 0
        assert not world.borne(0)
        world.grip(math.inf)
        for _ in range(600):
            world.step(hand_at(LOW + 0.1))
        assert world.held() is None
        assert world.opening == pytest.approx(FINGERS.stroke, abs=1e-4)
        assert world.poses()[0][2] == pytest.approx(SIDE / 2, abs=1e-3)
        world.grip(0.0)
        for _ in range(400):
            world.step(hand_at(0.5))
        assert world.opening == pytest.approx(0.0, abs=1e-4)


def carried(block: int) -> tuple[Array, list[float | None], Array]:
    """An arm that closes its hand around a can, lifts it, and drops it, in blocks of steps."""
    robot = load("puma560")
    model, low = robot.arm, hand_at(0.0)
    low[:3, 3] = 0.45, 0.15, -0.3
    q0 = model.inverse(low)[0]
    high = low.copy()
    high[2, 3] += 0.1
    q1 = model.inverse_near(high, q0)
    z = -0.3 - 0.05625 - 0.06
    scene = Scene(z - 0.035, (Thing("can", (0.45, 0.15, z), cylinder=(0.03, 0.07), mass=1.5, friction=0.8),))
    loads: list[float | None] = []
    found = []

    class Told:
        """The arm's body, and the loads that it's told of."""

        def __init__(self, body: ArmBody) -> None:
            self.body = body

        def __getattr__(self, name: str) -> object:
            return getattr(self.body, name)

        def attach(self, mass: float) -> None:
            loads.append(mass)
            self.body.attach(mass)

        def release(self) -> None:
            loads.append(None)
            self.body.release()

    @contextmanager
    def told(q: ArrayLike, *, friction: bool = True, dt: float = DT) -> Iterator[ArmBody]:
        with robot.body()(q, friction=friction, dt=dt) as body:
            yield Told(body)  # type: ignore[misc]

    with grasping(told, robot, scene)(q0) as made:
        body = cast("GraspingArm", made)
        s = np.clip(np.arange(1, 1201) / 1000 - 0.2, 0.0, 0.8)[:, None] / 0.8
        shape = 10 * s**3 - 15 * s**4 + 6 * s**5
        rate, bend = (30 * s**2 - 60 * s**3 + 30 * s**4) / 0.8, (60 * s - 180 * s**2 + 120 * s**3) / 0.64
        rows = [q0 + (q1 - q0) * shape, (q1 - q0) * rate, (q1 - q0) * bend]
        body.grip(0.0)
        for first in range(0, 1200, block):
            if first == 1000:
                body.grip(math.inf)
            found.append(body.follow(body.prepare(*(row[first : first + block] for row in rows))).q)
        return np.concatenate(found), loads, np.array(body.state().poses[0])


@pytest.mark.needs("pybullet")
def test_what_the_arm_carries_weighs_on_it_in_blocks_of_any_length() -> None:
    q, loads, pose = carried(100)
    assert loads == [1.5, None]
    again, loads_again, pose_again = carried(50)
    np.testing.assert_array_equal(q, again)
    np.testing.assert_array_equal(pose, pose_again)
    assert loads == loads_again


@pytest.mark.needs("pybullet")
def test_an_ideal_arm_grasps_too_and_one_without_fingers_doesnt() -> None:
    robot = load("puma560")
    with grasping(exact_arm, robot, Scene(-0.6))(robot.arm.poses["nominal"]) as made:
        body = cast("GraspingArm", made)
        still = np.tile(robot.arm.poses["nominal"], (3, 1))
        assert (body.follow(body.prepare(still, 0 * still, 0 * still)).q == still).all()
        assert body.state().poses == ()
    with pytest.raises(InvalidValueError, match="gripper has fingers"):
        fingered(load("ipr"))
    palm, left, right = finger_poses(fingered(robot), 0.04)
    assert left[0, 3] - right[0, 3] == pytest.approx(0.04 + 0.012)
    assert palm[2, 3] < left[2, 3]


def test_scenes_are_read_and_say_what_is_wrong(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    a = '[[things]]\nname = "a"\nat = [0.5, 0, 0]\n'
    path.write_text(f"floor = -0.5\n{a}box = [0.1, 0.2, 0.3]\nturn_deg = 90\n")
    scene = read_scene(path)
    assert scene == Scene(-0.5, (Thing("a", (0.5, 0.0, 0.0), box=(0.1, 0.2, 0.3), turn_deg=90.0),))
    assert scene.coloured.things[0].colour is not None
    assert pose_matrix(scene.things[0].pose)[:3, 0] == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)
    assert scene.things[0].shape().vertices.max(axis=0) == pytest.approx((0.05, 0.1, 0.15))
    (tmp_path / "scene.json").write_text('{"floor": -0.5}')
    assert read_scene(tmp_path / "scene.json") == Scene(-0.5)
    for text, said in (
        ("floor = 'low'", "float"),
        ("floor = 0\nceiling = 3", "ceiling"),
        (f"floor = 0\n{a}", "either a box"),
        (f"floor = 0\n{a}box = [1, 1, 1]\nmass = -1", "mass"),
        (f"floor = 0\n{a}box = [1, 1, 1]\n{a}box = [1, 1, 1]", "there twice"),
        (f"floor = {'[' * 5000}", "recursion"),
        (f"floor = {'9' * 5000}", "digits"),
    ):
        path.write_text(text)
        with pytest.raises(FormatError, match=said):
            read_scene(path)
    with pytest.raises(FormatError, match="No such file"):
        read_scene(tmp_path / "nowhere.toml")
