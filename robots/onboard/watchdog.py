"""The watchdog on board: no authentic fresh message for T_loss, and the robot begins to stop.

A message carries a `Stamp`; whether it counts is a `Verdict`.

The watchdog is a state machine of values: messages and times in, verdicts and actions out. It has one timeout.
`advance` gives actions as of its `now`, never as of an earlier time: a stop that is planned from a late stamp asks
for any speed.

    WAITING ──arm──▶ RUNNING ──T_loss, stop, disarm──▶ STOPPING ──stopped──▶ HALTED
                        ▲                                 │ hold only            │
                        └─────────────────────────────────┴──resume, arm, hold───┘
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace
from typing import Annotated, TypeAlias

from vrs.checks import finite, not_before, validated, within
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


_ROUNDING = 1e-6
"""A stamp may lie this much after now [s] by rounding alone."""


class LossPolicy(enum.StrEnum):
    """What a loss of the link means."""

    HALT = "halt"
    """The robot stops and stays: only a new lease or an explicit resume lets it move. Old messages are refused."""
    HOLD = "hold"
    """The robot stops; the next authentic command of the same epoch lets it go on. No age gate."""


class AcceptedFuture(enum.StrEnum):
    """What becomes of motion that was accepted before the link was lost."""

    STOP = "stop"
    """It ends: the robot brakes at once."""
    FINISH = "finish"
    """It is the way to stop, if it comes to rest within another T_loss; else the robot brakes at once."""


class WatchdogState(enum.StrEnum):
    """Where the watchdog is."""

    WAITING = "waiting"
    """Nobody has been let in yet."""
    RUNNING = "running"
    """Commands are taken, and T_loss runs."""
    STOPPING = "stopping"
    """The robot is coming to rest."""
    HALTED = "halted"
    """The robot is at rest."""


class StopReason(enum.StrEnum):
    """Why the robot was stopped."""

    LINK_LOSS = "link loss"
    OPERATOR = "operator"
    LEASE = "lease"
    """The lease ended: it was released, taken over, or it expired."""
    TOLERANCE = "tolerance"
    """The robot didn't follow."""
    FAULT = "fault"
    """Anything else on board."""


class Manner(enum.StrEnum):
    """How to stop."""

    COMMANDED = "commanded"
    """Brake from the last commanded state: from the measured one the command would jump."""
    MEASURED = "measured"
    """Brake from the measured state: the commanded one is somewhere else."""
    FINISH = "finish"
    """Drop nothing; what was accepted comes to rest in time."""


@dataclass(frozen=True, slots=True)
class BeginStop:
    """The robot is to begin to stop; `Watchdog.stopped` with its number answers it."""

    number: int
    """Counts stops, from 1."""
    at: float
    """When it begins [s]: now."""
    due: float
    """When it became due [s]; earlier than `at` only if `advance` was called late."""
    reason: StopReason
    manner: Manner


@dataclass(frozen=True, slots=True)
class GoOn:
    """Commands are taken again, after a stop or for the first time."""

    at: float
    """[s]."""
    epoch: int
    """Of the lease."""


Action: TypeAlias = BeginStop | GoOn


@dataclass(frozen=True, slots=True)
@validated
class WatchdogConfig:
    """When the link counts as lost, and what happens then."""

    timeout: Annotated[float, within(0.1, 2.0, "s")] = 0.5
    """T_loss [s], 0.1 to 2: so long after the last message that counted the stop begins."""
    policy: LossPolicy = LossPolicy.HALT
    future: AcceptedFuture = AcceptedFuture.STOP
    max_age: Annotated[float, within(0.01, 2.0, "s")] = 0.5
    """Oldest message that counts under `halt` [s], 0.01 to 2."""
    max_uncertainty: Annotated[float, within(0.0, 1.0, "s")] = 0.1
    """Largest uncertainty of the clocks that the age gate works with [s], 0 to 1."""
    window: Annotated[int, within(1, 1000000)] = 4096
    """How far a message may be overtaken and still count [messages], 1 to 1,000,000."""


class Watchdog:
    """Says which messages count, and when the robot has to stop.

    Times are of one clock that never runs back; a time earlier than one given before, NaN or infinity raises
    InvalidValueError from every method, and changes nothing.
    """

    __slots__ = (
        "_armed", "_deadline", "_epoch", "_finish", "_first", "_may_finish", "_now", "_number", "_queue", "_reason",
        "_state", "_window", "config",
    )  # fmt: skip

    def __init__(self, config: WatchdogConfig | None = None, *, epoch: int = 0) -> None:
        """Wait for a lease.

        Args:
            config: Timeouts and policy.
            epoch: The last epoch that was ever granted, 0 to 2⁶⁴ − 1; it and older ones are refused.
        """
        self.config = config or WatchdogConfig()
        if not whole(epoch, 0):
            raise InvalidValueError("epoch", epoch, f"an integer in [0, {LARGEST}]")
        self._epoch, self._armed = epoch, False
        self._state, self._reason, self._number = WatchdogState.WAITING, StopReason.LEASE, 0
        self._now = self._deadline = -math.inf
        self._finish: float | None = None
        self._may_finish = False
        self._first = 0
        self._window = SequenceWindow(self.config.window)
        self._queue: list[Action] = []

    @property
    def state(self) -> WatchdogState:
        """The state, as of the last call."""
        return self._state

    @property
    def reason(self) -> StopReason | None:
        """Why the robot was stopped; None while it may move, and before the first lease."""
        return self._reason if self._state in (WatchdogState.STOPPING, WatchdogState.HALTED) else None

    @property
    def number(self) -> int:
        """Number of the last stop, 0 before the first: what a resume has to answer."""
        return self._number

    @property
    def epoch(self) -> int | None:
        """Epoch of the lease in force; None where there's none."""
        return self._epoch if self._armed else None

    def arm(self, epoch: int, *, now: float) -> Verdict:
        """Let the holder of a new lease move the robot: FRESH, or why not.

        Args:
            epoch: Of the lease, newer than every one before.
            now: [s].

        Returns:
            FRESH; MOVING if the robot may be in motion, INVALID or STALE_EPOCH.
        """
        self._check(now)
        if not whole(epoch, 1):
            return Verdict.INVALID
        if epoch <= self._epoch:
            return Verdict.STALE_EPOCH
        self._expire(now)
        if self._state in (WatchdogState.RUNNING, WatchdogState.STOPPING):
            return Verdict.MOVING
        self._epoch, self._armed, self._first = epoch, True, 0
        self._window = SequenceWindow(self.config.window)
        self._go_on(now)
        return Verdict.FRESH

    def disarm(self, *, now: float) -> None:
        """End the lease: its epoch is stale from now on, and the robot stops."""
        self.stop(StopReason.LEASE, now=now)
        self._armed = False

    def heard(self, stamp: Stamp, *, now: float, authentic: bool, uncertainty: float = 0.0) -> Verdict:
        """Judge a message.

        Args:
            stamp: Its head.
            now: [s].
            authentic: Whether it was proven to come from the holder of the lease, unchanged.
            uncertainty: Of the clocks [s], ≥ 0: |error of issued_at| ≤ uncertainty; infinity where they were
                never compared.

        Returns:
            FRESH if it's to be carried out, NOTED, or why it isn't.
        """
        self._check(now)
        refusal = self._refusal(stamp, now, authentic, uncertainty)
        if refusal is not None:
            return refusal
        # A message can't undo a loss that nobody has looked at yet.
        self._expire(now)
        if self._state is WatchdogState.RUNNING:
            self._now, self._deadline = now, now + self.config.timeout
        elif stamp.kind is Kind.RESUME:
            if self._state is WatchdogState.STOPPING:
                return Verdict.MOVING
            if stamp.answers != self._number:
                return Verdict.OTHER_STOP
            self._first = stamp.sequence
            self._go_on(now)
        elif stamp.kind is Kind.HEARTBEAT:
            self._window.note(stamp.sequence)
            return Verdict.NOTED
        elif self.config.policy is LossPolicy.HOLD and self._reason is StopReason.LINK_LOSS:
            self._go_on(now)
        else:
            return Verdict.HALTED
        self._window.note(stamp.sequence)
        return Verdict.FRESH

    def stop(self, reason: StopReason, *, now: float, manner: Manner = Manner.COMMANDED) -> None:
        """Stop for a reason on board or by the operator's word, in any state; only a resume or a lease ends it.

        Args:
            reason: Why.
            now: [s].
            manner: `MEASURED` where the robot isn't where it was commanded to be.
        """
        self._check(now)
        if not isinstance(reason, StopReason) or reason is StopReason.LINK_LOSS:
            raise InvalidValueError("reason", reason, "a StopReason other than a link loss")
        if manner not in (Manner.COMMANDED, Manner.MEASURED):
            raise InvalidValueError("manner", manner, "commanded or measured")
        self._begin(reason, manner, now, now)

    def stopped(self, number: int, *, now: float) -> bool:
        """Say that the robot has come to rest by a stop.

        Args:
            number: Of the stop.
            now: [s].

        Returns:
            Whether that was the last stop, and had been handed out; else nothing changes.
        """
        self._check(now)
        self._expire(now)
        awaited = self._state is WatchdogState.STOPPING and number == self._number
        if not awaited or any(isinstance(action, BeginStop) for action in self._queue):
            return False
        self._state, self._finish, self._now = WatchdogState.HALTED, None, now
        return True

    def advance(self, *, now: float, rest_at: float | None = None) -> tuple[Action, ...]:
        """Return what is to be done now, in order.

        Args:
            now: [s].
            rest_at: When what was accepted comes to rest by itself [s]; None where it doesn't, or nobody knows.
        """
        self._check(now)
        if rest_at is not None:
            rest_at = finite("rest_at", rest_at, "None or finite seconds")
        self._expire(now)
        self._now = now
        actions = tuple(self._handed_out(action, now, rest_at) for action in self._queue)
        self._queue.clear()
        return actions

    def next_deadline(self) -> float | None:
        """When `advance` has something to say [s]; None if never without another event."""
        if self._queue:
            return self._now
        return self._deadline if self._state is WatchdogState.RUNNING else self._finish

    def _refusal(self, stamp: Stamp, now: float, authentic: bool, uncertainty: float) -> Verdict | None:
        if authentic is not True:
            return Verdict.NOT_AUTHENTIC
        if not isinstance(stamp, Stamp) or not stamp.valid:
            return Verdict.INVALID
        if stamp.epoch > self._epoch:
            return Verdict.UNKNOWN_EPOCH
        if stamp.epoch < self._epoch or not self._armed:
            return Verdict.STALE_EPOCH
        if self.config.policy is LossPolicy.HALT:
            if not 0 <= uncertainty <= self.config.max_uncertainty:
                return Verdict.CLOCK_UNKNOWN
            age = now - stamp.issued_at
            if age < -uncertainty - _ROUNDING:
                return Verdict.FROM_THE_FUTURE
            if age + uncertainty > self.config.max_age:
                return Verdict.TOO_OLD
        if stamp.sequence < self._first:
            return Verdict.BEFORE_RESUME
        return self._window.refusal(stamp.sequence)

    def _handed_out(self, action: Action, now: float, rest_at: float | None) -> Action:
        if isinstance(action, BeginStop) and self._may_finish and rest_at is not None:
            end = action.due + self.config.timeout
            if max(now, rest_at) <= end:
                self._finish, self._may_finish = end, False
                return replace(action, at=now, manner=Manner.FINISH)
        return replace(action, at=now)

    def _expire(self, now: float) -> None:
        if self._state is WatchdogState.RUNNING and now >= self._deadline:
            self._begin(StopReason.LINK_LOSS, Manner.COMMANDED, self._deadline, now)
            self._may_finish = self.config.future is AcceptedFuture.FINISH
        elif self._finish is not None and now >= self._finish:
            self._begin(StopReason.LINK_LOSS, Manner.COMMANDED, self._finish, now)

    def _begin(self, reason: StopReason, manner: Manner, due: float, now: float) -> None:
        waiting = [action for action in self._queue if isinstance(action, BeginStop)]
        if any(action.manner is Manner.MEASURED for action in waiting):
            manner = Manner.MEASURED
        self._state, self._reason = WatchdogState.STOPPING, reason
        self._finish, self._may_finish = None, False
        self._number += 1
        self._now = now
        self._queue = [BeginStop(self._number, now, due, reason, manner)]

    def _go_on(self, now: float) -> None:
        self._state, self._finish, self._may_finish = WatchdogState.RUNNING, None, False
        self._now, self._deadline = now, now + self.config.timeout
        self._queue.append(GoOn(now, self._epoch))

    def _check(self, now: float) -> None:
        not_before("now", now, self._now, "at or after the present, {} s")
