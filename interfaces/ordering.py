"""A client's orders, carried out once each and in their order, whatever the way does to them."""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Callable

from interfaces.messages import Order, Outcome
from vrs.commands import Stop

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
            self._settle(self.outcomes.get(number) or Outcome(number, None, OVERTAKEN, 0, now))
            return
        if isinstance(order.command, Stop):
            for early in sorted(n for n in self._early if n < number):
                del self._early[early]
                self._settle(Outcome(early, None, OVERTAKEN, 0, now))
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
                outcome = Outcome(due.number, None, f"{FAILED}: {type(error).__name__}", 0, now)
            self._settle(outcome)

    def _settle(self, outcome: Outcome) -> None:
        self.outcomes[outcome.number] = outcome
        if len(self.outcomes) > REMEMBERED:
            self.outcomes.popitem(last=False)
        self._tell(outcome)
