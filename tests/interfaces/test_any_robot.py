"""Robots that nobody here knows: made up in a few lines, they go through every room that takes a robot."""

from __future__ import annotations

import ast
import csv
import json
import re
import time
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from interfaces import connect_mobile
from interfaces.cli.main import app, exit_status
from interfaces.lab.driving.run import run
from interfaces.link import delay_profile
from interfaces.recording import open_recording
from interfaces.recording.rerun import rerun
from interfaces.recording.run_recorders import RunRecorder
from interfaces.report.html import render
from interfaces.runs.drive_run import DriveCase
from interfaces.runs.summary import summarize
from interfaces.runtime.plan import default_plan
from interfaces.runtime.session import run_twins
from robots import Robot
from tests.interfaces import own_arm, own_base
from tests.interfaces.live_rig import child
from tests.interfaces.station.opened import Page, station
from vrs.model import Array, Limits

HERE = Path(__file__).parent
ARM, BASE = "tests.interfaces.own_arm:ROBOT", "tests.interfaces.own_base:ROBOT"
PLAN = """{"title": "Lifting"}
{"issue": 0.0, "execute": 0.5, "move": [40, 0.4, -60], "speed": 0.8}
{"issue": 1.0, "payload": {"mass_kg": 2.0}}
{"issue": 2.0, "execute": 2.5, "move": {"pose": "low"}}
"""


NAMES = re.compile(r"puma|\bipr\b|\bmicro\b|cubo", re.IGNORECASE)
PAPERS = {"doulgeri", "han2001", "kim2002", "kim2006", "tipsuwan"}
"""Folders of the laboratory: what they reproduce was done with one robot."""


def test_no_shared_room_names_a_robot() -> None:
    shared = [
        path
        for path in sorted((HERE.parents[1] / "interfaces").rglob("*"))
        if path.suffix in {".py", ".js", ".html", ".css"}
        and not {"val2", *PAPERS} & set(path.relative_to(HERE.parents[1]).parts)
    ]
    assert len(shared) > 200
    found = [
        f"{path.relative_to(HERE.parents[1])}:{number}: {line.strip()}"
        for path in shared
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if NAMES.search(line)
    ]
    assert found == []


def vrs(*arguments: object) -> str:
    """What a command says on standard output; it ends well."""
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert done.exit_code == 0, done.output
    return done.stdout


def code_lines(path: Path) -> int:
    """Lines of a module that aren't blank, documentation or imports."""
    text = path.read_text(encoding="utf-8")
    left: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)):
            first = body[0]
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                left |= set(range(first.lineno, (first.end_lineno or 0) + 1))
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            left |= set(range(node.lineno, (node.end_lineno or 0) + 1))
    return sum(bool(line.strip()) and number not in left for number, line in enumerate(text.splitlines(), start=1))


@pytest.mark.parametrize("module", [own_arm, own_base])
def test_a_robot_is_made_up_in_60_lines(module: ModuleType) -> None:
    assert code_lines(Path(str(module.__file__))) <= 60


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a demo of the arm leaves."""
    out = tmp_path_factory.mktemp("arm")
    (out / "plan.jsonl").write_text(PLAN)
    vrs("demo", "--robot", ARM, "--commands", out / "plan.jsonl", "--delay", "wed", "--out", out / "out")
    return out / "out"


def test_a_demo_tells_joints_that_turn_in_degrees_and_those_that_slide_in_metres(demo: Path) -> None:
    summary = json.loads((demo / "summary.json").read_text())
    assert summary["robot"] == "crane"
    servo = summary["errors"]["servo"]
    assert [x is None for x in servo["joint_rms_deg"]] == [False, True, False]
    assert [x is None for x in servo["joint_rms_m"]] == [True, False, True]
    # Its load of 2 kg is taken in mid-run, and it sags by a millimetre a kilogram.
    assert servo["joint_max_m"][1] == pytest.approx(2e-3, abs=1e-3)
    assert servo["worst_joint"] == 2
    assert summary["receipts_virtual"][0]["q_m"] == [None, 0.4, None]
    assert summary["receipts_virtual"][0]["q_deg"] == pytest.approx([40.0, None, -60.0])
    assert summary["commands"]["real"]["accepted"] == 2


def test_its_recording_says_what_the_run_said(demo: Path, tmp_path: Path) -> None:
    path = demo / "run.mcap"
    assert vrs("compare", path, "--robot", ARM, "--json") == (demo / "summary.json").read_text()
    assert "2 commands and corrections, 2 timelines compared" in vrs("replay", path, "--commands", "--robot", ARM)
    shown = json.loads(vrs("replay", path, "--headless", "--at", 2.0, "--json", "--robot", ARM).splitlines()[-1])
    assert shown["q_virtual"] == pytest.approx([np.radians(40), 0.4, np.radians(-60)])
    vrs("export", path, "--csv", tmp_path, "--report", tmp_path / "report.html", "--robot", ARM)
    assert (tmp_path / "report.html").read_bytes() == (demo / "report.html").read_bytes()
    with open(tmp_path / "real.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {"q1_rad", "q2_m", "q3_rad", "reference2_m"} <= rows[0].keys()
    last = [float(rows[-1][name]) for name in ("q1_rad", "q2_m", "q3_rad")]
    assert last == pytest.approx([0.5, 0.05 - 2e-3, -1.0], abs=1e-6)


@pytest.mark.needs("pybullet", "mujoco")
def test_the_puma_follows_alike_in_both_worlds_of_physics(tmp_path: Path) -> None:
    (tmp_path / "plan.jsonl").write_text("""{"title": "Turn"}
{"issue": 0.0, "execute": 0.5, "move": [30, 20, 10, 40, -30, 20], "speed": 0.8}
{"issue": 0.5, "payload": {"mass_kg": 1.5}}
""")
    found = {}
    for body in ("bullet", "mujoco", "ideal"):
        vrs("demo", "--body", body, "--commands", tmp_path / "plan.jsonl", "--out", tmp_path / body)
        found[body] = json.loads((tmp_path / body / "summary.json").read_text())["errors"]["servo"]["joint_rms_deg"]
    assert max(found["ideal"]) == 0.0
    assert min(found["bullet"]) > 1e-3
    # Encoders count: what one world rounds up, the other may round down.
    assert found["mujoco"] == pytest.approx(found["bullet"], rel=0.05, abs=1e-3)


class Snake:
    """A planar arm of n joints about z."""

    name, prismatic, tool_speed, tool_turn_speed, characteristic_length = "snake", (), 0.5, 1.0, 1.0

    def __init__(self, n: int) -> None:
        self.limits = Limits(-2.0 * np.ones(n), 2.0 * np.ones(n), np.ones(n), 4.0 * np.ones(n))
        self.poses: dict[str, Array] = {}

    def links(self, q: Array) -> Array:
        yaw = np.cumsum(q, axis=-1)
        X = np.zeros((*yaw.shape, 4, 4)) + np.eye(4)
        X[..., 0, 0], X[..., 1, 0], X[..., 0, 1], X[..., 1, 1] = np.cos(yaw), np.sin(yaw), -np.sin(yaw), np.cos(yaw)
        X[..., :2, 3] = np.cumsum(0.1 * X[..., :2, 0], axis=-2)
        return np.concatenate([np.zeros((*yaw.shape[:-1], 1, 4, 4)) + np.eye(4), X], axis=-3)

    def forward(self, q: Array) -> Array:
        return self.links(np.asarray(q))[..., -1, :, :]


@pytest.mark.parametrize("n", [1, 2, 7, 12])
def test_arms_have_any_number_of_joints(n: int, tmp_path: Path) -> None:
    snake: Any = Snake(n)
    robot = Robot("snake", snake)
    recorder = RunRecorder(tmp_path / "run.mcap")
    played = run_twins(default_plan(snake), robot, delay_profile("mon"), seed=1, keeper=recorder)
    recorder.finish()
    assert played.q_real.shape[1] == n
    figures = summarize(played)
    assert len(figures["errors"]["servo"]["joint_rms_deg"]) == n
    assert figures["path"]["progress"] > 0.99
    assert f'id="plot-joint-{n}"' in render(played, figures)
    assert f'id="plot-joint-{n + 1}"' not in render(played, figures)
    with open_recording(recorder.path, robot) as recording:
        assert rerun(recording).identical
        assert recording.real(2.0).shape == (n,)


@pytest.mark.parametrize(
    "arguments",
    [("compare",), ("compare", "--robot", "puma560"), ("replay", "--commands"), ("export", "--report", "r.html")],
)
def test_without_the_robot_its_recording_says_what_is_missing(
    demo: Path, arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    name, *more = arguments
    assert exit_status([name, str(demo / "run.mcap"), *more]) == 2
    assert "of a robot that isn't known here: 'crane'; --robot says where it is" in capsys.readouterr().err


def test_a_demo_needs_no_plan(tmp_path: Path) -> None:
    vrs("demo", "--robot", ARM, "--delay", "none", "--out", tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["title"] == "Round trip"
    assert summary["commands"]["virtual"]["rejected"] == 0
    assert summary["path"]["progress"] > 0.99


@pytest.mark.parametrize(
    ("move", "said"),
    [("[40, 0.6, 0]", "joint 2 must be within [0, 0.5] m"),
     ("[200, 0.1, 0]", "joint 1 must be within [-143.239, 143.239] deg; given: 200"),
     ("[1, 2]", "3 finite joint values [deg, of prismatic joints m]")],
)  # fmt: skip
def test_errors_are_in_the_joints_units(
    tmp_path: Path, move: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "plan.jsonl").write_text(f'{{"issue": 0.0, "move": {move}}}')
    asked = ["demo", "--robot", ARM, "--commands", str(tmp_path / "plan.jsonl"), "--out", str(tmp_path)]
    assert exit_status(asked) == 2
    assert said in capsys.readouterr().err


def test_its_report_draws_a_robot_without_shapes(demo: Path, new_page: Any) -> None:
    page = new_page((demo / "report.html").as_uri(), 1280, 900, "light", offline=True)
    page.goto((demo / "report.html").as_uri())
    page.wait_for_function("window.report !== undefined")
    titles = page.locator("figure h3").all_text_contents()
    assert {"Joint errors", "Errors of prismatic joints", "Joint 3"} <= set(titles)
    assert page.locator("#no-3d").is_hidden()
    q = np.array([0.7, 0.4, -1.0])
    np.testing.assert_allclose(
        page.evaluate("(q) => report.links(q)", q.tolist()),
        [X.T.ravel() for X in own_arm.ROBOT.arm.links(q)],
        atol=1e-9,
    )
    shapes = json.loads(page.locator("#run-data").text_content())["links"]
    assert [shape["name"] for shape in shapes] == ["link 0", "link 1", "link 2", "link 3"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("serve", "--robot", ARM, "--val-port", "0"), "val-port must be left out"),
        (("serve", "--robot", ARM, "--body", "jelly"), "body of crane must be one of swaying, ideal"),
        (("console", "--robot", ARM), "an arm of 6 joints that turn"),
        (("serve", "--robot", "micro", "--camera", "3"), "micro has nothing of the kind"),
        (("demo", "--robot", "ipr"), "an arm; this one is a mobile robot"),
        (("lab", "--robot", ARM, "--out", "."), "a mobile robot; this one is an arm"),
        (("demo", "--robot", "tests.interfaces.own_arm:Crane"), "a Robot there (ROBOT)"),
        (("demo", "--robot", "crane.urdf"), "crane.urdf: there's no such file"),
        (("demo", "--robot", ARM, "--tip", "hook"), "only a robot of a description has one"),
        (("serve", "--robot", "diff:wheelbase=0.4"), "with at least wheelbase and wheel"),
    ],
)
def test_doors_say_which_robots_they_take(
    arguments: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert exit_status(list(arguments)) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.strip().splitlines()) == 1


def test_it_is_driven_live_seen_on_the_page_and_recorded(tmp_path: Path, new_page: Any) -> None:
    path = tmp_path / "live.mcap"
    with child("serve", "--port", "0", "--robot", ARM, "--link-loss", "hold", "--record", str(path)) as server:
        url = station(server)
        page = Page(new_page(url, 1280, 800, "light", expected="WebSocket connection"), url).open()
        assert not page.get("station.config.panels.some((panel) => panel.name === 'terminal')")
        page.take_control()
        page.get(
            "station.session.order({ type: 'move', target: { type: 'joints', q: [0.5, 0.35, -0.5] }, "
            "insertion: 'replace' }, 'lift')"
        )
        page.until(lambda: np.allclose(page.real, [0.5, 0.35, -0.5], atol=2e-3))
        for name, value, unit in ("J2", "350.0", "mm"), ("J1", "28.6", "°"):
            shown = f"document.getElementById('jog-{name}')"
            page.wait(f"{shown}.value === '{value}' && {shown}.parentElement.textContent.trim() === '{unit}'")
        assert page.errors == []
        page.page.context.close()
    summary = json.loads(vrs("compare", path, "--robot", ARM, "--json"))
    assert summary["robot"] == "crane"
    assert summary["receipts_virtual"][-1]["q_m"] == [None, 0.35, None]
    assert "identical" in vrs("replay", path, "--commands", "--robot", ARM)


def test_a_base_of_another_size_drives_in_the_laboratory(tmp_path: Path) -> None:
    case = DriveCase(robot=BASE, operator="slalom", delay="constant:0.3", length=5.0)
    drive = run(case)
    assert 0.1 < np.abs(drive.drives[:, 0]).max() <= own_base.LIMITS.v_max
    assert drive.limits_passed() == 0
    assert drive.compare().path_error_max < 0.05


def test_a_drive_of_a_base_of_another_size_is_recorded(tmp_path: Path) -> None:
    one = "--architecture", "timeline", "--transport", "datagrams", "--runs", 1, "--length", 2, "--workers", 1
    vrs("lab", "--robot", BASE, "--operator", "slalom", *one, "--record", "--out", tmp_path)
    with open(tmp_path / "runs.csv", newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["robot"] == BASE
    (path,) = (tmp_path / "runs").glob("*.mcap")
    told = json.loads(vrs("compare", path, "--robot", BASE, "--json"))
    assert "missing" not in told
    assert told["robot"] == "cart"
    for name in ("path_error_max", "time_difference_mean", "limits_passed"):
        assert told[name] == pytest.approx(float(row[name]), rel=1e-5)
    assert "identical" in vrs("replay", path, "--commands", "--robot", BASE)
    shown = json.loads(vrs("replay", path, "--headless", "--at", 1.0, "--json", "--robot", BASE).splitlines()[-1])
    assert len(shown["q_virtual"]) == len(shown["q_real"]) == 3
    vrs("export", path, "--csv", tmp_path, "--report", tmp_path / "report.html", "--robot", BASE)
    with open(tmp_path / "real.csv", newline="") as file:
        assert {"x_m", "y_m", "theta_rad", "v_m_per_s"} <= next(csv.DictReader(file)).keys()
    assert "cart" in (tmp_path / "report.html").read_text()
    assert exit_status(["compare", str(path)]) == 2


def test_a_base_without_shapes_is_a_box_where_it_stands() -> None:
    (box,) = own_base.ROBOT.shapes()
    front = own_base.CHASSIS.centre_x + own_base.CHASSIS.length / 2
    assert box.vertices[:, 0].max() == pytest.approx(front)
    assert box.vertices[:, 0].min() == pytest.approx(front - own_base.CHASSIS.length)
    (X,) = own_base.ROBOT.placed((1.0, 2.0, np.pi / 2))
    assert pytest.approx([1.0, 3.0, 0.0, 1.0]) == X @ [1, 0, 0, 1]


def test_a_base_of_another_size_is_driven_live_seen_on_the_page_and_recorded(tmp_path: Path, new_page: Any) -> None:
    path = tmp_path / "live.mcap"
    where = "--room", "furnished", "--record", str(path), "--recordings", str(tmp_path)
    with child("serve", "--port", "0", "--robot", BASE, "--link-loss", "hold", *where) as server:
        url = station(server)
        page = Page(new_page(url, 1280, 800, "light", expected="WebSocket connection"), url).open(live=False)
        with connect_mobile(url.rstrip("/"), name="somebody", timeout=20.0) as robot:
            assert robot.welcome.robot == "cart"
            assert robot.welcome.limits.v_max == own_base.LIMITS.v_max
            assert robot.wait(lambda it: it.postures is not None and it.postures.real is not None, 60.0)
            robot.acquire()
            assert robot.wait(lambda it: it.postures is not None and not it.postures.halted, 20.0)
            begun = robot.postures.real.x
            for _ in range(20):
                robot.drive(0.7, 0.0, wait=5.0)
                time.sleep(0.1)
            assert robot.wait(lambda it: it.postures.real.x > begun + 0.2, 30.0)
            assert not page.get("station.config.panels.some((panel) => panel.name === 'camera')")
            page.wait("station.recordings.now?.name === 'live.mcap'")
        assert page.errors == []
        page.page.context.close()
    told = json.loads(vrs("compare", path, "--robot", BASE, "--json"))
    assert told["robot"] == "cart"
    assert told["path_error_max"] < 0.05
    assert told["time_difference_mean"] > 0.0
    assert "identical" in vrs("replay", path, "--commands", "--robot", BASE)
