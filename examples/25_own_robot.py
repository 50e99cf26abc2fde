"""A robot of your own: a slide that carries an arm, told by its limits and by where its links are."""

from __future__ import annotations

from typing import Any

import numpy as np

from interfaces.link import delay_profile
from interfaces.runs.summary import summarize
from interfaces.runtime.plan import parse_plan
from interfaces.runtime.session import run_twins
from robots import Robot
from vrs.model import Limits


class Slide:
    """Slides along x, and turns its arm of 0.4 m about z; joint 1 is prismatic."""

    name, prismatic = "slide", (0,)
    tool_speed, tool_turn_speed, characteristic_length = 0.5, 1.0, 0.4
    limits = Limits([-1.0, -2.0], [1.0, 2.0], [0.5, 1.5], [2.0, 6.0])
    poses = {"nominal": np.array([0.0, 0.0])}  # noqa: RUF012

    def links(self, q: Any) -> Any:
        """Poses of the base, the carriage and the arm's end, (3, 4, 4), or (k, 3, 4, 4)."""
        x, angle = np.moveaxis(np.asarray(q, float), -1, 0)
        X = np.zeros((*x.shape, 3, 4, 4)) + np.eye(4)
        X[..., 1, 0, 3] = x
        X[..., 2, 0, 3], X[..., 2, 1, 3] = x + 0.4 * np.cos(angle), 0.4 * np.sin(angle)
        X[..., 2, 0, 0], X[..., 2, 0, 1] = np.cos(angle), -np.sin(angle)
        X[..., 2, 1, 0], X[..., 2, 1, 1] = np.sin(angle), np.cos(angle)
        return X

    def forward(self, q: Any) -> Any:
        """Pose of the arm's end."""
        return self.links(q)[..., -1, :, :]


ROBOT = Robot("slide", Slide())
PLAN = b"""{"issue": 0.0, "execute": 0.5, "move": [0.6, 80], "speed": 0.8}
{"issue": 1.0, "execute": 1.5, "move": [-0.4, -45], "speed": 0.8}"""

if __name__ == "__main__":
    run = run_twins(parse_plan(PLAN, "along the slide", ROBOT.arm), ROBOT, delay_profile("mon"), seed=0)
    summary = summarize(run)
    slid, turned = summary["errors"]["user_time"]["joint_rms_m"], summary["errors"]["user_time"]["joint_rms_deg"]
    print(f"as the user sees it: the slide is {1e3 * slid[0]:.1f} mm off, the arm {turned[1]:.2f} deg, rms")
    print("try: vrs demo --robot examples.25_own_robot:ROBOT, or a module of yours")
