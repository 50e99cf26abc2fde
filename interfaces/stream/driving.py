"""A mobile robot's site as a hub serves it: drive orders become wishes, and both robots' postures are told."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

from interfaces.link.delivery import OrderBook
from interfaces.messages import Order, Outcome, Refusal, RefusalCode, Request
from interfaces.messages.control import PROTOCOL, Problem, ProblemCode
from interfaces.messages.mobile import MobileWelcome
from interfaces.stream.codec import Value
from interfaces.teleop.operator import OperatorSite
from interfaces.teleop.virtual_base import HOLDS, VirtualBase
from vrs.commands import DriveCommand, Stop
from vrs.errors import InvalidValueError
from vrs.mobile import MobileModel

OUTBOX = 256
"""Replies that wait to be sent; the oldest is dropped first."""
_NOTHING = "a mobile robot's postures are told to every client: there's nothing to follow, ask or want"
_COMMANDS = "a mobile robot is driven and stopped: drive and stop are what can be ordered"
_AT_ONCE = "a live drive begins as it comes: leave out execute_at"


class DriveSite:
    """What a hub serves of a mobile robot."""

    def __init__(self, operator: OperatorSite[VirtualBase], model: MobileModel, *, room: str = "") -> None:
        """Serve an operator's site.

        Args:
            operator: The site.
            model: The virtual robot.
            room: Where the robot drives, for people.
        """
        self._operator, self._model, self._room = operator, model, room
        self.robot = model.name
        self.broadcasters = ()

    def broadcast(self, rate: float) -> object:
        """Nothing is broadcast but postures.

        Raises:
            InvalidValueError: Always.
        """
        raise InvalidValueError("rate", rate, "none: a mobile robot has no frames")

    def look(self) -> int:
        """No edit: nothing is followed."""
        return 0

    def servlet(self, *, admit: Callable[[Order], Refusal | None]) -> DriveServlet:
        """Make what serves one more client."""
        return DriveServlet(self._operator, admit)

    def time(self, now: float) -> float:
        """Session time is the site's own."""
        return now

    def advance(self, *, now: float) -> None:
        """There are no frames to be made."""

    def next_deadline(self) -> float | None:
        """Return None: it waits for nothing of its own."""
        return None

    def welcome(self, **facts: Any) -> MobileWelcome:
        """What a client is told that is let in: the facts that every client is told, and these."""
        model = self._model
        return MobileWelcome(
            protocol=PROTOCOL,
            robot=model.name,
            limits=model.limits,
            period=model.period,
            holds=HOLDS,
            room=self._room,
            **facts,
        )


class DriveServlet:
    """Carries out a client's orders once each, in their order."""

    def __init__(self, operator: OperatorSite[VirtualBase], admit: Callable[[Order], Refusal | None]) -> None:
        """Serve one client of an operator's site, which may order what is admitted."""
        self._operator, self._admit = operator, admit
        self._outbox: deque[Value] = deque(maxlen=OUTBOX)
        self._orders = OrderBook(self._carry_out, self._outbox.append)

    def receive(self, message: Request, *, now: float) -> None:
        """Take a message of the client, at session time now [s]."""
        if isinstance(message, Order):
            self._orders.take(message, now)
        else:
            self._outbox.append(Problem(ProblemCode.NOT_ALLOWED, _NOTHING, getattr(message, "number", None)))

    def _carry_out(self, order: Order, now: float) -> Outcome:
        refused = self._admit(order) or self._refusal(order, now)
        if refused is None:
            return Outcome(order.number, now)
        return Outcome(order.number, now, None, refused.text, code=refused.code)

    def _refusal(self, order: Order, now: float) -> Refusal | None:
        """Give the operator's site an order; why it isn't carried out, None if it is."""
        command = order.command
        if isinstance(command, Stop):
            self._operator.robot.stop(now=now)
            return None
        if not isinstance(command, DriveCommand):
            return Refusal(_COMMANDS)
        if command.execute_at is not None:
            return Refusal(_AT_ONCE)
        issued = now if command.issued_at is None else command.issued_at
        why = self._operator.robot.wish(command.v, command.w, issued_at=issued, now=now, lasts=command.duration)
        return Refusal(why, RefusalCode.NOT_FOLLOWING) if why else None

    def advance(self, *, now: float) -> tuple[Value, ...]:  # noqa: ARG002 - it's a servlet's
        """What is to be sent to the client."""
        replies = tuple(self._outbox)
        self._outbox.clear()
        return replies

    def next_deadline(self) -> float | None:
        """When there's something to be sent; −∞ for at once."""
        return float("-inf") if self._outbox else None

    def close(self) -> None:
        """There's nothing to leave."""
