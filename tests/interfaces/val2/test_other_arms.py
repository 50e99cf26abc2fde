"""VAL-II on an arm of six joints from a description, an xArm 6; its tool is where URDF says, read here anew."""

from __future__ import annotations

import math
import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree as ET

import numpy as np
import pybullet_data
import pytest
from scipy.spatial.transform import Rotation

from interfaces.messages.control import Lease, Role, Welcome
from interfaces.val2.motion import Arm, EngineRobot, conventions_of
from interfaces.val2.motion.remote import remote_robot
from interfaces.val2.playing import Listeners, Rehearsal, rehearse
from interfaces.val2.source import parse_file
from interfaces.val2.values import VAL2, PrecisionPoint
from robots import load
from robots.onboard.lease import LeaseState
from robots.robot import Gripper
from vrs import Engine
from vrs.errors import InvalidValueError
from vrs.model import Limits

FILE = Path(pybullet_data.getDataPath()) / "xarm" / "xarm6_robot.urdf"
ROBOT = load(f"{FILE}#link6")
MODEL = ROBOT.arm
WAIT = 60.0
VRS = [sys.executable, "-m", "interfaces.cli"]
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}


def tool(q: np.ndarray) -> np.ndarray:
    """The pose of link 6 at joints [rad], (4, 4) [m], by the file alone."""
    joints = {joint.find("child").get("link"): joint for joint in ET.parse(FILE).getroot().iterfind("joint")}
    X, link, angles = np.eye(4), "link6", list(q)
    while link in joints:
        joint = joints[link]
        origin = {key: [float(x) for x in joint.find("origin").get(key).split()] for key in ("xyz", "rpy")}
        step = np.eye(4)
        step[:3, :3] = Rotation.from_euler("xyz", origin["rpy"]).as_matrix()
        step[:3, 3] = origin["xyz"]
        if joint.get("type") == "revolute":
            axis = np.array([float(x) for x in joint.find("axis").get("xyz").split()])
            step[:3, :3] = step[:3, :3] @ Rotation.from_rotvec(axis * angles.pop()).as_matrix()
        X, link = step @ X, joint.find("parent").get("link")
    return X


def rehearsed(*lines: str, q: np.ndarray | None = None) -> tuple[Rehearsal, str]:
    """What becomes of a program on the arm, and what it types."""
    typed: list[str] = []
    found = rehearse(
        parse_file("\n".join([".PROGRAM main", *lines, ".END"]), "t.v2"),
        MODEL,
        listeners=Listeners(typed.append),
        start=q,
        conventions=conventions_of(ROBOT),
    )
    return found, "".join(typed)


def numbers(text: str) -> list[float]:
    return [float(x) for x in re.findall(r"-?\d+\.?\d*(?:E-?\d+)?", text)]


def test_where_and_here_are_the_last_link_in_the_base_frame() -> None:
    q = np.radians([20.0, -30.0, -50.0, 10.0, 40.0, -15.0])
    found, typed = rehearsed(
        "SET p = HERE", "DECOMPOSE a[1] = p", "TYPE a[1], a[2], a[3], a[4], a[5], a[6]",
        "DECOMPOSE j[1] = #HERE", "TYPE j[1], j[2], j[3], j[4], j[5], j[6]", q=q,
    )  # fmt: skip
    assert found.findings == ()
    place, joints = (numbers(line) for line in typed.splitlines())
    X = tool(q)
    X[:3, 3] *= 1000.0
    np.testing.assert_allclose(VAL2.transformation(*place).X, X, atol=1e-3)
    np.testing.assert_allclose(joints, np.degrees(q), atol=1e-3)


def test_a_program_moves_it_as_its_own_kinematics_say() -> None:
    found, typed = rehearsed(
        "DISABLE CP", "SET p = TRANS(300, 80, 150, 0, 90, 0)", "MOVE p", "BREAK", "t0 = TIME()",
        "FOR i = 1 TO 2", "SET q = SHIFT(p BY 0, -100 * i, 40 * i)",
        "APPRO q, 60", "BREAK", "t1 = TIME()", "MOVES q", "BREAK", "t2 = TIME()", "TYPE t1, t2", "DEPARTS 60",
        "BREAK", "TYPE DX(HERE), DY(HERE), DZ(HERE)", "END",
        "SET #back = #DEST", "MOVES p", "MOVE #back", "DRIVE 1, 10, 50", "READY", "NEST", "ALIGN", "BREAK",
    )  # fmt: skip
    assert found.findings == ()
    lines = typed.splitlines()
    for i in (1, 2):
        t1, t2 = numbers(lines[2 * i - 2])
        start, goal = (
            np.array([0.3, 0.08 - 0.1 * i, 0.21 + 0.04 * i]),
            np.array([0.3, 0.08 - 0.1 * i, 0.15 + 0.04 * i]),
        )
        poses = [tool(found.timeline.sample(t)) for t in np.linspace(t1, t2, 101)]
        tips = np.array([X[:3, 3] for X in poses])
        assert np.abs(tips[0] - start).max() < 1e-6
        assert np.abs(tips[-1] - goal).max() < 1e-6
        assert np.abs(np.cross(tips - start, [0.0, 0.0, 1.0])).max() < 1e-5
        assert np.ptp(tips[:, 2]) == pytest.approx(0.06, abs=1e-6)
        # The hand keeps pointing down.
        assert max(np.abs(X[:3, 2] - [0.0, 0.0, -1.0]).max() for X in poses) < 1e-5
        assert numbers(lines[2 * i - 1]) == pytest.approx((1000.0 * start).tolist(), abs=1e-3)
    # NEST and READY are where it stands at first, as nothing else is said; ALIGN turned its tool to an axis.
    there = tool(found.timeline.final())
    assert np.abs(there[:3, 2]).max() == pytest.approx(1.0, abs=1e-6)
    assert np.abs(there[:3, 3] - tool(MODEL.poses["nominal"])[:3, 3]).max() < 1e-6


def test_a_tool_and_where_a_gripper_holds_count_from_the_last_link() -> None:
    held = replace(ROBOT, devices=(Gripper((0.0, 0.01, 0.12)),))
    arm = Arm(EngineRobot(Engine(MODEL, q=MODEL.poses["nominal"])), conventions=conventions_of(held))
    X = tool(MODEL.poses["nominal"])
    at = 1000.0 * (X[:3, 3] + X[:3, :3] @ [0.0, 0.01, 0.12])
    assert arm.here(now=0.0).tool.X[:3, 3] == pytest.approx(at, abs=1e-6)
    arm.set_tool(VAL2.transformation(0, 0, 50, 90, -90, 0))
    assert arm.here(now=0.0).tool.X[:3, 3] == pytest.approx(at + 50.0 * X[:3, 2], abs=1e-6)


def test_named_poses_are_ready_and_nest() -> None:
    poses = {"nominal": np.zeros(6), "ready": np.full(6, 0.1), "nest": np.full(6, 0.2)}
    posed = conventions_of(replace(ROBOT, model=replace(MODEL, poses=poses)))
    assert posed.ready == PrecisionPoint((math.degrees(0.1),) * 6)
    assert posed.nest == PrecisionPoint((math.degrees(0.2),) * 6)


def test_joints_whose_range_begins_above_zero_read_as_they_are() -> None:
    limits = replace(MODEL.limits, q_min=np.full(6, 0.2), q_max=np.full(6, 3.0))
    spoken = conventions_of(ROBOT)
    q = np.linspace(0.3, 2.9, 6)
    assert spoken.point(q, limits).joints == pytest.approx(np.degrees(q))
    assert spoken.joints(spoken.point(q, limits), limits) == pytest.approx(q)


@pytest.mark.parametrize("word", ["RIGHTY", "LEFTY", "ABOVE", "BELOW", "FLIP", "NOFLIP"])
def test_words_of_configurations_are_one_clear_error(word: str) -> None:
    (finding,) = rehearsed(word)[0].findings
    said = f"*Not available* {word}: xarm6 has no names of configurations; allowed: MOVE #point"
    assert str(finding.error).startswith(said)


def test_limits_name_the_joint() -> None:
    (finding,) = rehearsed("MOVE #PPOINT(0, 130, -60)")[0].findings
    assert str(finding.error).startswith("*Location out of range* Jt 2 (joint2) would be at 130 deg, allowed are -")


@contextmanager
def server() -> Iterator[tuple[str, int, str]]:
    """A server of the arm: its address, and of VAL-II's terminals the port and the token."""
    process = subprocess.Popen(
        [*VRS, "serve", "--robot", f"{FILE}#link6", "--port", "0", "--val-port", "0", "--body", "ideal",
         "--link-loss", "hold", "--until-eof"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=ENVIRONMENT,
        start_new_session=True,
    )  # fmt: skip
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        said = [process.stdout.readline() for _ in range(4)]
        (port,), (url,) = re.findall(r"VAL-II on \S+ port (\d+)", said[2]), re.findall(r"http://[\d.:]+", said[0])
        yield url, int(port), said[3].split()[-1]
    finally:
        process.stdin.close()
        process.stdout.close()
        try:
            assert process.wait(timeout=WAIT) == 0
        finally:
            process.kill()
            process.wait()


@contextmanager
def terminal(port: int, token: str) -> Iterator[Callable[[str], str]]:
    """What says a line at a terminal over TCP."""
    with socket.create_connection(("127.0.0.1", port), timeout=WAIT) as client:

        def say(text: str) -> str:
            client.sendall(f"{text}\r\n".encode())
            heard = ""
            while not heard.endswith("."):
                data = client.recv(65536)
                assert data, heard
                heard += data.decode()
            return heard

        say(token)
        yield say


def console(url: str, text: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """What a console elsewhere makes of lines."""
    return subprocess.run(
        [*VRS, "console", "--connect", url, *arguments],
        input=text, capture_output=True, text=True, timeout=WAIT, check=False, env=ENVIRONMENT,
    )  # fmt: skip


@pytest.mark.slow
def test_at_a_served_arm_and_at_a_console_elsewhere() -> None:
    with server() as (url, port, token):
        with terminal(port, token) as say:
            given_up = time.monotonic() + WAIT
            while "X/JT1" not in say("where real"):
                assert time.monotonic() < given_up
                time.sleep(0.1)
            assert "joint6" in say("status")
            assert "*Not available* LEFTY: xarm6 has no" in say("do lefty")
            assert "*" not in say("do move trans(300, 80, 150, 0, 80, 0)")
            where = numbers(say("where"))[-13:-1]
            assert where[:6] == pytest.approx([300, 80, 150, 0, 80, 0], abs=0.01)
            np.testing.assert_allclose(tool(np.radians(where[6:]))[:3, 3], [0.3, 0.08, 0.15], atol=2e-5)
        done = console(url, "do draw ,,50\nwhere\n", "--robot", f"{FILE}#link6")
        assert done.returncode == 0, done.stderr
        (row,) = re.findall(r"HAND\n(.*\n)", done.stdout)
        assert numbers(row) == pytest.approx([300, 80, 200, 0, 80, 0], abs=0.01)


@pytest.mark.parametrize(
    ("name", "limits", "said"),
    [
        (
            "puma560",
            MODEL.limits,
            "the server's, puma560: --robot says which",
        ),
        ("xarm6", replace(MODEL.limits, qd_max=2.0 * MODEL.limits.qd_max), "robot must be of the server's limits"),
    ],
)
def test_at_another_arm_elsewhere_a_console_doesnt_begin(name: str, limits: Limits, said: str) -> None:
    welcome = Welcome(1, "s", Role.OPERATOR, name, 6, limits, {}, 0.0, Lease(LeaseState.FREE), 1.0)
    with pytest.raises(InvalidValueError, match=re.escape(said)):
        remote_robot(SimpleNamespace(welcome=welcome), ROBOT)
