"""Operators between reals, as closures."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeAlias

from interfaces.val2 import arithmetic
from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.memory import where

Slots: TypeAlias = list[Any]
"""Of a call: a `VariableSlot` for each name, then what FOR keeps."""
Real: TypeAlias = Callable[[Slots], float]

_QUICK: Final = frozenset("+-*")


def placed(error: ValError, at: TextPosition) -> ValError:
    """An error at a place, unless it has one."""
    return error.at(place=where(at))


def joined(symbol: str, a: Real, b: Real, at: TextPosition) -> Real:
    """A closure of two reals with an operator between them."""
    if symbol in _QUICK:
        return _quick(symbol, a, b, at)
    function = arithmetic.BINARY[symbol]

    def binary(s: Slots) -> float:
        left, right = a(s), b(s)
        try:
            return function(left, right)
        except ValError as error:
            raise placed(error, at) from None

    return binary


def _quick(symbol: str, a: Real, b: Real, at: TextPosition) -> Real:
    """The frequent operators, without a call in between."""

    def overflow() -> ValError:
        return ValError("Arithmetic overflow", place=where(at))

    def add(s: Slots) -> float:
        value = a(s) + b(s)
        if value - value == 0.0:
            return value
        raise overflow()

    def subtract(s: Slots) -> float:
        value = a(s) - b(s)
        if value - value == 0.0:
            return value
        raise overflow()

    def multiply(s: Slots) -> float:
        value = a(s) * b(s)
        if value - value == 0.0:
            return value
        raise overflow()

    return {"+": add, "-": subtract, "*": multiply}[symbol]
