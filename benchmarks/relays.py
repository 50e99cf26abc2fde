"""1,000 viewers of relays: do all edits come in time, what does a second relay cost the hub, what if one is killed?

Router, hub with its robot, relays and viewers (`watchers.py`) are processes of their own, all on loopback, all of
this machine's cores. An edit's age counts from when its command is sent to the hub. `python -m benchmarks relays`.
"""

from __future__ import annotations

import contextlib
import json
import signal
import socket
import statistics
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from interfaces import connect
from interfaces.stream.connection import Connection
from interfaces.stream.remote import RemoteViewer
from vrs import JointTarget, MotionCommand

VIEWERS, PROCESSES, ROUNDS, SECONDS, PERIOD = 1000, 2, 3, 8.0, 0.25
"""Of viewers half are at each relay; a command every PERIOD [s]."""
LINKED, LINK_SECONDS = 50, 40.0
"""Viewers behind the bad link, and how long it's measured [s]."""
WATCHERS = Path(__file__).with_name("watchers.py")


def port() -> int:
    """A port that's free."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextlib.contextmanager
def running(*command: str) -> Iterator[subprocess.Popen[str]]:
    """A process that says a line when it's ready; it's ended in the end."""
    process = subprocess.Popen(
        [sys.executable, *command],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()


def said(process: subprocess.Popen[str]) -> str:
    """Its next line."""
    assert process.stdout is not None
    return process.stdout.readline()


@contextlib.contextmanager
def vrs(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """A command of ours."""
    with running("-m", "interfaces.cli", *arguments) as process:
        yield process


def health(at: int) -> dict[str, Any]:
    """What a server says of itself; nothing where it isn't well yet."""
    with contextlib.suppress(OSError), urllib.request.urlopen(f"http://127.0.0.1:{at}/health", timeout=5) as answer:
        return dict(json.load(answer))
    return {}


def wait(ready: Any, timeout: float = 60.0) -> None:
    """Wait until something is so."""
    end = time.monotonic() + timeout
    while not ready():
        if time.monotonic() > end:
            raise TimeoutError("it doesn't come")
        time.sleep(0.05)


class Viewers:
    """Processes of viewers."""

    def __init__(self, stack: contextlib.ExitStack, count: int, ports: Sequence[int]) -> None:
        each = str(count // PROCESSES)
        made = [running(str(WATCHERS), each, *map(str, ports)) for _ in range(PROCESSES)]
        self.processes = [stack.enter_context(one) for one in made]
        for process in self.processes:
            said(process)

    def ask(self, sent: dict[int, float]) -> list[dict[str, Any]]:
        """What came to each process."""
        found = []
        for process in self.processes:
            assert process.stdin is not None
            process.stdin.write(json.dumps(sent) + "\n")
            process.stdin.flush()
            found.append(json.loads(said(process)))
        return found


def command(robot: Connection, seconds: float, rng: np.random.Generator) -> dict[int, float]:
    """Let the robot move for some seconds; when each command was sent, by the machine's clock [s]."""
    sent, begun = {}, time.monotonic()
    while (now := time.monotonic()) < begun + seconds:
        target = JointTarget(robot.welcome.poses["nominal"] + rng.uniform(-0.3, 0.3, 6))
        receipt = robot.designer.issue(MotionCommand(target, speed=0.9), wait=5.0).receipt
        if receipt is not None and receipt.status != "rejected":
            sent[receipt.command_id] = now
        time.sleep(max(0.0, now + PERIOD - time.monotonic()))
    return sent


def spent(process: psutil.Process) -> float:
    """Processor time of a process [s]."""
    times = process.cpu_times()
    return float(times.user + times.system)


def shares(processes: dict[str, psutil.Process], before: dict[str, float], since: float) -> str:
    """Of a core, each."""
    took = time.monotonic() - since
    return ", ".join(f"{name} {(spent(one) - before[name]) / took:.2f}" for name, one in processes.items())


def ages_of(found: list[dict[str, Any]]) -> str:
    """How old edits were when they came."""
    ages = 1e3 * np.concatenate([part["ages"] for part in found])
    lost = sum(part["missing"] for part in found)
    p50, p99, worst = np.percentile(ages, [50, 99, 100])
    all_ = len(ages) + lost
    return f"{len(ages)} of {all_} edits arrived; median {p50:.1f} ms, p99 {p99:.1f} ms, worst {worst:.0f} ms"


@contextlib.contextmanager
def site(endpoint: str) -> Iterator[tuple[psutil.Process, Connection]]:
    """A hub that publishes, and who commands it."""
    at = port()
    options = ("--body", "ideal", "--link-loss", "hold", "--port", str(at), "--zenoh", endpoint, "--site", "bench")
    with vrs("serve", *options) as hub:
        said(hub)
        with connect(f"127.0.0.1:{at}", timeout=30.0) as robot:
            robot.acquire()
            wait(lambda: robot.state is not None and robot.state.connected and not robot.state.halted)
            yield psutil.Process(hub.pid), robot


def loaded() -> None:
    """1,000 viewers at two relays; then one of these is killed."""
    endpoint, rng = f"tcp/127.0.0.1:{port()}", np.random.default_rng(1)
    one, two = port(), port()

    def relay(at: int) -> tuple[str, ...]:
        return "view", "--zenoh", endpoint, "--port", str(at)

    with contextlib.ExitStack() as stack:
        router = stack.enter_context(vrs("router", "--listen", endpoint))
        said(router)
        hub, robot = stack.enter_context(site(endpoint))
        first = stack.enter_context(vrs(*relay(one)))
        wait(lambda: health(one).get("ok"))
        at_first = Viewers(stack, VIEWERS // 2, [one, two])
        costs: dict[int, list[float]] = {1: [], 2: []}
        for k in range(ROUNDS):
            begun, before = time.monotonic(), spent(hub)
            command(robot, SECONDS, rng)
            costs[1].append((spent(hub) - before) / (time.monotonic() - begun))
            with contextlib.ExitStack() as round_:
                second = round_.enter_context(vrs(*relay(two)))
                wait(lambda: health(two).get("ok"))
                at_second = Viewers(round_, VIEWERS // 2, [two, one])
                processes = {
                    "hub": hub, "relay 1": psutil.Process(first.pid), "relay 2": psutil.Process(second.pid),
                    "router": psutil.Process(router.pid), "viewers 1": psutil.Process(at_first.processes[0].pid),
                }  # fmt: skip
                since, known = time.monotonic(), {name: spent(process) for name, process in processes.items()}
                sent = command(robot, SECONDS, rng)
                costs[2].append((spent(hub) - known["hub"]) / (time.monotonic() - since))
                cores = shares(processes, known, since)
                time.sleep(1.0)
                found = at_first.ask(sent) + at_second.ask(sent)
                here = [health(at) for at in (one, two)]
                cut = ", ".join(f"{facts['clients']} there, {facts['cut_off']} cut off" for facts in here if facts)
                print(f"{VIEWERS} viewers, 2 relays, {len(sent)} commands: {ages_of(found)}; cores: {cores}; {cut}")
                if k == ROUNDS - 1:
                    first.send_signal(signal.SIGKILL)
                    sent = command(robot, 4.0, rng)
                    time.sleep(1.0)
                    back = [took for part in at_first.ask({}) for took in part["back"]]
                    there = sum(part["open"] for part in at_first.ask({}))
                    late = {k: t for k, t in sent.items() if t > min(sent.values()) + 2.5}
                    print(
                        f"relay 1 killed: {there} of {VIEWERS // 2} viewers at the other, after "
                        f"{statistics.median(back):.2f} s (median), {max(back):.2f} s (worst); then "
                        f"{ages_of(at_first.ask(late) + at_second.ask(late))}"
                    )
        ratio = statistics.median(costs[2]) / statistics.median(costs[1])
        print(
            f"the hub's processor time: {statistics.median(costs[1]):.3f} cores with one relay, "
            f"{statistics.median(costs[2]):.3f} with two: {ratio:.2f} times as much"
        )


def whole(seen: RemoteViewer, own: RemoteViewer) -> bool:
    """Whether a viewer has the timeline that another one has, bit by bit."""
    a, b = seen.timeline, own.timeline
    if a is None or b is None or (len(a), a.end) != (len(b), b.end):
        return False
    t = np.linspace(a.start, a.end, 2000)
    same = bool((a.sample(t) == b.sample(t)).all())
    return same and list(a.owners(0, len(a))) == list(b.owners(0, len(b)))


def linked() -> None:
    """Viewers at a relay whose router is behind an emulated internet."""
    near, far, between, at = f"tcp/127.0.0.1:{port()}", f"tcp/127.0.0.1:{port()}", port(), port()
    rng = np.random.default_rng(2)
    with contextlib.ExitStack() as stack:
        said(stack.enter_context(vrs("router", "--listen", near)))
        stack.enter_context(
            vrs("link", "--listen", str(between), "--to", near.rpartition(":")[2], "--delay", "mon",
                "--loss", "0.02", "--transport", "tcp")
        )  # fmt: skip
        time.sleep(2.0)
        said(stack.enter_context(vrs("router", "--listen", far, "--connect", f"tcp/127.0.0.1:{between}")))
        _, robot = stack.enter_context(site(near))
        stack.enter_context(vrs("view", "--zenoh", far, "--port", str(at)))
        wait(lambda: health(at).get("ok"))
        viewers, own = Viewers(stack, LINKED, [at]), robot.viewer()
        seen = stack.enter_context(connect(f"127.0.0.1:{at}", role="viewer", timeout=30.0)).viewer()
        sent = command(robot, LINK_SECONDS, rng)
        wait(lambda: whole(seen, own), 120.0)
        facts = health(at)
        print(
            f"mon with 2 % loss between routers: a viewer has all {len(own.timeline or ())} segments, bit by bit; "
            f"of {LINKED} viewers' edits by themselves {ages_of(viewers.ask(sent))} (fetched as a whole they "
            f"don't count); gaps found and filled: {facts.get('gaps')}, silent for 5 s: {facts['hubs'] - 1} times"
        )


def main() -> None:
    """Measure both."""
    loaded()
    linked()
