"""Functions of the language as closures: those whose values are locations, reals and strings.

Plain arithmetic is in `arithmetic.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from interfaces.val2 import arithmetic, dialogue
from interfaces.val2.arithmetic import Real, Slots, placed, truth, whole
from interfaces.val2.context import Context, Warned
from interfaces.val2.errors import ValError
from interfaces.val2.expressions import Expressions, Frame, Functions, ResultKind, String
from interfaces.val2.forms import FUNCTIONS
from interfaces.val2.memory import VariableSlot, where
from interfaces.val2.syntax import Apply, Expression, Format, Variable
from interfaces.val2.values import NULL, PrecisionPoint, Transformation, Value, about_x, about_y, about_z, from_oat


def arguments(e: Apply, least: int, most: int) -> list[Expression | None]:
    """The arguments, filled up with None.

    Raises:
        ValError: If there are too few or too many.
    """
    given = [None if isinstance(a, Format) else a for a in e.arguments]
    if len(given) > most or len(given) < least or any(a is None for a in given[:least]):
        counts = f"{least}" if least == most else f"{least} to {most}"
        raise ValError("Missing argument" if len(given) <= most else "Too many arguments",
                       f"{e.function} takes {counts}", place=where(e.at))  # fmt: skip
    return given + [None] * (most - len(given))


def reals(x: Expressions, e: Apply, least: int, most: int, *, otherwise: float = 0.0) -> list[Real]:
    """The arguments, reals all; those that were left out are `otherwise`."""
    return [x.real(a) if a is not None else (lambda _: otherwise) for a in arguments(e, least, most)]


_STRAIGHT: Final = 1e-6
"""Shortest distance of FRAME's points [mm], and of the third from the axis."""
_POSE: Final = (0.0, 0.0, 0.0, 90.0, -90.0, 0.0)
"""What TRANS takes for what is left out: no translation, no turn."""


def frame_function(x: Expressions, e: Apply) -> Frame:
    """A closure of a function whose value is a transformation.

    Raises:
        ValError: If its arguments aren't what it takes.
    """
    inner, at = FRAMES[e.function](x, e), e.at

    def function(s: Slots) -> Transformation:
        try:
            return inner(s)
        except ValError as error:
            raise placed(error, at) from None

    return function


def _trans(x: Expressions, e: Apply) -> Frame:
    given = zip(arguments(e, 0, 6), _POSE, strict=True)
    parts: list[Real] = [x.real(a) if a is not None else (lambda _, v=v: v) for a, v in given]  # type: ignore[misc]
    return lambda s: from_oat(*[p(s) for p in parts])


def _shift(x: Expressions, e: Apply) -> Frame:
    location, *by = arguments(e, 1, 4)
    assert location is not None
    frame = x.transformation(location)
    parts = [x.real(a) if a is not None else (lambda _: 0.0) for a in by]

    def shift(s: Slots) -> Transformation:
        X = np.array(frame(s).X)
        X[:3, 3] += [p(s) for p in parts]
        return Transformation(X)

    return shift


def _inverse(x: Expressions, e: Apply) -> Frame:
    (location,) = arguments(e, 1, 1)
    assert location is not None
    frame = x.transformation(location)
    return lambda s: frame(s).inverse()


def _frame(x: Expressions, e: Apply) -> Frame:
    frames = [x.transformation(a) for a in arguments(e, 4, 4) if a is not None]

    def frame(s: Slots) -> Transformation:
        a, b, c, d = (f(s).X[:3, 3] for f in frames)
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

    return frame


def _turn(about: Callable[[float], Transformation]) -> Callable[[Expressions, Apply], Frame]:
    def make(x: Expressions, e: Apply) -> Frame:
        (angle,) = reals(x, e, 1, 1)
        return lambda s: about(angle(s))

    return make


def _standing(pose: Callable[[Expressions], Transformation]) -> Callable[[Expressions, Apply], Frame]:
    def make(x: Expressions, e: Apply) -> Frame:
        arguments(e, 0, 0)
        return lambda _: pose(x)

    return make


FRAMES: Final[dict[str, Callable[[Expressions, Apply], Frame]]] = {
    "DEST": _standing(lambda x: x.context.arm.destination(now=x.context.now).tool),
    "FRAME": _frame,
    "HERE": _standing(lambda x: x.context.arm.here(now=x.context.now).tool),
    "INVERSE": _inverse,
    "NULL": _standing(lambda _: NULL),
    "RX": _turn(about_x),
    "RY": _turn(about_y),
    "RZ": _turn(about_z),
    "SHIFT": _shift,
    "TRANS": _trans,
}


def point_function(x: Expressions, e: Apply) -> Callable[[Slots], PrecisionPoint]:
    """A closure of a function whose value is a precision point: #PPOINT, or where the arm is or goes.

    Raises:
        ValError: If it's none, or its arguments aren't what it takes.
    """
    context = x.context
    match e.function.lstrip("#"):
        case "PPOINT":
            parts = reals(x, e, 0, 6)

            def point(s: Slots) -> PrecisionPoint:
                joints = tuple([p(s) for p in parts])
                if any(math.fabs(j) > 1e6 for j in joints):
                    raise ValError("Illegal value", "joints over 1000000 deg", place=where(e.at))
                return PrecisionPoint(joints)

            return point
        case "HERE":
            return lambda _: context.arm.here(now=context.now).joints
        case "DEST":
            return lambda _: context.arm.destination(now=context.now).joints
        case _:
            raise ValError("Invalid expression", "a precision point was expected", place=where(e.at))


# Reals.


def real_function(x: Expressions, e: Apply) -> Real:
    """A closure of a function whose value is a real.

    Raises:
        ValError: If there's none of this name, or its arguments aren't what it takes.
    """
    make = REALS.get(e.function)
    if make is not None:
        inner = make(x, e)
    elif e.function in arithmetic.FUNCTIONS:
        inner = _plain(x, e)
    else:
        what = "Invalid expression" if e.function in RESULTS else "Undefined function"
        raise ValError(what, e.function, place=where(e.at))
    at = e.at

    def function(s: Slots) -> float:
        try:
            return inner(s)
        except ValError as error:
            raise placed(error, at) from None

    return function


def _plain(x: Expressions, e: Apply) -> Real:
    function, least, most = arithmetic.FUNCTIONS[e.function]
    parts = [x.real(a) for a in arguments(e, least, most) if a is not None]
    if not parts:
        value = function()
        return lambda _: value
    if len(parts) == 1:
        a = parts[0]
        return lambda s: function(a(s))
    return lambda s: function(*[p(s) for p in parts])


def _sig(x: Expressions, e: Apply) -> Real:
    parts = [x.real(a) for a in arguments(e, 1, max(1, len(e.arguments))) if a is not None]
    signals = x.context.signals
    return lambda s: truth(all(signals.on(p(s)) for p in parts))


def _bits(x: Expressions, e: Apply) -> Real:
    first, count = reals(x, e, 1, 2, otherwise=1.0)
    signals = x.context.signals

    def bits(s: Slots) -> float:
        start, n = whole(first(s)), whole(count(s))
        if not 1 <= n <= 32:
            raise ValError("Illegal value", f"{n}: 1 to 32 signals")
        return float(sum(signals.on(start + i) << i for i in range(n)))

    return bits


def _timer(x: Expressions, e: Apply) -> Real:
    (number,) = reals(x, e, 1, 1)
    context = x.context
    return lambda s: context.now - context.timers[context.timer(number(s))]


def _random(x: Expressions, e: Apply) -> Real:
    arguments(e, 0, 0)
    return lambda _: x.context.rng.random()


def _defined(x: Expressions, e: Apply) -> Real:
    (variable,) = arguments(e, 1, 1)
    if not isinstance(variable, Variable):
        raise ValError("Invalid expression", "DEFINED takes a name", place=where(e.at))
    found = x.found(variable)

    def defined(s: Slots) -> float:
        slot = found(s)
        return truth(slot is not None and slot.defined())

    return defined


def _last(x: Expressions, e: Apply) -> Real:
    (variable,) = arguments(e, 1, 1)
    if not isinstance(variable, Variable) or variable.indices:
        raise ValError("Invalid expression", "LAST takes an array", place=where(e.at))
    found = x.found(variable)

    def last(s: Slots) -> float:
        slot = found(s)
        keys = [k for k, v in ((slot and slot.elements) or {}).items() if v.value is not None]
        return float(max((k if isinstance(k, int) else k[0] for k in keys), default=-1))

    return last


def _component(i: int) -> Callable[[Expressions, Apply], Real]:
    def make(x: Expressions, e: Apply) -> Real:
        (location,) = arguments(e, 1, 1)
        assert location is not None
        frame = x.transformation(location)
        return lambda s: float(frame(s).X[i, 3])

    return make


def _distance(x: Expressions, e: Apply) -> Real:
    a, b = (x.transformation(p) for p in arguments(e, 2, 2) if p is not None)
    return lambda s: float(np.linalg.norm(a(s).X[:3, 3] - b(s).X[:3, 3]))


def _inrange(x: Expressions, e: Apply) -> Real:
    (given,) = arguments(e, 1, 1)
    assert given is not None
    context, location = x.context, x.location(given)
    return lambda s: 0.0 if context.arm.reaches(location(s), now=context.now) else 1.0


def _bmask(x: Expressions, e: Apply) -> Real:
    parts = reals(x, e, 1, max(1, len(e.arguments)))

    def mask(s: Slots) -> float:
        value = 0
        for part in parts:
            bit = whole(part(s))
            if not 1 <= bit <= 32:
                raise ValError("Illegal value", f"bit {bit}: 1 to 32")
            value |= 1 << (bit - 1)
        return float(value)

    return mask


def _idle(x: Expressions, e: Apply) -> Real:
    """Of files and other tasks: 0, with a warning."""
    warning = Warned(f"{e.function} has no meaning here")

    def nothing(_: Slots) -> float:
        x.context.warn(warning)
        return 0.0

    return nothing


def _idle_string(x: Expressions, e: Apply) -> String:
    nothing = _idle(x, e)
    return lambda s: "\0" * int(nothing(s))


def _speed(x: Expressions, e: Apply) -> Real:
    (number,) = reals(x, e, 0, 1, otherwise=1.0)

    def speed(s: Slots) -> float:
        if number(s) != 1.0:
            raise ValError("Illegal value", "SPEED(1) is the monitor speed")
        return x.context.arm.monitor_speed()

    return speed


def _named(e: Apply) -> str:
    (name,) = arguments(e, 1, 1)
    if not isinstance(name, Variable):
        raise ValError("Invalid expression", f"{e.function} takes a name", place=where(e.at))
    return name.name.upper()


def _switch(x: Expressions, e: Apply) -> Real:
    name, switches = _named(e), x.context.switches
    if name not in switches:
        raise ValError("Unknown switch", name, place=where(e.at))
    return lambda _: truth(switches[name])


def _parameter(x: Expressions, e: Apply) -> Real:
    name, parameters = _named(e), x.context.parameters
    if name not in parameters:
        raise ValError("Unknown parameter", name, place=where(e.at))
    return lambda _: parameters[name]


def _texts(x: Expressions, e: Apply, least: int, most: int, strings: int) -> tuple[list[String], list[Real]]:
    parts = arguments(e, least, most)
    texts = [x.string(p) for p in parts[:strings] if p is not None]
    return texts, [x.real(p) if p is not None else (lambda _: 1.0) for p in parts[strings:]]


def _len(x: Expressions, e: Apply) -> Real:
    (text,), _ = _texts(x, e, 1, 1, 1)
    return lambda s: float(len(text(s)))


def _asc(x: Expressions, e: Apply) -> Real:
    (text,), (position,) = _texts(x, e, 1, 2, 1)

    def asc(s: Slots) -> float:
        value, i = text(s), whole(position(s))
        if not 1 <= i <= len(value):
            return -1.0
        return float(ord(value[i - 1]))

    return asc


def _val(x: Expressions, e: Apply) -> Real:
    (text,), _ = _texts(x, e, 1, 1, 1)
    return lambda s: dialogue.leading_number(text(s))


def _pos(x: Expressions, e: Apply) -> Real:
    (text, part), (first,) = _texts(x, e, 2, 3, 2)
    return lambda s: float(text(s).find(part(s), max(0, whole(first(s)) - 1)) + 1)


REALS: Final[dict[str, Callable[[Expressions, Apply], Real]]] = {
    "ASC": _asc, "BITS": _bits, "BMASK": _bmask, "DEFINED": _defined, "DISTANCE": _distance, "DX": _component(0),
    "DY": _component(1), "DZ": _component(2), "INRANGE": _inrange, "LAST": _last, "LEN": _len,
    "PARAMETER": _parameter,
    "POS": _pos, "RANDOM": _random, "SIG": _sig, "SPEED": _speed, "SWITCH": _switch, "TIMER": _timer, "VAL": _val,
    **dict.fromkeys((name for name, f in FUNCTIONS.items() if f.idle and f.gives == "real"), _idle),
}  # fmt: skip
"""What functions that give reals are made by, but for those of `arithmetic`."""


# Strings.


def string_function(x: Expressions, e: Apply) -> String:
    """A closure of a function whose value is a string.

    Raises:
        ValError: If its arguments aren't what it takes.
    """
    inner, at = _STRING[e.function](x, e), e.at

    def function(s: Slots) -> str:
        try:
            return inner(s)
        except ValError as error:
            raise placed(error, at) from None

    return function


def _chr(x: Expressions, e: Apply) -> String:
    (code,) = reals(x, e, 1, 1)

    def character(s: Slots) -> str:
        n = whole(code(s))
        if not 0 <= n <= 255:
            raise ValError("Illegal value", f"{n}: 0 to 255")
        return chr(n)

    return character


def _mid(x: Expressions, e: Apply) -> String:
    parts = arguments(e, 2, 3)
    assert parts[0] is not None
    assert parts[1] is not None
    text, first = x.string(parts[0]), x.real(parts[1])
    count = x.real(parts[2]) if parts[2] is not None else None

    def middle(s: Slots) -> str:
        value, i = text(s), whole(first(s))
        n = len(value) if count is None else whole(count(s))
        if i < 1 or n < 0:
            raise ValError("Illegal value", f"$MID from {i}, {n} characters")
        return value[i - 1 : i - 1 + n]

    return middle


def _encode(x: Expressions, e: Apply) -> String:
    items = [a if isinstance(a, Format) else x.value(a) for a in e.arguments if a is not None]

    def encode(s: Slots) -> str:
        values: list[Value | Format] = [i if isinstance(i, Format) else i(s) for i in items]
        return dialogue.spelled(values)[0]

    return encode


def _decode(x: Expressions, e: Apply) -> String:
    source, breaks, mode = arguments(e, 2, 3)
    if not isinstance(source, Variable) or breaks is None:
        raise ValError("Invalid expression", "$DECODE takes a string variable first", place=where(e.at))
    read, slot, marks = x.string(source), x.reference(source), x.string(breaks)
    skip = x.real(mode) if mode is not None else (lambda _: 0.0)

    def decode(s: Slots) -> str:
        text, ends, marked = read(s), marks(s), skip(s) > 0.0
        n = next((i for i, c in enumerate(text) if (c in ends) != marked), len(text))
        slot(s).value = text[n:]
        return text[:n]

    return decode


def _truncate(x: Expressions, e: Apply) -> String:
    (text,), _ = _texts(x, e, 1, 1, 1)
    return lambda s: text(s).partition("\0")[0]


_STRING: Final[dict[str, Callable[[Expressions, Apply], String]]] = {
    "$CHR": _chr, "$DECODE": _decode, "$ENCODE": _encode, "$MID": _mid, "$TRUNCATE": _truncate,
    **dict.fromkeys((name for name, f in FUNCTIONS.items() if f.idle and f.gives == "string"), _idle_string),
}  # fmt: skip


RESULTS: Final[dict[str, ResultKind]] = {
    **dict.fromkeys(_STRING, ResultKind.STRING),
    **dict.fromkeys(FRAMES, ResultKind.TRANSFORMATION),
    **dict.fromkeys(("#PPOINT", "#HERE", "#DEST"), ResultKind.POINT),
}
"""What functions give that aren't reals."""

ALL: Final = Functions(RESULTS, real_function, string_function, frame_function, point_function)
"""The functions of VAL-II."""


def expressions(context: Context, scope: dict[str, int | VariableSlot] | None = None) -> Expressions:
    """What makes closures of VAL-II's expressions; see `Expressions`."""
    return Expressions(context, ALL, scope)
