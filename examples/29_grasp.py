"""A hand that grasps: a VAL-II program takes a box by what friction holds, and feels whether it has it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from interfaces.link import delay_profile
from interfaces.recording.recording import open_recording
from interfaces.recording.run_recorders import RunRecorder
from interfaces.val2.playing import Listeners
from interfaces.val2.source import parse_file
from interfaces.val2.twins import play
from robots import load
from robots.things import Scene, read_scene

HERE = Path(__file__).resolve().parent / "val2"
OUT = Path("out") / "grasp.mcap"


def run(scene: Scene) -> None:
    """Run the program in a scene, and say where the box was before and after."""
    recorder = RunRecorder(OUT)
    source = parse_file((HERE / "13_grasp.v2").read_text(encoding="utf-8"), "13_grasp.v2")
    said = Listeners(typed=lambda text: print("the program says:", text.strip()))
    play(
        source, load("puma560"), delay_profile("constant:0.2"), seed=0, scene=scene, listeners=said, keeper=recorder
    )
    recorder.finish()
    with open_recording(OUT) as recording:
        for t in recording.span:
            x, y, z = recording.hands.poses(t)[0][:3]
            print(f"at {t:4.1f} s the box is at x {x:.2f}, y {y:.2f}, z {z:.2f} m")


if __name__ == "__main__":
    OUT.parent.mkdir(exist_ok=True)
    scene = read_scene(HERE / "13_grasp.toml")
    run(scene)
    # Two fingers with 40 N each and a friction of 0.7 hold 5.7 kg, and not a gram more.
    table, box, can = scene.things
    print("the same with 7 kg")
    run(Scene(scene.floor, (table, replace(box, mass=7.0), can)))
    print(f"try: vrs replay {OUT}; vrs serve --scene examples/val2/13_grasp.toml")
