"""How values, programs and tables are laid out on 80 columns, or fewer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from interfaces.val2.motion.places import Where
from interfaces.val2.printer import number
from interfaces.val2.values import VAL2, Dialect, Location, Transformation, Value

WIDTH = 79
"""Longest line, unless a terminal is narrower [characters]."""
_COLUMN = 9
_TABLE = 7 * _COLUMN
"""Width of a location's six numbers and the hand [characters]; a narrower terminal shows three of them a line."""
_HALF = 3 * _COLUMN
_NAME = 15


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


def folded(rows: Sequence[str], width: int) -> list[str]:
    """Rows of a location's numbers; on a narrow terminal the first three of each, then the others."""
    if width >= _TABLE:
        return list(rows)
    return [row[:_HALF] for row in rows] + [row[_HALF:] for row in rows]


def where(place: Where, dialect: Dialect = VAL2, width: int = WIDTH) -> list[str]:
    """WHERE: the tool, then the joints and the hand."""
    joints = row(place.joints)
    rows = [
        f"{heading(dialect)}{'HAND':>{_COLUMN}}",
        row(place.tool, dialect),
        f"{joints}{fixed(place.hand, 2):>{_COLUMN}}",
    ]
    return folded(rows, width)


def values(known: Mapping[str, Value], dialect: Dialect = VAL2, terminal: int = WIDTH) -> list[str]:
    """LISTL, LISTR, LISTS: a line each; a location's long name has one of its own."""
    width, lines = max(map(len, known), default=0), []
    for name, value in known.items():
        if isinstance(value, float):
            lines.append(f"{name:{width}} = {number(value)}")
        elif isinstance(value, str):
            lines.append(f'{name:{width}} = "{visible(value)}"')
        else:
            shown = row(value, dialect)
            if terminal < _NAME + _TABLE - _COLUMN:
                lines += [name, *folded([heading(dialect), shown], terminal)]
                continue
            lines += [] if lines else [f"{'':{_NAME}}{heading(dialect)}"]
            lines += [f"{name:{_NAME}}{shown}"] if len(name) <= _NAME else [name, f"{'':{_NAME}}{shown}"]
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


def in_columns(words: Iterable[str], terminal: int = WIDTH) -> list[str]:
    """Words beside each other, in alphabetical order down the columns."""
    listed = sorted(words)
    if not listed:
        return []
    width = max(map(len, listed)) + 2
    many = max((terminal + 2) // width, 1)
    deep = -(-len(listed) // many)
    return ["".join(f"{word:{width}}" for word in listed[line::deep]).rstrip() for line in range(deep)]


def numbered(lines: Sequence[str], first: int = 1) -> list[str]:
    """A program's steps with their numbers."""
    return [f"{index:5}  {line}".rstrip() for index, line in enumerate(lines, first)]
