"""A command that arrives in motion redirects the arm; the past stays, and no speed jumps."""

from __future__ import annotations

import numpy as np

from robots import puma560
from vrs import Engine, JointTarget, ManualClock, MotionCommand

model = puma560.model()
clock = ManualClock(0.0)
engine = Engine(model, q=model.poses["nominal"], clock=clock)
engine.execute(MotionCommand(JointTarget(np.radians([60, 60, -170, 0, 30, 0])), execute_at=0.5, speed=0.5))
before = engine.timeline

clock.set(1.0)
receipt = engine.execute(MotionCommand(JointTarget(np.radians([-30, 70, -150, 0, 40, 0])), execute_at=1.2))
past = np.linspace(0.0, 1.2, 200)
around = engine.timeline.sample([1.2 - 1e-9, 1.2 + 1e-9], derivative=1)
print(f"command {receipt.command_id}: {receipt.status}, arrives at {receipt.end:.3f} s")
print(f"command 1 is superseded by command {engine.receipts[0].superseded_by}")
print(f"change of the past: {np.abs(engine.timeline.sample(past) - before.sample(past)).max():.1e} rad")
print(f"jump of the speed:  {np.abs(around[1] - around[0]).max():.1e} rad/s")
