"""How values, programs and tables are laid out on 80 columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from interfaces.val2.motion.places import Where
from interfaces.val2.printer import number
from interfaces.val2.values import VAL2, Dialect, Location, Transformation, Value

WIDTH = 79
"""Longest line [characters]."""
_COLUMN = 9


def fixed(value: float, decimals: int) -> str:
    """A number with so many decimals, without a minus before zero."""
    shown = f"{value:.{decimals}f}"
    return shown.removeprefix("-") if float(shown) == 0.0 else shown


def heading(dialect: Dialect = VAL2) -> str:
    """The line above those of `row`."""
    return "".join(f"{f'{axis}/JT{n}':>{_COLUMN}}" for n, axis in enumerate(("X", "Y", "Z", *dialect.angles), 1))


def row(location: Location, dialect: Dialect = VAL2) -> str:
    """A location's six numbers in columns."""
    lengths = isinstance(location, Transformation)
    return "".join(
        f"{fixed(value, 2 if lengths and index < 3 else 3):>{_COLUMN}}"
        for index, value in enumerate(dialect.numbers(location))
    )


def where(place: Where, dialect: Dialect = VAL2) -> list[str]:
    """WHERE: the tool, then the joints and the hand."""
    joints = row(place.joints)
    return [
        f"{heading(dialect)}{'HAND':>{_COLUMN}}",
        row(place.tool, dialect),
        f"{joints}{fixed(place.hand, 2):>{_COLUMN}}",
    ]


def values(known: Mapping[str, Value], dialect: Dialect = VAL2) -> list[str]:
    """LISTL, LISTR, LISTS: a line each; a location's long name has one of its own."""
    width, lines = max(map(len, known), default=0), []
    for name, value in known.items():
        if isinstance(value, float):
            lines.append(f"{name:{width}} = {number(value)}")
        elif isinstance(value, str):
            lines.append(f'{name:{width}} = "{visible(value)}"')
        else:
            shown = row(value, dialect)
            lines += [] if lines else [f"{'':15}{heading(dialect)}"]
            lines += [f"{name:15}{shown}"] if len(name) <= 15 else [name, f"{'':15}{shown}"]
    return lines


def visible(text: str) -> str:
    """A text on one line: characters that would move a terminal's cursor are shown as a dot."""
    return "".join(letter if letter.isprintable() else "·" for letter in text)


def table(rows: Sequence[Sequence[str]], *, indent: str = "") -> list[str]:
    """Rows in columns; the last column isn't padded."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        (indent + "  ".join(f"{cell:{width}}" for cell, width in zip(line, widths, strict=True))).rstrip()
        for line in rows
    ]


def in_columns(words: Iterable[str]) -> list[str]:
    """Words beside each other, in alphabetical order down the columns."""
    listed = sorted(words)
    if not listed:
        return []
    width = max(map(len, listed)) + 2
    many = max((WIDTH + 2) // width, 1)
    deep = -(-len(listed) // many)
    return ["".join(f"{word:{width}}" for word in listed[line::deep]).rstrip() for line in range(deep)]


def numbered(lines: Sequence[str], first: int = 1) -> list[str]:
    """A program's steps with their numbers."""
    return [f"{index:5}  {line}".rstrip() for index, line in enumerate(lines, first)]
