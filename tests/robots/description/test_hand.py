"""Fingers behind a tip are a hand: how far, fast and strongly it closes, where it is, and that it holds things."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from robots.bullet.grasping import GraspingArm, finger_poses, grasping
from robots.described import described
from robots.robot import Robot
from robots.simulated import WORLDS
from robots.things import Scene, Thing
from tests.robots.description.tried import bullet_data
from vrs.model import Array

BOX = "<visual><origin xyz='{at}'/><geometry><box size='{size}'/></geometry></visual>"
HEAVY = """<inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>"""
ARM = """<robot name="gantry">
<link name="base"/>
<link name="x">{heavy}</link><link name="z">{heavy}</link><link name="wrist">{heavy}</link>
<link name="flange"/><link name="palm">{palm}</link><link name="left">{left}</link><link name="right">{right}</link>
{links}
<joint name="jx" type="prismatic"><parent link="base"/><child link="x"/><axis xyz="1 0 0"/>
  <limit lower="-1" upper="1" effort="200" velocity="1"/></joint>
<joint name="jz" type="prismatic"><parent link="x"/><child link="z"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="200" velocity="1"/></joint>
<joint name="turn" type="revolute"><parent link="z"/><child link="wrist"/><axis xyz="0 0 1"/>
  <limit lower="-3" upper="3" effort="50" velocity="2"/></joint>
<joint name="down" type="fixed"><parent link="wrist"/><child link="flange"/>
  <origin xyz="0 0 -0.1" rpy="{pi} 0 0"/></joint>
<joint name="hand" type="fixed"><parent link="flange"/><child link="palm"/>
  <origin xyz="0.01 0 0.02" rpy="0 0 -0.785398163397"/></joint>
{joints}</robot>"""
SLIDE = """<joint name="{name}" type="prismatic"><parent link="palm"/><child link="{child}"/>
<origin xyz="{at}" rpy="{rpy}"/><axis xyz="{axis}"/><limit lower="{low}" upper="{high}" effort="30" velocity="0.1"/>
{more}</joint>"""
LEFT = BOX.format(at="0 0.005 0.03", size="0.02 0.01 0.06")
RIGHT = BOX.format(at="0 -0.005 0.03", size="0.02 0.01 0.06")
PALM = BOX.format(at="0 0 0.02", size="0.04 0.2 0.04")


def slide(name: str, child: str, axis: str, low: float, high: float, more: str = "", **given: str) -> str:
    at, rpy = given.get("at", "0 0 0.04"), given.get("rpy", "0 0 0")
    return SLIDE.format(name=name, child=child, axis=axis, low=low, high=high, more=more, at=at, rpy=rpy)


FIRST = slide("grip", "left", "0 1 0", 0.0, 0.04)
MIMIC = slide("grip too", "right", "0 -1 0", 0.0, 0.04, "<mimic joint='grip'/>")


def write(folder: Path, joints: str, *, left: str = LEFT, right: str = RIGHT, links: str = "") -> Path:
    path = folder / "gantry.urdf"
    path.write_text(
        ARM.format(heavy=HEAVY, palm=PALM, left=left, right=right, links=links, joints=joints, pi=math.pi)
    )
    return path


def robot(path: Path) -> Robot:
    return described(f"{path}#palm").robot


SLIDING = {
    "mimic": FIRST + MIMIC,
    "mimic that goes the other way": FIRST
    + slide("grip too", "right", "0 1 0", -0.04, 0.0, "<mimic joint='grip' multiplier='-1'/>"),
    "its own drive": FIRST + slide("other", "right", "0 -1 0", 0.0, 0.04),
    "its own drive, open where it's low": FIRST + slide("other", "right", "0 1 0", -0.04, 0.0),
    "shut where the drive is at its upper limit": slide("grip", "left", "0 -1 0", -0.04, 0.0)
    + slide("grip too", "right", "0 1 0", -0.04, 0.0, "<mimic joint='grip'/>"),
    "the right one drives": slide("grip too", "left", "0 1 0", 0.0, 0.04, "<mimic joint='grip'/>")
    + slide("grip", "right", "0 -1 0", 0.0, 0.04),
}


@pytest.mark.parametrize("joints", SLIDING.values(), ids=SLIDING)
def test_fingers_that_slide_are_a_hand(tmp_path: Path, joints: str) -> None:
    hand = robot(write(tmp_path, joints)).hand
    assert hand is not None
    fingers = hand.fingers
    assert fingers is not None
    # Each goes 4 cm at 0.1 m/s with 30 N; a finger is 2 cm wide, 1 cm thick, 6 cm long.
    sizes = fingers.stroke, fingers.force, fingers.speed, fingers.width, fingers.thickness, fingers.length
    assert sizes == pytest.approx((0.08, 30.0, 0.2, 0.02, 0.01, 0.06), rel=1e-6)
    X = hand.X_LH
    assert np.abs(X[:3, 0]) == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)
    assert X[:3, 2] == pytest.approx((0.0, 0.0, 1.0), abs=1e-9)
    assert X[:3, 3] == pytest.approx((0.0, 0.0, 0.04), abs=1e-9)
    assert np.linalg.det(X[:3, :3]) == pytest.approx(1.0)


def drawn(hand_robot: Robot, opening: float) -> Array:
    """Corners of both fingers as they're drawn, in the palm's frame, along its y, (2, k)."""
    hand = hand_robot.hand
    assert hand is not None
    poses = hand.X_LH @ finger_poses(hand, opening)[1:]
    return np.array([(s.vertices @ X[:3, :3].T + X[:3, 3])[:, 1] for s, X in zip(hand.shapes, poses, strict=True)])


def test_fingers_are_drawn_apart_by_the_opening_and_the_palm_stays_with_the_link(tmp_path: Path) -> None:
    made = robot(write(tmp_path, SLIDING["mimic"]))
    for opening in (0.0, 0.03, 0.08):
        one, other = sorted(drawn(made, opening), key=lambda y: float(y.mean()))
        assert (one.max(), other.min()) == pytest.approx((-opening / 2, opening / 2), abs=1e-9)
    last = made.shapes()[-1].vertices
    assert np.ptp(last[:, 1]) == pytest.approx(0.2)
    assert last[:, 2].max() == pytest.approx(0.04)


TURNING = """<joint name="{name}" type="revolute"><parent link="palm"/><child link="{child}"/>
<origin xyz="0 {y} 0.04"/><axis xyz="{axis} 0 0"/><limit lower="0" upper="0.6" effort="3" velocity="1"/>
{more}</joint>"""


def test_fingers_that_turn_are_parallel_ones_where_they_hold(tmp_path: Path) -> None:
    joints = TURNING.format(name="grip", child="left", y=0.02, axis=-1, more="") + TURNING.format(
        name="too", child="right", y=-0.02, axis=1, more="<mimic joint='grip'/>"
    )
    hand = robot(write(tmp_path, joints)).hand
    assert hand is not None
    fingers = hand.fingers
    assert fingers is not None
    # Apart by 4 cm when shut; the inner edges of the fingertips, 6 cm out, then go aside by up to 6 cm sin 0.6.
    assert fingers.stroke == pytest.approx(0.04 + 2 * 0.06 * math.sin(0.6))
    assert fingers.speed == pytest.approx((fingers.stroke - 0.04) / 0.6, rel=1e-6)
    assert fingers.force == pytest.approx(3 * 0.6 / (0.5 * (fingers.stroke - 0.04)), rel=1e-6)
    assert hand.X_LH[:3, 2] == pytest.approx((0.0, 0.0, 1.0), abs=1e-9)
    assert any("stay 40 mm apart" in note for note in described(f"{tmp_path / 'gantry.urdf'}#palm").notes)


def test_without_shapes_fingers_are_apart_by_what_they_go(tmp_path: Path) -> None:
    made = robot(write(tmp_path, FIRST + MIMIC, left="", right=""))
    hand = made.hand
    assert hand is not None
    assert hand.fingers is not None
    assert hand.fingers.stroke == pytest.approx(0.08)
    assert hand.shapes == ()
    assert np.abs(hand.X_LH[:3, 0]) == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)


LAMP = "<link name='lamp'>" + BOX.format(at="0 0 0.01", size="0.01 0.01 0.02") + "</link>"
NO_HANDS = {
    "one finger": (
        FIRST + "<joint name='r' type='fixed'><parent link='palm'/><child link='right'/></joint>",
        "",
    ),
    "both go the same way": (FIRST + slide("too", "right", "0 1 0", 0.0, 0.04, "<mimic joint='grip'/>"), ""),
    "a lamp that turns": (
        """<joint name="a" type="fixed"><parent link="palm"/><child link="left"/></joint>
<joint name="b" type="fixed"><parent link="palm"/><child link="right"/></joint>
<joint name="c" type="continuous"><parent link="palm"/><child link="lamp"/><axis xyz="0 0 1"/></joint>""",
        LAMP,
    ),
}


@pytest.mark.parametrize(("joints", "links"), NO_HANDS.values(), ids=NO_HANDS)
def test_what_else_moves_behind_a_tip_is_no_hand(tmp_path: Path, joints: str, links: str) -> None:
    assert robot(write(tmp_path, joints, links=links)).hand is None


def test_what_turns_beside_fingers_is_no_part_of_them(tmp_path: Path) -> None:
    lamp = (
        "<joint name='c' type='continuous'><parent link='palm'/><child link='lamp'/><origin xyz='0 0 0.05'/>"
        "<axis xyz='0 0 1'/><limit effort='1' velocity='0.01'/></joint>"
    )
    hand = robot(write(tmp_path, FIRST + MIMIC + lamp, links=LAMP)).hand
    assert hand is not None
    assert hand.fingers is not None
    assert (hand.fingers.stroke, hand.fingers.speed) == pytest.approx((0.08, 0.2))


def test_an_srdf_says_which_joints_are_the_hands(tmp_path: Path) -> None:
    other = "<link name='jaw'/><link name='jaw too'/><link name='third'/>"
    more = "".join(
        slide(name, child, axis, 0.0, 0.3)
        for name, child, axis in (("p", "jaw", "1 0 0"), ("q", "jaw too", "-1 0 0"), ("r", "third", "0 0 1"))
    )
    path = write(tmp_path, FIRST + MIMIC + more, links=other)
    assert robot(path).hand is None
    (tmp_path / "gantry.srdf").write_text(
        "<robot name='gantry'><group name='fingers'><joint name='grip'/><joint name='grip too'/></group>"
        "<end_effector name='e' group='fingers' parent_link='palm'/></robot>"
    )
    (tmp_path / "gantry.urdf").touch()
    hand = robot(path).hand
    assert hand is not None
    assert hand.fingers is not None
    assert hand.fingers.stroke == pytest.approx(0.08)


@pytest.mark.needs("pybullet")
@pytest.mark.parametrize("world", WORLDS)
def test_a_described_hand_takes_a_box_and_lifts_it(tmp_path: Path, world: str) -> None:
    made = robot(write(tmp_path, SLIDING["mimic"]))
    # The palm is 12 cm below the wrist's axis, 1 cm before it, and the fingers close 45° aside.
    low = made.arm.forward(np.zeros(3))
    assert low[:3, 3] == pytest.approx((0.01, 0.0, -0.12))
    box = Thing("box", (0.01, 0.0, -0.2), box=(0.04, 0.04, 0.04), mass=0.2, turn_deg=45.0)
    maker = grasping(made.body(world), made, Scene(-0.22, (box,)))
    q = np.zeros((1500, 3))
    q[500:, 1] = np.minimum(np.arange(1000) * 1e-4, 0.05)
    with maker(q[0]) as body:
        assert isinstance(body, GraspingArm)
        body.grip(0.0)
        body.follow(body.prepare(q, np.gradient(q, 1e-3, axis=0), 0 * q))
        state = body.state()
    assert state.holds == 0
    assert state.opening == pytest.approx(0.04, abs=2e-3)
    assert state.poses[0][2] == pytest.approx(-0.15, abs=3e-3)


def test_public_descriptions_with_grippers_have_hands() -> None:
    panda, xarm = (
        described(str(bullet_data(name))).robot.hand
        for name in ("franka_panda/panda.urdf", "xarm/xarm6_with_gripper.urdf")
    )
    assert panda is not None
    assert panda.fingers is not None
    assert (panda.fingers.stroke, panda.fingers.force) == pytest.approx((0.08, 20.0), abs=5e-4)
    assert xarm is not None
    assert xarm.fingers is not None
    # Six joints that follow one: UFACTORY gives 86 mm.
    assert xarm.fingers.stroke == pytest.approx(0.086, abs=4e-3)
