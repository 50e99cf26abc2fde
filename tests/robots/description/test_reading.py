"""What descriptions say is read, whoever wrote them; what they don't say is assumed, and said."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yourdfpy
from PIL import Image

from robots import load
from robots.described import described
from robots.description import meshes
from robots.description.description import Description, JointKind
from robots.description.reading import read
from robots.description.tips import tip_of
from robots.description.wheels import placed
from tests.robots.description import tried
from tests.robots.description.stranger import URDF, write
from tests.robots.description.tried import TOOLBOX, bullet_data
from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array


@pytest.mark.needs("mujoco")
def test_the_table_of_robots_that_were_tried_is_what_they_give() -> None:
    assert tried.page() == tried.PAGE.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.needs("mujoco")] if "mjcf" in file else ())
        for name, (_, file) in tried.ROBOTS.items()
    ],
)
def test_robots_of_pybullet_and_the_toolbox_are_read_whole(name: str) -> None:
    found = tried.examined(name)
    whole = found.description
    assert whole is not None
    assert not [note for note in found.notes if "wasn't found" in note or "can't be read" in note]
    assert sum(len(link.shapes) for link in whole.links.values()) >= len(whole.links) // 2
    assert max(len(shape.faces) for link in whole.links.values() for shape in link.shapes) <= meshes.MOST_TRIANGLES
    if found.robot.is_base:
        return
    for link in whole.links.values():
        if link.mass and link.name != whole.root:
            moments = np.linalg.eigvalsh(link.inertia)
            assert moments[0] > 0
            assert moments[0] + moments[1] >= moments[2] * (1 - 1e-6)


@pytest.mark.parametrize("name", ["kuka_iiwa/model.urdf", "franka_panda/panda.urdf", "husky/husky.urdf"])
def test_links_stand_where_yourdfpy_says(name: str, tmp_path: Path) -> None:
    text = bullet_data(name).read_text().replace("$(optenv HUSKY_IMU_XYZ 0.19 0 0.149)", "0.19 0 0.149")
    (tmp_path / "plain.urdf").write_text(
        text.replace("$(optenv HUSKY_IMU_RPY 0 -1.5708 3.1416)", "0 -1.5708 3.1416")
    )
    oracle = yourdfpy.URDF.load(str(tmp_path / "plain.urdf"), load_meshes=False)
    description = read(bullet_data(name))
    for link, X in placed(description).items():
        low = {joint.name: joint for joint in oracle.robot.joints}
        oracle.update_cfg({name: _rest(low[name]) for name in oracle.actuated_joint_names})
        assert np.abs(X - oracle.get_transform(link)).max() < 1e-9


def _rest(joint: Any) -> float:
    limit = joint.limit
    if joint.type == "continuous" or limit is None or limit.lower is None or limit.lower >= limit.upper:
        return 0.0
    return float(np.clip(0.0, limit.lower, limit.upper))


MJCF = """<mujoco model="two and a half">
  <compiler angle="radian"/>
  <worldbody>
    <body name="a" pos="0.1 0 0.2" euler="0.1 0.2 0.3">
      <joint name="slide" type="slide" axis="1 0 0" range="-0.3 0.4"/>
      <joint name="turn" type="hinge" axis="0 0 1" pos="0.05 0 0" ref="0.2" range="-1 1"
        damping="0.3" frictionloss="2" armature="0.1"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0.3 0 0"/>
      <body name="b" pos="0.3 0 0">
        <joint name="bend" type="hinge" axis="0 1 0" pos="0 0 -0.02"/>
        <geom type="box" size="0.1 0.02 0.03" rgba="0.1 0.8 0.2 1"/>
        <body name="c" pos="0.2 0 0"><geom type="ellipsoid" size="0.05 0.02 0.02"/></body>
        <body name="jaw" pos="0.2 0 0">
          <joint name="jaw" type="hinge" axis="0 0 1" range="0 1"/><geom type="sphere" size="0.01"/>
        </body>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="jaw" joint2="bend" polycoef="0.1 -2 0 0 0"/></equality>
  <actuator><motor joint="turn" gear="5" ctrllimited="true" ctrlrange="-3 3"/></actuator>
  <keyframe><key name="folded" qpos="0.1 -0.5 0.4 0"/></keyframe>
</mujoco>"""


def test_mjcf_is_what_mujoco_makes_of_it(tmp_path: Path) -> None:
    import mujoco

    path = tmp_path / "model.xml"
    path.write_text(MJCF)
    description, model = read(path), mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(4)
    for _ in range(5):
        data.qpos[:] = rng.uniform(-1, 1, model.nq)
        mujoco.mj_kinematics(model, data)
        poses = _at(description, {model.joint(k).name: float(data.qpos[k]) for k in range(model.nq)})
        for k in range(1, model.nbody):
            link = description.links[model.body(k).name]
            X = poses[link.name]
            assert X[:3, :3] @ link.centre + X[:3, 3] == pytest.approx(data.xipos[k], abs=1e-12)
            R = data.ximat[k].reshape(3, 3)
            turned = X[:3, :3] @ link.inertia @ X[:3, :3].T
            assert turned == pytest.approx(R @ np.diag(model.body_inertia[k]) @ R.T, abs=1e-12)
            assert link.mass == pytest.approx(model.body_mass[k])
    joints = {joint.name: joint for joint in description.joints}
    assert (joints["slide"].q_min, joints["slide"].q_max) == pytest.approx((-0.3, 0.4))
    assert joints["bend"].kind is JointKind.CONTINUOUS
    assert (joints["turn"].damping, joints["turn"].friction, joints["turn"].effort) == pytest.approx(
        (0.3, 2.0, 15.0)
    )
    assert joints["turn"].armature == pytest.approx(0.1)
    mimic = joints["jaw"].mimic
    assert mimic is not None
    assert (mimic.joint, mimic.multiplier, mimic.offset) == ("bend", -2.0, pytest.approx(0.1))
    assert description.poses["folded"]["turn"] == pytest.approx(-0.5)
    assert description.links["b"].shapes[0].colour == pytest.approx((0.1, 0.8, 0.2), abs=1e-6)
    assert (tip_of(description), description.name) == ("b", "two and a half")


def test_mjcf_with_numbers_that_are_none_is_refused_in_silence(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("model.xml").write_text(MJCF.replace('pos="0.3 0 0"', 'pos="nan 0 0"'))
    with pytest.raises(FormatError, match=r"model\.xml"):
        read(Path("model.xml"))
    assert capfd.readouterr() == ("", "")
    assert [path.name for path in tmp_path.iterdir()] == ["model.xml"]


def _at(description: Description, q: dict[str, float]) -> dict[str, Array]:
    poses = {description.root: np.eye(4)}
    for joint in description.joints:
        motion = np.eye(4)
        if joint.kind is JointKind.PRISMATIC:
            motion[:3, 3] = q[joint.name] * joint.axis
        elif joint.kind is not JointKind.FIXED:
            K = np.cross(np.eye(3), joint.axis)
            motion[:3, :3] += np.sin(q[joint.name]) * K + (1 - np.cos(q[joint.name])) * K @ K
        poses[joint.child] = poses[joint.parent] @ joint.X @ motion
    return poses


def test_a_strangers_robot_is_read_with_all_its_traps(tmp_path: Path) -> None:
    path = write(tmp_path)
    found = described(str(path))
    robot, description = found.robot, found.description
    assert description is not None
    assert robot.name == "stranger_s_robot"
    assert description.tip == "palm"
    assert list(robot.arm.prismatic) == [0]
    assert robot.arm.limits.q_min == pytest.approx([-0.8, -2.5, -np.pi, -2 * np.pi])
    assert robot.arm.limits.qd_max == pytest.approx([0.6, 2.0, 1.0, 3.0])
    assert robot.arm.forward([0.5, 0.0, 0.0, 0.0])[:3, 3] == pytest.approx([1.4, 0.0, 0.2])
    (block,) = description.links["carriage"].shapes
    assert np.ptp(block.vertices, axis=0) == pytest.approx([0.2, 0.16, 0.1])
    assert block.colour == pytest.approx([0.9, 0.5, 0.1])
    said = "\n".join(found.notes)
    for words in (
        "upper: mesh my meshes/gone.dae wasn't found",
        "roll: turns without end",
        "elbow: no limits are said; assumed ±180°",
        "elbow: no speed is said",
        "fore: the inertia breaks the triangle inequality",
        "no mass is said",
        "The tip is palm; other ends are finger, other finger, lamp",
        "slide, shoulder, elbow, roll: no acceleration is said",
        "The tool's speed isn't said",
    ):
        assert words in said
    assert len(robot.shapes()) == len(robot.placed([0.0] * 4)) == 5


def test_what_is_said_to_be_stated_states_it(tmp_path: Path) -> None:
    path = write(tmp_path)
    first = described(str(path))
    assert first.stated == path.parent / "my robot.vrs.toml"
    first.stated.write_text("\n".join(first.to_state))
    second = described(str(path))
    assert second.to_state == ()
    before, after = first.robot.arm, second.robot.arm
    for name in ("q_min", "q_max", "qd_max", "qdd_max", "qddd_max"):
        assert getattr(after.limits, name) == pytest.approx(getattr(before.limits, name), rel=1e-5)
    assert after.tool_speed == before.tool_speed
    assert not [note for note in second.notes if "acceleration" in note or "speed" in note or "tip" in note]


def test_a_tip_is_asked_for_with_the_file_and_found_again(tmp_path: Path) -> None:
    path = write(tmp_path)
    robot = load(f"{path}#lamp")
    assert robot.arm.limits.dof == 2
    assert load(robot.found_by).arm.limits.dof == 2
    with pytest.raises(
        InvalidValueError, match=r"one of finger, other finger, lamp, or another link.*did you mean palm"
    ):
        load(f"{path}#pam")
    with pytest.raises(InvalidValueError, match="a link behind a joint that moves"):
        load(f"{path}#rail")


TWINS = """<robot name="two"><link name="post"/>{}</robot>"""
ARM = """<link name="{0}1"/><link name="{0}2"/><link name="{0}3"/>
<joint name="{0}a" type="revolute"><parent link="post"/><child link="{0}1"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="{0}b" type="revolute"><parent link="{0}1"/><child link="{0}2"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="{0}c" type="fixed"><parent link="{0}2"/><child link="{0}3"/><origin xyz="1 0 0"/></joint>"""
SRDF = """<robot name="two">
  <group name="left"><chain base_link="post" tip_link="l3"/></group>
  <group name="hand"><link name="l3"/></group>
  <group name="right"><joint name="ra"/><joint name="rb"/></group>
  <group_state name="up" group="left"><joint name="la" value="0.5"/><joint name="lb" value="x"/></group_state>
</robot>"""


def test_of_two_arms_one_is_asked_for_and_srdf_names_them(tmp_path: Path) -> None:
    path = tmp_path / "two.urdf"
    path.write_text(TWINS.format(ARM.format("l") + ARM.format("r")))
    with pytest.raises(InvalidValueError, match="as there are several chains: one of l3, r3, or"):
        load(str(path))
    (tmp_path / "config").mkdir()
    (tmp_path / "config" / "two.srdf").write_text(SRDF)
    with pytest.raises(InvalidValueError, match=r"l3, r3; l3 \(group left\), .*r2 \(group right\)"):
        load(str(path))
    assert load(f"{path}#l3").arm.poses["up"] == pytest.approx([0.5, 0.0])
    (tmp_path / "config" / "two.srdf").write_text(
        SRDF.replace('<group name="right">', '<group name="none">').replace(
            '<joint name="ra"/><joint name="rb"/>', ""
        )
    )
    assert load(str(path)).arm.limits.dof == 2


def test_limits_of_moveit_count_and_toml_counts_more(tmp_path: Path) -> None:
    path = write(tmp_path)
    limits = {
        "has_velocity_limits": True,
        "max_velocity": 1.5,
        "has_acceleration_limits": True,
        "max_acceleration": 4.0,
    }
    many = {
        "joint_limits": {
            "shoulder": limits,
            "elbow": limits | {"has_jerk_limits": True, "max_jerk": 30},
            "knee": {},
        }
    }
    (path.parent / "joint_limits.yaml").write_text(json.dumps(many))
    (path.parent / "my robot.toml").write_text(
        'name = "mine"\npoint = [0, 0, 0.1]\n[joints.elbow]\nacceleration = 7\n[poses.nominal]\nslide = 0.3\n'
    )
    found = described(str(path))
    assert (found.robot.name, found.robot.tool) == ("mine", (0.0, 0.0, 0.1))
    assert found.robot.arm.limits.qd_max[1:3] == pytest.approx([1.5, 1.5])
    assert found.robot.arm.limits.qdd_max[1:3] == pytest.approx([4.0, 7.0])
    assert found.robot.arm.limits.qddd_max[2] == 30.0
    assert found.robot.arm.poses["nominal"][0] == 0.3
    assert any("there are no joints knee" in note for note in found.notes)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("tipp = 'palm'", "unknown field `tipp`; allowed: name, tip, tool_speed in [0.001, 20] m/s"),
        ("tip = 'hand'", "there's no link 'hand'"),
        ("[joints.knee]\nvelocity = 1", "there's no joint 'knee'"),
        ("[joints.elbow]\nvelocity = -1", "allowed: lower in [-1000, 1000] rad"),
        ("[joints.slide]\nlower = 2", "slide: lower must be below upper: 2, 0.8"),
        ("[base]\nwheels = 2", "allowed: wheelbase in [0.02, 5] m"),
        ("point = [0, nan, 0]", "Expected `float`"),
        ("[poses.a]\nslide = inf", "Expected `float`"),
        ("tip = ", "isn't TOML"),
        ("tip = " + 4000 * "[", "isn't TOML"),
        ("tip = " + 5000 * "9", "isn't TOML"),
    ],
)
def test_what_is_stated_wrong_is_named(tmp_path: Path, text: str, said: str) -> None:
    path = write(tmp_path)
    (path.parent / "my robot.vrs.toml").write_text(text)
    with pytest.raises(FormatError) as error:
        load(str(path))
    assert said in str(error.value)
    assert "my robot.vrs.toml" in str(error.value)


BOMB = '<!DOCTYPE r [<!ENTITY a "aaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>'
LINK = '<link name="a"/>'
PAIR = """<robot><link name="a"/><link name="b">{link}</link><joint name="j" type="{kind}">
<parent link="a"/><child link="b"/>{joint}</joint></robot>"""
MESH = "<visual><geometry><mesh filename='a.stl' scale='{}'/></geometry></visual>"
MASS, BOX = "<inertial><mass value='{}'/></inertial>", "<visual><geometry><box size='{}'/></geometry></visual>"


def pair(link: str = "", kind: str = "revolute", joint: str = "") -> str:
    """A robot of two links."""
    return PAIR.format(link=link, kind=kind, joint=joint)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"{BOMB}<robot name='&b;'>{LINK}</robot>", "document type"),
        ("<robot", "isn't XML: line 1"),
        ("", "isn't XML: it's empty"),
        ("<sdf/>", "must have <robot> (URDF) or <mujoco> (MJCF) at its root; has <sdf>"),
        ("<robot/>", "must have 1 to 500 links; has 0"),
        (f"<robot>{LINK}{LINK}</robot>", "link 'a' is there twice"),
        (pair().replace('<link name="b"></link>', ""), "joint 'j': there's no link 'b'"),
        (f"<robot>{LINK}<link name='b'/></robot>", "one link that hangs on no other; has 2: a, b"),
        (f"<robot>{LINK}<link/></robot>", "link '': has no name"),
        (f"<robot>{LINK}<joint name='j'/></robot>", "joint 'j': something that belongs to it is missing"),
        (pair(kind="bendy"), "type must be one of revolute"),
        (pair(joint="<axis xyz='0 0 0'/>"), "its axis is 0"),
        (pair(MASS.format("heavy")), "link 'b': could not convert"),
        (pair(MASS.format("nan")), "mass must be 0 kg or more"),
        (pair(BOX.format("1 -1 1")), "sizes must be positive"),
        (pair(MESH.format("0 1 1")), "scale must not be 0"),
        (pair(MESH.format("1 1")), "link 'b': must have 3 numbers"),
        (pair(joint="<origin xyz='inf 0 0'/>"), "'j': xyz must be 3 numbers within ±1e+09; given: 'inf 0 0'"),
        (pair(joint="<origin xyz='0 zero 0'/>"), "'j': xyz must be 3 numbers within ±1e+09; given: '0 zero 0'"),
        (pair(joint="<origin xyz='0 0 1' rpy='0 0'/>"), "joint 'j': rpy must be 3 numbers"),
        (pair(joint="<limit lower='-1' upper='1' velocity='-2' effort='1'/>"), "velocity must be 0 or more"),
        (pair(joint="<limit lower='-1' upper='1' velocity='2' effort='-1'/>"), "effort must be 0 or more"),
        (pair(joint="<origin xyz='${x} 0 0'/>"), "left of xacro"),
        pytest.param(
            "<mujoco><worldbody><body><geom/></body></worldbody></mujoco>", "Error",
            marks=pytest.mark.needs("mujoco"),
        ),
    ],
)  # fmt: skip
def test_a_file_that_is_none_is_refused_with_a_reason(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "bad.xml"
    path.write_text(text)
    with pytest.raises(FormatError) as error:
        read(path)
    assert said in str(error.value)
    assert "bad.xml" in str(error.value)


def test_huge_files_binary_ones_and_the_network_are_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "big.urdf"
    with path.open("wb") as file:
        file.truncate(20 * 2**20)
    with pytest.raises(FormatError, match="longer than"):
        read(path)
    path.write_bytes(b"<robot>\xff</robot>")
    with pytest.raises(FormatError, match="no UTF-8"):
        read(path)
    path.write_text(
        "<robot name='r'><link name='a'><visual><geometry><mesh filename='http://localhost:1/a.stl'/></geometry>"
        "</visual></link></robot>"
    )
    assert "nothing is fetched" in read(path).notes[0]


@pytest.mark.parametrize("name", ["bad.stl", "bad.obj", "bad.dae", "bomb.dae", "bad.png"])
def test_a_mesh_that_cannot_be_read_is_said_and_missing(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(f"{BOMB}<COLLADA>&b;</COLLADA>" if name.startswith("bomb") else "solid nothing")
    shape = f"<visual><geometry><mesh filename='{name}'/></geometry></visual>"
    text = f"<robot name='r'><link name='a'>{shape}</link></robot>"
    (tmp_path / "r.urdf").write_text(text)
    description = read(tmp_path / "r.urdf")
    assert description.links["a"].shapes == ()
    assert name in description.notes[0]


PICTURED = """mtllib m.mtl
v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0.2 0.5\nvt 0.8 0.5\nusemtl skin
f 1/1 2/1 3/1\nf 1/2 2/2 4/2\nusemtl plain\nf 1/1 3/1 4/1\n"""


def test_colours_are_those_of_materials_pictures_and_names(tmp_path: Path) -> None:
    picture = Image.new("RGB", (2, 1))
    picture.putdata([(255, 0, 0), (0, 0, 255)])
    picture.save(tmp_path / "p.png")
    (tmp_path / "a.obj").write_text(PICTURED)
    (tmp_path / "m.mtl").write_text("newmtl skin\nmap_Kd p.png\nnewmtl plain\nKd 0 1 0\n")
    (tmp_path / "r.urdf").write_text(
        """<robot name="r"><link name="a"><visual><geometry><box size="1 1 1"/></geometry>
        <material name="own"><color rgba="1 1 0 1"/></material></visual>
        </link><link name="b"><visual><geometry><mesh filename="a.obj"/></geometry><material name="own"/></visual>
        <visual><geometry><sphere radius="1"/></geometry><material name="own"/></visual></link>
        <joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint></robot>"""
    )
    several, one = read(tmp_path / "r.urdf").links["b"].shapes
    assert sorted(map(tuple, np.round(several.face_colours, 1).tolist())) == [(0, 0, 1), (0, 1, 0), (1, 0, 0)]
    assert one.colour == pytest.approx([1, 1, 0])


def test_units_of_collada_count() -> None:
    duck = meshes.read_mesh(bullet_data("duck.dae")).mesh
    assert np.ptp(duck.vertices, axis=0).max() == pytest.approx(1.6548, rel=1e-3)


def test_a_heavy_mesh_keeps_its_form_with_few_triangles() -> None:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=6)
    colours = np.tile((0.2, 0.4, 0.6), (len(ball.faces), 1))
    vertices, faces, kept = meshes.simplified(ball.vertices, ball.faces, colours, 2000)
    assert 1000 < len(faces) <= 2000
    assert len(kept) == len(faces)
    assert trimesh.Trimesh(vertices, faces).volume == pytest.approx(ball.volume, rel=0.03)


def test_without_a_processor_xacro_and_mjcf_say_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("robots.description.xacro_process.find_spec", lambda _: None)
    monkeypatch.setattr("robots.description.mjcf.find_spec", lambda _: None)
    with pytest.raises(FormatError, match=r"pip install vrs-teleop\[xacro\]"):
        read(TOOLBOX / "trossen_descriptions/urdf/px100.urdf.xacro")
    (tmp_path / "a.xml").write_text(MJCF)
    with pytest.raises(FormatError, match=r"pip install vrs-teleop\[mujoco\]"):
        read(tmp_path / "a.xml")


XACRO = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="mass" default="2"/>
<link name="a"><inertial><mass value="${2 * $(arg mass)}"/></inertial></link>
<xacro:include filename="$(find parts)/joint.xacro"/></robot>"""


def test_xacro_takes_arguments_and_finds_packages_and_its_errors_are_a_line(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    text = '<robot><link name="b"/><joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint></robot>'
    (tmp_path / "parts" / "joint.xacro").write_text(text)
    path = tmp_path / "robots" / "r.urdf.xacro"
    path.parent.mkdir()
    path.write_text(XACRO)
    assert read(path).links["a"].mass == 4.0
    (path.parent / "r.vrs.toml").write_text('arguments.mass = "5"')
    assert read(path).links["a"].mass == 10.0
    path.write_text(XACRO.replace("parts", "others"))
    with pytest.raises(FormatError, match=r"xacro: .*there's no package others above it or beside it$") as error:
        read(path)
    assert "\n" not in str(error.value)
    assert str(error.value).count("others") == 1


def test_limits_that_no_number_here_may_have_count_as_not_said(tmp_path: Path) -> None:
    path = tmp_path / "far.urdf"
    path.write_text(pair(joint="<limit lower='-1e20' upper='1e20' velocity='2' effort='1'/>"))
    description = read(path)
    assert (description.joints[0].q_min, description.joints[0].qd_max) == (None, 2.0)
    assert "j: limits that aren't within ±1e+09 count as not said." in description.notes


def test_urdf_is_read_whatever_its_file_is_called_and_mimics_in_a_circle_are_fixed(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(URDF.replace('<mimic joint="grip" multiplier="1"/>', '<mimic joint="grip too"/>'))
    description = read(path)
    joint = next(joint for joint in description.joints if joint.name == "grip too")
    assert joint.kind is JointKind.FIXED
    assert any("grip too: mimics a joint that isn't there or itself" in note for note in description.notes)


def test_husky_is_a_mobile_robot_by_its_wheels() -> None:
    found = described(str(bullet_data("husky/husky.urdf")))
    base = found.robot.base
    assert (base.wheels.base, base.wheels.radius) == pytest.approx((0.5708, 0.1778), abs=1e-4)
    assert base.body.mass == pytest.approx(44.0, abs=0.1)
    assert len(found.robot.shapes()) == 9
    there = found.robot.placed([1.0, 2.0, np.pi / 2])
    corners = np.concatenate(
        [shape.vertices @ X[:3, :3].T + X[:3, 3] for shape, X in zip(found.robot.shapes(), there, strict=True)]
    )
    assert corners[:, 2].min() == pytest.approx(0.0, abs=1e-3)
    # Half a metre before and behind its middle along y, as it looks that way.
    assert (corners.min(axis=0)[:2], corners.max(axis=0)[:2]) == (
        pytest.approx([1 - 0.343, 2 - 0.504], abs=0.015), pytest.approx([1 + 0.343, 2 + 0.504], abs=0.015)
    )  # fmt: skip
    assert load(str(bullet_data("husky/husky.urdf")) + "#front_left_wheel_link").arm.limits.dof == 1


def test_a_base_in_numbers_is_whole_and_what_is_stated_counts(tmp_path: Path) -> None:
    robot = load("diff:wheelbase=0.4,wheel=0.1,v=0.7,mass=12")
    assert robot.is_base
    assert (robot.base.limits.v_max, robot.base.body.mass) == (0.7, pytest.approx(12.0))
    file = tmp_path / "cart.toml"
    file.write_text("wheelbase = 0.4\nwheel = 0.1\nv = 0.7\nmass = 12\n")
    same = load(str(file))
    assert same.name == "cart"
    assert same.base.limits == robot.base.limits
    assert load(same.found_by).base.wheels == same.base.wheels
    shutil.copy(bullet_data("husky/husky.urdf"), tmp_path / "husky.urdf")
    (tmp_path / "husky.vrs.toml").write_text("[base]\nwheel = 0.165\nw = 1.5\n")
    stated = load(str(tmp_path / "husky.urdf"))
    assert (stated.base.wheels.radius, stated.base.limits.w_max) == (0.165, 1.5)


@pytest.mark.parametrize(
    "what",
    [
        "diff:",
        "diff:wheel=0.1",
        "diff:wheelbase=0.4,wheel=9",
        "diff:wheelbase=0.4,wheel=a",
        "diff:wheelbase=0.4,wheel=0.1,colour=3",
        "diff:wheelbase=nan,wheel=0.1",
    ],
)
def test_numbers_that_are_missing_or_wrong_are_answered_with_all_that_is_allowed(what: str) -> None:
    with pytest.raises(
        InvalidValueError, match=r"wheelbase in \[0.02, 5\] m, wheel in \[0.005, 1\] m.*alpha in"
    ) as error:
        load(what)
    assert what in str(error.value)


def test_every_robot_that_is_read_says_itself_what_finds_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path)
    monkeypatch.chdir(tmp_path / "strange things")
    robot = load("robots/my robot.urdf")
    monkeypatch.chdir(tmp_path)
    assert load(robot.found_by).name == robot.name


def test_steered_wheels_are_refused() -> None:
    with pytest.raises(
        InvalidValueError, match=r"without steered wheels; left_steering_hinge_joint steers left_front"
    ):
        described(str(bullet_data("racecar/racecar.urdf")))
