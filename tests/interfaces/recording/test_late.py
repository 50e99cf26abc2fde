"""Recordings that begin in the middle of a session: they play, and their commands run again from there."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from interfaces.messages.recording import Begin
from interfaces.recording.capture import Capture, late_of
from interfaces.recording.figures import summary
from interfaces.recording.live import LiveRecording
from interfaces.recording.mcap_file import RecordingError
from interfaces.recording.playback import Align, Playback
from interfaces.recording.recording import open_recording
from interfaces.recording.rerun import rerun
from interfaces.recording.track import REAL
from interfaces.recording.writer import RecordingWriter
from interfaces.system import software
from tests.interfaces.live_rig import NOMINAL, READY, operator_here, robot_here, until
from tests.interfaces.recording.taken import MODEL, Sitting
from vrs import JointTarget, MotionCommand
from vrs.commands import Insertion, ParameterChange, Profile, Resume, Retime, SteerCommand, Stop
from vrs.errors import InvalidValueError


def begin_late(sitting, path, **given):
    """Record a sitting from now on."""
    now, engine = sitting.clock, sitting.site.robot.engine
    sitting.site.robot.clock.set(now)
    sitting.capture = capture = sitting.site.listener = Capture(
        sitting.site.robot.engine, now=now, step=0.02, every=True, **given
    )
    begin = Begin(
        t=now, robot="puma560", driver="live", title="late", seed=0, delay="none", offset="adaptive",
        service="datagram", link_loss="hold", step=0.02, q=engine.joints(now).tolist(),
        lateness=str(engine.parameters["lateness"]), software=software(), late=late_of(capture.late, 0.0),
    )  # fmt: skip
    sitting.writer = RecordingWriter(path, begin)
    capture.put = sitting.writer.write
    for message in capture.first():
        capture.add(now, message)
    sitting.timelines = [engine.timeline]


def sat(tmp_path, seed, before):
    made = Sitting(tmp_path / "whole.mcap", seed)
    made.go_on(before)
    made.end()
    return made


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("most_before", [3, 20_000])
def test_commands_run_again_from_the_middle(tmp_path, seed, most_before):
    made, path = sat(tmp_path, seed, (5, 20, 35)[seed]), tmp_path / "late.mcap"
    begin_late(made, path, most_before=most_before)
    made.go_on(25)
    made.end()
    with open_recording(path) as recording:
        again = rerun(recording)
        assert again.difference == ""
        if not again.missing:
            assert again.commands > 10
            assert again.timeline.end == made.site.robot.engine.timeline.end
        assert len(recording.edits) == len(made.timelines)
        assert len(recording.edits[0].timeline) <= max(most_before, 30) + 30 or most_before > 30
        for edit, timeline in zip(recording.edits, made.timelines, strict=True):
            t = np.linspace(recording.session.t, timeline.end + 1.0, 60)
            assert edit.timeline.sample(t) == pytest.approx(timeline.sample(t), abs=1e-11)


def test_a_move_that_is_rough_stays_so(tmp_path):
    made, path = Sitting(tmp_path / "whole.mcap", 0), tmp_path / "late.mcap"
    low = np.array([-2.0, 0.0, -2.0, 0.0, 0.0, 0.0])
    high = np.array([MODEL.limits.q_max[0], 0.0, -2.0, 0.0, 0.0, 0.0])
    made.tell(MotionCommand(JointTarget(low), execute_at=0.1))
    made.tell(MotionCommand(JointTarget(high), insertion=Insertion.APPEND))
    t = made.site.robot.engine.timeline.segments[-1].start - 1e-3
    made.tell(MotionCommand(JointTarget(low), execute_at=t, profile=Profile.JERK_LIMITED))
    assert made.site.robot.engine.receipts[-1].reason.startswith("braked with parabolas first")
    made.clock = t + 0.02
    made.end()
    begin_late(made, path)
    made.tell(Stop())
    assert made.site.robot.engine.receipts[-1].reason.startswith("each joint braked")
    made.end()
    with open_recording(path) as recording:
        again = rerun(recording)
        assert (again.difference, again.missing) == ("", "")
        assert again.receipts[-1].reason == made.site.robot.engine.receipts[-1].reason


def test_what_stays_behind_an_edit_is_counted_from_where_the_recording_begins(tmp_path):
    made, path = Sitting(tmp_path / "whole.mcap", 0), tmp_path / "late.mcap"
    for k in range(8):
        made.tell(MotionCommand(JointTarget(NOMINAL + 0.1 * (k % 3 + 1)), execute_at=1.0 + 2.0 * k))
    made.clock = 6.0
    made.end()
    begin_late(made, path, most_before=1)
    made.tell(MotionCommand(JointTarget(NOMINAL), execute_at=6.2, insertion=Insertion.SPLICE))
    made.end()
    with open_recording(path) as recording:
        change = next(entry for entry in recording.changes if entry.edit == 1)
        assert change.tail is not None
        assert recording.edits[1].timeline.end == made.timelines[1].end
        t = np.linspace(6.0, made.timelines[1].end, 200)
        assert recording.virtual(t) == pytest.approx(made.timelines[1].sample(t), abs=1e-11)


def told(tmp_path, commands, after):
    """What running again says, where some commands came before the recording and one comes after."""
    made, path = Sitting(tmp_path / "whole.mcap", 0), tmp_path / "late.mcap"
    for command in commands:
        made.tell(command)
        made.clock += 0.1
    made.end()
    begin_late(made, path)
    made.clock += 0.05
    made.tell(after)
    made.clock += 1.0
    made.end()
    with open_recording(path) as recording:
        again = rerun(recording)
        assert len(recording.edits) == len(made.timelines) > 1
        return again


MOVES = [MotionCommand(JointTarget(READY), speed=0.3), MotionCommand(JointTarget(NOMINAL), execute_at=9.0)]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (MOVES, Retime(2, 12.0)),
        (MOVES, Stop()),
        ([SteerCommand(rates=np.full(6, 0.1))], SteerCommand(rates=np.full(6, 0.2))),
        ([ParameterChange("qd_max", 0.3)], MotionCommand(JointTarget(READY))),
        ([ParameterChange("lateness", "reject")], MotionCommand(JointTarget(READY))),
    ],
)
def test_what_came_before_counts(tmp_path, before, after):
    again = told(tmp_path, before, after)
    assert (again.identical, again.missing, again.commands) == (True, "", 1)


def test_what_goes_back_to_before_is_missing_and_nothing_else(tmp_path):
    for commands, after in ((MOVES, None), ([*MOVES, Stop()], Resume())):
        again = told(tmp_path, commands, after)
        assert again.difference == ""
        assert "goes back to before the recording began" in again.missing


def test_recordings_are_shown_with_their_beginnings_together(tmp_path):
    made, paths = sat(tmp_path, 1, 5), (tmp_path / "a.mcap", tmp_path / "b.mcap")
    for path in paths:
        begin_late(made, path)
        made.go_on(10)
        made.end()
    with open_recording(paths[0]) as first, open_recording(paths[1]) as second:
        shown = Playback([first, second], align=Align.START)
        moment = shown.moment(first.session.t + 0.25)
        assert [frame.t for frame in moment.frames] == [first.session.t + 0.25, second.session.t + 0.25]


def test_a_live_site_is_recorded_on_the_fly(tmp_path):
    path, problems = tmp_path / "late.mcap", []
    what = LiveRecording(path, "adaptive", "hold", problems.append, over=False)

    async def main():
        async with robot_here() as (_, url), operator_here(url) as (live, _):
            site, clock = live.operator, live.clock
            await until(lambda: site.report is not None)
            await until(lambda: site.resume(now=clock.now()) == "")
            await until(lambda: site.report.epoch == site.epoch)
            first = site.robot.execute(MotionCommand(JointTarget(READY), speed=0.4), now=clock.now())
            await until(lambda: clock.now() > first.execute_at + 0.2)
            await live.recording.begin(what)
            with pytest.raises(InvalidValueError, match="once the other one has ended"):
                await live.recording.begin(replace(what, path=tmp_path / "other.mcap"))
            site.robot.execute(MotionCommand(JointTarget(NOMINAL)), now=clock.now())
            await until(lambda: clock.now() > site.robot.engine.timeline.end + 0.3)
            assert await live.recording.end() is None
            assert await live.recording.end() is None
            with pytest.raises(RecordingError, match="none is written over"):
                await live.recording.begin(what)
            # Another one, which the end of the server closes.
            await live.recording.begin(replace(what, path=tmp_path / "more.mcap"))
            await asyncio.sleep(0.3)
            return first, site.robot.engine.timeline

    first, timeline = asyncio.run(main())
    assert problems == []
    with open_recording(path) as recording:
        again = rerun(recording)
        assert (again.identical, again.missing, again.commands) == (True, "", 1)
        start, end = recording.span
        assert first.execute_at < start < end
        t = np.linspace(first.execute_at, end, 400)
        assert recording.virtual(t) == pytest.approx(timeline.sample(t), abs=1e-12)
        assert recording.track(REAL).t[0] >= start - 0.5
        value = summary(recording)
        assert value["commands"]["virtual"] == {"accepted": 2, "postponed": 0, "rejected": 0}
    with open_recording(tmp_path / "more.mcap") as recording:
        assert recording.end is not None
        assert not recording.damage
