"""A hand on a joystick: fifty inputs a second become smooth segments, and end by themselves when the hand stops."""

from __future__ import annotations

import numpy as np

from robots import puma560
from vrs import Engine, ManualClock, SteerCommand

model = puma560.model()
clock = ManualClock(0.0)
engine = Engine(model, q=model.poses["nominal"], clock=clock)
for k in range(100):
    twist = [0.0, 0.15, 0.1 * np.sin(0.1 * k), 0.0, 0.0, 0.3]
    receipt = engine.execute(SteerCommand(twist=twist))
    clock.advance(0.02)
moved = engine.pose(2.0)[:3, 3] - engine.pose(0.0)[:3, 3]
print(f"{len(engine.timeline)} segments for 100 inputs, one command (id {receipt.command_id})")
print(f"the tool moved {np.round(moved, 3)} m")
print(f"no input after {clock.now():.2f} s: the arm rests at {engine.timeline.end:.2f} s")

for _ in range(300):
    receipt = engine.execute(SteerCommand(rates=[0.0, 0.0, 0.0, 0.0, 0.8, 0.0]))
    clock.advance(0.02)
limit = model.limits.q_max[4]
print(f"joint 5 pushed on for 6 s: {limit - engine.joints(clock.now())[4]:.1e} rad before its limit")
