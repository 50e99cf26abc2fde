"""What a recording says of a robot whose reports come late, get lost, or stay away."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from interfaces.recording.figures import figures, summary
from interfaces.recording.recording import open_recording
from interfaces.recording.track import REAL
from interfaces.report.html import render
from interfaces.report.tables import rich_tables
from tests.interfaces.recording.driven import HOME, MODEL, Driven
from vrs import Insertion, JointTarget, MotionCommand, SteerCommand
from vrs.comparison import agreement, compare_paths
from vrs.errors import FormatError


def drive(made: Driven, seconds: float) -> None:
    """Moves, and some steering."""
    end = made.now + seconds
    k = 0
    while made.now < end:
        away = 0.5 * np.sin(np.arange(1, 7) * (k + 1))
        made.tell(MotionCommand(JointTarget(HOME + away), speed=0.5, insertion=Insertion.SPLICE))
        made.run(1.7)
        for _ in range(20):
            made.tell(SteerCommand(rates=0.3 * np.cos(np.arange(6) + k), issued_at=made.now))
            made.run(0.05)
        k += 1


def own_figures(made: Driven, recording) -> dict[str, np.ndarray]:
    """The figures at the robot's own site, from its own log: at 100 Hz, all of it."""
    track = recording.track(REAL)
    rows = made.own(track.t[0], track.t[-1])
    t, play, q, asked = rows[:, 0], rows[:, 1], rows[:, 2:8], rows[:, 8:]
    virtual = made.operator.robot.engine.timeline
    found = agreement(MODEL, virtual.sample(play), q)
    servo = agreement(MODEL, asked, q)
    p_virtual, p_real = (MODEL.forward(values)[:, :3, 3] for values in (virtual.sample(t), q))
    path = compare_paths(t, p_virtual, p_real)
    return {
        "joint_rms": np.degrees(found.joint_rms), "joint_max": np.degrees(found.joint_max),
        "servo_rms": np.degrees(servo.joint_rms), "tool": np.array([found.tool_rms, found.tool_max]),
        "path": np.array([path.path_error_mean, path.path_error_max]),
        "late": np.array([path.time_difference_mean]),
    }  # fmt: skip


def recorded_figures(value) -> dict[str, np.ndarray]:
    timeline, servo, path = value["errors"]["timeline_time"], value["errors"]["servo"], value["path"]
    return {
        "joint_rms": np.array(timeline["joint_rms_deg"]), "joint_max": np.array(timeline["joint_max_deg"]),
        "servo_rms": np.array(servo["joint_rms_deg"]),
        "tool": np.array([timeline["tool_rms_m"], timeline["tool_max_m"]]),
        "path": np.array([path["path_error_mean"], path["path_error_max"]]),
        "late": np.array([path["time_difference_mean"]]),
    }  # fmt: skip


@pytest.mark.parametrize(("delay", "loss", "seed"), [("mon", "0", 1), ("wed", "0", 2), ("constant:0.1", "0.2", 3)])
def test_a_live_recording_says_what_the_robots_own_log_says(tmp_path, delay, loss, seed):
    made = Driven(tmp_path / "live.mcap", delay, loss, seed=seed)
    made.run(2.0)
    drive(made, 16.0)
    made.run(6.0)
    made.finish()
    with open_recording(tmp_path / "live.mcap") as recording:
        value = summary(recording)
        expected = own_figures(made, recording)
        track = recording.track(REAL)
        assert np.diff(track.t).min() > 0.0
        # Every sample is the robot's own, at its own time.
        rows = {round(row[0], 6): row for row in made.log}
        for t, play, q in zip(track.t, track.play, track.q, strict=True):
            row = rows[round(t, 6)]
            assert play == pytest.approx(row[1], abs=1e-9)
            assert np.array_equal(q, row[2:8])
    for name, found in recorded_figures(value).items():
        assert found == pytest.approx(expected[name], rel=0.1, abs=1e-5), name
    # What was on its way when the recording ended isn't in it.
    assert not (track.gaps[:, 0] < made.now - 3.0).any()
    assert value["gap_s"] == pytest.approx(np.diff(track.gaps, axis=1).sum(), abs=1e-6)


def test_what_was_measured_in_an_outage_comes_afterwards(tmp_path):
    made = Driven(tmp_path / "live.mcap", "constant:0.05")
    made.run(1.0)
    made.tell(MotionCommand(JointTarget(HOME + 0.4), speed=0.1))
    made.run(0.5)
    made.cut = True
    made.run(30.0)
    made.cut = False
    made.run(6.0)
    made.finish()
    with open_recording(tmp_path / "live.mcap") as recording:
        track = recording.track(REAL)
        assert np.diff(track.t).max() < 0.1
        assert recording.span[1] == pytest.approx(made.now, abs=0.1)
        # A look back finds the arm everywhere.
        assert np.isfinite(recording.real(np.linspace(1.0, made.now - 0.5, 500))).all()
        assert summary(recording)["gap_s"] == 0.0


def test_a_gap_is_told_and_nothing_in_it_is_scored(tmp_path):
    made = Driven(tmp_path / "live.mcap", "constant:0.05")
    made.run(1.0)
    made.operator.listener.measured, heard = lambda samples, *, now: None, made.operator.listener.measured
    made.run(0.5)
    made.operator.listener.measured = heard
    made.tell(MotionCommand(JointTarget(HOME + 0.3), speed=0.6))
    made.run(0.4)
    # The first half of the move is bent, the gap hides where it bends.
    made.operator.listener.measured = lambda samples, *, now: None
    made.tell(MotionCommand(JointTarget(HOME), speed=0.6, insertion=Insertion.SPLICE))
    made.run(1.5)
    made.operator.listener.measured = heard
    drive(made, 4.0)
    made.run(3.0)
    made.finish()
    with open_recording(tmp_path / "live.mcap") as recording:
        track = recording.track(REAL)
        gaps = np.diff(track.t)[np.diff(track.t) > 0.1]
        assert len(gaps) == 2
        value, found = summary(recording), figures(recording)
        assert value["gap_s"] == pytest.approx(gaps.sum(), abs=1e-6)
        assert not found.run.measured.all()
        assert np.isnan(recording.real(track.t[np.argmax(np.diff(track.t))] + 0.5)).all()
        expected = own_figures(made, recording)
        # A straight line over the gap was off by centimetres.
        assert value["errors"]["timeline_time"]["tool_max_m"] <= 1.1 * expected["tool"][1]
        assert value["path"]["path_error_max"] <= 1.1 * expected["path"][1] + 1e-5
        assert value["errors"]["timeline_time"]["joint_max_deg"] <= list(1.1 * expected["joint_max"] + 1e-5)
        assert any("samples of the real robot for 2.0 s" in line for line in value["missing"])
        first = next(iter(rich_tables(value)))
        assert str(first.caption).startswith(
            "What happened while the real robot wasn't measured is in no figure. (2.0"
        )
        assert "<li><span>not measured</span>2.0 s</li>" in render(found.run, value)


def test_a_robot_that_reports_seldom_is_measured_all_the_same(tmp_path):
    made = Driven(tmp_path / "live.mcap", "constant:0.05", "0.2", beat=1.0)
    made.run(1.0)
    drive(made, 6.0)
    made.run(12.0)
    made.finish()
    with open_recording(tmp_path / "live.mcap") as recording:
        assert summary(recording)["gap_s"] < 3.0
        track = recording.track(REAL)
        assert np.diff(track.t[track.t < 10.0]).max() < 0.1


def test_samples_that_are_all_apart_are_no_measurement(tmp_path):
    made = Driven(tmp_path / "live.mcap", "constant:0.05")
    heard = made.operator.listener.measured
    for _ in range(20):
        made.operator.listener.measured = lambda samples, *, now: heard(samples[:1], now=now)
        made.run(0.034)
        made.operator.listener.measured = lambda samples, *, now: None
        made.run(0.2)
    made.finish()
    with open_recording(tmp_path / "live.mcap") as recording, pytest.raises(FormatError, match="no two samples"):
        summary(recording)


def test_a_recording_of_before_samples_were_numbered_has_its_figures():
    here = Path(__file__).parent
    with open_recording(here / "before.mcap") as recording:
        value = summary(recording)
        assert np.isfinite(recording.real(np.linspace(0.1, 2.5, 100))).all()
    assert value["gap_s"] == 0.0
    for name, expected in json.loads((here / "before.json").read_text(encoding="utf-8")).items():
        assert value[name] == approx(expected), name


def approx(expected):
    """The same, but for the last digits of numbers."""
    if isinstance(expected, dict):
        return {name: approx(one) for name, one in expected.items()}
    if isinstance(expected, list):
        return [approx(one) for one in expected]
    return pytest.approx(expected, rel=1e-5, abs=1e-8) if isinstance(expected, float) else expected
