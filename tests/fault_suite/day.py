"""A day of virtual operation: operators, links, crashes and disks by chance, the laws checked at each step."""

from __future__ import annotations

import tempfile
from collections import Counter
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

import numpy as np

from benchmarks.results import Result
from interfaces.link import BernoulliLoss, Conditions, LinkConditions, Service, delay_profile
from interfaces.recording import RecordingError, open_recording
from interfaces.recording.live import LiveRecorder, LiveRecording
from interfaces.recording.mcap_file import Sink
from interfaces.teleop import RobotSiteConfig
from robots.onboard.watchdog import LossPolicy, WatchdogConfig
from tests.fault_suite.effort import Effort, most
from tests.interfaces.recording.disks import Failing
from tests.interfaces.test_host import LIMITS, NOMINAL, Ends
from vrs import Insertion, JointTarget, MotionCommand, SteerCommand, Stop
from vrs.errors import FormatError, VrsError

STEP = 0.02
"""Virtual time between two looks [s]."""
HOUR = 3600.0
HALT = WatchdogConfig(max_age=2.0, max_uncertainty=1.0)
BRAKE = 2 * float((LIMITS.qd_max / LIMITS.qdd_max).max()) + 0.2
"""How long a stop takes at most [s], along the path and from any pace of play."""
PROFILES = ("constant:0.05", "domain", "country", "mon", "tue", "wed", "fri", "constant:0.4")
QUIET = LinkConditions.symmetric(Conditions(delay=delay_profile("constant:0.05")))
DARK = LinkConditions.symmetric(Conditions(loss=BernoulliLoss(1.0), service=Service.DATAGRAM))
EACH = 1200.0
"""So often all faults end, and both robots are to agree again [s]."""


class Day:
    """One robot, and whoever comes to command it."""

    def __init__(self, seed: int, folder: Path) -> None:
        self.random, self.folder = Random(seed), folder
        self.ends = Ends(site=RobotSiteConfig(watchdog=HALT), step=STEP)
        self.did: Counter[str] = Counter()
        self.lives = 0
        self.heard = self.ends.t
        """When the robot heard its operator last [s]."""
        self.moved_alone = self.late = self.readable = 0
        self.recorder: LiveRecorder | None = None
        self._watch_host()
        self._record()

    def _watch_host(self) -> None:
        receive = self.ends.host.receive

        def heard(message: Any, *, now: float) -> None:
            self.heard = self.ends.t
            receive(message, now=now)

        self.ends.host.receive = heard  # type: ignore[method-assign]

    def _record(self) -> None:
        """Record this operator, on a disk that's full at some time."""
        disk = Failing(self.random.randint(2, 400), how="full")
        self.disk = disk
        with patch.object(Sink, "create", classmethod(lambda cls, path, **_: cls(disk, str(path)))):
            self.recorder = LiveRecorder(
                LiveRecording(self.folder / "day.mcap", "adaptive", "hold"), self.ends.line, seed=0, began=0.0
            )
            try:
                self.recorder.open()
            except RecordingError:
                self.recorder = None

    def _end_recording(self) -> None:
        """Look into what the disk took."""
        if self.recorder is None:
            return
        self.recorder.finish(now=self.ends.now)
        path = self.folder / "day.mcap"
        path.write_bytes(self.disk.data)
        with suppress(FormatError), open_recording(path) as recording:
            self.readable += bool(recording.damage.cut or recording.end is not None)
            self.did["recordings"] += 1

    def run(self, seconds: float, *, operator: bool = True) -> None:
        """Let time pass, and hold what the body was asked for against the laws."""
        ends, site = self.ends, self.ends.host.site
        epoch, halted = (0, "") if site is None else (site.epoch, site.halted)
        last = ends.asked[-1:]
        ends.asked = list(last)
        ends.run(max(seconds, STEP), operator=operator)
        if self.recorder is not None:
            self.recorder.advance(now=ends.now, connected=operator)
        ends.check()
        asked = np.array(ends.asked)
        if last and halted and site is ends.host.site and site is not None and site.epoch == epoch:
            stands = np.flatnonzero(np.abs(asked[:, 1:]).max((1, 2)) == 0.0)
            if len(stands):
                self.moved_alone += bool(np.ptp(asked[stands[0] :, 0], axis=0).max() > 0.0)
        if site is not None and site is ends.host.site and site.watchdog is not None:
            silent = ends.t - self.heard
            if silent >= HALT.timeout + 0.02 + STEP:
                self.late += not site.halted
            if silent >= HALT.timeout + 0.02 + BRAKE:
                self.late += bool(np.abs(asked[-1, 1]).max() > 0.0)

    def go_on(self) -> None:
        """One thing that happens, and some time."""
        random, ends = self.random, self.ends
        what = random.choices(
            ("command", "resume", "outage", "absence", "operator dies", "robot dies", "other link"),
            (60, 20, 5, 3, 2, 1.5, 4),
        )[0]
        self.did[what] += 1
        wait = min(random.expovariate(1 / 0.7), 4.0)
        if what == "command":
            self.command()
        elif what == "resume":
            ends.operator.resume(now=ends.now)
        elif what == "outage":
            before = ends.line.link.conditions
            ends.line.change(DARK, now=ends.now)
            self.run(random.uniform(0.1, 5.0))
            ends.line.change(before, now=ends.now)
        elif what == "absence":
            # It stands still, and goes on: nothing of that time is made up for.
            self.run(random.uniform(0.1, 5.0), operator=False)
        elif what == "operator dies":
            self.other_operator(random.uniform(0.0, 4.0))
        elif what == "robot dies":
            self.other_robot()
        else:
            self.link()
        self.run(wait)

    def command(self) -> None:
        """Something that an operator may do."""
        random, ends = self.random, self.ends
        robot, now = ends.operator.robot, ends.now
        kind = random.random()
        with suppress(VrsError):
            if kind < 0.6:
                q = np.clip(NOMINAL + [random.uniform(-0.8, 0.8) for _ in range(6)], LIMITS.q_min, LIMITS.q_max)
                at = now + random.choice((0.0, 0.3, 2.0, -1.0))
                how = random.choice(list(Insertion))
                robot.execute(
                    MotionCommand(JointTarget(q), None, at, random.choice((0.3, 0.6, 1.0)), insertion=how), now=now
                )
            elif kind < 0.8:
                rates = LIMITS.qd_max * [random.uniform(-0.4, 0.4) for _ in range(6)]
                for _ in range(10):
                    robot.execute(SteerCommand(rates=rates), now=ends.now)
                    self.run(0.06)
            elif kind < 0.9:
                robot.undo(now=now)
            else:
                robot.execute(Stop(), now=now)

    def link(self) -> None:
        """The link becomes another one."""
        random = self.random
        service = random.choice(list(Service))
        loss = random.choice((0.0, 0.0, 0.1, 0.3)) * (0.1 if service is Service.IN_ORDER else 1.0)
        conditions = Conditions(
            delay=delay_profile(random.choice(PROFILES)), loss=BernoulliLoss(loss),
            duplicate=random.choice((0.0, 0.2)), service=service,
        )  # fmt: skip
        self.ends.line.change(LinkConditions.symmetric(conditions), now=self.ends.now)

    def other_operator(self, after: float) -> None:
        """The operator's site is gone, and another one comes; the robot lets it in when it may."""
        ends = self.ends
        self._end_recording()
        self.run(after, operator=False)
        self.lives += 1
        policy = self.random.choice((None, LossPolicy.HOLD, LossPolicy.HALT))
        ends.new_operator(f"operator {self.lives}", policy)
        while ends.refused:
            self.run(0.5, operator=False)
            ends.new_operator(f"operator {self.lives}", policy)
        self._record()

    def other_robot(self) -> None:
        """The robot's site is gone, and another one is there where the body came to rest, with another clock."""
        ends, random = self.ends, self.random
        ends.line.connected = False
        q = np.clip(ends.asked[-1][0], LIMITS.q_min, LIMITS.q_max)
        ends.run(random.uniform(0.1, 3.0), robot=False)
        clock = 1.0 + random.uniform(-100e-6, 100e-6), random.uniform(-HOUR, HOUR)
        ends.host, ends.asked = ends.robot(q, *clock), []
        self._watch_host()
        self.heard = ends.t
        ends.host.hello(ends.session, now=ends.robots())
        ends.line.connected = True

    def settle(self) -> float:
        """End all faults; how far the body is from where it's sent then [rad]."""
        ends = self.ends
        ends.line.change(QUIET, now=ends.now)
        for _ in range(40):
            self.run(1.0)
            if ends.operator.resume(now=ends.now) == "":
                self.run(0.5)
            if not ends.operator.halted and ends.host.site is not None and not ends.host.site.halted:
                ends.operator.robot.execute(
                    MotionCommand(JointTarget(NOMINAL), insertion=Insertion.REPLACE), now=ends.now
                )
                self.run(12.0)
                apart = float(np.abs(ends.asked[-1][0] - NOMINAL).max())
                if apart <= 1e-9:
                    return apart
        return float(np.abs(ends.asked[-1][0] - NOMINAL).max())


def day_of_faults(effort: Effort) -> tuple[Result, ...]:
    """A day of virtual operation with random faults

    One robot, and operators who come and go: by chance they move, redirect, steer, stop, take back and resume;
    links change, lose everything for up to 5 s, or lose and double some; operators and robots stand still, die and
    come again, the robot with a clock that's up to an hour off and drifts by up to 100 ppm; disks of recordings
    fill up. At each step of 20 ms: limits are kept and nothing jumps; who halted and stands moves only in a new
    epoch; without a message for T_loss it has halted, and soon stands. Every twenty minutes all faults end: then it
    does as it's told.
    """
    worst, end = 0.0, effort.hours * HOUR
    with tempfile.TemporaryDirectory() as folder:
        day = Day(effort.seed, Path(folder))
        day.run(4.0)
        while day.ends.t < end:
            until = min(day.ends.t + EACH, end)
            while day.ends.t < until:
                day.go_on()
            worst = max(worst, day.settle())
        day._end_recording()
    things = sum(day.did.values())
    note = ", ".join(f"{count} {what}" for what, count in sorted(day.did.items()))
    said = f"{day.ends.t / HOUR:.1f} h: {note}"
    return (
        most("moves by itself after a halt", day.moved_alone, 0, tries=things, note=said),
        most("hasn't halted, or doesn't stand, in time", day.late, 0, tries=things),
        most("is at last from where it's sent", worst, 1e-9, "rad", tries=max(1, round(day.ends.t / EACH))),
        most("recordings that aren't readable as far as the disk took them", day.did["recordings"] - day.readable,
             0, tries=day.did["recordings"]),
    )  # fmt: skip
