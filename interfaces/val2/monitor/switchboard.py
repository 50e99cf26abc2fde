"""One controller, and the terminals that are at it: one of them is in control, the others look."""

from __future__ import annotations

import math
from typing import Protocol

from interfaces.val2.controller import Controller
from interfaces.val2.errors import ValError
from interfaces.val2.events import Event


class Control(Protocol):
    """The right to command the robot, as its site gives it."""

    def wanted(self, *, now: float) -> str | None:
        """Ask for it, if it isn't there: empty if it is, why not, or None while nothing is known yet."""

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

    def wanted(self, *, now: float) -> str | None:  # noqa: ARG002 - it's always there
        """It's there."""
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


class Terminal(Protocol):
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
        self.holder: Terminal | None = None
        """The terminal in control."""

    def wanted(self, terminal: Terminal, *, now: float) -> str | None:
        """Ask for control for a terminal: empty if it's in control, why not, or None if that isn't known yet."""
        if self.holder is not None and self.holder is not terminal:
            return "another terminal is in control"
        answer = self._control.wanted(now=now)
        if answer == "":
            self.holder = terminal
        return answer

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

    def leave(self, terminal: Terminal, *, now: float) -> None:
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
        for event in self.controller.advance(now=now):
            if self.holder is not None:
                self.holder.take(event)

    def next_deadline(self) -> float:
        """When something is due [s]; infinity for never."""
        deadline = self.controller.next_deadline()
        return math.inf if deadline is None else deadline
