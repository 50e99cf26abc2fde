"""The control lease: who may command a robot, one at a time.

Every lease has an epoch of 64 bits, higher than all before it, and every command carries one. However a lease
ends, by release, expiry or take-over, its epoch is stale at once, and the next lease begins only after the robot
has been stopped. There's no queue: nobody gets a lease without having asked for it just then.

    FREE ──acquire──▶ HELD ──release, expiry, take-over──▶ ENDING ──robot at rest──▶ FREE, or HELD by who took over
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Annotated, TypeAlias

from robots.onboard.watchdog import LARGEST, whole
from vrs.checks import not_before, validated, within
from vrs.errors import InvalidValueError

_NAME = 100
"""Longest name of a holder [characters]."""


class LeaseState(enum.StrEnum):
    """Where a lease is."""

    FREE = "free"
    HELD = "held"
    ENDING = "ending"
    """It has ended, and the robot isn't known to be at rest yet."""


class LeaseEnd(enum.StrEnum):
    """Why a lease ended."""

    RELEASED = "released"
    EXPIRED = "expired"
    TAKEN_OVER = "taken over"


class LeaseRefusal(enum.StrEnum):
    """Why a request was refused; nothing has changed then."""

    INVALID = "invalid"
    """The holder's name isn't a text of 1 to 100 characters."""
    HELD = "held"
    """Somebody has it."""
    ENDING = "ending"
    """The robot isn't at rest yet; ask again."""
    NOT_ADMIN = "not admin"
    """Only an admin may take over."""
    STALE_EPOCH = "stale epoch"
    """The epoch isn't that of the lease in force."""
    EXHAUSTED = "exhausted"
    """There are no epochs left."""


@dataclass(frozen=True, slots=True)
class Grant:
    """A lease that has begun."""

    epoch: int
    holder: str
    at: float
    """[s]."""


@dataclass(frozen=True, slots=True)
class Pending:
    """A take-over that waits for the robot to stop; the grant comes from `Lease.stopped`."""

    holder: str


@dataclass(frozen=True, slots=True)
class Ended:
    """A lease that has ended: the robot is to be stopped, `Lease.stopped` answers."""

    epoch: int
    holder: str
    why: LeaseEnd
    at: float
    """[s]."""


Answer: TypeAlias = Grant | Pending | LeaseRefusal


@dataclass(frozen=True, slots=True)
@validated
class LeaseConfig:
    """How long a lease lasts."""

    timeout: Annotated[float, within(0.1, 60.0, "s")] = 2.0
    """It expires so long after its last heartbeat or command [s], 0.1 to 60."""


class Lease:
    """Grants the lease of one robot, and ends it.

    Times are of one clock that never runs back; a time earlier than one given before, NaN or infinity raises
    InvalidValueError, and changes nothing. Who asks, and whether it's an admin, is for the caller to find out.
    """

    __slots__ = ("_deadline", "_ended", "_epoch", "_holder", "_next", "_now", "_state", "config")

    def __init__(self, config: LeaseConfig | None = None, *, epoch: int = 0) -> None:
        """Begin free.

        Args:
            config: Its timeout.
            epoch: The last epoch that was ever granted, 0 to 2⁶⁴ − 1. A robot that starts anew passes one that no
                earlier life of it can have reached, for example the seconds since 1970 times 2³².
        """
        self.config = config or LeaseConfig()
        if not whole(epoch, 0):
            raise InvalidValueError("epoch", epoch, f"an integer in [0, {LARGEST}]")
        self._epoch = epoch
        self._state = LeaseState.FREE
        self._holder = ""
        self._next: str | None = None
        self._now = self._deadline = -math.inf
        self._ended: Ended | None = None

    @property
    def state(self) -> LeaseState:
        """The state, as of the last call."""
        return self._state

    @property
    def epoch(self) -> int | None:
        """Epoch of the lease in force; None where there's none."""
        return self._epoch if self._state is LeaseState.HELD else None

    @property
    def holder(self) -> str | None:
        """Who has it; None where nobody has."""
        return self._holder if self._state is LeaseState.HELD else None

    def acquire(self, holder: str, *, now: float) -> Grant | LeaseRefusal:
        """Ask for a free lease.

        Args:
            holder: Who asks, 1 to 100 characters.
            now: [s].
        """
        self._check(now)
        if not _named(holder):
            return LeaseRefusal.INVALID
        self._expire(now)
        if self._state is not LeaseState.FREE:
            return LeaseRefusal.HELD if self._state is LeaseState.HELD else LeaseRefusal.ENDING
        return self._granted(holder, now)

    def take_over(self, holder: str, *, admin: bool, now: float) -> Answer:
        """Take the lease from whoever has it; where it's free, that's `acquire`.

        Args:
            holder: Who asks, 1 to 100 characters. Of several who wait for the robot to stop, the last gets it.
            admin: Whether the caller has seen the admin's token.
            now: [s].
        """
        self._check(now)
        if not _named(holder):
            return LeaseRefusal.INVALID
        if admin is not True:
            return LeaseRefusal.NOT_ADMIN
        self._expire(now)
        if self._state is LeaseState.FREE:
            return self._granted(holder, now)
        if self._epoch == LARGEST:
            return LeaseRefusal.EXHAUSTED
        if self._state is LeaseState.HELD:
            self._end(LeaseEnd.TAKEN_OVER, now)
        self._next = holder
        return Pending(holder)

    def revoke(self, *, admin: bool, now: float) -> LeaseRefusal | None:
        """Take the lease from whoever has it, or is about to take it over, for nobody: None, or why not.

        Args:
            admin: Whether the caller has seen the admin's token.
            now: [s].
        """
        self._check(now)
        if admin is not True:
            return LeaseRefusal.NOT_ADMIN
        self._expire(now)
        if self._state is LeaseState.HELD:
            self._end(LeaseEnd.TAKEN_OVER, now)
        self._next = None
        return None

    def release(self, epoch: int, *, now: float) -> LeaseRefusal | None:
        """Give the lease back: None, or why not. An epoch that isn't in force releases nothing."""
        self._check(now)
        self._expire(now)
        if not whole(epoch, 1) or epoch != self.epoch:
            return LeaseRefusal.STALE_EPOCH
        self._end(LeaseEnd.RELEASED, now)
        return None

    def heard(self, epoch: int, *, now: float) -> LeaseRefusal | None:
        """Take note of a message of the holder, or say why not: only the epoch in force keeps a lease."""
        refusal = self.refused(epoch, now=now)
        if refusal is None:
            self._now, self._deadline = now, now + self.config.timeout
        return refusal

    def refused(self, epoch: int, *, now: float) -> LeaseRefusal | None:
        """Say why an epoch doesn't count, None where it does; unlike `heard` this keeps no lease."""
        self._check(now)
        self._expire(now)
        return None if whole(epoch, 1) and epoch == self.epoch else LeaseRefusal.STALE_EPOCH

    def stopped(self, *, now: float) -> Grant | LeaseRefusal | None:
        """Say that the robot is at rest and takes no command.

        Returns:
            The grant of who took over, if somebody did; None if the lease is free now, or hadn't ended.
        """
        self._check(now)
        if self._state is not LeaseState.ENDING or self._ended is not None:
            return None
        self._state, self._now = LeaseState.FREE, now
        holder, self._next = self._next, None
        return None if holder is None else self._granted(holder, now)

    def advance(self, *, now: float) -> Ended | None:
        """Return that the lease has ended, once; the robot is then to be stopped."""
        self._check(now)
        self._expire(now)
        self._now = now
        ended, self._ended = self._ended, None
        return ended

    def next_deadline(self) -> float | None:
        """When `advance` has something to say [s]; None if never without another event."""
        if self._ended is not None:
            return self._now
        return self._deadline if self._state is LeaseState.HELD else None

    def _granted(self, holder: str, now: float) -> Grant | LeaseRefusal:
        if self._epoch == LARGEST:
            return LeaseRefusal.EXHAUSTED
        self._epoch += 1
        self._state, self._holder = LeaseState.HELD, holder
        self._now, self._deadline = now, now + self.config.timeout
        return Grant(self._epoch, holder, now)

    def _expire(self, now: float) -> None:
        if self._state is LeaseState.HELD and now >= self._deadline:
            self._end(LeaseEnd.EXPIRED, now)

    def _end(self, why: LeaseEnd, now: float) -> None:
        self._state, self._now = LeaseState.ENDING, now
        self._ended = Ended(self._epoch, self._holder, why, now)

    def _check(self, now: float) -> None:
        not_before("now", now, self._now, "at or after the present, {} s")


def _named(holder: object) -> bool:
    return isinstance(holder, str) and 1 <= len(holder) <= _NAME
