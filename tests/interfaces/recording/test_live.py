"""A live site, recorded while it serves."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from interfaces import connect
from interfaces.cli.main import exit_status
from interfaces.link import Conditions, LinkConditions, TraceDelay, delay_profile
from interfaces.messages.control import DirectionConditions, Impair
from interfaces.messages.recording import HistoryEntry, ReceiptEntry, RunEvent
from interfaces.messages.sites import Report
from interfaces.recording import Recorder
from interfaces.recording.figures import figures, summary
from interfaces.recording.live import LiveRecorder, LiveRecording
from interfaces.recording.mcap_file import Sink
from interfaces.recording.recording import open_recording
from interfaces.recording.rerun import rerun
from interfaces.recording.track import REAL
from interfaces.runtime.live.operator import LiveOperator, LiveOperatorConfig
from interfaces.stream import sockets
from interfaces.stream.access import OPEN, Access, hosts
from interfaces.stream.server import application
from interfaces.teleop import OperatorSite, RobotLine, VirtualArm
from tests.interfaces.live_rig import MODEL, NOMINAL, READY, ROBOT, child, robot_here, until
from tests.interfaces.recording import shown
from tests.interfaces.recording.disks import Filling
from vrs import Insertion, JointTarget, MotionCommand, Status, SteerCommand


@contextlib.asynccontextmanager
async def recorded(url, path, told):
    """An operator's site in this loop that's recorded."""
    listening = sockets.bind("127.0.0.1", 0)
    link = LinkConditions.symmetric(Conditions(delay=delay_profile("constant:0.03")))
    recording = LiveRecording(path, "adaptive", "hold", told.append)
    config = LiveOperatorConfig(ROBOT, url, link, q=NOMINAL, recording=recording)
    operator = LiveOperator(config, Access(free=OPEN))
    app = application(operator.routes, hosts(["127.0.0.1"], listening.getsockname()[1]))
    async with sockets.serve(app, listening), operator.running():
        await until(lambda: operator.operator.report is not None)
        await until(lambda: operator.operator.resume(now=operator.clock.now()) == "")
        await until(lambda: operator.operator.report.epoch == operator.operator.epoch)
        yield operator


def test_what_a_live_site_did_is_in_its_recording(tmp_path):
    path, told, reports = tmp_path / "live.mcap", [], []

    async def main():
        async with robot_here() as (_, url), recorded(url, path, told) as live:
            virtual, clock = live.operator.robot, live.clock
            heard = live.operator.listener.reported
            live.operator.listener.reported = lambda r, *, now: (reports.append(r), heard(r, now=now))
            virtual.execute(MotionCommand(JointTarget(READY)), now=clock.now())
            await asyncio.sleep(0.3)
            virtual.execute(MotionCommand(JointTarget(READY + 9)), now=clock.now())
            virtual.execute(SteerCommand(rates=np.full(6, 0.1)), now=clock.now())
            await asyncio.sleep(0.1)
            virtual.execute(MotionCommand(JointTarget(NOMINAL), insertion=Insertion.APPEND), now=clock.now())
            virtual.undo(now=clock.now())
            await until(lambda: set(virtual.receipts) >= {1, 3, 4})
            live.emulation.impair(
                Impair(1, 1, DirectionConditions("constant:0.03", "0", "in-order")), "Ada", now=clock.now()
            )
            await until(lambda: len({report.measured_at for report in reports}) > 30)
            # What came last is waited for to be written.
            await asyncio.sleep(0.5)
            health = live.health()["recording"]
            assert (health["file"], health["dropped"], health["problem"]) == (str(path), 0, None)
            # The block that's open, a turn of the recorder's thread and one of the site's, on a busy machine.
            assert health["written_s"] > clock.now() - 1.5
            return virtual.engine.timeline, virtual.engine.receipts

    timeline, receipts = asyncio.run(main())
    assert told == []
    with open_recording(path) as recording:
        again = rerun(recording)
        assert (again.identical, again.missing) == (True, "")
        assert again.timeline == timeline
        assert [(r.command_id, r.status, r.end) for r in recording.receipts("virtual")] == [
            (r.command_id, r.status, r.end) for r in receipts
        ]
        assert {r.command_id for r in recording.receipts("real")} == {1, 3, 4}
        samples = recording.track(REAL)
        known = {report.measured_at: report for report in reports}
        assert len(set(samples.t.tolist()) & known.keys()) > 10
        for t, q, play in zip(samples.t.tolist(), samples.q, samples.play.tolist(), strict=True):
            if t in known:
                assert (q == known[t].q).all()
                assert play == known[t].q_at
        shown.check(path, recording, least=2)
        assert (recording.session.driver, recording.session.delay) == ("live", "constant:0.03")
        assert abs(recording.session.began - time.time()) < 60
        kinds = [event.kind for event in recording.events]
        assert {"up", "followed"} <= set(kinds)
        (rerouted,) = [event.text for event in recording.events if event.kind == "rerouted"]
        assert rerouted.startswith("Ada changed the way to the robot: delay constant:0.03, loss 0, in-order; back ")
        found, value = figures(recording), summary(recording)
        assert found.missing == []
        assert value["errors"]["servo"]["tool_max_m"] < 1e-9
        assert value["commands"]["virtual"] == {"accepted": 3, "postponed": 0, "rejected": 1}
        assert value["messages"]["delay_mean_s"] == 0.03
        # The exact body is where its reference is: what differs is what its reports don't show.
        if not value["corrections"]:
            assert value["errors"]["timeline_time"]["tool_max_m"] < 5e-3
        assert value["behind"]["mean_s"] > 0.03


def test_a_disk_that_fills_up_is_told_and_nothing_else_happens(tmp_path, monkeypatch):
    monkeypatch.setattr(Sink, "create", classmethod(lambda cls, path, **_: cls(Filling(path, 12_000), str(path))))
    told = []

    async def main():
        async with robot_here() as (_, url), recorded(url, tmp_path / "live.mcap", told) as live:
            await until(lambda: live.health()["recording"]["problem"])
            receipt = live.operator.robot.execute(MotionCommand(JointTarget(READY)), now=live.clock.now())
            await until(lambda: live.operator.report.q_at > receipt.execute_at + 0.2)
            await until(lambda: told)

    asyncio.run(main())
    assert len(told) == 1
    assert told[0].startswith("recording failed: ")
    with open_recording(tmp_path / "live.mcap") as recording:
        assert recording.damage.cut


def test_a_recording_that_breaks_is_told_and_nothing_else_happens(tmp_path, monkeypatch):
    told = []

    async def main():
        async with robot_here() as (_, url), recorded(url, tmp_path / "live.mcap", told) as live:

            def broken():
                raise ValueError("a fault of ours")

            monkeypatch.setattr(live.operator.listener, "write_out", broken)
            await until(lambda: live.health()["recording"]["problem"])
            receipt = live.operator.robot.execute(MotionCommand(JointTarget(READY)), now=live.clock.now())
            await until(lambda: live.operator.report.q_at > receipt.execute_at + 0.2)

    asyncio.run(main())
    assert told == ["recording failed: a fault of ours"]
    with open_recording(tmp_path / "live.mcap") as recording:
        assert recording.end is None
        assert recording.damage.cut


def alone(path, way=None):
    """A recorder of an operator's site whose robot is far away."""
    link = LinkConditions() if way is None else LinkConditions.symmetric(way)
    line = RobotLine(OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0)), link, np.random.default_rng(0))
    recorder = LiveRecorder(LiveRecording(path, "adaptive", "hold"), line, seed=0, began=5e8)
    recorder.open()
    return recorder, line


def test_what_the_robot_tells_is_written_down_once(tmp_path):
    recorder, line = alone(tmp_path / "live.mcap")
    heard, q = line.operator.listener, NOMINAL + 0.1
    goals = [MotionCommand(JointTarget(NOMINAL + 0.1 * k), insertion=Insertion.APPEND) for k in (1, 2, 3)]
    receipts = [line.operator.robot.execute(goal, now=0.1) for goal in goals]
    recorder.advance(now=0.2, connected=True)
    said = ["never met", "never met", "", "", "no message", "no message", ""]
    for k, halted in enumerate(said):
        at = 0.3 + 0.1 * (k // 2)
        # Of a robot that numbers no samples: each report has one.
        line.operator.receive(Report(1, k + 1, at, 0, at, 1.0, q, at, at - 0.2, None, halted), now=0.3 + 0.1 * k)
    heard.answered(1, receipts[0], now=1.1)
    heard.answered(2, replace(receipts[1], execute_at=receipts[1].execute_at + 0.5), now=1.2)
    heard.answered(3, replace(receipts[2], status=Status.REJECTED, reason="too far"), now=1.3)
    recorder.advance(now=1.4, connected=True)
    line.link.backward.send(b"report", 1.4, 6)
    assert line.link.backward.receive(1.5)
    recorder.advance(now=1.5, connected=False)
    assert not recorder.recorder.put(RunEvent(1.5, "other", "x" * 9 * 2**20), t=1.5)
    assert recorder.health()["dropped"] == 1
    recorder.finish(now=1.6)
    assert line.operator.listener is None
    with open_recording(tmp_path / "live.mcap") as recording:
        assert recording.session.began == 5e8
        assert [(round(event.t, 9), event.kind) for event in recording.events] == [
            (0.2, "up"), (0.5, "followed"), (0.7, "halted"), (0.9, "followed"), (1.2, "late"), (1.3, "diverged"),
            (1.5, "down"),
        ]  # fmt: skip
        track = recording.track(REAL)
        assert track.t == pytest.approx([0.3, 0.4, 0.5, 0.6])
        assert track.play == pytest.approx(track.t - 0.2)
        assert (track.q == q).all()
        assert len(recording.logs[REAL].entries()) == 4
        assert [(entry.direction, entry.sent) for entry in recording.link] == [("backward", 1.4)]
        assert len(recording.receipts("real")) == 3


def test_what_was_before_a_late_recording_isnt_told_again(tmp_path):
    line = RobotLine(OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0)), LinkConditions(), np.random.default_rng(0))
    line.operator.robot.execute(MotionCommand(JointTarget(READY)), now=0.0)
    line.advance(now=0.1)
    path = tmp_path / "live.mcap"
    recorder = LiveRecorder(LiveRecording(path, "adaptive", "hold"), line, seed=0, began=5e8, now=60.0)
    assert recorder.health()["written_s"] == 60.0
    recorder.open()
    line.operator.robot.execute(MotionCommand(JointTarget(NOMINAL)), now=60.1)
    recorder.advance(now=60.2, connected=True)
    recorder.finish(now=60.3)
    assert recorder.health()["written_s"] == 60.3
    with open_recording(path) as recording:
        assert [entry.receipt.command_id for entry in recording.commands] == [2]
        assert recording.session.t == 60.0
        assert not recording.link
        told = recording.logs["/commands"].entries()
        assert [one.receipt.command_id for one in told if isinstance(one, ReceiptEntry)] == [2]


def test_what_is_written_at_the_end_needs_no_room(tmp_path, monkeypatch):
    monkeypatch.setattr("interfaces.recording.live.Recorder", partial(Recorder, room=12_000))
    way = Conditions(delay=TraceDelay(f"trace:{'x' * 500}.csv", (0.01,)))
    recorder, line = alone(tmp_path / "live.mcap", way)
    for k in range(20):
        goal = JointTarget(READY if k % 2 else NOMINAL)
        line.operator.robot.execute(MotionCommand(goal, insertion=Insertion.APPEND), now=0.1 * k)
        recorder.advance(now=0.1 * k, connected=True)
        while recorder.recorder.queue:
            time.sleep(0.001)
    recorder.finish(now=2.0)
    assert recorder.health()["dropped"] == 0
    with open_recording(recorder.path) as recording:
        assert [r.command_id for r in recording.receipts("virtual")] == list(range(1, 21))
        assert recording.session.delay == way.delay.name
        assert recording.changes[-1].edit == 20
        assert isinstance(recording.changes[-1], HistoryEntry)


def test_vrs_serve_records(tmp_path, capsys):
    path = tmp_path / "run.mcap"
    arguments = ["serve", "--port", "0", "--body", "exact", "--link-loss", "hold", "--record", str(path)]
    with child(*arguments) as server:
        with connect(server.url.removesuffix("/view")) as robot:
            robot.acquire()
            robot.wait(lambda r: r.state is not None and not r.state.halted and r.state.connected, 20.0)
            move = MotionCommand(JointTarget(NOMINAL + 0.05), speed=0.5)
            receipt = robot.designer.issue(move, wait=5.0).receipt
            robot.wait(lambda r: r.state.play > receipt.end, 20.0)
        health = server.health()["recording"]
        assert health["problem"] is None
    assert exit_status(["compare", str(path), "--json"]) == 0
    value = json.loads(capsys.readouterr().out)
    # How far behind the robot is to be isn't known yet: the first command may be late.
    assert value["commands"]["real"]["accepted"] + value["commands"]["real"]["postponed"] >= 1
    with open_recording(path) as recording:
        assert rerun(recording).identical
        assert not recording.damage
        assert recording.end is not None
        # 60 samples a second of both robots, or nearly.
        track = recording.track(REAL)
        assert np.median(np.diff(track.t)) < 0.025


def test_a_file_that_cannot_be_made_is_one_line(tmp_path, capsys):
    assert exit_status(["serve", "--port", "0", "--record", str(tmp_path / "no" / "run.mcap")]) == 2
    said = capsys.readouterr().err
    assert "recording failed" in said.splitlines()[-1]
    assert "Traceback" not in said


def test_a_recording_is_not_written_over(tmp_path, capsys):
    path = tmp_path / "run.mcap"
    path.write_bytes(b"an earlier one")
    assert exit_status(["serve", "--port", "0", "--record", str(path)]) == 2
    assert "none is written over" in capsys.readouterr().err
    assert path.read_bytes() == b"an earlier one"
