"""WHERE, HERE, POINT, TEACH, TOOL, BASE, REWIND: commands on locations."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

from interfaces.val2.errors import ValError
from interfaces.val2.monitor import layout
from interfaces.val2.monitor.state import (
    Dialogue,
    Expects,
    Question,
    TerminalState,
    as_location,
    halves,
    nothing,
    pieces,
)
from interfaces.val2.printer import print_expression
from interfaces.val2.syntax import Compound, Number, Variable
from interfaces.val2.values import NULL, Dialect, Location, PrecisionPoint, Transformation

REPEAT_PERIOD: Final = 0.5
"""Time between two lines of `WHERE 1` [s]."""


def _change(state: TerminalState, variable: Variable, value: Location) -> Dialogue:
    """Show a location's six numbers and ask for changes to them, such as `,,10`, until there are none."""
    dialect = state.controller.dialect
    state.say(*layout.folded([layout.heading(dialect), layout.row(value, dialect)], state.width))
    while True:
        try:
            text = (yield Question("Change? ")) or ""
        except EOFError:
            text = ""
        with state.guarded():
            if not text.strip():
                state.controller.memory.set(variable, value)
                return
            value = _changed(value, text, dialect)
            state.say(*layout.folded([layout.row(value, dialect)], state.width))


def _changed(value: Location, text: str, dialect: Dialect) -> Location:
    """A location with some of its six numbers replaced, by numbers and nothings between commas."""
    given = pieces(text)
    if len(given) > 6:
        raise ValError("Invalid argument", f"{text.strip()}: at most six numbers between commas")
    numbers = list(dialect.numbers(value))
    for index, piece in enumerate(given):
        if piece:
            numbers[index] = _number(piece)
    joints = isinstance(value, PrecisionPoint)
    return PrecisionPoint(tuple(numbers)) if joints else dialect.transformation(*numbers)


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) < 1e9:
        raise ValError("Invalid argument", f"{text}: a number is wanted")
    return value


def where(state: TerminalState, rest: str) -> Dialogue:
    """WHERE; WHERE REAL; WHERE 1 shows it again and again, until a line comes."""
    arm = state.controller.arm
    if rest == "1":
        yield from _watch(state)
    elif rest and "REAL".startswith(rest.upper()):
        real = arm.real(now=state.now)
        if real is None:
            raise ValError("No other twin", "nothing has been heard of a real arm")
        state.say(*layout.where(real, state.controller.dialect, state.width))
    else:
        nothing(rest, "WHERE but 1 or REAL")
        state.say(*layout.where(arm.here(now=state.now), state.controller.dialect, state.width))


def _watch(state: TerminalState) -> Dialogue:
    arm, due = state.controller.arm, state.now
    shown: list[str] = []
    while (yield Question(due=due)) is None:
        due = state.now + REPEAT_PERIOD
        rows = layout.where(arm.here(now=state.now), state.controller.dialect, state.width)
        if rows != shown:
            # One heading does, unless the rows are folded.
            state.say(*rows[1 if shown and len(rows) == 3 else 0 :])
            shown = rows


def rewind(state: TerminalState, rest: str) -> None:
    """REWIND t, REWIND -t: where the arm was."""
    t = state.number(rest)
    now, t = state.now, state.now + t if rest.startswith("-") else t
    past = state.controller.arm.past(t, now=now)
    apart = (
        f"{layout.fixed(now - t, 3)} s ago" if t <= now else f"{layout.fixed(t - now, 3)} s from now, as planned"
    )
    state.say(f"At {layout.fixed(t, 3)} s, {apart}", *layout.where(past, state.controller.dialect, state.width))


def here(state: TerminalState, rest: str) -> Dialogue:
    """HERE location, HERE #location, HERE a:b."""
    target, frame = state.expression(rest, "a location's name"), NULL
    if isinstance(target, Compound):
        *before, target = target.parts
        whole = before[0] if len(before) == 1 else Compound(tuple(before))
        value = state.controller.evaluate(whole, now=state.now)
        if not isinstance(value, Transformation):
            raise ValError("Invalid argument", f"{rest}: a precision point isn't in a compound")
        frame = value
    if not isinstance(target, Variable):
        raise ValError("Invalid argument", f"{rest}: a location's name is wanted")
    location = state.here(_location_name(target))
    if isinstance(location, Transformation):
        location = location if frame is NULL else frame.inverse() @ location
    elif frame is not NULL:
        raise ValError("Invalid argument", f"{rest}: a precision point isn't relative to anything")
    yield from _change(state, state.resolved(target), location)


def _location_name(variable: Variable) -> Variable:
    """A variable, refused if it's a string's."""
    if variable.prefix == "$":
        raise ValError("Invalid argument", f"{variable.name}: a location's name is wanted")
    return variable


def point(state: TerminalState, rest: str) -> Dialogue:
    """POINT location, POINT location = expression; without a value it begins at NULL, or joint values of 0."""
    name, expression = halves(rest)
    variable = _location_name(state.variable(name))
    if expression is not None:
        value = as_location(state.value(expression), expression)
    else:
        unset = PrecisionPoint((0.0,) * 6) if variable.prefix == "#" else NULL
        known = state.controller.memory.found(variable)
        value = unset if known is None else as_location(known, variable.name)
    if (variable.prefix == "#") != isinstance(value, PrecisionPoint):
        kind = "precision point" if variable.prefix else "transformation"
        raise ValError("Invalid argument", f"{expression}: a {kind} is wanted")
    yield from _change(state, variable, value)


def teach(state: TerminalState, rest: str) -> Dialogue:
    """TEACH location: each CR records one, p[1], p[2].. or p1, p2.., until E; commands may come in between."""
    variable = _location_name(state.variable(rest))
    if not variable.indices and not variable.name[-1].isdigit():
        variable = replace(variable, name=f"{variable.name}1")
    answers = frozenset({"", "E", "END"})
    while not ((yield Question(f"{print_expression(variable)}? ", Expects.COMMAND, answers)) or "").strip():
        with state.guarded():
            value = state.here(variable)
            state.controller.memory.set(variable, value)
            state.say(*layout.folded([layout.row(value, state.controller.dialect)], state.width))
            variable = following(variable)


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
        shown, dialect = arm.tool() if word == "TOOL" else arm.base(), state.controller.dialect
        state.say(*layout.folded([layout.heading(dialect), layout.row(shown, dialect)], state.width))
    else:
        state.controller.do(state.instruction(word, rest), now=state.now)
