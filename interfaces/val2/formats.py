"""The text of values in the formats of TYPE and $ENCODE, and numbers in texts.

Without a format a number has one leading blank and as many digits as it needs, seven at most unless it's whole;
`/F8.2` is a width and decimals, `/I5` a whole number, `/E12.3` with an exponent, `/G12.5` either, `/H4` and `/O6`
whole to the base of 16 and 8, `/D` as without. A width of 0, or none, is what the number needs; a number that is
too wide makes a field of `*`. A format holds until the next one. `/X3` is blanks, `/C2` line ends, `/B` the bell;
`/S` leaves out the line end of TYPE; `/U`, lines up, is passed over.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Final

from interfaces.val2.errors import ValError
from interfaces.val2.syntax import Format
from interfaces.val2.values import Dialect, Value

NUMBERS: Final = "DFGEIHO"
"""Formats of numbers."""
WIDEST: Final = 80
_DEFAULT: Final = Format("D")
_WHOLE: Final = 1e15
"""Numbers below it are exact where they're whole."""


def checked(value: float) -> float:
    """The value.

    Raises:
        ValError: If it's infinite or not a number.
    """
    if value - value == 0.0:
        return value
    raise ValError("Arithmetic overflow")


def number(value: float, form: Format = _DEFAULT) -> str:
    """A number in a format."""
    width = form.width or 0
    decimals = form.decimals if form.decimals is not None else 3
    match form.code:
        case "F":
            text = f"{_clean(value, decimals):.{decimals}f}"
        case "E":
            text = f"{value:.{decimals}E}"
        case "G":
            text = f"{value:.{max(decimals, 1)}G}"
        case "I":
            text = f"{_clean(value, 0):.0f}"
        case "H":
            text = f"{int(value):X}"
        case "O":
            text = f"{int(value):o}"
        case _:
            return " " + general(value)
    if width and len(text) > width:
        return "*" * width
    return text.rjust(width)


def general(value: float) -> str:
    """A number with the digits that it needs: whole ones exact, others to seven."""
    if value == int(value) and abs(value) < _WHOLE:
        return str(int(value))
    return f"{value:.7G}"


def _clean(value: float, decimals: int) -> float:
    """Without a minus before nothing but zeros."""
    return 0.0 if round(value, decimals) == 0.0 else value


def spelled(items: Sequence[Value | Format], dialect: Dialect) -> tuple[str, bool]:
    """The text of items, angles in a dialect's, and whether a line end belongs after it.

    Raises:
        ValError: If a format isn't one of these.
    """
    parts, form, ends = [], _DEFAULT, True
    for item in items:
        if not isinstance(item, Format):
            parts.append(_value(item, form, dialect))
            continue
        count = min(item.width if item.width is not None else 1, WIDEST)
        match item.code:
            case "S":
                ends = False
            case "C":
                parts.append("\n" * count)
            case "X":
                parts.append(" " * count)
            case "U":
                pass
            case "B":
                parts.append("\a")
            case code if code in NUMBERS:
                if (item.width or 0) > WIDEST or (item.decimals or 0) > WIDEST:
                    raise ValError("Illegal format", f"/{code}: {WIDEST} characters at most")
                form = item
            case code:
                raise ValError("Illegal format", f"/{code}: one of /B /C /S /X /{' /'.join(NUMBERS)}")
    return "".join(parts), ends


def _value(value: Value, form: Format, dialect: Dialect) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return number(value, form)
    return "".join(number(v, form) for v in dialect.numbers(value))


_NUMBER: Final = re.compile(r"\s*[+-]?(\d+(\.\d*)?|\.\d+)(E[+-]?\d+)?", re.IGNORECASE | re.ASCII)


def leading_number(text: str) -> float:
    """The number at the beginning of a text; 0 if there's none.

    Raises:
        ValError: If it's too large.
    """
    found = _NUMBER.match(text)
    value = float(found[0]) if found else 0.0
    return checked(value)


def whole_number(text: str) -> float | None:
    """The number that a text is, blanks around it apart; None if it's none."""
    found = _NUMBER.fullmatch(text.rstrip())
    value = float(found[0]) if found else math.inf
    return value if math.isfinite(value) else None
