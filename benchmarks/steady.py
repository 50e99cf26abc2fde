"""Does the memory of `vrs serve` and its robot stay flat? Viewers, one that reads nothing, a move a second.

`python -m benchmarks steady`: ten minutes; VRS_STEADY_MINUTES changes that.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil

from benchmarks.readers import stuck
from benchmarks.viewers import follow
from interfaces import connect
from robots import puma560
from vrs import Insertion, JointTarget, MotionCommand

MINUTES = float(os.environ.get("VRS_STEADY_MINUTES", "10"))
VIEWERS = 64
PERIOD = 15.0
"""Time between two looks at the memory [s]."""
READERS = Path(__file__).with_name("readers.py")
HOME = puma560.model().poses["nominal"]


@contextlib.contextmanager
def served(*options: str) -> Iterator[tuple[int, psutil.Process]]:
    """`vrs serve` with a robot of its own: its port and its process."""
    command = [sys.executable, "-m", "interfaces.cli", "serve", "--port", "0", "--delay", "domain", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            url = next(word for word in process.stdout.readline().split() if "://" in word)
            yield int(url.split(":")[2].split("/")[0]), psutil.Process(process.pid)
        finally:
            process.terminate()


@contextlib.contextmanager
def viewers(port: int) -> Iterator[None]:
    """A process of viewers that follow frames."""
    command = [sys.executable, str(READERS), str(port), "0.0"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        wish = {"do": "connect", "count": VIEWERS, "follow": follow("frames", 60.0)}
        process.stdin.write(json.dumps(wish) + "\n")
        process.stdin.flush()
        process.stdout.readline()
        yield
        process.stdin.close()


def main() -> None:
    """Print the memory of both sites over time, and how much more it is at the end."""
    rng = np.random.default_rng(1)
    looks: list[tuple[float, float]] = []
    with (
        served() as (port, server),
        viewers(port),
        connect(f"127.0.0.1:{port}") as robot,
        contextlib.closing(stuck(port, follow("frames", 60.0))),
    ):
        robot.acquire()
        begin = time.monotonic()
        looked, halted = begin, ""
        while time.monotonic() < begin + 60.0 * MINUTES:
            target = JointTarget(HOME + rng.uniform(-0.3, 0.3, 6))
            robot.designer.issue(MotionCommand(target, speed=0.8, insertion=Insertion.REPLACE), wait=1.0)
            time.sleep(1.0)
            if robot.state is not None and robot.state.halted != halted:
                halted = robot.state.halted
                print(f"{time.monotonic() - begin:6.0f} s  the robot {halted or 'goes on'}", flush=True)
            if halted:
                # Refused until the virtual robot has come to where the real one stands.
                robot.resume()
            if time.monotonic() >= looked + PERIOD:
                looked = time.monotonic()
                sites = [server, *server.children(recursive=True)]
                looks.append((looked - begin, sum(site.memory_info().rss for site in sites) / 2**20))
                print(f"{looks[-1][0]:6.0f} s  {looks[-1][1]:.1f} MiB in {len(sites)} processes", flush=True)
    settled = np.array([look for look in looks if look[0] > 60.0 * MINUTES / 5])
    slope = np.polyfit(settled[:, 0] / 60.0, settled[:, 1], 1)[0]
    print(f"{slope:+.3f} MiB a minute after the first fifth")


if __name__ == "__main__":
    main()
