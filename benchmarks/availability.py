"""Does who has control keep it, whatever others do? A command's round trip under load, halts, and the way back.

`python -m benchmarks availability`. The operator is a plain WebSocket by docs/protocol.md alone; server and loads
(`loads.py`) are processes of their own, all on loopback.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import psutil
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import WebSocketException
from websockets.typing import Subprotocol

from benchmarks.loads import LOADED, unverified
from benchmarks.results import Bar, Cost, Part, Result

SECONDS = 8.0
"""How long each load is measured."""
PERIOD = 0.05
"""Between commands [s]."""
ANSWER = 5.0
"""A command without an answer for so long counts as this late [s]."""
BACK = 3.0
"""An operator who was cut off is to be back within that [s]."""
P99 = 50.0
"""Largest p99 of a command's round trip [ms]."""
LOADS = Path(__file__).with_name("loads.py")
SCENARIOS = {
    "alone": "",
    "30 viewers at all they may send": "viewers",
    "2,048 idle sockets": "idle",
    "4,000 connections a second": "connections",
    "a flooded VAL-II port": "terminals",
    "64 that ask for frames and read none": "stalled",
    "256 that drip": "dripping",
    "8 viewers that flood": "flooding viewers",
    "8 operators that flood": "flooding operators",
}
BY_TLS = {
    "alone by TLS": "",
    "30 viewers at all they may send, by TLS": "viewers",
    "a flood of handshakes of TLS": "handshakes",
}
"""The same with a server that speaks TLS."""


class Ports(NamedTuple):
    """Where a server is."""

    page: int
    val: int
    token: str
    """Of the VAL-II port."""
    tls: bool
    process: psutil.Process


@contextlib.contextmanager
def served(directory: Path, *, tls: bool) -> Iterator[Ports]:
    """`vrs serve` with a robot of its own."""
    command = [sys.executable, "-m", "interfaces.cli", "serve", "--port", "0", "--val-port", "0",
               "--val-files", str(directory), "--until-eof", "--tls" if tls else "--no-tls"]  # fmt: skip
    pipe, kept = subprocess.PIPE, os.environ | {"XDG_STATE_HOME": str(directory)}
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=kept) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            lines = [process.stdout.readline() for _ in range(5 if tls else 4)]
            page = int(lines[1].rsplit(":", 1)[1].strip().rstrip("/"))
            yield Ports(page, int(lines[-2].split()[-1]), lines[-1].split()[-1], tls, psutil.Process(process.pid))
        finally:
            process.stdin.close()
            try:
                process.wait(15.0)
            except subprocess.TimeoutExpired:
                process.kill()


@contextlib.asynccontextmanager
async def load(kind: str, ports: Ports, seconds: float) -> AsyncIterator[list[str]]:
    """Put a load on for a time [s], nothing where its name is empty; how much it was is in the list afterwards."""
    found: list[str] = []
    if not kind:
        yield found
        return
    port = ports.val if kind == "terminals" else ports.page
    command = [sys.executable, str(LOADS), kind, str(port), str(seconds + BACK + 8.0), ports.token]
    command += ["tls"] if ports.tls else []
    pipe = subprocess.PIPE
    process = await asyncio.create_subprocess_exec(*command, stdin=pipe, stdout=pipe)
    try:
        assert process.stdout is not None
        assert process.stdin is not None
        assert await process.stdout.readline() == b"on\n"
        yield found
        process.stdin.close()
        async with asyncio.timeout(10.0):
            found.append((await process.stdout.readline()).decode().strip())
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.terminate()
        await process.wait()


@dataclass
class Operator:
    """Steers by a plain WebSocket, and notes when its commands are answered."""

    ports: Ports
    peer: ClientConnection
    session: str = ""
    epoch: str = ""
    number: int = 0
    offset: float = 0.0
    """Session time less ours [s]."""
    halted: list[str] = field(default_factory=list)
    """Why the robot stopped, each time."""
    state: dict[str, Any] = field(default_factory=dict)
    sent: dict[int, float] = field(default_factory=dict)
    took: list[float] = field(default_factory=list)
    """Round trips of commands [s]."""

    @classmethod
    async def join(cls, ports: Ports, session: str = "", *, wait: float = 30.0) -> Operator:
        """Connect within a time [s], perhaps to go on with a session, until the server has said welcome."""
        url, protocol = f"{'wss' if ports.tls else 'ws'}://127.0.0.1:{ports.page}/ws", Subprotocol("vrs.1.json")
        context = unverified() if ports.tls else None
        peer = await connect(
            url, subprotocols=[protocol], compression=None, proxy=None, open_timeout=wait, ssl=context
        )
        self = cls(ports, peer)
        hello = {"type": "hello", "protocol": 1, "role": "operator", "name": "Ada"}
        await self.send(hello | ({"session": session} if session else {}))
        welcome = await self.until("welcome", wait)
        self.session, self.offset = welcome["session"], welcome["now"] - time.monotonic()
        if session and not welcome.get("resumed"):
            raise TimeoutError("the session is gone")
        return self

    async def send(self, message: dict[str, Any]) -> None:
        """Send a message."""
        await self.peer.send(json.dumps(message))

    def take(self, text: str | bytes) -> dict[str, Any]:
        """Note what a message says."""
        message: dict[str, Any] = json.loads(text)
        kind = message["type"]
        if kind == "outcome":
            begun = self.sent.pop(message["number"], None)
            if begun is not None:
                self.took.append(time.monotonic() - begun)
        elif kind == "state" and message.get("connected", True):
            why = message.get("halted", "")
            if why and not self.state.get("halted"):
                self.halted.append(why)
            self.state = message
        elif kind == "lease":
            self.epoch = message["epoch"] if message.get("yours") else ""
        return message

    async def until(self, kind: str, wait: float = 1.0) -> dict[str, Any]:
        """Take messages until one of a kind comes; none is of the kind ''."""
        async with asyncio.timeout(wait):
            while True:
                message = self.take(await self.peer.recv())
                if message["type"] == kind:
                    return message

    async def command(self, *, settled: bool = True) -> None:
        """Send an input of steering, to and fro."""
        self.number += 1
        now = time.monotonic()
        rate = 0.1 if int(now) % 2 else -0.1
        command = {"type": "steer", "rates": [rate, 0, 0, 0, 0, 0], "issued_at": now + self.offset}
        if settled:
            self.sent[self.number] = now
        await self.send({"type": "order", "number": self.number, "epoch": self.epoch, "command": command})

    async def steer(self, enough: asyncio.Event) -> None:
        """Steer until it's enough, and wait for the answers."""
        reading = asyncio.create_task(self._read())
        with contextlib.suppress(WebSocketException):
            while not enough.is_set():
                await self.command()
                await asyncio.sleep(PERIOD)
            end = time.monotonic() + ANSWER
            while self.sent and time.monotonic() < end:
                await self.send({"type": "beat", "epoch": self.epoch})
                await asyncio.sleep(PERIOD)
        reading.cancel()
        await asyncio.gather(reading, return_exceptions=True)
        self.took += [ANSWER] * len(self.sent)
        self.sent.clear()

    async def _read(self) -> None:
        async for text in self.peer:
            self.take(text)

    async def ready(self) -> None:
        """Have control over a robot that follows."""
        async with asyncio.timeout(120.0):
            while not self.epoch or not self.state or self.state.get("halted"):
                if not self.epoch:
                    await self.send({"type": "acquire", "number": 1})
                elif self.state.get("halted"):
                    await self.send({"type": "resume", "number": 2, "epoch": self.epoch})
                else:
                    await self.send({"type": "beat", "epoch": self.epoch})
                with contextlib.suppress(TimeoutError):
                    await self.until("", 0.5)

    async def cut_off_and_back(self) -> tuple[Operator, float]:
        """Lose the connection; the new one, and how long it took until a command was answered [s]."""
        self.peer.transport.abort()
        begun = time.monotonic()
        while time.monotonic() < begun + 4 * BACK:
            try:
                other = await Operator.join(self.ports, self.session, wait=1.0)
                other.epoch, other.number, other.state = self.epoch, self.number, self.state
                await other.command(settled=False)
                await other.until("outcome")
            except (OSError, TimeoutError, WebSocketException):
                await asyncio.sleep(0.05)
            else:
                return other, time.monotonic() - begun
        return await Operator.join(self.ports), time.monotonic() - begun


async def _measure(ports: Ports, names: Iterable[str], seconds: float) -> list[Result]:
    results: list[Result] = []
    for name in names:
        operator = await Operator.join(ports)
        await operator.ready()
        enough = asyncio.Event()
        steering = asyncio.create_task(operator.steer(enough))
        await asyncio.sleep(1.0)
        operator.halted.clear()
        async with load((SCENARIOS | BY_TLS)[name], ports, seconds) as load_was:
            operator.took.clear()
            before = ports.process.cpu_times()
            await asyncio.sleep(seconds)
            after = ports.process.cpu_times()
            enough.set()
            await steering
            took = np.array(operator.took) * 1e3
            halted = operator.halted
            operator, back = await operator.cut_off_and_back()
        p50, p99, worst = np.quantile(took, [0.5, 0.99, 1.0]).tolist()
        worked = (after.user + after.system - before.user - before.system) / SECONDS
        results += [
            Result(f"a command's round trip, {name}", Cost(p50, p99), "ms", Bar(p99=P99),
                   note="; ".join([f"{len(took)} commands, worst {worst:.0f} ms", *load_was])),
            Result(f"the server's share of a processor, {name}", Cost(100.0 * worked), "%"),
            Result(f"halts, {name}", Cost(float(len(halted))), "", Bar(median=0.0), note="; ".join(halted)),
            Result(f"back after the connection was lost, {name}", Cost(back), "s", Bar(median=BACK)),
        ]  # fmt: skip
        with contextlib.suppress(OSError, TimeoutError, WebSocketException):
            await operator.send({"type": "release", "number": 3, "epoch": operator.epoch})
            await operator.peer.close()
        await asyncio.sleep(2.5)
    return results


def results(names: Iterable[str], seconds: float) -> list[Result]:
    """A command's round trip, halts and the way back, under some of the scenarios, each for a time [s]."""
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder)
        (directory / LOADED).write_text(
            ".PROGRAM flood()\n" + "  x = x + 1\n" * 80_000 + ".END\n", encoding="ascii"
        )
        results: list[Result] = []
        for tls, kinds in ((False, SCENARIOS), (True, BY_TLS)):
            chosen = [name for name in names if name in kinds]
            if chosen:
                with served(directory, tls=tls) as ports:
                    results += asyncio.run(_measure(ports, chosen, seconds))
        return results


def part() -> Part:
    """Measure."""
    return Part(
        "Availability",
        f"`vrs serve` and its robot, and an operator who steers every {1000 * PERIOD:g} ms for {SECONDS:g} s by a "
        "plain WebSocket: from sending a command to its outcome. Alone, then under loads from processes of their "
        "own on the same machine, one after the other: viewers at nine tenths of the messages they may send, most "
        "of them for edits; sockets that say nothing, half a request or no hello, opened again where they were "
        "closed; connections that come and go; a terminal that sends lines and loads a program of a megabyte as "
        "fast as it's let, beside others without a token; clients that read nothing or send a byte now and then; "
        "clients of each role that send all that they can, and come again when they're cut off; and with a server "
        "that speaks TLS, where the flood is of handshakes that a client begins by a first message made once, and "
        "leaves: the dear part is the server's. Under each the operator's connection is lost, and comes back with "
        "its session.",
        tuple(results([*SCENARIOS, *BY_TLS], SECONDS)),
    )
