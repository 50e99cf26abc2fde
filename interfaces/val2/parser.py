"""From text to trees: lines, expressions and programs."""

from __future__ import annotations

import re
from collections.abc import Generator, Sequence
from functools import lru_cache
from typing import Final, TypeAlias, TypeVar

from interfaces.val2 import forms, grammar
from interfaces.val2.errors import TextPosition, ValError, syntax_error
from interfaces.val2.printer import print_step
from interfaces.val2.rows import nearest
from interfaces.val2.syntax import (
    BLANK,
    Expression,
    Program,
    Step,
    Variable,
)

LONGEST_LINE: Final = 1000
MOST_LINES: Final = 100_000
DIRECTIVES: Final = (".PROGRAM", ".END", ".LOCATIONS", ".REALS", ".STRINGS", ".SIGNALS")
"""What lines of a file may begin with, beside what programs hold."""

_Result = TypeVar("_Result")
Reading: TypeAlias = Generator[int, None, _Result]
"""Reads a text in steps: yields how many characters each took, and returns what the text holds."""

_SURELY_SHORT: Final = 120
"""Characters of a line that can't come to too many when they're printed."""
_INDENTED: Final = 250
"""Columns that structures may indent a line by, and a label."""
_BREAK: Final = re.compile(r"[\r\n]")
_BEFORE: Final = re.compile(r"\s*([0-9]+(?![A-Za-z0-9_.]))?\s*")
_CODE: Final = re.compile(r'(?:[^";]|"[^"]*")*')
_HEADER: Final = re.compile(r"\s*\.PROGRAM(?![A-Za-z0-9_.])\s*", re.IGNORECASE | re.ASCII)
_PROGRAM_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_.]*")
_PARAMETER: Final = re.compile(r"\s*([#$]?[A-Za-z][A-Za-z0-9_.]*)\s*(\[[\s,]*\])?\s*")
_DIRECTIVE: Final = re.compile(r"\s*(\.[A-Za-z]+)(?![A-Za-z0-9_.])", re.ASCII)


def lines_of(text: str) -> list[str]:
    """The lines of a text, however they end.

    Raises:
        ValError: If there are too many of them.
    """
    text = text.removeprefix("\ufeff").rstrip("\x1a\x00")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if len(lines) > MOST_LINES:
        raise ValError("Text too long", f"{MOST_LINES} lines at most")
    return lines


def parse_line(text: str) -> Step:
    """The step of one line, such as `100 MOVE p1 ;there`.

    Raises:
        ValError: If it can't be one; its place is in line 1.
    """
    return read_line(text, 1)


def read_line(text: str, line: int) -> Step:
    """The step of a line that has a number in its text, from 1.

    Raises:
        ValError: If it can't be one.
    """
    _check_one_line(text, line)
    step = cached_step(text, line)
    if len(text) > _SURELY_SHORT and len(print_step(step)) > LONGEST_LINE - _INDENTED:
        detail = f"spelled out it has more than {LONGEST_LINE - _INDENTED} characters"
        raise ValError("Line too long", detail, place=step.at)
    return step


def _check_one_line(text: str, line: int) -> None:
    if len(text) > LONGEST_LINE:
        raise syntax_error(f"{LONGEST_LINE} characters at most", line, LONGEST_LINE + 1, "Line too long")
    if found := _BREAK.search(text):
        raise syntax_error("one line is allowed", line, found.start() + 1)


@lru_cache(maxsize=8192)
def cached_step(text: str, line: int) -> Step:
    """The step of a line that is short enough; files repeat their lines."""
    label, statement, comment = grammar.read(text, "line", line)
    found = _BEFORE.match(text)
    begin = 0 if found is None or text[found.end() :][:1] in ("", ";") else found.end()
    return Step(statement, label, comment, TextPosition(line, begin + 1))


def split_comment(text: str, line: int) -> tuple[str, str | None]:
    """The code of a line, and its comment.

    Raises:
        ValError: If a string has no closing quote.
    """
    code, semicolon, comment = text.partition(";")
    if '"' in code:
        found = _CODE.match(text)
        end = found.end() if found else 0
        if text[end : end + 1] == '"':
            raise syntax_error("the string has no closing quote", line, end + 1)
        code, semicolon, comment = text[:end], text[end : end + 1], text[end + 1 :]
    return code, comment.rstrip() if semicolon else None


def parse_expression(text: str) -> Expression:
    """The expression of a text.

    Raises:
        ValError: If it isn't one.
    """
    _check_one_line(text, 1)
    expression: Expression = grammar.read(text, "expression", 1)
    return expression


def parse_program(text: str) -> Program:
    """The program of a text from `.PROGRAM` on; `.END` may be missing.

    Raises:
        ValError: If it isn't one program.
    """
    lines = lines_of(text)
    begin = next((i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith(";")), 0)
    program, end = whole(read_program(lines, begin))
    for i in range(end, len(lines)):
        if lines[i].strip() and not lines[i].lstrip().startswith(";"):
            raise syntax_error("one program is allowed", i + 1, 1)
    return program


def directive(line: str) -> str:
    """The directive that a line begins with, upper case; empty if there's none."""
    if not line.lstrip().startswith("."):
        return ""
    found = _DIRECTIVE.match(line)
    return found[1].upper() if found else "."


def whole(reading: Reading[_Result]) -> _Result:
    """What a reading comes to, without a pause."""
    while True:
        try:
            next(reading)
        except StopIteration as stop:
            result: _Result = stop.value
            return result


def read_program(lines: Sequence[str], begin: int) -> Reading[tuple[Program, int]]:
    """The program whose header is a line, counted from 0, and the line behind it.

    Raises:
        ValError: If there's no such program; its place is in the lines.
    """
    name, parameters, comment = _header(lines[begin], begin + 1)
    steps, end = yield from read_steps(lines, begin + 1, name)
    return Program(name, parameters, steps, comment, TextPosition(begin + 1, 1)), end


def read_steps(lines: Sequence[str], begin: int, name: str) -> Reading[tuple[tuple[Step, ...], int]]:
    """The steps from a line, counted from 0, to `.END`, and the line behind it.

    Raises:
        ValError: If one of them can't be a step.
    """
    steps: list[Step] = []
    for i in range(begin, len(lines)):
        yield len(lines[i])
        match directive(lines[i]):
            case "":
                try:
                    steps.append(read_line(lines[i], i + 1))
                except ValError as error:
                    raise error.at(program=name) from None
            case ".END":
                return tuple(steps), i + 1
            case other:
                if other in DIRECTIVES:
                    return _trimmed(steps), i
                raise unknown_directive(lines[i], i + 1).at(program=name)
    return _trimmed(steps), len(lines)


def unknown_directive(line: str, number: int) -> ValError:
    """The error of a line that begins with what is no directive."""
    word = line.split(maxsplit=1)[0]
    detail = f"{word}{nearest(word, DIRECTIVES)}; allowed: {', '.join(DIRECTIVES)}"
    return syntax_error(detail, number, indented(line) + 1, "Undefined directive")


def _trimmed(steps: list[Step]) -> tuple[Step, ...]:
    """Without the blank lines at the end, where none says that they're the program's."""
    while steps and steps[-1] == Step(BLANK):
        steps.pop()
    return tuple(steps)


def indented(text: str, begin: int = 0) -> int:
    """Where the first character that isn't blank stands, from a place on, counted from 0."""
    return len(text) - len(text[begin:].lstrip())


def _header(line: str, number: int) -> tuple[str, tuple[Variable, ...], str | None]:
    code, comment = split_comment(line, number)
    allowed = ".PROGRAM name(arguments)"
    found = _HEADER.match(code)
    if found is None:
        raise syntax_error(f"allowed: {allowed}", number, indented(line) + 1)
    name = _PROGRAM_NAME.match(code, found.end())
    if name is None:
        raise syntax_error(f"allowed: {allowed}", number, found.end() + 1)
    parameters, end = _parameters(code, name.end(), number)
    if code[end:].strip():
        raise syntax_error(f"allowed: {allowed}", number, indented(code, end) + 1)
    return grammar.name_of(name[0]), parameters, comment


def _parameters(code: str, begin: int, line: int) -> tuple[tuple[Variable, ...], int]:
    opening = indented(code, begin)
    if code[opening : opening + 1] != "(":
        return (), begin
    closing = code.find(")", opening)
    if closing < 0:
        raise syntax_error("')' is missing", line, len(code.rstrip()) + 1)
    parameters: list[Variable] = []
    position = opening + 1
    while code[position:closing].strip():
        found = _PARAMETER.match(code, position, closing)
        if found is None or (found.end() < closing and code[found.end()] != ","):
            column = (found.end() if found else position) + 1
            raise syntax_error("allowed: names with commas between them", line, column)
        at = TextPosition(line, found.start(1) + 1)
        variable = Variable(grammar.name_of(found[1]), (), at, array=bool(found[2]))
        if found[1].upper() in forms.CONSTANTS:
            raise ValError("Reserved name", f"{found[1].upper()} is a function", place=at)
        if any(variable.name == other.name for other in parameters):
            raise ValError("Duplicate name", variable.name, place=at)
        parameters.append(variable)
        position = found.end() + 1
    return tuple(parameters), closing + 1
