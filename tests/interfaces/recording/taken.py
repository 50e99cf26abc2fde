"""Recordings of what really ran: plans in the laboratory, and an operator's site that's told this and that."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np

from interfaces.link import Service, delay_profile
from interfaces.messages.recording import Begin, End
from interfaces.messages.sites import PlanPart, Report
from interfaces.recording.capture import Capture
from interfaces.recording.run_recorders import RunRecorder
from interfaces.recording.writer import RecordingWriter
from interfaces.runs.twin_run import TwinRun, fixed_offset
from interfaces.runtime.plan import parse_plan
from interfaces.runtime.session import run_twins
from interfaces.system import software
from interfaces.teleop import OperatorSite, VirtualArm
from robots import load
from robots.robot import exact_arm
from tests.vrs.sessions import Draws, Generator
from vrs import Engine, JointTarget, ManualClock, MotionCommand
from vrs.errors import VrsError
from vrs.model import frozen_array

ROBOT = load("puma560")
MODEL = ROBOT.arm
NOMINAL = MODEL.poses["nominal"]
PLAN = parse_plan(
    b"""{"schema": "vrs-plan/1", "title": "back and forth"}
{"issue": 0.4, "execute": 0.6, "move": [40, 60, -170, 0, 30, 0], "speed": 0.8}
{"issue": 0.9, "move": [-30, 70, -150, 20, 40, 30], "speed": 0.9, "profile": "jerk-limited"}
{"issue": 1.0, "payload": {"mass_kg": 2.5}}
{"issue": 1.2, "execute": 0.4, "move": {"pose": "ready"}}
{"issue": 1.3, "register": 1.7, "execute": 1.4, "move": {"pose": "nominal"}}
{"issue": 1.8, "execute": 2.2, "move": [10, 60, -170, 0, 30, 0], "insertion": "append"}""",
    "plan.jsonl",
    MODEL,
)


def taken(
    path: Path, delay: str = "thu", *, plan=PLAN, arm=exact_arm, seed=0, offset="adaptive",
    service=Service.DATAGRAM, progress=None,
) -> TwinRun:  # fmt: skip
    """Run a plan on both twins, and record it."""
    profile = delay_profile(delay)
    recorder = RunRecorder(path)
    run = run_twins(
        plan, ROBOT, profile, arm,
        seed=seed, offset=fixed_offset(offset, profile), service=service, keeper=recorder, progress=progress,
    )  # fmt: skip
    recorder.finish()
    assert recorder.problem == ""
    return run


class Sitting:
    """An operator's site without a robot, recorded while it's told this and that, and corrected now and then."""

    def __init__(self, path: Path, seed: int) -> None:
        self.clock = 0.0
        self.site = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
        self.capture = self.site.listener = Capture(self.site.robot.engine, now=0.0, step=0.02, every=True)
        begin = Begin(
            t=0.0, robot="puma560", driver="laboratory", title="sitting", seed=seed, delay="none",
            offset="adaptive", service="datagram", link_loss="hold", step=0.02, q=NOMINAL.tolist(),
            lateness="postpone", software=software(),
        )  # fmt: skip
        self.writer = RecordingWriter(path, begin)
        self.capture.put = self.writer.write
        for message in self.capture.first():
            self.capture.add(0.0, message)
        self.timelines = [self.site.robot.engine.timeline]
        """Every one that there was, one after the other."""
        self._source = Generator(seed)
        self._draws = Draws(self._source, MODEL)
        self._reports = 0

    def go_on(self, edits: int) -> None:
        """Tell it what chance says."""
        for _ in range(edits):
            self.tell()
            if self._source.share() < 0.04:
                self.report(halted="chance" if self._source.share() < 0.3 else "")
            self.clock += self._draws.pause(self.site.robot.engine)
            if self.site.halted:
                self.site.resume(now=self.clock)
            self.capture.sample(now=self.clock)
            self.capture.write_out()

    def tell(self, command=..., /) -> None:
        """Tell it a command, one of any kind unless it's given."""
        engine = self.site.robot.engine
        if command is ...:
            watch = SimpleNamespace(
                engine=engine, moves={r.command_id: r for r in engine.receipts if r.q is not None},
                receipts={r.command_id: r for r in engine.receipts},
            )  # fmt: skip
            command = self._draws.command(watch, self._draws.kind())  # type: ignore[arg-type]
        try:
            if command is None:
                self.site.robot.undo(now=self.clock)
            else:
                self.site.robot.execute(command, now=self.clock)
        except VrsError:
            return
        finally:
            self._note()

    def report(self, halted: str = "") -> None:
        """Let the robot say that it's doing something else."""
        self._reports += 1
        now, engine = self.clock, self.site.robot.engine
        real = Engine(MODEL, timeline=engine.timeline, clock=ManualClock(now))
        away = np.clip(NOMINAL + 0.3 * np.sin(np.arange(6) + self._reports), MODEL.limits.q_min, MODEL.limits.q_max)
        real.execute(MotionCommand(JointTarget(away), execute_at=now + 0.05, speed=0.5))
        timeline = real.timeline
        low = max(timeline.index_at(now - 0.1), 0)
        since = timeline.start_of(low)
        part = PlanPart(timeline.version, since, timeline.sample(since), segments=tuple(timeline.segments[low:]))
        q = frozen_array(timeline.sample(now - 0.1))
        report = Report(
            self.site.epoch, self._reports, now, 0, now, 1.0, q, now - 0.1, now - 0.1, None, halted, (), part
        )
        self.site.receive(report, now=now)
        self._note()

    def _note(self) -> None:
        if self.site.robot.engine.timeline is not self.timelines[-1]:
            self.timelines.append(self.site.robot.engine.timeline)

    def end(self) -> None:
        """Close the file."""
        self.capture.sample(now=self.clock)
        self.capture.receipts(self.clock, "virtual", self.site.robot.engine.receipts)
        self.capture.whole(self.clock)
        self.capture.write_out()
        self.writer.finish(End(self.clock))
