"""A recording played back: to an instant, rewound, in slow motion, in a loop, from mark to mark."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from interfaces.link import delay_profile
from interfaces.recording import open_recording
from interfaces.recording.headless import PlaybackFrames
from interfaces.recording.marks import MarkKind
from interfaces.recording.playback import Playback
from interfaces.recording.run_recorders import RunRecorder
from interfaces.runtime.plan import parse_plan
from interfaces.runtime.session import run_twins
from robots import load
from robots.robot import exact_arm

robot = load("puma560")
model = robot.arm
line = b'{"issue": %.1f, "move": [%d, 60, -170, 0, 30, 0], "speed": 0.4}'
plan = parse_plan(b"\n".join(line % (0.7 * k, 40 - 80 * (k % 2)) for k in range(4)), "redirected", model)
recorder = RunRecorder(Path("run.mcap"))
run_twins(plan, robot, delay_profile("tue"), exact_arm, seed=3, keeper=recorder)
recorder.finish()


def watched(playback: Playback, seconds: float) -> list[float]:
    """Places that are shown in so many seconds of the viewer's time: here they pass at once."""
    frames = PlaybackFrames(playback, rate=50.0, begun=0.0)
    shown = (frames.next(now=0.02 * k) for k in range(round(50 * seconds) + 1))
    return [found[1].t for found in shown if found is not None]


with open_recording("run.mcap") as recording:
    playback = Playback([recording])
    playback.read_marks()
    marks = playback.tracks[0].marks.marks
    print(f"{playback.span[1]:.1f} s are recorded; what happened:")
    for mark in marks:
        print(f"  {mark.t:5.2f} s  {mark.kind}: {mark.text}")

    (frame,) = playback.moment(3.0).frames
    print(f"at 3 s the real robot is {frame.behind:.3f} s behind, off by {frame.error:.1e} rad")

    for rate in (-4.0, 0.25):
        playback.seek(4.0, now=0.0)
        playback.play(now=0.0, rate=rate)
        places = watched(playback, 0.8)
        print(f"from 4 s at {rate:g}: at {places[-1]:.2f} s after 0.8 s")

    playback.play(now=0.0, rate=2.0)
    playback.set_loop(1.0, 2.0, now=0.0)
    places = watched(playback, 10.0)
    print(f"10 s of a loop at 2: {len(places)} frames from {min(places):.2f} to {max(places):.2f} s")
    exact = max(np.abs(playback.moment(t).frames[0].q_virtual - recording.timeline.sample(t)).max() for t in places)
    print(f"each shows g: off by at most {exact:.0e} rad")

    false = next(mark for mark in marks if mark.kind is MarkKind.FALSIFIED)
    playback.seek(false.t, now=0.0)
    playback.step(-1 / 60, now=0.0)
    before = recording.timeline_at(playback.place(now=0.0))
    print(f"a frame before {false.t} s a rest at {before.end:.2f} s was predicted; a command changed that")
