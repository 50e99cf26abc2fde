"""A robot from its description: a URDF with what it leaves out stated beside it, and its twins over a network."""

from __future__ import annotations

import tempfile
from pathlib import Path

from interfaces.link import delay_profile
from interfaces.runs.summary import summarize
from interfaces.runtime.plan import parse_plan
from interfaces.runtime.session import run_twins
from robots.described import described

URDF = """<robot name="gantry">
  <link name="rail"/>
  <link name="carriage"><visual><geometry><box size="0.2 0.2 0.1"/></geometry></visual></link>
  <link name="arm"><visual><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.05 0.05"/></geometry></visual></link>
  <link name="hook"/>
  <joint name="slide" type="prismatic"><parent link="rail"/><child link="carriage"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" velocity="0.5" effort="100"/></joint>
  <joint name="turn" type="continuous"><parent link="carriage"/><child link="arm"/><axis xyz="0 0 1"/></joint>
  <joint name="end" type="fixed"><parent link="arm"/><child link="hook"/><origin xyz="0.4 0 0"/></joint>
</robot>"""
STATED = """tool_speed = 0.3
[joints.turn]
lower = -3.0
upper = 3.0
velocity = 1.5
[poses.nominal]
turn = 0.5
"""
PLAN = b"""{"issue": 0.0, "execute": 0.5, "move": [0.6, 80], "speed": 0.8}
{"issue": 1.0, "execute": 1.5, "move": [-0.4, -45], "speed": 0.8}"""

if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "gantry.urdf").write_text(URDF)
        (Path(folder) / "gantry.vrs.toml").write_text(STATED)
        found = described(f"{folder}/gantry.urdf")
    for note in found.notes:
        print(f"- {note}")
    robot = found.robot
    run = run_twins(parse_plan(PLAN, "along the rail", robot.arm), robot, delay_profile("mon"), seed=0)
    behind = summarize(run)["errors"]["user_time"]["tool_rms_m"]
    print(f"{robot.name}, {robot.joints}: as the user sees it, the hook is {1e3 * behind:.0f} mm off, rms")
    print("try: vrs check FILE.urdf, then vrs demo --robot FILE.urdf")
