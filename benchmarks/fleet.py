"""Fleets live on this machine: how many robots keep up with the clock, with bare bodies and with physics.

Each mobile robot is driven in a circle by a client of its own, in this process; a sixth of the robots are
arms that stand. A robot keeps up that leaves out no more than a thousandth of its control periods.
"""

from __future__ import annotations

import json
import os
import time
import urllib.request
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import psutil

from interfaces import connect_mobile
from interfaces.messages.control import Lease
from tests.interfaces.live_rig import child

SIZES = (8, 16, 24, 32)
SECONDS = 15.0
KEPT_UP = 0.999
FLEET = """
room = "hall.room"
[[robots]]
robot = "ipr"
name = "cart"
count = {carts}
body = "{body}"
[[robots]]
robot = "puma560"
name = "arm"
count = {arms}
body = "ideal"
"""
HALL = """room 1
name Hall
size 20 20
start 10 10 0
wall 0 0  20 0
wall 20 0  20 20
wall 20 20  0 20
wall 0 20  0 0
"""


def health(url: str) -> dict[str, object]:
    with urllib.request.urlopen(url, timeout=10) as answer:  # noqa: S310 - of a server that this process started
        found: dict[str, object] = json.load(answer)
    return found


def busy(server: psutil.Process) -> float:
    """Processor time that a server and its robots have taken [s]."""
    return sum(sum(one.cpu_times()[:2]) for one in (server, *server.children(recursive=True)))


def measure(size: int, body: str) -> tuple[float, int, float, float]:
    """Serve so many robots: least share of periods run, halts, processors at work, how long starting took [s]."""
    arms = size // 6
    with TemporaryDirectory() as folder, ExitStack() as stack:
        path = Path(folder) / "fleet.toml"
        path.write_text(FLEET.format(carts=size - arms, arms=arms, body=body))
        (path.parent / "hall.room").write_text(HALL)
        begun = time.monotonic()
        options = "--port", "0", "--jobs", f"{folder}/jobs.json", "--recordings", f"{folder}/kept"
        server = stack.enter_context(child("serve", "--robots", str(path), "--link-loss", "hold", *options))
        at = server.url.removesuffix("/")
        names = [f"cart-{k + 1}" for k in range(size - arms)] + [f"arm-{k + 1}" for k in range(arms)]
        if arms == 1:
            names[-1] = "arm"
        sites = [f"{at}/robots/{name}/health" for name in names]
        while not all(health(site)["connected"] for site in sites):
            time.sleep(0.5)
        started = time.monotonic() - begun
        carts = []
        for name in names[: size - arms]:
            cart = stack.enter_context(connect_mobile(f"{at.replace('http', 'ws')}/robots/{name}/ws"))
            while not (isinstance(lease := cart.acquire(), Lease) and lease.yours):
                time.sleep(0.1)
            carts.append(cart)
        bodies = [
            str(health(site)["robot_at"]).replace("ws", "http", 1).replace("/site", "/health") for site in sites
        ]
        ticks = [health(where)["ticks"] for where in bodies]
        processes = psutil.Process(server.process.pid)
        work, end = busy(processes), time.monotonic() + SECONDS
        while time.monotonic() < end:
            for cart in carts:
                cart.drive(0.1, 0.5)
            time.sleep(0.1)
        work = (busy(processes) - work) / SECONDS
        shares = []
        for before, where in zip(ticks, bodies, strict=True):
            after = health(where)["ticks"]
            run, left = (after[key] - before[key] for key in ("run", "skipped"))  # type: ignore[index]
            shares.append(run / (run + left))
        halted = sum(health(where)["halted"] != "" for where in bodies[: len(carts)])
    return min(shares), halted, work, started


def main() -> None:
    """Print a row for each size, until robots don't keep up."""
    print(f"{os.cpu_count()} processors")
    for body in ("bare", "bullet"):
        for size in SIZES:
            share, halted, work, started = measure(size, body)
            print(f"{body}: {size} robots: {share:.2%} of the periods run by the slowest, {halted} halted, "
                  f"{work:.2f} processors at work, there after {started:.0f} s")  # fmt: skip
            if share < KEPT_UP:
                break
