"""What motions need of a robot: somewhere to send commands, its timeline, and how the other twin is."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, Protocol, TypeAlias

from typing_extensions import override

from interfaces.clients.designer import Issued
from interfaces.messages import Refusal, RefusalCode
from interfaces.messages.control import HandReport
from interfaces.teleop.operator import OperatorSite, text_of
from interfaces.teleop.virtual_arm import VirtualArm
from vrs.clock import ManualClock
from vrs.commands import Command
from vrs.engine import Engine
from vrs.errors import VrsError
from vrs.ledger import Receipt
from vrs.model import Array, RobotModel
from vrs.timeline import Timeline


@dataclass(frozen=True, slots=True, eq=False)
class OtherTwin:
    """What is known of the twin that isn't the operator's."""

    q: Array | None = None
    """Joints as they were measured last [rad], (n,); None where there's none."""
    halted: str = ""
    """Why it doesn't follow, having stopped by itself; empty while it does."""
    hand: HandReport | None = None
    """Its hand as it was measured last; None of one that isn't."""
    hand_at: float = -math.inf
    """The time on the timeline that it played then [s]."""


class RobotPort(Protocol):
    """A robot's timeline, and the way to it. Times are session time [s]."""

    fault_poll_interval: float
    """How often it's to be asked for trouble while it moves [s]; infinity where its driver does so anyway."""
    newest: int
    """Number of the newest thing that was asked for; 0 before."""
    has_fingers: bool = False
    """Whether it has fingers that are to be moved."""

    @property
    def model(self) -> RobotModel:
        """Its kinematics and limits."""

    @property
    def timeline(self) -> Timeline:
        """What the operator's twin did and will do, as far as it's known."""

    @property
    def other(self) -> OtherTwin:
        """How the other twin is."""

    @property
    def lost(self) -> bool:
        """Whether nothing can be heard of it now."""

    def ask(self, command: Command | None, *, now: float) -> int:
        """Ask for something; None takes back the newest command.

        Returns:
            The number by which `outcome` tells what came of it.
        """

    def outcome(self, number: int, *, now: float) -> Issued | None:
        """What became of it by now, as later commands left it; None while nothing was heard."""


Execute: TypeAlias = Callable[[Command | None, float], Receipt | Refusal | None]
"""Carries a command out at a time [s], or takes back the newest where it's None; None where there's none."""
REMEMBERED: Final = 256
"""Answers that are kept."""


class EngineRobot(RobotPort):
    """An engine in this process; a manual clock of it is set to the time of each call."""

    lost = False

    def __init__(
        self, engine: Engine, execute: Execute | None = None, *, fault_poll_interval: float = math.inf
    ) -> None:
        """Reach an engine.

        Args:
            engine: The engine.
            execute: The way to it, where it isn't called directly.
            fault_poll_interval: See `RobotPort`.
        """
        self.engine, self.fault_poll_interval = engine, fault_poll_interval
        self._execute = self._directly if execute is None else execute
        self._issued: OrderedDict[int, Issued] = OrderedDict()
        self.newest = 0

    @property
    @override
    def model(self) -> RobotModel:
        return self.engine.model

    @property
    @override
    def timeline(self) -> Timeline:
        return self.engine.timeline

    @property
    @override
    def other(self) -> OtherTwin:
        return OtherTwin()

    @override
    def ask(self, command: Command | None, *, now: float) -> int:
        number = self.newest = self.newest + 1
        try:
            answer = self._execute(command, now) or Refusal("there's nothing to take back")
        except VrsError as error:
            answer = Refusal(str(error))
        if isinstance(answer, Refusal):
            self._issued[number] = Issued(number, command, now, now, refusal=answer.text, code=answer.code)
        else:
            known = self.engine.refusal(answer.command_id)
            code = known if isinstance(known, RefusalCode) else RefusalCode.OTHER
            self._issued[number] = Issued(number, command, now, now, answer, code=code)
        if len(self._issued) > REMEMBERED:
            self._issued.popitem(last=False)
        return number

    def _directly(self, command: Command | None, now: float) -> Receipt | None:
        clock = self.engine.clock
        if isinstance(clock, ManualClock):
            clock.set(max(now, clock.now()))
        if command is None:
            return self.engine.undo()
        return self.engine.execute(command)  # type: ignore[return-value]

    @override
    def outcome(self, number: int, *, now: float) -> Issued | None:
        """What became of it; of one that's long over, nothing but that it's over."""
        issued = self._issued.get(number) or Issued(number, None, now, now)
        if issued.receipt is None or issued.reason:
            return issued
        return replace(issued, receipt=self.engine.receipt(issued.receipt.command_id))


class SiteRobot(EngineRobot):
    """The operator's site, of the laboratory or a server's own."""

    def __init__(
        self,
        site: OperatorSite[VirtualArm],
        execute: Execute | None = None,
        *,
        fault_poll_interval: float = math.inf,
        has_fingers: bool = False,
    ) -> None:
        """Reach a site; see `EngineRobot` and `RobotPort`."""
        super().__init__(site.robot.engine, execute, fault_poll_interval=fault_poll_interval)
        self._site, self.has_fingers = site, has_fingers

    @property
    @override
    def other(self) -> OtherTwin:
        site = self._site
        q = None if site.report is None else site.report.q
        return OtherTwin(q, site.gone or text_of(site.halted), site.robot.hand, site.robot.hand_at)
