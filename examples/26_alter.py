"""A line with steering on top: a correction every 28 ms becomes an offset of the path, within the limits."""

from __future__ import annotations

import numpy as np

from robots import puma560
from vrs import Alter, Engine, ManualClock, Motion, MotionCommand, PoseTarget, Stop

model, clock = puma560.model(), ManualClock(0.0)
engine = Engine(model, q=model.poses["nominal"], clock=clock)
goal = engine.pose(0.0)
goal[0, 3] -= 0.25
line = engine.execute(MotionCommand(PoseTarget(goal), motion=Motion.LINE, speed=0.2, acceleration=0.5))
planned = engine.timeline
print(f"a line of 250 mm at 100 mm/s, {line.end:.2f} s")


def sine(t):
    """Height above the line [m]."""
    return 5e-3 * np.sin(2 * np.pi * np.clip(t - 0.2, 0.0, None))


for k in range(70):
    clock.set(0.2 + 0.028 * k)
    engine.execute(Alter([0, 0, sine(clock.now()), 0, 0, 0]))

t = np.arange(0.4, clock.now(), 1e-3)
height = model.forward(engine.timeline.sample(t))[:, 2, 3] - model.forward(planned.sample(t))[:, 2, 3]
print(f"it's off the line by {1e3 * np.abs(height).max():.2f} mm")
print(f"and off line and sine by {1e3 * np.abs(height - sine(t - 0.056)).max():.4f} mm")
share = np.abs(engine.timeline.sample(t, derivative=2) / model.limits.qdd_max).max()
print(f"with {100 * share:.0f} % of the accelerations that the joints have")

late = engine.execute(Alter([0, 0, 0.05, 0, 0, 0], issued_at=clock.now() + 0.01))
print(f"50 mm at once: {late.hindrance}")
clock.advance(0.1)
stop = engine.execute(Stop())
print(f"a stop on the way: {stop.reason}, {stop.end - clock.now():.3f} s")
