"""A live site, recorded while it serves."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time

import numpy as np

from interfaces import connect
from interfaces.cli.main import _status
from interfaces.link import Conditions, LinkConditions, delay_profile
from interfaces.recording import sink
from interfaces.recording.figures import figures, summary
from interfaces.recording.live import LiveRecording
from interfaces.recording.recording import open_recording
from interfaces.recording.rerun import rerun
from interfaces.recording.track import REAL
from interfaces.runtime.live.operator import LiveOperator, LiveOperatorConfig
from interfaces.stream import sockets
from interfaces.stream.access import OPEN, Access, hosts
from interfaces.stream.network import Impair, Way
from interfaces.stream.server import application
from tests.interfaces.live_rig import MODEL, NOMINAL, READY, child, robot_here, until
from tests.interfaces.recording import shown
from vrs import Insertion, JointTarget, MotionCommand, SteerCommand


@contextlib.asynccontextmanager
async def recorded(url, path, told):
    """An operator's site in this loop that's recorded."""
    listening = sockets.bind("127.0.0.1", 0)
    link = LinkConditions.symmetric(Conditions(delay=delay_profile("constant:0.03")))
    recording = LiveRecording(path, "adaptive", "hold", told.append)
    config = LiveOperatorConfig(MODEL, NOMINAL, url, link, recording=recording)
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
            site, clock = live.operator, live.clock
            heard = live.recorder._capture.reported
            live.recorder._capture.reported = lambda r, *, now: (reports.append(r), heard(r, now=now))
            site.execute(MotionCommand(JointTarget(READY)), now=clock.now())
            await asyncio.sleep(0.3)
            site.execute(MotionCommand(JointTarget(READY + 9)), now=clock.now())
            site.execute(SteerCommand(rates=np.full(6, 0.1)), now=clock.now())
            await asyncio.sleep(0.1)
            site.execute(MotionCommand(JointTarget(NOMINAL), insertion=Insertion.APPEND), now=clock.now())
            site.undo(now=clock.now())
            await until(lambda: set(site.receipts) >= {1, 3, 4})
            live.emulation.impair(Impair(1, 1, Way("constant:0.03", "0", "in-order")), "Ada", now=clock.now())
            await until(lambda: len({report.measured_at for report in reports}) > 30)
            # What came last is waited for to be written.
            await asyncio.sleep(0.5)
            health = live.health()["recording"]
            assert (health["file"], health["dropped"], health["problem"]) == (str(path), 0, None)
            # The block that's open, a turn of the recorder's thread and one of the site's, on a busy machine.
            assert health["written_s"] > clock.now() - 1.5
            return site.engine.timeline, site.engine.receipts

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
        assert len(set(samples.t.tolist()) & known.keys()) > 20
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
        assert any("own references" in line for line in found.missing)
        assert value["commands"]["virtual"] == {"accepted": 3, "postponed": 0, "rejected": 1}
        assert value["messages"]["delay_mean_s"] == 0.03
        # The exact body is where its reference is: what differs is what its reports don't show.
        if not value["corrections"]:
            assert value["errors"]["timeline_time"]["tool_max_m"] < 5e-3
        assert value["behind"]["mean_s"] > 0.03


def test_a_disk_that_fills_up_is_told_and_nothing_else_happens(tmp_path, monkeypatch):
    class Small:
        def __init__(self, path):
            self.file, self.room = path.open("wb", buffering=0), 12_000

        def write(self, data):
            some = bytes(data)[: self.room]
            self.room -= len(some)
            return self.file.write(some)

        def close(self):
            self.file.close()

    monkeypatch.setattr(sink.Sink, "create", classmethod(lambda cls, path, **_: cls(Small(path), str(path))))
    told = []

    async def main():
        async with robot_here() as (_, url), recorded(url, tmp_path / "live.mcap", told) as live:
            await until(lambda: live.health()["recording"]["problem"])
            receipt = live.operator.execute(MotionCommand(JointTarget(READY)), now=live.clock.now())
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

            monkeypatch.setattr(live.recorder._capture, "write_out", broken)
            await until(lambda: live.health()["recording"]["problem"])
            receipt = live.operator.execute(MotionCommand(JointTarget(READY)), now=live.clock.now())
            await until(lambda: live.operator.report.q_at > receipt.execute_at + 0.2)

    asyncio.run(main())
    assert told == ["recording failed: a fault of ours"]


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
    assert _status(["compare", str(path), "--json"]) == 0
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
    assert _status(["serve", "--port", "0", "--record", str(tmp_path / "no" / "run.mcap")]) == 2
    said = capsys.readouterr().err
    assert "recording failed" in said.splitlines()[-1]
    assert "Traceback" not in said


def test_a_recording_is_not_written_over(tmp_path, capsys):
    path = tmp_path / "run.mcap"
    path.write_bytes(b"an earlier one")
    assert _status(["serve", "--port", "0", "--record", str(path)]) == 2
    assert "none is written over" in capsys.readouterr().err
    assert path.read_bytes() == b"an earlier one"
