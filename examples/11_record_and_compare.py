"""A run is recorded while it goes on: its figures come back from the file, and its commands make the same again."""

from __future__ import annotations

import csv
from pathlib import Path

from interfaces.link import delay_profile
from interfaces.recording import open_recording
from interfaces.recording.export import tables, write_csv
from interfaces.recording.figures import summary
from interfaces.recording.rerun import rerun
from interfaces.recording.run_recorders import RunRecorder
from interfaces.runs.summary import summarize
from interfaces.runtime.plan import parse_plan
from interfaces.runtime.session import run_twins
from robots import load
from robots.robot import exact_arm

robot = load("puma560")
model = robot.arm
line = b'{"issue": %d, "move": [%d, 60, -170, 0, 30, 0], "speed": 0.6}'
plan = parse_plan(b"\n".join(line % (k, 40 - 80 * (k % 2)) for k in range(4)), "to and fro", model)

# `vrs demo` and `vrs run` do this by themselves: run.mcap lies beside the report.
recorder = RunRecorder(Path("run.mcap"))
run = run_twins(plan, robot, delay_profile("tue"), exact_arm, seed=3, keeper=recorder)
recorder.finish()

with open_recording("run.mcap") as recording:
    print(f"{recording.path.stat().st_size / 1024:.0f} kB, damage: {recording.damage}")
    print(f"the same summary as the run's own: {summary(recording) == summarize(run)}")

    again = rerun(recording)
    print(f"{again.commands} commands again make the same {again.versions} timelines: {again.identical}")

    # What the user saw at 2.5 s, and what was planned then; the virtual robot is computed, at any time.
    q, q_real = recording.virtual(2.5), recording.real(2.5)
    print(f"joint 1 at 2.5 s: virtual {q[0]:.4f} rad, real {q_real[0]:.4f} rad, played {recording.play(2.5):.3f} s")
    then, now = recording.timeline_at(2.5), recording.timeline
    print(f"planned until {then.end:.2f} s then, until {now.end:.2f} s in the end")

    files = {file.stem: file for file in write_csv(tables(recording), Path("tables"))}
    with files["real"].open(newline="") as file:
        print("columns of real.csv:", *next(csv.reader(file))[:5], "…")

# A file that's cut, as by a power failure, says so; what was written until then is there.
data = Path("run.mcap").read_bytes()
Path("cut.mcap").write_bytes(data[: len(data) // 2])
with open_recording("cut.mcap") as recording:
    print(f"half of the file: {recording.damage}")
    print("its figures lack:", *summary(recording)["missing"], sep="\n  ")
