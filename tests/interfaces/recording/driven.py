"""Both sites of an arm in virtual time, recorded as a live site is; the robot's own log is kept beside that."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from interfaces.link import Conditions, LinkConditions, delay_profile, loss_model
from interfaces.recording.live import LiveRecorder, LiveRecording
from interfaces.teleop import FollowingArm, OperatorSite, RobotLine, RobotSiteConfig, VirtualArm
from robots import puma560
from vrs.commands import Command

MODEL = puma560.model()
HOME = MODEL.poses["nominal"]
TICK = 0.005
MEASURED = 0.01
"""How often the body is measured [s]."""


class Driven:
    """An operator's site with a recorder, and a robot's; the body is a little beside its references."""

    def __init__(self, path: Path, delay: str = "none", loss: str = "0", *, seed: int = 0, beat: float = 1 / 30):
        way = LinkConditions.symmetric(Conditions(delay=delay_profile(delay), loss=loss_model(loss)))
        self.operator = OperatorSite(VirtualArm(MODEL, HOME, now=0.0))
        self.line = RobotLine(self.operator, way, np.random.default_rng(seed))
        self.line.connected = True
        self.robot = FollowingArm(MODEL, HOME, now=0.0, config=RobotSiteConfig(beat=beat))
        self.recorder = LiveRecorder(LiveRecording(path, "adaptive", "hold"), self.line, seed=seed, began=5e8)
        self.recorder.open()
        self.now = 0.0
        self.cut = False
        """Whether the connection between the sites is lost."""
        self.log: list[np.ndarray] = []
        """What the robot's own site knows: time, play time, measured joints, and what was asked of them."""
        self._ticks = 0

    def tell(self, command: Command) -> None:
        self.operator.robot.execute(command, now=self.now)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK)):
            self._ticks += 1
            self.now = now = TICK * self._ticks
            for message in self.line.advance(now=now):
                if not self.cut:
                    self.robot.receive(message, now=now)
            if self._ticks % round(MEASURED / TICK) == 0:
                self._measure(now)
            for report in self.robot.advance(now=now):
                if not self.cut:
                    self.line.receive(report, now=now)
            if self._ticks % round(0.1 / TICK) == 0:
                self.recorder.advance(now=now, connected=not self.cut)

    def _measure(self, now: float) -> None:
        play = self.robot.play_at(np.array([now]))
        q, qd, _ = (rows[0] for rows in self.robot.reference(play))
        real = q - 0.004 * qd + 2e-4 * np.sin(7.0 * now + np.arange(6))
        self.robot.measured(real, now=now)
        self.log.append(np.concatenate(([now, play.p[0]], real, q)))

    def finish(self) -> None:
        self.recorder.finish(now=self.now)

    def own(self, since: float, until: float) -> np.ndarray:
        """The robot's own log of a time [s]."""
        rows = np.array(self.log)
        return rows[(rows[:, 0] >= since) & (rows[:, 0] <= until)]
