"""Many viewers of one server: what share of their frames they get and how old these are, and what they cost.

Readers are other processes on the same machine. `python -m benchmarks viewers [NAME ...]` measures some or all.
"""

from __future__ import annotations

import asyncio
import gc
import json
import os
import statistics
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import uvloop

from interfaces.engine_server.site import Site
from interfaces.stream.access import Access, hosts
from interfaces.stream.hub import Hub, HubConfig
from interfaces.stream.limits import ClientLimits
from interfaces.stream.server import HubServer, application
from interfaces.stream.sockets import KERNEL_BUFFER, bind, serve
from robots import puma560
from robots.onboard.lease import Lease
from vrs import Engine, JointTarget, ManualClock, MotionCommand
from vrs.clock import WallClock

MODEL = puma560.model()
HOME = MODEL.poses["nominal"]
READERS = Path(__file__).with_name("readers.py")
SECONDS = 10.0


class Idle:
    """A robot that is always at rest."""

    hub: Hub

    def began(self, grant: object, *, now: float) -> None:  # noqa: ARG002
        return

    def ended(self, ended: object, *, now: float) -> None:  # noqa: ARG002
        self.hub.stopped(now=now)

    def resume(self, epoch: int, *, now: float) -> str:  # noqa: ARG002
        return ""


class Bench:
    """A server in this process."""

    def __init__(self, rates: tuple[float, ...]) -> None:
        self.origin = time.monotonic()
        self.clock = WallClock(0.0)
        self.engine = Engine(MODEL, q=HOME, clock=ManualClock(self.clock.now()))
        self.site = Site(self.engine)
        robot = Idle()
        config = HubConfig(rates=rates, limits=ClientLimits(clients=2000))
        self.hub = robot.hub = Hub(self.site, Lease(), Access(), robot, config=config)
        self.server = HubServer(self.hub, self.clock)
        self.listening = bind()
        self.port = self.listening.getsockname()[1]
        self.rng = np.random.default_rng(1)
        self.readers: list[asyncio.subprocess.Process] = []

    async def start(self, processes: int) -> None:
        """Start readers' processes."""
        for _ in range(processes):
            self.readers.append(
                await asyncio.create_subprocess_exec(
                    sys.executable, str(READERS), str(self.port), repr(self.origin),
                    stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, limit=1 << 24,
                )
            )  # fmt: skip

    async def ask(self, which: int, **wish: Any) -> dict[str, Any]:
        """Have something done by a process of readers."""
        process = self.readers[which]
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps(wish).encode() + b"\n")
        return dict(json.loads(await process.stdout.readline()))

    async def ask_all(self, **wish: Any) -> list[dict[str, Any]]:
        """Have the same done by all."""
        return await asyncio.gather(*(self.ask(i, **wish) for i in range(len(self.readers))))

    async def end(self) -> None:
        """End the readers."""
        for process in self.readers:
            assert process.stdin is not None
            process.stdin.close()
            await process.wait()

    def move(self) -> float:
        """Carry out a command; how long that took [s]."""
        target = JointTarget(HOME + self.rng.uniform(-0.4, 0.4, 6))
        now = self.clock.now()
        self.site.time(now)
        command = MotionCommand(target, issued_at=now, speed=0.8)
        start = time.perf_counter()
        self.site.journal.execute(command)
        took = time.perf_counter() - start
        self.server.kick()
        return took

    async def keep_moving(self, period: float = 1.0) -> None:
        """A move every so often, for ever."""
        while True:
            self.move()
            await asyncio.sleep(period)

    async def worst_waiting(self) -> int:
        """Bytes that wait for whoever reads least, sampled for ever; cancel it to be told."""
        worst = 0
        try:
            while True:
                for client in list(self.server._clients.values()):
                    here = client.session.outbox.waiting + client.socket.waiting()
                    worst = max(worst, here + 2 * KERNEL_BUFFER)
                await asyncio.sleep(0.1)
        except asyncio.CancelledError:
            return worst


def follow(form: str, rate: float | None = None) -> dict[str, Any]:
    """The message that begins to follow."""
    return {"type": "follow", "number": 1, "form": form, "rate": rate}


def row(name: str, found: list[dict[str, Any]], busy: float, rate: float, seconds: float) -> dict[str, float]:
    """Print what readers found."""
    each = [reader for part in found for reader in part["found"]]
    ages = np.sort(np.concatenate([part["ages"] for part in found])) * 1e3
    shares = [min(frames / max(span, int(rate * seconds * 0.98)), 1.0) for frames, span, _, _ in each]
    p50, p99 = float(np.quantile(ages, 0.5)), float(np.quantile(ages, 0.99))
    lost = sum(reader[3] for reader in each)
    print(
        f"{name}: {len(each)} readers, worst share {100 * min(shares):.1f} %, mean {100 * np.mean(shares):.2f} %, "
        f"age median {p50:.1f} ms, p99 {p99:.1f} ms, lost {lost}; server {100 * busy:.0f} % of a core, "
        f"readers {100 * sum(part['busy'] for part in found):.0f} %; load {os.getloadavg()[0]:.1f}"
    )
    return {"share": min(shares), "p99": p99, "p50": p50}


async def run(
    bench: Bench, name: str, count: int, message: dict[str, Any], rate: float, *, seconds: float = SECONDS
) -> dict[str, float]:
    """Measure so many readers, split on the processes, that are connected and leave again."""
    await bench.ask_all(do="connect", count=count // len(bench.readers), follow=message)
    await asyncio.sleep(1.0)
    busy = time.process_time()
    found = await bench.ask_all(do="measure", seconds=seconds)
    share = (time.process_time() - busy) / seconds
    result = row(name, found, share, rate, seconds)
    await bench.ask_all(do="leave")
    await asyncio.sleep(0.5)
    return result


async def frames(bench: Bench) -> None:
    """60 Hz to 64, 50 Hz to 150, 500 by segments."""
    await run(bench, "frames, 60 Hz", 64, follow("frames", 60.0), 60.0)
    await run(bench, "frames, 50 Hz", 150, follow("frames", 50.0), 50.0)
    await run(bench, "segments (an edit a second)", 500, follow("segments"), 1.0)


async def stalled(bench: Bench) -> None:
    """Healthy readers in turns without and with one that reads nothing and one that drips."""
    worst: list[int] = []
    table: dict[bool, list[float]] = {False: [], True: []}
    for _ in range(3):
        for bad in (False, True):
            watcher = asyncio.create_task(bench.worst_waiting())
            if bad:
                await bench.ask(0, do="stall", count=1, follow=follow("frames", 50.0))
                await bench.ask(0, do="drip", count=1, follow=follow("frames", 50.0))
            name = "with a stalled and a dripping one" if bad else "healthy alone"
            found = await run(bench, name, 100, follow("frames", 50.0), 50.0, seconds=8.0)
            table[bad].append(found["p99"])
            watcher.cancel()
            worst.append(await watcher)
    ratio = statistics.median(table[True]) / statistics.median(table[False])
    print(f"p99 with them {ratio:.2f} times that without; most bytes of a client {max(worst)}; "
          f"{bench.server.cut_off} were cut off")  # fmt: skip


async def insertion(bench: Bench) -> None:
    """Time of an engine's insertion, in blocks with 100 viewers at 50 Hz and without, in turns.

    By the clock, and of the processor: viewers on the same machine take the processor from everybody.
    """
    found: dict[bool, list[tuple[float, float]]] = {False: [], True: []}
    for _ in range(10):
        for viewed in (False, True):
            if viewed:
                await bench.ask_all(do="connect", count=100 // len(bench.readers), follow=follow("frames", 50.0))
            await asyncio.sleep(0.3)
            for _ in range(200):
                busy = time.thread_time()
                took = bench.move()
                found[viewed].append((took, time.thread_time() - busy))
                await asyncio.sleep(0.02)
            if viewed:
                await bench.ask_all(do="leave")
    for i, kind in enumerate(("by the clock", "of the processor")):
        alone, viewed = (np.quantile(np.array(found[v])[:, i], [0.5, 0.99]) * 1e3 for v in (False, True))
        print(
            f"insertion {kind}: without viewers median {alone[0]:.3f}, p99 {alone[1]:.3f} ms; with 100 "
            f"{viewed[0]:.3f}, {viewed[1]:.3f} ms; p99 ratio {viewed[1] / alone[1]:.2f}"
        )


async def latency(bench: Bench) -> None:
    """From a command on a socket to the first changed frame, or edit, at a viewer."""
    for form in ("frames", "segments"):
        times = np.array((await bench.ask(0, do="latency", trials=100, form=form))["times"]) * 1e3
        print(
            f"command to first change, {form}: "
            f"median {np.median(times):.1f} ms, p99 {np.quantile(times, 0.99):.1f} ms, "
            f"worst {times.max():.1f} ms"
        )


async def churn(bench: Bench) -> None:
    """10,000 connects and disconnects: what is left."""
    process = psutil.Process()

    async def left() -> tuple[float, int, int, int]:
        await asyncio.sleep(3.0)
        gc.collect()
        return process.memory_info().rss / 2**20, process.num_fds(), len(asyncio.all_tasks()), bench.hub.seats

    await bench.ask(0, do="churn", count=500, follow=follow("frames", 50.0))
    print("after 500 connections: RSS {:.1f} MiB, {} handles, {} tasks, {} seats".format(*await left()))
    for _ in range(2):
        start = time.monotonic()
        await bench.ask(0, do="churn", count=5000, follow=follow("frames", 50.0))
        took = time.monotonic() - start
        print(
            f"5000 more in {took:.0f} s: " + "RSS {:.1f} MiB, {} handles, {} tasks, {} seats".format(*await left())
        )


async def measure(names: list[str]) -> None:
    """Measure some or all."""
    bench = Bench((60.0, 50.0, 10.0))
    app = application(bench.server.routes, hosts(["127.0.0.1"], bench.port))
    parts = {"frames": frames, "stalled": stalled, "latency": latency, "insertion": insertion, "churn": churn}
    # What is there from the beginning needn't be looked at by each full collection.
    gc.collect()
    gc.freeze()
    async with serve(app, bench.listening), bench.server.running():
        await bench.start(2)
        for name in names or parts:
            moving = asyncio.create_task(bench.keep_moving()) if name in {"frames", "stalled", "churn"} else None
            await parts[name](bench)
            if moving is not None:
                moving.cancel()
        await bench.end()


def main(names: list[str] | None = None) -> None:
    """Measure."""
    uvloop.run(measure(names or []))


if __name__ == "__main__":
    main(sys.argv[1:])
