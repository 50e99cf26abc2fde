"""From lines to trees: steps, headers, expressions, and rules of a cell."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Final

from interfaces.val2 import grammar
from interfaces.val2.errors import TextPosition, ValError, syntax_error
from interfaces.val2.printer import print_step
from interfaces.val2.signals import SignalRule
from interfaces.val2.syntax import Expression, Program, Step

LONGEST_LINE: Final = 1000
MOST_LINES: Final = 100_000

_SURELY_SHORT: Final = 120
"""Characters of a line that can't come to too many when they're printed."""
_INDENTED: Final = 250
"""Columns that structures may indent a line by, and a label."""
_BREAK: Final = re.compile(r"[\r\n]")
_BEFORE: Final = re.compile(r"\s*(?:[0-9]+\.\??(?=\s|$)\s*)?(?:[0-9]+(?![A-Za-z0-9_.]))?\s*")
"""A step's number, and a label."""
_NO_STATEMENT: Final = re.compile(r"$|;|#(?![A-Za-z][A-Za-z0-9_.]*\s*(\[|=))")
_CODE: Final = re.compile(r'[^";#]*(?:(?:"[^"]*"|#(?=[A-Za-z]))[^";#]*)*')
_VALUE: Final = re.compile(r'\s*(?:#(?=[A-Za-z]))?[^";#]*(?:"[^"]*"[^";#]*)*')


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
    step = read_line(text, 1)
    if (error := grammar.undefined(step.statement)) is not None:
        raise error
    return step


def read_line(text: str, line: int) -> Step:
    """The step of a line that has a number in its text, from 1; its word may be no instruction.

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
    if (move := grammar.read_move(text, line)) is not None:
        return Step(move, at=move.at)
    label, statement, comment = grammar.read(text, "line", line)
    found = _BEFORE.match(text)
    begin = 0 if found is None or _NO_STATEMENT.match(text, found.end()) else found.end()
    return Step(statement, label, comment, TextPosition(line, begin + 1))


def no_statement(text: str) -> bool:
    """Whether a line of a program is blank, or a comment alone."""
    return _NO_STATEMENT.match(text.lstrip()) is not None


def split_comment(text: str, line: int, *, value: bool = False) -> tuple[str, str | None]:
    """The code of a line, and its comment.

    Args:
        text: The line.
        line: Its number, from 1.
        value: Whether it's a value or a directive, not a step: there a name with `#` can stand first alone.

    Raises:
        ValError: If a string has no closing quote.
    """
    found = (_VALUE if value else _CODE).match(text)
    code = found[0] if found else ""
    behind = text[len(code) :]
    if behind.startswith('"'):
        raise syntax_error("the string has no closing quote", line, len(code) + 1)
    return code, behind[1:].rstrip() if behind else None


def parse_expression(text: str) -> Expression:
    """The expression of a text.

    Raises:
        ValError: If it isn't one.
    """
    _check_one_line(text, 1)
    expression: Expression = grammar.read(text, "expression", 1)
    return expression


def parse_header(text: str, line: int = 1) -> Program:
    """The program without steps of a line such as `.PROGRAM fetch(from) ;it`.

    Raises:
        ValError: If it isn't one.
    """
    _check_one_line(text, line)
    program: Program = grammar.read(text, "header", line)
    return program


def parse_rule(text: str, line: int = 1) -> SignalRule:
    """The rule of a line such as `1001 = SIG(1) AFTER 2`.

    Raises:
        ValError: If it isn't one.
    """
    rule: SignalRule = grammar.read(text, "cell", line)
    return rule
