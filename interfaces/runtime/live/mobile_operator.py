"""The operator's site of a mobile robot, live: the virtual robot, its clients, and the line to the real one."""

from __future__ import annotations

import asyncio
import contextlib
import math
import secrets
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from starlette.routing import BaseRoute
from typing_extensions import override

from interfaces.jobs import JobFile
from interfaces.link import LinkConditions
from interfaces.media import CameraConfig, LiveMedia, MediaDoor
from interfaces.messages.control import MOST_MESSAGES, Role
from interfaces.messages.drive_sites import Doing, DriveReport, RobotTask
from interfaces.messages.jobs import ArmJob, OperatorLoss
from interfaces.messages.mobile import Postures, Tasks
from interfaces.runtime.live.emulation import LiveEmulation
from interfaces.runtime.live.mobile_drawing import MobileDrawing, reality
from interfaces.runtime.live.mobile_tasks import TaskDesk
from interfaces.runtime.live.operator import SHOW
from interfaces.runtime.live.robot_client import GONE, RobotClient
from interfaces.stream.access import Access
from interfaces.stream.driving import DriveSite
from interfaces.stream.hub import Hub, HubConfig, Workers
from interfaces.stream.leasing import LeasedRobot
from interfaces.stream.meshcat.meshes import bodies
from interfaces.stream.meshcat.page import routes as view_routes
from interfaces.stream.server import HubServer
from interfaces.teleop.architectures import OperatorSurroundings
from interfaces.teleop.architectures.compositions import grid_of, operator_surroundings
from interfaces.teleop.halt import Halt, HaltCause, text_of
from interfaces.teleop.operator import OperatorSite
from interfaces.teleop.virtual_base import DriveLine, VirtualBase
from interfaces.timer import Turning
from robots.bullet.rooms import EMPTY, Room
from robots.onboard import LossPolicy
from robots.onboard.driving import Posture
from robots.onboard.lease import Ended, Grant, Lease, LeaseState
from robots.robot import Robot
from vrs.clock import WallClock, seconds_since_1970

PATIENCE = 6.0
"""So long after a lease ended the real robot may take to say that it stands [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class LiveMobileOperatorConfig:
    """An operator's site."""

    base: Robot
    """Which mobile robot."""
    room: Room
    """Where the robot drives: both sites have the same."""
    robot: str
    """Where the robot's site listens: `ws://HOST:PORT/site`; empty until that's known, see `RobotClient.url`."""
    conditions: LinkConditions
    """What is emulated on the way to the robot at first, both ways; clients may change it."""
    robot_token: str | None = field(default=None, repr=False)
    """Token of the role `site` at the robot."""
    seed: int = 0
    """Seed of the emulated link, ≥ 0."""
    server: str = "vrs"
    """Name and version of the program."""
    jobs: JobFile | None = None
    """Where the list of jobs is kept; nowhere unless given."""
    camera: CameraConfig | None = None
    """The robot's camera; None for none, nor voice and screen."""
    link_loss: LossPolicy | None = None
    """What the robot is to do when the link is lost; None leaves it to the robot."""
    arm: Callable[[ArmJob], float | str | None] = lambda _: None
    """Says of a program of the list how long it takes [s], why it'd fail, or None where nobody knows."""


class LiveMobileOperator(LeasedRobot, Workers):
    """The virtual robot and all that joins it to people and to the real one. Enter `running` in its loop."""

    def __init__(self, config: LiveMobileOperatorConfig, access: Access) -> None:
        """Session time begins here.

        Args:
            config: The site.
            access: Who may do what.
        """
        self.config = config
        self.clock = WallClock()
        start, model = Posture(*config.room.start), config.base.base
        virtual = VirtualBase(model, start, now=0.0, around=self._around)
        self.operator = OperatorSite(virtual, halted=Halt(HaltCause.NOT_MET))
        self.line = DriveLine(self.operator, config.conditions, np.random.default_rng(config.seed))
        self._turning = Turning(self.clock, self._turn)
        self.robot = RobotClient(
            self.line, config.robot, self.clock, self._turning.soon, name=config.base.name, room=config.room.name,
            token=config.robot_token, reports=DriveReport, link_loss=config.link_loss,
        )  # fmt: skip
        # Every lease of an earlier life has a smaller epoch.
        lease = Lease(epoch=int(seconds_since_1970()) << 32)
        hub = HubConfig(rates=(), server=config.server, instance=secrets.token_urlsafe(9))
        self.site = DriveSite(self.operator, model, room=config.room.name)
        self.emulation = LiveEmulation(self.line, self.robot, config.seed, lambda _, __: self._turning.soon())
        self.hub = Hub(self.site, lease, access, self, config=hub, emulation=self.emulation, workers=self)
        self.desk = TaskDesk(self.operator, config.room, model, self.hub.tell, config.jobs, config.arm)
        self.server = HubServer(self.hub, self.clock, health=self.health, turned=self._turning.soon)
        self.drawing = MobileDrawing(config.base, start, config.room, grid_of(config.room, start))
        self._view = view_routes(self.drawing.scene, authorize=lambda token: not access.refusal(Role.VIEWER, token))
        self.media = None if config.camera is None else self._media(config.camera)
        """Camera, voice and screen; None where there's no camera."""
        self._media_routes = [] if self.media is None else MediaDoor(self.media, access).routes
        self._wants_resume = False
        self._ending = -math.inf
        """Since when a lease is ending [s]; −∞ while none is."""
        self._states = 0

    @property
    def routes(self) -> list[BaseRoute]:
        """What it answers."""
        return [*self.server.routes, *self._view, *self._media_routes]

    def _media(self, camera: CameraConfig) -> LiveMedia:
        return LiveMedia(
            camera, self.config.room, self.clock,
            stand=self._stand,
            commands=lambda session, epoch: self.hub.commands(session, epoch, now=self.clock.now()),
            screen=self.drawing.scene.say,
        )  # fmt: skip

    def _stand(self, now: float) -> tuple[tuple[float, float, float], float]:
        """Where the real robot is, and the time in its room [s]; where it begins before it's been heard."""
        return reality(self.operator, now) or (self.config.room.start, 0.0)

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[LiveMobileOperator]:
        """Serve clients, and keep the robot connected."""
        media = contextlib.nullcontext() if self.media is None else self.media.running()
        async with self.server.running(), media:
            tasks = [asyncio.create_task(work) for work in (self.robot.run(), self._draw())]
            self._turning.start()
            try:
                yield self
            finally:
                self._turning.stop()
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)

    def _around(self, start: Posture) -> OperatorSurroundings | None:
        """What keeps the virtual robot out of the walls that are known."""
        room = self.config.room
        return None if room is EMPTY else operator_surroundings(room, start, self.config.base.base)

    async def _draw(self) -> None:
        """Draw both robots for those who look, once their bodies are made."""
        self.drawing.scene.dress(await asyncio.to_thread(bodies, self.config.base))
        while True:
            await asyncio.sleep(SHOW)
            self.drawing.follow(self.operator)
            if self.drawing.scene.readers:
                self.drawing.show(self.operator, now=self.clock.now())

    def _turn(self, now: float) -> float | None:
        report, steps = self.operator.report, self.operator.robot.steps
        for message in self.line.advance(now=now):
            self.robot.send(message)
        held = self.hub.lease_state is LeaseState.HELD
        if self._wants_resume or (held and self.operator.cause is HaltCause.STOPPED):
            # After a stop, too: the next drive begins where the real robot has come to rest.
            self._wants_resume = bool(self.operator.resume(now=now))
        self._end_lease(now)
        self.desk.turn()
        tasks = self.operator.robot.tasks
        if self.media is not None and tasks is not None:
            self.media.presenter.follow(tasks.says, tasks.shows)
        if self.operator.report is not report or self.operator.robot.steps != steps:
            self._show(now)
            self.server.kick()
        return self.line.next_deadline()

    @override
    def began(self, grant: Grant, *, now: float) -> None:
        """A lease has begun: a drive may begin."""
        self._wants_resume = True
        self._turning.soon()

    @override
    def ended(self, ended: Ended, *, now: float) -> None:
        """A lease has ended: the robots stop on their way."""
        self._ending, self._wants_resume = now, False
        if not self._carries_on:
            self.operator.robot.stop(now=now)
        self._turning.soon()

    @property
    def _carries_on(self) -> bool:
        """Whether the robot goes on with what it does by itself, also where nobody has control."""
        tasks, doing = self.operator.robot.tasks, self.operator.robot.doing
        return doing is not Doing.NOTHING and tasks is not None and tasks.loss is OperatorLoss.CARRY_ON

    @override
    def order(self, task: RobotTask, *, now: float) -> str:
        """Let the robot do something by itself; why it doesn't, empty if it does."""
        self._turning.soon()
        return self.desk.order(task)

    def tasks(self, answers: int | None = None) -> Tasks:
        """How that is."""
        return self.desk.tasks(answers)

    @override
    def resume(self, epoch: int, *, now: float) -> str:
        """Let a robot go on that stopped by itself; why it can't, empty if it does."""
        return self.operator.resume(now=now)

    def _end_lease(self, now: float) -> None:
        """Let the next one have the lease once both robots rest."""
        if self._ending == -math.inf or not self.operator.robot.stands:
            return
        if (
            self._carries_on
            or self.operator.robot.done
            or self.line.silence(now=now) >= GONE
            or now >= self._ending + PATIENCE
        ):
            self._ending = -math.inf
            self.operator.halted = Halt(HaltCause.FREE)
            self.hub.stopped(now=now)
            self.server.kick()

    def lose(self, reason: str) -> None:
        """The robot is lost for good: nothing is sent any more, and commands are refused with the reason."""
        self.robot.lost = self.operator.gone = reason
        self.operator.halt(Halt(HaltCause.GONE, reason))
        self._show(self.clock.now())
        self._turning.soon()

    def _show(self, now: float) -> None:
        """Tell clients where both robots are."""
        operator, report, deviation = self.operator, self.operator.report, self.operator.robot.deviation
        self._states += 1
        real: dict[str, Any] = {}
        if report is not None:
            real = {"t": report.measured_at, "real": report.posture, "drive": report.drive, "D": report.D}
            real |= {"starved": report.starved, "epoch": report.epoch}
        if deviation is not None and not operator.halted:
            real |= {"path_error": deviation.path_error, "time_difference": deviation.time_difference}
        self.hub.show(
            Postures(
                number=self._states,
                now=now,
                virtual=operator.robot.virtual(now),
                command=operator.robot.architecture.before,
                estimate=Posture(*operator.robot.architecture.estimator.posture.tolist()),
                connected=self.robot.connected,
                halted=operator.gone or ("" if operator.cause is HaltCause.BY_ITSELF else text_of(operator.halted)),
                drives=operator.robot.epochs,
                round_trip=operator.round_trip,
                messages=self.line.messages()[-MOST_MESSAGES:],
                **real,
            )
        )

    def health(self) -> dict[str, Any]:
        """How it is, for `/health`."""
        attached, report, deviation = self.robot.attached, self.operator.report, self.operator.robot.deviation
        return {
            "robot_at": self.robot.url,
            "room": self.config.room.name,
            "architecture": "" if attached is None else attached.architecture,
            **self.robot.health(),
            "halted": text_of(self.operator.halted),
            "epoch": self.operator.epoch,
            "drives": self.operator.robot.epochs,
            "doing": self.operator.robot.doing,
            "jobs": {"stage": self.desk.progress.stage, "problem": self.desk.problem},
            "D": None if report is None else report.D,
            "path_error": None if deviation is None else deviation.path_error,
            "time_difference": None if deviation is None else deviation.time_difference,
            "link_loss": None if attached is None else attached.link_loss,
            "timer_late": self._turning.lateness.worst,
            "media": None if self.media is None else self.media.health(),
        }
