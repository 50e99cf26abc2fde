"""Files: programs, locations, reals, strings, and the cell that is simulated around them.

Of a file of which not every line can be read, `read_all` gives what the others hold, and an error for each that
can't be.
"""

from __future__ import annotations

import math
import re
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import Final, TypeAlias

from interfaces.val2 import forms, grammar
from interfaces.val2.errors import TextPosition, ValError, syntax_error
from interfaces.val2.grammar import name_of, undefined
from interfaces.val2.memory import KINDS, MOST_DIMENSIONS
from interfaces.val2.parser import lines_of, no_statement, parse_header, parse_rule, read_line, split_comment
from interfaces.val2.printer import number, print_expression, print_program
from interfaces.val2.signals import SignalRule
from interfaces.val2.syntax import BLANK, Apply, Expression, Instruction, Number, Program, Step, Text, Variable
from interfaces.val2.values import VAL2, VPLUS, Dialect, PrecisionPoint, Transformation, Value
from vrs.checks import closest, did_you_mean

DECIMALS: Final = 9
"""Of lengths [mm] and angles [deg] of transformations: what is read again is printed as it was."""
_NAME: Final = re.compile(r"\s*([#$]?[A-Za-z][A-Za-z0-9_.]*)(?:\s*\[([0-9,\s]*)\])?(?=[\s,=]|$)\s*[=,]?\s*")
_NUMBER: Final = re.compile(r"([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[Ee][+-]?[0-9]+)?)(?=[\s,]|$)\s*,?\s*")
_PREFIXES: Final = {".LOCATIONS": ("", "#"), ".REALS": ("",), ".STRINGS": ("$",)}
"""Of names in the sections of values."""
_SECTIONS: Final = (*_PREFIXES, ".SIGNALS")
DIRECTIVES: Final = (".PROGRAM", ".END", *_SECTIONS)
"""What lines of a file may begin with, beside what programs hold."""
_DIRECTIVE: Final = re.compile(r"\s*(\.[A-Za-z]+)(?![A-Za-z0-9_.])", re.ASCII)
DIALECTS: Final = {"VAL2": VAL2, "VPLUS": VPLUS}
"""Comments, alone on a line, that say in which dialect's angles it goes on; and what `--dialect` takes."""
_DIRECTIVES: Final = {dialect: word for word, dialect in DIALECTS.items()}
_DIALECT: Final = re.compile(rf"\s*;\s*({'|'.join(DIALECTS)})\s*", re.IGNORECASE)
_ELEMENT: Final = re.compile(r"[0-9]{1,6}")
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
_SHAPES: Final = {
    "IF": re.compile(r"\bTHEN\s*(;|$)", re.IGNORECASE),
    "WHILE": re.compile(r"\bDO\s*(;|$)", re.IGNORECASE),
    "CASE": re.compile(r"\bOF\s*(;|$)", re.IGNORECASE),
    "FOR": re.compile(r"=.*\bTO\b", re.IGNORECASE),
}
"""How lines look that begin a structure, whatever their first word."""


@dataclass(frozen=True, slots=True)
class NamedValue:
    """A variable, or an element of an array with numbers as indices, and its value."""

    variable: Variable
    value: Value
    second: float | None = field(default=None, compare=False)
    """The second angle of a transformation, as it was written [deg]."""


@dataclass(frozen=True, slots=True)
class SourceFile:
    """What a file holds."""

    name: str
    programs: tuple[Program, ...] = ()
    values: tuple[NamedValue, ...] = ()
    signals: tuple[SignalRule, ...] = ()
    dialect: Dialect = VAL2
    """In which its locations are printed."""

    def of(self, kind: str) -> list[NamedValue]:
        """The values of one of `KINDS`."""
        return [entry for entry in self.values if isinstance(entry.value, KINDS[kind])]

    @property
    def undefined(self) -> tuple[ValError, ...]:
        """The errors of steps whose words are no instructions: those of programs that come there."""
        steps = [(p.name, n, step) for p in self.programs for n, step in enumerate(p.steps, 1)]
        found = [(error, name, n) for name, n, step in steps if (error := undefined(step.statement)) is not None]
        return tuple(error.at(program=name, step=n) for error, name, n in found)


Reading: TypeAlias = Generator[int, None, SourceFile]
"""Reads a text in steps: yields how many characters each took, and returns what the text holds."""


def parse_file(text: str, name: str, dialect: Dialect = VAL2) -> SourceFile:
    """What the text of a file holds.

    Args:
        text: The text; lines end as they like.
        name: Name of the file; a text that begins without `.PROGRAM` is a program of its name.
        dialect: In which its angles are, as far as it doesn't say.

    Raises:
        ValError: If it can't be read; its place is in the file.
    """
    return _whole(read_file(text, name, dialect=dialect))


def parse_program(text: str, dialect: Dialect = VAL2) -> Program:
    """The program of a text from `.PROGRAM` on, in a dialect's angles; `.END` may be missing.

    Raises:
        ValError: If it isn't one program.
    """
    program, *others = parse_file(text, "", dialect).programs or (None,)
    if program is None or directive(lines_of(text)[program.at.line - 1]) != ".PROGRAM":
        raise syntax_error("allowed: .PROGRAM name(arguments)", program.at.line if program else 1, 1)
    if others:
        raise syntax_error("one program is allowed", others[0].at.line, 1)
    return program


def joined(files: Sequence[SourceFile], program: str = "") -> SourceFile:
    """Several files as one, named as the first; values of later ones take the place of earlier ones.

    Args:
        files: The files.
        program: Which program comes first; the first there is if nothing is said.

    Raises:
        ValError: If it isn't there, or two programs have one name.
    """
    programs: dict[str, Program] = {}
    for one in (one for file in files for one in file.programs):
        if programs.setdefault(one.name, one) is not one:
            raise ValError("Duplicate program", one.name)
    wanted = name_of(program) if program else next(iter(programs), "")
    if wanted not in programs:
        known = f"{program}; allowed: {', '.join(programs)}" if programs else "the file holds no program"
        raise ValError("Undefined program name", known)
    first = programs.pop(wanted)
    values = {(type(entry.value), entry.variable): entry for file in files for entry in file.values}
    rules = tuple(rule for file in files for rule in file.signals)
    return SourceFile(files[0].name, (first, *programs.values()), tuple(values.values()), rules, files[0].dialect)


def with_called(programs: Mapping[str, Program], some: Mapping[str, Program]) -> dict[str, Program]:
    """Some programs, and all that they call, or run beside them."""
    found, waiting = dict(some), list(some.values())
    while waiting:
        for step in waiting.pop().steps:
            name = step.statement.program
            if name in programs and name not in found:
                found[name] = programs[name]
                waiting.append(programs[name])
    return found


def says_dialect(text: str) -> bool:
    """Whether a line of a text says in which dialect's angles it is."""
    return any(_DIALECT.fullmatch(line) for line in text.splitlines() if ";" in line)


def directive(line: str) -> str:
    """The directive that a line begins with, upper case; empty if there's none."""
    if not line.lstrip().startswith("."):
        return ""
    found = _DIRECTIVE.match(line)
    return found[1].upper() if found else "."


def indented(text: str, begin: int = 0) -> int:
    """Where the first character that isn't blank stands, from a place on, counted from 0."""
    return len(text) - len(text[begin:].lstrip())


def _whole(reading: Reading) -> SourceFile:
    """What a reading comes to, without a pause."""
    while True:
        try:
            next(reading)
        except StopIteration as stop:
            source: SourceFile = stop.value
            return source


def read_file(
    text: str, name: str, unreadable: dict[int, ValError] | None = None, *, dialect: Dialect = VAL2
) -> Reading:
    """Read a file in steps, as `parse_file` does at once.

    Args:
        text: Its text.
        name: Its name.
        unreadable: Takes the error of each line that can't be read, by its number; in such a line's place stands
            one that is the same part of a structure, with the same label. Without it the first error is raised, but
            a line whose word is no instruction is kept: it's an error where a program comes there.
        dialect: In which its angles are, as far as it doesn't say.
    """
    file = _File(name, dialect)
    for n, line in enumerate(lines_of(text), 1):
        yield len(line)
        try:
            file.read(line, n, strict=unreadable is not None)
        except ValError as error:
            placed = error.at(program=file.program.name if file.program is not None else "")
            if unreadable is None or len(unreadable) == MOST_ERRORS:
                raise placed from None
            unreadable[n] = placed
            file.stand_in(line, n, error)
    file.end_program()
    return file.source()


class _File:
    """What has been read of a file, line by line."""

    def __init__(self, name: str, dialect: Dialect) -> None:
        self._name, self._dialect = name, dialect
        self._programs: dict[str, Program] = {}
        self._entries: dict[tuple[str, Variable], NamedValue] = {}
        self._rules: list[SignalRule] = []
        self._section = ""
        self._steps: list[Step] = []
        self.program: Program | None = None
        """The one that is being read, without its steps."""

    def read(self, line: str, number: int, *, strict: bool) -> None:
        """Take a line.

        Raises:
            ValError: If it can't be read.
        """
        word = directive(line)
        if stated := _DIALECT.fullmatch(line):
            self._speak(DIALECTS[stated[1].upper()])
        if word == ".END" and self.program is not None:
            self.end_program(trimmed=False)
        elif word and word not in DIRECTIVES:
            detail = (
                f"{line.split(maxsplit=1)[0]}{did_you_mean(word, DIRECTIVES)}; allowed: {', '.join(DIRECTIVES)}"
            )
            raise syntax_error(detail, number, indented(line) + 1, "Undefined directive")
        elif word:
            self.end_program()
            self._directive(word, line, number)
        elif self.program is not None:
            self._steps.append(read_line(line, number))
            if strict and (error := undefined(self._steps[-1].statement)) is not None:
                self._steps.pop()
                raise error
            match self._steps[-1].statement:
                case Instruction("PARAMETER", (Number(value),), ("VPLUS",)):
                    self._speak(VPLUS if value else VAL2)
        elif self._section or not no_statement(line):
            code = split_comment(line, number, value=True)[0]
            if code.strip():
                self._value(code, line, number, strict=strict)

    def _speak(self, dialect: Dialect) -> None:
        """Read the program that is being read, and what comes, in a dialect."""
        self._dialect = dialect
        if self.program is not None:
            self.program = replace(self.program, dialect=dialect)

    def _directive(self, word: str, line: str, number: int) -> None:
        self._section = word if word in _SECTIONS else ""
        if word == ".PROGRAM":
            self._begin(parse_header(line, number))
            return
        code = split_comment(line, number, value=True)[0]
        behind = indented(code) + len(word)
        if code[behind:].strip():
            raise syntax_error(f"allowed: {word} alone on its line", number, indented(code, behind) + 1)

    def _value(self, code: str, line: str, number: int, *, strict: bool) -> None:
        if self._section == ".SIGNALS":
            self._rules.append(parse_rule(code, number))
        elif self._section:
            entry = _entry(self._section, code, number, self._dialect)
            self._entries[self._section, entry.variable] = entry
        elif self._programs:
            raise syntax_error("allowed: .PROGRAM name(arguments)", number, indented(code) + 1)
        else:
            stem = re.sub(r"[^A-Za-z0-9_.]", "", PurePath(self._name).stem)
            self._begin(Program(name_of(stem if stem[:1].isalpha() else f"p{stem}"), at=TextPosition(number, 1)))
            self.read(line, number, strict=strict)

    def _begin(self, program: Program) -> None:
        if program.name in self._programs:
            raise ValError("Duplicate program", program.name, place=program.at)
        self.program, self._steps = replace(program, dialect=self._dialect), []

    def end_program(self, *, trimmed: bool = True) -> None:
        """Put the program away that is being read; blank lines at its end don't count where no `.END` says so."""
        while trimmed and self._steps and self._steps[-1] == Step(BLANK):
            self._steps.pop()
        if self.program is not None:
            self._programs[self.program.name] = replace(self.program, steps=tuple(self._steps))
        self.program = None

    def stand_in(self, line: str, number: int, error: ValError) -> None:
        """Take something in the place of a line that can't be read."""
        if directive(line) == ".PROGRAM":
            found = _HEADER.match(line)
            known = found is not None and name_of(found[1]) not in self._programs
            name = name_of(found[1]) if found is not None and known else f"{found[1][:8] if found else ''}l{number}"
            self._begin(Program(name, at=TextPosition(number, 1)))
        elif self.program is not None:
            self._steps.append(_stand_in(line, number, error))

    def source(self) -> SourceFile:
        """What the file holds."""
        programs, values = tuple(self._programs.values()), tuple(self._entries.values())
        return SourceFile(self._name, programs, values, tuple(self._rules), self._dialect)


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
    return Variable(name_of(found[1]), tuple(Number(float(n)) for n in indices), at), found.end()


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


def _entry(section: str, code: str, line: int, dialect: Dialect) -> NamedValue:
    variable, begin = _variable(code, line, _PREFIXES[section])
    if section == ".STRINGS":
        return NamedValue(variable, _constant(grammar.read(" " * begin + code[begin:], "expression", line)))
    if section == ".REALS":
        return NamedValue(variable, _numbers(code, begin, line, 1)[0])
    values = _numbers(code, begin, line, 6)
    if variable.prefix == "#":
        return NamedValue(variable, PrecisionPoint(values))
    return NamedValue(variable, dialect.transformation(*values), values[4])


def _constant(expression: Expression) -> str:
    match expression:
        case Text(value):
            return value
        case Apply("$CHR", (Number(code),)) if code.is_integer() and 0 <= code <= 0x10FFFF:
            return chr(int(code))
        case Apply("+", (left, right)):
            return _constant(left) + _constant(right)  # type: ignore[arg-type]
    raise ValError("Syntax error", "allowed: strings and $CHR(code) with + between them", place=expression.at)


def print_rule(rule: SignalRule) -> str:
    """The line of a rule."""
    shown = f"{rule.signal} = {print_expression(rule.value)}"
    for word, seconds in (("AFTER", rule.after or None), ("FOR", rule.lasting), ("AT", rule.at_time)):
        shown += "" if seconds is None else f" {word} {number(seconds)}"
    return shown


def print_file(source: SourceFile) -> str:
    """The text of a file; a section without entries is left out. What isn't VAL-II's is told by a directive."""
    parts, spoken, located = [], VAL2, source.of("locations")
    for dialect, text in (
        *((program.dialect, print_program(program)) for program in source.programs),
        (source.dialect if located else spoken, ""),
    ):
        parts += [f";{_DIRECTIVES[dialect]}\n"] if dialect != spoken else []
        parts.append(text)
        spoken = dialect
    rows = [_row(e, " ".join(map(number, numbers_of(e, source.dialect)))) for e in located]
    parts.append(_printed(".LOCATIONS", rows))
    parts.append(_printed(".REALS", [_row(e, number(float(e.value))) for e in source.of("reals")]))  # type: ignore[arg-type]
    parts.append(
        _printed(".STRINGS", [_row(e, print_expression(Text(str(e.value)))) for e in source.of("strings")])
    )
    parts.append(_printed(".SIGNALS", [print_rule(rule) for rule in source.signals]))
    return "".join(parts)


def numbers_of(entry: NamedValue, dialect: Dialect) -> tuple[float, ...]:
    """The six numbers of a location, of a transformation to `DECIMALS`."""
    match entry.value:
        case PrecisionPoint(joints):
            return joints
        case Transformation():
            return tuple(round(value, DECIMALS) + 0.0 for value in dialect.numbers(entry.value))
    raise ValError("Mixed types", f"{print_expression(entry.variable)} isn't a location")


def _row(entry: NamedValue, value: str) -> str:
    return f"{print_expression(entry.variable)} {value}"


def _printed(section: str, rows: list[str]) -> str:
    return "\n".join([section, *rows, ".END", ""]) if rows else ""


def read_all(text: str, name: str, dialect: Dialect = VAL2) -> tuple[SourceFile, dict[int, ValError], set[str]]:
    """What can be read of a file; the error of each line that can't be, by its number; the names in those lines."""
    errors: dict[int, ValError] = {}
    try:
        source = _whole(read_file(text, name, errors, dialect=dialect))
    except ValError as error:
        return SourceFile(name), errors or {1: error.at(place=TextPosition(1, 1))}, set()
    lines = lines_of(text) if errors else []
    return source, errors, {name_of(word) for n in errors for word in _WORD.findall(lines[n - 1])}


def _stand_in(line: str, number: int, error: ValError) -> Step:
    """What takes the place of a step that can't be read."""
    head = _LINE.match(line)
    label, word, assigns = head.groups() if head is not None else (None, None, None)
    keyword = (word or "").upper()
    if keyword and not assigns and keyword not in forms.INSTRUCTIONS:
        shaped = next((kind for kind, shape in _SHAPES.items() if shape.search(line)), "")
        near = closest(keyword, forms.INSTRUCTIONS)
        keyword = shaped if not near or near in _SHAPES else near
    jumps = keyword == "IF" and _JUMP.search(line)
    stands = "" if assigns or jumps else _STAND_INS.get(keyword, "")
    label = "" if label is None or error.what == "Invalid label" else label
    return read_line(f"{label} {stands}".strip(), number)
