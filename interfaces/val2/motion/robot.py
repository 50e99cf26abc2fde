"""What motions need of a robot: somewhere to send commands, and its timeline; robots in this process."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Final, Protocol

from typing_extensions import override

from interfaces.messages import RefusalCode
from interfaces.teleop.halt import text_of
from interfaces.teleop.operator import OperatorSite
from interfaces.teleop.virtual_arm import VirtualArm
from vrs.clock import ManualClock
from vrs.commands import Command
from vrs.engine import Engine
from vrs.errors import VrsError
from vrs.ledger import Receipt, Status
from vrs.model import Array, RobotModel
from vrs.timeline import Timeline


@dataclass(frozen=True, slots=True, eq=False)
class CommandOutcome:
    """What became of something that was asked for."""

    receipt: Receipt | None = None
    """As later commands left it; None where there's none."""
    refusal: str = ""
    """Why it couldn't be taken at all."""
    code: RefusalCode = RefusalCode.OTHER
    """Why nothing came of it, where that's decided by."""

    @property
    def reason(self) -> str:
        """Why nothing came of it; empty where something did."""
        if self.receipt is not None and self.receipt.status is Status.REJECTED:
            return self.receipt.reason
        return self.refusal


class RobotPort(Protocol):
    """A robot's timeline, and the way to it. Times are session time [s]."""

    @property
    def model(self) -> RobotModel:
        """Its kinematics and limits."""

    @property
    def timeline(self) -> Timeline:
        """What the operator's twin did and will do, as far as it's known."""

    def ask(self, command: Command | None, *, now: float) -> int:
        """Ask for something; None takes back the newest command.

        Returns:
            The number by which `outcome` tells what came of it.
        """

    def outcome(self, number: int, *, now: float) -> CommandOutcome | None:
        """What became of it by now; None while nothing was heard."""

    def halt_reason(self) -> str:
        """Why the other twin doesn't follow, having stopped by itself; empty while it does."""

    @property
    def lost(self) -> bool:
        """Whether nothing can be heard of it now."""

    @property
    def fault_poll_interval(self) -> float:
        """How often it's to be asked for trouble while it moves [s]; infinity where its driver does so anyway."""

    def scheduled(self, *, now: float) -> tuple[Receipt, ...]:
        """Receipts of what isn't over, in the order of their beginning."""

    def real(self, *, now: float) -> Array | None:
        """Joints of the other twin as they were measured last [rad], (n,); None where there's none."""


_REMEMBERED: Final = 64
"""Answers that are kept."""
_LOOKED: Final = 256
"""Newest receipts that are looked through for what isn't over."""


class EngineRobot(RobotPort):
    """An engine in this process; a manual clock of it is set to the time of each call."""

    lost = False
    fault_poll_interval = math.inf

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self._number = 0
        self._outcomes: OrderedDict[int, CommandOutcome] = OrderedDict()

    @property
    @override
    def model(self) -> RobotModel:
        return self.engine.model

    @property
    @override
    def timeline(self) -> Timeline:
        return self.engine.timeline

    @override
    def ask(self, command: Command | None, *, now: float) -> int:
        self._number += 1
        try:
            answer = self._do(command, now)
            refusal = "" if answer is not None else "there's nothing to take back"
        except VrsError as error:
            answer, refusal = None, str(error)
        code = RefusalCode.OTHER if answer is None else self._code(answer)
        self._outcomes[self._number] = CommandOutcome(answer, refusal, code)
        if len(self._outcomes) > _REMEMBERED:
            self._outcomes.popitem(last=False)
        return self._number

    def _code(self, answer: Receipt) -> RefusalCode:
        known = self.engine.refusal(answer.command_id) if answer.status is Status.REJECTED else None
        return known if isinstance(known, RefusalCode) else RefusalCode.OTHER

    def _do(self, command: Command | None, now: float) -> Receipt | None:
        clock = self.engine.clock
        if isinstance(clock, ManualClock):
            clock.set(max(now, clock.now()))
        if command is None:
            return self.engine.undo()
        return self.engine.execute(command)  # type: ignore[arg-type]

    @override
    def outcome(self, number: int, *, now: float) -> CommandOutcome | None:
        """What became of it; of one that's long over, nothing but that it's over."""
        outcome = self._outcomes.get(number)
        if outcome is None:
            return CommandOutcome()
        receipt = outcome.receipt
        if receipt is None or receipt.status is Status.REJECTED:
            return outcome
        return CommandOutcome(self.engine.receipt(receipt.command_id))

    @override
    def halt_reason(self) -> str:
        return ""

    @override
    def scheduled(self, *, now: float) -> tuple[Receipt, ...]:
        newest = self.engine.newest
        numbers = range(max(newest - _LOOKED, 0) + 1, newest + 1)
        return standing((self.engine.receipt(number) for number in numbers), now)

    @override
    def real(self, *, now: float) -> Array | None:
        return None


class SiteRobot(EngineRobot):
    """The operator's site of the laboratory."""

    def __init__(
        self, site: OperatorSite[VirtualArm], executed: Callable[[float, Command, Receipt], None] | None = None
    ) -> None:
        """Reach a site.

        Args:
            site: The operator's.
            executed: Is called with what was carried out, and when [s].
        """
        super().__init__(site.robot.engine)
        self._site, self._executed = site, executed

    def _do(self, command: Command | None, now: float) -> Receipt | None:
        if command is None:
            return self._site.robot.undo(now=now)
        answer = self._site.robot.execute(command, now=now)
        assert isinstance(answer, Receipt)
        if self._executed is not None and answer.status is not Status.REJECTED:
            self._executed(now, command, answer)
        return answer

    @override
    def halt_reason(self) -> str:
        return text_of(self._site.halted)

    @override
    def real(self, *, now: float) -> Array | None:
        report = self._site.report
        return None if report is None else report.q


def standing(receipts: Iterable[Receipt], now: float) -> tuple[Receipt, ...]:
    """Those that are to be carried out and aren't over at a time [s], in the order of their beginning."""
    known = {receipt.command_id: receipt for receipt in receipts if receipt.end is not None and not receipt.undone}
    chosen = []
    for receipt in known.values():
        by = known.get(receipt.superseded_by or 0)
        # One that the next begins before it's over gives way to that; anything else drops it.
        if by is not None and by.q is not None and receipt.q is not None:
            after = known.get(by.superseded_by or 0, by)
            begins = min(by.execute_at or 0.0, after.execute_at or 0.0)
            lasting = replace(receipt, end=begins)
        elif receipt.superseded_by is None:
            lasting = receipt
        else:
            continue
        if (lasting.end or 0.0) > now:
            chosen.append(lasting)
    return tuple(sorted(chosen, key=lambda receipt: (receipt.execute_at or 0.0, receipt.command_id)))
