"""The operator's engine: it asks whether it may, and what it's told goes into the log that the robot is sent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from interfaces.teleop.observers import CommandRecord
from vrs.clock import ManualClock
from vrs.commands import (
    Cancel,
    Command,
    InsertVia,
    JointTarget,
    Lateness,
    Motion,
    MotionCommand,
    PositionQuery,
    Resume,
    Retime,
    ScaleTime,
    SteerCommand,
    Stop,
)
from vrs.engine import Engine
from vrs.ledger import Receipt
from vrs.model import Array, RobotModel


class LoggedEngine(Engine):
    """An engine that asks whether it may, and tells what it was given; if that raises, nothing has happened."""

    def __init__(
        self,
        refusal: Callable[[], str],
        told: Callable[[CommandRecord, int], None],
        model: RobotModel,
        *,
        q: Array,
        clock: ManualClock,
        lateness: Lateness,
    ) -> None:
        """Make an engine.

        Args:
            refusal: Says why commands are refused now; empty if they aren't.
            told: Is told what it was given, and the newest id before that.
            model: See `Engine`, as for the rest.
            q: Initial joints.
            clock: The operator's.
            lateness: What happens to late commands.
        """
        super().__init__(model, q=q, clock=clock, lateness=lateness)
        self._refusal, self._tell = refusal, told

    def execute(self, command: Command) -> Any:
        """Carry out a command; see `Engine.execute`."""
        if isinstance(command, PositionQuery):
            return super().execute(command)
        with self.atomic():
            reason, newest = self._refusal(), self.newest
            answer: Receipt | None = self.refuse(command, reason) if reason else super().execute(command)  # type: ignore[arg-type]
            self._tell(CommandRecord(self.now(), command, answer, bool(reason)), newest)
            return answer

    def undo(self) -> Receipt | None:
        """Take back the newest command; see `Engine.undo`."""
        if self._refusal():
            return None
        with self.atomic():
            newest = self.newest
            answer = super().undo()
            if answer is not None:
                self._tell(CommandRecord(self.now(), None, answer, False), newest)
            return answer

    def undo_refusal(self) -> str:
        """Why nothing is taken back now; see `Engine.undo_refusal`."""
        return self._refusal() or super().undo_refusal()


def resolved(command: Command, answer: Receipt, now: float) -> Command:
    """The command with the stamps that it got, and joints for a pose."""
    issued = getattr(command, "issued_at", None)
    issued = now if issued is None else issued
    if isinstance(command, MotionCommand):
        target = command.target
        if command.motion is Motion.JOINT and answer.q is not None:
            target = JointTarget(answer.q)
        when = answer.execute_at if command.deviation == 0 else command.execute_at
        return replace(command, target=target, issued_at=issued, execute_at=when)
    if isinstance(command, (Cancel, InsertVia)) and command.execute_at is None:
        return replace(command, issued_at=issued, execute_at=max(now, issued))
    if isinstance(command, SteerCommand):
        return replace(command, issued_at=issued, execute_at=max(now, issued, command.execute_at or now))
    if isinstance(command, (ScaleTime, Stop, Resume)):
        return replace(command, issued_at=issued, execute_at=answer.execute_at)
    if isinstance(command, (Retime, Cancel, InsertVia)):
        return replace(command, issued_at=issued)
    return command
