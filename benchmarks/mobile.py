"""How many times faster than real time the mobile robots run, on one core.

Robots take turns in blocks of ten control periods, so that a busy machine slows all of them; processor time counts.
A bare PyBullet step of the same world, beside the PyBullet robot, tells what is ours and what is PyBullet's.
"""

from __future__ import annotations

import math
import os
import statistics
import subprocess
import sys
import time
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING

from benchmarks.timing import seconds
from robots.bullet.vehicle import BulletVehicle
from robots.ipr.parameters import IPR, MICRO
from robots.mobile.body import MobileBody
from robots.mobile.chassis import Senses, SonarModel
from robots.mobile.robot import BareBody, MobileRobot

if TYPE_CHECKING:
    from benchmarks.results import Part, Result

PERIODS = 10
"""Control periods of 0.1 s a block."""
START = (1.2, 1.3, 0.0)
"""Where in the furnished room a slow circle meets nothing."""


def circle(body: MobileRobot) -> None:
    """Drive a block of a circle 0.3 m in radius."""
    for k in range(PERIODS):
        body.follow(0.15, 0.5 + 0.01 * math.sin(k))


def bare_steps(body: MobileBody, count: int) -> None:
    """Step a robot's world without anything around it."""
    assert isinstance(body.vehicle, BulletVehicle)
    step = body.vehicle.world.bullet.stepSimulation
    for _ in range(count):
        step()


def measure(blocks: int = 40) -> dict[str, float]:
    """Return times real time by robot, medians and bests of blocks, and what of PyBullet's robot PyBullet is."""
    sonar = Senses(sonar=SonarModel(), camera=None)
    blind = Senses(sonar=None, camera=None)
    found: dict[str, list[float]] = {}
    with (
        MobileBody(IPR, START, room="furnished", rng=1, world="bullet") as simulated,
        MobileBody(MICRO, START, room="furnished", rng=1, world="bullet") as micro,
        MobileBody(IPR, START, room="furnished", rng=1, world="mujoco") as mujoco,
        MobileBody(IPR, START, room="furnished", rng=1, world="bullet") as stepped,
    ):
        bodies: dict[str, MobileRobot] = {
            "simulated": simulated,
            "micro": micro,
            "mujoco": mujoco,
            "bare": BareBody(IPR, START, room="furnished", rng=1, senses=blind),
            "bare_sonar": BareBody(IPR, START, room="furnished", rng=1, senses=sonar),
        }
        actions = {name: partial(circle, body) for name, body in bodies.items()}
        actions["pybullet"] = partial(bare_steps, stepped, PERIODS * 24)
        for action in actions.values():
            action()
        for _ in range(blocks):
            for name, action in actions.items():
                found.setdefault(name, []).append(seconds(action) / (0.1 * PERIODS))
    result = {name: 1 / statistics.median(costs) for name, costs in found.items()}
    result |= {f"{name}_best": 1 / min(costs) for name, costs in found.items()}
    pairs = zip(found["pybullet"], found["simulated"], strict=True)
    result["pybullet_share"] = statistics.median(a / b for a, b in pairs)
    return result


def whole_runs(length: float = 60.0, rounds: int = 3) -> dict[str, float]:
    """Times real time of laboratory runs with links and metrics, by architecture, medians of rounds in turns.

    Of the time of the whole run: it goes on after the operator stopped.
    """
    from interfaces.lab.driving.run import run
    from interfaces.runs.drive_run import DriveCase
    from interfaces.teleop.architectures import ARCHITECTURES, Transport

    found: dict[str, list[float]] = {}
    for _ in range(rounds):
        for name in ARCHITECTURES:
            transport = Transport.DATAGRAMS if name == "timeline" else Transport.STREAM
            case = DriveCase(name, transport, "mon@3.3", "bare", "figure-eight", 1, length)
            start = time.process_time()
            drive = run(case)
            drive.compare()
            found.setdefault(name, []).append((time.process_time() - start) / float(drive.t[-1]))
    return {name: 1 / statistics.median(costs) for name, costs in found.items()} | {
        f"{name}_best": 1 / min(costs) for name, costs in found.items()
    }


EARLIER = os.environ.get("VRS_LAB_BESIDE", "")
"""Another checkout that runs take turns with, as one of commit 6c55945, from before the laboratory drove the sites
that run live; empty for none."""
WORKER = """
import sys, time
from interfaces.lab.driving.sweep import cases, measure
from interfaces.teleop.architectures import Transport
chosen = cases(["timeline"], [Transport.DATAGRAMS], ["mon@3.3"], ["bare"], ["mixed"], range(64), 120.0)
for line in sys.stdin:
    start = time.process_time()
    measure(chosen[int(line)])
    print(time.process_time() - start, flush=True)
"""
"""What runs laboratory runs of 120 s, by their seeds, and says what each took in processor time [s]."""


def beside(earlier: str, rounds: int = 20) -> tuple[list[float], list[float]]:
    """What runs take here and by another checkout, in turns, seed by seed [s]."""
    with ExitStack() as stack:
        pair = []
        for folder in (os.getcwd(), earlier):
            process = stack.enter_context(
                subprocess.Popen(
                    [sys.executable, "-c", WORKER],
                    cwd=folder,
                    env=os.environ | {"PYTHONPATH": folder},
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    text=True,
                )
            )
            pair.append(process)

        def took(process: subprocess.Popen[str], seed: int) -> float:
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write(f"{seed}\n")
            process.stdin.flush()
            return float(process.stdout.readline())

        costs = [[took(process, seed) for process in pair] for seed in range(rounds + 1)]
    ours, theirs = map(list, zip(*costs[1:], strict=True))
    return ours, theirs


def many_runs(count: int, length: float = 120.0) -> float:
    """Seconds by the clock that laboratory runs take on two workers, with metrics."""
    from interfaces.lab.driving.sweep import cases, measure
    from interfaces.lab.runner import pooled
    from interfaces.teleop.architectures import Transport

    chosen = cases(["timeline"], [Transport.DATAGRAMS], ["mon@3.3"], ["bare"], ["mixed"], range(count), length)
    start = time.perf_counter()
    pooled([(measure, (case,)) for case in chosen], workers=2)
    return time.perf_counter() - start


RUNS = int(os.environ.get("VRS_LAB_RUNS", "40"))
"""How many runs are timed on two workers; the bar is for 1,000."""


def _beside(earlier: str) -> Result:
    from benchmarks.results import Bar, Cost, Result

    ours, theirs = beside(earlier)
    ratio = statistics.median(b / a for a, b in zip(ours, theirs, strict=True))
    return Result(
        "a run of 120 s",
        Cost(1e6 * statistics.median(ours)),
        bar=Bar(ratio=0.91),
        peer="another checkout",
        theirs=Cost(1e6 * statistics.median(theirs)),
        ratio=ratio,
    )


def part() -> Part:
    """Measure."""
    from benchmarks.results import Bar, Cost, Part, Result
    from interfaces.teleop.architectures import ARCHITECTURES

    found = measure() | whole_runs()
    seconds = many_runs(RUNS)

    def row(what: str, name: str, asked: float | None, note: str = "") -> Result:
        bar = Bar(median=None if asked is None else 1e6 / asked)
        said = f"{found[name]:.0f} times real time, {found[f'{name}_best']:.0f} in the best block"
        return Result(what, Cost(1e6 / found[name]), bar=bar, note=said + note)

    share = f"; {100 * found['pybullet_share']:.0f} % of it is PyBullet's own step"
    return Part(
        "The mobile robots",
        "A second of a real robot's life in the furnished room, in processor time on one core, blocks of "
        f"{PERIODS} control periods of 0.1 s in turns. The simulated ones step at 1/240 s, with sonars at 10 Hz, "
        "camera at 30 Hz and encoders at 20 Hz.",
        (
            row("IPR in PyBullet, sonars and camera", "simulated", 20.0, share),
            row("micro-robot in PyBullet, sonars and camera", "micro", 20.0),
            row("IPR in MuJoCo, sonars and camera", "mujoco", 10.0),
            row("bare robot", "bare", 500.0),
            row("bare robot with sonars", "bare_sonar", None),
            *(row(f"a run by {name}, bare, with link and metrics", name, 250.0) for name in ARCHITECTURES),
            Result(
                f"a run of 120 s, of {RUNS} on two workers",
                Cost(1e6 * seconds / RUNS),
                bar=Bar(median=0.24e6),
                note=f"{seconds * 1000 / RUNS:.0f} s for 1,000",
            ),
            *((_beside(EARLIER),) if EARLIER else ()),
        ),
    )
