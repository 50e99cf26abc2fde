"""A mobile robot's body, live: an architecture on board of it in PyBullet, in step with the clock.

It's in the site's own process: a control period's physics takes some 3 ms of 50.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from typing_extensions import override

from interfaces.jobs import RunnerConfig
from interfaces.link.quantiles import SlidingQuantiles
from interfaces.runtime.live.robot import LiveBody
from interfaces.teleop.architectures import ArchitectureRobotSite, Constants, architecture, controller
from interfaces.teleop.architectures.compositions import CONTROL, POSITIONS, robot_surroundings
from interfaces.teleop.autonomy import Autonomy, Hands, LaserSight, NavigatorPilot
from interfaces.teleop.connection import HostConfig
from interfaces.teleop.following_base import DrivenConfig, DrivenHost, FollowingBase
from robots.mobile.chassis import Senses
from robots.mobile.robot import MobileRobot
from robots.onboard.driving import Posture
from robots.onboard.following import SoundPosition
from robots.onboard.laser import LaserModel
from robots.onboard.watchdog import WatchdogConfig
from robots.robot import Robot
from robots.rooms import Room
from vrs.checks import one_of
from vrs.clock import WallClock
from vrs.model import Array

_LOG = logging.getLogger(__name__)
_COUNTED = 1200
"""Control periods of which it's told how late they were, and how long they took: the last minute."""


@dataclass(frozen=True, slots=True)
class PacedConfig:
    """A mobile robot, and how its site behaves."""

    robot: Robot
    """Which mobile robot."""
    room: Room
    """Where it drives; it stands at first where the room says."""
    architecture: str = "timeline"
    """What it does with the operator's path: one of `ARCHITECTURES`, or `module:name`."""
    driven: DrivenConfig = field(default_factory=lambda: DrivenConfig(period=CONTROL))
    """How its site behaves."""
    jobs: RunnerConfig = field(default_factory=RunnerConfig)
    """How it does lists of jobs, and what follows when the operator is lost."""
    hands: Hands = field(default_factory=Hands)
    """Who speaks, shows and lets an arm work; nobody aloud, and no arm, unless given."""
    position: str = ""
    """What tells it where it is: a name of `interfaces.teleop.architectures.compositions.POSITIONS`. Unless given,
    its laser where the map has walls or other blocks for it to see, else the camera."""
    halting: WatchdogConfig = field(default_factory=lambda: HostConfig().halting)
    """The watchdog for an operator who asks for `halt`."""
    constants: Constants = field(default_factory=Constants)
    """Of all architectures."""
    seed: int = 0
    """Of slip and of the senses' noise, ≥ 0."""
    since: float = 0.0
    """Time in the room when it's put there [s], ≥ 0."""
    told: Callable[[tuple[float, float, float]], None] = lambda _: None
    """Is told after each control period where the robot truly is: x, y [m], θ [rad]."""

    def __post_init__(self) -> None:
        architecture(self.architecture)
        if not self.position:
            seen = any(block.height >= LaserModel().height for block in self.room.known().blocks)
            object.__setattr__(self, "position", "laser" if seen else "fused")
        one_of("position", self.position, POSITIONS)


class PacedBody(LiveBody):
    """What drives along a path, a control period at a time."""

    host: DrivenHost

    def __init__(self, config: PacedConfig) -> None:
        """Put the robot into its room; its clock runs from here on.

        Args:
            config: The robot.
        """
        self.config, self.name, self.watchdog = config, config.robot.name, config.driven.watchdog
        self._composed = architecture(config.architecture)
        self.estimates = self._composed.estimates
        self.about = {"architecture": config.architecture, "room": config.room.name}
        senses = Senses(laser=config.robot.device(LaserModel) or LaserModel())
        rng = np.random.default_rng(config.seed)
        limits = config.robot.base.limits
        self.body: MobileRobot = config.robot.body()(
            room=config.room, rng=rng, senses=senses, limits=limits, since=config.since
        )
        body, position = self.body, POSITIONS[config.position](self.body)
        self._position = SoundPosition(position, lambda: body.time)
        # The first look of its senses, before anybody waits for it.
        self.body.drive(0.0, 0.0, 0)
        self.autonomy = Autonomy(NavigatorPilot(self.body, CONTROL), config.hands, config.jobs)
        self._sight = LaserSight(self.body, position)
        self.clock = WallClock()
        self.host = DrivenHost(
            self.new_site,
            HostConfig(lead=0.0, halting=config.halting),
            now=self.clock.now(),
            seed=secrets.randbelow(2**32),
        )
        self.ticks = self.skipped = 0
        """Control periods that were run, and left out as the process stood still."""
        self.worst = 0.0
        """By how much the latest of them was late [s]."""
        self._late, self._took = SlidingQuantiles(_COUNTED), SlidingQuantiles(_COUNTED)
        self._touched = 0

    @property
    @override
    def q(self) -> Array:
        return np.array(self._position.posture())

    @override
    @contextlib.asynccontextmanager
    async def running(self, soon: Callable[[], None]) -> AsyncIterator[None]:
        control = asyncio.create_task(self._control(soon))
        try:
            yield
        finally:
            control.cancel()
            await asyncio.wait([control])
            self.body.close()

    async def _control(self, soon: Callable[[], None]) -> None:
        """Drive the body, a control period at a time, as long as the clock says."""
        due = self.clock.now()
        try:
            while True:
                await asyncio.sleep(max(0.0, due - self.clock.now()))
                now = self.clock.now()
                late = now - due
                self.worst = max(self.worst, late)
                self._late.add(late, now=now)
                missed = int(late / CONTROL)
                self.skipped += missed
                due += (1 + missed) * CONTROL
                self.drive_tick(now)
                soon()
                self._took.add(self.clock.now() - now, now=now)
        except Exception as error:  # noqa: BLE001 - whatever it is, who waits for the robot must not wait for ever
            _LOG.exception("the body failed")
            self.problem = f"the body failed: {error}"
            soon()

    def drive_tick(self, now: float) -> None:
        """One control period."""
        drive = self.host.drive(now=now)
        self._sight.look()
        body = self.body
        body.drive(drive.v, drive.w, round(CONTROL / body.reality.dt))
        self.config.told(body.truth)
        self.ticks += 1
        site = self.host.site
        if body.watch.fault and site is not None and not site.halted:
            self.host.halt(body.watch.fault, now=now)
        collisions = body.collisions
        if len(collisions) > self._touched:
            self._touched = len(collisions)
            self.host.halt(f"the robot touches something: {collisions[-1].thing}", now=now)

    def new_site(self, t: float) -> FollowingBase:
        """What follows an operator from the time t of its clock on [s]."""
        body, watchdog = self.body, self.host.watchdog(self.config.driven.watchdog)
        if watchdog is not None:
            # What is decided takes effect with the next control period.
            watchdog = replace(watchdog, timeout=max(watchdog.timeout - CONTROL, 0.1))
        driven = replace(self.config.driven, watchdog=watchdog)
        return FollowingBase(
            self._architecture,
            self._position,
            body.limits,
            now=t,
            world=lambda: body.time,
            config=driven,
            autonomy=self.autonomy,
            sight=self._sight.newest,
        )

    def _architecture(self, start: Posture, since: float) -> ArchitectureRobotSite:
        """The architecture's parts for a drive that began at a posture, so long ago [s]."""
        config, body = self.config, self.body
        made = controller(config.architecture, start, config.constants)
        around = None
        if self._composed.senses:
            around = robot_surroundings(body, start, made, CONTROL, since=body.time - since)
        return ArchitectureRobotSite(made, self._position, body.limits, period=CONTROL, surroundings=around)

    @override
    def decided(self) -> None:
        """The next control period goes by it."""

    @override
    def health(self) -> dict[str, Any]:
        body = self.body
        return {
            "posture": list(self._position.posture()),
            "truth": list(body.truth),
            "motion": list(body.motion),
            "doing": self.autonomy.doing,
            "operator_loss": self.autonomy.loss,
            "touching": body.touching,
            "collisions": len(body.collisions),
            "ticks": {
                "run": self.ticks,
                "skipped": self.skipped,
                "worst": self.worst,
                "late_p99": self._late.quantile(0.99),
                "took": self._took.median,
                "took_p99": self._took.quantile(0.99),
            },
        }
