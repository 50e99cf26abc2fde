"""What crosses the link between the operator's site and the robot's, as frozen values."""

from __future__ import annotations

from typing import Annotated, ClassVar, Final

import msgspec
from msgspec import Meta
from typing_extensions import override

from interfaces.messages.fields import (
    MOST_NAMES,
    Count,
    Echo,
    Epoch,
    Leased,
    Number,
    Party,
    Stamp,
    Text,
    Time,
    Uncertainty,
    Value,
)
from interfaces.messages.segments import Dof, Planned, Segmented
from vrs.commands import Command
from vrs.ledger import Receipt
from vrs.model import Array
from vrs.record import Record

NEW: Final = 128
"""New samples in one report, at most; the older ones are asked for."""
AGAIN: Final = 32
"""Samples in one report that were asked for, at most."""
RANGES: Final = 32
"""Ranges of samples that are asked for in one message, at most."""

MOST_ENTRIES = 4096
"""Entries or receipts in one message, at most."""

Ranges = tuple[tuple[Number, Number], ...]
"""First and last number of each range."""


class Sample(msgspec.Struct, frozen=True, array_like=True, gc=False, eq=False):
    """Where the robot was measured once; it crosses as an array."""

    number: Number
    """Counts the samples of a robot's site, without gaps; 0 of a robot that doesn't number them."""
    t: Stamp
    """When, by the robot's clock [s]."""
    play: Time
    """Time on the robot's timeline that it played then [s]."""
    q: Array
    """Measured joints [rad], (n,)."""
    reference: Array | None = None
    """What the robot's own timeline asked for at `play` [rad], (n,); None of a robot that doesn't say."""


class LogEntry(Record, frozen=True, omit_defaults=True, gc=False, eq=False):
    """One command of the operator's log."""

    number: Number
    """From 1, without gaps, within an epoch."""
    at: Time
    """When it was given, by the operator's clock [s]; entries are in this order."""
    command_id: Count
    """Id that the operator's engine gave it."""
    command: Command | None = None
    """What was commanded, poses and times resolved as they were accepted; None: take back the newest."""


class Orders(Leased, frozen=True, omit_defaults=True, gc=False, eq=False, tag="orders"):
    """From the operator's site: entries of the log, or a heartbeat without any."""

    sender: ClassVar[Party] = Party.SITE
    epoch: Epoch
    """Of the control lease."""
    number: Number
    """Of the packet, from 1."""
    sent_at: Stamp
    """By the operator's clock [s]."""
    newest: Count
    """Number of the newest entry."""
    complete_until: Time
    """With all entries up to the newest, nothing will change before this time on the timeline [s]."""
    epoch_began: Time
    """When the epoch began [s]: no entry of it changes anything before."""
    heard: Count = 0
    """Number of the newest report that came."""
    entries: Annotated[tuple[LogEntry, ...], Meta(max_length=MOST_ENTRIES)] = ()
    """New ones, and older ones that may have been lost."""
    wanted: Annotated[Ranges, Meta(max_length=RANGES)] = ()
    """[first, last]: numbers of samples that are missing."""
    halted: Text = ""
    """Why the operator's site commands no more until somebody resumes: the robot is to stop and wait for that."""


class PlanPart(Segmented, frozen=True, omit_defaults=True, gc=False, eq=False):
    """The robot's plan from a time on."""

    version: Count
    """Of the robot's timeline."""
    since: Time
    """Before it nothing changed since the version that the operator knew [s]."""
    initial: Array
    """Where the arm stands before the first segment [rad], (n,)."""
    dof: Dof = 0
    """Joints of the segments."""
    start: Time = 0.0
    """Start of the first segment [s]."""
    segments: Planned = ()
    """All of them from there on."""


class Report(Leased, frozen=True, omit_defaults=True, gc=False, eq=False, tag="report"):
    """From the robot's site: where it is, and what became of the entries."""

    sender: ClassVar[Party] = Party.ROBOT
    epoch: Epoch
    """Epoch that it follows."""
    number: Number
    """Of the packet, from 1."""
    sent_at: Stamp
    """By the robot's clock [s]."""
    executed: Count
    """Entries up to this number were carried out."""
    play: Time
    """Time on the robot's timeline that it plays now [s]."""
    pace: Value
    """How fast it plays; 1 is as planned."""
    q: Array
    """Measured joints [rad], (n,)."""
    measured_at: Stamp
    """When they were measured, by the robot's clock [s]."""
    q_at: Time
    """Time on the robot's timeline that it played then [s]."""
    echo: Echo | None = None
    """The newest `Orders` heard: its number, its `sent_at`, and when it arrived by the robot's clock [s]."""
    halted: Text = ""
    """Why it stopped by itself and waits for a new epoch; empty while it doesn't."""
    receipts: Annotated[tuple[tuple[Number, Receipt], ...], Meta(max_length=MOST_ENTRIES)] = ()
    """[number, receipt] of entries that aren't known to have been reported."""
    plan: PlanPart | None = None
    """Where the robot's plan may be another than the operator thinks."""
    reference: Array | None = None
    """What the robot's own timeline asked for at `q_at` [rad], (n,); None where it doesn't say."""
    uncertainty: Uncertainty | None = None
    """Bound on the error of what it takes for the operator's clock [s]; None where that isn't known."""
    samples: Annotated[tuple[Sample, ...], Meta(max_length=NEW + AGAIN)] = ()
    """Where it was measured since the report before, 128 at most, and up to 32 earlier ones that were `wanted`."""
    oldest: Count = 0
    """Number of the oldest sample that it keeps; 0 where it keeps none."""

    def __post_init__(self) -> None:
        # A robot that follows nobody yet reports, too, to whoever watches it in its own process.
        if self.epoch != 0:
            super().__post_init__()

    @override
    def as_written(self, packed: bool) -> Report:
        if self.plan is None and not self.receipts:
            return self
        receipts = tuple((number, receipt.named(MOST_NAMES)) for number, receipt in self.receipts)
        plan = None if self.plan is None else self.plan.as_written(packed)
        return msgspec.structs.replace(self, receipts=receipts, plan=plan)
