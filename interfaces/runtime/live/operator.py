"""The operator's site, live: the virtual robot, its clients, and the line to the real one, whatever moves them."""

from __future__ import annotations

import asyncio
import contextlib
import math
import secrets
from collections.abc import AsyncIterator, Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

import numpy as np
from starlette.routing import BaseRoute
from typing_extensions import override

from interfaces.jobs import JobFile
from interfaces.link import LinkConditions
from interfaces.media import CameraConfig
from interfaces.messages.control import Role
from interfaces.messages.jobs import ArmJob, RobotTask, Tasks
from interfaces.recording.live import LiveRecording
from interfaces.runtime.live.base_twins import BaseTwins
from interfaces.runtime.live.devices import MediaDevice, OperatorDevice
from interfaces.runtime.live.emulation import LiveEmulation
from interfaces.runtime.live.recording import SiteRecording
from interfaces.runtime.live.robot_client import GONE, RobotClient
from interfaces.runtime.live.task_desk import TaskDesk
from interfaces.runtime.live.twins import ArmTwins
from interfaces.stream.access import Access
from interfaces.stream.audit import AuditLog
from interfaces.stream.certificates import Certificate
from interfaces.stream.hub import Hub, HubConfig, Workers
from interfaces.stream.leasing import LeasedRobot
from interfaces.stream.meshcat.meshes import bodies
from interfaces.stream.meshcat.newest import Nodes
from interfaces.stream.meshcat.page import routes as view_routes
from interfaces.stream.server import HubServer, admit
from interfaces.teleop import OperatorSiteConfig
from interfaces.teleop.operator import Halt, HaltCause, text_of
from interfaces.timer import Turning
from robots.base import upright
from robots.onboard.lease import Ended, Grant, Lease, LeaseState
from robots.onboard.watchdog import LossPolicy
from robots.robot import Robot
from robots.rooms import EMPTY, Posture, Room
from robots.things import Scene
from vrs.clock import Clock, WallClock, seconds_since_1970
from vrs.errors import UnreachablePoseError, VrsError
from vrs.model import Array

SHOW = 1.0 / 60.0
"""Time between two frames of the view [s]."""
APART = 1.5
"""Arms in one world stand so far to the left of where mobile robots begin, and of each other [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class LiveOperatorConfig:
    """An operator's site."""

    which: Robot
    """Which robot."""
    robot: str
    """Where the robot's site listens: `ws://HOST:PORT/site`; empty until that's known, see `RobotClient.url`."""
    conditions: LinkConditions
    """What is emulated on the way to the robot at first, both ways; clients may change it."""
    robot_token: str | None = field(default=None, repr=False)
    """Token of the role `site` at the robot."""
    robot_certificate: Certificate | None = None
    """What is shown to it by TLS; None for nothing."""
    seed: int = 0
    """Seed of the emulated link, ≥ 0."""
    server: str = "vrs"
    """Name and version of the program."""
    link_loss: LossPolicy | None = None
    """What the robot is to do when the link is lost; None leaves it to the robot."""
    recording: LiveRecording | None = None
    """What is recorded from the beginning; None for nothing."""
    q: Array | None = None
    """Where a virtual arm stands at first [rad], (n,): its usual pose unless given; it goes to where the real one
    is met."""
    rates: tuple[float, ...] = (60.0, 30.0, 10.0)
    """Rates of an arm's broadcasters [1/s]."""
    site: OperatorSiteConfig = field(default_factory=OperatorSiteConfig)
    """How an arm's site sends."""
    room: Room = EMPTY
    """Where a mobile robot drives: both sites have the same."""
    jobs: JobFile | None = None
    """Where its list of jobs is kept; nowhere unless given."""
    camera: CameraConfig | None = None
    """Its camera; None for none, nor voice and screen."""
    datagrams: bool = False
    """Whether messages are also sent as datagrams, where the robot takes them."""
    say: Callable[[str], None] = lambda _: None
    """Is told, for people, why there's no connection to the robot, and once that no datagram gets through."""
    arm: Callable[[ArmJob], float | str | None] = lambda _: None
    """Says of a program of the list how long it takes [s], why it'd fail, or None where nobody knows."""
    in_order: bool = False
    """Whether operators get control in the order in which they connect."""


class LiveOperator(LeasedRobot, Workers):
    """The virtual robot and all that joins it to people and to the real one. Enter `running` in its loop."""

    def __init__(
        self,
        config: LiveOperatorConfig,
        access: Access,
        *,
        clock: Clock | None = None,
        audit: AuditLog | None = None,
    ) -> None:
        """Session time begins here, unless another robot's site began it.

        Args:
            config: The site.
            access: Who may do what.
            clock: Session time, where several sites share it.
            audit: Where it's written who has control, and what is refused; nowhere unless given.

        Raises:
            RecordingError: If it's to be recorded and the file can't be made.
        """
        self.config, which = config, config.which
        twins: ArmTwins | BaseTwins
        if which.is_base:
            twins = BaseTwins(which, config.conditions, config.seed, config.room)
        else:
            twins = ArmTwins(
                which, config.conditions, config.seed, q=config.q, config=config.site, rates=config.rates
            )
        if not which.is_base:
            # What a model loads when it's first asked, nobody waits for.
            q = which.arm.poses["nominal"]
            with contextlib.suppress(UnreachablePoseError):
                which.arm.inverse_near(which.arm.forward(q), q)
        self.clock = WallClock() if clock is None else clock
        self.twins, self.operator, self.line, self.scene = twins, twins.operator, twins.line, twins.scene
        self._turning = Turning(self.clock, self._turn)
        self.robot = RobotClient(
            self.line, config.robot, self.clock, self._turning.soon, name=which.name, room=twins.room,
            token=config.robot_token, certificate=config.robot_certificate, reports=twins.reports,
            link_loss=config.link_loss, datagrams=config.datagrams, say=config.say,
        )  # fmt: skip
        # Every lease of an earlier life has a smaller epoch.
        lease = Lease(epoch=int(seconds_since_1970()) << 32)
        hub = HubConfig(rates=(), server=config.server, instance=secrets.token_urlsafe(9), in_order=config.in_order)
        self.emulation = LiveEmulation(self.line, self.robot, config.seed, self._rerouted)
        workers = self if which.is_base else None
        self.hub = Hub(
            twins.site, lease, access, self, config=hub, emulation=self.emulation, workers=workers, audit=audit
        )
        self.server = HubServer(self.hub, self.clock, health=self.health, turned=self._turning.soon)
        self._view = view_routes(self.scene, authorize=partial(admit, access, Role.VIEWER))
        self.recording = SiteRecording(
            config.recording, self.line, self.clock, lambda: self.robot.connected, self._around, seed=config.seed
        )
        """What is recorded here."""
        self.desk: TaskDesk | None = None
        """What lets a mobile robot do something by itself."""
        self.devices: tuple[OperatorDevice, ...] = (self.recording,)
        """What stands here beside the robots' motion."""
        if isinstance(twins, BaseTwins):
            self.desk = TaskDesk(twins.operator, config.room, which.base, self.hub.tell, config.jobs, config.arm)
            media = MediaDevice(config.camera, config.room, twins, self.hub, self.clock, access)
            self.devices = *self.devices, self.desk, media
        self._wants_resume = False
        self._ending: float | None = None
        """Since when a lease is ending [s]; None while none is."""
        self._told: Hashable = (False, "", twins.news)
        self._states = 0

    def _around(self) -> Scene | None:
        """What is around an arm; None while nothing is known that it could grasp."""
        attached = self.robot.attached
        return None if attached is None else attached.scene

    @property
    def routes(self) -> list[BaseRoute]:
        """What it answers."""
        return [*self.server.routes, *self._view, *(route for device in self.devices for route in device.routes)]

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[LiveOperator]:
        """Serve clients, and keep the robot connected."""
        async with contextlib.AsyncExitStack() as stack:
            await stack.enter_async_context(self.server.running())
            for device in self.devices:
                await stack.enter_async_context(device.running())
            tasks = [asyncio.create_task(work) for work in (self.robot.run(), self._draw())]
            self._turning.start()
            try:
                yield self
            finally:
                self._turning.stop()
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)

    async def _draw(self) -> None:
        """Draw both robots for those who look, once their bodies are made."""
        self.scene.dress(await asyncio.to_thread(bodies, self.config.which))
        while True:
            await asyncio.sleep(SHOW)
            self.twins.draw(self.robot.attached, now=self.clock.now())

    def _turn(self, now: float) -> float | None:
        operator = self.operator
        version = operator.robot.engine.timeline.version
        for message in self.line.advance(now=now):
            self.robot.send(message)
        held = self.hub.lease_state is LeaseState.HELD
        if self._wants_resume or (held and operator.cause is HaltCause.STOPPED):
            # After a stop, too: a drive begins where the real robot has come to rest.
            self._wants_resume = bool(operator.halted and operator.resume(now=now))
        self._end_lease(now)
        for device in self.devices:
            device.turn()
        if self._tell(now) or operator.robot.engine.timeline.version != version:
            self.server.kick()
        return self.line.next_deadline()

    def _tell(self, now: float) -> bool:
        """Tell clients where both robots are, when that's news; whether it is."""
        connected = self.robot.connected
        news = connected, self.twins.halted, self.twins.news
        if news == self._told:
            return False
        state = self.twins.state(self._states + 1, connected=connected, now=now)
        if state is None:
            return False
        self._told, self._states = news, state.number
        self.hub.show(state)
        return True

    @property
    @override
    def met(self) -> bool:
        """Whether the real robot has been heard."""
        return self.robot.attached is not None

    @override
    def began(self, grant: Grant, *, now: float) -> None:
        """A lease has begun: a robot that had stopped by itself may go on."""
        self._wants_resume = True
        self._turning.soon()

    @override
    def ended(self, ended: Ended, *, now: float) -> None:
        """A lease has ended: the robots stop on their way, unless the real one is to carry on by itself."""
        self._ending, self._wants_resume = now, False
        if not self._carries_on:
            with contextlib.suppress(VrsError):
                self.operator.robot.stop(now=now)
        self._turning.soon()

    @property
    def _carries_on(self) -> bool:
        return self.desk is not None and self.desk.carries_on

    def _end_lease(self, now: float) -> None:
        """Let the next one have the lease once both robots rest."""
        since, robot = self._ending, self.operator.robot
        if since is None or not robot.rests(now=now):
            return
        gone = self.line.silence(now=now) >= GONE or now >= since + self.twins.patience
        if self._carries_on or robot.done or gone:
            self._ending = None
            self.twins.freed()
            self.hub.stopped(now=now)
            self.server.kick()

    @override
    def resume(self, epoch: int, *, now: float) -> str:
        """Let a robot go on that stopped by itself; why it can't, empty if it does."""
        return self.operator.resume(now=now)

    @override
    def order(self, task: RobotTask, *, now: float) -> str:
        """Let the robot do something by itself; why it doesn't, empty if it does."""
        assert self.desk is not None
        self._turning.soon()
        return self.desk.order(task)

    @override
    def tasks(self, answers: int | None = None) -> Tasks:
        """How that is."""
        assert self.desk is not None
        return self.desk.tasks(answers)

    def _rerouted(self, now: float, text: str) -> None:
        """The emulated way to the robot has changed."""
        self.recording.rerouted(now, text)
        self._turning.soon()

    def lose(self, reason: str) -> None:
        """The robot is lost for good: nothing is sent any more, and commands are refused with the reason."""
        self.robot.lost = self.operator.gone = reason
        self.operator.halt(Halt(HaltCause.GONE, reason))
        self._turning.soon()

    def health(self) -> dict[str, Any]:
        """How it is, for `/health`."""
        operator, attached, halted = self.operator, self.robot.attached, self.operator.halted
        stuck = halted.text if halted is not None and halted.cause is HaltCause.STUCK else ""
        return {
            **self.robot.health(stuck),
            "halted": text_of(halted),
            "epoch": operator.epoch,
            **self.twins.health(attached),
            "link_loss": None if attached is None else attached.link_loss,
            "timer_late": self._turning.lateness.worst,
            **{device.name: device.health() for device in self.devices},
        }


TWINS: Final = frozenset({"virtual", "real", "committed"})
"""What of a robot is seen in others' scenes of a fleet: not the way that it has driven."""
SURROUNDINGS: Final = frozenset({"room", "doors", "people"})
"""What of a mobile robot's scene is the room's, which all of a fleet have in common."""


def share_world(
    sites: Sequence[LiveOperator], starts: Sequence[Posture] | None = None, overview: Nodes | None = None
) -> None:
    """Let each robot be seen in the scenes of the others, where it stands in one world; before any site runs.

    Mobile robots are where their room has them. Arms stand in a row to the left of where those begin, `APART` from
    each other, unless it's said where; their feet are on the floor. It takes a moment.

    Args:
        sites: The robots'.
        starts: Of a fleet, where each begins, or its base stands; None for no fleet.
        overview: A scene that shows all of a fleet.
    """
    places, arms = [], 0
    for k, site in enumerate(sites):
        X = np.eye(4)
        if not site.config.which.is_base:
            arms += 1
            x, y, theta = site.config.room.start
            aside = arms * APART
            X[:2, 3] = x - aside * math.sin(theta), y + aside * math.cos(theta)
            if starts is not None:
                X = upright(*starts[k])
            X[2, 3] = -bodies(site.config.which)[1]
        places.append(X)
    parts = None if starts is None else TWINS
    for site, X_WA in zip(sites, places, strict=True):
        for other, X_WB in zip(sites, places, strict=True):
            if other is not site:
                other.scene.show_in(site.scene, other.config.which.name, np.linalg.inv(X_WA) @ X_WB, parts)
    if overview is None:
        return
    for site, X_WA in zip(sites, places, strict=True):
        site.scene.show_in(overview, site.config.which.name, X_WA, TWINS)
    for host, X_WH in zip(sites, places, strict=True):
        if host.config.which.is_base:
            # All of them have the same room: the first one's is shown where there's none.
            host.scene.show_in(overview, "room", X_WH, SURROUNDINGS)
            for site, X_WA in zip(sites, places, strict=True):
                if not site.config.which.is_base:
                    host.scene.show_in(site.scene, "room", np.linalg.inv(X_WA) @ X_WH, SURROUNDINGS)
            break
