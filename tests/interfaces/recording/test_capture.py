"""What's written while something runs: in step with it, whole, and without disturbing it."""

from __future__ import annotations

import errno
import shutil
from pathlib import Path

import numpy as np
import pytest

from interfaces.link import delay_profile
from interfaces.messages.recording import HistoryEntry, RunEvent
from interfaces.recording.capture import Paced
from interfaces.recording.figures import summary
from interfaces.recording.mcap_file import Sink
from interfaces.recording.recording import open_recording
from interfaces.recording.rerun import rerun
from interfaces.recording.run_recorders import RunRecorder
from interfaces.recording.track import REAL, VIRTUAL
from interfaces.runs.summary import summarize, to_json
from interfaces.runs.twin_run import Turn
from interfaces.runtime.plan import parse_plan
from interfaces.runtime.session import run_twins
from interfaces.teleop import OperatorSite, VirtualArm
from interfaces.teleop.operator import Halt, HaltCause
from robots.robot import exact_arm
from tests.interfaces.recording import recorded, shown
from tests.interfaces.recording.taken import MODEL, NOMINAL, PLAN, ROBOT, Sitting, taken
from vrs import JointTarget, MotionCommand, Status
from vrs.commands import ParameterChange, PositionQuery, Retime, ScaleTime
from vrs.errors import UnknownCommandError


class Heard:
    """A listener that remembers."""

    def __init__(self, site):
        self.deeds, self.corrections, self.answers, self.reports = [], [], [], []
        site.listener = self

    def commanded(self, deed):
        self.deeds.append(deed)

    def corrected(self, correction, truth):
        self.corrections.append((correction, truth))

    def answered(self, command_id, receipt, *, now):
        self.answers.append((command_id, receipt, now))

    def reported(self, report, *, now):
        self.reports.append((report, now))

    def measured(self, samples, *, now):
        pass


def test_a_site_tells_every_command_once_with_the_time_and_the_receipt():
    site = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
    heard = Heard(site)
    move = MotionCommand(JointTarget(NOMINAL + 0.1))
    far = MotionCommand(JointTarget(NOMINAL + 99.0))
    limits = ParameterChange("lateness", "reject")
    taken_ = site.robot.execute(move, now=0.125)
    rejected = site.robot.execute(far, now=0.25)
    site.robot.execute(limits, now=0.25)
    undone = site.robot.undo(now=0.3)
    assert [(d.at, d.command, d.receipt, d.refused) for d in heard.deeds] == [
        (0.125, move, taken_, False), (0.25, far, rejected, False), (0.25, limits, None, False),
        (0.3, None, undone, False),
    ]  # fmt: skip
    assert rejected.status is Status.REJECTED
    site.robot.execute(PositionQuery(0.0), now=0.4)
    with pytest.raises(UnknownCommandError):
        site.robot.execute(Retime(77, 1.0), now=0.4)
    assert len(heard.deeds) == 4
    site.halted = Halt(HaltCause.REPORTED, "it stands in the way")
    refused = site.robot.execute(move, now=0.5)
    assert site.robot.undo(now=0.5) is None
    assert [(d.at, d.command, d.receipt, d.refused) for d in heard.deeds[4:]] == [(0.5, move, refused, True)]
    assert "it stands in the way" in refused.reason


def test_a_site_tells_corrections_answers_and_reports(tmp_path):
    made = Sitting(tmp_path / "run.mcap", 0)
    heard = Heard(made.site)
    made.tell(MotionCommand(JointTarget(NOMINAL + 0.2)))
    made.clock = 0.2
    made.report()
    ((correction, truth),) = heard.corrections
    assert correction is made.site.robot.corrections[0]
    assert made.site.robot.engine.timeline.sample(correction.end + 0.1) == pytest.approx(
        truth.sample(correction.end + 0.1), abs=1e-9
    )
    assert [now for _, now in heard.reports] == [0.2]
    made.writer.abandon()


def test_a_run_is_in_the_file_while_it_goes_on(tmp_path):
    path, known = tmp_path / "run.mcap", []

    def look(t):
        copy = shutil.copy(path, tmp_path / "copy.mcap")
        with open_recording(copy) as recording:
            assert recording.end is None
            known.append((t, recording.span[1], len(recording.commands), recording.edits[-1].timeline))

    run = taken(path, progress=look)
    assert len(known) > 10
    assert all(t - 0.5 <= until <= t for t, until, _, _ in known[1:])
    assert [commands for t, _, commands, _ in known if 1.0 < t <= 1.5] == [3]
    assert known[-1][2] == len(run.receipts_virtual)
    with open_recording(path) as recording:
        assert recording.end is not None
        assert not recording.damage


def test_names_of_files_that_are_long_or_no_utf_8_can_be_read_back(tmp_path):
    deep = tmp_path.joinpath(*["d" * 60] * 4)
    deep.mkdir(parents=True)
    (deep / "caf\udce9.csv").write_text("delay_s\n0.1\n")
    plan = parse_plan(b'{"issue": 0.1, "move": {"pose": "ready"}}', "caf\udce9.jsonl", MODEL)
    run = taken(tmp_path / "run.mcap", f"trace:{deep}/caf\udce9.csv", plan=plan)
    assert (run.session.title, run.session.delay) == ("caf?", f"trace:{deep}/caf?.csv")
    with open_recording(tmp_path / "run.mcap") as recording:
        assert (recording.session.title, recording.session.delay) == (run.session.title, run.session.delay)
        assert to_json(summary(recording)) == to_json(summarize(run))


def test_texts_of_any_length_can_be_read_back(tmp_path):
    recorder, site = RunRecorder(tmp_path / "run.mcap"), OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
    recorder.begin(recorded.begin(title="a", step=0.02, q=NOMINAL.tolist()), site)
    recorder.turn(
        Turn(
            0.0, 0, *(np.empty((0, *n)) for n in ((), (6,), (6,))), (), (), (RunEvent(0.0, "late", "x" * 3000),), ()
        )
    )
    recorder.finish()
    with open_recording(tmp_path / "run.mcap") as recording:
        assert [event.text for event in recording.events] == ["x" * 2000]


def test_samples_of_both_robots_are_the_runs_rows(tmp_path):
    run = taken(tmp_path / "run.mcap", "mon")
    with open_recording(tmp_path / "run.mcap") as recording:
        real, virtual = recording.track(REAL), recording.track(VIRTUAL)
        rows = len(run.t)
        for name, rowed in (("q", run.q_real), ("reference", run.q_reference), ("play", run.play), ("t", run.t)):
            assert (getattr(real, name)[:rows] == rowed).all()
        assert (virtual.t[:rows] == run.t).all()
        assert np.abs(virtual.q[:rows] - run.q_shown).max() < 1e-12
        # The number of the newest edit stands beside each.
        for edit in recording.edits[1:]:
            assert (virtual.edit[virtual.t < edit.at] < edit.number).all()
            assert (virtual.edit[virtual.t >= edit.at] >= edit.number).all()


def test_both_robots_are_shown_where_their_joints_put_them(tmp_path):
    taken(tmp_path / "run.mcap", "mon")
    with open_recording(tmp_path / "run.mcap") as recording:
        shown.check(tmp_path / "run.mcap", recording, least=10)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
@pytest.mark.parametrize("full", ["/dev/full", "{tmp}/no/such/folder/run.mcap"])
def test_a_disk_that_takes_nothing_ends_the_recording_and_not_the_run(tmp_path, full):
    recorder = RunRecorder(Path(full.format(tmp=tmp_path)))
    run = run_twins(PLAN, ROBOT, delay_profile("thu"), exact_arm, seed=0, keeper=recorder)
    recorder.finish()
    assert recorder.problem.startswith("recording failed: ")
    assert to_json(summarize(run)) == to_json(summarize(taken(tmp_path / "run.mcap")))


class Small:
    """A disk that's soon full, and says so once more when the file is closed."""

    def __init__(self, path):
        self.file, self.room = path.open("wb", buffering=0), 30_000

    def write(self, data):
        some = bytes(data)[: min(self.room, 1000)]
        self.room -= len(some)
        return self.file.write(some)

    def close(self):
        self.file.close()
        raise OSError(errno.ENOSPC, "full")


@pytest.fixture
def small(monkeypatch):
    monkeypatch.setattr(Sink, "create", classmethod(lambda cls, path: cls(Small(path), str(path))))


@pytest.mark.usefixtures("small")
def test_a_disk_that_fills_up_leaves_what_it_took(tmp_path):
    recorder = RunRecorder(tmp_path / "run.mcap")
    run = run_twins(PLAN, ROBOT, delay_profile("thu"), exact_arm, seed=0, keeper=recorder)
    recorder.finish()
    assert "takes no more after 30000 bytes" in recorder.problem
    with open_recording(tmp_path / "run.mcap") as recording:
        assert recording.damage.cut
        track = recording.track(REAL)
        assert 10 < len(track.t) < len(run.t)
        assert (track.q == run.q_real[: len(track.t)]).all()


@pytest.mark.usefixtures("small")
def test_a_disk_that_fills_up_amid_commands_stops_no_command(tmp_path):
    recorder, site = RunRecorder(tmp_path / "run.mcap"), OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
    recorder.begin(recorded.begin(title="many", step=0.02, q=NOMINAL.tolist()), site)
    for k in range(1100):
        site.robot.execute(MotionCommand(JointTarget(NOMINAL), execute_at=10.0 + 0.5 * k), now=0.001 * k)
    assert "takes no more after 30000 bytes" in recorder.problem


def test_what_moves_is_shown_at_a_rate_and_what_stands_once_a_second():
    shown = Paced(10.0)
    t = np.arange(0.0, 4.0, 0.02)
    q = np.where(t[:, None] < 2.0, 0.1 * t[:, None], 0.2) * np.ones(6)
    rows = shown.chosen(t[:50], q[:50])
    rows += [50 + row for row in shown.chosen(t[50:], q[50:])]
    times = t[rows]
    assert times[times < 2.0] == pytest.approx(np.arange(0.0, 2.0, 0.1))
    assert np.diff(times[times > 2.05]) == pytest.approx(1.0)
    assert len(times[times > 2.05]) == 1 or np.diff(times).max() <= 1.0 + 1e-9


def test_what_comes_late_is_shown_where_nothing_beside_it_was():
    shown = Paced(10.0)
    t = np.arange(0.0, 4.0, 0.02)
    q = t[:, None] * np.ones(6)
    late = (t > 1.0) & (t < 2.0)
    times = t[~late][shown.chosen(t[~late], q[~late])]
    assert not ((times > 1.05) & (times < 2.0)).any()
    found = t[late][shown.chosen(t[late], q[late])]
    assert found == pytest.approx(np.arange(1.1, 1.95, 0.1), abs=0.021)
    assert shown.chosen(t[late], q[late]) == []


def test_an_edit_of_very_many_segments_is_written_as_the_whole_timeline(tmp_path, monkeypatch):
    monkeypatch.setattr("interfaces.recording.history.MOST_CHANGED", 20)
    monkeypatch.setattr("interfaces.recording.history.PART", 16)
    made = Sitting(tmp_path / "run.mcap", 1)
    for k in range(10):
        made.tell(MotionCommand(JointTarget(NOMINAL + 0.1 * (k % 3)), execute_at=1.0 + k))
    made.tell(ScaleTime(0.5, execute_at=0.5))
    made.tell(MotionCommand(JointTarget(NOMINAL)))
    made.end()
    with open_recording(tmp_path / "run.mcap") as recording:
        assert len([c for c in recording.changes if isinstance(c, HistoryEntry) and c.edit == 11]) > 1
        assert recording.edits[11].timeline == made.timelines[11]
        assert recording.timeline == made.site.robot.engine.timeline
        again = rerun(recording)
        assert (again.identical, again.missing, again.versions) == (True, "", 12)


def test_many_commands_between_two_turns_are_all_written(tmp_path):
    made = Sitting(tmp_path / "run.mcap", 1)
    for k in range(1100):
        made.clock = 0.001 * k
        made.tell(MotionCommand(JointTarget(NOMINAL + 0.01 * (k % 7)), execute_at=10.0 + 0.5 * k))
    made.end()
    with open_recording(tmp_path / "run.mcap") as recording:
        assert [entry.number for entry in recording.commands] == list(range(1, 1101))
        assert len(recording.edits) == 1101
        assert recording.timeline == made.site.robot.engine.timeline


def test_what_later_commands_made_of_receipts_is_in_a_cut_file_too(tmp_path):
    made = Sitting(tmp_path / "run.mcap", 1)
    for k in range(70):
        made.clock = 0.01 * k
        made.tell(MotionCommand(JointTarget(NOMINAL + 0.05 * (k % 3)), execute_at=10.0 + 2.0 * k))
        made.capture.sample(now=made.clock)
    made.tell(MotionCommand(JointTarget(NOMINAL), execute_at=140.0))
    made.capture.sample(now=made.clock)
    made.capture.write_out()
    made.writer.flush()
    made.writer.abandon()
    receipts = made.site.robot.engine.receipts
    assert receipts[65].superseded_by == 71
    with open_recording(tmp_path / "run.mcap") as recording:
        told, known = (
            [(r.command_id, r.status, r.execute_at, r.end, r.shift, r.superseded_by) for r in found]
            for found in (recording.receipts("virtual"), receipts)
        )
        assert told == known
