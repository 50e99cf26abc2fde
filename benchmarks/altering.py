"""What a correction of the path costs, and how exactly a sine on a line is followed."""

from __future__ import annotations

import time

import numpy as np

from robots import puma560
from vrs import Alter, Engine, ManualClock, Motion, MotionCommand, PoseTarget
from vrs.planning.altering import DELAY

MODEL = puma560.model()
PERIOD = 0.028
BEGIN = 0.2
WAVES = ((5.0, 1.0), (5.0, 2.0), (20.0, 0.5), (1.0, 5.0), (30.0, 1.0))
"""Amplitude [mm], frequency [Hz]; the last is beyond the limits."""


def follow(amplitude: float, frequency: float) -> tuple[list[float], int, float]:
    """Processor times of corrections [s], how many came late or not at all, the largest error after 0.2 s [mm]."""
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=MODEL.poses["nominal"], clock=clock)
    goal = engine.pose(0.0)
    goal[0, 3] -= 0.25
    line = MotionCommand(PoseTarget(goal), motion=Motion.LINE, speed=0.2, acceleration=0.5)
    receipt = engine.execute(line)
    planned = engine.timeline

    def height(t: np.ndarray) -> np.ndarray:
        return amplitude / 1000.0 * np.sin(2.0 * np.pi * frequency * np.clip(t - BEGIN, 0.0, None))

    took, late = [], 0
    assert receipt.end is not None
    for k in range(int((receipt.end - BEGIN) / PERIOD)):
        clock.set(BEGIN + k * PERIOD)
        command = Alter(np.array([0.0, 0.0, float(height(np.array(clock.now()))), 0.0, 0.0, 0.0]))
        begun = time.process_time()
        answer = engine.execute(command)
        took.append(time.process_time() - begun)
        late += bool(answer.hindrance) or answer.execute_at is None
    t = np.arange(BEGIN + 0.2, clock.now(), 1e-3)
    off = MODEL.forward(engine.timeline.sample(t))[:, 2, 3] - MODEL.forward(planned.sample(t))[:, 2, 3]
    return took, late, 1000.0 * float(np.abs(off - height(t - DELAY)).max())


def main() -> None:
    """Print a line for each sine."""
    follow(*WAVES[0])
    for wave in WAVES:
        took, late, error = follow(*wave)
        median, worst = 1000.0 * np.median(took), 1000.0 * max(took)
        print(
            f"{wave[0]:5.1f} mm at {wave[1]:.1f} Hz: {median:.2f} ms median, {worst:.2f} ms worst; "
            f"{late} of {len(took)} late; {error:.4f} mm off line and sine"
        )
