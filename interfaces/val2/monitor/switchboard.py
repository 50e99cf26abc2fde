"""One controller, and the terminals that are at it: one of them is in control, the others look."""

from __future__ import annotations

import math
from typing import Final, Protocol

from interfaces.val2.controller import Controller
from interfaces.val2.errors import ValError
from interfaces.val2.events import Event

_AGAIN: Final = 0.02
"""Time between two looks whether control is there again [s]."""


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


class Control(Protocol):
    """The right to command the robot, as its site gives it."""

    def wanted(self, person: SharedOperator | None = None, *, now: float) -> str | None:
        """Ask for it, if it isn't there: empty if it is, why not, or None while nothing is known yet.

        Args:
            person: Whose right it's to be; None for the controller's own.
            now: Session time [s].
        """

    @property
    def kept(self) -> bool:
        """Whether it's there."""

    def lapsed(self) -> str:
        """Why it has ended since this was asked last; empty where it hasn't."""

    def release(self, *, now: float) -> None:
        """Give it back; the robot stops."""

    def resume(self, *, now: float) -> None:
        """Let a robot go on that stopped by itself."""

    def trouble(self, *, now: float) -> ValError | None:
        """What is wrong with the robot or the way to it; None where nothing is."""

    @property
    def looks(self) -> float:
        """How often it's to be asked for trouble [s]; infinity for never."""


class Free:
    """Control over what nobody else can reach."""

    kept = True
    """It's there."""

    def wanted(self, person: SharedOperator | None = None, *, now: float) -> str | None:  # noqa: ARG002 - it's always there
        """It's there."""
        return ""

    def lapsed(self) -> str:
        """It hasn't."""
        return ""

    def release(self, *, now: float) -> None:
        """It stays."""

    def resume(self, *, now: float) -> None:
        """It doesn't stop by itself."""

    def trouble(self, *, now: float) -> ValError | None:  # noqa: ARG002 - there's never any
        """Nothing."""
        return None

    @property
    def looks(self) -> float:
        """Never."""
        return math.inf


class TerminalListener(Protocol):
    """What is told of what happens."""

    def take(self, event: Event) -> None:
        """Take an event of the controller."""


class Switchboard:
    """Who is in control, and who is told of events."""

    def __init__(self, controller: Controller, control: Control) -> None:
        """Begin with nobody.

        Args:
            controller: What programs run on.
            control: The right to command the robot.
        """
        self.controller, self._control = controller, control
        self.holder: TerminalListener | None = None
        """The terminal in control."""
        self._person: SharedOperator | None = None
        """Who sits there."""
        self._withdraws: float | None = None
        """When to see next whether what a program asked for ahead can be taken back [s]; None where nothing is."""

    def wanted(self, terminal: TerminalListener, person: SharedOperator | None = None, *, now: float) -> str | None:
        """Ask for control for a terminal: empty if it's in control, why not, or None if that isn't known yet.

        Args:
            terminal: Who asks.
            person: Who sits there, where they command by a session of their own, too.
            now: Session time [s].
        """
        self._notice(now)
        if self.holder is not None and self.holder is not terminal:
            if self._control.kept:
                return "another terminal is in control"
            self._dismiss(now)
        answer = self._control.wanted(person, now=now)
        if answer == "":
            self.holder, self._person = terminal, person
        return answer

    def _dismiss(self, now: float) -> None:
        """Let the terminal go that has lost control; what it ran ends."""
        if self.controller.running or self.controller.doing:
            self.controller.abort(now=now)
            self._tell(now)
        self.holder = None

    def _notice(self, now: float) -> None:
        """End what runs if control has ended since this was called last, though it may be there again."""
        why = self._control.lapsed()
        if why and (self.controller.running or self.controller.doing):
            self.controller.interrupt(ValError("Motion interrupted", why), now=now)
            self._withdraws = now
        if self._withdraws is not None and now >= self._withdraws:
            self._withdraws = now + _AGAIN if self._withdraw(now) else None

    def _withdraw(self, now: float) -> bool:
        """Take out of the plan what was asked for ahead; whether it's to be tried again."""
        person = self._person
        answer = "" if person is None or not person.holds else self._control.wanted(person, now=now)
        if answer == "" and self._control.kept:
            self.controller.arm.withdraw(now=now)
        return answer is None

    def resume(self, *, now: float) -> None:
        """Let a robot go on that stopped by itself."""
        self._control.resume(now=now)

    def trouble(self, *, now: float) -> ValError | None:
        """What is wrong with the robot or the way to it; None where nothing is."""
        return self._control.trouble(now=now)

    @property
    def looks(self) -> float:
        """How often it's to be asked for trouble [s]."""
        return self._control.looks

    def leave(self, terminal: TerminalListener, *, now: float) -> None:
        """A terminal is gone: what it ran is stopped."""
        if self.holder is not terminal:
            return
        self.holder = None
        controller = self.controller
        if controller.running or controller.doing:
            controller.abort(now=now)
        self._control.release(now=now)

    def advance(self, *, now: float) -> None:
        """Do what is due, and tell the terminal in control."""
        self._notice(now)
        self._tell(now)

    def _tell(self, now: float) -> None:
        for event in self.controller.advance(now=now):
            if self.holder is not None:
                self.holder.take(event)

    def next_deadline(self) -> float:
        """When something is due [s]; infinity for never."""
        return min(self.controller.next_deadline(), math.inf if self._withdraws is None else self._withdraws)
