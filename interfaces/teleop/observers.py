"""What happens at an operator's site, for whoever writes it down."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

from interfaces.teleop.measured import Sample
from interfaces.teleop.messages import Report
from vrs.commands import Command
from vrs.ledger import Receipt
from vrs.model import Array
from vrs.timeline import Timeline


class Correction(NamedTuple):
    """The virtual robot was put where the real one is going."""

    t: float
    """When, by the operator's clock [s]."""
    end: float
    """Until when it takes [s]."""
    error: Array
    """By how much it was off [rad], (n,)."""
    reason: str


class CommandRecord(NamedTuple):
    """A command that the operator's engine was given, and what became of it."""

    at: float
    """The engine's time when it was [s]."""
    command: Command | None
    """None took back the newest."""
    receipt: Receipt | None
    """None where there's none, as for a parameter."""
    refused: bool
    """Whether the site refused it, so that it was never tried."""


class SiteObserver(Protocol):
    """Who is told of all that happens, at once: it must not take long, and changes nothing."""

    def commanded(self, deed: CommandRecord) -> None:
        """The engine was given a command. What raised isn't told: it changed nothing, and took no id."""

    def corrected(self, correction: Correction, truth: Timeline) -> None:
        """The engine's timeline has joined another one."""

    def answered(self, command_id: int, receipt: Receipt, *, now: float) -> None:
        """The robot's engine has answered a command of the operator's: its id there, and the answer."""

    def reported(self, report: Report, *, now: float) -> None:
        """A report has come that is newer than all before."""

    def measured(self, samples: Sequence[Sample], *, now: float) -> None:
        """Samples of the robot have come that weren't known: mostly the newest, some of them late."""

    def failed(self, error: Exception) -> None:
        """Being told raised this: nothing more is told."""
