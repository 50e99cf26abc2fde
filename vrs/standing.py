"""What an engine knows besides its timeline, so that another one can go on from there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from vrs.chunk import HOLD
from vrs.commands import Lateness, MotionCommand, Profile
from vrs.model import Limits
from vrs.receipt import Receipt

if TYPE_CHECKING:
    from vrs.scheduler import Scheduler

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


def standing(plan: Scheduler, now: float) -> Standing:
    """How a scheduler stands at a time [s]; what costs no more than what is scheduled."""
    timeline, ledger = plan.timeline, plan.ledger
    first = max(timeline.index_at(now) - 1, 0)
    last = min(len(timeline), first + MOST_KNOWN)
    names = dict.fromkeys(timeline.owners(first, last))
    session = plan.steered
    if session is not None:
        names.setdefault(session[0])
    for command_id in ledger.stills_from(now):
        names.setdefault(command_id)
    known = tuple(
        Known(ledger.receipt(command_id), ledger.command(command_id), plan.profile(command_id))
        for command_id in sorted(names)[-MOST_KNOWN:]
        if command_id != HOLD and command_id in ledger
    )
    return Standing(ledger.newest, plan.lateness, plan.limits, session, known)


def take_up(plan: Scheduler, stand: Standing) -> None:
    """Let a scheduler that was just made on the same timeline go on from there."""
    plan.ledger.newest = stand.newest
    plan.lateness, plan.limits = stand.lateness, stand.limits
    for one in stand.known:
        plan.ledger.note(one.receipt, one.command)
        if one.command is None:
            plan.note_profile(one.receipt.command_id, one.profile)
    if stand.steered is not None and stand.steered[0] in plan.ledger:
        plan.go_on_steering(*stand.steered)
