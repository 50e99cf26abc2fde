"""Both sites of a mobile robot in virtual time, recorded as a live site is, beside the robot's own log."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from interfaces.cli.main import exit_status
from interfaces.link import Conditions, LinkConditions, delay_profile, loss_model
from interfaces.messages.jobs import RobotTask
from interfaces.messages.recording import Placement
from interfaces.messages.sites import DriveReport
from interfaces.recording import Recording, open_recording
from interfaces.recording.figures import summary
from interfaces.recording.live import LiveRecorder, LiveRecording
from interfaces.recording.playback import Playback
from interfaces.recording.rerun import rerun
from interfaces.recording.track import ESTIMATED, MEASURED, REAL_POSTURE, VIRTUAL_POSTURE
from robots.mobile.robot import place
from robots.onboard.journey import Goal
from robots.rooms import Person, Room
from tests.interfaces.teleop.rig import CONTROL, TURN, Rig
from vrs.comparison import match_paths, summed_up

BEFORE = 4.0
"""When the robot has been met and the first drive has begun [s]."""


class Driven(Rig):
    """A rig with a recorder; where the body takes itself to be is logged each control period."""

    def __init__(
        self, path: Path, delay: str = "constant:0.1", loss: str = "0", *, room: Room | None = None
    ) -> None:
        super().__init__(delay, hold=True)
        way = LinkConditions.symmetric(Conditions(delay=delay_profile(delay), loss=loss_model(loss)))
        self.line.change(way, now=0.0)
        self.log: list[tuple[float, ...]] = []
        self.shown: list[tuple[float, ...]] = []
        self.path, self.room = path, room
        self.recorder: LiveRecorder | None = None

    def record(self) -> None:
        """Record from now on."""
        what = LiveRecording(self.path, "adaptive", "hold", room=self.room, architecture="timeline")
        self.recorder = LiveRecorder(what, self.line, seed=1, began=5e8, now=self.now)
        self.recorder.open()

    def go(self, seconds: float, v: float | None = None, w: float = 0.0) -> None:
        """Drive so for a while; without a wish, wait."""

        def each(now: float) -> None:
            if v is not None:
                assert self.operator.robot.wish(v, w, issued_at=now, now=now) == ""
            if self.recorder is not None and self.k % round(0.1 / TURN) == 0:
                self.recorder.advance(now=now, connected=True)
            if self.k % CONTROL == 0:
                self.log.append((now, *self.position.posture()))
                self.shown.append((now, *self.operator.robot.virtual(now)))

        self.run(seconds, each)

    def drive(self) -> None:
        """Two drives, each of which begins where the robot stands."""
        for turn in (0.4, -0.5):
            assert self.operator.resume(now=self.now) == ""
            self.go(1.0)
            for k in range(4):
                self.go(2.0, 0.3, turn if k % 2 else -turn)
            self.go(1.0, 0.0)
            self.operator.robot.stop(now=self.now)
            self.go(4.0)

    def finish(self) -> None:
        assert self.recorder is not None
        self.recorder.finish(now=self.now)


def own_figures(made: Driven, recording: Recording) -> dict[str, float]:
    """Of the robot's own log, and of what the virtual one showed."""
    until = recording.track(REAL_POSTURE).t[-1]
    log, shown = np.array(made.log), np.array(made.shown)
    kept = (log[:, 0] > recording.drives[1].start) & (log[:, 0] <= until)
    found = summed_up(match_paths(log[kept, 0], shown[kept, 1:3], log[kept, 1:3]))
    return {name: getattr(found, name) for name in ("path_error_mean", "path_error_max", "time_difference_mean")}


@pytest.mark.parametrize(("delay", "loss"), [("constant:0.1", "0"), ("mon", "0"), ("constant:0.2", "0.1")])
def test_a_live_recording_says_what_the_robots_own_log_says(tmp_path: Path, delay: str, loss: str) -> None:
    made = Driven(tmp_path / "live.mcap", delay, loss)
    made.record()
    made.go(BEFORE)
    made.drive()
    made.finish()
    with open_recording(made.path) as recording:
        value, expected = summary(recording), own_figures(made, recording)
        for name, own in expected.items():
            assert value[name] == pytest.approx(own, rel=0.1, abs=1e-3), name
        assert (value["architecture"], value["robot"], value["operator"]) == ("timeline", "ipr", "live")
        assert (value["limits_passed"], value["path_error_max"] < 0.01) == (0, True)
        if loss == "0" and delay.startswith("constant"):
            # Every sample is the robot's own, at its own time.
            rows = {round(row[0], 4): row[1:] for row in made.log}
            track = recording.track(REAL_POSTURE)
            for t, q in zip(track.t.tolist(), track.q, strict=True):
                assert q == pytest.approx(rows[round(t, 4)], abs=1e-9)
            assert value.get("missing") is None


def test_two_drives_are_one_session(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = Driven(tmp_path / "live.mcap", "constant:0.15")
    made.record()
    made.go(BEFORE)
    made.drive()
    made.finish()
    shown = np.array(made.shown)
    with open_recording(made.path) as recording:
        # Met, and two drives: the virtual robot was put where the real one stood.
        placed = [entry for entry in recording.commands if isinstance(entry, Placement)]
        assert len(placed) == len(recording.drives) - 1 == 3
        assert [entry.number for entry in recording.commands] == list(range(1, len(recording.commands) + 1))
        ids = [receipt.command_id for receipt in recording.receipts("virtual")]
        assert ids == list(range(1, len(recording.commands) - len(placed) + 1))
        again = rerun(recording)
        assert (again.identical, again.missing) == (True, "")
        assert [len(drive) for drive in again.drives] == [len(drive) for drive in recording.drives]
        # As the site showed it, but for the turn in which a drive began.
        begun = np.array([entry.at for entry in placed])
        far = (np.abs(shown[:, :1] - begun) > 1e-6).all(axis=1)
        found = recording.virtual(shown[far, 0])
        np.testing.assert_allclose(found, shown[far, 1:], atol=1e-9)
        track = recording.track(VIRTUAL_POSTURE)
        known = (np.abs(track.t[:, None] - begun) > 0.1).all(axis=1)
        np.testing.assert_allclose(track.q[known], recording.virtual(track.t[known]), atol=1e-9)
        for topic in (MEASURED, ESTIMATED):
            assert len(recording.track(topic).t) > 100
        kinds = [event.kind for event in recording.events]
        assert {"up", "followed"} <= set(kinds)
        assert {entry.direction for entry in recording.link} == {"forward", "backward"}
        assert not recording.damage
        playback = Playback([recording])
        playback.read_marks()
        for t in np.linspace(*playback.span, 50).tolist():
            (frame,) = playback.moment(t).frames
            assert frame.error is None or frame.error < 0.01 or t < BEFORE
        assert sum("put where the real one stands" in mark.text for mark in playback.tracks[0].marks.marks) == 3
    assert (
        exit_status(["export", str(made.path), "--csv", str(tmp_path), "--report", str(tmp_path / "r.html")]) == 0
    )
    with open(tmp_path / "segments.csv", newline="") as file:
        starts = [float(row["start_s"]) for row in csv.DictReader(file)]
    assert starts == sorted(starts)
    assert starts[-1] > begun[-1]
    with open(tmp_path / "commands.csv", newline="") as file:
        assert [row["command"] for row in csv.DictReader(file)].count("placed") == 3
    capsys.readouterr()
    assert exit_status(["replay", str(made.path), "--headless", "--at", "12", "--json"]) == 0
    frame = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert len(frame["q_virtual"]) == len(frame["q_real"]) == 3


def test_a_recording_begins_in_the_middle_of_a_drive(tmp_path: Path) -> None:
    made = Driven(tmp_path / "live.mcap")
    made.go(BEFORE)
    assert made.operator.resume(now=made.now) == ""
    made.go(1.0)
    made.go(1.03, 0.3, 0.3)
    made.record()
    made.go(2.0, 0.3, 0.3)
    made.go(1.0, 0.0)
    made.operator.robot.stop(now=made.now)
    made.go(3.0)
    assert made.operator.resume(now=made.now) == ""
    made.go(1.0, 0.2)
    made.finish()
    with open_recording(made.path) as recording:
        again = rerun(recording)
        assert (again.identical, again.missing) == (True, "")
        assert again.commands > 30
        shown = np.array([row for row in made.shown if row[0] > recording.session.t])
        far = np.abs(shown[:, 0] - recording.drives[-1].start) > 1e-6
        np.testing.assert_allclose(recording.virtual(shown[far, 0]), shown[far, 1:], atol=1e-9)
        value = summary(recording)
        # The real robot was still where the virtual one had been before.
        assert (value["path_error_max"] < 0.2, value["path_error_mean"] < 0.02, value["limits_passed"]) == (
            True,
            True,
            0,
        )


def test_of_a_robot_that_drives_by_itself_the_virtual_one_is_with_it(tmp_path: Path) -> None:
    made = Driven(tmp_path / "live.mcap")
    made.record()
    made.go(BEFORE)
    assert made.operator.resume(now=made.now) == ""
    made.go(1.0)
    x, y, _ = made.truth
    assert made.operator.robot.order(RobotTask(go=Goal(x + 1.0, y + 0.5))) == ""
    made.go(8.0)
    made.finish()
    with open_recording(made.path) as recording:
        assert rerun(recording).identical
        t = np.linspace(BEFORE + 2.0, recording.span[1], 100)
        apart = np.linalg.norm((recording.virtual(t) - recording.real(t))[:, :2], axis=1)
        assert np.nanmax(apart) < 0.25
        assert np.ptp(recording.virtual(t)[:, 0]) > 0.8


def test_what_walks_in_a_room_walks_by_the_sessions_clock(tmp_path: Path) -> None:
    ada = Person("Ada", 0.3, 1.7, (100.0, 110.0), (1.0, 2.0), (0.5, 0.5))
    made = Driven(tmp_path / "live.mcap", room=replace(place("furnished"), people=(ada,)))
    receive = made.line.receive

    def heard(message, *, now):
        """In its room the robot's time is another one."""
        if isinstance(message, DriveReport):
            message = replace(message, world=message.measured_at + 100.0)
        receive(message, now=now)

    made.line.receive = heard
    made.record()
    made.go(BEFORE)
    made.finish()
    with open_recording(made.path) as recording:
        assert recording.room is not None
        (walks,) = recording.room.people
        assert walks.times == pytest.approx((0.0, 10.0), abs=0.05)
        assert recording.room.name == place("furnished").name
