"""Pieces of a command's line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from interfaces.val2.errors import ValError

NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9._]*")
"""A name without its prefix."""
_PLAIN: Final = re.compile(r"[#$]?[A-Za-z*?][A-Za-z0-9._*?]*(\[[-0-9, *]*\])?")
_WORD: Final = re.compile(r"\s*([A-Za-z][A-Za-z0-9._]*)\s*(.*)", re.DOTALL)
_INTEGER: Final = re.compile(r"\s*[-+]?\d{1,9}\s*")
_OPENING, _CLOSING = "([", ")]"


def split_word(text: str) -> tuple[str, str]:
    """The first word of a line, empty if it doesn't begin with one, and the rest."""
    found = _WORD.fullmatch(text)
    return (found[1], found[2].strip()) if found else ("", text.strip())


def pieces(text: str, separator: str = ",") -> list[str]:
    """What stands between separators, but for those within brackets or quotes; none of an empty text."""
    return [piece.strip() for piece in _pieces(text, separator)] if text.strip() else []


def _pieces(text: str, separator: str) -> Iterator[str]:
    depth, quoted, begin = 0, False, 0
    for index, letter in enumerate(text):
        if letter == '"':
            quoted = not quoted
        elif not quoted:
            depth += (letter in _OPENING) - (letter in _CLOSING)
            if letter == separator and depth == 0:
                yield text[begin:index]
                begin = index + 1
    yield text[begin:]


def halves(text: str) -> tuple[str, str | None]:
    """What stands before and after the first `=`; None after where there's none."""
    before, equals, after = text.partition("=")
    return before.strip(), after.strip() if equals else None


def named(text: str, kind: str) -> str:
    """A name without a prefix, lower case.

    Args:
        text: What was given.
        kind: What it names, for the error.

    Raises:
        ValError: If it's none.
    """
    if not text.strip():
        raise ValError("Missing argument", kind)
    if not NAME.fullmatch(text.strip()):
        raise ValError("Invalid argument", f"{text.strip()}: the name of a {kind} is wanted")
    return text.strip().lower()


def integer(text: str, default: int, what: str) -> int:
    """A whole number; the default where nothing is given.

    Raises:
        ValError: If it's none.
    """
    if not text.strip():
        return default
    if not _INTEGER.fullmatch(text):
        raise ValError("Invalid argument", f"{text.strip()}: {what} is a whole number")
    return int(text)


def is_pattern(text: str) -> bool:
    """Whether a text is a name, of an element of an array too, in which `*` and `?` may stand for others."""
    return _PLAIN.fullmatch(text) is not None


def nothing(rest: str, name: str) -> None:
    """Refuse what follows a command that takes nothing.

    Raises:
        ValError: If there's something.
    """
    if rest:
        raise ValError("Invalid argument", f"{rest}: nothing follows {name}")
