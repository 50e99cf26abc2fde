"""Thirty at one server: they come in by a code, ask for control, get it, lose it; `python -m benchmarks classroom`.

Each is a plain WebSocket by docs/protocol.md alone, and follows frames at 60 a second all the time. In turns with
that as many are at a server without a class, where one has control: how old frames are, how long orders take.
"""

from __future__ import annotations

import asyncio
import contextlib
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator
from itertools import islice, pairwise
from typing import Any, NamedTuple

import msgspec
import numpy as np
import psutil
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

PUPILS = 30
RATE = 60.0
"""Frames a second that each follows."""
ORDERS = 20
"""Orders of each who gets control, and how far they are apart [s]."""
APART = 0.03
BLOCKS = 2
"""Servers of each kind, in turns."""
TURNS = 12
"""Pupils who get control at each server, one after the other."""
QUICKLY = 1.0
"""So long it may take to come in, to be answered, to get control, and to hear that it's lost [s]."""
OLDEST = 0.1
"""95 % of frames may be so old [s]."""
SLOWER = 1.25
"""Orders may take so many times as long as without a class, for these machines are noisy."""
_encode, _decode = msgspec.json.Encoder().encode, msgspec.json.Decoder().decode


class Server(NamedTuple):
    """Where one is, and what it has printed."""

    port: int
    lines: list[str]
    process: psutil.Process

    def code(self, role: str) -> str:
        """The code of a role, `watch` or `operate`."""
        line = next(line for line in self.lines if f"vrs: to {role}: " in line)
        return line.rstrip().rpartition("?code=")[2]

    def busy(self) -> float:
        """The processor's time that it has taken, without its robot's [s]."""
        return float(sum(self.process.cpu_times()[:2]))

    @property
    def token(self) -> str:
        """The teacher's."""
        return next(line for line in self.lines if "token of the teacher" in line).split()[-1]


@contextlib.contextmanager
def served(*options: str, lines: int) -> Iterator[Server]:
    """`vrs serve` with a robot of its own, which prints so many lines."""
    command = [sys.executable, "-m", "interfaces.cli", "serve", "--port", "0", "--until-eof", *options]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            said = [process.stdout.readline() for _ in range(lines)]
            yield Server(int(said[1].rsplit(":", 1)[1].strip().rstrip("/")), said, psutil.Process(process.pid))
        finally:
            process.stdin.close()
            try:
                process.wait(15.0)
            except subprocess.TimeoutExpired:
                process.kill()


class Pupil:
    """A client: what it was told last, how old its frames were, and how long its orders took."""

    def __init__(self, peer: ClientConnection) -> None:
        self.peer = peer
        self.role = self.session = ""
        self.lease: dict[str, Any] = {}
        self.state: dict[str, Any] = {}
        self.present: dict[str, Any] = {}
        self.ages: list[float] = []
        self.took: list[float] = []
        self._offset, self._trip = 0.0, float("inf")
        """Session time less ours, by the quickest round trip [s]."""
        self._sent: dict[int, float] = {}
        self._asked: dict[int, float] = {}
        self._answered: dict[int, float] = {}
        self._number = self._orders = 0
        self._told = asyncio.Event()
        self._reading = asyncio.create_task(self._read())

    @classmethod
    async def join(cls, port: int, name: str, role: str, token: str | None) -> tuple[Pupil, float]:
        """Come in; the pupil, and how long that took [s]."""
        begun = time.monotonic()
        url, protocol = f"ws://127.0.0.1:{port}/ws", Subprotocol("vrs.1.json")
        pupil = cls(await connect(url, subprotocols=[protocol], compression=None, proxy=None, max_size=None))
        await pupil.send({"type": "hello", "protocol": 1, "role": role, "name": name, "token": token})
        await pupil.until(lambda: pupil.lease)
        return pupil, time.monotonic() - begun

    async def send(self, message: dict[str, Any]) -> None:
        """Send a message."""
        await self.peer.send(_encode(message).decode())

    async def _read(self) -> None:
        async for text in self.peer:
            self._take(_decode(text), time.monotonic())

    def _take(self, message: dict[str, Any], now: float) -> None:
        kind = message["type"]
        if kind == "broadcast":
            if self._trip < float("inf"):
                self.ages.append(now + self._offset - message["made_at"])
            return
        if kind == "pong":
            trip = now - message["t"]
            if trip < self._trip:
                self._trip, self._offset = trip, message["received"] - (now + message["t"]) / 2
        elif kind == "outcome":
            if message["number"] in self._sent:
                self.took.append(now - self._sent.pop(message["number"]))
        elif kind == "problem":
            raise RuntimeError(message["text"])
        elif kind == "welcome":
            self.role, self.session, self.lease = message["role"], message["session"], message["lease"]
        elif kind in {"lease", "state", "present"}:
            setattr(self, kind, message)
        if "answers" in message:
            self._answered[message["answers"]] = now
        self._told.set()

    async def until(self, ready: Callable[[], Any], wait: float = 60.0) -> float:
        """Wait until something was told; how long that took [s]."""
        begun = time.monotonic()
        async with asyncio.timeout(wait):
            while not ready():
                if self._reading.done():
                    self._reading.result()
                self._told.clear()
                await self._told.wait()
        return time.monotonic() - begun

    def is_offered(self) -> bool:
        """Whether control is offered to it."""
        return "offered_until" in self.lease

    def has_control(self) -> bool:
        """Whether it has control."""
        return bool(self.lease.get("yours"))

    def has_none(self) -> bool:
        """Whether somebody else has it, or nobody."""
        return not self.has_control()

    def sees_free(self) -> bool:
        """Whether nobody has it."""
        return bool(self.lease["state"] == "free")

    def sees(self, holder: Pupil) -> Callable[[], bool]:
        """Says whether it sees by the list of those present that somebody has control."""
        return lambda: bool(self.present.get("holder") == holder.lease["member"])

    async def ask(self, kind: str, **fields: Any) -> float:
        """Ask something; how long the answer took [s]."""
        self._number += 1
        number, begun = self._number, time.monotonic()
        await self.send({"type": kind, "number": number, **fields})
        await self.until(lambda: number in self._answered)
        return self._answered.pop(number) - begun

    async def follow(self) -> None:
        """Follow frames, and know the clock."""
        await self.send({"type": "follow", "number": 1, "form": "frames", "rate": RATE})
        # Clocks are compared when everybody has come in.
        await asyncio.sleep(0.5)
        for number in range(1, 17):
            await self.send({"type": "ping", "number": number, "t": time.monotonic()})
            await asyncio.sleep(0.01)

    async def order(self) -> None:
        """Steer to and fro, each input when it's time."""
        for k in range(ORDERS):
            self._orders += 1
            self._sent[self._orders] = now = time.monotonic()
            rates = [0.1 if k < ORDERS / 2 else -0.1, 0, 0, 0, 0, 0]
            command = {"type": "steer", "rates": rates, "issued_at": now + self._offset}
            await self.send(
                {"type": "order", "number": self._orders, "epoch": self.lease["epoch"], "command": command}
            )
            await asyncio.sleep(APART)
        await self.until(lambda: not self._sent)

    async def leave(self) -> None:
        """Go."""
        self._reading.cancel()
        await self.peer.close()


@contextlib.asynccontextmanager
async def joined(server: Server, token: str | None) -> AsyncIterator[tuple[list[Pupil], list[float]]]:
    """All pupils, who follow frames; how long it took each to come in [s]."""
    found = await asyncio.gather(
        *(Pupil.join(server.port, f"pupil {k}", "operator", token) for k in range(1, PUPILS + 1))
    )
    pupils = [pupil for pupil, _ in found]
    await asyncio.gather(*(pupil.follow() for pupil in pupils))
    await pupils[0].until(lambda: pupils[0].state.get("connected", True) and pupils[0].state)
    yield pupils, [took for _, took in found]
    await asyncio.gather(*(pupil.leave() for pupil in pupils))


Figures = dict[str, list[float]]


@contextlib.contextmanager
def measured(figures: Figures, server: Server, pupils: list[Pupil], kind: str) -> Iterator[None]:
    """Note how old frames are meanwhile, how long orders take, and the server's processor time a frame."""
    for pupil in pupils:
        pupil.ages.clear()
    busy = server.busy()
    yield
    frames = sum(len(pupil.ages) for pupil in pupils)
    figures.setdefault(f"processor a frame, {kind}", []).append((server.busy() - busy) / frames)
    figures.setdefault(f"age of a frame, {kind}", []).extend(age for pupil in pupils for age in pupil.ages)
    figures.setdefault(f"order to answer, {kind}", []).extend(took for pupil in pupils for took in pupil.took)


async def without(figures: Figures) -> None:
    """As many without a class: each of some acquires control, orders and releases it."""
    with served(lines=2) as server:
        async with joined(server, None) as (pupils, _):
            await asyncio.sleep(1.0)
            with measured(figures, server, pupils, "without a class"):
                for pupil in pupils[:TURNS]:
                    await pupil.until(pupil.sees_free)
                    await pupil.ask("acquire")
                    await pupil.order()
                    await pupil.ask("release", epoch=pupil.lease["epoch"])


async def with_one(figures: Figures) -> None:
    """A class: all ask for control, and get it one after the other; the teacher takes it from each third."""

    def add(name: str, *seconds: float) -> None:
        figures.setdefault(name, []).extend(seconds)

    with served("--class", lines=5) as server:
        teacher, _ = await Pupil.join(server.port, "Teacher", "admin", server.token)
        async with joined(server, server.code("operate")) as (pupils, took):
            add("to come in by a code", *took)
            await asyncio.gather(*(pupil.ask("who") for pupil in (*pupils, teacher)))
            await asyncio.sleep(1.0)
            with measured(figures, server, pupils, "with a class"):
                asked = await asyncio.gather(*(pupil.ask("request-control") for pupil in pupils))
                add("to be answered who asks", *asked)
                waiting = sorted(pupils, key=lambda pupil: pupil.lease.get("waiting", 0))
                assert [pupil.lease.get("waiting", 0) for pupil in waiting] == list(range(PUPILS))
                for k, (pupil, following) in enumerate(islice(pairwise(waiting), TURNS)):
                    await pupil.order()
                    holder = pupil
                    if k % 3 == 2:
                        lost = asyncio.create_task(pupil.until(pupil.has_none))
                        await teacher.ask("take-over")
                        add("to lose it to the teacher", await lost)
                        await teacher.until(teacher.has_control)
                        holder = teacher
                    offered = asyncio.create_task(following.until(following.is_offered))
                    await holder.ask("release", epoch=holder.lease["epoch"])
                    add("to be offered it", await offered)
                    begun = time.monotonic()
                    add("to get it", await following.ask("acquire"))
                    assert following.has_control()
                    await teacher.until(teacher.sees(following))
                    add("to be seen by all", time.monotonic() - begun)
        await teacher.leave()


def main() -> None:
    """Measure."""
    figures: Figures = {}
    for _ in range(BLOCKS):
        asyncio.run(without(figures))
        asyncio.run(with_one(figures))
    held = True
    for name, found in figures.items():
        p50, p95, worst = (np.quantile(found, [0.5, 0.95, 1.0]) * 1e3).tolist()
        print(f"{name}: median {p50:.3g} ms, p95 {p95:.3g} ms, worst {worst:.3g} ms ({len(found)})")
        if name.startswith("to "):
            held &= worst <= 1e3 * QUICKLY
        elif name.startswith("age"):
            held &= p95 <= 1e3 * OLDEST
    ratio, share = (
        np.median(figures[f"{what}, with a class"]) / np.median(figures[f"{what}, without a class"])
        for what in ("order to answer", "processor a frame")
    )
    held &= bool(ratio <= SLOWER)
    print(
        f"orders take {ratio:.2f} times as long as without a class, and the server {share:.2f} times the processor"
    )
    print("holds" if held else "doesn't hold")


if __name__ == "__main__":
    main()
