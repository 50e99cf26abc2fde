"""Reliable delivery: requests sent again until answered and carried out once, in order; messages repeated."""

from __future__ import annotations

import logging
import math
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from typing import Annotated, Generic, TypeVar

from interfaces.link.conditions import Service
from interfaces.link.delays import MAX_DELAY
from interfaces.link.link import moment
from interfaces.messages import Order, Outcome
from vrs.checks import integer_in, number_in, validated, within
from vrs.commands import Stop, finite
from vrs.errors import InvalidValueError

T = TypeVar("T")

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

    def __contains__(self, number: object) -> bool:
        return number in self._waiting

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
        self._next = 1
        self._early: dict[int, Order] = {}
        self.outcomes: OrderedDict[int, Outcome] = OrderedDict()
        """Of the newest orders, by number."""

    def take(self, order: Order, now: float) -> None:
        """Take an order that has come at now [s]."""
        number = order.number
        if number < self._next:
            self.settle(self.outcomes.get(number) or Outcome(number, now, None, OVERTAKEN))
            return
        if isinstance(order.command, Stop):
            for early in sorted(n for n in self._early if n < number):
                del self._early[early]
                self.settle(Outcome(early, now, None, OVERTAKEN))
            self._next = number
        if number - self._next <= BACKLOG:
            self._early[number] = order
        while self._next in self._early:
            due = self._early.pop(self._next)
            self._next += 1
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


MAX_REPEATS = 1024
"""Most messages in a packet."""


@dataclass(frozen=True, slots=True)
@validated
class Bundle(Generic[T]):
    """A packet with the newest messages."""

    first: Annotated[int, within(0, 2**63)]
    """Sequence number of the first message in it, ≥ 0."""
    messages: tuple[T, ...]
    """The messages first, first + 1, …; 1 to 1024."""

    def __post_init__(self) -> None:
        if not isinstance(self.messages, tuple) or not 1 <= len(self.messages) <= MAX_REPEATS:
            raise InvalidValueError("messages", self.messages, f"a tuple of 1 to {MAX_REPEATS}")


class Repeater(Generic[T]):
    """The sender: puts each new message in a packet with those before it.

    Args:
        repeat: Messages in a packet, 1 to 1024: each message is sent as often, if others follow it.
    """

    def __init__(self, repeat: int) -> None:
        self._recent: deque[T] = deque(maxlen=integer_in("repeat", repeat, 1, MAX_REPEATS))
        self._count = 0

    def send(self, message: T) -> Bundle[T]:
        """The packet for a new message."""
        self._recent.append(message)
        self._count += 1
        return Bundle(self._count - len(self._recent), tuple(self._recent))

    def again(self) -> Bundle[T] | None:
        """The last packet once more, for a pause in which no new message repeats it; None before the first."""
        return Bundle(self._count - len(self._recent), tuple(self._recent)) if self._recent else None


class RepeatReceiver(Generic[T]):
    """The receiver: gives each message once.

    It believes sequence numbers: what comes from a network must have been authenticated before.

    Args:
        service: `IN_ORDER` gives messages in the order of their numbers, and waits for one that is missing,
            but no longer than `patience`; `DATAGRAM` gives them as they come.
        patience: Longest wait for a missing message [s], in [0, 3600].
        window: How far numbers are told apart behind the newest, 1 to 1,048,576. Older ones are refused, and
            no more messages than these are held.
    """

    def __init__(self, service: Service = Service.IN_ORDER, *, patience: float = 1.0, window: int = 1024) -> None:
        self._in_order = Service(service) is Service.IN_ORDER
        self._patience = number_in("patience", patience, 0.0, MAX_DELAY, "seconds")
        self._window = integer_in("window", window, 1, 2**20)
        self._next = 0
        """In order: the number to be given next. Otherwise: the oldest that may still be given."""
        self._held: dict[int, T] = {}
        self._since: dict[int, float] = {}
        self._given: set[int] = set()
        self._now = -math.inf
        self.missed = 0
        """Messages that were given up: they never came, or too late."""
        self.repeated = 0
        """Messages that were refused because they had been given, held or given up."""

    def receive(self, bundle: Bundle[T], *, now: float) -> tuple[T, ...]:
        """Take a packet that came at now [s]; return the messages that it makes available.

        Raises:
            InvalidValueError: If now is not finite, or runs back.
        """
        self._now = moment("now", now, self._now)
        given = [*self._give_overdue()]
        for offset, message in enumerate(bundle.messages):
            given += self._take(bundle.first + offset, message)
        return (*given, *self._give_overdue())

    def advance(self, *, now: float) -> tuple[T, ...]:
        """Messages that become available because one before them is given up by now [s].

        Raises:
            InvalidValueError: If now is not finite, or runs back.
        """
        self._now = moment("now", now, self._now)
        return tuple(self._give_overdue())

    def next_deadline(self) -> float | None:
        """When a missing message is given up [s]; None when none is waited for."""
        return min(self._since.values()) + self._patience if self._since else None

    def _take(self, number: int, message: T) -> list[T]:
        if number < self._next or number in self._held or number in self._given:
            self.repeated += 1
            return []
        out: list[T] = []
        oldest = number - self._window + 1
        if not self._in_order:
            self._given.add(number)
            self._forget(oldest)
            return [message]
        if self._next < oldest:
            out += self._skip_to(oldest)
        self._held[number] = message
        self._since[number] = self._now
        return [*out, *self._give_next()]

    def _give_next(self) -> list[T]:
        """Give what is next in order."""
        out = []
        while self._next in self._held:
            out.append(self._held.pop(self._next))
            del self._since[self._next]
            self._next += 1
        return out

    def _skip_to(self, number: int) -> list[T]:
        """Give up whatever is missing before a number; give what is held there."""
        out = []
        for held in sorted(key for key in self._held if key < number):
            self.missed += held - self._next
            out.append(self._held.pop(held))
            del self._since[held]
            self._next = held + 1
        self.missed += max(0, number - self._next)
        self._next = max(self._next, number)
        return [*out, *self._give_next()]

    def _give_overdue(self) -> list[T]:
        """Give up what has been missing for longer than the patience.

        A message is known to be missing since the first of those after it came.
        """
        overdue = [key for key, since in self._since.items() if since + self._patience <= self._now]
        return self._skip_to(max(overdue)) if overdue else []

    def _forget(self, oldest: int) -> None:
        """Without order: refuse from now on what is older than the window."""
        if oldest <= self._next:
            return
        near = range(self._next, oldest) if oldest - self._next < len(self._given) else self._given
        old = [number for number in near if number < oldest and number in self._given]
        self.missed += (oldest - self._next) - len(old)
        self._given.difference_update(old)
        self._next = oldest
