"""LISTP, LISTL, LISTR, LISTS, DIRECTORY, FREE, ID."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TypeVar

from interfaces.val2.errors import ValError
from interfaces.val2.memory import MOST_VALUES
from interfaces.val2.monitor import layout
from interfaces.val2.monitor.desk import TerminalState, as_location
from interfaces.val2.monitor.text import is_pattern, nothing, pieces
from interfaces.val2.parser import parse_expression
from interfaces.val2.printer import print_program
from interfaces.val2.syntax import Program
from interfaces.val2.values import Location, Value

T = TypeVar("T")


def listp(desk: TerminalState, rest: str, *, now: float) -> None:  # noqa: ARG001 - commands have one form
    """LISTP: programs with their steps."""
    programs = desk.controller.memory.programs
    for name in chosen(dict(sorted(programs.items())), rest, "program"):
        head, *steps, end = print_program(programs[name]).splitlines()
        desk.say(head, *layout.numbered(steps), end)
    if not programs and not rest:
        desk.say("No programs")


def listl(desk: TerminalState, rest: str, *, now: float) -> None:  # noqa: ARG001 - commands have one form
    """LISTL: locations."""
    desk.say_all(layout.locations(chosen(locations(desk), rest, "location")), "No locations")


def listr(desk: TerminalState, rest: str, *, now: float) -> None:
    """LISTR: reals, or an expression."""
    known = {name: value for name, value in desk.controller.memory.listing("real") if isinstance(value, float)}
    if _computed(rest) or _product(rest, known):
        desk.say(layout.number(desk.number(rest, now=now)))
        return
    desk.say_all(layout.reals(chosen(known, rest, "value")), "No reals")


def lists(desk: TerminalState, rest: str, *, now: float) -> None:
    """LISTS: strings, or an expression."""
    if _computed(rest):
        value = desk.value(rest, now=now)
        if not isinstance(value, str):
            raise ValError("Invalid argument", f"{rest}: a string is wanted")
        desk.say(f'"{layout.visible(value)}"')
        return
    known = {name: value for name, value in desk.controller.memory.listing("string") if isinstance(value, str)}
    desk.say_all(layout.strings(chosen(known, rest, "value")), "No strings")


def _computed(rest: str) -> bool:
    """Whether there's something to compute, not names alone."""
    return not all(is_pattern(piece) for piece in pieces(rest))


def _product(rest: str, known: Mapping[str, float]) -> bool:
    """Whether a `*` multiplies: no name is meant by it, and it's between two operands."""
    if "*" not in rest or any(matcher(piece).fullmatch(name) for piece in pieces(rest) for name in known):
        return False
    try:
        parse_expression(rest)
    except ValError:
        return False
    return True


def locations(desk: TerminalState) -> dict[str, Location]:
    """All locations by name."""
    listing = desk.controller.memory.listing
    return {name: as_location(value, name) for name, value in [*listing("location"), *listing("point")]}


def chosen(known: Mapping[str, T], rest: str, kind: str) -> dict[str, T]:
    """Those of the known names that are named; all where none is.

    Args:
        known: By name.
        rest: Names between commas; `*` stands for any characters, a name for all elements of an array.
        kind: What they are, for the error.

    Raises:
        ValError: If nothing is so named.
    """
    if not rest:
        return dict(known)
    found: dict[str, T] = {}
    for piece in pieces(rest):
        wanted = matcher(piece)
        some = {name: value for name, value in known.items() if wanted.fullmatch(name)}
        if not some:
            raise ValError(f"Undefined {kind}{' name' * (kind == 'program')}", piece)
        found |= some
    return found


def matcher(pattern: str) -> re.Pattern[str]:
    """What a name with `*` and `?` stands for; an array's name for its elements, too."""
    plain = "".join(pattern.split()).lower()
    spelled = re.escape(plain.removesuffix("[]")).replace(r"\*", ".*").replace(r"\?", ".")
    return re.compile(spelled if plain.endswith("]") and not plain.endswith("[]") else spelled + r"(\[.*\])?")


def directory(desk: TerminalState, rest: str, *, now: float) -> None:  # noqa: ARG001 - commands have one form
    """DIRECTORY: programs in memory."""
    programs = chosen(dict(sorted(desk.controller.memory.programs.items())), rest, "program")
    desk.say_all(_directory(programs), "No programs")


def _directory(programs: Mapping[str, Program]) -> list[str]:
    rows = []
    for name, program in programs.items():
        many = len(program.steps)
        comment = f";{program.comment}" if program.comment else ""
        parameters = ", ".join(variable.name for variable in program.parameters)
        rows.append((f".PROGRAM {name}({parameters})", f"{many} step{'s' * (many != 1)}", comment))
    return layout.table(rows) if rows else []


def free(desk: TerminalState, rest: str, *, now: float) -> None:  # noqa: ARG001 - commands have one form
    """FREE: what is in memory."""
    nothing(rest, "FREE")
    memory = desk.controller.memory
    steps = sum(len(program.steps) for program in memory.programs.values())
    values: dict[str, list[tuple[str, Value]]] = {
        kind: memory.listing(kind) for kind in ("location", "point", "real", "string")
    }
    used = sum(map(len, values.values()))
    desk.say(
        *layout.table([
            ("Programs", f"{len(memory.programs)}, of {steps} steps"),
            ("Locations", f"{len(values['location']) + len(values['point'])}"),
            ("Reals", f"{len(values['real'])}"),
            ("Strings", f"{len(values['string'])}"),
            ("Free", f"{MOST_VALUES - used} of {MOST_VALUES} values"),
        ])
    )  # fmt: skip


def identity(desk: TerminalState, rest: str, *, now: float) -> None:  # noqa: ARG001 - commands have one form
    """ID: what this is."""
    nothing(rest, "ID")
    desk.say(desk.version)
