"""An architecture of one's own: the robot drives to where the operator's robot was last, straight on.

Beside this file:  vrs lab --architecture 23_own_architecture:Chaser --architecture I --delay mon --out out/own
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from interfaces.lab.driving.run import run
from interfaces.messages.sites import ArcPacket
from interfaces.runs.drive_run import DriveCase
from interfaces.teleop.architectures import Constants
from robots.onboard.driving import STAND, Drive, Posture
from vrs.mobile import wrapped
from vrs.segment import ArcSegment


class Chaser:
    """Heads for the end of the newest arc it has heard of; late packets only make it wait."""

    def __init__(self, constants: Constants, posture: Posture) -> None:
        """Stand where both robots begin."""
        self._goal, self.executed = posture, 0

    def receive(self, arcs: Sequence[ArcSegment], packet: ArcPacket, *, now: float) -> None:
        """Take the newest arc's end for the goal."""
        if arcs:
            self._goal = Posture(*arcs[-1].value(arcs[-1].end).tolist())
            self.executed += len(arcs)

    def control(self, posture: Posture, *, now: float, v_before: float) -> Drive:
        """Drive towards the goal, the slower the nearer; the robot's site keeps the limits."""
        dx, dy = self._goal.x - posture.x, self._goal.y - posture.y
        left = math.hypot(dx, dy)
        if left < 0.03:
            return STAND
        aside = wrapped(math.atan2(dy, dx) - posture.theta)
        return Drive(max(0.0, 1.5 * left * math.cos(aside)), 2.0 * aside)


if __name__ == "__main__":
    for name in (f"{Path(__file__).stem}:Chaser", "I", "timeline"):
        drive = run(DriveCase(name, "datagrams", "thu@3.3", robot="bare", operator="corridor", seed=1, length=30.0))
        found = drive.compare()
        off = 100 * (found.path_error_mean or 0.0)
        print(f"{name:27} {off:5.1f} cm off the path on average, {drive.collisions} collisions")
