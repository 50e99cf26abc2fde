"""A live recording beside the robot's own log of the same run: does `vrs compare` say what the robot knows?

`python -m benchmarks recordings [--seconds N]`: a robot's site in a process of its own, which writes down what its
body measures 100 times a second; `vrs serve --record` in another, driven by a program on a socket, moves and
steering. Under `mon`, `wed`, and `mon` with 20 % loss, all at once; with adaptive D and a body with physics.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
import uvloop

from interfaces import connect
from interfaces.messages.control import Role
from interfaces.recording.recording import open_recording
from interfaces.recording.track import REAL
from interfaces.runtime.live.physics_body import PhysicsBody
from interfaces.runtime.live.robot import LiveRobot
from interfaces.runtime.live.robot_server import LARGEST
from interfaces.runtime.physics import TICK, Event, Feeder, PhysicsConfig
from interfaces.runtime.physics_messages import Measurement
from interfaces.stream import sockets
from interfaces.stream.access import Access, hosts
from interfaces.stream.server import application
from interfaces.system import module_process
from interfaces.teleop import RobotHostConfig, RobotSiteConfig
from robots import load
from vrs import Insertion, JointTarget, MotionCommand, SteerCommand
from vrs.comparison import agreement, compare_paths

ROBOT = load("puma560")
MODEL = ROBOT.arm
NOMINAL = MODEL.poses["nominal"]
SECONDS = 300.0
"""How long each is driven unless asked otherwise [s]."""
CASES = (("mon", "0"), ("wed", "0"), ("mon", "0.2"))
"""Delay and loss, both ways."""
AFTER = 20.0
"""How long a recording goes on after the last command [s]: the largest delay, and some more."""
LEAD = 0.3
"""How far ahead the body is told what to do [s]: three pairs of sites share the processor."""
BAR = 0.1
"""By how much the recording's figures may differ from the robot's."""


class LoggingBody(PhysicsBody):
    """A body that keeps what it measured, beside all that it tells the operator."""

    def __init__(self, physics: PhysicsConfig, host: RobotHostConfig) -> None:
        super().__init__(MODEL, physics, host)
        self.rows: list[list[float]] = []

    def _take(self, event: Event, feeder: Feeder, now: float) -> None:
        site = self.host.site
        if isinstance(event, Measurement) and site is not None:
            t = event.followed * TICK + self.host.offset
            play = float(site.play_at(np.array([t])).p[0])
            self.rows.append([t, play, *event.q, *event.q_ref])
        super()._take(event, feeder, now)


async def serve_robot(file: Path) -> None:
    """Be the robot until standard input ends; then write its log, and what its own timeline says."""
    host = RobotHostConfig(site=RobotSiteConfig(beat=1 / 60), lead=LEAD)
    body = LoggingBody(PhysicsConfig(ROBOT, NOMINAL), host)
    listening = sockets.bind("127.0.0.1", 0)
    port = listening.getsockname()[1]
    robot = LiveRobot(body, Access(free={Role.SITE}))
    app = application(robot.routes, hosts(["127.0.0.1"], port))
    async with sockets.serve(app, listening, largest=LARGEST), robot.running():
        await robot.ready()
        print(f"127.0.0.1:{port}", flush=True)
        ended = asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
        await ended
        site = body.host.site
        assert site is not None
        timeline, rows = site.engine.timeline, np.array(body.rows)
        np.savez(
            file, t=rows[:, 0], play=rows[:, 1], q=rows[:, 2:8], asked=rows[:, 8:14],
            virtual=timeline.sample(rows[:, 0]), matched=timeline.sample(rows[:, 1]),
            parted=site.parted, halted=site.halted, faults=body.faults,
        )  # fmt: skip


@contextlib.contextmanager
def process(module: str, *arguments: str, patience: float = 60.0) -> Iterator[IO[str]]:
    """Run a module whose end comes with that of its standard input; what it says on standard output."""
    command, environment = module_process(module, *arguments)
    running = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment, start_new_session=True
    )
    assert running.stdin is not None
    assert running.stdout is not None
    try:
        yield running.stdout
    finally:
        running.stdin.close()
        try:
            running.wait(patience)
        except subprocess.TimeoutExpired:
            running.kill()
            running.wait()
        running.stdout.close()


def operate(url: str, seconds: float) -> None:
    """Moves and steering by turns, as a program gives them."""
    with connect(url) as robot:
        robot.acquire()
        robot.wait(lambda r: r.state is not None and r.state.connected and not r.state.halted, 60.0)
        end, k = time.monotonic() + seconds, 0
        while time.monotonic() < end:
            away = np.array([0.6, 0.25, 0.25, 0.4, 0.3, 0.6]) * np.sin(1.3 * np.arange(1, 7) * (k + 1))
            robot.designer.issue(
                MotionCommand(JointTarget(NOMINAL + away), speed=0.5, insertion=Insertion.SPLICE), wait=5.0
            )
            time.sleep(2.5)
            until = time.monotonic() + 2.0
            rates = 0.25 * np.cos(2.0 * np.arange(6) + k)
            while time.monotonic() < until:
                robot.designer.issue(SteerCommand(rates=rates))
                time.sleep(0.04)
            k += 1
        time.sleep(AFTER)


def figures_there(log: Any, since: float, until: float, path: dict[str, Any]) -> dict[str, float]:
    """What the robot's own log says of a time [s], in the terms of `vrs compare`."""
    # A body that begins a motion late follows what was meant for an earlier time once more.
    newest = np.maximum.accumulate(np.append(-np.inf, log["t"][:-1]))
    rows = (log["t"] >= since - 1e-6) & (log["t"] <= until + 1e-6) & (log["t"] > newest)
    t, q = log["t"][rows], log["q"][rows]
    joints = agreement(MODEL, log["matched"][rows], q)
    virtual, real = (MODEL.forward(values)[:, :3, 3] for values in (log["virtual"][rows], q))
    found = compare_paths(t, virtual, real, v_max=path["v_max"], cell=path["cell"])
    assert found.path_error_mean is not None
    assert found.path_error_p95 is not None
    assert found.path_error_max is not None
    return {
        **{f"joint {k + 1} rms [deg]": float(np.degrees(x)) for k, x in enumerate(joints.joint_rms)},
        **{f"joint {k + 1} max [deg]": float(np.degrees(x)) for k, x in enumerate(joints.joint_max)},
        "tool rms [mm]": 1e3 * joints.tool_rms,
        "tool max [mm]": 1e3 * joints.tool_max,
        "path error, mean [mm]": 1e3 * found.path_error_mean,
        "path error, 95 % [mm]": 1e3 * found.path_error_p95,
        "path error, max [mm]": 1e3 * found.path_error_max,
    }


def figures_here(value: dict[str, Any]) -> dict[str, float]:
    """The same of `vrs compare --json`."""
    errors, path = value["errors"]["timeline_time"], value["path"]
    return {
        **{f"joint {k + 1} rms [deg]": x for k, x in enumerate(errors["joint_rms_deg"])},
        **{f"joint {k + 1} max [deg]": x for k, x in enumerate(errors["joint_max_deg"])},
        "tool rms [mm]": 1e3 * errors["tool_rms_m"],
        "tool max [mm]": 1e3 * errors["tool_max_m"],
        "path error, mean [mm]": 1e3 * path["path_error_mean"],
        "path error, 95 % [mm]": 1e3 * path["path_error_p95"],
        "path error, max [mm]": 1e3 * path["path_error_max"],
    }


def measure(delay: str, loss: str, seconds: float, folder: Path) -> list[str]:
    """Record a run, and say how its figures stand beside the robot's."""
    log, file = folder / "robot.npz", folder / "live.mcap"
    with process("benchmarks.recordings", "--robot", str(log)) as said:
        at = said.readline().strip()
        way = ("--delay", delay, "--loss", loss)
        options = ("--port", "0", "--record", str(file), "--until-eof", "--recordings", str(folder / "others"))
        with process("interfaces.cli", "serve", "--robot-at", at, *way, *options) as server:
            url = next(word.strip("()") for word in server.readline().split() if "://" in word)
            operate(url.removesuffix("/view"), seconds)
    command, environment = module_process("interfaces.cli", "compare", str(file), "--json")
    value = json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)
    with open_recording(file) as recording:
        t = recording.track(REAL).t
    with np.load(log) as kept:
        there = figures_there(kept, float(t[0]), float(t[-1]), value["path"])
        halted, parted = str(kept["halted"]), bool(kept["parted"])
    if halted:
        # Its timeline is another then than what the commands alone make, with which the recording is compared.
        return [f"{delay}, loss {loss}: nothing to compare, as the robot stopped by itself: {halted}"]
    here, gap = figures_here(value), value["gap_s"]
    length = float(t[-1] - t[0])
    lines = [f"{delay}, loss {loss}: {length:.0f} s, gap_s {gap:.2f} ({gap / length:.2%})"]
    if parted:
        lines.append("  a command was late: the recording is beside the commands' plan, the robot beside its own")
    for name, expected in there.items():
        apart = here[name] / expected - 1 if expected else 0.0
        verdict = "" if abs(apart) <= BAR else "  TOO FAR"
        lines.append(f"  {name:24s} recording {here[name]:9.4f}  robot {expected:9.4f}  {apart:+7.2%}{verdict}")
    if loss == "0" and gap > 0.01 * length:
        lines.append("  TOO MANY GAPS")
    return lines


def main(seconds: float = SECONDS) -> None:
    """Print the figures of both, for each case."""
    found: dict[int, list[str]] = {}
    with tempfile.TemporaryDirectory() as folder:

        def work(k: int) -> None:
            inside = Path(folder) / str(k)
            inside.mkdir()
            found[k] = measure(*CASES[k], seconds, inside)

        workers = [threading.Thread(target=work, args=(k,)) for k in range(len(CASES))]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
    print(f"{seconds:g} s of moves and steering each, adaptive D, physics; vrs compare beside the robot's own log")
    for k in sorted(found):
        print("\n".join(found[k]))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--robot"]:
        uvloop.run(serve_robot(Path(sys.argv[2])))
    else:
        main(*map(float, sys.argv[1:]))
