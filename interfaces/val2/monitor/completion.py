"""What may follow what was typed: commands, instructions, functions, switches, files, and the names in memory."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from interfaces.val2 import forms
from interfaces.val2.errors import ValError
from interfaces.val2.monitor import commands
from interfaces.val2.monitor.state import TerminalState, split_word

MOST: Final = 200
"""Longest list."""
_FRAGMENT: Final = re.compile(r"[#$]?[A-Za-z0-9._]*$")
_DO: Final = re.compile(r"\sDO\s(.*)$", re.IGNORECASE | re.DOTALL)
_LABEL: Final = re.compile(r"\s*\d+\s+")
_PROGRAMS: Final = frozenset(
    {"EXECUTE", "XSTEP", "EDIT", "LISTP", "DELETE", "DELETEP", "COPY", "RENAME", "DIRECTORY"}
)
_LOCATIONS: Final = frozenset({"LISTL", "DELETEL", "HERE", "POINT", "TEACH"})
_VALUES: Final = {"LISTR": "real", "DELETER": "real", "LISTS": "string", "DELETES": "string"}


@dataclass(frozen=True, slots=True)
class Suggestion:
    """A word that may come."""

    word: str
    help: str = ""
    """One line; empty for none."""


def suggestions(text: str, state: TerminalState, *, program: bool = False) -> tuple[str, list[Suggestion]]:
    """What may complete a line.

    Args:
        text: As far as the cursor.
        state: Whose memory and files are known.
        program: Whether it's a line of a program, not a command.

    Returns:
        What is typed of the last word, and the words that begin with it; keywords in its case.
    """
    found = _FRAGMENT.search(text)
    fragment = found[0] if found else ""
    before = text[: len(text) - len(fragment)]
    if before.count('"') % 2 or ";" in before:
        return fragment, []
    known = _instruction(before, state) if program else _command(before, state)
    wanted = fragment.upper()
    fitting = {one.word: one for one in known if one.word.upper().startswith(wanted) and one.word.upper() != wanted}
    lower = bool(fragment) and not any(letter.isupper() for letter in fragment)
    some = sorted(fitting.values(), key=lambda one: one.word.upper())[:MOST]
    return fragment, [Suggestion(one.word.lower() if lower else one.word, one.help) for one in some]


def _command(before: str, state: TerminalState) -> Iterable[Suggestion]:
    word, rest = split_word(before)
    if not word:
        return [Suggestion(one.name, one.help) for one in commands.COMMANDS.values()]
    try:
        name = commands.command_named(word).name
    except ValError:
        return []
    memory = state.controller.memory
    if name == "DO":
        return _instruction(before.lstrip()[len(word) :], state)
    if name == "AT":
        found = _DO.search(before)
        return _instruction(found[1], state) if found else [Suggestion("DO")]
    if name in {"ENABLE", "DISABLE", "SWITCH"}:
        return [Suggestion(one.name, one.help) for one in forms.SWITCHES.values()]
    if name == "PARAMETER" and "=" not in rest:
        return [Suggestion(one.name, one.help) for one in forms.PARAMETERS.values()]
    if name in _PROGRAMS:
        return [Suggestion(one) for one in memory.programs]
    if name in _LOCATIONS and "=" not in rest and ":" not in rest:
        return _names(state, "location", "point")
    if name in _VALUES:
        return _names(state, _VALUES[name])
    if name in {"LOAD", "STORE", "STOREP", "STOREL", "STORER", "STORES"}:
        return [Suggestion(one) for one in (memory.programs if "=" in rest else state.files.listed())]
    if name == "HELP":
        return _all_words()
    if name == "WHERE":
        return [Suggestion("REAL", "The other twin.")]
    return _operands(state) if name in {"TOOL", "BASE", "POINT", "HERE", "REWIND", "SPEED", "SIGNAL"} else []


def _instruction(before: str, state: TerminalState) -> Iterator[Suggestion]:
    word, _ = split_word(_LABEL.sub("", before))
    if not word:
        yield from (Suggestion(one.name, one.help) for one in forms.INSTRUCTIONS.values())
        yield from _names(state, "real", "string")
        return
    keyword = word.upper()
    if keyword in {"CALL", "GOSUB", "REACT", "REACTI"}:
        yield from (Suggestion(one) for one in state.controller.memory.programs)
    if keyword in {"ENABLE", "DISABLE"}:
        yield from (Suggestion(one.name, one.help) for one in forms.SWITCHES.values())
        return
    form = forms.INSTRUCTIONS.get(keyword)
    if form is not None:
        yield from (Suggestion(one, forms.WORDS.get(one, "")) for one in form.allowed_words)
    yield from _operands(state)


def _operands(state: TerminalState) -> Iterator[Suggestion]:
    yield from (Suggestion(one.name, f"{one.usage}: {one.help}") for one in forms.FUNCTIONS.values())
    yield from (Suggestion(name, said) for name, said in forms.OPERATORS.items())
    yield from _names(state, "location", "point", "real", "string")


def _names(state: TerminalState, *kinds: str) -> list[Suggestion]:
    """Names in memory, an array's once."""
    listing = state.controller.memory.listing
    return [
        Suggestion(name) for name in {name.partition("[")[0]: None for kind in kinds for name, _ in listing(kind)}
    ]


def _all_words() -> Iterator[Suggestion]:
    for name in {*commands.COMMANDS, *forms.INSTRUCTIONS, *forms.FUNCTIONS, *forms.SWITCHES, *forms.PARAMETERS}:
        yield Suggestion(name, next(said for _, _, said in commands.explained(name)))


def hint(text: str, *, program: bool = False) -> str:
    """One line on the word that's being typed, or the last one that means something; empty for none.

    Args:
        text: As far as the cursor.
        program: Whether it's a line of a program, not a command.
    """
    parts = re.findall(r"[#$]?[A-Za-z][A-Za-z0-9._]*", text)
    if not program and parts:
        try:
            parts[0] = commands.command_named(parts[0]).name
        except ValError:
            return ""
    for index in reversed(range(len(parts))):
        found = list(commands.explained(parts[index]))
        if found:
            wanted = "command" if index == 0 and not program else "instruction"
            kind, usage, said = next((one for one in found if one[0].startswith(wanted)), found[0])
            return f"{usage}: {said}" if kind else ""
    return ""
