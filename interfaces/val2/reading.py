"""Files of which not every line can be read: what the others hold, and an error for each that can't be."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

from interfaces.val2 import forms, grammar
from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.parser import directive, lines_of
from interfaces.val2.slots import nearest_word
from interfaces.val2.source import SourceFile, parse_file

MOST_ERRORS: Final = 100
"""Lines that can't be read, of which is told."""
_HEADER: Final = re.compile(r"\s*\.PROGRAM\s+([A-Za-z][A-Za-z0-9_.]*)", re.IGNORECASE | re.ASCII)
_LINE: Final = re.compile(r"\s*([0-9]+(?![A-Za-z0-9_.]))?\s*([A-Za-z][A-Za-z0-9_.]*)?\s*(\[|=(?!=))?", re.ASCII)
_JUMP: Final = re.compile(r"\b(GOTO\b|THEN\s*[0-9]+\s*(;|$))", re.IGNORECASE)
_WORD: Final = re.compile(r"[#$]?[A-Za-z][A-Za-z0-9_.]*")
_STAND_INS: Final = {
    "IF": "IF TRUE THEN", "ELSE": "ELSE", "END": "END", "WHILE": "WHILE TRUE DO", "DO": "DO", "UNTIL": "UNTIL TRUE",
    "FOR": "FOR n = 1 TO 1", "CASE": "CASE 1 OF", "VALUE": "VALUE 1:", "ANY": "ANY",
}  # fmt: skip
"""What keeps a structure whole where one of its lines can't be read."""
_SHAPES: Final = (
    ("IF", re.compile(r"\bTHEN\s*(;|$)", re.IGNORECASE)),
    ("WHILE", re.compile(r"\bDO\s*(;|$)", re.IGNORECASE)),
    ("CASE", re.compile(r"\bOF\s*(;|$)", re.IGNORECASE)),
    ("FOR", re.compile(r"=.*\bTO\b", re.IGNORECASE)),
)
"""How lines look that begin a structure, whatever their first word."""


def read_all(text: str, name: str) -> tuple[SourceFile, dict[int, ValError]]:
    """What can be read of a file, and the error of each line that can't, by its number.

    In the place of such a line stands one that is the same part of a structure, with the same label.
    """
    errors: dict[int, ValError] = {}
    try:
        lines = lines_of(text)
    except ValError as error:
        return SourceFile(name), {1: error.at(place=TextPosition(1, 1))}
    while len(errors) < MOST_ERRORS:
        try:
            return parse_file("\n".join(lines), name), errors
        except ValError as error:
            number = error.place.line if error.place is not None else len(lines)
            if number in errors and not lines[number - 1]:
                break
            stands = "" if number in errors else _stand_in(lines[number - 1], number, error)
            lines[number - 1] = stands
            errors.setdefault(number, error)
    return SourceFile(name), errors


def words_of(text: str, numbers: Iterable[int]) -> set[str]:
    """The names in lines that can't be read: they may have been set there."""
    wanted = list(numbers)
    try:
        lines = lines_of(text) if wanted else []
    except ValError:
        return set()
    return {grammar.name_of(word) for n in wanted for word in _WORD.findall(lines[n - 1])}


def _stand_in(line: str, number: int, error: ValError) -> str:
    """What takes the place of a line that can't be read."""
    if directive(line) == ".PROGRAM":
        found = _HEADER.match(line)
        named = "" if found is None else found[1]
        return (
            f".PROGRAM {named}" if named and error.what != "Duplicate program" else f".PROGRAM {named[:8]}l{number}"
        )
    if directive(line):
        return ""
    head = _LINE.match(line)
    label, word, assigns = head.groups() if head is not None else (None, None, None)
    keyword = (word or "").upper()
    if keyword and not assigns and keyword not in forms.INSTRUCTIONS:
        shaped = (kind for kind, shape in _SHAPES if shape.search(line))
        keyword = nearest_word(keyword, forms.INSTRUCTIONS) or next(shaped, "")
    jumps = keyword == "IF" and _JUMP.search(line)
    stands = "" if assigns or jumps else _STAND_INS.get(keyword, "")
    return f"{_label(label, error)} {stands}".strip()


def _label(label: str | None, error: ValError) -> str:
    return "" if label is None or error.what == "Invalid label" else label
