"""A mobile robot's site, live: an architecture on board of a body in PyBullet, in step with the clock.

Its process is the body's own: a control period's physics takes some 3 ms of 50.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import secrets
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.routing import BaseRoute, Route
from typing_extensions import override

from interfaces.jobs import RunnerConfig
from interfaces.link.quantiles import SlidingQuantiles
from interfaces.messages.control import PROTOCOL, Attached
from interfaces.messages.drive_sites import DriveOrders, SensedPoints
from interfaces.messages.fields import MOST_POINTS
from interfaces.runtime.live.robot_server import RobotServer
from interfaces.stream.access import Access
from interfaces.teleop.architectures import (
    ArchitectureRobotSite,
    Constants,
    PositionSource,
    architecture,
    controller,
)
from interfaces.teleop.architectures.compositions import CONTROL, POSITIONS, SENSING, robot_surroundings
from interfaces.teleop.connection import HostConfig
from interfaces.teleop.driving import Autonomy, DrivenConfig, DrivenHost, DrivenRobot, Hands, JourneyPilot
from interfaces.timer import Turning
from robots.bullet.rooms import Room
from robots.ipr.chassis import Senses
from robots.ipr.navigation import BodyNavigator
from robots.ipr.position import LaserPosition
from robots.ipr.robot import MobileRobot
from robots.onboard import WatchdogConfig
from robots.onboard.driving import STAND, Drive, Posture
from robots.onboard.following import SoundPosition
from robots.onboard.journey import GOING, Goal
from robots.onboard.laser import LaserModel, LaserScan, beam_angles
from robots.robot import Robot
from vrs.checks import one_of
from vrs.clock import WallClock

EVERY: Final = 4
"""Each so many of a scan's beams is told of."""
_TOLD: Final = 0.39
"""At most so often [s]."""


class NavigatorPilot(JourneyPilot):
    """Drives by a robot's own navigator: its laser, its sonars, and who walks there."""

    def __init__(self, body: MobileRobot, period: float) -> None:
        """Take a robot.

        Args:
            body: With a laser scanner and sonars.
            period: Between two drives [s].
        """
        self._ahead = BodyNavigator(body, period)
        super().__init__(self._ahead.navigator.journey, lambda: body.time)

    @override
    def go(self, goal: Goal, posture: Posture) -> None:
        self._ahead.navigator.go(goal, posture, now=self._clock())

    @override
    def drive(self, posture: Posture, before: Drive) -> Drive:
        drive = self._ahead.drive(posture, v_before=before.v)
        return drive if self.state in GOING else STAND


class LaserSight:
    """Where the beams of a robot's newest scan ended, and how sure it is of its place."""

    def __init__(self, body: MobileRobot, position: PositionSource) -> None:
        """Take a robot, and what tells it where it is."""
        self._body, self._position = body, position
        self._scan: LaserScan | None = None
        self._sight: SensedPoints | None = None
        self._told = -math.inf

    def look(self) -> None:
        """Note where the robot is while its newest scan is new; to be called each control period."""
        scan = self._body.laser
        if scan is None or scan is self._scan or scan.time < self._told + _TOLD:
            return
        self._scan, self._told = scan, scan.time
        reckoned, position = self._body.reckoned, self._position
        doubt, place = None, reckoned
        if isinstance(position, LaserPosition):
            localizer = position.localizer
            place = reckoned if localizer.posture is None else localizer.posture
            (xx, xy, _), (_, yy, _), _ = localizer.covariance.tolist()
            doubt = xx, xy, yy
        self._sight = SensedPoints(scan.time, seen_from(scan, place)[:MOST_POINTS], doubt)

    def newest(self) -> SensedPoints | None:
        """What was seen since the last call; None if that's nothing."""
        sight, self._sight = self._sight, None
        return sight


def seen_from(scan: LaserScan, place: tuple[float, float, float]) -> tuple[tuple[float, float], ...]:
    """Where some of a scan's beams ended, for a map.

    Args:
        scan: The scan; how the robot moved during it doesn't matter for a picture.
        place: Where the robot is, (x, y, θ) [m, m, rad].

    Returns:
        Places on the map [m], to the centimetre.
    """
    x, y, theta = place
    angles = beam_angles(len(scan.ranges))[::EVERY] + theta
    ranges = scan.ranges[::EVERY]
    hit = np.isfinite(ranges)
    ahead = np.array([x + scan.forward * math.cos(theta), y + scan.forward * math.sin(theta)])
    ends = ahead + ranges[hit, None] * np.column_stack([np.cos(angles[hit]), np.sin(angles[hit])])
    return tuple((round(a, 2), round(b, 2)) for a, b in ends.tolist())


_COUNTED = 1200
"""Control periods of which it's told how late they were, and how long they took: the last minute."""
_REST = 3.0
"""Longest time to come to rest in the end [s]."""


@dataclass(frozen=True, slots=True)
class LiveMobileConfig:
    """A mobile robot, and how its site behaves."""

    base: Robot
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
    server: str = "vrs"
    """Name and version of the program."""

    def __post_init__(self) -> None:
        architecture(self.architecture)
        if not self.position:
            seen = any(block.height >= LaserModel().height for block in self.room.known().blocks)
            object.__setattr__(self, "position", "laser" if seen else "fused")
        one_of("position", self.position, POSITIONS)


class LiveMobileRobot:
    """A mobile robot that follows whoever says hello as an operator's site. Enter `running` where its loop runs."""

    def __init__(self, config: LiveMobileConfig, access: Access) -> None:
        """Put the robot into its room; its clock runs from here on.

        Args:
            config: The robot.
            access: Who may come in as `Role.SITE`.
        """
        self.config = config
        senses = Senses(laser=config.base.device(LaserModel) or LaserModel())
        rng = np.random.default_rng(config.seed)
        limits = config.base.base.limits
        self.body: MobileRobot = config.base.body()(room=config.room, rng=rng, senses=senses, limits=limits)
        body, position = self.body, POSITIONS[config.position](self.body)
        self._position = SoundPosition(position, lambda: body.time)
        # The first look of its senses, before anybody waits for it.
        self.body.drive(0.0, 0.0, 0)
        self.autonomy = Autonomy(NavigatorPilot(self.body, CONTROL), config.hands, config.jobs)
        self._sight = LaserSight(self.body, position)
        self.clock = WallClock()
        self.instance = secrets.token_urlsafe(9)
        self.host = DrivenHost(
            self.new_site,
            HostConfig(lead=0.0, halting=config.halting),
            now=self.clock.now(),
            seed=secrets.randbelow(2**32),
        )
        self._turning = Turning(self.clock, self._turn)
        soon = self._turning.soon
        self._server = RobotServer(
            self.host, self.clock, access, attached=self._attached, met=self._follow, heard=soon, orders=DriveOrders
        )
        self.ended = asyncio.Event()
        """Set when it's to end."""
        self.met: Callable[[Attached], None] = lambda _: None
        """Is given what an operator's site is told that is let in."""
        self.ticks = self.skipped = 0
        """Control periods that were run, and left out as the process stood still."""
        self.worst = 0.0
        """By how much the latest of them was late [s]."""
        self._late, self._took = SlidingQuantiles(_COUNTED), SlidingQuantiles(_COUNTED)
        self._touched = 0

    @property
    def routes(self) -> list[BaseRoute]:
        """`/site` and `/health`."""
        return [Route("/health", self._say_health), *self._server.routes]

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[LiveMobileRobot]:
        """Run the body, and serve meanwhile."""
        control = asyncio.create_task(self._control())
        self._turning.start()
        try:
            yield self
        finally:
            self._turning.stop()
            control.cancel()
            await asyncio.wait([control])
            self._server.close()
            self.body.close()

    async def rest(self) -> None:
        """Stop, and wait until the robot stands, if that doesn't take too long."""
        self.host.halt("the robot's site stops", now=self.clock.now())
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_REST):
                while self.host.site is not None and not self.host.site.rests(now=self.clock.now()):
                    await asyncio.sleep(CONTROL)

    async def _control(self) -> None:
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
                self._took.add(self.clock.now() - now, now=now)
        except Exception:
            # Whoever waits for the robot must not wait for ever.
            self.ended.set()
            raise

    def drive_tick(self, now: float) -> None:
        """One control period."""
        drive = self.host.drive(now=now)
        self._sight.look()
        body = self.body
        body.drive(drive.v, drive.w, round(CONTROL / body.reality.dt))
        self.ticks += 1
        site = self.host.site
        if body.watch.fault and site is not None and not site.halted:
            self.host.halt(body.watch.fault, now=now)
        collisions = body.collisions
        if len(collisions) > self._touched:
            self._touched = len(collisions)
            self.host.halt(f"the robot touches something: {collisions[-1].thing}", now=now)
        self._turning.soon()

    def new_site(self, t: float) -> DrivenRobot:
        """What follows an operator from the time t of its clock on [s]."""
        body, watchdog = self.body, self.host.watchdog(self.config.driven.watchdog)
        if watchdog is not None:
            # What is decided takes effect with the next control period.
            watchdog = replace(watchdog, timeout=max(watchdog.timeout - CONTROL, 0.1))
        driven = replace(self.config.driven, watchdog=watchdog)
        return DrivenRobot(
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
        if config.architecture in SENSING:
            around = robot_surroundings(body, start, made, CONTROL, since=body.time - since)
        return ArchitectureRobotSite(made, self._position, body.limits, period=CONTROL, surroundings=around)

    def _turn(self, now: float) -> float:
        self._server.send(self.host.advance(now=now))
        return self.host.next_deadline()

    def _follow(self, attached: Attached) -> None:
        self._turning.soon()
        self.met(attached)

    def _attached(self) -> Attached:
        config, dog = self.config, self.host.watchdog(self.config.driven.watchdog)
        loss, timeout, age = ("hold", 0.5, None) if dog is None else ("halt", dog.timeout, dog.max_age)
        posture = np.array(self._position.posture())
        return Attached(
            PROTOCOL, config.base.name, posture, loss, timeout, None, self.instance, config.server, max_age=age,
            architecture=config.architecture, room=config.room.name,
        )  # fmt: skip

    def health(self) -> dict[str, Any]:
        """How it is, for `/health`."""
        site, body = self.host.site, self.body
        return {
            "ok": not self.ended.is_set(),
            "robot": self.config.base.name,
            "server": self.config.server,
            "instance": self.instance,
            "now": self.clock.now(),
            "architecture": self.config.architecture,
            "room": self.config.room.name,
            "operator": self._server.connected,
            "epoch": 0 if site is None else site.epoch,
            "halted": "" if site is None else site.halted,
            "link_loss": self._attached().link_loss,
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
            "timer_late": self._turning.lateness.worst,
        }

    async def _say_health(self, _request: Request) -> JSONResponse:
        return JSONResponse(self.health())
