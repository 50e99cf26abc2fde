"""Who commands: the right to command the robot, and the one of a controller's terminals that is in control."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from functools import partial
from typing import TYPE_CHECKING, Final, Protocol, TypeAlias

from typing_extensions import override

from interfaces.messages.control import Lease, Problem
from interfaces.val2.context import Event
from interfaces.val2.controller import Controller
from interfaces.val2.errors import TAKEN, ValError, robot_halted
from robots.onboard.lease import LeaseState

if TYPE_CHECKING:
    from interfaces.stream.connection import Connection

_AGAIN: Final = 0.02
"""Time between two looks whether control is there again [s]."""


class ControlState(Enum):
    """What came of a request for control that wasn't refused."""

    PENDING = "pending"
    """Nothing is known yet."""
    HELD = "held"
    """Control is there."""


ControlAnswer: TypeAlias = ControlState | str
"""The state of a request for control, or why it was refused."""


class SharedOperator(Protocol):
    """Who commands the robot by a session of its own, too, and shares with the controller what it has."""

    @property
    def session(self) -> str:
        """Names that session; empty while there's none."""

    @property
    def holds(self) -> bool:
        """Whether that session says that it has the right to command."""

    def take(self) -> None:
        """Let that session ask for it."""


class Control:
    """The right to command the robot: here over what nobody else can reach."""

    fault_poll_interval = math.inf
    """How often it's to be asked for trouble [s]; infinity for never."""

    def request(self, person: SharedOperator | None = None, *, now: float) -> ControlAnswer:  # noqa: ARG002
        """Ask for it, if it isn't there.

        Args:
            person: Whose right it's to be; None for the controller's own.
            now: Session time [s].
        """
        return ControlState.HELD

    @property
    def held(self) -> bool:
        """Whether it's there."""
        return True

    def pop_lapse(self) -> str:
        """Why it has ended since this was asked last; empty where it hasn't."""
        return ""

    def release(self, *, now: float) -> None:
        """Give it back; the robot stops."""

    def resume(self, *, now: float) -> None:
        """Let a robot go on that stopped by itself."""

    def fault(self, *, now: float) -> ValError | None:  # noqa: ARG002
        """What is wrong with the robot or the way to it; None where nothing is."""
        return None


Listener: TypeAlias = Callable[[Event], None]
"""A terminal, as what takes the events of the controller when it's in control."""


class SharedController:
    """Who is in control, and who is told of events."""

    def __init__(self, controller: Controller, control: Control) -> None:
        """Begin with nobody.

        Args:
            controller: What programs run on.
            control: The right to command the robot.
        """
        self.controller, self.control = controller, control
        self.holder: Listener | None = None
        """The terminal in control."""
        self._person: SharedOperator | None = None
        """Who sits there."""
        self._withdraws = math.inf
        """When to see next whether what a program asked for ahead can be taken back [s]; infinity for never."""

    def request(self, terminal: Listener, person: SharedOperator | None = None, *, now: float) -> ControlAnswer:
        """Ask for control for a terminal.

        Args:
            terminal: Who asks.
            person: Who sits there, where they command by a session of their own, too.
            now: Session time [s].
        """
        self._notice(now)
        if self.holder is not None and self.holder is not terminal:
            if self.control.held:
                return "another terminal is in control"
            if self._runs:
                self.controller.abort(now=now)
                self._tell(now)
            self.holder = None
        answer = self.control.request(person, now=now)
        if answer is ControlState.HELD:
            self.holder, self._person = terminal, person
        return answer

    @property
    def _runs(self) -> bool:
        return self.controller.running or self.controller.doing

    def _notice(self, now: float) -> None:
        """End what runs if control has ended since this was called last, though it may be there again."""
        why = self.control.pop_lapse()
        if why and self._runs:
            self.controller.interrupt(ValError("Motion interrupted", why), now=now)
            self._withdraws = now
        if now >= self._withdraws:
            self._withdraws = now + _AGAIN if self._withdraw(now) else math.inf

    def _withdraw(self, now: float) -> bool:
        """Take out of the plan what was asked for ahead; whether it's to be tried again."""
        person = self._person
        answer: ControlAnswer = ControlState.HELD
        if person is not None and person.holds:
            answer = self.control.request(person, now=now)
        if answer is ControlState.HELD and self.control.held:
            self.controller.arm.withdraw(now=now)
        return answer is ControlState.PENDING

    def leave(self, terminal: Listener, *, now: float) -> None:
        """A terminal is gone: what it ran is stopped."""
        if self.holder is terminal:
            self.holder = None
            if self._runs:
                self.controller.abort(now=now)
            self.control.release(now=now)

    def advance(self, *, now: float) -> None:
        """Do what is due, and tell the terminal in control."""
        self._notice(now)
        self._tell(now)

    def _tell(self, now: float) -> None:
        for event in self.controller.advance(now=now):
            if self.holder is not None:
                self.holder(event)

    def next_deadline(self) -> float:
        """When something is due [s]; infinity for never."""
        return min(self.controller.next_deadline(), self._withdraws)


LEASE_TIMEOUT: Final = 3.0
"""How long the lease is waited for [s]; the robot comes to rest between two."""
FOLLOW_TIMEOUT: Final = 10.0
"""How long a robot is waited for that doesn't follow a new lease yet [s]."""
_TAKE_GRACE: Final = 1.0
"""So long after a person's session was to take control it may be that it has it, and hasn't said so [s]."""
_ASK_AGAIN: Final = 0.25
"""Time between two requests [s]."""
_FAULT_POLL: Final = 0.1
"""Time between two looks at how the robot is [s]."""


class LeaseControl(Control):
    """The lease of a connection, kept by the connection until it's released; or the share of a person's lease."""

    fault_poll_interval = _FAULT_POLL

    def __init__(self, connection: Connection) -> None:
        """Ask for nothing yet.

        Args:
            connection: Of an operator.
        """
        self._connection = connection
        self._requested_at: float | None = None
        self._polled_at = 0.0
        self._granted: float | None = None
        """When a lease was first seen to be held [s]."""
        self._share: tuple[str, int] = "", 0
        """Whose lease is shared, or was asked for, and the number of what was asked; 0 once it's answered."""
        self._given_back = -1
        """Of which of the lapses the server is to tell, since it was given back; -1 for none."""
        self._lapses = connection.lapses
        self._resumed = self._resume_until = -math.inf

    @override
    def request(self, person: SharedOperator | None = None, *, now: float) -> ControlAnswer:
        """Ask for the lease.

        Args:
            person: Whose lease is to be shared; None for one of the connection's own.
            now: Session time [s].
        """
        lease = self._observe_lease(now)
        answer: ControlAnswer = "there's no connection to the robot's server"
        if self._connection.is_connected:
            answer = self._request_own(lease, now) if person is None else self._request_share(person, lease, now)
        if answer is not ControlState.PENDING:
            self._requested_at = None
        return answer

    def _observe_lease(self, now: float) -> Lease | None:
        """The lease as it was last heard of."""
        lease = self._connection.lease
        if lease is None or lease.state is not LeaseState.HELD:
            self._granted = None
        elif self._granted is None:
            self._granted = now
        return lease

    def _request_own(self, lease: Lease | None, now: float) -> ControlAnswer:
        if lease is not None and lease.state is LeaseState.HELD and not self._release_pending:
            return self._followed(now) if lease.yours else f"{lease.holder} has control"
        ask = partial(self._connection.acquire, wait=0.0)
        return self._poll(now, ask, "the robot isn't at rest yet: try again")

    def _request_share(self, person: SharedOperator, lease: Lease | None, now: float) -> ControlAnswer:
        """A share of the lease of a person's session, which is to take one if it has none."""
        mine = lease is not None and lease.shared and lease.commands and not self._release_pending
        if mine and self._share[0] == person.session:
            return self._followed(now)
        if not person.holds:
            asked = self._requested_at is not None and self._requested_at <= now < self._requested_at + _TAKE_GRACE
            if lease is not None and lease.state is LeaseState.HELD and not (lease.yours or asked):
                return f"{lease.holder} has control"
            return self._poll(now, person.take, "control wasn't given: try again")
        session, number = self._share
        if session != person.session or not number:
            self._share = person.session, self._connection.ask_to_share(person.session)
            return ControlState.PENDING
        answer = self._connection.answer(number)
        if answer is not None:
            self._share = session, 0
        return answer.text if isinstance(answer, Problem) else ControlState.PENDING

    def _poll(self, now: float, ask: Callable[[], object], timeout_reason: str) -> ControlAnswer:
        """Ask now and then, but not for ever."""
        if self._requested_at is None or now < self._requested_at:
            self._requested_at, self._polled_at = now, now - _ASK_AGAIN
        if now >= self._requested_at + LEASE_TIMEOUT:
            return timeout_reason
        if now >= self._polled_at + _ASK_AGAIN:
            self._polled_at = now
            ask()
        return ControlState.PENDING

    def _followed(self, now: float) -> ControlState:
        """Wait until the robot follows this lease; one that doesn't in time says why to those who command it."""
        assert self._granted is not None
        state = self._connection.state
        follows = state is not None and state.connected and not state.halted
        return ControlState.HELD if follows or now >= self._granted + FOLLOW_TIMEOUT else ControlState.PENDING

    @property
    def _release_pending(self) -> bool:
        """Whether it was given back, and the server hasn't said so yet."""
        return self._connection.lapses == self._given_back

    @property
    @override
    def held(self) -> bool:
        lease = self._connection.lease
        return not self._connection.is_connected or (
            lease is not None and lease.commands and not self._release_pending
        )

    @override
    def pop_lapse(self) -> str:
        lease, lapses = self._connection.lease, self._connection.lapses
        if lapses == self._lapses:
            return ""
        self._lapses = lapses
        return TAKEN if lease is not None and lease.state is LeaseState.HELD else "control has ended"

    @override
    def release(self, *, now: float) -> None:
        connection = self._connection
        if connection.lease is not None and connection.lease.commands:
            self._given_back = connection.lapses
        connection.release(wait=0.0)

    @override
    def resume(self, *, now: float) -> None:
        """Let a robot go on that stopped by itself, as soon as it can within a while."""
        self._resumed, self._resume_until = -math.inf, now + LEASE_TIMEOUT
        self.fault(now=now)

    @override
    def fault(self, *, now: float) -> ValError | None:
        connection, state, lease = self._connection, self._connection.state, self._observe_lease(now)
        if not connection.is_connected:
            return ValError("No connection", "to the robot's server; it's taken up again by itself")
        if state is None or not state.halted:
            self._resume_until = -math.inf
            return None
        commanded = lease is not None and lease.commands
        if commanded and self._resumed + _ASK_AGAIN <= now < self._resume_until:
            self._resumed = now
            connection.resume(wait=0.0)
        return robot_halted(state.halted, commanded=commanded)
