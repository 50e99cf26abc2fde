"""WHERE, HERE, POINT, TEACH, TOOL, BASE, REWIND: commands on locations, and their dialogues."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from interfaces.val2.errors import ValError
from interfaces.val2.monitor import layout
from interfaces.val2.monitor.state import Dialogue, TerminalState, as_location, halves, nothing, pieces
from interfaces.val2.ports import Where
from interfaces.val2.syntax import Compound, Number, Variable
from interfaces.val2.values import NULL, Location, PrecisionPoint, Transformation, from_oat

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


def where(desk: TerminalState, rest: str, *, now: float) -> Dialogue | None:
    """WHERE, WHERE 1, WHERE REAL."""
    if rest == "1":
        return WatchDialogue(desk, now=now)
    if rest and "REAL".startswith(rest.upper()):
        real = desk.controller.arm.real(now=now)
        if real is None:
            raise ValError("No other twin", "nothing has been heard of a real arm")
        desk.say(*layout.where(real))
    else:
        nothing(rest, "WHERE but 1 or REAL")
        desk.say(*layout.where(desk.controller.arm.here(now=now)))
    return None


def rewind(desk: TerminalState, rest: str, *, now: float) -> None:
    """REWIND t, REWIND -t: where the arm was."""
    t = desk.number(rest, now=now)
    t = now + t if rest.startswith("-") else t
    past = desk.controller.arm.past(t, now=now)
    apart = (
        f"{layout.fixed(now - t, 3)} s ago" if t <= now else f"{layout.fixed(t - now, 3)} s from now, as planned"
    )
    desk.say(f"At {layout.fixed(t, 3)} s, {apart}", *layout.where(past))


def here(desk: TerminalState, rest: str, *, now: float) -> Dialogue:
    """HERE location, HERE #location, HERE a:b."""
    variable, value = _recorded(desk, rest, now=now)
    return ChangeDialogue(desk, value, _keeper(desk, variable))


def _recorded(desk: TerminalState, text: str, *, now: float) -> tuple[Variable, Location]:
    """The variable that a HERE is about, and the arm's location as it takes it."""
    target = desk.expression(text, "a location's name")
    frame = NULL
    if isinstance(target, Compound):
        *before, target = target.parts
        parts = before[0] if len(before) == 1 else Compound(tuple(before))
        frame = _transformation(desk.controller.evaluate(parts, now=now), text)
    if not isinstance(target, Variable):
        raise ValError("Invalid argument", f"{text}: a location's name is wanted")
    _refuse_string(target)
    place: Where = desk.controller.arm.here(now=now)
    if target.prefix == "#":
        if frame is not NULL:
            raise ValError("Invalid argument", f"{text}: a precision point isn't relative to anything")
        return desk.settled(target, now=now), place.joints
    value = place.tool if frame is NULL else frame.inverse() @ place.tool
    return desk.settled(target, now=now), value


def _transformation(value: object, text: str) -> Transformation:
    if not isinstance(value, Transformation):
        raise ValError("Invalid argument", f"{text}: a precision point isn't in a compound")
    return value


def _refuse_string(variable: Variable) -> None:
    if variable.prefix == "$":
        raise ValError("Invalid argument", f"{variable.name}: a location's name is wanted")


def _keeper(desk: TerminalState, variable: Variable) -> Callable[[Location], None]:
    def keep(value: Location) -> None:
        desk.controller.memory.set(variable, value)

    return keep


def point(desk: TerminalState, rest: str, *, now: float) -> Dialogue:
    """POINT location, POINT location = expression."""
    name, expression = halves(rest)
    variable = desk.variable(name, now=now)
    _refuse_string(variable)
    if expression is not None:
        value = as_location(desk.value(expression, now=now), expression)
    else:
        value = _known(desk, variable)
    if (variable.prefix == "#") != isinstance(value, PrecisionPoint):
        kind = "precision point" if variable.prefix else "transformation"
        raise ValError("Invalid argument", f"{expression}: a {kind} is wanted")
    return ChangeDialogue(desk, value, _keeper(desk, variable))


def _known(desk: TerminalState, variable: Variable) -> Location:
    """The value that a location has; of one that has none, NULL or joint values of 0."""
    try:
        return as_location(desk.controller.memory.get(variable), variable.name)
    except ValError as error:
        if not error.what.startswith("Undefined"):
            raise
        return PrecisionPoint((0.0,) * 6) if variable.prefix == "#" else NULL


class Teach:
    """TEACH: records one location after the other; other commands may be given in between."""

    def __init__(self, desk: TerminalState, first: Variable) -> None:
        """Ask for the first."""
        self._desk, self._next = desk, first

    @property
    def prompt(self) -> str:
        """The name of what comes next."""
        return f"{layout.variable(self._next)}? "

    def line(self, text: str, *, now: float) -> Dialogue | None:
        """CR records, E ends."""
        if text.strip().upper() in {"E", "END"}:
            return None
        place = self._desk.controller.arm.here(now=now)
        value: Location = place.joints if self._next.prefix == "#" else place.tool
        self._desk.controller.memory.set(self._next, value)
        self._desk.say(layout.row(value))
        self._next = following(self._next)
        return self

    def leave(self, *, now: float, kept: bool) -> None:
        """What is recorded stays."""

    @staticmethod
    def takes(text: str) -> bool:
        """Whether a line is for it, not a command in between."""
        return text.strip().upper() in {"", "E", "END"}


def teach(desk: TerminalState, rest: str, *, now: float) -> Dialogue:
    """TEACH location: p[1], p[2].. or p1, p2.."""
    variable = desk.variable(rest, now=now)
    _refuse_string(variable)
    if not variable.indices and not variable.name[-1].isdigit():
        variable = replace(variable, name=f"{variable.name}1")
    return Teach(desk, variable)


def following(variable: Variable) -> Variable:
    """The element after one of an array, or the name with the next number."""
    if variable.indices:
        *before, last = variable.indices
        assert isinstance(last, Number)
        return replace(variable, indices=(*before, Number(last.value + 1.0)))
    found = re.fullmatch(r"(.*?)(\d+)", variable.name)
    assert found is not None
    return replace(variable, name=f"{found[1]}{int(found[2]) + 1}")


def tool(desk: TerminalState, rest: str, *, now: float) -> None:
    """TOOL, TOOL transformation."""
    if rest in {"", "?"}:
        desk.say(layout.heading(), layout.row(desk.controller.arm.tool()))
    else:
        desk.controller.do(desk.instruction("TOOL", rest), now=now)


def base(desk: TerminalState, rest: str, *, now: float) -> None:
    """BASE, BASE dx,dy,dz,turn."""
    if rest in {"", "?"}:
        desk.say(layout.heading(), layout.row(desk.controller.arm.base()))
    else:
        desk.controller.do(desk.instruction("BASE", rest), now=now)
