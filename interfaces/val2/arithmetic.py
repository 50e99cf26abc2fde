"""Arithmetic of VAL, and its operators as closures.

Reals are floats, angles degrees, TRUE is -1; what can't be is an error, not a NaN.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, TypeAlias

from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.memory import where

TRUE: Final = -1.0
FALSE: Final = 0.0
_WIDEST_WHOLE: Final = 2.0**53
_SINES: Final = {0.0: 0.0, 30.0: 0.5, 90.0: 1.0, 150.0: 0.5, 180.0: 0.0}
_COSINES: Final = {60.0: 0.5, 90.0: 0.0, 120.0: -0.5}


def truth(value: bool) -> float:
    """TRUE or FALSE."""
    return TRUE if value else FALSE


def checked(value: float) -> float:
    """The value.

    Raises:
        ValError: If it's infinite or not a number.
    """
    if value - value == 0.0:
        return value
    raise ValError("Arithmetic overflow")


def whole(value: float) -> int:
    """The integer part.

    Raises:
        ValError: If it's too large to be exact.
    """
    if abs(value) < _WIDEST_WHOLE:
        return int(value)
    raise ValError("Illegal value", f"{value:.9g}: whole numbers to 2 ^ 53")


def divide(a: float, b: float) -> float:
    """Quotient."""
    if b == 0.0:
        raise ValError("Division by zero")
    return checked(a / b)


def modulo(a: float, b: float) -> float:
    """Remainder of the division whose quotient is cut to a whole number; it has the dividend's sign."""
    if b == 0.0:
        raise ValError("Division by zero")
    return math.fmod(a, b)


def power(a: float, b: float) -> float:
    """A to the power of b."""
    try:
        return math.pow(a, b)
    except OverflowError:
        raise ValError("Arithmetic overflow") from None
    except ValueError:
        if a == 0.0:
            raise ValError("Division by zero", "0 to a negative power") from None
        raise ValError("Illegal value", "a negative number to a broken power") from None


def sine(angle: float) -> float:
    """Sine of an angle [deg], exact at right angles."""
    turned = math.remainder(angle, 360.0)
    exact = _SINES.get(abs(turned))
    return math.sin(math.radians(turned)) if exact is None else math.copysign(exact, turned) + 0.0


def cosine(angle: float) -> float:
    """Cosine of an angle [deg], exact at right angles."""
    turned = abs(math.remainder(angle, 360.0))
    exact = _COSINES.get(turned)
    return math.cos(math.radians(turned)) if exact is None else exact


def tangent(angle: float) -> float:
    """Tangent of an angle [deg]."""
    return divide(sine(angle), cosine(angle))


def root(value: float) -> float:
    """Square root."""
    if value < 0.0:
        raise ValError("Square root of a negative number", f"{value:.9g}")
    return math.sqrt(value)


BINARY: Final[dict[str, Callable[[float, float], float]]] = {
    "+": lambda a, b: checked(a + b),
    "-": lambda a, b: checked(a - b),
    "*": lambda a, b: checked(a * b),
    "/": divide,
    "MOD": modulo,
    "^": power,
    "BAND": lambda a, b: float(whole(a) & whole(b)),
    "BOR": lambda a, b: float(whole(a) | whole(b)),
    "BXOR": lambda a, b: float(whole(a) ^ whole(b)),
}
UNARY: Final[dict[str, Callable[[float], float]]] = {
    "-": lambda a: -a,
    "+": lambda a: a,
    "NOT": lambda a: truth(a == 0.0),
    "COM": lambda a: float(~whole(a)),
}
FUNCTIONS: Final[dict[str, tuple[Callable[..., float], int, int]]] = {
    "ABS": (abs, 1, 1),
    "ATAN2": (lambda y, x: math.degrees(math.atan2(y, x)), 2, 2),
    "COS": (cosine, 1, 1),
    "FALSE": (lambda: FALSE, 0, 0),
    "FRACT": (lambda a: math.fmod(a, 1.0), 1, 1),
    "INT": (lambda a: float(math.trunc(a)), 1, 1),
    "MAX": (max, 1, 64),
    "MIN": (min, 1, 64),
    "OFF": (lambda: FALSE, 0, 0),
    "ON": (lambda: TRUE, 0, 0),
    "OUTSIDE": (lambda low, value, high: truth(not low <= value <= high), 3, 3),
    "PI": (lambda: math.pi, 0, 0),
    "SIGN": (lambda a: 1.0 if a >= 0.0 else -1.0, 1, 1),
    "SIN": (sine, 1, 1),
    "SQR": (lambda a: checked(a * a), 1, 1),
    "SQRT": (root, 1, 1),
    "TAN": (tangent, 1, 1),
    "TRUE": (lambda: TRUE, 0, 0),
}
"""Functions of reals alone, with how many arguments they take."""


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
    function = BINARY[symbol]

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
