"""WHERE, HERE, POINT, TEACH, TOOL, BASE, REWIND: commands on locations, and their dialogues."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from typing_extensions import override

from interfaces.val2.errors import ValError
from interfaces.val2.monitor import layout
from interfaces.val2.monitor.state import Dialogue, TerminalState, as_location, halves, nothing, pieces
from interfaces.val2.motion.places import Where
from interfaces.val2.syntax import Compound, Number, Variable
from interfaces.val2.values import NULL, Location, PrecisionPoint, Transformation, from_oat

REPEAT_PERIOD: Final = 0.5
"""Time between two lines of `WHERE 1` [s]."""


class ChangeDialogue(Dialogue):
    """Shows a location's six numbers and asks for changes to them, until there are none."""

    prompt = "Change? "

    def __init__(self, state: TerminalState, value: Location, keep: Callable[[Location], None]) -> None:
        """Show the value.

        Args:
            state: Where it's shown.
            value: To begin with.
            keep: Takes the value in the end.
        """
        self._state, self._value, self._keep = state, value, keep
        state.say(layout.heading(), layout.row(value))

    @override
    def line(self, text: str) -> Dialogue | None:
        """Take changes, such as `,,10`; an empty line accepts.

        Raises:
            ValError: If they aren't at most six numbers.
        """
        if not text.strip():
            self._keep(self._value)
            return None
        self._value = changed(self._value, text)
        self._state.say(layout.row(self._value))
        return self

    @override
    def leave(self, *, kept: bool) -> None:
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


class WatchDialogue(Dialogue):
    """WHERE 1: shows where the arm is, again and again, until a line comes."""

    def __init__(self, state: TerminalState) -> None:
        """Show it for the first time."""
        self._state = state
        state.say(layout.where(state.controller.arm.here(now=state.now))[0])
        self.due = state.now
        self._shown = ""

    def advance(self) -> None:
        """Show it when it's due, and not what it was already."""
        if self._state.now < self.due:
            return
        self.due = self._state.now + REPEAT_PERIOD
        _, tool, joints = layout.where(self._state.controller.arm.here(now=self._state.now))
        if tool + joints != self._shown:
            self._shown = tool + joints
            self._state.say(tool, joints)

    @override
    def line(self, text: str) -> Dialogue | None:
        return None


def where(state: TerminalState, rest: str) -> Dialogue | None:
    """WHERE, WHERE 1, WHERE REAL."""
    if rest == "1":
        return WatchDialogue(state)
    if rest and "REAL".startswith(rest.upper()):
        real = state.controller.arm.real(now=state.now)
        if real is None:
            raise ValError("No other twin", "nothing has been heard of a real arm")
        state.say(*layout.where(real))
    else:
        nothing(rest, "WHERE but 1 or REAL")
        state.say(*layout.where(state.controller.arm.here(now=state.now)))
    return None


def rewind(state: TerminalState, rest: str) -> None:
    """REWIND t, REWIND -t: where the arm was."""
    t = state.number(rest)
    now, t = state.now, state.now + t if rest.startswith("-") else t
    past = state.controller.arm.past(t, now=state.now)
    apart = (
        f"{layout.fixed(now - t, 3)} s ago" if t <= now else f"{layout.fixed(t - now, 3)} s from now, as planned"
    )
    state.say(f"At {layout.fixed(t, 3)} s, {apart}", *layout.where(past))


def here(state: TerminalState, rest: str) -> Dialogue:
    """HERE location, HERE #location, HERE a:b."""
    variable, value = _recorded(state, rest)
    return ChangeDialogue(state, value, _keeper(state, variable))


def _recorded(state: TerminalState, text: str) -> tuple[Variable, Location]:
    """The variable that a HERE is about, and the arm's location as it takes it."""
    target = state.expression(text, "a location's name")
    frame = NULL
    if isinstance(target, Compound):
        *before, target = target.parts
        parts = before[0] if len(before) == 1 else Compound(tuple(before))
        frame = _transformation(state.controller.evaluate(parts, now=state.now), text)
    if not isinstance(target, Variable):
        raise ValError("Invalid argument", f"{text}: a location's name is wanted")
    _refuse_string(target)
    place: Where = state.controller.arm.here(now=state.now)
    if target.prefix == "#":
        if frame is not NULL:
            raise ValError("Invalid argument", f"{text}: a precision point isn't relative to anything")
        return state.resolved(target), place.joints
    value = place.tool if frame is NULL else frame.inverse() @ place.tool
    return state.resolved(target), value


def _transformation(value: object, text: str) -> Transformation:
    if not isinstance(value, Transformation):
        raise ValError("Invalid argument", f"{text}: a precision point isn't in a compound")
    return value


def _refuse_string(variable: Variable) -> None:
    if variable.prefix == "$":
        raise ValError("Invalid argument", f"{variable.name}: a location's name is wanted")


def _keeper(state: TerminalState, variable: Variable) -> Callable[[Location], None]:
    def keep(value: Location) -> None:
        state.controller.memory.set(variable, value)

    return keep


def point(state: TerminalState, rest: str) -> Dialogue:
    """POINT location, POINT location = expression."""
    name, expression = halves(rest)
    variable = state.variable(name)
    _refuse_string(variable)
    given = None if expression is None else as_location(state.value(expression), expression)
    value = _known(state, variable) if given is None else given
    if (variable.prefix == "#") != isinstance(value, PrecisionPoint):
        kind = "precision point" if variable.prefix else "transformation"
        raise ValError("Invalid argument", f"{expression}: a {kind} is wanted")
    return ChangeDialogue(state, value, _keeper(state, variable))


def _known(state: TerminalState, variable: Variable) -> Location:
    """The value that a location has; of one that has none, NULL or joint values of 0."""
    try:
        return as_location(state.controller.memory.get(variable), variable.name)
    except ValError as error:
        if not error.what.startswith("Undefined"):
            raise
        return PrecisionPoint((0.0,) * 6) if variable.prefix == "#" else NULL


class Teach(Dialogue):
    """TEACH: CR records one location after the other, E ends; other commands may be given in between."""

    def __init__(self, state: TerminalState, first: Variable) -> None:
        """Ask for the first."""
        self._state, self._next = state, first

    @property
    @override
    def prompt(self) -> str:
        return f"{layout.variable(self._next)}? "

    @override
    def line(self, text: str) -> Dialogue | None:
        if text.strip().upper() in {"E", "END"}:
            return None
        place = self._state.controller.arm.here(now=self._state.now)
        value: Location = place.joints if self._next.prefix == "#" else place.tool
        self._state.controller.memory.set(self._next, value)
        self._state.say(layout.row(value))
        self._next = following(self._next)
        return self

    @staticmethod
    def takes(text: str) -> bool:
        """Whether a line is for it, not a command in between."""
        return text.strip().upper() in {"", "E", "END"}


def teach(state: TerminalState, rest: str) -> Dialogue:
    """TEACH location: p[1], p[2].. or p1, p2.."""
    variable = state.variable(rest)
    _refuse_string(variable)
    if not variable.indices and not variable.name[-1].isdigit():
        variable = replace(variable, name=f"{variable.name}1")
    return Teach(state, variable)


def following(variable: Variable) -> Variable:
    """The element after one of an array, or the name with the next number."""
    if variable.indices:
        *before, last = variable.indices
        assert isinstance(last, Number)
        return replace(variable, indices=(*before, Number(last.value + 1.0)))
    found = re.fullmatch(r"(.*?)(\d+)", variable.name)
    assert found is not None
    return replace(variable, name=f"{found[1]}{int(found[2]) + 1}")


def frame(state: TerminalState, rest: str, *, word: str) -> None:
    """TOOL, TOOL transformation; BASE, BASE dx,dy,dz,turn."""
    arm = state.controller.arm
    if rest in {"", "?"}:
        state.say(layout.heading(), layout.row(arm.tool() if word == "TOOL" else arm.base()))
    else:
        state.controller.do(state.instruction(word, rest), now=state.now)
