"""Both live sites for tests: in one event loop where a test looks inside, as processes where it kills them."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from ssl import SSLContext
from typing import Any

import numpy as np

from interfaces.link import Conditions, LinkConditions, delay_profile
from interfaces.messages.control import Role
from interfaces.runtime.live.operator import LiveOperator, LiveOperatorConfig
from interfaces.runtime.live.physics_body import PhysicsBody
from interfaces.runtime.live.robot import LiveRobot
from interfaces.runtime.live.robot_server import LARGEST
from interfaces.runtime.physics import PhysicsConfig
from interfaces.runtime.physics_messages import Grips
from interfaces.stream import sockets
from interfaces.stream.access import OPEN, Access, hosts
from interfaces.stream.audit import AuditLog
from interfaces.stream.certificates import Certificate
from interfaces.stream.server import application
from interfaces.teleop import JointReference, RobotHostConfig, RobotSiteConfig
from robots import load
from robots.onboard.watchdog import WatchdogConfig
from robots.robot import IDEAL

ROBOT = load("puma560")
MODEL = ROBOT.arm
NOMINAL, READY = MODEL.poses["nominal"], MODEL.poses["ready"]
HALT = WatchdogConfig(max_age=2.0, max_uncertainty=1.0)
LEAD = 0.2
"""Of robots in tests [s]: other tests share the processor."""


class Rows:
    """What a robot's body was given, tick by tick."""

    def __init__(self, robot: LiveRobot) -> None:
        self.q: dict[int, Any] = {}
        assert isinstance(robot.body, PhysicsBody)
        physics = robot.body.physics
        assert physics is not None
        feed = physics.feed

        def noted(rows: JointReference, first: int, *, placed: bool = False, grips: Grips = ()) -> bool:
            for tick in [tick for tick in self.q if tick >= first]:
                del self.q[tick]
            for k in range(len(rows.q)):
                self.q[first + k] = np.concatenate([rows.q[k], rows.qd[k]])
            return feed(rows, first, placed=placed, grips=grips)

        physics.feed = noted  # type: ignore[method-assign]

    def until(self, tick: int) -> tuple[np.ndarray, np.ndarray]:
        """Ticks from the first to one, and q and qd in each, (k, 12); a gap holds what was before it."""
        ticks = np.arange(min(self.q), tick + 1)
        rows, last = [], self.q[int(ticks[0])]
        for k in ticks.tolist():
            last = self.q.get(k, last)
            rows.append(last)
        return ticks, np.array(rows)


@contextlib.asynccontextmanager
async def robot_here(
    *,
    site: RobotSiteConfig | None = None,
    body: str = IDEAL,
    port: int = 0,
    tls: SSLContext | None = None,
    audit: AuditLog | None = None,
    access: Access | None = None,
    datagrams: int | None = None,
) -> AsyncIterator[tuple[LiveRobot, str]]:
    """A robot's site in this loop, and its URL; it takes datagrams on the stream's port, or on another one."""
    host = RobotHostConfig(site=RobotSiteConfig(beat=0.03) if site is None else site, lead=LEAD)
    listening = sockets.bind("127.0.0.1", port)
    port = listening.getsockname()[1]
    made = PhysicsBody(PhysicsConfig(ROBOT, NOMINAL, body), host)
    robot = LiveRobot(made, Access(free={Role.SITE}) if access is None else access, audit=audit)
    app = application(robot.routes, hosts(["127.0.0.1"], port))
    udp = None if datagrams is None else socket.socket(type=socket.SOCK_DGRAM)
    if udp is not None:
        udp.bind(("127.0.0.1", 0 if datagrams else port))
    shaking = None if tls is None else lambda: tls
    async with sockets.serve(app, listening, largest=LARGEST, tls=shaking), robot.running(udp):
        await robot.ready()
        yield robot, f"{'ws' if tls is None else 'wss'}://127.0.0.1:{port}/site"


@contextlib.asynccontextmanager
async def operator_here(
    url: str,
    *,
    delay: str = "none",
    certificate: Certificate | None = None,
    token: str | None = None,
    say: Callable[[str], None] = lambda _: None,
    datagrams: bool = False,
) -> AsyncIterator[tuple[LiveOperator, str]]:
    """An operator's site in this loop, and its URL for programs."""
    listening = sockets.bind("127.0.0.1", 0)
    port = listening.getsockname()[1]
    link = LinkConditions.symmetric(Conditions(delay=delay_profile(delay)))
    config = LiveOperatorConfig(
        ROBOT, url, link, q=NOMINAL, robot_certificate=certificate, robot_token=token, say=say, datagrams=datagrams
    )
    operator = LiveOperator(config, Access(free=OPEN))
    app = application(operator.routes, hosts(["127.0.0.1"], port))
    async with sockets.serve(app, listening), operator.running():
        yield operator, f"ws://127.0.0.1:{port}/ws"


async def until(ready: Callable[[], Any], timeout: float = 20.0) -> None:
    """Wait until something is so."""
    async with asyncio.timeout(timeout):
        while not ready():
            await asyncio.sleep(0.005)


@dataclass(frozen=True)
class Lost:
    """What a robot did that lost its operator in mid-motion; times from the loss on [s]."""

    at: float
    """The loss, by the robot's clock."""
    said: str
    """Why it halted."""
    moved: bool
    """Whether it moved as it lost him."""
    halted: float
    """When it decided to brake: its lead before it brakes."""
    rested: float
    """When it stood."""
    excess: float
    """Largest speed, and change of speed in a tick, of what the limits allow."""
    went_on: float
    """How far a joint went after it had stood [rad]."""
    faults: int
    """How often the body came to rest by itself."""


async def lose_operator(
    robot: LiveRobot, rows: Rows, url: str, wait: float, number: int = signal.SIGKILL, *options: str
) -> Lost:
    """Let an operator's site of its own command a robot here, and kill or stop it in mid-motion.

    Args:
        robot: In this loop.
        rows: What its body is given.
        url: Of the robot's site.
        wait: From the last command to the signal [s].
        number: The signal. Who is stopped goes on after 1.5 s, with what it was sent meanwhile.
        options: More of `vrs serve`.
    """
    address = url.removeprefix("ws://").removesuffix("/site")
    async with child_beside("serve", "--port", "0", "--robot-at", address, *options) as server:
        # In a process of its own, so that it takes nothing of the robot's time.
        killer = await asyncio.create_subprocess_exec(
            sys.executable, str(Path(__file__).with_name("killer.py")),
            server.url.replace("http", "ws").replace("/view", "/ws"), str(server.process.pid), str(wait),
            str(number), stdout=asyncio.subprocess.PIPE,
        )  # fmt: skip
        assert killer.stdout is not None
        said, when = (await killer.stdout.readline()).split()
        assert said == b"sent"
        t_lost = float(when) - robot.clock.origin
        moved = bool(robot.host.reference(np.array([t_lost])).qd.any())
        await until(lambda: robot.host.site is not None and robot.host.site.halted, 3.0)
        t_halt = robot.clock.now()
        assert robot.host.site is not None
        reason = robot.host.site.halted
        await asyncio.sleep(1.5)
        if number == signal.SIGSTOP:
            server.kill(signal.SIGCONT)
            await asyncio.sleep(1.5)
        ticks, asked = rows.until(round(robot.clock.now() / 0.001))
        q, qd = asked[:, :6], asked[:, 6:]
        moving = np.flatnonzero(np.abs(qd).max(axis=1) > 0)
        last = int(moving[-1]) if len(moving) else 0
        limits = MODEL.limits
        excess = max(
            float((np.abs(np.diff(qd, axis=0)) / (limits.qdd_max * 1e-3)).max()),
            float((np.abs(np.diff(q, axis=0)) / (limits.qd_max * 1e-3)).max()),
        )
        stood = ticks >= 1e3 * (t_lost + HALT.timeout + 0.02 + 2 * float((limits.qd_max / limits.qdd_max).max()))
        went_on = float(np.ptp(q[stood], axis=0).max()) if stood.any() else np.inf
        await asyncio.wait_for(killer.wait(), 20.0)
        return Lost(
            t_lost, reason, moved, t_halt - t_lost, float(ticks[last]) * 1e-3 - t_lost, excess, went_on,
            robot.health()["faults"],
        )  # fmt: skip


@dataclass
class Child:
    """A `vrs` command in a process of its own."""

    process: subprocess.Popen[str]
    url: str
    """Where it listens: the first address that it said."""

    def health(self) -> dict[str, Any]:
        """What it says of itself."""
        base = self.url.replace("ws://", "http://").rsplit("/", 1)[0]
        try:
            with urllib.request.urlopen(f"{base}/health", timeout=5) as answer:
                facts: dict[str, Any] = json.load(answer)
        except urllib.error.HTTPError as refused:
            with refused:
                facts = json.load(refused)
        return facts

    def wait(self, ready: Callable[[dict[str, Any]], Any], timeout: float = 30.0) -> dict[str, Any]:
        """Wait until its health says so."""
        end = time.monotonic() + timeout
        while True:
            with contextlib.suppress(OSError):
                facts = self.health()
                if ready(facts):
                    return facts
            if time.monotonic() > end:
                raise TimeoutError(facts if "facts" in locals() else "it doesn't answer")
            time.sleep(0.02)

    def kill(self, number: int = signal.SIGKILL) -> None:
        """Send it a signal."""
        os.kill(self.process.pid, number)


@contextlib.contextmanager
def child(*arguments: str) -> Iterator[Child]:
    """Run a `vrs` command that says where it listens; it's ended in the end, or when this process is killed."""
    ends = ("--until-eof",) if arguments[0] in {"serve", "robot", "view"} else ()
    process = subprocess.Popen(
        [sys.executable, "-m", "interfaces.cli", *arguments, *ends],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    guard = threading.Timer(60.0, process.kill)
    guard.start()
    try:
        line = process.stdout.readline()
        guard.cancel()
        url = next(word.strip("()") for word in line.split() if "://" in word)
        yield Child(process, url)
    finally:
        guard.cancel()
        if process.poll() is None:
            process.send_signal(signal.SIGCONT)
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        process.stdin.close()
        process.stdout.close()


@contextlib.asynccontextmanager
async def child_beside(*arguments: str) -> AsyncIterator[Child]:
    """`child`, started and ended while this loop goes on."""
    running = child(*arguments)
    made = await asyncio.to_thread(running.__enter__)
    try:
        yield made
    finally:
        await asyncio.to_thread(running.__exit__, None, None, None)
