"""A mobile robot on the timeline: exact arcs, a correction from far away, and a wall."""

from __future__ import annotations

import math

import numpy as np

from robots import ipr
from vrs import DriveCommand, Engine, ManualClock
from vrs.mobile import Avoidance, PostureEstimator, VirtualEnvironment, limited

model = ipr.model()
clock = ManualClock()
engine = Engine(model, posture=(1.0, 3.0, 0.0), clock=clock)

walls = np.zeros((125, 61), bool)
walls[60] = True
room = VirtualEnvironment(walls=walls)
avoidance = Avoidance(model.limits, model.radius, model.period)

asked = u = (0.0, 0.0)
while clock.now() < 15.0:
    asked = limited((0.5, 0.0), asked, model.period, model.limits)
    now = clock.now()
    u = avoidance.command(asked, u, tuple(engine.posture(now).tolist()), room.grid, room.occupied(now))
    engine.execute(DriveCommand(*u, model.period))
    clock.advance(model.period)

x, y, theta = engine.posture()
print(f"the wall is at 6 m: the robot turned along it, at ({x:.2f}, {y:.2f}) m, {math.degrees(theta):.0f} deg")
nearest = 6.0 - engine.posture(np.linspace(0, 15, 500))[:, 0].max()
print(f"its middle came no nearer than {nearest:.2f} m; it needs {model.radius:.2f} m")

engine.execute(DriveCommand(0.3, 0.5, 2.0))
planned = engine.posture(clock.now() + 2.0)
clock.advance(0.5)
receipt = engine.stop()
print(f"stopped {receipt.end - clock.now():.1f} s later on its arc: {receipt.reason}")
engine.undo()
print(f"taken back: again off by {np.abs(engine.posture(engine.timeline.end) - planned).max():.0e} m")

estimator = PostureEstimator(np.add(engine.posture(0.0), (0.2, -0.1, 0.1)), gain=0.5)
arcs = list(engine.timeline.segments)
for i, arc in enumerate(arcs):
    if i >= 10:
        estimator.feedback(i - 10, arcs[i - 10].posture)
    estimator.command(arc.v, arc.w, arc.duration)
error = np.abs(estimator.posture - engine.posture(engine.timeline.end)).max()
print(f"feedback 1 s late took an error of 0.2 m to {error:.0e} m")
