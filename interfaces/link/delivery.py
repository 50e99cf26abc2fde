"""Reliable delivery: messages are numbered, sent again until the other side has them, and taken once, in order."""

from __future__ import annotations

import logging
import math
from collections import OrderedDict
from collections.abc import Callable, Sequence
from itertools import islice
from typing import Generic, TypeVar

from interfaces.messages import Order, Outcome
from vrs.checks import finite
from vrs.commands import Stop
from vrs.errors import InvalidValueError

T = TypeVar("T")


class Outgoing(Generic[T]):
    """Messages that the other side isn't known to have, numbered without gaps from 1."""

    def __init__(self) -> None:
        """Start with none."""
        self.waiting: dict[int, T] = {}
        """By number, those that were put there first in front; what is taken out is sent no more."""
        self.count = 0
        """Messages added so far: the number of the newest."""
        self.acknowledged = 0
        """The other side has all up to this number."""

    def add(self, message: T) -> None:
        """Take the next message."""
        self.count += 1
        self.waiting[self.count] = message

    def acknowledge(self, newest: int) -> None:
        """Take it that the other side has all up to this number; what it said before may be more."""
        newest = min(newest, self.count)
        for number in range(self.acknowledged + 1, newest + 1):
            self.waiting.pop(number, None)
        self.acknowledged = max(self.acknowledged, newest)


class Incoming(Generic[T]):
    """Gives messages in the order of their numbers, each once, as soon as all before them are there."""

    def __init__(self, most: int) -> None:
        """Expect number 1.

        Args:
            most: How far ahead of the number that is missing messages are kept; those beyond must be sent again.
        """
        self._most = most
        self._early: dict[int, T] = {}
        self.count = 0
        """Messages given so far: the number of the newest."""

    def expects(self, number: int) -> bool:
        """Whether a message of this number would be taken, and hasn't been yet."""
        return self.count < number <= self.count + 1 + self._most and number not in self._early

    def take(self, first: int, messages: Sequence[T]) -> list[T]:
        """Take a run of messages that has come; return those whose turn it is.

        Args:
            first: Number of the first.
            messages: That one and those that follow it; they may have come before.
        """
        start, end = max(first, self.count + 1), max(first, self.count + 2 + self._most)
        self._early.update(enumerate(messages[start - first : end - first], start))
        due = []
        while self.count + 1 in self._early:
            self.count += 1
            due.append(self._early.pop(self.count))
        return due

    def skip_to(self, number: int) -> list[int]:
        """Wait for none before this number any more; return the numbers of those that had come."""
        given_up = sorted(early for early in self._early if early < number)
        for early in given_up:
            del self._early[early]
        self.count = number - 1
        return given_up


GROWTH = 1.5
"""Each interval is so many times as long as the one before."""

LONGEST = 5.0
"""The longest interval [s]."""


def interval_of(value: object) -> float:
    """Return the first interval [s].

    Raises:
        InvalidValueError: If it isn't 0.001 to 5.
    """
    interval = finite("resend", value, "0.001 to 5 s")
    if not 1e-3 <= interval <= LONGEST:
        raise InvalidValueError("resend", value, "0.001 to 5 s")
    return interval


class Resending(Generic[T]):
    """What waits for an answer, by number."""

    def __init__(self, interval: float) -> None:
        """Wait for nothing.

        Args:
            interval: The first interval [s], 0.001 to 5.

        Raises:
            InvalidValueError: If it's out of range.
        """
        self._interval = interval_of(interval)
        self._waiting: dict[int, tuple[T, float, float]] = {}
        self._soonest = math.inf

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, number: int, request: T, now: float, *, first: float | None = None) -> None:
        """Wait for the answer to a request.

        Args:
            number: Its number.
            request: What is sent again.
            now: When it was sent [s].
            first: When it's sent again at first [s]; after the first interval unless given.
        """
        at = now + self._interval if first is None else first
        self._waiting[number] = request, at, self._interval
        self._soonest = min(self._soonest, at)

    def drop(self, number: int) -> None:
        """Wait no more for an answer; one that nobody waits for is none."""
        self._waiting.pop(number, None)
        if not self._waiting:
            self._soonest = math.inf

    def due(self, now: float) -> tuple[T, ...]:
        """What is to be sent again now, in the order of adding."""
        if now < self._soonest:
            return ()
        found = []
        for number, (request, at, interval) in self._waiting.items():
            if at <= now:
                found.append(request)
                longer = min(GROWTH * interval, LONGEST)
                self._waiting[number] = request, now + longer, longer
        self._soonest = min((at for _, at, _ in self._waiting.values()), default=math.inf)
        return tuple(found)

    def next_deadline(self) -> float | None:
        """When to look again what is due [s]; None for never."""
        return self._soonest if self._waiting else None

    def newest(self, count: int) -> tuple[T, ...]:
        """The requests that were added last, at most so many, in the order of adding."""
        found = [request for request, _, _ in islice(reversed(self._waiting.values()), count)]
        return tuple(reversed(found))

    def numbers(self) -> tuple[int, ...]:
        """The numbers, in the order of adding."""
        return tuple(self._waiting)


BACKLOG = 256
"""Orders that wait for an earlier one that's still under way, at most."""
REMEMBERED = 1024
"""Outcomes that are kept, to be sent again."""
OVERTAKEN = "issued before a stop that came first"
"""Why an order is refused that a stop has overtaken."""
FAILED = "the server failed at this command, and nothing has changed"
"""How the refusal of an order begins at which something raised that nobody expected."""

_LOG = logging.getLogger(__name__)


class OrderBook:
    """Puts orders into their order.

    An order that comes twice is answered twice and carried out once. One that comes too early waits for those
    before it. A stop doesn't wait: orders that were issued before it and come later are refused, since it would
    have dropped them.
    """

    def __init__(self, carry_out: Callable[[Order, float], Outcome], tell: Callable[[Outcome], None]) -> None:
        """Expect the first order.

        Args:
            carry_out: Carries out an order whose turn it is, at a time [s]; where it raises, nothing has happened.
            tell: Is given what's to be answered.
        """
        self._carry_out, self._tell = carry_out, tell
        self._orders: Incoming[Order] = Incoming(BACKLOG)
        self.outcomes: OrderedDict[int, Outcome] = OrderedDict()
        """Of the newest orders, by number."""

    def take(self, order: Order, now: float) -> None:
        """Take an order that has come at now [s]."""
        number = order.number
        if number <= self._orders.count:
            self.settle(self.outcomes.get(number) or Outcome(number, now, None, OVERTAKEN))
            return
        if isinstance(order.command, Stop):
            for early in self._orders.skip_to(number):
                self.settle(Outcome(early, now, None, OVERTAKEN))
        for due in self._orders.take(number, (order,)):
            try:
                outcome = self._carry_out(due, now)
            except Exception as error:  # noqa: BLE001 - whatever it is, it ends no more than this order
                _LOG.exception("an order failed, and changed nothing")
                outcome = Outcome(due.number, now, None, f"{FAILED}: {type(error).__name__}")
            self.settle(outcome)

    def settle(self, outcome: Outcome) -> None:
        """Remember an outcome, and send it."""
        self.outcomes[outcome.number] = outcome
        if len(self.outcomes) > REMEMBERED:
            self.outcomes.popitem(last=False)
        self._tell(outcome)
