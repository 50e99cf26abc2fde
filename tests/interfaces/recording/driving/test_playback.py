"""A mobile robot's recording played back: what is shown when, on lines, on a page, in tables."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from interfaces.cli.main import exit_status
from interfaces.recording import open_recording
from interfaces.recording.marks import MarkKind
from interfaces.recording.playback import Playback
from interfaces.recording.stages import Stage
from tests.interfaces.pages import until, wait
from tests.interfaces.recording.driving.runs import SLALOM, WANDER, recorded
from tests.interfaces.recording.test_page import near, served

POSES = """twin => [0, 1, 2, 3, 4].map((i) => {
    const node = replay.node(0, 'vrs', twin, 'body', String(i));
    node.updateMatrix();
    return node.matrix.toArray();
})"""


@pytest.mark.parametrize("case", [SLALOM, WANDER], ids=lambda case: case.operator)
def test_the_real_robot_is_where_the_virtual_one_was(case) -> None:
    drive, path = recorded(case)
    with open_recording(path) as recording:
        playback = Playback([recording])
        shown = 0
        for t in np.linspace(0.0, drive.t[-1], 60).tolist():
            (frame,) = playback.moment(t).frames
            assert frame.q_virtual == pytest.approx(recording.virtual(t))
            assert frame.q_real is not None
            assert frame.play is not None
            assert frame.error is not None
            assert frame.play <= t + 1e-9
            apart = np.linalg.norm(recording.virtual(frame.play)[:2] - frame.q_real[:2])
            # A cell, and what it drives in a step.
            assert abs(apart - frame.error) < 0.01 + 0.5 * 0.05
            shown += frame.behind is not None and frame.behind > 0.1
        assert shown > 10
        (last,) = playback.moment(float(drive.t[-1])).frames
        if case is SLALOM:
            assert last.behind == 0.0


def test_marks_are_what_happened_and_not_each_command() -> None:
    drive, path = recorded(WANDER)
    with open_recording(path) as recording:
        playback = Playback([recording])
        playback.read_marks()
        marks = playback.tracks[0].marks.marks
        first = next(t for t, cells in drive.learned if cells)
        assert marks[0].t == first
        assert {mark.kind for mark in marks} <= {MarkKind.OTHER, MarkKind.STOPPED}
        assert len(marks) < 40


def test_frames_come_as_lines(capsys) -> None:
    drive, path = recorded(SLALOM)
    assert exit_status(["replay", str(path), "--headless", "--at", "4", "--json"]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    facts = json.loads(line)
    assert facts["t"] == 4.0
    assert facts["q_virtual"] == pytest.approx(drive.virtual[80].tolist(), abs=1e-12)
    assert facts["q_real"] == pytest.approx(drive.real[80].tolist(), abs=1e-12)
    assert facts["behind"] == pytest.approx(4.0 - facts["play"])
    assert facts["error"] < 0.05
    assert exit_status(["replay", str(path), "--headless", "--at", "0.3", "--rate", "-8"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].split()[0] == "0.000"
    assert all(line.endswith(" m") for line in lines)
    assert exit_status(["replay", str(path), "--commands", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["identical"], facts["commands"]) == (True, 60)


def test_tables_have_every_digit(tmp_path: Path) -> None:
    drive, path = recorded(WANDER)
    assert exit_status(["export", str(path), "--csv", str(tmp_path)]) == 0
    texts = {file.stem: file.read_text(encoding="utf-8") for file in tmp_path.iterdir()}
    found = {name: list(csv.DictReader(text.splitlines())) for name, text in texts.items()}
    for name, table in (
        ("virtual", drive.virtual),
        ("real", drive.real),
        ("measured", drive.measured),
        ("estimated", drive.estimated),
    ):
        rows = [[float(row[column]) for column in ("x_m", "y_m", "theta_rad")] for row in found[name]]
        assert rows == table.tolist()
    told = [[float(row["v_m_per_s"]), float(row["w_rad_per_s"])] for row in found["real"]]
    assert told == drive.drives.tolist()
    assert len(found["commands"]) == len(found["receipts"]) == len(found["edits"]) - 1
    assert len(found["segments"]) >= len(found["commands"])
    assert sum(int(row["size_byte"]) for row in found["link"] if row["direction"] == "forward") == drive.sent_bytes
    came = sum({"true": 1, "false": -1}[row["came"]] for row in found["environment"])
    assert came == len(drive.learned[-1][1])


def test_a_report_has_the_figures_and_the_pictures(tmp_path: Path) -> None:
    drive, path = recorded(WANDER)
    for name in ("one.html", "other.html"):
        assert exit_status(["export", str(path), "--report", str(tmp_path / name)]) == 0
    text = (tmp_path / "one.html").read_text(encoding="utf-8")
    assert text == (tmp_path / "other.html").read_text(encoding="utf-8")
    assert f"{100 * drive.compare().path_error_max:.3f}" in text
    assert text.count("data:image/svg+xml;base64,") == 2
    assert "<script" not in text
    assert "the virtual environment learned" in text


def test_the_stage_shows_what_was_known_then() -> None:
    drive, path = recorded(WANDER)
    with open_recording(path) as recording:
        stage = Stage(recording)
        told = {}
        stage.scene.show = lambda **named: told.update(named)  # type: ignore[method-assign]
        playback = Playback([recording])
        for t, cells in drive.learned[::3]:
            (frame,) = playback.moment(t).frames
            stage.show(frame, None, now=t)
            assert told["learned"] == tuple(sorted(cells))
            assert told["t"] == t
            assert told["driven"]["virtual"][-1].tolist() == drive.virtual[round(t / 0.05)][:2].tolist()
            assert told["driven"]["real"][-1].tolist() == drive.real[round(t / 0.05)][:2].tolist()


def test_a_page_shows_both_robots_and_their_room(new_page) -> None:
    drive, path = recorded(WANDER)
    with open_recording(path) as recording:
        robot = recording.robot
    with served(path) as server:
        page = new_page(server.url, 640, 480, "light", expected="WebSocket connection")
        page.goto(f"{server.url}/replay")
        wait(page, "!!window.replay && !!replay.state && replay.views.length === 1")
        wait(page, "replay.node(0, 'vrs', 'real', 'body', '4').children.length === 1")
        page.evaluate("replay.wish('seek', { t: 9 })")
        near(server, 9.0)
        for twin, posture in (("virtual", drive.virtual[180]), ("real", drive.real[180])):
            expected = np.array([X.T.ravel() for X in robot.placed(posture)])
            until(lambda: np.abs(np.array(page.evaluate(POSES, twin)) - expected).max() < 1e-6)  # noqa: B023
        wait(page, "replay.node(0, 'vrs', 'driven', 'virtual', '0').children.length === 1")
        wait(page, "replay.node(0, 'vrs', 'room', '0').children.length === 1")
        wait(page, "document.querySelector('.error').textContent.endsWith(' cm')")
        assert page.locator("[data-path=driven]").is_visible()
        assert page.locator("[data-path=learned]").is_visible()
