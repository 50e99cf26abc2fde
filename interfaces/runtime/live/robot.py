"""The robot's site, live: it follows one operator at a time, with a body in a process of its own."""

from __future__ import annotations

import asyncio
import contextlib
import math
import secrets
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.routing import BaseRoute, Route

from interfaces.messages.control import PROTOCOL, Attached, Role
from interfaces.runtime.live.process import warm
from interfaces.runtime.live.robot_server import RobotServer
from interfaces.runtime.physics import (
    TICK,
    Feeder,
    PhysicsConfig,
    PhysicsProcess,
    ProcessEnded,
    Silent,
)
from interfaces.runtime.physics_messages import Fault, Measurement, PhysicsReady
from interfaces.stream.access import Access, bearer
from interfaces.teleop import RobotHost, RobotHostConfig
from interfaces.timer import Turning
from robots.robot import Robot
from vrs.clock import WallClock
from vrs.model import Array

JOINTS = frozenset(("q", "qd", "q_ref", "qd_ref"))
"""Of `/health`, what only an operator's site is told."""
_REST = 2.0
"""Longest time to come to rest in the end [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class LiveRobotConfig:
    """A robot, and how its site behaves."""

    robot: Robot
    """An arm."""
    q: Array
    """Where it stands [rad], of prismatic joints [m], (n,)."""
    host: RobotHostConfig = field(default_factory=RobotHostConfig)
    """How its end of the connection behaves."""
    body: str = ""
    """Which of its bodies follows the references; the usual one unless given."""
    friction: bool = True
    """Whether its joints have friction."""
    server: str = "vrs"
    """Name and version of the program."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "body", self.body or self.robot.usual_body)


class LiveRobot:
    """A robot that follows whoever says hello as an operator's site. Enter `running` where its loop runs."""

    def __init__(self, config: LiveRobotConfig, access: Access) -> None:
        """Take the clock from here on.

        Args:
            config: The robot.
            access: Who may come in as `Role.SITE`.
        """
        self.config, self._access = config, access
        model = config.robot.arm
        warm(model, config.q)
        self.clock = WallClock()
        self.instance = secrets.token_urlsafe(9)
        seed = secrets.randbelow(2**32)
        self.host = RobotHost(model, config.q, now=self.clock.now(), config=config.host, seed=seed)
        self._turning = Turning(self.clock, self._turn)
        self._server = RobotServer(
            self.host, self.clock, access, attached=self._attached, met=self._follow, heard=self._decide
        )
        self.physics: PhysicsProcess | None = None
        """The body's own process; None without one."""
        self._feeder: Feeder | None = None
        self._measured: Measurement | None = None
        self.ended = asyncio.Event()
        """Set when the robot can't go on; anybody may set it to end it."""
        self.problem = ""
        """Why it can't; empty while it can."""
        self.met: Callable[[Attached], None] = lambda _: None
        """Is given what an operator's site is told that is let in."""
        self.faults = 0
        """How often the body came to rest by itself."""

    @property
    def routes(self) -> list[BaseRoute]:
        """`/site` and `/health`."""
        return [Route("/health", self._say_health), *self._server.routes]

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[LiveRobot]:
        """Run the body, and serve meanwhile.

        Raises:
            PhysicsStartError: If the body can't be made.
        """
        made = self.config
        config = PhysicsConfig(made.robot, made.q, body=made.body, friction=made.friction)
        loop = asyncio.get_running_loop()
        with PhysicsProcess(config, self.clock) as physics:
            self.physics = physics
            self._feeder = Feeder(self.host, physics, now=self.clock.now())
            loop.add_reader(physics.fileno(), self._turning.soon)
            self._turning.start()
            try:
                yield self
            finally:
                self._turning.stop()
                loop.remove_reader(physics.fileno())
                self._server.close()
                self.physics = self._feeder = None

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
        physics, feeder = self.physics, self._feeder
        assert physics is not None
        assert feeder is not None
        for event in physics.poll(now=now):
            self._take(event, feeder, now)
        self._server.send(feeder.advance(now=now))
        return min(feeder.next_deadline(), physics.next_deadline())

    def _take(
        self, event: PhysicsReady | Measurement | Fault | Silent | ProcessEnded, feeder: Feeder, now: float
    ) -> None:
        """Take in what the body's process said."""
        if isinstance(event, Measurement):
            self._measured = event
            if self.host.measured(np.array(event.q), at=event.followed * TICK, now=now):
                feeder.placed(now=now)
            return
        if isinstance(event, Fault):
            self.faults += 1
            feeder.failed(event)
            self.host.fault(f"the body: {event.text}", np.array(event.rest), now=now)
        elif isinstance(event, Silent):
            self.host.halt("the body's process stands still", now=now)
        elif isinstance(event, ProcessEnded):
            self.host.halt("the body's process has ended", now=now)
            self.problem = f"the body's process ended with status {event.status}"
            self.ended.set()
        feeder.decided()

    def _decide(self) -> None:
        """Something is decided: let the body have it soon."""
        if self._feeder is not None:
            self._feeder.decided()
        self._turning.soon()

    def _follow(self, attached: Attached) -> None:
        self._decide()
        self.met(attached)

    def _attached(self) -> Attached:
        site = self.config.host.site
        dog = self.host.watchdog(site.watchdog)
        loss, timeout, age = ("hold", 0.5, None) if dog is None else ("halt", dog.timeout, dog.max_age)
        q = np.array(self._measured.q) if self._measured is not None else self.config.q
        name = self.config.robot.name
        offset, server = site.fixed_offset, self.config.server
        return Attached(PROTOCOL, name, q, loss, timeout, offset, self.instance, server, max_age=age)

    def health(self) -> dict[str, Any]:
        """How it is, for `/health`."""
        site, measured = self.host.site, self._measured
        counts = None if measured is None else measured.counts
        reference = self.host.reference(np.array([self.clock.now()]))
        return {
            "ok": not self.problem and measured is not None,
            "robot": self.config.robot.name,
            "server": self.config.server,
            "instance": self.instance,
            "now": self.clock.now(),
            "operator": self._server.connected,
            "epoch": 0 if site is None else site.epoch,
            "halted": "" if site is None else site.halted,
            "link_loss": self._attached().link_loss,
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
            "timer_late": self._turning.lateness.worst,
        }  # fmt: skip

    async def _say_health(self, request: Request) -> JSONResponse:
        facts = self.health()
        if self._access.refusal(Role.SITE, bearer(request.headers.get("authorization", ""))):
            facts = {name: fact for name, fact in facts.items() if name not in JOINTS}
        return JSONResponse(facts, 503 if self.problem else 200)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
