"""Files: programs, locations, reals, strings, and the cell that is simulated around them.

Of a file of which not every line can be read, `read_all` gives what the others hold, and an error for each that
can't be.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
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
    return (yield from _SourceReader(lines_of(text), name).run())


class _SourceReader:
    def __init__(self, lines: Sequence[str], name: str) -> None:
        self._lines, self._name = lines, name
        self._programs: list[Program] = []
        self._entries: dict[str, dict[Variable, Value]] = {".LOCATIONS": {}, ".REALS": {}, ".STRINGS": {}}
        self._rules: list[SignalRule] = []

    def run(self) -> Reading[SourceFile]:
        i = 0
        while i < len(self._lines):
            yield len(self._lines[i])
            line = self._lines[i]
            match directive(line):
                case ".PROGRAM":
                    program, i = yield from read_program(self._lines, i)
                    self._add(program)
                case ".LOCATIONS" | ".REALS" | ".STRINGS" | ".SIGNALS" as section:
                    code, _ = split_comment(line, i + 1)
                    behind = indented(code) + len(section)
                    if code[behind:].strip():
                        raise syntax_error(
                            f"allowed: {section} alone on its line", i + 1, indented(code, behind) + 1
                        )
                    i = yield from self._section(section, i + 1)
                case ".END":
                    i += 1
                case "":
                    i = yield from self._outside(i)
                case _:
                    raise unknown_directive(line, i + 1)
        locations, reals, strings = (
            tuple(NamedValue(variable, value) for variable, value in entries.items())
            for entries in self._entries.values()
        )
        return SourceFile(self._name, tuple(self._programs), locations, reals, strings, tuple(self._rules))

    def _add(self, program: Program) -> None:
        if any(program.name == other.name for other in self._programs):
            raise ValError("Duplicate program", program.name, place=program.at)
        self._programs.append(program)

    def _outside(self, i: int) -> Reading[int]:
        """Blank lines and comments between programs; else a program that has no header."""
        if not split_comment(self._lines[i], i + 1)[0].strip():
            return i + 1
        if self._programs:
            raise syntax_error("allowed: .PROGRAM name(arguments)", i + 1, indented(self._lines[i]) + 1)
        stem = re.sub(r"[^A-Za-z0-9_.]", "", PurePath(self._name).stem)
        name = grammar.name_of(stem if stem[:1].isalpha() else f"p{stem}")
        steps, end = yield from read_steps(self._lines, i, name)
        self._add(Program(name, (), steps, None, TextPosition(i + 1, 1)))
        return end

    def _section(self, section: str, begin: int) -> Reading[int]:
        for i in range(begin, len(self._lines)):
            yield len(self._lines[i])
            word = directive(self._lines[i])
            if word:
                return i + (word == ".END")
            code, _ = split_comment(self._lines[i], i + 1)
            if code.strip() and section == ".SIGNALS":
                self._rules.append(parse_rule(code, i + 1))
            elif code.strip():
                variable, value = _ENTRIES[section](code, i + 1)
                self._entries[section][variable] = value
        return len(self._lines)


def _variable(code: str, line: int, prefixes: str) -> tuple[Variable, int]:
    """The variable that a line begins with, and where what stands behind it begins."""
    found = _NAME.match(code)
    at = TextPosition(line, indented(code) + 1)
    if found is None:
        raise ValError("Syntax error", "allowed: a name, and its value", place=at)
    prefix = found[1][0] if found[1][0] in "#$" else ""
    if prefix not in prefixes.split("|"):
        shown = " or ".join(f"{p}name" for p in prefixes.split("|"))
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


def _location(code: str, line: int) -> tuple[Variable, Value]:
    variable, begin = _variable(code, line, "|#")
    return variable, location_of(variable, _numbers(code, begin, line, 6))


def _real(code: str, line: int) -> tuple[Variable, Value]:
    variable, begin = _variable(code, line, "")
    return variable, _numbers(code, begin, line, 1)[0]


def _string(code: str, line: int) -> tuple[Variable, Value]:
    variable, begin = _variable(code, line, "$")
    tree = grammar.read(" " * begin + code[begin:], "expression", line)
    return variable, _constant(grammar.expression(tree, line))


_ENTRIES: Final[dict[str, Callable[[str, int], tuple[Variable, Value]]]] = {
    ".LOCATIONS": _location,
    ".REALS": _real,
    ".STRINGS": _string,
}


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
    signal, _, value, *rest = grammar.read(text, "rule", line).children
    number_of = grammar.number(signal, line)
    place = TextPosition(line, signal.column)
    if not number_of.is_integer():
        raise ValError("Illegal digital signal", str(signal), place=place)
    times: dict[str, float] = {}
    for word, seconds in zip(rest[::2], rest[1::2], strict=True):
        if word.type in times:
            raise syntax_error(f"a second {word}", line, word.column)
        times[word.type] = grammar.number(seconds, line)
    return SignalRule(
        int(number_of),
        grammar.expression(value, line),
        times.get("AFTER", 0.0),
        times.get("FOR"),
        times.get("AT"),
        place,
    )


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
