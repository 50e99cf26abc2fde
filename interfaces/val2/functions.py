"""Functions whose values are reals and strings, beyond plain arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from interfaces.val2 import arithmetic, formats
from interfaces.val2.arguments import arguments, reals
from interfaces.val2.arithmetic import truth, whole
from interfaces.val2.context import Context
from interfaces.val2.errors import ValError
from interfaces.val2.events import Warned
from interfaces.val2.expressions import Expressions, Functions, ResultKind, String
from interfaces.val2.forms import FUNCTIONS
from interfaces.val2.locations import FRAMES, frame_function, point_function
from interfaces.val2.memory import VariableSlot, where
from interfaces.val2.operations import Real, Slots, placed
from interfaces.val2.syntax import Apply, Format, Variable
from interfaces.val2.values import Value

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
    return lambda s: formats.leading_number(text(s))


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
        return formats.spelled(values)[0]

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
