"""Who commands: the right to command the robot, and the one of a controller's terminals that is in control."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np
from typing_extensions import override

from interfaces.clients.designer import Issued
from interfaces.messages.control import (
    Acquire,
    Corrected,
    Lease,
    PathCorrection,
    Problem,
    ProblemCode,
    Release,
    Resume,
    Share,
)
from interfaces.val2.context import Event
from interfaces.val2.controller import Controller
from interfaces.val2.errors import TAKEN, ValError, robot_halted
from interfaces.val2.motion.places import in_millimetres
from robots.onboard.lease import LeaseState
from vrs.model import Array
from vrs.scheduler import FRESH

if TYPE_CHECKING:
    from interfaces.stream.connection import Connection
    from interfaces.stream.local import LocalClient


class ControlState(Enum):
    """What came of a request for control that wasn't refused."""

    PENDING = "pending"
    """Nothing is known yet."""
    HELD = "held"
    """Control is there."""


ControlAnswer: TypeAlias = ControlState | str
"""The state of a request for control, or why it was refused."""


class Control:
    """The right to command the robot: here over what nobody else can reach."""

    fault_poll_interval = math.inf
    """How often it's to be asked for trouble [s]; infinity for never."""

    def request(self, session: str | None = None, *, now: float) -> ControlAnswer:  # noqa: ARG002
        """Ask for it, if it isn't there.

        Args:
            session: Of the server's, whose right it's to be; None for the controller's own.
            now: Session time [s].
        """
        return ControlState.HELD

    def regain(self) -> None:
        """Take up again what is there without asking for more, after it ended."""

    @property
    def held(self) -> bool:
        """Whether it's there."""
        return True

    def pop_lapse(self) -> str:
        """Why it has ended since this was asked last; empty where it hasn't."""
        return ""

    def release(self) -> None:
        """Give it back; the robot stops."""

    def resume(self, *, now: float) -> None:
        """Let a robot go on that stopped by itself."""

    def fault(self, *, now: float) -> ValError | None:  # noqa: ARG002
        """What is wrong with the robot or the way to it; None where nothing is."""
        return None

    correction_poll_interval = math.inf
    """How often it's to be asked for corrections while a program alters its path [s], else `_SELDOM` times that;
    infinity for never."""

    def take_corrections(self) -> Sequence[PathCorrection]:
        """What others have asked of the path of a program since this was called last."""
        return ()

    def answer_correction(self, answer: Corrected | Problem) -> None:
        """Tell who asked what came of one of them."""


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
        self._corrections: dict[int, int] = {}
        """Corrections that are to be answered: numbers of what the arm was asked for, by theirs."""
        self._now = -math.inf

    def request(self, terminal: Listener, session: str | None = None, *, now: float) -> ControlAnswer:
        """Ask for control for a terminal.

        Args:
            terminal: Who asks.
            session: By which the person there commands from elsewhere, too, and whose right it's to be; None for
                the controller's own.
            now: Session time [s].
        """
        self._notice(now)
        if self.holder is not None and self.holder is not terminal:
            if self.control.held:
                return "another terminal is in control"
            if self._runs:
                self.controller.abort_all(now=now)
                self._tell(now)
            self.holder = None
        answer = self.control.request(session, now=now)
        if answer is ControlState.HELD:
            self.holder = terminal
        return answer

    @property
    def _runs(self) -> bool:
        return self.controller.busy or self.controller.doing

    def _notice(self, now: float) -> None:
        """End what runs if control has ended since this was called last, though it may be there again.

        What the program asked for ahead is taken out of the plan, by whatever right there still is.
        """
        why = self.control.pop_lapse()
        if why and self._runs:
            self.controller.interrupt(ValError("Motion interrupted", why), now=now)
            self.control.regain()
            if self.control.held:
                self.controller.arm.withdraw(now=now)

    def leave(self, terminal: Listener, *, now: float) -> None:
        """A terminal is gone: what it ran is stopped."""
        if self.holder is terminal:
            self.holder = None
            if self._runs:
                self.controller.abort_all(now=now)
            self.control.release()

    def advance(self, *, now: float) -> None:
        """Do what is due, and tell the terminal in control."""
        self._now = now
        self._notice(now)
        self._correct(now)
        self._tell(now)

    def correct(self, channel: int, offset: Array, at: float, *, now: float) -> Issued | None:
        """Correct the path of the program that alters it on a channel; see `interfaces.stream.hub.PathAlterer`.

        Returns:
            What came of it; None while nothing was heard.

        Raises:
            ValError: If none does, or it can't be.
        """
        arm = self.controller.arm
        if not arm.altering(channel, now=now):
            raise ValError("Path isn't altered", f"no program has ALTER on for channel {channel}")
        if abs(at - now) > FRESH:
            raise ValError("Illegal value", f"a correction is for now, within {FRESH:g} s")
        values = (*(1000.0 * offset[:3]).tolist(), *np.degrees(offset[3:]).tolist())
        return arm.correct(values, given=at, now=now)

    def _correct(self, now: float) -> None:
        """Correct the path as others want, and answer what has been answered."""
        robot = self.controller.arm.robot
        for wish in self.control.take_corrections():
            before = robot.newest
            try:
                self.correct(wish.channel, wish.offset, now if wish.at is None else wish.at, now=now)
                if robot.newest == before:
                    raise ValError("Path can't be altered so", "it's a dry run")
            except ValError as error:
                self.control.answer_correction(Problem(ProblemCode.OUT_OF_RANGE, str(error), wish.number))
            else:
                self._corrections[wish.number] = robot.newest
        for number, asked in tuple(self._corrections.items()):
            outcome = robot.outcome(asked, now=now)
            if outcome is None:
                continue
            del self._corrections[number]
            late = "" if outcome.receipt is None else outcome.receipt.hindrance
            refused = str(ValError("Path can't be altered so", in_millimetres(outcome.reason)))
            self.control.answer_correction(
                Problem(ProblemCode.OUT_OF_RANGE, refused, number) if outcome.reason else Corrected(number, late)
            )

    def _tell(self, now: float) -> None:
        for event in self.controller.advance(now=now):
            if self.holder is not None:
                self.holder(event)

    def next_deadline(self) -> float:
        """When something is due [s]; infinity for never."""
        altered = bool(self._corrections) or self.controller.arm.altered_since(now=self._now) is not None
        polled = self.control.correction_poll_interval * (1.0 if altered else _SELDOM)
        return min(self.controller.next_deadline(), self._now + polled)


_SELDOM: Final = 10.0
"""How much longer a correction may wait that nothing is to be done with."""
LEASE_TIMEOUT: Final = 3.0
"""How long the lease is waited for [s]; the robot comes to rest between two."""
FOLLOW_TIMEOUT: Final = 10.0
"""How long a robot is waited for that doesn't follow a new lease yet [s]."""
_ASK_AGAIN: Final = 0.25
"""Time between two requests [s]."""


class LeaseControl(Control):
    """The lease of a client of a server, kept by that client until it's released."""

    fault_poll_interval = 0.1

    def __init__(self, client: Connection | LocalClient) -> None:
        """Ask for nothing yet.

        Args:
            client: An operator.
        """
        self._client = client
        self._requested_at: float | None = None
        self._polled_at = 0.0
        self._granted: float | None = None
        """When a lease was first seen to be held [s]."""
        self._given_back = -1
        """Of which of the lapses the server is to tell, since it was given back; -1 for none."""
        self._lapses = client.lapses
        self._resumed = self._resume_until = -math.inf

    @override
    def request(self, session: str | None = None, *, now: float) -> ControlAnswer:
        lease = self._observe_lease(now)
        answer: ControlAnswer
        if not self._client.is_connected:
            answer = "there's no connection to the robot's server"
        elif self._has(session, lease):
            answer = self._followed(now)
        elif lease is not None and lease.state is LeaseState.HELD and not self._release_pending:
            answer = f"{lease.holder} has control"
        else:
            answer = self._acquired(session, now)
        if answer is not ControlState.PENDING:
            self._requested_at = None
        return answer

    def _observe_lease(self, now: float) -> Lease | None:
        """The lease as it was last heard of."""
        lease = self._client.lease
        if lease is None or lease.state is not LeaseState.HELD:
            self._granted = None
        elif self._granted is None:
            self._granted = now
        return lease

    def _has(self, session: str | None, lease: Lease | None) -> bool:
        """Whether the lease is there that was asked for."""
        if session is not None or lease is None:
            return False
        return lease.yours and lease.commands and not self._release_pending

    def _followed(self, now: float) -> ControlState:
        """Wait until the robot follows this lease; one that doesn't in time says why to those who command it."""
        assert self._granted is not None
        state = self._client.state
        follows = state is not None and state.connected and not state.halted
        return ControlState.HELD if follows or now >= self._granted + FOLLOW_TIMEOUT else ControlState.PENDING

    def _acquired(self, session: str | None, now: float) -> ControlAnswer:
        """Ask for a lease now and then, but not for ever."""
        if self._requested_at is None or now < self._requested_at:
            self._requested_at, self._polled_at = now, now - _ASK_AGAIN
        if now >= self._requested_at + LEASE_TIMEOUT:
            why = "the robot isn't at rest yet" if session is None else "control wasn't given"
            return f"{why}: try again"
        if now >= self._polled_at + _ASK_AGAIN:
            self._polled_at = now
            self._acquire(session)
        return ControlState.PENDING

    def _acquire(self, session: str | None) -> None:
        if session is None:
            self._client.ask(Acquire)

    @property
    def _release_pending(self) -> bool:
        """Whether it was given back, and the server hasn't said so yet."""
        return self._client.lapses == self._given_back

    @property
    @override
    def held(self) -> bool:
        lease = self._client.lease
        return not self._client.is_connected or (lease is not None and lease.commands and not self._release_pending)

    @override
    def pop_lapse(self) -> str:
        lease, lapses = self._client.lease, self._client.lapses
        if lapses == self._lapses:
            return ""
        self._lapses = lapses
        return TAKEN if lease is not None and lease.state is LeaseState.HELD else "control has ended"

    @override
    def release(self) -> None:
        lease = self._client.lease
        if lease is not None and lease.commands and (epoch := lease.epoch) is not None:
            self._given_back = self._client.lapses
            self._client.ask(lambda number: Release(number, epoch))

    @override
    def resume(self, *, now: float) -> None:
        """Let a robot go on that stopped by itself, as soon as it can within a while."""
        self._resumed, self._resume_until = -math.inf, now + LEASE_TIMEOUT
        self.fault(now=now)

    @override
    def fault(self, *, now: float) -> ValError | None:
        state, lease = self._client.state, self._observe_lease(now)
        if not self._client.is_connected:
            return ValError("No connection", "to the robot's server; it's taken up again by itself")
        if state is None or not state.halted:
            self._resume_until = -math.inf
            return None
        epoch = lease.epoch if lease is not None and lease.commands else None
        if epoch is not None and self._resumed + _ASK_AGAIN <= now < self._resume_until:
            self._resumed = now
            self._client.ask(lambda number: Resume(number, epoch))
        return robot_halted(state.halted, commanded=epoch is not None)


class RemoteControl(LeaseControl):
    """The same of a client elsewhere, to whose programs others send corrections by the server."""

    correction_poll_interval = 0.01

    def __init__(self, connection: Connection) -> None:
        """Ask for nothing yet.

        Args:
            connection: With `alters`.
        """
        super().__init__(connection)
        self._connection = connection

    @override
    def take_corrections(self) -> Sequence[PathCorrection]:
        return self._connection.take_corrections()

    @override
    def answer_correction(self, answer: Corrected | Problem) -> None:
        self._connection.answer_correction(answer)


class ServedControl(LeaseControl):
    """The same of a client in the server's process: it shares the lease of a page whose person is at a terminal."""

    def __init__(self, client: LocalClient) -> None:
        """Ask for nothing yet."""
        super().__init__(client)
        self._local = client
        self._lender: str | None = None
        """Whose lease is shared; None where it's the client's own."""

    @override
    def regain(self) -> None:
        if self._lender is not None:
            self._share(self._lender)

    def _share(self, session: str) -> bool:
        shared = isinstance(self._local.ask(lambda number: Share(number, session)), Lease)
        self._lender = session if shared else self._lender
        return shared

    @override
    def _has(self, session: str | None, lease: Lease | None) -> bool:
        if session is None:
            self._lender = None
            return super()._has(session, lease)
        shares = lease is not None and lease.shared and session == self._lender
        return shares or self._share(session)

    @override
    def _acquire(self, session: str | None) -> None:
        super()._acquire(session)
        if session is not None:
            self._local.let_acquire(session)
