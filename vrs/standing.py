"""What an engine knows besides its timeline, so that another one can go on from there."""

from __future__ import annotations

from dataclasses import dataclass

from vrs.commands import Lateness, MotionCommand, Profile
from vrs.model import Limits
from vrs.receipt import Receipt

MOST_KNOWN = 2000
"""Commands that an engine's standing holds, at most: the first ones to come."""


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """A command that isn't over, or by which the arm moved last."""

    receipt: Receipt
    """As it is now."""
    command: MotionCommand | None
    """What it answers; None where it's no motion command."""
    profile: Profile
    """By which profile it moves the arm."""


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """What the next commands of an engine depend on, besides its timeline.

    What could be taken back, and what a stop interrupted, is no part of it: an undo or a resume of what was before
    finds nothing.
    """

    newest: int
    """Highest command id given out, ≥ 0."""
    lateness: Lateness
    limits: Limits
    """In force."""
    steered: tuple[int, float] | None = None
    """The command that the next steering input goes on with, and when that began [s]."""
    known: tuple[Known, ...] = ()
