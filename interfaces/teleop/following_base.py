"""A base that follows an operator: an architecture for each epoch, the watchdog before it, and the way to rest."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from typing_extensions import override

from interfaces.messages.control import SensedPoints
from interfaces.messages.jobs import Doing, Errand, TaskReport
from interfaces.messages.sites import DriveOrders, DriveReport
from interfaces.teleop.architectures import ArchitectureRobotSite, TimelineController
from interfaces.teleop.autonomy import Autonomy
from interfaces.teleop.connection import Host
from interfaces.teleop.robot import LOST, RobotSite
from robots.onboard.driving import STAND, Drive, Posture, is_still, kept
from robots.onboard.following import PositionSource, SoundPosition
from robots.onboard.watchdog import StopReason, WatchdogConfig
from vrs.checks import validated, within
from vrs.mobile import DriveLimits
from vrs.mobile.model import braking

TOO_FAR = "the drive is to begin too far from where the robot is"
"""Why a new epoch isn't followed."""
NO_NUMBER = "what follows the path asks for no finite drive"
"""Why it stops by itself where nothing else says so."""
TOLD = 0.5
"""So often at least it's told how far the robot is with what it does by itself [s]."""


@dataclass(frozen=True, slots=True)
@validated
class DrivenConfig:
    """How a mobile robot's site behaves."""

    period: Annotated[float, within(1e-3, 1.0)] = 0.05
    """Between two drives [s], in [0.001, 1]."""
    beat: Annotated[float, within(1e-3, 10.0)] = 0.05
    """Between two reports [s], in [0.001, 10]."""
    begin_within: Annotated[float, within(0.0, 100.0)] = 0.3
    """So near to where it takes itself to be a drive must begin [m], in [0, 100]."""
    watchdog: WatchdogConfig | None = None
    """When the link counts as lost, and messages as too old; None: it holds, and no message is too old."""
    lost_after: Annotated[float, within(0.1, 60.0)] = 2.0
    """Without a watchdog, the operator is lost to what the robot does by itself after so long [s], in [0.1, 60]."""


class FollowingBase(RobotSite[DriveOrders, DriveReport]):
    """What runs beside a real mobile robot, all but its body: it follows the operator's path, epoch by epoch."""

    rearms = True

    def __init__(
        self,
        make: Callable[[Posture, float], ArchitectureRobotSite],
        position: PositionSource,
        limits: DriveLimits,
        *,
        now: float,
        world: Callable[[], float | None] = lambda: None,
        config: DrivenConfig | None = None,
        autonomy: Autonomy | None = None,
        sight: Callable[[], SensedPoints | None] = lambda: None,
    ) -> None:
        """Stand, and wait for an epoch.

        Args:
            make: Makes the architecture's parts for a drive that begins at a posture, so long ago [s].
            position: What tells where the robot is.
            limits: That every drive keeps.
            now: [s].
            world: Tells what time it is where the robot drives, see `DriveReport`.
            config: How to behave.
            autonomy: What it does by itself; None for nothing.
            sight: What it sees of its surroundings, once; None where there's nothing new.
        """
        self.config = DrivenConfig() if config is None else config
        reported = max(0, math.floor(1000.0 * now))
        super().__init__(self.config.watchdog, self.config.beat, now=now, reported=reported)
        self.autonomy, self._sight = autonomy, sight
        self._errand = 0
        self._unattended = False
        """Whether the operator was lost, and it goes on by itself nevertheless."""
        self._told: tuple[float, TaskReport] | None = None
        self._make, self._limits, self._world, self._now = make, limits, world, now
        if not isinstance(position, SoundPosition):
            position = SoundPosition(position, lambda: self._now)
        self._position: SoundPosition = position
        self._site: ArchitectureRobotSite | None = None
        self._began = 0.0
        self._driven_at = now
        self._drive = STAND
        self._posture = position.posture()

    @override
    def join(self, orders: DriveOrders, reason: str, *, now: float) -> None:
        super().join(orders, reason, now=now)
        self._site = None

    @override
    def _heed(self, orders: DriveOrders, now: float, *, counts: bool) -> None:
        for errand in orders.errands:
            self._do(errand, now, counts=counts)

    @override
    def _follow(self, orders: DriveOrders, now: float, *, new: bool) -> None:
        if new and orders.start is None:
            # The drive is over: the robot stands, and keeps no place.
            self._site = None
        if self._site is not None and not self.halted:
            self._site.receive(orders.packet, now=self._since(now))

    @property
    def doing(self) -> bool:
        """Whether it does something by itself."""
        return self.autonomy is not None and self.autonomy.doing is not Doing.NOTHING

    def _do(self, errand: Errand, now: float, *, counts: bool) -> None:
        """Do a task once; whatever only stops something counts however late it comes."""
        if errand.number <= self._errand:
            return
        if self.autonomy is None:
            self._errand = errand.number
            return
        fresh = counts and (not self.halted or self._unattended)
        if not fresh and not errand.task.stops:
            return
        self._errand = errand.number
        if not errand.task.stops:
            self._site = None
        self.autonomy.receive(errand.task, now=now)

    @override
    def _admits(self, orders: DriveOrders) -> bool:
        start = orders.start
        if start is None or self.doing:
            return False
        here = self._position.posture()
        if math.hypot(start.x - here.x, start.y - here.y) > self.config.begin_within:
            self._refused = TOO_FAR
            return False
        return True

    @override
    def _start(self, orders: DriveOrders, now: float) -> None:
        assert orders.start is not None
        self._unattended = False
        self._began = orders.began
        self._site = self._make(orders.start, self._since(now))

    def _since(self, now: float) -> float:
        """Time of the epoch [s]: the clocks may differ by as much as they are uncertain."""
        return max(0.0, now - self._began)

    @override
    def _watch(self, now: float) -> None:
        if self._unattended and not self.doing:
            self._halt(f"{LOST}, and it has carried on to the end", now)
        if self.watchdog is not None:
            super()._watch(now)
        elif self.doing and self._newest is not None and now >= self._newest[2] + self.config.lost_after:
            self._lose(now)

    @property
    @override
    def _carries_on(self) -> bool:
        return self._unattended

    @override
    def _lose(self, now: float) -> None:
        if self.autonomy is not None:
            self.autonomy.lost(LOST, now=now)
            self._unattended = self.doing and self.watchdog is not None

    def drive(self, *, now: float) -> Drive:
        """What to drive for the next period, from now [s] on."""
        self._watch(now)
        self._now = now
        if self._site is not None and not self.halted:
            drive, here = self._site.drive(now=self._since(now)), self._site.posture
            wrong = self._position.fault or ("" if all(map(math.isfinite, (*drive, *here))) else NO_NUMBER)
            if not wrong:
                self._posture, self._drive, self._driven_at = here, drive, now
                return drive
            self.halt(wrong, now=now)
        self._posture = self._position.posture()
        if self._position.fault and self.epoch and not self.halted:
            self.halt(self._position.fault, now=now)
        self._drive = self._by_itself(now)
        self._driven_at = now
        return self._drive

    def _by_itself(self, now: float) -> Drive:
        """What to drive that no operator's path says: to a goal, or to rest along the arc that it's on."""
        period, limits = self.config.period, self._limits
        wanted = None
        if self.autonomy is not None and not self.halted:
            wanted = self.autonomy.drive(self._posture, self._drive, now=now)
        if wanted is not None:
            return kept(wanted.v, wanted.w, self._drive.v, period, limits)
        steps = braking(self._drive, period, limits)
        return Drive(*steps[0]) if steps else STAND

    @override
    def rests(self, *, now: float) -> bool:
        """Whether the robot is at rest."""
        return is_still(self._drive)

    @override
    def halt(self, reason: str, *, now: float) -> None:
        """Stop along the arc that it's on, and wait for a new epoch."""
        self._stop_watching(StopReason.FAULT, now)
        self._halt(reason, now)

    def _halt(self, reason: str, now: float) -> None:
        if not self.halted:
            self.halted, self._due = reason, now
        self._unattended = False
        if self.autonomy is not None:
            self.autonomy.stop(reason, now=now)

    @override
    def _report(self, now: float) -> DriveReport:
        site = None if self.halted else self._site
        autonomy = self.autonomy
        player = site.controller if site is not None and isinstance(site.controller, TimelineController) else None
        return DriveReport(
            epoch=self.epoch or None,
            number=self._reports,
            sent_at=now,
            measured_at=self._driven_at,
            posture=self._posture,
            drive=self._drive,
            echo=self._newest,
            halted=self.halted,
            refused=self._refused,
            report=None if site is None else site.report(now=self._since(now)),
            play=None if player is None else player.reference.t_play,
            D=None if player is None else player.D,
            starved=player is not None and player.reference.starved,
            uncertainty=self._uncertainty,
            world=self._world(),
            errand=self._errand,
            doing=Doing.NOTHING if autonomy is None else autonomy.doing,
            left=0.0 if autonomy is None else autonomy.left,
            tasks=self._tasks(now),
            sight=self._sight(),
        )

    def _tasks(self, now: float) -> TaskReport | None:
        """How far it is with what it does by itself, where that's news or was told a while ago."""
        if self.autonomy is None:
            return None
        report = self.autonomy.report()
        if self._told is not None and self._told[1] == report and now < self._told[0] + TOLD:
            return None
        self._told = now, report
        return report


class DrivenHost(Host[FollowingBase, DriveOrders, DriveReport]):
    """See `Host`; what the body is to do is a drive for each control period."""

    orders = DriveOrders

    def drive(self, *, now: float) -> Drive:
        """What to drive for the next period, from the robot's time now [s] on."""
        return STAND if self.site is None else self.site.drive(now=self.site_time(now))
