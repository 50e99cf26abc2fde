"""An arm for motions, with an engine and a time of its own, and the square that it goes round."""

from __future__ import annotations

import numpy as np

from interfaces.val2.motion import Arm, EngineRobot
from interfaces.val2.motion.places import Frames
from interfaces.val2.values import VAL2
from robots import puma560
from vrs import Engine, ManualClock

MODEL = puma560.model()
from_oat, to_oat = VAL2.transformation, VAL2.numbers
DOWN = (90.0, 90.0, 0.0)
SQUARE = [from_oat(x, y, 0, *DOWN) for x, y in ((-100, 500), (100, 500), (100, 600), (-100, 600))]


class Bench:
    """An arm on an engine of its own, and its time."""

    def __init__(self, q=None, **options):
        self.clock = ManualClock(0.0)
        self.engine = Engine(MODEL, q=MODEL.poses["nominal"] if q is None else q, clock=self.clock)
        self.arm = Arm(EngineRobot(self.engine), **options)
        self.now = 0.0

    def until(self, ready):
        for _ in range(1000):
            if ready(now=self.now):
                return self.now
            deadline = self.arm.next_deadline()
            assert self.now < deadline < 1e6
            self.sleep(deadline - self.now)
        raise AssertionError("never")

    def sleep(self, seconds):
        self.now += seconds
        self.clock.set(self.now)

    def settle(self):
        return self.until(self.arm.settled)

    def move(self, *places, straight=False):
        for place in places:
            self.arm.move(place, straight=straight, now=self.now)
            self.until(self.arm.ready)

    def here(self):
        return self.arm.here(now=self.now)

    def tips(self, start, end, n=3001):
        """Times, and the tool's tip in VAL's world [mm]."""
        t = np.linspace(start, end, n)
        X = MODEL.forward(self.engine.timeline.sample(t)) @ Frames(MODEL).tip()
        return t, X[:, :3, 3] * [-1000, -1000, 1000]


def close(where, place):
    return np.abs(where.tool.X - place.X).max()
