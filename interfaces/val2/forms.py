"""Every word of the language: how it's written, what it does in a line, whose it is, and what carries it out.

The parser, the checker, the lexer, the monitor's help and its completion, and the reference in docs/val2.md
read these tables. The rows of instructions are in `instructions.py`, those of functions and operators in
`functions.py`, those of switches and parameters in `rows.py`.
"""

from __future__ import annotations

from collections import Counter
from typing import Final

from interfaces.val2 import functions
from interfaces.val2.functions import ALIASES, CONSTANTS, FUNCTIONS
from interfaces.val2.instructions import INSTRUCTIONS
from interfaces.val2.rows import PARAMETERS, SWITCHES

__all__ = [
    "ABBREVIATIONS", "ALIASES", "CONSTANTS", "FORMATS", "FUNCTIONS", "IGNORED", "INSTRUCTIONS", "OPERATORS",
    "PARAMETERS", "SWITCHES", "UNAVAILABLE", "WORDS",
]  # fmt: skip

OPERATORS: Final = {row.name: row.help for row in functions.OPERATORS.values() if row.name.isalpha()}
"""Operators that are words."""

UNAVAILABLE: Final = {
    **dict.fromkeys(("CLEAR.EVENT", "SET.EVENT"), "there are no events; allowed: SIGNAL number, WAIT SIG(number)"),
    "MC": "commands are the monitor's",
    "RUNSIG": "allowed: SIGNAL number",
    "WEAVE": "allowed: MOVES location",
    "WINDOW": "there is no conveyor",
}
"""Keywords without whose work a program would do something else: an error where it comes there, and why."""

PASSED: Final = {
    **dict.fromkeys(("DISABLE.EVENT", "ENABLE.EVENT"), "there are no events that could come"),
    "FSET": "a serial line is two files here, with nothing to set",
    **dict.fromkeys(("INTOFF", "INTON"), "no source tells what the servos' integration does; here it's on"),
    **dict.fromkeys(("NOOVERLAP", "OVERLAP"), "CP says whether motions go round their destinations"),
    "RELEASE": "tasks take turns by themselves",
    "SELECT": "there is one robot",
    "UNLOCK": "no source tells what it does",
}
"""Keywords that are recognised but have no meaning here, and why."""

IGNORED: Final = UNAVAILABLE.keys() | PASSED.keys()
"""Both."""

_NOT_HERE: Final = frozenset(
    {"CALIBRATE", "ERROR", "ESTOP", "JHERE", "JMOVE", "MCS", "ROBOT", "SEE", "SWITCH", "TIME"}
)
"""Instructions of V+ that aren't here: they don't stand for others that begin like them."""


def _abbreviations() -> dict[str, str]:
    """Beginnings that only one instruction has, and the instruction, as VAL takes them."""
    whole = {row.name for row in INSTRUCTIONS.values() if "whole" in row.tags}
    known = (INSTRUCTIONS.keys() | IGNORED | _NOT_HERE) - whole
    begun = Counter(word[:n] for word in known for n in range(1, len(word) + 1))
    return {
        name[:n]: name for name in INSTRUCTIONS.keys() - whole for n in range(1, len(name)) if begun[name[:n]] == 1
    }


ABBREVIATIONS: Final = _abbreviations()
"""What instructions may be abbreviated to."""

WORDS: Final = {
    "ALWAYS": "Not for the next motion alone, but until it's changed.",
    "MMPS": "Speed in millimetres a second.",
    "IPS": "Speed in inches a second.",
    "MONITOR": "The monitor speed, which stretches time.",
    "THEN": "Of IF: the steps up to ELSE or END.",
    "GOTO": "Go on at a label.",
    "TO": "Of FOR: the last value.",
    "STEP": "Of FOR: what is added each time.",
    "DO": "Of WHILE: the steps up to END.",
    "OF": "Of CASE: the values up to END.",
    "BY": "Of SHIFT and SCALE: how far, how much.",
}
"""Words within a line."""

FORMATS: Final = {
    "B": "A bell.", "C": "New lines.", "D": "A number as it is.", "E": "A number with an exponent.",
    "F": "A number with decimals.", "G": "/F or /E, whichever fits.", "H": "An integer, base 16.",
    "I": "An integer.", "O": "An integer, base 8.", "S": "No new line at the end.", "U": "Lines up.",
    "X": "Blanks.",
}  # fmt: skip
"""Control items of TYPE and $ENCODE."""
