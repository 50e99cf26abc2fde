"""An arm's body, live: in a process of its own, which is fed ahead of time."""

from __future__ import annotations

import asyncio
import contextlib
import math
import secrets
from collections.abc import AsyncIterator, Callable
from typing import Any

import numpy as np
from typing_extensions import override

from interfaces.messages.control import Ping
from interfaces.messages.sites import Report
from interfaces.runtime.live.process import warm
from interfaces.runtime.live.robot import LiveBody
from interfaces.runtime.physics import TICK, Event, Feeder, PhysicsConfig, PhysicsProcess, ProcessEnded, Silent
from interfaces.runtime.physics_messages import Fault, Measurement
from interfaces.teleop import RobotHost, RobotHostConfig
from vrs.clock import WallClock
from vrs.model import Array


class PhysicsBody(LiveBody):
    """What follows a plan in joints, measured a hundred times a second."""

    host: RobotHost
    ready = False

    def __init__(self, physics: PhysicsConfig, host: RobotHostConfig | None = None) -> None:
        """Take the clock from here on.

        Args:
            physics: The robot, its body, and where it stands.
            host: How its end of the connection behaves.
        """
        host = RobotHostConfig() if host is None else host
        model = physics.robot.arm
        warm(model, physics.q)
        self.name, self.offset, self.watchdog = physics.robot.name, host.site.fixed_offset, host.site.watchdog
        self.clock = WallClock()
        self.host = RobotHost(model, physics.q, now=self.clock.now(), config=host, seed=secrets.randbelow(2**32))
        self._config, self.scene = physics, physics.scene
        self.physics: PhysicsProcess | None = None
        """The body's own process; None without one."""
        self._feeder: Feeder | None = None
        self._measured: Measurement | None = None
        self.faults = 0
        """How often the body came to rest by itself."""

    @property
    @override
    def q(self) -> Array:
        return self._config.q if self._measured is None else np.array(self._measured.q)

    @override
    @contextlib.asynccontextmanager
    async def running(self, soon: Callable[[], None]) -> AsyncIterator[None]:
        loop = asyncio.get_running_loop()
        with PhysicsProcess(self._config, self.clock) as physics:
            self.physics, self._feeder = (
                physics,
                Feeder(self.host, physics, now=self.clock.now(), grasps=self.scene is not None),
            )
            loop.add_reader(physics.fileno(), soon)
            try:
                yield
            finally:
                loop.remove_reader(physics.fileno())
                self.physics = self._feeder = None

    @override
    def decided(self) -> None:
        if self._feeder is not None:
            self._feeder.decided()

    @override
    def advance(self, *, now: float) -> tuple[Report | Ping, ...]:
        assert self.physics is not None
        assert self._feeder is not None
        for event in self.physics.poll(now=now):
            self._take(event, self._feeder, now)
        return self._feeder.advance(now=now)

    @override
    def next_deadline(self) -> float:
        assert self.physics is not None
        assert self._feeder is not None
        return min(self._feeder.next_deadline(), self.physics.next_deadline())

    def _take(self, event: Event, feeder: Feeder, now: float) -> None:
        """Take in what the body's process said."""
        if isinstance(event, Measurement):
            self._measured, self.ready = event, True
            if event.hand is not None:
                self.host.hand(event.hand)
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
        feeder.decided()

    @override
    def health(self) -> dict[str, Any]:
        measured = self._measured
        counts = None if measured is None else measured.counts
        reference, uncertainty = self.host.reference(np.array([self.clock.now()])), self.host.uncertainty
        return {
            "uncertainty": uncertainty if math.isfinite(uncertainty) else None,
            "measured_at": None if measured is None else measured.followed * TICK,
            "q": None if measured is None else list(measured.q),
            "qd": None if measured is None else list(measured.qd),
            "doing": None if measured is None else str(measured.doing),
            "q_ref": reference.q[0].tolist(),
            "qd_ref": reference.qd[0].tolist(),
            "rests": not (reference.qd.any() or reference.qdd.any()),
            **({} if measured is None or measured.hand is None else {"hand": measured.hand.opening}),
            "faults": self.faults,
            "ticks": None if counts is None else {
                "run": counts.ticks, "late": counts.late, "worst": counts.worst, "skipped": counts.skipped,
                "merged": counts.merged,
            },
        }  # fmt: skip
