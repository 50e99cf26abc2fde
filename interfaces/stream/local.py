"""A client of a hub in the same process: its rights, its lease and its bounds are those of any other."""

from __future__ import annotations

from collections.abc import Callable

from interfaces.messages import Order, Outcome, Refusal, control
from interfaces.stream.hub import Hub
from interfaces.stream.leasing import Wish
from vrs.clock import Clock
from vrs.commands import Command
from vrs.ledger import Receipt


class LocalClient:
    """An operator without a connection: what it asks, is answered at once."""

    is_connected = True

    def __init__(self, hub: Hub, clock: Clock, name: str, changed: Callable[[], None]) -> None:
        """Join a hub.

        Args:
            hub: The hub.
            clock: Session time.
            name: For people.
            changed: Is called when the hub has something to do.
        """
        self._hub, self._clock, self._changed = hub, clock, changed
        self._seat = hub.join(name)
        self._epoch = self._lapses = self._number = 0

    def now(self) -> float:
        """Session time [s]."""
        return self._clock.now()

    @property
    def state(self) -> control.State | None:
        """The real robot, as all clients are told."""
        _, state = self._hub.news.get(control.State, (0, None))
        assert state is None or isinstance(state, control.State)
        return state

    @property
    def lease(self) -> control.Lease:
        """The lease as it is."""
        lease = self._hub.leasing.seen_by(self._seat)
        epoch = lease.epoch or 0 if lease.commands else 0
        if epoch != self._epoch:
            self._lapses += self._epoch > 0
            self._epoch = epoch
        return lease

    @property
    def lapses(self) -> int:
        """How often commands of this client have ceased to count: a lease or a share has ended."""
        return self._lapses if self.lease else 0

    def ask(self, make: Callable[[int], Wish]) -> control.Lease | control.Problem | None:
        """Ask something of the lease; the answer."""
        answer = self._hub.leasing.wish(self._seat, make(1), self.now())
        self._changed()
        return answer

    def let_acquire(self, session: str) -> None:
        """Let another session have the lease, where nobody has it and it may.

        Args:
            session: Its name, which nobody else knows.
        """
        self._hub.let_acquire(session, now=self.now())
        self._changed()

    def execute(self, command: Command | None) -> Receipt | Refusal:
        """Let the robot carry out a command, or take back the newest where it's None; or say why not.

        Raises:
            VrsError: If the command isn't one that may be ordered.
        """
        servlet, t = self._seat.servlet, self._hub.engine_time(self.now())
        order = Order(self._number + 1, command, self.lease.epoch)
        self._number = order.number
        servlet.receive(order, now=t)
        outcomes = (reply for reply in servlet.advance(now=t) if isinstance(reply, Outcome))
        outcome = next(reply for reply in outcomes if reply.number == order.number)
        self._changed()
        return outcome.receipt or Refusal(outcome.refusal, outcome.code)
