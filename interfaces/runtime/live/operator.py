"""The operator's site, live: the virtual robot, its clients, and the line to the real one."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from starlette.routing import BaseRoute
from typing_extensions import override

from interfaces.engine_server.site import Site
from interfaces.link import LinkConditions
from interfaces.messages.control import MOST_MESSAGES, Role, State
from interfaces.messages.fields import Epoch
from interfaces.messages.sites import Report
from interfaces.recording.errors import RecordingError
from interfaces.recording.live import TURN as RECORD
from interfaces.recording.live import LiveRecorder, LiveRecording
from interfaces.runtime.live.emulation import LiveEmulation
from interfaces.runtime.live.process import warm
from interfaces.runtime.live.robot_client import GONE, RobotClient
from interfaces.stream.access import Access
from interfaces.stream.hub import Hub, HubConfig
from interfaces.stream.leasing import LeasedRobot
from interfaces.stream.meshcat import Committed, TwinScene
from interfaces.stream.meshcat.meshes import bodies
from interfaces.stream.meshcat.page import routes as view_routes
from interfaces.stream.server import HubServer
from interfaces.teleop import OperatorSite, OperatorSiteConfig, RobotLine, VirtualArm
from interfaces.teleop.halt import Halt, HaltCause, text_of
from interfaces.timer import Turning
from robots.onboard import LossPolicy
from robots.onboard.lease import Ended, Grant, Lease
from robots.robot import Robot
from vrs.clock import WallClock, seconds_since_1970
from vrs.commands import Stop
from vrs.errors import InvalidValueError, VrsError
from vrs.model import Array

SHOW = 1.0 / 60.0
"""Time between two frames of the view [s]."""
TOLD_AGAIN = 0.2
"""Clients are told of a late measurement for so long [s]: not every state reaches everyone."""


@dataclass(frozen=True, slots=True, eq=False)
class LiveOperatorConfig:
    """An operator's site."""

    arm: Robot
    """Which arm."""
    q: Array
    """Where the virtual robot stands at first [rad], (n,); it goes to where the real one is met."""
    robot: str
    """Where the robot's site listens: `ws://HOST:PORT/site`; empty until that's known, see `RobotClient.url`."""
    conditions: LinkConditions
    """What is emulated on the way to the robot at first, both ways; clients may change it."""
    robot_token: str | None = field(default=None, repr=False)
    """Token of the role `site` at the robot."""
    seed: int = 0
    """Seed of the emulated link, ≥ 0."""
    rates: tuple[float, ...] = (60.0, 30.0, 10.0)
    """Rates of the broadcasters [1/s]."""
    site: OperatorSiteConfig = field(default_factory=OperatorSiteConfig)
    """How the operator's site sends."""
    server: str = "vrs"
    """Name and version of the program."""
    recording: LiveRecording | None = None
    """What is recorded; None for nothing."""
    link_loss: LossPolicy | None = None
    """What the robot is to do when the link is lost; None leaves it to the robot."""


class LiveOperator(LeasedRobot):
    """The virtual robot and all that joins it to people and to the real one. Enter `running` in its loop."""

    def __init__(self, config: LiveOperatorConfig, access: Access) -> None:
        """Session time begins here.

        Args:
            config: The site.
            access: Who may do what.

        Raises:
            RecordingError: If it's to be recorded and the file can't be made.
        """
        self.config = config
        model = config.arm.arm
        warm(model, config.q)
        self.clock = WallClock()
        virtual = VirtualArm(model, config.q, now=0.0, config=config.site)
        self.operator = OperatorSite(virtual, halted=Halt(HaltCause.NOT_MET))
        self.site = Site(self.operator.robot.engine)
        self.line = RobotLine(self.operator, config.conditions, np.random.default_rng(config.seed))
        self.recorder: LiveRecorder | None = None
        self._recording: asyncio.Task[None] | None = None
        self._recording_changes, self._closed = asyncio.Lock(), False
        if config.recording is not None:
            began = seconds_since_1970() - self.clock.now()
            self.recorder = LiveRecorder(config.recording, self.line, seed=config.seed, began=began)
            self.recorder.open()
        self._turning = Turning(self.clock, self._turn)
        self.robot = RobotClient(
            self.line, config.robot, self.clock, self._turning.soon, name=config.arm.name,
            token=config.robot_token, link_loss=config.link_loss,
        )  # fmt: skip
        # Every lease of an earlier life has a smaller epoch.
        lease = Lease(epoch=int(seconds_since_1970()) << 32)
        hub = HubConfig(rates=config.rates, server=config.server, instance=secrets.token_urlsafe(9))
        self.emulation = LiveEmulation(self.line, self.robot, config.seed, self._rerouted)
        self.hub = Hub(self.site, lease, access, self, config=hub, emulation=self.emulation)
        self.server = HubServer(self.hub, self.clock, health=self.health, turned=self._turning.soon)
        self.scene = TwinScene(config.arm)
        self._view = view_routes(self.scene, authorize=lambda token: not access.refusal(Role.VIEWER, token))
        self._wants_resume = self._ending = False
        self._shown: tuple[Report | None, bool, str] = (None, False, "")
        self._states = 0

    @property
    def routes(self) -> list[BaseRoute]:
        """What it answers."""
        return [*self.server.routes, *self._view]

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[LiveOperator]:
        """Serve clients, and keep the robot connected."""
        async with self.server.running():
            tasks = [asyncio.create_task(work) for work in (self.robot.run(), self._draw())]
            if self.recorder is not None:
                self._go_on_recording(self.recorder)
            self._turning.start()
            try:
                yield self
            finally:
                self._turning.stop()
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
                self._closed = True
                await self.end_recording()

    async def _draw(self) -> None:
        """Draw both robots for those who look, once their bodies are made."""
        self.scene.dress(await asyncio.to_thread(bodies, self.config.arm))
        while True:
            await asyncio.sleep(SHOW)
            if not self.scene.readers:
                continue
            now, report, timeline = self.clock.now(), self.operator.report, self.operator.robot.engine.timeline
            follows = report is not None and not self.operator.halted
            path = Committed(timeline, report.q_at) if follows and report is not None else None
            real = None if report is None else report.q
            self.scene.show(virtual=timeline.sample(now), real=real, path=path, now=now)

    async def begin_recording(self, what: LiveRecording) -> None:
        """Record from now on; the loop doesn't wait for the disk.

        Raises:
            RecordingError: If the file can't be made.
            InvalidValueError: If something is being recorded already, or it's all over.
        """
        async with self._recording_changes:
            if self.recorder is not None or self._closed:
                raise InvalidValueError("recording", what.path.name, "begun once the other one has ended")
            now, config = self.clock.now(), self.config
            recorder = LiveRecorder(what, self.line, seed=config.seed, began=seconds_since_1970(), now=now)
            try:
                await asyncio.to_thread(recorder.open)
            except RecordingError:
                recorder.leave()
                raise
            self.recorder = recorder
            self._go_on_recording(recorder)

    async def end_recording(self) -> str | None:
        """Close what is being recorded; what was wrong with it, None if nothing was."""
        async with self._recording_changes:
            recorder, task = self.recorder, self._recording
            if recorder is None or task is None:
                return None
            task.cancel()
            await asyncio.wait([task])
            recorder.end(now=self.clock.now())
            await asyncio.to_thread(recorder.close)
            self.recorder = self._recording = None
            return recorder.problem

    def _go_on_recording(self, recorder: LiveRecorder) -> None:
        def stopped(task: asyncio.Task[None]) -> None:
            """Nothing is recorded any more: say why, unless it's all over."""
            if not task.cancelled() and (error := task.exception()) is not None:
                recorder.stop(str(error) or type(error).__name__)

        self._recording = asyncio.create_task(self._record(recorder))
        self._recording.add_done_callback(stopped)

    async def _record(self, recorder: LiveRecorder) -> None:
        """Let what has happened be recorded."""
        while True:
            await asyncio.sleep(RECORD)
            recorder.advance(now=self.clock.now(), connected=self.robot.connected)

    def _turn(self, now: float) -> float | None:
        version = self.operator.robot.engine.timeline.version
        for message in self.line.advance(now=now):
            self.robot.send(message)
        if self._wants_resume and (not self.operator.halted or not self.operator.resume(now=now)):
            self._wants_resume = False
        self._end_lease(now)
        self._show(now)
        if self.operator.robot.engine.timeline.version != version:
            self.server.kick()
        return self.line.next_deadline()

    @override
    def began(self, grant: Grant, *, now: float) -> None:
        """A lease has begun: a robot that had stopped by itself may go on."""
        self._wants_resume = True
        self._turning.soon()

    @override
    def ended(self, ended: Ended, *, now: float) -> None:
        """A lease has ended: the robots stop on their way."""
        self._ending, self._wants_resume = True, False
        with contextlib.suppress(VrsError):
            self.operator.robot.execute(Stop(), now=now)
        self._turning.soon()

    @override
    def resume(self, epoch: int, *, now: float) -> str:
        """Let a robot go on that stopped by itself; why it can't, empty if it does."""
        return self.operator.resume(now=now)

    def _rerouted(self, now: float, text: str) -> None:
        """The emulated way to the robot has changed."""
        if self.recorder is not None:
            self.recorder.tell(now, "rerouted", text)
        self._turning.soon()

    def _end_lease(self, now: float) -> None:
        """Let the next one have the lease once both robots rest."""
        report, end = self.operator.report, self.operator.robot.engine.timeline.end
        if not self._ending or now < end:
            return
        heard = self.line.silence(now=now) < GONE
        if report is not None and heard and not report.halted:
            follows = report.epoch != self.operator.epoch or report.play < end
        else:
            follows = False
        if not follows:
            self._ending = False
            self.hub.stopped(now=now)
            self.server.kick()

    def lose(self, reason: str) -> None:
        """The robot is lost for good: nothing is sent any more, and commands are refused with the reason."""
        self.robot.lost = self.operator.gone = reason
        self._turning.soon()

    def _show(self, now: float) -> None:
        """Tell clients where the real robot is, when that's news."""
        report = self.operator.report
        halted = self.operator.gone or text_of(self.operator.halted)
        shown = report, self.robot.connected, halted
        if report is None or shown == self._shown:
            return
        self._shown = shown
        self._states += 1
        expected = self.operator.robot.engine.timeline.sample(report.q_at)
        self.hub.show(
            State(
                number=self._states,
                t=report.measured_at,
                q=report.q,
                play=report.q_at,
                pace=report.pace,
                D=report.q_at - report.measured_at,
                following_error=float(np.abs(expected - report.q).max()),
                epoch=Epoch(report.epoch) if report.epoch else None,
                connected=self.robot.connected,
                halted=halted,
                corrections=len(self.operator.robot.corrections),
                reference=report.reference,
                round_trip=self.operator.round_trip,
                messages=self.line.messages()[-MOST_MESSAGES:],
                late=tuple((one.t, one.q) for one in self.operator.robot.gathering.late(since=now - TOLD_AGAIN)),
            )
        )
        self.server.kick()

    def health(self) -> dict[str, Any]:
        """How it is, for `/health`."""
        report, attached, halted = self.operator.report, self.robot.attached, self.operator.halted
        return {
            **self.robot.health(halted.text if halted is not None and halted.cause is HaltCause.STUCK else ""),
            "halted": text_of(halted),
            "epoch": self.operator.epoch,
            "corrections": len(self.operator.robot.corrections),
            "behind": None if report is None or report.halted else report.measured_at - report.q_at,
            "link_loss": None if attached is None else attached.link_loss,
            "offset": None if attached is None else attached.offset,
            "timer_late": self._turning.lateness.worst,
            "recording": None if self.recorder is None else self.recorder.health(),
        }
