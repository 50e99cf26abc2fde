"""A virtual and a real robot on one plan; how far behind the real one plays adapts to a bad network."""

from __future__ import annotations

import numpy as np

from interfaces.link import delay_profile
from interfaces.runs.summary import measures
from interfaces.runtime.plan import parse_plan
from interfaces.runtime.session import run_twins
from robots import load

PLAN = b"""{"issue": 0.0, "execute": 0.5, "move": [20, 50, -160, 0, 30, 0], "speed": 0.6}
{"issue": 0.8, "execute": 1.0, "move": [-10, 60, -170, 0, 30, 0], "speed": 0.6}"""

robot = load("puma560")
model = robot.arm
plan = parse_plan(PLAN, "two moves", model)
run = run_twins(plan, robot, delay_profile("mon"), seed=0)
errors = measures(run)
print(f"the real robot plays {-run.D.mean():.3f} s behind on average, at most {-run.D.min():.3f} s")
print(f"tool apart at equal user time:     {1e3 * errors.tool_rms_user_m:8.3f} mm rms")
print(f"tool apart at equal timeline time: {1e3 * errors.tool_rms_timeline_m:8.3f} mm rms")
print(f"joints apart at equal timeline time: {np.degrees(errors.joint_rms_timeline_rad):.4f} deg rms")
