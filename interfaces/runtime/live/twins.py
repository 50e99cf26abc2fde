"""What a live operator's site has of its two robots, whatever moves them: how both are told of, and drawn."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Hashable, Sequence
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np
from typing_extensions import override

from interfaces.engine_server.site import Site
from interfaces.link import LinkConditions
from interfaces.messages.control import MOST_MESSAGES, Attached, Postures, State
from interfaces.messages.fields import Epoch
from interfaces.messages.sites import Report
from interfaces.runtime.live.process import warm
from interfaces.stream.meshcat import Committed, TwinScene
from interfaces.teleop import OperatorSite, OperatorSiteConfig, RobotLine, VirtualArm
from interfaces.teleop.connection import SiteLine
from interfaces.teleop.operator import Halt, HaltCause, VirtualRobot, text_of
from interfaces.teleop.predicted_grasp import Hands, PredictedGrasp
from robots.robot import Robot
from vrs.model import Array, home

TOLD_AGAIN = 0.2
"""Clients are told of a late measurement for so long [s]: not every state reaches everyone."""

V = TypeVar("V", bound=VirtualRobot[Any, Any])


class LiveTwins(Protocol[V]):
    """Both robots of one kind: what is served of them, what clients are told of them, and what viewers see."""

    reports: ClassVar[type]
    """What the real one sends."""
    patience: ClassVar[float] = math.inf
    """So long after a lease ended the real one may take to say that it stands [s]."""
    room: str = ""
    """Name of the room that both drive in; empty for arms."""
    operator: OperatorSite[V]
    """The operator's site."""
    line: SiteLine[V, Any, Any]
    """To the real one."""
    site: Site
    """What a hub serves."""
    scene: TwinScene
    """What all viewers see, once it's dressed."""

    @property
    @abstractmethod
    def news(self) -> Hashable:
        """What clients are told of as soon as it changes."""

    @abstractmethod
    def state(self, number: int, *, connected: bool, now: float) -> State | Postures | None:
        """Where both are, as clients are told; None while nothing is known.

        Args:
            number: Of the message.
            connected: Whether the real one is heard of.
            now: Session time [s].
        """

    @abstractmethod
    def draw(self, attached: Attached | None, *, now: float) -> None:
        """Draw both for those who look, and note what's to be drawn later.

        Args:
            attached: What the real one said of itself; None while there's no connection.
            now: Session time [s].
        """

    @abstractmethod
    def freed(self) -> None:
        """Nobody has control any more, and both rest."""

    @abstractmethod
    def health(self, attached: Attached | None) -> dict[str, Any]:
        """How they are, for `/health`.

        Args:
            attached: See `draw`.
        """

    @property
    def halted(self) -> str:
        """Why the real one doesn't follow, for people; empty while it does."""
        return self.operator.gone or text_of(self.operator.halted)


class ArmTwins(LiveTwins[VirtualArm]):
    """Two arms."""

    reports = Report

    def __init__(
        self,
        robot: Robot,
        conditions: LinkConditions,
        seed: int,
        *,
        q: Array | None,
        config: OperatorSiteConfig,
        rates: Sequence[float],
    ) -> None:
        """Make the operator's site at session time 0.

        Args:
            robot: Which arm.
            conditions: Of the way to the real one.
            seed: Of what is random there.
            q: Where the virtual one stands at first [rad], (n,): the usual pose unless given.
            config: How the operator's site sends.
            rates: Of the broadcasters [1/s].
        """
        model = robot.arm
        q = home(model) if q is None else q
        warm(model, q)
        virtual = VirtualArm(model, q, now=0.0, config=config, stroke=robot.stroke)
        self._grasp = None if robot.hand is None else PredictedGrasp(robot.hand)
        self.operator = OperatorSite(virtual, halted=Halt(HaltCause.NOT_MET))
        self.line: RobotLine = RobotLine(self.operator, conditions, np.random.default_rng(seed))
        self.site = Site(virtual.engine)
        for rate in rates:
            self.site.broadcast(rate)
        self.scene = TwinScene(robot)

    @property
    @override
    def news(self) -> Hashable:
        return self.operator.report

    @override
    def state(self, number: int, *, connected: bool, now: float) -> State | None:
        operator, report = self.operator, self.operator.report
        if report is None:
            return None
        virtual = operator.robot
        expected = virtual.engine.timeline.sample(report.q_at)
        return State(
            number=number,
            t=report.measured_at,
            q=report.q,
            play=report.q_at,
            pace=report.pace,
            D=report.q_at - report.measured_at,
            following_error=float(np.abs(expected - report.q).max()),
            epoch=Epoch(report.epoch) if report.epoch else None,
            connected=connected,
            halted=self.halted,
            corrections=len(virtual.corrections),
            reference=report.reference,
            round_trip=operator.round_trip,
            messages=self.line.messages()[-MOST_MESSAGES:],
            late=tuple((one.t, one.q) for one in virtual.gathering.late(since=now - TOLD_AGAIN)),
            hand=report.hand,
        )

    @override
    def draw(self, attached: Attached | None, *, now: float) -> None:
        if not self.scene.readers:
            return
        operator, report = self.operator, self.operator.report
        path = None
        if report is not None and not operator.halted:
            path = Committed(operator.robot.engine.timeline, report.q_at)
        real = None if report is None else report.q
        if attached is not None and attached.scene is not None and self._grasp is not None:
            if attached.scene != self._grasp.scene:
                self._grasp.scene = attached.scene
            self.scene.furnish(attached.scene)
        q = operator.robot.shown(now=now)
        self.scene.show(virtual=q, real=real, path=path, hands=self._hands(q, now), now=now)

    def _hands(self, q: Array, now: float) -> Hands | None:
        """Both hands: the virtual one as it's told, the real one as it's measured, else as it's told."""
        virtual, report = self.operator.robot, self.operator.report
        if self._grasp is None:
            return None
        goals = virtual.engine.scheduler.grips
        X = virtual.engine.model.forward(q)
        opening, predicted = self._grasp.advance(X, goals, virtual.things, now=now)
        real = None if report is None else self._grasp.fingers.opening(goals, report.q_at)
        return Hands(opening, real if virtual.hand is None else virtual.hand.opening, virtual.things, predicted)

    @override
    def freed(self) -> None:
        """Whoever has control next goes on with the same plan."""

    @override
    def health(self, attached: Attached | None) -> dict[str, Any]:
        report = self.operator.report
        return {
            "corrections": len(self.operator.robot.corrections),
            "behind": None if report is None or report.halted else report.measured_at - report.q_at,
            "offset": None if attached is None else attached.offset,
        }
