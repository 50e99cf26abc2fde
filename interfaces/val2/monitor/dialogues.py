"""What takes lines in place of commands: confirmation, changes to a location, recording, WHERE over and over."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from interfaces.val2.errors import ValError
from interfaces.val2.geometry import from_oat
from interfaces.val2.monitor import layout
from interfaces.val2.monitor.desk import Dialogue, TerminalState
from interfaces.val2.monitor.text import pieces
from interfaces.val2.values import Location, PrecisionPoint

AGAIN: Final = 0.5
"""Time between two lines of `WHERE 1` [s]."""


class Confirm:
    """Asks before something is destroyed: Y does it, all else doesn't."""

    def __init__(self, question: str, act: Callable[[float], None]) -> None:
        """Ask.

        Args:
            question: What would happen.
            act: Does it, at session time [s].
        """
        self.prompt = f"{question} (Y/N)? "
        self._act = act

    def line(self, text: str, *, now: float) -> Dialogue | None:
        """Take the answer."""
        if text.strip().upper() in {"Y", "YES"}:
            self._act(now)
        return None

    def leave(self, *, now: float, kept: bool) -> None:
        """Nothing has happened."""


class ChangeDialogue:
    """Shows a location's six numbers and asks for changes to them, until there are none."""

    prompt = "Change? "

    def __init__(self, desk: TerminalState, value: Location, keep: Callable[[Location], None]) -> None:
        """Show the value.

        Args:
            desk: Where it's shown.
            value: To begin with.
            keep: Takes the value in the end.
        """
        self._desk, self._value, self._keep = desk, value, keep
        desk.say(layout.heading(), layout.row(value))

    def line(self, text: str, *, now: float) -> Dialogue | None:  # noqa: ARG002 - nothing here takes time
        """Take changes, such as `,,10`; an empty line accepts.

        Raises:
            ValError: If they aren't at most six numbers.
        """
        if not text.strip():
            self._keep(self._value)
            return None
        self._value = changed(self._value, text)
        self._desk.say(layout.row(self._value))
        return self

    def leave(self, *, now: float, kept: bool) -> None:  # noqa: ARG002 - nothing here takes time
        """The value is kept as it is, or not at all."""
        if kept:
            self._keep(self._value)


def changed(value: Location, text: str) -> Location:
    """A location with some of its six numbers replaced.

    Args:
        value: The location.
        text: Numbers and nothings between commas.

    Raises:
        ValError: If there are others, or more than six.
    """
    given = pieces(text)
    if len(given) > 6:
        raise ValError("Invalid argument", f"{text.strip()}: at most six numbers between commas")
    numbers = list(layout.six(value))
    for index, piece in enumerate(given):
        if piece:
            numbers[index] = _number(piece)
    if isinstance(value, PrecisionPoint):
        return PrecisionPoint(tuple(numbers))
    x, y, z, o, a, t = numbers
    return from_oat(x, y, z, o, a, t)


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) < 1e9:
        raise ValError("Invalid argument", f"{text}: a number is wanted")
    return value


class WatchDialogue:
    """WHERE 1: shows where the arm is, again and again, until a line comes."""

    prompt = ""

    def __init__(self, desk: TerminalState, *, now: float) -> None:
        """Show it for the first time."""
        self._desk = desk
        desk.say(layout.where(desk.controller.arm.here(now=now))[0])
        self.due = now
        self._shown = ""

    def advance(self, *, now: float) -> None:
        """Show it when it's due, and not what it was already."""
        if now < self.due:
            return
        self.due = now + AGAIN
        _, tool, joints = layout.where(self._desk.controller.arm.here(now=now))
        if tool + joints != self._shown:
            self._shown = tool + joints
            self._desk.say(tool, joints)

    def line(self, text: str, *, now: float) -> Dialogue | None:  # noqa: ARG002 - whatever it is
        """It ends."""
        return None

    def leave(self, *, now: float, kept: bool) -> None:
        """It ends."""
