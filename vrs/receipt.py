"""Receipts: what became of a command."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from vrs.model import Array

Names: TypeAlias = tuple[int, ...] | Callable[[], tuple[int, ...]]
"""Command ids, or what finds them when somebody asks."""


class Status(enum.StrEnum):
    """Outcome of a command."""

    ACCEPTED = "accepted"
    POSTPONED = "postponed"
    REJECTED = "rejected"


@dataclass(frozen=True, slots=True, eq=False)
class Receipt:
    """What became of a command; it belongs to one version of the timeline."""

    command_id: int
    """Id of the command, from 1; rejected commands have one too."""
    status: Status
    issued_at: float | None
    """Issue time [s]; None where none was given to an offline engine."""
    asked_at: float | None
    """Execution time that was asked for [s]; None where none was."""
    execute_at: float | None = None
    """Start of the motion [s]; None when rejected."""
    end: float | None = None
    """Arrival [s]; None when rejected."""
    q: Array | None = None
    """Joints of the target [rad], (n,), poses resolved; None when rejected, or where there's no target."""
    reason: str = ""
    """Why it was postponed or rejected, or what else the user must know."""
    version: int = 0
    """Version of the timeline that the command made, or left when rejected."""
    shift: float = 0.0
    """Δ by which the commands in `shifted` were shifted [s]."""
    superseded_by: int | None = None
    """Id of the later command that cut this one short or dropped it; None while it stands."""
    undone: bool = False
    """Whether it was taken back or cancelled."""
    shifted_names: Names = ()
    """Ids for `shifted`, or what finds them: naming a long tail takes time that a command hasn't got."""
    superseded_names: Names = ()
    """Ids for `superseded`, or what finds them."""
    hindrance: str = ""
    """Of a steering input that's accepted: what keeps the arm from going as asked, and what leads away from it."""

    @property
    def shifted(self) -> tuple[int, ...]:
        """Ids of commands whose moves now come at another time."""
        return self.shifted_names if isinstance(self.shifted_names, tuple) else self.shifted_names()

    @property
    def superseded(self) -> tuple[int, ...]:
        """Ids of commands that will not arrive any more, wholly or in part."""
        return self.superseded_names if isinstance(self.superseded_names, tuple) else self.superseded_names()

    @property
    def is_still(self) -> bool:
        """Whether the command's target is where the arm stood anyway: it has no segments."""
        return self.q is not None and self.end == self.execute_at

    @property
    def stands(self) -> bool:
        """Whether the command is to be carried out as the receipt says, or was."""
        return self.end is not None and self.superseded_by is None and not self.undone
