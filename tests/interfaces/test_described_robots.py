"""Robots from descriptions go through every door that takes one, and recordings find theirs again."""

from __future__ import annotations

import json
import re
import shutil
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from interfaces.cli.main import exit_status
from interfaces.recording import open_recording
from robots.simulated import WORLDS, missing_for
from tests.interfaces.live_rig import child
from tests.interfaces.station.opened import Page, station
from tests.robots.description.stranger import write
from tests.robots.description.tried import bullet_data

HUSKY = "husky/husky.urdf"
DIFF = "diff:wheelbase=0.3,wheel=0.06,v=0.4"


def vrs(*arguments: object, status: int = 0) -> str:
    """What a command says on standard output; it ends as it should."""
    said = StringIO()
    with redirect_stdout(said):
        assert exit_status([str(argument) for argument in arguments]) == status
    return said.getvalue()


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stranger's robot."""
    return write(tmp_path_factory.mktemp("robot"))


@pytest.fixture(scope="module")
def demo(robot: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a demo of it leaves, which was begun beside the file."""
    out = tmp_path_factory.mktemp("demo")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(robot.parent)
        vrs("demo", "--robot", robot.name, "--delay", "wed", "--out", out)
    return out


def test_a_check_says_what_is_there_what_is_assumed_and_how_it_is_stated(robot: Path) -> None:
    said = vrs("check", robot)
    for words in (
        "an arm of 4 joints that ends at palm",
        "grip too mimics another: 1 × grip + 0",
        "fingers: open ",
        "- upper: mesh my meshes/gone.dae wasn't found",
        "my robot.vrs.toml:",
        '    [joints."shoulder"]\n    acceleration = 8\n    jerk = 80\n',
    ):
        assert words in said
    assert re.search(r"elbow +-180°\* +180°\* +57\.3°\*", said)
    facts = json.loads(vrs("check", robot, "--json", "--tip", "lamp"))
    assert (facts["kind"], facts["tip"], facts["driven"]) == ("arm", "lamp", ["pan", "tilt"])
    assert [body["name"] for body in facts["bodies"]] == [*WORLDS, "ideal"]
    assert {joint["name"]: joint["upper"] for joint in facts["joints"]}["grip"] == 0.03
    husky = json.loads(vrs("check", bullet_data(HUSKY), "--json"))
    assert (husky["kind"], husky["wheelbase_m"]) == ("mobile robot", pytest.approx(0.5708))


def test_a_check_lists_its_bodies_and_says_what_one_needs_that_is_not_installed(
    robot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("interfaces.cli.check_robot.missing_for", lambda _: "")
    assert f"bodies: {', '.join(WORLDS)}, ideal\n" in vrs("check", robot)
    assert f"bodies: {', '.join(WORLDS)}, bare\n" in vrs("check", DIFF)
    monkeypatch.setattr("robots.simulated.find_spec", lambda name: None if name == "mujoco" else name)
    monkeypatch.setattr("interfaces.cli.check_robot.missing_for", missing_for)
    assert "mujoco (needs mujoco, which isn't installed)" in vrs("check", robot)
    facts = json.loads(vrs("check", robot, "--json"))
    assert {body["name"]: body["missing"] for body in facts["bodies"]} == {
        "bullet": None, "mujoco": "mujoco", "ideal": None
    }  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("check", "ROBOT", "--static"),
            "static must be left out: descriptions of robots have nothing of the kind",
        ),
        (("check", "ROBOT", "other.v2"), "file must be a robot's, as the others are"),
        (("check", "ROBOT", "--tip", "thumb"), "one of finger, other finger, lamp, or another link"),
        (("demo", "--robot", "ROBOT", "--tip", "thumb", "--out", "."), "tip must be one of finger"),
        (("serve", "--robot", "ROBOT", "--robot", "ipr", "--tip", "lamp"), "FILE#LINK says it of each"),
        (("run", "any.v2", "--robot", "ROBOT"), "any.v2"),
        (("console", "--robot", "ROBOT"), "an arm of 6 joints that turn"),
        (("lab", "--robot", "ROBOT", "--out", "."), "a mobile robot; this one is an arm"),
        (("demo", "--robot", DIFF, "--out", "."), "an arm; this one is a mobile robot"),
        (("replay", "a.mcap", "--tip", "lamp"), "tip must be left out without --robot"),
    ],
)
def test_doors_say_what_they_take(
    robot: Path, arguments: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert exit_status([str(robot) if word == "ROBOT" else word for word in arguments]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.strip().splitlines()) == 1


def test_a_recording_knows_its_robot_by_the_file_and_runs_again(demo: Path) -> None:
    recording = demo / "run.mcap"
    summary = json.loads((demo / "summary.json").read_text())
    assert [x is None for x in summary["errors"]["servo"]["joint_rms_deg"]] == [True, False, False, False]
    assert vrs("compare", recording, "--json") == (demo / "summary.json").read_text()
    assert "identical" in vrs("replay", recording, "--commands")
    frame = json.loads(vrs("replay", recording, "--headless", "--at", "5", "--json"))
    assert frame


def test_a_recording_says_when_its_file_is_gone_and_takes_another(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path)
    (tmp_path / "plan.jsonl").write_text('{"issue": 0.0, "execute": 0.5, "move": [20, -30]}')
    out = tmp_path / "out"
    vrs(
        "demo",
        "--robot",
        path,
        "--tip",
        "lamp",
        "--commands",
        tmp_path / "plan.jsonl",
        "--delay",
        "none",
        "--out",
        out,
    )
    assert "identical" in vrs("replay", out / "run.mcap", "--commands")
    with open_recording(out / "run.mcap") as opened:
        assert opened.robot.found_by == f"{path}#lamp"
    moved = tmp_path / "elsewhere"
    shutil.move(tmp_path / "strange things", moved)
    vrs("replay", out / "run.mcap", "--commands", status=2)
    error = capsys.readouterr().err
    assert f"{path}: there's no such file; --robot says where it is" in error
    there = moved / "robots" / path.name
    assert "identical" in vrs("replay", out / "run.mcap", "--commands", "--robot", there, "--tip", "lamp")
    capsys.readouterr()
    text = there.read_text(encoding="utf-8")
    there.write_text(text.replace('<origin xyz="1 0 0"/>', '<origin xyz="1.02 0 0"/>'), encoding="utf-8")
    vrs("compare", out / "run.mcap", "--robot", there, "--tip", "lamp", status=2)
    assert "its tool is up to 20 mm from where the recording has it" in capsys.readouterr().err


@pytest.mark.parametrize("body", ["bullet", "mujoco"])
def test_its_physics_follows_in_either_world(robot: Path, tmp_path: Path, body: str) -> None:
    (tmp_path / "plan.jsonl").write_text('{"issue": 0.0, "execute": 0.5, "move": [0.3, 40, -30, 60], "speed": 0.5}')
    vrs(
        "demo", "--robot", robot, "--body", body, "--commands", tmp_path / "plan.jsonl", "--delay", "none",
        "--out", tmp_path,
    )  # fmt: skip
    servo = json.loads((tmp_path / "summary.json").read_text())["errors"]["servo"]
    assert 0.0 < servo["tool_rms_m"] < 0.01
    assert max(x for x in servo["joint_rms_deg"] if x is not None) < 0.5


def test_bases_drive_in_the_laboratory_and_their_recordings_play(tmp_path: Path) -> None:
    vrs(
        "lab", "--robot", DIFF, "--robot", bullet_data(HUSKY), "--operator", "slalom", "--architecture", "timeline",
        "--runs", 1, "--length", 6, "--workers", 1, "--record", "--out", tmp_path,
    )  # fmt: skip
    recordings = sorted((tmp_path / "runs").glob("*.mcap"))
    assert len(recordings) == 2
    names = set()
    for recording in recordings:
        assert vrs("replay", recording, "--headless", "--at", "3", "--json")
        with open_recording(recording) as opened:
            names.add(opened.robot.name)
            assert opened.robot.shapes()
    assert names == {"diff", "husky_robot"}


def test_a_described_arm_is_served_with_its_shapes_and_the_names_of_its_joints(robot: Path, new_page: Any) -> None:
    with child("serve", "--port", "0", "--robot", str(robot), "--link-loss", "hold") as server:
        url = station(server)
        page = Page(new_page(url, 1280, 800, "light", expected="WebSocket connection"), url).open()
        page.take_control()
        names = "[...document.querySelectorAll('.joint .name')].map((name) => name.title)"
        assert page.get(names) == ["slide", "shoulder", "elbow", "roll"]
        page.page.locator("button[aria-label='Joint 2 up']").click(delay=500)
        page.wait("station.session.timeline.joints(station.session.now)[1] > 0.001")


def test_an_arm_that_its_drives_can_not_hold_sinks_and_the_run_says_so(tmp_path: Path) -> None:
    """It's held where it was found, again and again, while it sinks on."""
    (tmp_path / "weak.urdf").write_text(
        """<robot name="weak"><link name="base"/><link name="arm"><inertial><mass value="5"/><origin xyz="0.5 0 0"/>
        <inertia ixx="0.01" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="a"
        type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/><dynamics damping="60"/>
        <limit lower="-1" upper="1" effort="0.5" velocity="1"/></joint></robot>"""
    )
    vrs("demo", "--robot", tmp_path / "weak.urdf", "--delay", "mon", "--out", tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["commands"]["virtual"]["rejected"] > 5
    assert "more than 0.1 rad" in summary["receipts_virtual"][-1]["reason"]
