"""Watchdog, lease and guard as one: what stands between a link and a robot.

It adds three rules to its parts: a bad value feeds nothing, only a message that counts keeps a lease, and a lease
that ends disarms the watchdog, so that the next one begins with the robot at rest.
"""

from __future__ import annotations

from typing import TypeAlias

from robots.onboard.following import FollowingAbort
from robots.onboard.lease import Answer, Ended, Grant, Lease, LeaseConfig, LeaseRefusal, LeaseState
from robots.onboard.stamps import Stamp, Verdict
from robots.onboard.values import Refusal, ValueGuard
from robots.onboard.watchdog import Action, Manner, StopReason, Watchdog, WatchdogConfig, WatchdogState
from vrs.checks import finite
from vrs.errors import InvalidValueError

Output: TypeAlias = Action | Ended | Grant
"""What `Supervision.advance` gives."""


class Supervision:
    """Says what a robot may do, from the messages that reach it. Times as in `Watchdog` and `Lease`."""

    __slots__ = ("_aborted", "_guard", "_lease", "_outputs", "_watchdog")

    def __init__(
        self,
        watchdog: WatchdogConfig | None = None,
        lease: LeaseConfig | None = None,
        guard: ValueGuard | None = None,
        *,
        epoch: int = 0,
    ) -> None:
        """Begin without a lease.

        Args:
            watchdog: Of the link.
            lease: Not shorter than the watchdog's timeout, which would make two of it.
            guard: Looks at commands; None where another part does.
            epoch: The last epoch that was ever granted; see `Lease`.

        Raises:
            InvalidValueError: If the lease is shorter, or the epoch isn't one.
        """
        self._watchdog, self._lease = Watchdog(watchdog, epoch=epoch), Lease(lease, epoch=epoch)
        least, given = self._watchdog.config.timeout, self._lease.config.timeout
        if given < least:
            raise InvalidValueError("lease timeout", given, f"at least the watchdog's, {least} s")
        self._guard = guard
        self._aborted: FollowingAbort | None = None
        self._outputs: list[Ended | Grant] = []

    @property
    def state(self) -> WatchdogState:
        """The watchdog's state, as of the last call."""
        return self._watchdog.state

    @property
    def reason(self) -> StopReason | None:
        """Why the robot was stopped; None while it may move."""
        return self._watchdog.reason

    @property
    def number(self) -> int:
        """Number of the last stop: what a resume has to answer."""
        return self._watchdog.number

    @property
    def holder(self) -> str | None:
        """Who has the lease."""
        return self._lease.holder

    @property
    def epoch(self) -> int | None:
        """Epoch of the lease in force."""
        return self._lease.epoch

    @property
    def aborted(self) -> FollowingAbort | None:
        """The violation that stopped the robot; None where it wasn't one, or since it may move again."""
        return self._aborted if self.reason is StopReason.TOLERANCE else None

    def acquire(self, holder: str, *, now: float) -> Grant | LeaseRefusal:
        """Ask for a free lease: see `Lease.acquire`. ENDING too where the robot isn't at rest."""
        self._settle(now)
        if self._lease.state is LeaseState.FREE and self._watchdog.state is WatchdogState.STOPPING:
            return LeaseRefusal.ENDING
        answer = self._lease.acquire(holder, now=now)
        if isinstance(answer, Grant):
            self._watchdog.arm(answer.epoch, now=now)
        return answer

    def take_over(self, holder: str, *, admin: bool, now: float) -> Answer:
        """Take the lease from whoever has it: see `Lease.take_over`. The grant comes from `advance`."""
        self._settle(now)
        if admin is True and self._lease.state is LeaseState.FREE:
            return self.acquire(holder, now=now)
        answer = self._lease.take_over(holder, admin=admin, now=now)
        self._settle(now)
        return answer

    def release(self, epoch: int, *, now: float) -> LeaseRefusal | None:
        """Give the lease back; the robot is stopped."""
        self._settle(now)
        refusal = self._lease.release(epoch, now=now)
        self._settle(now)
        return refusal

    def receive(
        self, stamp: Stamp, command: object = None, *, now: float, authentic: bool, uncertainty: float = 0.0
    ) -> Verdict | Refusal:
        """Judge a message; it's to be carried out only if the answer is `Verdict.FRESH`.

        Args:
            stamp: Its head.
            command: What it asks for, looked at by the guard.
            now: [s].
            authentic: Whether it was proven to come from the holder of the lease, unchanged.
            uncertainty: Of the clocks [s]; see `Watchdog.heard`.
        """
        self._settle(now)
        if authentic is True and self._guard is not None and command is not None:
            refusal = self._guard.command(command)
            if refusal is not None:
                return refusal
        verdict = self._watchdog.heard(stamp, now=now, authentic=authentic, uncertainty=uncertainty)
        if verdict.counts:
            self._lease.heard(stamp.epoch, now=now)
        return verdict

    def stop(self, reason: StopReason, *, now: float) -> None:
        """Stop the robot from its commanded state, until a resume or a new lease."""
        self._settle(now)
        self._watchdog.stop(reason, now=now)

    def abort(self, violation: FollowingAbort, *, now: float) -> None:
        """Stop the robot from its measured state, until a resume or a new lease."""
        self._settle(now)
        self._watchdog.stop(StopReason.TOLERANCE, now=now, manner=Manner.MEASURED)
        self._aborted = violation

    def stopped(self, number: int, *, now: float) -> bool:
        """Say that the robot has come to rest by a stop: see `Watchdog.stopped`."""
        self._settle(now)
        done = self._watchdog.stopped(number, now=now)
        if done and self._lease.state is LeaseState.ENDING:
            grant = self._lease.stopped(now=now)
            if isinstance(grant, Grant):
                self._watchdog.arm(grant.epoch, now=now)
                self._outputs.append(grant)
        return done

    def advance(self, *, now: float, rest_at: float | None = None) -> tuple[Output, ...]:
        """Return what is to be done and told now, in order: see `Watchdog.advance`."""
        self._settle(now)
        outputs = (*self._outputs, *self._watchdog.advance(now=now, rest_at=rest_at))
        self._outputs.clear()
        return outputs

    def next_deadline(self) -> float | None:
        """When `advance` has something to say [s]; None if never without another event."""
        times = [t for t in (self._watchdog.next_deadline(), self._lease.next_deadline()) if t is not None]
        return min(times, default=None)

    def _settle(self, now: float) -> None:
        due = self._lease.next_deadline()
        # Nothing is written before something is due: a refused message is to change no bit.
        if due is None or finite("now", now, "finite seconds") < due:
            return
        ended = self._lease.advance(now=now)
        if ended is not None:
            self._watchdog.disarm(now=now)
            self._outputs.append(ended)
