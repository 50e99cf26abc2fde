"""What stands in a mobile robot's recording, read by the public reader and by ours."""

from __future__ import annotations

import errno
import json
import math
from collections import defaultdict
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from mcap.reader import make_reader

from interfaces.lab.driving.run import run
from interfaces.messages.recording import room_entry, room_of
from interfaces.recording import Damage, open_recording
from interfaces.recording.channels import CHANNELS
from interfaces.recording.mcap_file import Sink
from interfaces.recording.rerun import rerun
from interfaces.recording.run_recorders import DriveRecorder
from interfaces.recording.track import ESTIMATED, MEASURED, REAL_POSTURE, VIRTUAL_POSTURE
from interfaces.runs.drive_run import DriveCase
from robots.mobile.robot import PLACES, place
from tests.interfaces.recording.disks import Failing
from tests.interfaces.recording.driving.runs import SLALOM, WANDER, recorded
from vrs.errors import FormatError

BOTH = pytest.mark.parametrize("case", [SLALOM, WANDER], ids=lambda case: case.operator)


@BOTH
def test_the_public_reader_finds_messages_that_keep_to_the_schemas(case: DriveCase) -> None:
    drive, path = recorded(case)
    found = defaultdict(list)
    times = []
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            assert schema is not None
            value = json.loads(message.data)
            if len(found[channel.topic]) < 100:
                jsonschema.Draft202012Validator(json.loads(schema.data)).validate(value)
            found[channel.topic].append(value)
            times.append(message.log_time)
    usual = {channel.topic for channel in CHANNELS if channel.mobile} - {"/environment", "/events"}
    assert usual <= found.keys() <= {channel.topic for channel in CHANNELS if channel.mobile}
    assert times == sorted(times)
    assert len(found["/real/posture"]) == len(drive.t)
    rows = zip(drive.t, drive.virtual, drive.real, strict=True)
    near = {round(t, 9): (virtual, real) for t, virtual, real in rows}
    for topic, which in (("/virtual/pose", 0), ("/real/pose", 1)):
        assert len(found[topic]) > 10
        for value in found[topic]:
            stamp, pose = value["timestamp"], value["pose"]
            x, y, theta = near[round(stamp["sec"] + 1e-9 * stamp["nsec"], 9)][which]
            assert (pose["position"]["x"], pose["position"]["y"]) == pytest.approx((x, y), abs=1e-8)
            turn = 2 * math.atan2(pose["orientation"]["z"], pose["orientation"]["w"])
            assert math.remainder(turn - theta, math.tau) == pytest.approx(0.0, abs=1e-8)
    for value in found["/tf"]:
        assert [one["child_frame_id"] for one in value["transforms"]] == ["virtual", "real"]


@BOTH
def test_everything_comes_back_to_the_last_bit(case: DriveCase) -> None:
    drive, path = recorded(case)
    with open_recording(path) as recording:
        assert recording.damage == Damage(until=drive.t[-1])
        assert recording.virtual(drive.t).tobytes() == drive.virtual.tobytes()
        assert recording.real(drive.t).tobytes() == drive.real.tobytes()
        real = recording.track(REAL_POSTURE)
        assert real.reference.tobytes() == drive.drives.tobytes()
        assert np.array_equal(real.play, drive.t - drive.offset, equal_nan=True)
        assert recording.track(VIRTUAL_POSTURE).q.tobytes() == drive.virtual.tobytes()
        assert recording.track(MEASURED).q.tobytes() == drive.measured.tobytes()
        assert recording.track(ESTIMATED).q.tobytes() == drive.estimated.tobytes()
        assert sum(entry.size for entry in recording.link if entry.direction == "forward") == drive.sent_bytes
        assert sum(entry.size for entry in recording.link if entry.direction == "backward") == drive.reported_bytes
        cells: set[tuple[int, int]] = set()
        known = dict(drive.learned)
        for entry in recording.learned:
            cells |= set(zip(entry.added[::2], entry.added[1::2], strict=True))
            cells -= set(zip(entry.gone[::2], entry.gone[1::2], strict=True))
            assert cells == set(known[entry.t])
        assert cells == (set(drive.learned[-1][1]) if drive.learned else set())
        assert bool(recording.learned) == (case is WANDER)


@BOTH
def test_the_commands_make_the_same_timelines_again(case: DriveCase) -> None:
    _, path = recorded(case)
    with open_recording(path) as recording:
        again = rerun(recording)
        assert (again.identical, again.missing, again.difference) == (True, "", "")
        assert again.commands == again.versions == round(case.length / 0.1)
        assert again.timeline == recording.timeline
        halfway = recording.timeline_at(3.0)
        assert halfway.end == pytest.approx(3.1)
        t = np.linspace(0.0, 3.0, 50)
        assert halfway.sample(t).tobytes() == recording.timeline.sample(t).tobytes()


def test_recording_changes_nothing_of_a_run() -> None:
    drive, _ = recorded(WANDER)
    alone = run(WANDER)
    for name in ("t", "virtual", "real", "measured", "drives", "estimated", "delays"):
        assert np.array_equal(getattr(drive, name), getattr(alone, name))
    assert (drive.learned, drive.sent_bytes) == (alone.learned, alone.sent_bytes)


def test_a_disk_that_fills_up_is_a_problem_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Full(Failing):
        def close(self) -> None:
            super().close()
            raise OSError(errno.ENOSPC, "full")

    disk, recorder = Full(4, how="full"), DriveRecorder(tmp_path / "run.mcap")
    drive = run(DriveCase("timeline", robot="bare", length=1.0), witness=recorder)
    monkeypatch.setattr(Sink, "create", classmethod(lambda cls, path: cls(disk, str(path))))
    recorder.finish(drive)
    assert disk.closed
    assert recorder.problem == f"recording failed: {recorder.path}: No space left on device"


def test_packets_on_their_way_at_the_end_are_told_from_lost_ones(tmp_path: Path) -> None:
    trace = tmp_path / ("d" * 200) / "caf\udce9.csv"
    trace.parent.mkdir()
    trace.write_text("delay_s\n" + '0.1\n""\n0.2\n5\n' * 500, encoding="utf-8")
    case = DriveCase("timeline", delay=f"trace:{trace}", robot="bare", length=4.0)
    recorder = DriveRecorder(tmp_path / "run.mcap")
    drive = run(case, witness=recorder)
    recorder.finish(drive)
    with open_recording(recorder.path) as recording:
        assert recording.session.delay == f"trace:{trace.parent}/caf?.csv"
        forward = [entry for entry in recording.link if entry.direction == "forward"]
        assert sum(entry.size for entry in forward) == drive.sent_bytes
        lost = {round(entry.sent, 6) for entry in forward if entry.lost}
        waiting = {round(entry.sent, 6) for entry in forward if not entry.lost and entry.arrived is None}
        assert len(lost) > 5
        assert waiting
        assert min(waiting) > drive.t[-1] - 5.1
        assert not lost & waiting


@pytest.mark.parametrize("name", PLACES)
def test_rooms_come_back(name: str) -> None:
    room = place(name)
    assert room_of(room_entry(room), "here") == room.__class__(
        room.name, room.length, room.width, blocks=room.blocks, columns=room.columns, people=room.people,
        doors=room.doors,
    )  # fmt: skip


def test_a_room_that_makes_no_sense_is_a_format_error() -> None:
    entry = room_entry(place("fig13_person"))
    person = entry.people[0]
    from msgspec.structs import replace

    for wrong in (
        replace(entry, people=(replace(person, times=person.times[::-1]),)),
        replace(entry, people=(replace(person, x=person.x[:1]),)),
        replace(entry, things=(replace(entry.things[0], width=None, radius=None),)),
    ):
        with pytest.raises(FormatError, match="here"):
            room_of(wrong, "here")
    home = room_entry(place("home"))
    with pytest.raises(FormatError, match="timetable"):
        room_of(replace(home, doors=(replace(home.doors[0], times=[1.0, 0.5], shares=[0.0, 1.0]),)), "here")


def test_a_disk_that_takes_nothing_is_a_problem_of_the_recording_alone(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    recorder = DriveRecorder(tmp_path / "file" / "run.mcap")
    drive = run(SLALOM, witness=recorder)
    recorder.finish(drive)
    assert "file" in recorder.problem
