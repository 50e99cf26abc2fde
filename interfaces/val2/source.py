"""Files: programs, locations, reals, strings, and the cell that is simulated around them.

Of a file of which not every line can be read, `read_all` gives what the others hold, and an error for each that
can't be.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Final

from interfaces.val2 import forms, grammar
from interfaces.val2.errors import TextPosition, ValError, syntax_error
from interfaces.val2.memory import MOST_DIMENSIONS
from interfaces.val2.parser import (
    Reading,
    directive,
    indented,
    lines_of,
    read_program,
    read_steps,
    split_comment,
    unknown_directive,
    whole,
)
from interfaces.val2.printer import number, print_expression, print_program
from interfaces.val2.rows import nearest_word
from interfaces.val2.signals import SignalRule
from interfaces.val2.syntax import Apply, Expression, Number, Program, Text, Variable
from interfaces.val2.values import Location, PrecisionPoint, Transformation, Value, from_oat, to_oat

DECIMALS: Final = 9
"""Of lengths [mm] and angles [deg] of transformations: what is read again is printed as it was."""
_NAME: Final = re.compile(r"\s*([#$]?[A-Za-z][A-Za-z0-9_.]*)(?:\s*\[([0-9,\s]*)\])?(?=[\s,=]|$)\s*[=,]?\s*")
_NUMBER: Final = re.compile(r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[Ee][+-]?[0-9]+)?)(?=[\s,]|$)\s*,?\s*")
_PREFIXES: Final = {".LOCATIONS": ("", "#"), ".REALS": ("",), ".STRINGS": ("$",)}
"""Of names in the sections of values."""
_SECTIONS: Final = (*_PREFIXES, ".SIGNALS")
_ELEMENT: Final = re.compile(r"[0-9]{1,6}")


@dataclass(frozen=True, slots=True)
class NamedValue:
    """A variable, or an element of an array with numbers as indices, and its value."""

    variable: Variable
    value: Value


@dataclass(frozen=True, slots=True)
class SourceFile:
    """What a file holds."""

    name: str
    programs: tuple[Program, ...] = ()
    locations: tuple[NamedValue, ...] = ()
    """Transformations and precision points."""
    reals: tuple[NamedValue, ...] = ()
    strings: tuple[NamedValue, ...] = ()
    signals: tuple[SignalRule, ...] = ()

    @property
    def values(self) -> tuple[NamedValue, ...]:
        """Of all variables."""
        return (*self.locations, *self.reals, *self.strings)


def parse_file(text: str, name: str) -> SourceFile:
    """What the text of a file holds.

    Args:
        text: The text; lines end as they like.
        name: Name of the file; a text that begins without `.PROGRAM` is a program of its name.

    Raises:
        ValError: If it can't be read; its place is in the file.
    """
    return whole(read_file(text, name))


def read_file(text: str, name: str) -> Reading[SourceFile]:
    """Read a file in steps, as `parse_file` does at once."""
    lines, i, section = lines_of(text), 0, ""
    programs: dict[str, Program] = {}
    entries: dict[str, dict[Variable, Value]] = {word: {} for word in _PREFIXES}
    rules: list[SignalRule] = []
    while i < len(lines):
        yield len(lines[i])
        word, program, number = directive(lines[i]), None, i + 1
        code = split_comment(lines[i], number)[0] if word == "" or word in _SECTIONS else ""
        if word == ".PROGRAM":
            program, i = yield from read_program(lines, i)
        elif word == ".END" or word in _SECTIONS:
            behind = indented(code) + len(word)
            if code[behind:].strip():
                raise syntax_error(f"allowed: {word} alone on its line", number, indented(code, behind) + 1)
            i += 1
        elif word:
            raise unknown_directive(lines[i], number)
        elif not section and code.strip():
            if programs:
                raise syntax_error("allowed: .PROGRAM name(arguments)", number, indented(code) + 1)
            stem = re.sub(r"[^A-Za-z0-9_.]", "", PurePath(name).stem)
            called = grammar.name_of(stem if stem[:1].isalpha() else f"p{stem}")
            steps, i = yield from read_steps(lines, i, called)
            program = Program(called, (), steps, None, TextPosition(number, 1))
        else:
            if code.strip() and section == ".SIGNALS":
                rules.append(parse_rule(code, number))
            elif code.strip():
                variable, value = _entry(section, code, number)
                entries[section][variable] = value
            i += 1
        if word:
            section = word if word in _SECTIONS else ""
        if program is not None and programs.setdefault(program.name, program) is not program:
            raise ValError("Duplicate program", program.name, place=program.at)
    locations, reals, strings = (tuple(NamedValue(*entry) for entry in given.items()) for given in entries.values())
    return SourceFile(name, tuple(programs.values()), locations, reals, strings, tuple(rules))


def _variable(code: str, line: int, prefixes: tuple[str, ...]) -> tuple[Variable, int]:
    """The variable that a line begins with, and where what stands behind it begins."""
    found = _NAME.match(code)
    at = TextPosition(line, indented(code) + 1)
    if found is None:
        raise ValError("Syntax error", "allowed: a name, and its value", place=at)
    prefix = found[1][0] if found[1][0] in "#$" else ""
    if prefix not in prefixes:
        shown = " or ".join(f"{p}name" for p in prefixes)
        raise ValError("Syntax error", f"{found[1]}; allowed: {shown}", place=at)
    if found[1].upper() in forms.CONSTANTS:
        raise ValError("Reserved name", f"{found[1].upper()} is a function", place=at)
    indices = [] if found[2] is None else [part.strip() for part in found[2].split(",")]
    if len(indices) > MOST_DIMENSIONS or not all(_ELEMENT.fullmatch(part) for part in indices):
        raise ValError("Syntax error", "allowed: one to three indices", place=at)
    return Variable(grammar.name_of(found[1]), tuple(Number(float(n)) for n in indices), at), found.end()


def _numbers(code: str, begin: int, line: int, count: int) -> tuple[float, ...]:
    values: list[float] = []
    position = begin
    while position < len(code.rstrip()):
        found = _NUMBER.match(code, position)
        if found is None or len(values) == count:
            what = "a number" if len(values) < count else "the end of the line"
            raise syntax_error(f"allowed: {what}", line, position + 1)
        value = float(found[1])
        if not math.isfinite(value):
            raise syntax_error(found[1], line, position + 1, "Number too large")
        values.append(value)
        position = found.end()
    if len(values) < count:
        detail = f"{len(values)} of {count} numbers"
        raise syntax_error(detail, line, len(code.rstrip()) + 1, "Missing argument")
    return tuple(values)


def _entry(section: str, code: str, line: int) -> tuple[Variable, Value]:
    variable, begin = _variable(code, line, _PREFIXES[section])
    if section == ".STRINGS":
        return variable, _constant(grammar.read(" " * begin + code[begin:], "expression", line))
    if section == ".REALS":
        return variable, _numbers(code, begin, line, 1)[0]
    return variable, location_of(variable, _numbers(code, begin, line, 6))


def _constant(expression: Expression) -> str:
    match expression:
        case Text(value):
            return value
        case Apply("$CHR", (Number(code),)) if code.is_integer() and 0 <= code <= 0x10FFFF:
            return chr(int(code))
        case Apply("+", (left, right)):
            return _constant(left) + _constant(right)  # type: ignore[arg-type]
    raise ValError("Syntax error", "allowed: strings and $CHR(code) with + between them", place=expression.at)


def location_of(variable: Variable, values: Sequence[float]) -> Location:
    """The location of six numbers: joints for a precision point, else X, Y, Z, O, A, T."""
    if variable.prefix == "#":
        return PrecisionPoint(tuple(values))
    x, y, z, o, a, t = values
    return from_oat(x, y, z, o, a, t)


def numbers_of(location: Location) -> tuple[float, ...]:
    """The six numbers of a location, of a transformation to `DECIMALS`."""
    if isinstance(location, PrecisionPoint):
        return location.joints
    return tuple(round(value, DECIMALS) + 0.0 for value in to_oat(location))


def parse_rule(text: str, line: int = 1) -> SignalRule:
    """The rule of a line such as `1001 = SIG(1) AFTER 2`.

    Raises:
        ValError: If it isn't one.
    """
    rule: SignalRule = grammar.read(text, "cell", line)
    return rule


def print_rule(rule: SignalRule) -> str:
    """The line of a rule."""
    shown = f"{rule.signal} = {print_expression(rule.value)}"
    for word, seconds in (("AFTER", rule.after or None), ("FOR", rule.lasting), ("AT", rule.at_time)):
        shown += "" if seconds is None else f" {word} {number(seconds)}"
    return shown


def print_file(source: SourceFile) -> str:
    """The text of a file; a section without entries is left out."""
    parts = [print_program(program) for program in source.programs]
    parts.append(_printed(".LOCATIONS", [_row(e, " ".join(map(number, _numbers_of(e)))) for e in source.locations]))
    parts.append(_printed(".REALS", [_row(e, number(float(e.value))) for e in source.reals]))  # type: ignore[arg-type]
    parts.append(_printed(".STRINGS", [_row(e, print_expression(Text(str(e.value)))) for e in source.strings]))
    parts.append(_printed(".SIGNALS", [print_rule(rule) for rule in source.signals]))
    return "".join(parts)


def _numbers_of(entry: NamedValue) -> tuple[float, ...]:
    if not isinstance(entry.value, Transformation | PrecisionPoint):
        raise ValError("Mixed types", f"{print_expression(entry.variable)} isn't a location")
    return numbers_of(entry.value)


def _row(entry: NamedValue, value: str) -> str:
    return f"{print_expression(entry.variable)} {value}"


def _printed(section: str, rows: list[str]) -> str:
    return "\n".join([section, *rows, ".END", ""]) if rows else ""


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
