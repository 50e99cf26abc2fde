"""Checks of values that many parts share."""

from __future__ import annotations

from collections.abc import Iterable

from vrs.commands import finite
from vrs.errors import InvalidValueError


def number_in(name: str, value: object, low: float, high: float, what: str = "a number", unit: str = "") -> float:
    """Return value as a float in [low, high].

    Args:
        name: What it's called, for the message.
        value: To be checked.
        low: Smallest allowed.
        high: Largest allowed.
        what: What it counts, before the range in the message.
        unit: What follows the range.

    Raises:
        InvalidValueError: If it is anything else.
    """
    allowed = f"{what} in [{low:g}, {high:g}]{unit}"
    number = finite(name, value, allowed)
    if not low <= number <= high:
        raise InvalidValueError(name, value, allowed)
    return number


def one_of(name: str, value: str, words: Iterable[str]) -> str:
    """Return value if it's one of some words.

    Args:
        name: What it's called, for the message.
        value: To be checked.
        words: What is allowed.

    Raises:
        InvalidValueError: If it isn't.
    """
    allowed = tuple(words)
    if value not in allowed:
        raise InvalidValueError(name, value, f"one of {', '.join(allowed)}")
    return value
