"""What the operators and functions of VAL come to, of values.

Reals are floats, angles degrees, TRUE is -1; what can't be is an error, not a NaN. How functions are written is in
`forms.py`; those that take names, not values, are in `expressions.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from interfaces.val2.context import Context
from interfaces.val2.errors import ValError
from interfaces.val2.formats import checked, leading_number
from interfaces.val2.values import (
    NULL,
    Location,
    PrecisionPoint,
    Transformation,
    about_x,
    about_y,
    about_z,
    from_oat,
)

TRUE: Final = -1.0
FALSE: Final = 0.0
_WIDEST_WHOLE: Final = 2.0**53
_SINES: Final = {0.0: 0.0, 30.0: 0.5, 90.0: 1.0, 150.0: 0.5, 180.0: 0.0}
_COSINES: Final = {60.0: 0.5, 90.0: 0.0, 120.0: -0.5}
_STRAIGHT: Final = 1e-6
"""Shortest distance of FRAME's points [mm], and of the third from the axis."""


def truth(value: bool) -> float:
    """TRUE or FALSE."""
    return TRUE if value else FALSE


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


def root(value: float) -> float:
    """Square root."""
    if value < 0.0:
        raise ValError("Square root of a negative number", f"{value:.9g}")
    return math.sqrt(value)


BINARY: Final[dict[str, Callable[[float, float], float]]] = {
    "/": divide,
    "MOD": modulo,
    "^": power,
    "BAND": lambda a, b: float(whole(a) & whole(b)),
    "BOR": lambda a, b: float(whole(a) | whole(b)),
    "BXOR": lambda a, b: float(whole(a) ^ whole(b)),
}
"""Operators between reals, but for the frequent ones, relations and logic, which `expressions.py` has."""
UNARY: Final[dict[str, Callable[[float], float]]] = {
    "-": lambda a: -a,
    "NOT": lambda a: truth(a == 0.0),
    "COM": lambda a: float(~whole(a)),
}


def _bmask(*bits: float) -> float:
    value = 0
    for bit in map(whole, bits):
        if not 1 <= bit <= 32:
            raise ValError("Illegal value", f"bit {bit}: 1 to 32")
        value |= 1 << (bit - 1)
    return float(value)


def _asc(text: str, index: float) -> float:
    i = whole(index)
    return float(ord(text[i - 1])) if 1 <= i <= len(text) else -1.0


def _chr(code: float) -> str:
    n = whole(code)
    if not 0 <= n <= 255:
        raise ValError("Illegal value", f"{n}: 0 to 255")
    return chr(n)


def _mid(text: str, first: float, length: float) -> str:
    i, n = whole(first), whole(length)
    if i < 1 or n < 0:
        raise ValError("Illegal value", f"$MID from {i}, {n} characters")
    return text[i - 1 : i - 1 + n]


def _shift(frame: Transformation, *way: float) -> Transformation:
    X = np.array(frame.X)
    X[:3, 3] += way
    return Transformation(X)


def _frame(*frames: Transformation) -> Transformation:
    a, b, c, d = (frame.X[:3, 3] for frame in frames)
    along, aside = b - a, c - a
    n = np.linalg.norm(along)
    if n < _STRAIGHT:
        raise ValError("Illegal value", "FRAME: the first two points are one")
    u = along / n
    aside = aside - (aside @ u) * u
    n = np.linalg.norm(aside)
    if n < _STRAIGHT:
        raise ValError("Illegal value", "FRAME: three points on a line")
    v = aside / n
    X = np.eye(4)
    X[:3, 0], X[:3, 1], X[:3, 2], X[:3, 3] = u, v, np.cross(u, v), d
    return Transformation(X)


def _ppoint(*joints: float) -> PrecisionPoint:
    if any(math.fabs(j) > 1e6 for j in joints):
        raise ValError("Illegal value", "joints over 1000000 deg")
    return PrecisionPoint(joints)


OF_VALUES: Final[dict[str, Callable[..., Any]]] = {
    "ABS": abs,
    "ASC": _asc,
    "ATAN2": lambda y, x: math.degrees(math.atan2(y, x)),
    "BMASK": _bmask,
    "COS": cosine,
    "DISTANCE": lambda a, b: float(np.linalg.norm(a.X[:3, 3] - b.X[:3, 3])),
    "DX": lambda a: float(a.X[0, 3]),
    "DY": lambda a: float(a.X[1, 3]),
    "DZ": lambda a: float(a.X[2, 3]),
    "FALSE": lambda: FALSE,
    "FRACT": lambda a: math.fmod(a, 1.0),
    "FRAME": _frame,
    "INT": lambda a: float(math.trunc(a)),
    "INVERSE": Transformation.inverse,
    "LEN": lambda text: float(len(text)),
    "MAX": max,
    "MIN": min,
    "NULL": lambda: NULL,
    "OFF": lambda: FALSE,
    "ON": lambda: TRUE,
    "OUTSIDE": lambda low, value, high: truth(not low <= value <= high),
    "PI": lambda: math.pi,
    "POS": lambda text, part, first: float(text.find(part, max(0, whole(first) - 1)) + 1),
    "RX": about_x,
    "RY": about_y,
    "RZ": about_z,
    "SHIFT": _shift,
    "SIGN": lambda a: 1.0 if a >= 0.0 else -1.0,
    "SIN": sine,
    "SQR": lambda a: checked(a * a),
    "SQRT": root,
    "TAN": lambda angle: divide(sine(angle), cosine(angle)),
    "TRANS": from_oat,
    "TRUE": lambda: TRUE,
    "VAL": leading_number,
    "#PPOINT": _ppoint,
    "$CHR": _chr,
    "$MID": _mid,
    "$TRUNCATE": lambda text: text.partition("\0")[0],
}
"""Functions of their arguments' values alone."""


def _bits(c: Context, first: float, count: float) -> float:
    start, n = whole(first), whole(count)
    if not 1 <= n <= 32:
        raise ValError("Illegal value", f"{n}: 1 to 32 signals")
    return float(sum(c.signals.on(start + i) << i for i in range(n)))


def _speed(c: Context, which: float) -> float:
    if which != 1.0:
        raise ValError("Illegal value", "SPEED(1) is the monitor speed")
    return c.arm.monitor_speed()


def _inrange(c: Context, location: Location) -> float:
    return 0.0 if c.arm.reaches(location, now=c.now) else 1.0


OF_CONTEXT: Final[dict[str, Callable[..., Any]]] = {
    "BITS": _bits,
    "DEST": lambda c: c.arm.destination(now=c.now).tool,
    "HERE": lambda c: c.arm.here(now=c.now).tool,
    "INRANGE": _inrange,
    "RANDOM": lambda c: c.rng.random(),
    "SIG": lambda c, *numbers: truth(all(c.signals.on(n) for n in numbers)),
    "SPEED": _speed,
    "TIMER": lambda c, number: c.now - c.timers[c.timer(number)],
    "#DEST": lambda c: c.arm.destination(now=c.now).joints,
    "#HERE": lambda c: c.arm.here(now=c.now).joints,
}
"""Functions of signals, time and the arm, too."""
