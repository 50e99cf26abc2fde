"""Both sites of a mobile robot in virtual time, with an emulated link and a body between them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from interfaces.jobs import ArmControl, RunnerConfig
from interfaces.link import Conditions, LinkConditions, delay_profile
from interfaces.teleop.architectures import ArchitectureRobotSite, Constants, controller
from interfaces.teleop.autonomy import Autonomy, Hands, JourneyPilot
from interfaces.teleop.connection import HostConfig
from interfaces.teleop.following_base import DrivenConfig, DrivenHost, FollowingBase
from interfaces.teleop.operator import Halt, HaltCause, OperatorSite
from interfaces.teleop.virtual_base import DriveLine, VirtualBase
from robots import ipr
from robots.ipr.parameters import IPR
from robots.mobile.position import FusedPosition
from robots.mobile.robot import BareBody
from robots.onboard.driving import IPR_LIMITS, Posture
from robots.onboard.journey import Journey
from robots.onboard.routes import RouteConfig, RouteMap
from robots.onboard.watchdog import WatchdogConfig

TURN = 0.01
CONTROL = 5
"""Turns of a control period."""
MODEL = ipr.model()


class Rig:
    """Session time goes on by `run`; the robot's clock is `AHEAD` of it."""

    AHEAD = 123.25

    def __init__(
        self,
        delay: str = "constant:0.1",
        *,
        hold: bool = False,
        architecture: str = "timeline",
        jobs: RunnerConfig | None = None,
        arm: ArmControl | None = None,
    ) -> None:
        self.k = 0
        self.body = BareBody(IPR, (1.0, 2.0, 0.5), rng=3)
        self.position = FusedPosition(self.body)
        self.architecture = architecture
        watchdog = None if hold else WatchdogConfig(max_uncertainty=1.0)
        self.config = DrivenConfig(watchdog=watchdog)
        wall = [(4.0, 0.0), (4.2, 0.0), (4.2, 3.5), (4.0, 3.5)]
        self.roads = RouteMap((8.0, 6.0), [wall], RouteConfig(0.4, 0.25))
        pilot = JourneyPilot(Journey(self.roads), lambda: self.body.time)
        self.hands = Hands() if arm is None else Hands(arm=arm)
        self.autonomy = Autonomy(pilot, self.hands, jobs)
        self.operator = OperatorSite(
            VirtualBase(MODEL, Posture(0.0, 0.0, 0.0), now=0.0), halted=Halt(HaltCause.NOT_MET)
        )
        way = LinkConditions.symmetric(Conditions(delay=delay_profile(delay)))
        self.line = DriveLine(self.operator, way, np.random.default_rng(1))
        self.line.connected = True
        self.host = DrivenHost(self._site, HostConfig(lead=0.0), now=self.AHEAD, seed=1)
        assert self.host.hello("me", now=self.AHEAD) == ""
        self.drives: list[tuple[float, float]] = []
        """What the body was told, a control period each."""

    def _site(self, t: float) -> FollowingBase:
        return FollowingBase(
            self._made, self.position, IPR_LIMITS, now=t, config=self.config, autonomy=self.autonomy
        )

    def _made(self, start: Posture, since: float) -> ArchitectureRobotSite:
        assert since >= 0.0
        return ArchitectureRobotSite(
            controller(self.architecture, start, Constants()), self.position, IPR_LIMITS, period=CONTROL * TURN
        )

    @property
    def now(self) -> float:
        return self.k * TURN

    @property
    def robot(self) -> FollowingBase:
        assert self.host.site is not None
        return self.host.site

    @property
    def truth(self) -> tuple[float, float, float]:
        return self.body.truth

    def run(self, seconds: float, each: Callable[[float], object] = lambda _: None) -> None:
        """Let so much time pass; `each` is called with the session time before every turn."""
        for _ in range(round(seconds / TURN)):
            now, own = self.now, self.now + self.AHEAD
            each(now)
            for message in self.line.advance(now=now):
                self.host.receive(message, now=own)
            if self.k % CONTROL == 0:
                drive = self.host.drive(now=own)
                self.drives.append(drive)
                self.body.drive(drive.v, drive.w, round(CONTROL * TURN / self.body.reality.dt))
            for answer in self.host.advance(now=own):
                if self.line.connected:
                    self.line.receive(answer, now=now)
            self.k += 1

    def begin(self) -> None:
        """Meet, and begin a drive."""
        self.run(3.5)
        assert self.operator.resume(now=self.now) == ""
        self.run(0.5)
        assert not self.robot.halted

    def wish(self, v: float, w: float) -> Callable[[float], None]:
        """What wishes that, turn by turn."""

        def each(now: float) -> None:
            assert self.operator.robot.wish(v, w, issued_at=now, now=now) == ""

        return each

    def apart(self) -> float:
        """How far the real robot is from the virtual one [m]."""
        return math.dist(self.truth[:2], self.operator.robot.virtual(self.now)[:2])
