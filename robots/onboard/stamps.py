"""What a message to a robot says about itself, and which messages count."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from vrs.checks import finite
from vrs.errors import InvalidValueError

LARGEST = 2**64 - 1
"""Largest epoch and largest sequence number."""


class Kind(enum.StrEnum):
    """What a message wants."""

    COMMAND = "command"
    """That the robot does something, or that it may go on further than it was told before."""
    HEARTBEAT = "heartbeat"
    """Nothing: the operator is there."""
    RESUME = "resume"
    """That the robot may move again after a stop, which it names."""


@dataclass(frozen=True, slots=True)
class Stamp:
    """The head of a message, as it came: the fields may hold anything, whoever hears it looks at them."""

    epoch: int
    """Of the lease that it was sent under, 1 to 2⁶⁴ − 1."""
    sequence: int
    """Counts the sender's messages of this epoch, 0 to 2⁶⁴ − 1; a repeated message keeps its number."""
    issued_at: float
    """When it was issued [s], mapped to the robot's clock."""
    kind: Kind = Kind.COMMAND
    answers: int | None = None
    """Of a `RESUME`: number of the stop that the operator has seen."""

    @property
    def valid(self) -> bool:
        """Whether every field has its type and range."""
        try:
            finite("issued_at", self.issued_at)
        except (InvalidValueError, OverflowError):
            return False
        resumes = self.kind is Kind.RESUME
        return (
            whole(self.epoch, 1)
            and whole(self.sequence, 0)
            and isinstance(self.kind, Kind)
            and (whole(self.answers, 1) if resumes else self.answers is None)
        )


class Verdict(enum.StrEnum):
    """What becomes of a message. All but the first two are refusals, which change nothing: only time does."""

    FRESH = "fresh"
    """It counts: it's carried out, and feeds the watchdog."""
    NOTED = "noted"
    """A heartbeat to a robot that has stopped: it keeps the lease, nothing moves by it."""
    NOT_AUTHENTIC = "not authentic"
    INVALID = "invalid"
    """A field of the stamp isn't what it should be."""
    STALE_EPOCH = "stale epoch"
    """Of a lease that has ended."""
    UNKNOWN_EPOCH = "unknown epoch"
    """Of a lease that was never granted."""
    DUPLICATE = "duplicate"
    OVERTAKEN = "overtaken"
    """So many later ones came before it that nobody knows whether it's a duplicate."""
    BEFORE_RESUME = "before resume"
    """Sent before the resume that ended the last stop."""
    TOO_OLD = "too old"
    """Its age, with the clocks' uncertainty, is over the gate's."""
    FROM_THE_FUTURE = "from the future"
    """Its stamp lies later than the clocks' uncertainty can explain."""
    CLOCK_UNKNOWN = "clock unknown"
    """The clocks' uncertainty is over what the age gate works with."""
    HALTED = "halted"
    """The robot was stopped and takes no command until it's resumed."""
    MOVING = "moving"
    """The robot isn't at rest yet: it can't be resumed or armed."""
    OTHER_STOP = "other stop"
    """The resume names an earlier stop than the last."""

    @property
    def counts(self) -> bool:
        """Whether the message shows that the operator is there: it keeps the lease."""
        return self is Verdict.FRESH or self is Verdict.NOTED


class SequenceWindow:
    """Which sequence numbers were seen, of the newest so many."""

    __slots__ = ("_newest", "_seen", "_size")

    def __init__(self, size: int) -> None:
        """Remember numbers less than `size` below the newest."""
        self._size = size
        self._newest = -1
        self._seen = 0

    def refusal(self, sequence: int) -> Verdict | None:
        """Return why a number can't be taken; None if it can."""
        back = self._newest - sequence
        if back < 0:
            return None
        if back >= self._size:
            return Verdict.OVERTAKEN
        return Verdict.DUPLICATE if self._seen >> back & 1 else None

    def note(self, sequence: int) -> None:
        """Take a number that can be taken."""
        ahead = sequence - self._newest
        if ahead <= 0:
            self._seen |= 1 << -ahead
            return
        # A jump of 2⁶³ would make a number of 2⁶³ bits.
        self._seen = 1 if ahead >= self._size else ((self._seen << ahead) & ((1 << self._size) - 1)) | 1
        self._newest = sequence


def whole(value: object, least: int) -> bool:
    """Whether a value is an integer from `least` to 2⁶⁴ − 1."""
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= LARGEST
