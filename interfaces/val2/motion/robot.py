"""What motions need of a robot, here or elsewhere: somewhere to send commands, and its timeline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from vrs.commands import Command
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
            The number by which `fate` tells what came of it.
        """

    def fate(self, number: int, *, now: float) -> CommandOutcome | None:
        """What became of it by now; None while nothing was heard."""

    def trouble(self) -> str:
        """Why the other twin doesn't follow, having stopped by itself; empty while it does."""

    @property
    def lost(self) -> bool:
        """Whether nothing can be heard of it now."""

    @property
    def looks(self) -> float:
        """How often it's to be asked for trouble while it moves [s]; infinity where its driver does so anyway."""

    def scheduled(self, *, now: float) -> tuple[Receipt, ...]:
        """Receipts of what isn't over, in the order of their beginning."""

    def real(self, *, now: float) -> Array | None:
        """Joints of the other twin as they were measured last [rad], (n,); None where there's none."""
