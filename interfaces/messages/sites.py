"""What crosses the link between the operator's site and the robot's, as frozen values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple

from interfaces.messages.fields import Party
from vrs.commands import Command
from vrs.ledger import Receipt
from vrs.model import Array
from vrs.segment import PolynomialSegment

NEW: Final = 128
"""New samples in one report, at most; the older ones are asked for."""
AGAIN: Final = 32
"""Samples in one report that were asked for, at most."""
RANGES: Final = 32
"""Ranges of samples that are asked for in one message, at most."""

Ranges = tuple[tuple[int, int], ...]
"""First and last number of each range."""


class Sample(NamedTuple):
    """Where the robot was measured once."""

    number: int
    """Counts the samples of a robot's site, without gaps; 0 of a robot that doesn't number them."""
    t: float
    """When, by the robot's clock [s]."""
    play: float
    """Time on the robot's timeline that it played then [s]."""
    q: Array
    """Measured joints [rad], (n,)."""
    reference: Array | None = None
    """What the robot's own timeline asked for at `play` [rad], (n,); None of a robot that doesn't say."""


@dataclass(frozen=True, slots=True, eq=False)
class LogEntry:
    """One command of the operator's log."""

    number: int
    """From 1, without gaps, within an epoch."""
    at: float
    """When it was given, by the operator's clock [s]; entries are in this order."""
    command: Command | None
    """What was commanded, poses and times resolved as they were accepted; None takes back the newest."""
    command_id: int
    """Id that the operator's engine gave it."""


@dataclass(frozen=True, slots=True, eq=False)
class Orders:
    """From the operator's site: entries of the log, or a heartbeat without any."""

    sender: ClassVar[Party] = Party.SITE
    epoch: int
    """Of the control lease."""
    number: int
    """Of the packet, from 1."""
    sent_at: float
    """By the operator's clock [s]."""
    newest: int
    """Number of the newest entry."""
    complete_until: float
    """With all entries up to the newest, nothing will change before this time on the timeline [s]."""
    epoch_began: float
    """When the epoch began [s]: no entry of it changes anything before."""
    heard: int = 0
    """Number of the newest report that came."""
    entries: tuple[LogEntry, ...] = ()
    """New ones, and older ones that may have been lost."""
    wanted: Ranges = ()
    """Samples that are missing; see `interfaces.teleop.samples`."""
    halted: str = ""
    """Why the operator's site commands no more until somebody resumes: the robot is to stop and wait for that."""


@dataclass(frozen=True, slots=True, eq=False)
class PlanPart:
    """The robot's plan from a time on."""

    version: int
    """Of the robot's timeline."""
    since: float
    """Before it nothing changed since the version that the operator knew [s]."""
    initial: Array
    """Where the arm stands before the first segment [rad], (n,)."""
    segments: tuple[PolynomialSegment, ...]
    """All of them from there on."""


@dataclass(frozen=True, slots=True, eq=False)
class Report:
    """From the robot's site: where it is, and what became of the entries."""

    sender: ClassVar[Party] = Party.ROBOT
    epoch: int
    """Epoch that it follows."""
    number: int
    """Of the packet, from 1."""
    sent_at: float
    """By the robot's clock [s]."""
    echo: tuple[int, float, float] | None
    """The newest Orders heard: its number, its sent_at, and when it arrived by the robot's clock [s]."""
    executed: int
    """Entries up to this number were carried out."""
    play: float
    """Time on the robot's timeline that it plays now [s]."""
    pace: float
    """How fast it plays; 1 is as planned."""
    q: Array
    """Measured joints [rad], (n,)."""
    measured_at: float
    """When they were measured, by the robot's clock [s]."""
    q_at: float
    """Time on the robot's timeline that it played then [s]."""
    halted: str = ""
    """Why it stopped by itself and waits for a new epoch; empty while it doesn't."""
    receipts: tuple[tuple[int, Receipt], ...] = ()
    """Receipts by entry number, of entries not known to have been reported."""
    plan: PlanPart | None = None
    """Where the robot's plan may be another than the operator thinks."""
    reference: Array | None = None
    """What the robot's own timeline asked for at `measured_at` [rad], (n,); None where it doesn't say."""
    uncertainty: float | None = None
    """Bound on the error of what it takes for the operator's clock [s]; None where that isn't known."""
    samples: tuple[Sample, ...] = ()
    """Where it was measured since the report before, and earlier samples that are missing at the operator's."""
    oldest: int = 0
    """Number of the oldest sample that it keeps; 0 where it keeps none."""
