"""The tool on a straight line: as fast as asked where the joints can, slower where one couldn't keep up."""

from __future__ import annotations

import numpy as np

from robots import puma560
from vrs import Engine, Motion, MotionCommand, PoseTarget

model = puma560.model()
engine = Engine(model, q=model.poses["nominal"])
begin = engine.pose()
goal = begin.copy()
goal[:3, 3] += [-0.25, 0.35, 0.15]
receipt = engine.execute(MotionCommand(PoseTarget(goal), motion=Motion.LINE, execute_at=0.0))
p = engine.pose(np.linspace(0.0, receipt.end, 2001))[:, :3, 3]
way = goal[:3, 3] - begin[:3, 3]
length = float(np.linalg.norm(way))
aside = np.linalg.norm(np.cross(p - begin[:3, 3], way / length), axis=1).max()
speed = np.linalg.norm(np.diff(p, axis=0), axis=1).max() / (receipt.end / 2000)
print(f"{length:.3f} m in {receipt.end:.3f} s, {len(engine.timeline)} polynomials")
print(f"largest distance from the line: {aside:.1e} m; largest speed: {speed:.3f} m/s")

far = goal.copy()
far[:3, 3] += [1.0, 0.0, 0.0]
refused = engine.execute(MotionCommand(PoseTarget(far), motion=Motion.LINE))
print(f"{refused.status}: {refused.reason}")
