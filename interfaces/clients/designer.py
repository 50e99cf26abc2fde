"""The Designer: issues commands to an engine, here or elsewhere, and keeps what became of them; and the Supervisor.

Source: Doulgeri, Zikos, Delopoulos, section III.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from typing_extensions import override

from interfaces.clients.observer import Observation, Observer
from interfaces.clients.ports import Asking, RemotePort, port_to
from interfaces.engine_server.site import earliest
from interfaces.messages import Order, Outcome, RefusalCode, Reply
from vrs.checks import finite
from vrs.commands import Command, DriveCommand, MotionCommand, PlanEdit, PositionQuery, SteerCommand, Stop
from vrs.engine import Engine
from vrs.errors import InvalidValueError, UnknownCommandError
from vrs.ledger import Receipt, Status

PENDING = 200
"""Commands that may be without an answer; a stop may be beyond them."""


@dataclass(frozen=True, slots=True, eq=False)
class Issued:
    """A command that was issued, and what became of it."""

    number: int
    """Counts the commands that went through its port, from 1."""
    command: Command | None
    """As it was sent, stamps included; None for taking back the newest."""
    issued_at: float
    """When it was issued [s], by the user's clock."""
    answered_at: float | None = None
    """When the first answer came [s], by the user's clock; None while it's pending."""
    receipt: Receipt | None = None
    """Its receipt, in the engine's time, as later commands left it."""
    refusal: str = ""
    """Why it couldn't be taken at all."""
    revision: int = -1
    """Which state of the receipt it is, from 0; −1 while it's pending."""
    code: RefusalCode = RefusalCode.OTHER
    """Why it was refused or rejected, where that's decided by."""

    @property
    def is_pending(self) -> bool:
        """Whether nothing was heard of it yet."""
        return self.answered_at is None

    @property
    def reason(self) -> str:
        """Why nothing came of it; empty where something did, or may yet."""
        if self.receipt is not None and self.receipt.status is Status.REJECTED:
            return self.receipt.reason
        return self.refusal

    @property
    def late(self) -> float:
        """How much later than asked it is carried out [s]; 0 where it's in time, or not carried out."""
        receipt = self.receipt
        if receipt is None or receipt.asked_at is None or receipt.execute_at is None:
            return 0.0
        return max(receipt.execute_at - receipt.asked_at, 0.0)


class Designer(Asking[Order, Issued]):
    """Issues motion commands, steering inputs and edits of the plan.

    Over a link, a command is sent again until it's answered; the servlet carries it out once.
    """

    def __init__(self, engine: RemotePort | Engine, *, resend: float = 0.3, repeat: int = 2) -> None:
        """Reach an engine.

        Args:
            engine: A port, or an engine in this process.
            resend: After how long without an answer a command is sent again [s], at first; longer and longer then.
            repeat: How many of the newest commands without an answer are sent again with each new one, 0 to 10: the
                servlet keeps to the order, and a steering input that waits for a lost one comes too late.
        """
        self._repeat = int(finite("repeat", repeat, "0 to 10"))
        if not 0 <= self._repeat <= 10:
            raise InvalidValueError("repeat", repeat, "0 to 10")
        super().__init__(engine, resend)
        self._number = 0

    def issue(self, command: Command, *, now: float, execute_in: float | None = None) -> Issued:
        """Issue a command.

        Args:
            command: What to do. Its `issued_at` is stamped where it's None; a given stamp is left as it is. Times
                are meant in the engine's time, which is the user's timeline shifted by D.
            now: The user's time [s].
            execute_in: When to carry it out, counted from now [s], for a command without `execute_at`.

        Returns:
            What is known of it: from an engine in this process, its receipt.

        Raises:
            InvalidValueError: If it's a position query, has both times, or too many others are without an answer.
        """
        if isinstance(command, PositionQuery):
            raise InvalidValueError("command", command, "one that changes something; an Observer asks")
        if len(self._open) >= PENDING and not isinstance(command, Stop):
            raise InvalidValueError("command", command, f"issued when fewer than {PENDING} have no answer")
        now = finite("now", now, "finite seconds")
        if isinstance(command, (MotionCommand, SteerCommand, DriveCommand, PlanEdit)):
            if execute_in is not None:
                if command.execute_at is not None:
                    raise InvalidValueError("execute_in", execute_in, "left out where execute_at is given")
                command = replace(command, execute_at=now + finite("execute_in", execute_in, "finite seconds"))
            if command.issued_at is None:
                command = replace(command, issued_at=now)
        elif execute_in is not None:
            raise InvalidValueError("execute_in", execute_in, "left out for a command that has no time")
        return self._send(command, now)

    def undo(self, *, now: float) -> Issued:
        """Take back the engine's newest accepted command; see `Engine.undo`."""
        return self._send(None, finite("now", now, "finite seconds"))

    def _send(self, command: Command | None, now: float) -> Issued:
        number = self._number = self._port.order_number()
        self._keep(number, Issued(number, command, now), news=False)
        order = Order(number, command)
        again = self._open.newest(self._repeat)
        self._open.add(number, order, now)
        for message in (*again, order):
            self._port.send(message, now=now)
        return self._kept[number]

    @override
    def receive(self, message: Reply, *, now: float) -> None:
        """Take an answer; an old one that comes after a newer is passed over."""
        if not isinstance(message, Outcome) or message.number not in self._kept:
            return
        self._open.drop(message.number)
        known = self._kept[message.number]
        if message.revision <= known.revision:
            return
        known = replace(
            known,
            answered_at=now if known.answered_at is None else known.answered_at,
            receipt=message.receipt,
            refusal=message.refusal,
            revision=message.revision,
            code=message.code,
        )
        self._keep(message.number, known)

    def issued(self, number: int) -> Issued:
        """What is known of a command.

        Raises:
            UnknownCommandError: If no command of that number is kept.
        """
        try:
            return self._kept[number]
        except KeyError:
            raise UnknownCommandError(number, self._number) from None

    @property
    def history(self) -> tuple[Issued, ...]:
        """The newest 4096 commands, oldest first."""
        return tuple(self._kept.values())

    @property
    def pending(self) -> tuple[Issued, ...]:
        """The commands without an answer, oldest first."""
        return tuple(self._kept[number] for number in self._open.numbers() if number in self._kept)


class Supervisor:
    """A Designer and an Observer of one engine: specifies the trajectory, and collects feedback."""

    def __init__(self, engine: RemotePort | Engine, *, resend: float = 0.3) -> None:
        """Reach an engine by one port; see `Designer` and `Observer`."""
        port, self._own = port_to(engine)
        self.designer = Designer(port, resend=resend)
        self.observer = Observer(port, resend=resend)

    def issue(self, command: Command, *, now: float, execute_in: float | None = None) -> Issued:
        """Issue a command; see `Designer.issue`."""
        return self.designer.issue(command, now=now, execute_in=execute_in)

    def undo(self, *, now: float) -> Issued:
        """Take back the newest accepted command; see `Designer.undo`."""
        return self.designer.undo(now=now)

    def ask(self, t: float | None = None, *, now: float) -> int:
        """Ask for the position; see `Observer.ask`."""
        return self.observer.ask(t, now=now)

    def observation(self, number: int) -> Observation | None:
        """The answer to a question; see `Observer.observation`."""
        return self.observer.observation(number)

    def advance(self, *, now: float) -> tuple[Issued | Observation, ...]:
        """Do what is due; what was heard of commands, then the answers."""
        if self._own is not None:
            self._own.advance(now=now)
        return (*self.designer.advance(now=now), *self.observer.advance(now=now))

    def next_deadline(self) -> float | None:
        """When something is to be done [s]; None for nothing."""
        own = None if self._own is None else self._own.next_deadline()
        return earliest(self.designer.next_deadline(), self.observer.next_deadline(), own)
