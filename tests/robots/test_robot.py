"""Robots as values, and how they are found."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

import robots
from robots.mobile.chassis import Senses
from robots.robot import EXACT, FOUND, IDEAL, Display, Gripper, HeadCamera, Robot, ThinClient
from robots.rooms import read_room
from robots.simulated import WORLDS, missing_for
from vrs.errors import FormatError, InvalidValueError
from vrs.mobile import MobileModel
from vrs.model import RobotModel

ARMS, BASES = ("puma560",), ("ipr", "micro", "cubo")


@pytest.mark.parametrize("name", FOUND)
def test_each_robot_is_found_by_its_name_and_stands_where_its_shapes_are_told(name: str) -> None:
    robot = robots.load(name)
    assert (robot.name, robot.found_by) == (name, name)
    assert robot.appearance is not None
    where = np.zeros(robot.arm.limits.dof if name in ARMS else 3)
    assert robot.appearance.poses(where).shape == (len(robot.appearance.shapes()), 4, 4)
    assert tuple(robot.bodies)[: len(WORLDS)] == tuple(WORLDS)
    assert isinstance(robot.model, RobotModel if name in ARMS else MobileModel)


@pytest.mark.parametrize("name", BASES)
def test_a_base_is_no_arm(name: str) -> None:
    with pytest.raises(InvalidValueError, match="an arm; this one is a mobile robot"):
        _ = robots.load(name).arm


def test_robots_carry_their_devices() -> None:
    arm, base, client = map(robots.load, ("puma560", "ipr", "cubo"))
    assert arm.device(Gripper) is not None
    assert arm.tool == (0.0, 0.0, 0.05625)
    assert base.tool == (0.0, 0.0, 0.0)
    assert base.device(Display) is not None
    assert base.device(HeadCamera) is not None
    assert arm.device(Display) is base.device(Gripper) is base.device(ThinClient) is None
    thin = client.device(ThinClient)
    assert thin is not None
    assert thin.model.is_file()


@pytest.mark.parametrize("name", BASES)
def test_a_bases_bodies_are_put_into_a_room_with_the_limits_and_senses_that_they_are_given(name: str) -> None:
    robot, room = robots.load(name), read_room("room 1\nsize 4 4\nstart 1 2 0\n")
    slow = replace(robot.base.limits, v_max=0.01)
    for world in (world for world in WORLDS if not missing_for(world)):
        rng = np.random.default_rng(0)
        with robot.body(world)(room=room, rng=rng, senses=Senses(laser=None), limits=slow) as body:
            assert body.truth == pytest.approx((1.0, 2.0, 0.0), abs=1e-3)
            assert body.limits.v_max == 0.01


def test_an_arms_bodies_follow_and_hold_loads() -> None:
    robot = robots.load("puma560")
    q = robot.arm.poses["ready"]
    still = np.tile(q, (20, 1)), np.zeros((20, 6)), np.zeros((20, 6))
    for name in (*(world for world in WORLDS if not missing_for(world)), IDEAL):
        with robot.body(name)(q, friction=False) as body:
            body.attach(2.5)
            measured = body.follow(body.prepare(*still))
            body.release()
        assert measured.q.shape == (20, 6)
        assert np.abs(measured.q - q).max() == pytest.approx(0.0 if name == IDEAL else 1e-3, abs=1e-3)
    assert robot.usual_body == next(iter(WORLDS))
    assert robot.body() is robot.bodies[robot.usual_body]
    assert Robot("bare", robot.model).usual_body == IDEAL
    worlds = ", ".join(WORLDS)
    with pytest.raises(InvalidValueError, match=f"puma560 must be one of {worlds}, ideal; given: 'jelly'"):
        robot.body("jelly")
    assert robot.with_body("mujoco").usual_body == "mujoco"
    assert robot.with_body(EXACT).body() is robot.body(IDEAL)
    assert set(robot.with_body("mujoco").bodies) == set(robot.bodies)
    assert robot.body_name(EXACT) == robot.body_name(IDEAL) == IDEAL
    assert robot.body(EXACT) is robot.body(IDEAL)
    with pytest.raises(InvalidValueError, match=f"one of {worlds}, bare"):
        robots.load("ipr").body(EXACT)


def test_ones_own_robot_lies_in_the_working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    name = f"own_{tmp_path.name}"
    text = "from robots import Robot, ipr\nMINE, ANSWER = Robot('mine', ipr.model()), 42\n"
    (tmp_path / f"{name}.py").write_text(text)
    (tmp_path / f"{name}_broken.py").write_text("1 / 0")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    robot = robots.load(f"{name}:MINE")
    assert (robot.name, robot.found_by) == ("mine", f"{name}:MINE")
    for other in ("ANSWER", "YOURS"):
        with pytest.raises(InvalidValueError, match=r"a Robot there \(MINE\)"):
            robots.load(f"{name}:{other}")
    with pytest.raises(FormatError, match="ZeroDivisionError"):
        robots.load(f"{name}_broken:MINE")
    with pytest.raises(FormatError, match="ModuleNotFoundError"):
        robots.load("nothing.of.the.kind:MINE")


def test_entry_points_add_names_and_replace_none(monkeypatch: pytest.MonkeyPatch) -> None:
    points = [EntryPoint(name, "robots.cubo.robot:ROBOT", "vrs.robots") for name in ("theirs", "ipr")]
    monkeypatch.setattr("robots.robot.added", lambda: tuple(points))
    assert robots.names() == (*FOUND, "theirs")
    assert robots.load("theirs").name == "cubo"
    assert robots.load("ipr").name == "ipr"


@pytest.mark.parametrize("what", ["r2d2", "", ":", "a:", ":b", "robots/arm.py", "a:b c"])
def test_an_error_says_what_is_allowed(what: str) -> None:
    with pytest.raises(InvalidValueError, match=r"one of puma560, ipr, micro, cubo.*\.urdf, .*, or MODULE:NAME"):
        robots.load(what)


@pytest.mark.parametrize("what", ["arm.urdf", "arm.XACRO", "an arm.xml#hand", "base.toml"])
def test_a_file_that_is_not_there_is_named(what: str) -> None:
    with pytest.raises(FormatError, match=rf"{what.partition('#')[0]}: (there's no such file|can't be read)"):
        robots.load(what)


def test_nothing_heavy_is_loaded_before_a_body_or_a_shape_is_made() -> None:
    script = (
        "import sys, robots\nassert not any(name.startswith('robots.puma560') for name in sys.modules)\n"
        "for name in robots.names(): robots.load(name).model\n"
        "print(sorted({'pybullet', 'trimesh', 'roboticstoolbox', 'scipy.interpolate'} & sys.modules.keys()))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "[]"
