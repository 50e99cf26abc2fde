"""The robot's site: which orders of the operator count, and when it has lost him.

What's done with orders that count differs between arms and bases: `FollowingArm`, `FollowingBase`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar, Generic, Literal, TypeVar

from interfaces.link.delays import share_of
from interfaces.link.quantiles import SlidingQuantiles
from interfaces.messages.fields import Epoch
from interfaces.messages.sites import SiteOrders
from robots.onboard.watchdog import BeginStop, Stamp, StopReason, Verdict, Watchdog, WatchdogConfig, WatchdogState
from vrs.checks import validated, within

O = TypeVar("O", bound=SiteOrders)  # noqa: E741 - orders
R = TypeVar("R")

LOST = "nothing fresh came from the operator: link loss"
"""Why a robot halts that has lost its operator."""


class RobotSite(ABC, Generic[O, R]):
    """Carries out the orders of one operator, as far as a watchdog lets them count.

    Times are by its clock, as the robot takes the operator's to be [s].
    """

    rearms: ClassVar[bool]
    """Whether an epoch may follow another one without a halt between them."""

    def __init__(self, watchdog: WatchdogConfig | None, beat: float, *, now: float, reported: int) -> None:
        """Wait for an epoch.

        Args:
            watchdog: When the link counts as lost; None: no message is too old.
            beat: Time between two reports [s].
            now: [s].
            reported: Number of the newest report of an earlier life, which the operator may know.
        """
        self.epoch: Epoch | Literal[0] = 0
        """That it follows; 0 before the first."""
        self.halted = ""
        """Why it stopped by itself; empty while it follows the operator."""
        self.watchdog = None if watchdog is None else Watchdog(watchdog)
        self._verdict = Verdict.FRESH
        """Of the newest message, while it follows."""
        self._refused = ""
        """Why the newest orders didn't count; empty if they did."""
        self._newest: tuple[int, float, float] | None = None
        """Number of the newest orders that counted, when they were sent and when they came [s]."""
        self._uncertainty: float | None = None
        """Of the operator's clock [s]; None where nothing is known."""
        self._beat, self._due, self._reports = beat, now, reported

    def join(self, orders: O, reason: str, *, now: float) -> None:
        """Meet an operator in the midst of the epoch of these orders: wait for the next one, and report why."""
        self.epoch, self.halted, self._due = orders.epoch, reason, now

    def receive(self, orders: O, *, now: float, correction: float = 0.0, uncertainty: float = 0.0) -> None:
        """Take in orders; those of an old epoch are ignored, as all are once it has stopped by itself.

        Args:
            orders: The message.
            now: [s].
            correction: What is to be added to its stamp [s].
            uncertainty: Of that [s].
        """
        if orders.epoch > self.epoch and self.rests(now=now):
            self.begin(orders, now)
        if orders.epoch != self.epoch:
            return
        self._uncertainty = uncertainty if math.isfinite(uncertainty) else None
        counts = self._counts(orders, now, correction, uncertainty)
        self._heed(orders, now, counts=counts)
        if not counts:
            return
        new = self._newest is None or orders.number > self._newest[0]
        if new:
            self._newest = orders.number, orders.sent_at, now
        self._follow(orders, now, new=new)

    def begin(self, orders: O, now: float) -> None:
        """Follow a new epoch, from where the robot rests, if nothing is in the way."""
        if not self._admits(orders) or (self.watchdog is not None and not self._armed(self.watchdog, orders, now)):
            return
        self.epoch, self.halted, self._newest = orders.epoch, "", None
        self._start(orders, now)

    def _armed(self, watchdog: Watchdog, orders: O, now: float) -> bool:
        """Whether the watchdog lets a new epoch begin; the one before has ended with the robot at rest."""
        self._watch(now)
        if self.rearms and watchdog.state is WatchdogState.RUNNING:
            watchdog.disarm(now=now)
            watchdog.advance(now=now)
            watchdog.stopped(watchdog.number, now=now)
        return watchdog.arm(orders.epoch, now=now).counts

    def _counts(self, orders: O, now: float, correction: float, uncertainty: float) -> bool:
        """Whether the watchdog lets a message count."""
        if self.watchdog is None:
            return True
        stamp = Stamp(orders.epoch, orders.number, orders.sent_at + correction)
        verdict = self.watchdog.heard(stamp, now=now, authentic=True, uncertainty=uncertainty)
        if verdict is Verdict.HALTED and self._carries_on:
            return True
        if verdict not in (Verdict.HALTED, Verdict.STALE_EPOCH, Verdict.UNKNOWN_EPOCH):
            self._verdict = verdict
            self._refused = "" if verdict.counts else f"the newest message was refused: {verdict.value}"
        return verdict.counts

    def _watch(self, now: float) -> None:
        """Let the watchdog do what is due by now."""
        watchdog = self.watchdog
        if watchdog is None:
            return
        if any(isinstance(action, BeginStop) for action in watchdog.advance(now=now)):
            self._lose(now)
            if not self._carries_on:
                self.halt(lost(watchdog.config, self._verdict), now=now)
        if self._carries_on or (self.halted and self.rests(now=now)):
            watchdog.stopped(watchdog.number, now=now)

    def _stop_watching(self, reason: StopReason, now: float) -> None:
        """Tell the watchdog that the robot stops, where it doesn't know."""
        if self.watchdog is not None and self.watchdog.state is WatchdogState.RUNNING:
            self.watchdog.stop(reason, now=now)

    def advance(self, *, now: float) -> tuple[R, ...]:
        """Do what is due, and say what is to be sent."""
        self._watch(now)
        if now < self._due:
            return ()
        self._due = now + self._beat
        self._reports += 1
        return (self._report(now),)

    def next_deadline(self) -> float:
        """When there's something to do."""
        watch = None if self.watchdog is None else self.watchdog.next_deadline()
        return self._due if watch is None else min(self._due, watch)

    @abstractmethod
    def rests(self, *, now: float) -> bool:
        """Whether the robot is to stand still."""

    @abstractmethod
    def halt(self, reason: str, *, now: float) -> None:
        """Stop, and wait for a new epoch."""

    @abstractmethod
    def _admits(self, orders: O) -> bool:
        """Whether a new epoch may begin, with the robot at rest."""

    @abstractmethod
    def _start(self, orders: O, now: float) -> None:
        """Begin an epoch."""

    def _heed(self, orders: O, now: float, *, counts: bool) -> None:
        """Do what of orders of this epoch is done even where they don't count."""

    @abstractmethod
    def _follow(self, orders: O, now: float, *, new: bool) -> None:
        """Follow orders that count, in whatever order they come, unless it has halted."""

    @property
    def _carries_on(self) -> bool:
        """Whether it goes on by itself though the operator is lost."""
        return False

    def _lose(self, now: float) -> None:
        """The operator is lost: what the robot does by itself ends or goes on."""

    @abstractmethod
    def _report(self, now: float) -> R:
        """What is told now, with the newest number."""


def lost(watchdog: WatchdogConfig, verdict: Verdict) -> str:
    """Why a robot halts that has lost its operator, and what mends it.

    Args:
        watchdog: By which it has.
        verdict: What became of the newest message.
    """
    mend = "on a link this slow start vrs serve with --link-loss hold"
    if verdict.counts:
        return f"{LOST} ({mend})"
    if verdict is Verdict.TOO_OLD:
        mend = f"{watchdog.max_age:g} s are allowed: {mend}, or vrs robot with a larger --max-age"
    return f"{LOST} (the newest message was refused: {verdict}; {mend})"


@dataclass(frozen=True, slots=True)
@validated
class OffsetConfig:
    """How much delay is hidden."""

    share: float = 0.95
    """Share of the messages that come early enough, in (0, 1)."""
    margin: Annotated[float, within(0.0, 60.0)] = 0.05
    """Added to the quantile [s], in [0, 60]: for what the window hasn't seen."""
    window: Annotated[int, within(10, 100_000)] = 2000
    """Messages that count, in [10, 100000]."""
    horizon: Annotated[float, within(1.0, 86_400.0)] = 120.0
    """Age at which a message counts no more [s], in [1, 86400]."""

    def __post_init__(self) -> None:
        share_of(self.share)


class AdaptiveOffset:
    """D = −(quantile of the age of completeness + margin), by the robot's own clock.

    The age is how far the newest complete time lay behind the robot's clock just before a message came: delay,
    heartbeat period, losses and an unknown difference of the clocks are all in it, so that none need be known.
    """

    def __init__(self, config: OffsetConfig | None = None) -> None:
        self._config = OffsetConfig() if config is None else config
        self._ages = SlidingQuantiles(self._config.window, self._config.horizon)

    def heard(self, complete_until: float, *, now: float) -> None:
        """A message came.

        Args:
            complete_until: Up to where the timeline was known to be complete before it [s].
            now: By the robot's clock [s].
        """
        self._ages.add(now - complete_until, now=now)

    @property
    def D(self) -> float | None:
        """Timeline time less the robot's clock [s]; None before the first message."""
        age = self._ages.quantile(self._config.share)
        return None if age is None else -(age + self._config.margin)
