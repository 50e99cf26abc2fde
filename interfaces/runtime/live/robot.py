"""The robot's site, live: one operator at a time on a socket, and the body in a process of its own."""

from __future__ import annotations

import asyncio
import contextlib
import math
import secrets
from collections import deque
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.types import Receive, Scope, Send

from interfaces.runtime.live.turning import Turning
from interfaces.runtime.live.warm import warm
from interfaces.runtime.physics import (
    TICK,
    Ended,
    PhysicsConfig,
    PhysicsProcess,
    References,
    Silent,
)
from interfaces.runtime.physics_messages import BodyKind, Fault, Measurement, Ready
from interfaces.stream.access import Access
from interfaces.stream.codec import Encoding, decode, encode
from interfaces.stream.control import PROTOCOL, Attached, Hello, Ping, Pong, Problem, ProblemCode, Role
from interfaces.stream.errors import ProtocolError
from interfaces.teleop import Orders, Reference, Report, RobotHost, RobotHostConfig
from vrs.clock import WallClock
from vrs.errors import InvalidValueError
from vrs.model import Array, RobotModel

FEED = 0.1
"""Longest time between two lots of references for the body [s]."""
LARGEST = 1 << 20
"""Longest message of an operator's site: thousands of commands that wait to be acknowledged [B]."""
HELLO = 2.0
"""Time for the first message of a connection [s]."""
_WAITING = 64
"""Most messages that wait to be sent; older ones are dropped, for newer ones say it all."""
_PROBLEMS = 32
"""So many messages that can't be taken end a connection."""
_REST = 2.0
"""Longest time to come to rest in the end [s]."""
_NO_ROOM = 1013
_POLICY = 1008


@dataclass(frozen=True, slots=True, eq=False)
class LiveRobotConfig:
    """A robot, and how its site behaves."""

    model: RobotModel
    q: Array
    """Where it stands [rad], (n,)."""
    host: RobotHostConfig = field(default_factory=RobotHostConfig)
    """How its end of the connection behaves."""
    body: BodyKind = BodyKind.PUMA560
    """What follows the references."""
    friction: bool = True
    """Whether its joints have friction."""
    server: str = "vrs"
    """Name and version of the program."""


class _Connection:
    """An operator's site on a socket."""

    def __init__(self, encoding: Encoding) -> None:
        self.encoding = encoding
        self.waiting: deque[bytes] = deque(maxlen=_WAITING)
        self.wake = asyncio.Event()
        self.close: tuple[int, str] | None = None
        self.problems = 0

    def send(self, message: Report | Ping | Attached | Problem) -> None:
        self.waiting.append(encode(message, self.encoding))
        self.wake.set()

    def end(self, code: int, reason: str) -> None:
        self.close = code, reason
        self.wake.set()


class LiveRobot:
    """A robot that follows whoever says hello as an operator's site. Enter `running` where its loop runs."""

    def __init__(self, config: LiveRobotConfig, access: Access) -> None:
        """Take the clock from here on.

        Args:
            config: The robot.
            access: Who may come in as `Role.SITE`.
        """
        self.config, self._access = config, access
        warm(config.model, config.q)
        self.clock = WallClock()
        self.instance = secrets.token_urlsafe(9)
        seed = secrets.randbelow(2**32)
        self.host = RobotHost(config.model, config.q, now=self.clock.now(), config=config.host, seed=seed)
        self._turning = Turning(self.clock, self._turn)
        self._connection: _Connection | None = None
        self._physics: PhysicsProcess | None = None
        self._references = References(self.host.reference, now=self._ahead(self.clock.now()))
        self._fed, self._stale, self._placed = -math.inf, True, False
        self._measured: Measurement | None = None
        self._fault: Fault | None = None
        self.ended = asyncio.Event()
        """Set when the robot can't go on; anybody may set it to end it."""
        self.problem = ""
        """Why it can't; empty while it can."""
        self.faults = 0
        """How often the body came to rest by itself."""

    @property
    def routes(self) -> list[BaseRoute]:
        """`/site` and `/health`."""
        return [Route("/health", self._say_health), WebSocketRoute("/site", _Endpoint(self))]

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[LiveRobot]:
        """Run the body, and serve meanwhile.

        Raises:
            PhysicsStartError: If the body can't be made.
        """
        config = PhysicsConfig(
            self.config.model.limits, self.config.q, body=self.config.body, friction=self.config.friction
        )
        loop = asyncio.get_running_loop()
        with PhysicsProcess(config, self.clock) as physics:
            self._physics = physics
            loop.add_reader(physics.fileno(), self._turning.soon)
            self._turning.start()
            try:
                yield self
            finally:
                self._turning.stop()
                loop.remove_reader(physics.fileno())
                if self._connection is not None:
                    self._connection.end(1001, "the robot's site stops")
                self._physics = None

    async def ready(self) -> None:
        """Wait until the body stands and is measured."""
        while self._measured is None and not self.ended.is_set():
            await asyncio.sleep(0.005)

    async def rest(self) -> None:
        """Stop, and wait until the references rest, if that doesn't take too long."""
        self._decide()
        self.host.halt("the robot's site stops", now=self.clock.now())
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_REST):
                while not self.health()["rests"]:
                    await asyncio.sleep(0.01)

    def _turn(self, now: float) -> float:
        physics = self._physics
        assert physics is not None
        for event in physics.poll(now=now):
            self._take(event, now)
        messages = self.host.advance(now=now)
        if self._connection is not None:
            for message in messages:
                self._connection.send(message)
        self._place(now)
        if self._stale or now >= self._fed + FEED:
            self._feed(now)
        return min(self.host.next_deadline(), physics.next_deadline(), self._fed + FEED)

    def _take(self, event: Ready | Measurement | Fault | Silent | Ended, now: float) -> None:
        """Take in what the body's process said."""
        if isinstance(event, Measurement):
            self._measured = event
            if self.host.measured(np.array(event.q), at=event.followed * TICK, now=now):
                self._references.restart(now=self._ahead(now))
                self._stale = self._placed = True
            return
        if isinstance(event, Fault):
            self.faults += 1
            self._fault = event
            self.host.fault(f"the body: {event.text}", np.array(event.rest), now=now)
        elif isinstance(event, Silent):
            self.host.halt("the body's process stands still", now=now)
        elif isinstance(event, Ended):
            self.host.halt("the body's process has ended", now=now)
            self.problem = f"the body's process ended with status {event.status}"
            self.ended.set()
        self._stale = True

    def _ahead(self, now: float) -> float:
        """For when of the body's time is decided at now [s]."""
        return now + self.config.host.lead

    def _decide(self) -> None:
        """Something is decided: let the body have it soon."""
        self._stale = True
        self._turning.soon()

    def _place(self, now: float) -> None:
        """Once the body rests after a fault, let references count again: they begin where it rests."""
        physics, fault = self._physics, self._fault
        if physics is None or fault is None or now < fault.rest_tick * TICK:
            return
        physics.acknowledge(fault)
        self._references.restart(now=self._ahead(now))
        self._fault, self._stale = None, True

    def _feed(self, now: float) -> None:
        """Give the body its references, from where it has them for certain."""
        if self._physics is not None and self._fault is None:
            first, rows = self._references.take(now=self._ahead(now))
            self._feed_rows(rows, first)
            self._placed = False
        self._fed, self._stale = now, False

    def _feed_rows(self, rows: Reference, first: int) -> None:
        assert self._physics is not None
        self._physics.feed(rows, first, placed=self._placed)

    async def serve(self, encoding: Encoding, receive: Receive, send: Send) -> None:
        """Serve a connection that was accepted, until it ends."""
        connection = _Connection(encoding)
        writer = asyncio.create_task(self._write(connection, send))
        try:
            try:
                async with asyncio.timeout(HELLO):
                    refusal = self._greet(connection, await receive())
            except TimeoutError:
                refusal = Problem(ProblemCode.HELLO_LATE, f"no hello within {HELLO:g} s", fatal=True)
            if refusal is not None:
                connection.send(refusal)
                connection.end(_POLICY if refusal.code is not ProblemCode.FULL else _NO_ROOM, refusal.text)
            while connection.close is None and (message := await receive())["type"] != "websocket.disconnect":
                self._hear(connection, _data(message))
            await asyncio.wait([writer], timeout=1.0 if connection.close is not None else 0.0)
        finally:
            writer.cancel()
            if self._connection is connection:
                self._connection = None

    def _greet(self, connection: _Connection, message: Any) -> Problem | None:
        """Take the first message; why it can't be, or None if the operator is followed from now on."""
        try:
            hello = decode(_data(message), connection.encoding, allowed=Hello)
            refused = self._access.refusal(Role.SITE, hello.token)
            if hello.protocol != PROTOCOL:
                return Problem(ProblemCode.VERSION, f"this is version {PROTOCOL} of the protocol", fatal=True)
            if hello.role is not Role.SITE or refused:
                text = refused or "only an operator's site comes here"
                return Problem(ProblemCode.REFUSED, text, fatal=True)
            now = self.clock.now()
            busy = self.host.hello(hello.session or "", now=now)
        except ProtocolError as error:
            return Problem(error.code, str(error), fatal=True)
        except InvalidValueError as error:
            return Problem(ProblemCode.OUT_OF_RANGE, str(error), fatal=True)
        if busy:
            return Problem(ProblemCode.FULL, busy, fatal=True)
        if self._connection is not None:
            self._connection.end(_POLICY, "the same site has connected again")
        self._connection = connection
        connection.send(self._attached())
        self._turning.soon()
        return None

    def _attached(self) -> Attached:
        site = self.config.host.site
        loss, timeout = ("hold", 0.5) if site.watchdog is None else ("halt", site.watchdog.timeout)
        q = np.array(self._measured.q) if self._measured is not None else self.config.q
        name = self.config.model.name
        return Attached(name, q, loss, timeout, site.fixed_offset, self.instance, self.config.server)

    def _hear(self, connection: _Connection, data: bytes) -> None:
        if self._connection is not connection:
            return
        try:
            message: Orders | Pong = decode(data, connection.encoding, allowed=Orders | Pong, largest=LARGEST)
        except ProtocolError as error:
            connection.problems += 1
            connection.send(Problem(error.code, str(error), fatal=connection.problems >= _PROBLEMS))
            if connection.problems >= _PROBLEMS:
                connection.end(_POLICY, "too many messages that can't be taken")
            return
        self._decide()
        self.host.receive(message, now=self.clock.now())

    async def _write(self, connection: _Connection, send: Send) -> None:
        kind = "bytes" if connection.encoding is Encoding.MSGPACK else "text"
        with contextlib.suppress(OSError):
            while True:
                while connection.waiting:
                    data = connection.waiting.popleft()
                    await send({"type": "websocket.send", kind: data if kind == "bytes" else data.decode()})
                if connection.close is not None:
                    code, reason = connection.close
                    await send({"type": "websocket.close", "code": code, "reason": reason[:100]})
                    return
                connection.wake.clear()
                await connection.wake.wait()

    def health(self) -> dict[str, Any]:
        """How it is, for `/health`."""
        site, measured = self.host.site, self._measured
        counts = None if measured is None else measured.counts
        reference = self.host.reference(np.array([self.clock.now()]))
        return {
            "ok": not self.problem and measured is not None,
            "robot": self.config.model.name,
            "server": self.config.server,
            "instance": self.instance,
            "now": self.clock.now(),
            "operator": self._connection is not None,
            "epoch": 0 if site is None else site.epoch,
            "halted": "" if site is None else site.halted,
            "uncertainty": _finite(self.host.uncertainty),
            "measured_at": None if measured is None else measured.followed * TICK,
            "q": None if measured is None else list(measured.q),
            "qd": None if measured is None else list(measured.qd),
            "doing": None if measured is None else str(measured.doing),
            "q_ref": reference.q[0].tolist(),
            "qd_ref": reference.qd[0].tolist(),
            "rests": not (reference.qd.any() or reference.qdd.any()),
            "faults": self.faults,
            "ticks": None if counts is None else {
                "run": counts.ticks, "late": counts.late, "worst": counts.worst, "skipped": counts.skipped,
                "merged": counts.merged,
            },
            "timer_late": self._turning.latest,
        }  # fmt: skip

    async def _say_health(self, request: Request) -> JSONResponse:  # noqa: ARG002 - Starlette gives it
        return JSONResponse(self.health())


def _data(message: Any) -> bytes:
    """The bytes of a frame; of none where it's a disconnect."""
    data, text = message.get("bytes"), message.get("text")
    return bytes(data) if data is not None else (text or "").encode()


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


class _Endpoint:
    """`/site` as an ASGI application."""

    def __init__(self, robot: LiveRobot) -> None:
        self._robot = robot

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await receive()
        chosen = next((name for name in scope["subprotocols"] if name in set(Encoding)), None)
        if chosen is None:
            await send({"type": "websocket.close", "code": 1002, "reason": "no subprotocol of ours"})
            return
        await send({"type": "websocket.accept", "subprotocol": chosen})
        await self._robot.serve(Encoding(chosen), receive, send)
