"""Checks of values that many parts share."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from vrs.errors import InvalidValueError
from vrs.model import Array, frozen_array

LARGEST = 1e9
"""Size of the largest value that a command may ask for, in any unit: squares and products are far from overflow."""
SMALLEST = sys.float_info.min
"""Size of the smallest number besides 0 [2.2e-308]; what is divided by a subnormal one overflows."""


def finite(name: str, value: object, allowed: str = "a finite number") -> float:
    """Return value as a float.

    Raises:
        InvalidValueError: If value is not a real number, or NaN or infinite.
    """
    if type(value) is float and math.isfinite(value):
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InvalidValueError(name, value, allowed)
    try:
        number = float(value)
    except OverflowError:
        raise InvalidValueError(name, value, allowed) from None
    if not math.isfinite(number):
        raise InvalidValueError(name, value, allowed)
    return number


def normal(value: float) -> float:
    """The same number; 0 where it's subnormal."""
    return 0.0 if 0.0 < abs(value) < SMALLEST else value


def finite_array(name: str, value: ArrayLike, shape: tuple[int, ...] | None, allowed: str) -> Array:
    """Copy value into a read-only array of finite numbers of the given shape.

    Raises:
        InvalidValueError: If it holds anything else.
    """
    try:
        raw = np.asarray(value)
    except ValueError:
        raise InvalidValueError(name, value, allowed) from None
    if raw.dtype.kind not in "iuf" or (shape is not None and raw.shape != shape):
        raise InvalidValueError(name, value, allowed)
    array = frozen_array(raw)
    if not np.isfinite(array).all():
        raise InvalidValueError(name, value, allowed)
    return array


def sized_array(
    name: str, value: ArrayLike, shape: tuple[int, ...] | None, allowed: str, *, largest: float = LARGEST
) -> Array:
    """Copy what a command asks for: as `finite_array`, within ±`largest`, and a subnormal number counts as 0.

    Raises:
        InvalidValueError: If it holds anything else.
    """
    array = finite_array(name, value, shape, allowed)
    size = np.abs(array)
    if (size > largest).any():
        raise InvalidValueError(name, value, f"{allowed}, within ±{largest:g}")
    subnormal = (size > 0.0) & (size < SMALLEST)
    return frozen_array(np.where(subnormal, 0.0, array)) if subnormal.any() else array


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


def integer_in(name: str, value: object, low: int, high: int) -> int:
    """Return value as an integer in [low, high].

    Args:
        name: What it's called, for the message.
        value: To be checked.
        low: Smallest allowed.
        high: Largest allowed.

    Raises:
        InvalidValueError: If it is anything else.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise InvalidValueError(name, value, f"an integer in [{low}, {high}]")
    return value


def one_of(name: str, value: str, words: Iterable[str], *more: str) -> str:
    """Return value if it's one of some words.

    Args:
        name: What it's called, for the message.
        value: To be checked.
        words: What is allowed.
        *more: What else is, elsewhere, for the message.

    Raises:
        InvalidValueError: If it isn't.
    """
    allowed = tuple(words)
    if value not in allowed:
        raise InvalidValueError(name, value, f"one of {', '.join((*allowed, *more))}")
    return value
