"""How old are orders when they come to the robot, by the stream alone and with datagrams beside it?

`python -m benchmarks datagrams`: both live sites with TLS and tokens over a way that loses packets: once between
two kernels (network namespaces, needs root), whose TCP is the system's, once over `vrs link`, whose model of TCP
waits a second for what is lost. A hand steers; each command is counted at the robot.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from socket import SOCK_DGRAM, socket
from typing import Any, NamedTuple

import numpy as np
from typing_extensions import override

from benchmarks.lossy import ROBOT as ROBOT_ADDRESS
from benchmarks.lossy import NamespaceError, lossy_kernels
from interfaces.cli.options import keep_quiet
from interfaces.link import LinkConditions
from interfaces.messages.control import Role
from interfaces.messages.sites import Orders, Report
from interfaces.runtime.live.datagrams import ROOM
from interfaces.runtime.live.operator import LiveOperator, LiveOperatorConfig
from interfaces.runtime.live.robot import LiveBody, LiveRobot
from interfaces.runtime.live.robot_server import LARGEST
from interfaces.stream import sockets
from interfaces.stream.access import OPEN, Access, hosts, make_token
from interfaces.stream.certificates import own_certificate
from interfaces.stream.codec import Encoding, encode
from interfaces.stream.meshcat.meshes import bodies
from interfaces.stream.server import application
from interfaces.system import hasten, run_loop
from interfaces.teleop import RobotHost, RobotHostConfig, RobotSiteConfig
from interfaces.teleop.samples import PERIOD as PERIOD_MEASURED
from robots import load
from robots.onboard.watchdog import WatchdogConfig
from vrs import SteerCommand
from vrs.clock import WallClock
from vrs.model import Array

SECONDS = float(os.environ.get("VRS_DATAGRAMS_SECONDS", "40"))
LOSSES = (0.01, 0.05, 0.1)
DELAY = 0.05
"""Of each packet, one way [s]."""
PERIOD = 0.05
"""Between two commands [s]."""
TIMEOUT = WatchdogConfig().timeout
"""T_loss under `halt` [s]."""
HASTENED = "from interfaces.system import hasten; hasten(2); from interfaces.cli import main; main()"
"""`vrs`, ahead of other processes of this machine, as the sites are."""
KERNELS, PROXY = "kernels", "vrs link"
ROBOT = load("puma560")
NOMINAL = ROBOT.arm.poses["nominal"]


class _Still(LiveBody):
    """A body that is where it should be, and in no process of its own: what is measured is the way."""

    watchdog = None

    def __init__(self) -> None:
        self.name, self.clock = ROBOT.name, WallClock()
        config = RobotHostConfig(site=RobotSiteConfig(beat=1.0 / 30.0))
        self.host: RobotHost = RobotHost(ROBOT.arm, NOMINAL, now=self.clock.now(), config=config, seed=1)
        self._measured = self.clock.now()

    @property
    @override
    def q(self) -> Array:
        return self.host.reference(np.array([self._measured])).q[0]

    @override
    @contextlib.asynccontextmanager
    async def running(self, soon: Callable[[], None]) -> AsyncIterator[None]:
        yield

    @override
    def advance(self, *, now: float) -> tuple[Any, ...]:
        if now >= self._measured + PERIOD_MEASURED:
            self._measured = now
            self.host.measured(self.q, at=now, now=now)
        return super().advance(now=now)

    @override
    def next_deadline(self) -> float:
        return min(super().next_deadline(), self._measured + PERIOD_MEASURED)

    @override
    def health(self) -> dict[str, Any]:
        return {}


class Figures(NamedTuple):
    """Of a run."""

    commands: tuple[float, float, float]
    """Age of commands at the robot when they and all before them have come: p50, p99, largest [s]."""
    orders: tuple[float, float, float]
    """Of the newest order that the robot's site has, over time [s]."""
    reports: tuple[float, float, float]
    """Of the newest report that the operator's site has, over time [s]."""
    share: float
    """Of reports that fit in a datagram."""
    stops: int
    """How often nothing came for T_loss that wasn't older than that: so often a robot would halt."""
    given: int
    """Commands."""
    lost: int
    doubled: int
    apart: float
    """Largest difference of the robot's timeline from the operator's [rad]."""


def _quantiles(ages: Array) -> tuple[float, float, float]:
    p50, p99, most = np.quantile(ages, (0.5, 0.99, 1.0)).tolist()
    return p50, p99, most


def _known(came: list[tuple[float, float]]) -> Array:
    """How old the newest is of what has come, millisecond by millisecond [s].

    Args:
        came: When each came and was sent [s], in the order of coming.
    """
    at, sent = np.array(came).T
    t = np.arange(at[0], at[-1], 1e-3)
    ages: Array = t - np.maximum.accumulate(sent)[np.searchsorted(at, t, "right") - 1]
    return ages


def _listen(host: str) -> tuple[socket, socket]:
    """Where a robot's site listens: its stream, and datagrams to the same port."""
    stream = sockets.bind(host, 0)
    datagrams = socket(type=SOCK_DGRAM)
    datagrams.bind(stream.getsockname())
    return stream, datagrams


@contextlib.contextmanager
def _way(kind: str, loss: float, seed: int) -> Iterator[tuple[tuple[socket, socket], str]]:
    """Where the robot listens, and the address that its operator's site has for that."""
    if kind == KERNELS:
        with lossy_kernels(lambda: _listen(ROBOT_ADDRESS), loss, DELAY, seed) as listening:
            yield listening, f"{ROBOT_ADDRESS}:{listening[0].getsockname()[1]}"
        return
    listening = _listen("127.0.0.1")
    command = (
        sys.executable, "-c", HASTENED, "link", "--listen", "0", "--loss", str(loss), "--seed", str(seed),
        "--to", f"127.0.0.1:{listening[0].getsockname()[1]}", "--delay", f"constant:{DELAY}",
    )  # fmt: skip
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as proxy:
        assert proxy.stderr is not None
        yield listening, proxy.stderr.readline().split("listens on ")[1].split()[0]
        proxy.terminate()


def measured(kind: str, loss: float, datagrams: bool, seed: int) -> Figures:
    """Both sites in this process, so that their clocks are one, over a way that loses packets."""
    with tempfile.TemporaryDirectory() as directory, _way(kind, loss, seed) as (listening, address):
        return run_loop(_measured(Path(directory), listening, address, datagrams=datagrams))


async def _measured(directory: Path, listening: tuple[socket, socket], address: str, *, datagrams: bool) -> Figures:
    shown = own_certificate(directory / "robot.pem", ["127.0.0.1", ROBOT_ADDRESS])
    theirs = own_certificate(directory / "site.pem", (), client=True)
    token = make_token()
    robot = LiveRobot(_Still(), Access({Role.SITE: token}, free=()))
    url = f"wss://{address}/site#sha256={shown.fingerprint}"
    operator = LiveOperator(
        LiveOperatorConfig(
            ROBOT,
            url,
            LinkConditions(),
            q=NOMINAL,
            robot_token=token,
            robot_certificate=theirs,
            datagrams=datagrams,
        ),
        Access(free=OPEN),
    )
    here, clock = operator.operator, operator.clock
    came: list[tuple[float, float]] = []
    carried: list[float] = []
    reports: list[tuple[float, float]] = []
    fitting: list[bool] = []
    done: Counter[float | None] = Counter()
    early: dict[int, float] = {}
    sent: dict[int, float] = {}
    hear, tell, take = robot.host.receive, robot.host.advance, operator.line.receive

    def heard(message: Any, *, now: float) -> None:
        if isinstance(message, Orders) and message.epoch == here.epoch and begun:
            came.append((clock.now(), message.sent_at))
            early.update({entry.number: entry.at for entry in message.entries if entry.number > len(carried)})
            while (at := early.pop(len(carried) + 1, None)) is not None:
                carried.append(clock.now() - at)
        hear(message, now=now)

    def told(*, now: float) -> tuple[Any, ...]:
        messages = tell(now=now)
        sent.update({message.number: clock.now() for message in messages if isinstance(message, Report)})
        return messages

    def taken(message: Any, *, now: float) -> None:
        if isinstance(message, Report) and begun:
            reports.append((clock.now(), sent[message.number]))
            fitting.append(len(encode(message, Encoding.MSGPACK)) <= ROOM)
        take(message, now=now)

    robot.host.receive, robot.host.advance, operator.line.receive = heard, told, taken  # type: ignore[method-assign]
    begun = False
    stream, udp = listening
    app = application(robot.routes, hosts([address.split(":", maxsplit=1)[0]], int(address.split(":")[1])))
    serving = sockets.serve(app, stream, largest=LARGEST, tls=shown.server_context(theirs.chain))
    bodies(ROBOT)
    keep_quiet()
    hasten(1)
    async with serving, robot.running(udp), operator.running():
        await robot.ready()
        async with asyncio.timeout(60):
            while here.halted:
                here.resume(now=clock.now())
                await asyncio.sleep(0.01)
            while robot.host.site is None or robot.host.site.epoch != here.epoch:
                await asyncio.sleep(0.01)
        begun, begin = True, clock.now()
        following: Any = robot.host.site
        execute, given = following.engine.execute, []

        def executed(command: Any) -> Any:
            done[command.issued_at] += 1
            return execute(command)

        following.engine.execute = executed
        while (now := clock.now()) < begin + SECONDS:
            here.robot.execute(SteerCommand(0.3 * np.sin(now + np.arange(6.0)), issued_at=now), now=now)
            given.append(now)
            operator.robot._changed()
            await asyncio.sleep(PERIOD)
        # What is missing may come yet, and what came again.
        await asyncio.sleep(5.0)
        mine, other = here.robot.engine.timeline, following.engine.timeline
        t = np.linspace(begin, mine.end, 10_000)
        apart = float(np.abs(mine.sample(t) - other.sample(t)).max())
    fresh = [at for at, stamp in came if at - stamp <= TIMEOUT]
    return Figures(
        _quantiles(np.array(carried)), _quantiles(_known(came)), _quantiles(_known(reports)),
        float(np.mean(fitting)), int((np.diff(fresh) > TIMEOUT).sum()), len(given), len(set(given) - set(done)),
        sum(done.values()) - len(done), apart,
    )  # fmt: skip


def main() -> None:
    """Print the figures of each way and loss, by the stream alone and with datagrams."""
    congestion = Path("/proc/sys/net/ipv4/tcp_congestion_control")
    kernel = congestion.read_text(encoding="ascii").strip() if congestion.is_file() else "unknown"
    print(f"{SECONDS:g} s each, {1e3 * DELAY:g} ms one way, a command each {1e3 * PERIOD:g} ms")
    print(f"ages [ms]: p50, p99, largest; the system's TCP: {kernel}")
    print(
        "| between | loss | by | commands | newest order | newest report | halts | given, lost, doubled | apart |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for kind in (KERNELS, PROXY):
        for seed, loss in enumerate(LOSSES):
            for datagrams in (False, True):
                with ProcessPoolExecutor(1, get_context("spawn")) as process:
                    try:
                        found = process.submit(measured, kind, loss, datagrams, seed).result()
                    except NamespaceError as error:
                        print(f"| {kind} | none here: {error} |")
                        break
                ages = (", ".join(f"{1e3 * age:.0f}" for age in row) for row in found[:3])
                by = "datagrams, too" if datagrams else "stream"
                counts = f"{found.given}, {found.lost}, {found.doubled}"
                row = kind, f"{loss:.0%}", by, *ages, str(found.stops), counts, f"{found.apart:g} rad"
                print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
