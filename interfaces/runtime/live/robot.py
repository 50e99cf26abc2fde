"""The robot's site, live: it follows one operator at a time, whatever its body is."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import socket
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AbstractAsyncContextManager
from typing import Any

from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.routing import BaseRoute, Route

from interfaces.messages.control import PROTOCOL, Attached, Role
from interfaces.runtime.live.robot_server import RobotServer
from interfaces.stream.access import Access
from interfaces.stream.audit import AuditLog
from interfaces.stream.codec import Value
from interfaces.stream.server import health, may_see
from interfaces.teleop.connection import Host
from interfaces.timer import Turning
from robots.onboard.watchdog import WatchdogConfig
from robots.things import Scene
from vrs.clock import WallClock
from vrs.model import Array

_REST = 2.0
"""Longest time to come to rest in the end [s]."""


class LiveBody(ABC):
    """A body that follows what a host decides, while the robot's clock runs."""

    clock: WallClock
    """The robot's."""
    host: Host[Any, Any, Any]
    """The robot's end of the connection, which decides what the body does."""
    name: str
    """Name of the robot's model."""
    about: Mapping[str, str] = {}
    """What else an operator's site is told when it's met, and `/health` says."""
    estimates = False
    """Of a mobile robot, see `Attached.estimates`."""
    scene: Scene | None = None
    """What is around an arm; None for nothing that it could grasp."""
    offset: float | None = None
    """The robot's timeline less session time [s]; None: it adapts."""
    watchdog: WatchdogConfig | None
    """The robot's own, for operators who leave that to it; None holds."""
    ready = True
    """Whether it stands, and is measured."""
    problem = ""
    """Why it can't go on; empty while it can."""

    @property
    @abstractmethod
    def q(self) -> Array:
        """Its measured joints [rad]; of a mobile robot its posture, x, y, θ [m, m, rad]."""

    @abstractmethod
    def running(self, soon: Callable[[], None]) -> AbstractAsyncContextManager[None]:
        """Run the body meanwhile.

        Args:
            soon: To be called when there's something to `advance`.
        """

    @abstractmethod
    def health(self) -> dict[str, Any]:
        """How it is, for `/health`."""

    def decided(self) -> None:  # noqa: B027 - whoever drives a period at a time hears of it in time
        """The host was told something, or is about to be."""

    def advance(self, *, now: float) -> tuple[Value, ...]:
        """Do what is due by now [s], and say what is to be sent to the operator."""
        return self.host.advance(now=now)

    def next_deadline(self) -> float:
        """When to `advance` even if nothing comes [s]."""
        return self.host.next_deadline()


class LiveRobot:
    """A robot that follows whoever says hello as an operator's site. Enter `running` where its loop runs."""

    def __init__(
        self, body: LiveBody, access: Access, *, server: str = "vrs", audit: AuditLog | None = None
    ) -> None:
        """Stand, and wait for an operator.

        Args:
            body: What follows.
            access: Who may come in as `Role.SITE`.
            server: Name and version of the program.
            audit: Where it's written whom it follows, and who is refused; nowhere unless given.
        """
        self.body, self.clock, self.host = body, body.clock, body.host
        self._access, self._program, self._audit = access, server, audit
        self.instance = secrets.token_urlsafe(9)
        self._turning = Turning(self.clock, self._turn)
        self._server = RobotServer(
            self.host, self.clock, access, attached=self._attached, met=self._follow, heard=self._decide,
            audit=audit,
        )  # fmt: skip
        self.ended = asyncio.Event()
        """Set when the robot can't go on; anybody may set it to end it."""
        self.met: Callable[[Attached], None] = lambda _: None
        """Is given what an operator's site is told that is let in."""

    @property
    def routes(self) -> list[BaseRoute]:
        """`/site` and `/health`."""
        return [Route("/health", self._say_health), *self._server.routes]

    @contextlib.asynccontextmanager
    async def running(self, datagrams: socket.socket | None = None) -> AsyncIterator[LiveRobot]:
        """Run the body, and serve meanwhile.

        Args:
            datagrams: Where they come to, bound to the stream's port, which is closed in the end; None for none.

        Raises:
            PhysicsStartError: If the body can't be made.
        """
        async with self.body.running(self._turning.soon):
            self._turning.start()
            self._server.start(datagrams)
            try:
                yield self
            finally:
                self._turning.stop()
                self._server.close()

    async def ready(self) -> None:
        """Wait until the body stands and is measured."""
        while not self.body.ready and not self.ended.is_set():
            await asyncio.sleep(0.005)

    async def rest(self) -> None:
        """Stop, and wait until the robot is to stand, if that doesn't take too long."""
        self._decide()
        self.host.halt("the robot's site stops", now=self.clock.now())
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_REST):
                while not self.host.rests(now=self.clock.now()):
                    await asyncio.sleep(0.01)

    def _turn(self, now: float) -> float:
        self._server.send(self.body.advance(now=now))
        if self.body.problem:
            self.ended.set()
        return self.body.next_deadline()

    def _decide(self) -> None:
        """Something is decided: let the body have it soon."""
        self.body.decided()
        self._turning.soon()

    def _follow(self, attached: Attached) -> None:
        self._decide()
        self.met(attached)

    def _attached(self) -> Attached:
        body, dog = self.body, self.host.watchdog(self.body.watchdog)
        loss, timeout, age = ("hold", 0.5, None) if dog is None else ("halt", dog.timeout, dog.max_age)
        return Attached(
            PROTOCOL, body.name, body.q, loss, timeout, body.offset, self.instance, self._program, max_age=age,
            estimates=body.estimates, scene=body.scene, **body.about,
        )  # fmt: skip

    def health(self) -> dict[str, Any]:
        """How it is, for `/health`."""
        site, body = self.host.site, self.body
        return {
            "ok": not body.problem and body.ready,
            "robot": body.name,
            "server": self._program,
            "instance": self.instance,
            "now": self.clock.now(),
            **body.about,
            "operator": self._server.connected,
            "epoch": 0 if site is None else site.epoch,
            "halted": "" if site is None else site.halted,
            "link_loss": self._attached().link_loss,
            "datagrams": self._server.datagrams,
            **body.health(),
            **({} if self._audit is None else {"audit": self._audit.health()}),
            "timer_late": self._turning.lateness.worst,
        }

    async def _say_health(self, request: Request) -> JSONResponse:
        return health(self.health(), not self.body.problem, may_see(request, self._access, Role.SITE))
