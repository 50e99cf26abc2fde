"""An operator style of one's own: somebody who drives a square, and hesitates before each corner.

Beside this file:  vrs lab --operator 24_own_operator:square --operator corridor --delay mon --out out/own
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from interfaces.lab.driving.run import run
from interfaces.runs.drive_run import DriveCase
from robots.onboard.driving import STAND, Drive, Posture
from vrs.mobile import clipped


class Square:
    """Two metres straight on, a second of doubt, a quarter turn to the left; and again."""

    start = Posture(0.0, 0.0, 0.0)
    room = ""

    def __init__(self, speed: float, doubt: float, period: float) -> None:
        """Take speed [m/s], pause before a corner [s] and the period of commands [s]."""
        self._speed, self._doubt, self._period = speed, doubt, period
        self._legs = 2.0 / speed, doubt, (math.pi / 2) / 0.5

    def drive(self, t: float, posture: Posture, before: Drive) -> Drive:
        """Say what to drive for the next period; an operator knows the virtual robot alone."""
        straight, doubt, turn = self._legs
        along = t % (straight + doubt + turn)
        wanted = Drive(self._speed, 0.0) if along < straight else STAND
        if along >= straight + doubt:
            wanted = Drive(0.0, 0.5)
        return Drive(clipped(wanted.v, 0.36 * self._period, before.v), wanted.w)


def square(rng: np.random.Generator, period: float) -> Square:
    """Make one: the seed's generator draws its speed and its doubt."""
    return Square(float(rng.uniform(0.2, 0.32)), float(rng.uniform(0.5, 2.0)), period)


if __name__ == "__main__":
    own = f"{Path(__file__).stem}:square"
    for seed in range(3):
        found = run(DriveCase("timeline", "datagrams", "mon", "bare", own, seed, 40.0)).compare()
        late, off = found.time_difference_mean or 0.0, 100 * (found.path_error_max or 0.0)
        print(f"seed {seed}: at most {off:.1f} cm off the path, {late:.2f} s later on average")
