"""What the monitor knows of every word: commands at its prompt, and HELP."""

from __future__ import annotations

import difflib
import re
import textwrap
from collections.abc import Iterator
from typing import Final

from interfaces.val2 import forms
from interfaces.val2.errors import ValError
from interfaces.val2.monitor import commands, layout
from interfaces.val2.monitor.commands import COMMANDS, MonitorCommand
from interfaces.val2.monitor.desk import TerminalState
from interfaces.val2.monitor.text import split_word

_ASSIGNMENT: Final = re.compile(r"[#$]?[A-Za-z][A-Za-z0-9._]*(\[[^\]]*\])?\s*=(?!=).*", re.DOTALL)


def command(line: str) -> MonitorCommand:
    """The command that a line begins with.

    Raises:
        ValError: If it's none; it says so where the line is an instruction.
    """
    word, rest = split_word(line)
    if _ASSIGNMENT.fullmatch(line):
        raise ValError("Invalid command", f"{_short(line)}: an assignment is an instruction, DO {_short(line)}")
    try:
        if word.upper() in forms.INSTRUCTIONS and word.upper() not in COMMANDS:
            raise ValError("Invalid command", word.upper())
        return commands.command(word)
    except ValError as error:
        if error.what == "Ambiguous command":
            raise
        raise ValError("Invalid command", _hint(word.upper(), rest, line)) from None


def _hint(word: str, rest: str, line: str) -> str:
    if not word:
        return _short(line)
    if word in forms.INSTRUCTIONS:
        return f"{word} is an instruction: DO {_short(f'{word} {rest}'.strip())}"
    if word in forms.SWITCHES:
        return f"{word} is a switch: ENABLE {word}, DISABLE {word}"
    close = difflib.get_close_matches(word, COMMANDS, n=1, cutoff=0.7)
    return f"{_short(word)}; did you mean {close[0]}?" if close else f"{_short(word)}; HELP lists the commands"


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}.."


def explained(word: str) -> Iterator[tuple[str, str, str]]:
    """What a word is, how it's written, and what it does; a word may be several things."""
    upper = word.upper()
    if upper in COMMANDS:
        one = COMMANDS[upper]
        mark = ", ours" if one.ours else ""
        yield f"command{mark}", " | ".join(one.usage), one.help
    if upper in forms.INSTRUCTIONS:
        form = forms.INSTRUCTIONS[upper]
        yield f"instruction, {form.origin}", form.usage, form.help
    for name in (upper, f"${upper}", f"#{upper}"):
        if name in forms.FUNCTIONS:
            function = forms.FUNCTIONS[name]
            yield f"function, {function.origin}", function.usage, function.help
    if upper in forms.SWITCHES:
        one_switch = forms.SWITCHES[upper]
        yield f"switch, {one_switch.origin}", f"ENABLE {upper} | DISABLE {upper}", one_switch.help
    if upper in forms.PARAMETERS:
        row = forms.PARAMETERS[upper]
        said = f"{row.help} {layout.number(row.low)} to {layout.number(row.high)} {row.unit}."
        yield f"parameter, {row.origin}", f"PARAMETER {upper} = value", said
    for table, kind in ((forms.OPERATORS, "operator"), (forms.WORDS, "word")):
        if upper in table:
            yield kind, upper, table[upper]
    if upper in forms.IGNORED and upper not in COMMANDS:
        why = forms.UNAVAILABLE.get(upper)
        passed = "It's recognised in programs, and passed over: it has no meaning here."
        yield "instruction, V+", upper, passed if why is None else f"It isn't available: {why}."


def help_(desk: TerminalState, rest: str, *, now: float) -> None:  # noqa: ARG001 - commands have one form
    """HELP; HELP word."""
    if not rest:
        desk.say("Commands; they may be abbreviated. HELP and a word says more of it.")
        desk.say(*layout.in_columns(COMMANDS))
        desk.say("Instructions, after DO or in programs:")
        desk.say(*layout.in_columns(forms.INSTRUCTIONS))
        desk.say("Functions:")
        desk.say(*layout.in_columns(forms.FUNCTIONS))
        return
    found = list(explained(rest)) or list(explained(_whole(rest)))
    if not found:
        raise ValError("Unknown word", f"{_short(rest)}{_near(rest)}")
    for kind, usage, said in found:
        desk.say(
            f"{usage}  ({kind})",
            *textwrap.wrap(said, layout.WIDTH, initial_indent="    ", subsequent_indent="    "),
        )


def _whole(word: str) -> str:
    """The command, instruction, switch or parameter that a word is the beginning of; itself if there's none."""
    upper = word.upper()
    for names in (COMMANDS, forms.INSTRUCTIONS, forms.FUNCTIONS, forms.SWITCHES, forms.PARAMETERS):
        try:
            return commands.unique(upper, names, "word")
        except ValError:
            continue
    return upper


def _near(word: str) -> str:
    known = [*COMMANDS, *forms.INSTRUCTIONS, *forms.FUNCTIONS, *forms.SWITCHES, *forms.PARAMETERS]
    close = difflib.get_close_matches(word.upper(), known, n=1, cutoff=0.7)
    return f"; did you mean {close[0]}?" if close else ""
