"""The functions, constants and operators of VAL: how they're written, and what they come to, of values.

Reals are floats, angles degrees, TRUE is -1; what can't be is an error, not a NaN. Those that take names, not
values, are carried out in `expressions.py`.
"""

from __future__ import annotations

import math
import operator
import struct
from collections.abc import Callable
from typing import Final

import numpy as np

from interfaces.val2.context import Context
from interfaces.val2.errors import ValError
from interfaces.val2.formats import checked, leading_number
from interfaces.val2.motion.places import shifted
from interfaces.val2.rows import Form, numbered
from interfaces.val2.signals import group
from interfaces.val2.syntax import Apply
from interfaces.val2.units import MESSAGES
from interfaces.val2.values import (
    NULL,
    Dialect,
    PrecisionPoint,
    Transformation,
    about_x,
    about_y,
    about_z,
)

TRUE: Final = -1.0
_WIDEST_WHOLE: Final = 2.0**53
_SINES: Final = {0.0: 0.0, 30.0: 0.5, 90.0: 1.0, 150.0: 0.5, 180.0: 0.0}
_COSINES: Final = {60.0: 0.5, 90.0: 0.0, 120.0: -0.5}
_STRAIGHT: Final = 1e-6
"""Shortest distance of FRAME's points [mm], and of the third from the axis."""


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


def _trans(dialect: Dialect, x: float, y: float, z: float, *angles: float | None) -> Transformation:
    """Angles that were left out are those of no turn."""
    o, a, t = (none if angle is None else angle for angle, none in zip(angles, dialect.offsets, strict=True))
    return dialect.transformation(x, y, z, o, a, t)


def _scale(frame: Transformation, factor: float) -> Transformation:
    X = np.array(frame.X)
    X[:3, 3] *= factor
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


def _of_bits(act: Callable[[int, int], int]) -> Callable[[float, float], float]:
    return lambda a, b: float(act(whole(a), whole(b)))


def _bits(c: Context, first: float, count: float) -> float:
    return float(sum(c.signals.on(number) << i for i, number in enumerate(group(first, count))))


def _speed(c: Context, which: float) -> float:
    if which != 1.0:
        raise ValError("Illegal value", "SPEED(1) is the monitor speed")
    return c.arm.monitor_speed()


def _state(c: Context, select: float) -> float:
    """STATE; of V+'s numbers those that can be here.

    STATE(1) is 7 under a program's control, 2 without power. STATE(2) is 0 before a motion, 1 on one, 2 at its end,
    5 while it's braked, and 6 then.
    """
    if select == 1.0:
        return 7.0 if c.switches["POWER"] else 2.0
    if select != 2.0:
        raise ValError("Illegal value", f"STATE({select:.9g}): 1 is of the robot, 2 of its motion")
    if not c.moved:
        return 0.0
    return (5.0 if c.braked else 1.0) + c.arm.settled(now=c.now)


def _bytes(layout: str, value: float) -> str:
    try:
        return struct.pack(layout, value).decode("latin-1")
    except (struct.error, OverflowError):
        raise ValError("Illegal value", f"{value:.9g}: four characters hold less") from None


def _of_bytes(layout: str, text: str, first: float) -> float:
    i = whole(first) - 1
    piece = text[i : i + 4].encode("latin-1", errors="replace") if i >= 0 else b""
    if len(piece) < 4:
        raise ValError("Illegal value", f"four characters from {i + 1} on are wanted; the string has {len(text)}")
    return checked(float(struct.unpack(layout, piece)[0]))


def _task(c: Context, select: float, number: float) -> float:
    if select not in (0.0, 1.0):
        raise ValError("Illegal value", f"TASK({select:.9g}): 0 is this task's number, 1 a task's state")
    return c.task_state(numbered("task", number)) if select else float(c.task.number if c.task is not None else 0)


def _status(c: Context, program: str) -> float:
    """Of several tasks the state of the one that does most."""
    name = program.lower()
    return max((c.task_state(n) for n, task in c.tasks.items() if task.program == name), default=0.0)


def _error(c: Context, code: float | None) -> str:
    if code is not None:
        return MESSAGES.get(whole(code), f"*Error {code:.9g}*")
    last = c.task.error if c.task is not None else None
    return "" if last is None else str(ValError(last.what, last.detail))


_FUNCTIONS: Final = (
    # Of numbers.
    Form("ABS", "x -> real", "Absolute value.", "VAL-II", abs),
    Form("ASC", "text:string, index?=1 -> real", "Code of a character.", "VAL-II", _asc),
    Form("ATAN2", "y, x -> real", "Angle of a direction [deg].", "VAL-II",
         lambda y, x: math.degrees(math.atan2(y, x))),
    Form("BMASK", "bit*=0 -> real", "A number with these bits set, from 1.", "V+", _bmask),
    Form("BITS", "first, count?=1 -> real", "Signals from a first one on, as a number.", "V+", _bits,
         tags="context"),
    Form("COS", "angle -> real", "Cosine of an angle [deg].", "VAL-II", cosine),
    Form("DEFINED", "variable:name -> real", "Whether a variable has a value.", "V+"),
    Form("ADC", "channel:channel -> real", "Value of an analogue input.", "VAL-II",
         lambda c, n: c.channels["ADC"][numbered("channel", n)], tags="context reading"),
    Form("DISTANCE", "a:frame, b:frame -> real", "Distance of two locations [mm].", "VAL-II",
         lambda a, b: float(np.linalg.norm(a.X[:3, 3] - b.X[:3, 3]))),
    Form("DX", "a:frame -> real", "X of a location [mm].", "VAL-II", lambda a: float(a.X[0, 3])),
    Form("DY", "a:frame -> real", "Y of a location [mm].", "VAL-II", lambda a: float(a.X[1, 3])),
    Form("DZ", "a:frame -> real", "Z of a location [mm].", "VAL-II", lambda a: float(a.X[2, 3])),
    Form("FRACT", "x -> real", "Fractional part.", "VAL-II", lambda x: math.fmod(x, 1.0)),
    Form("HAND", "-> real", "Opening of the hand [mm], where no variable is called so.", "VAL-II",
         lambda c: c.arm.here(now=c.now).hand, usage="HAND", tags="context unreserved reading"),
    Form("IDENTICAL", "a:location, b:location -> truth", "Whether two locations are the same.", "VAL-II",
         lambda a, b: a == b, tags="reading"),
    Form("IOGET", "port:channel -> real", "Value of a port.", "VAL-II",
         lambda c, n: c.channels["IOGET"][numbered("channel", n)], tags="context reading"),
    Form("INRANGE", "a:location -> real", "0 if a location can be reached.", "V+",
         lambda c, location: 0.0 if c.arm.reaches(location, now=c.now) else 1.0, tags="context"),
    Form("INT", "x -> real", "Integer part.", "VAL-II", lambda x: float(math.trunc(x))),
    Form("LAST", "array:array -> real", "Largest index of an array.", "V+"),
    Form("LEN", "text:string -> real", "Length of a string.", "VAL-II", lambda text: float(len(text))),
    Form("MAX", "x* -> real", "Largest of values.", "V+", max),
    Form("MIN", "x* -> real", "Smallest of values.", "V+", min),
    Form("OUTSIDE", "low, x, high -> truth", "Whether a value is outside a range.", "V+",
         lambda low, x, high: not low <= x <= high),
    Form("PARAMETER", "name:name -> real", "Value of a parameter.", "V+"),
    Form("PI", "-> real", "Half a turn in radians: 3.14159..", "VAL-II", lambda: math.pi, tags="constant"),
    Form("POS", "text:string, part:string, from?=1 -> real", "Where a string has another; 0 for nowhere.", "V+",
         lambda text, part, first: float(text.find(part, max(0, whole(first) - 1)) + 1)),
    Form("RANDOM", "-> real", "A random number from 0 to 1.", "V+", lambda c: c.rng.random(),
         tags="constant context"),
    Form("SIG", "number:signal* -> truth", "Whether all these signals are on, or off where negative.", "VAL-II",
         lambda c, *numbers: all(c.signals.on(n) for n in numbers), tags="context"),
    Form("SIGN", "x -> real", "-1 of a negative number, 1 of any other.", "VAL-II",
         lambda x: 1.0 if x >= 0.0 else -1.0),
    Form("SIN", "angle -> real", "Sine of an angle [deg].", "VAL-II", sine),
    Form("SPEED", "which -> real", "1: the monitor speed [%].", "V+", _speed, tags="context"),
    Form("SQR", "x -> real", "Square.", "V+", lambda x: checked(x * x)),
    Form("SQRT", "x -> real", "Square root.", "VAL-II", root),
    Form("STATE", "select -> real", "State of the robot (1), of its motion (2).", "V+", _state, tags="context"),
    Form("SWITCH", "name:name -> real", "Whether a switch is on.", "V+"),
    Form("TAN", "angle -> real", "Tangent of an angle [deg].", "V+",
         lambda angle: divide(sine(angle), cosine(angle))),
    Form("TIME", "-> real", "Session time [s], where no variable is called so.", "VAL-II", lambda c: c.now,
         usage="TIME", tags="context unreserved reading"),
    Form("TIMER", "number -> real", "Seconds since a timer was set to 0.", "VAL-II",
         lambda c, number: c.now - c.timers[numbered("timer", number)], tags="context"),
    Form("VAL", "text:string -> real", "The number that a string begins with.", "VAL-II", leading_number),
    Form("TRUE", "-> real", "What holds: -1.", "VAL-II", lambda: TRUE, tags="constant"),
    Form("FALSE", "-> real", "What doesn't hold: 0.", "VAL-II", lambda: 0.0, tags="constant"),
    Form("ON", "-> real", "What holds, as TRUE: -1.", "VAL-II", lambda: TRUE, tags="constant"),
    Form("OFF", "-> real", "What doesn't hold, as FALSE: 0.", "VAL-II", lambda: 0.0, tags="constant"),
    # Strings.
    Form("$CHR", "code -> string", "The character of a code.", "VAL-II", _chr),
    Form("$DECODE", "$variable:variable, separators:string, mode?=0 -> string",
         "What stands before, or with mode 1 the run of, separators; it's taken out of the variable.", "V+"),
    Form("$ENCODE", "item:any?* -> string", "What TYPE would print.", "VAL-II"),
    Form("$MID", "text:string, from, length -> string", "Part of a string.", "VAL-II", _mid),
    Form("$TRUNCATE", "text:string -> string", "A string up to its first character of code 0.", "V+",
         lambda text: text.partition("\0")[0]),
    Form("$UNPACK", "$array:variable, first, count -> string",
         "Part of a text that an array's elements hold one after the other.", "VAL-II",
         usage="$UNPACK($array[index], first, count)", tags="reading"),
    # Locations.
    Form("TRANS", "x?=0, y?=0, z?=0, o?, a?, t? -> frame",
         "A transformation [mm, deg], in V+ by yaw, pitch, roll; without angles, no turn.", "VAL-II", _trans,
         tags="dialect"),
    Form("SHIFT", "a:frame, dx?=0, dy?=0, dz?=0 -> frame", "A location shifted in world axes [mm].", "VAL-II",
         shifted, usage="SHIFT(a BY dx, dy, dz)"),
    Form("SCALE", "a:frame, factor -> frame", "A location whose X, Y and Z are multiplied by a factor.", "V+",
         _scale, usage="SCALE(a BY factor)"),
    Form("INVERSE", "a:frame -> frame", "The transformation back.", "VAL", Transformation.inverse),
    Form("FRAME", "a:frame, b:frame, c:frame, d:frame -> frame", "A frame at d: x from a to b, c on the side of y.",
         "VAL", _frame),
    Form("RX", "angle -> frame", "A turn about x [deg].", "V+", about_x),
    Form("RY", "angle -> frame", "A turn about y [deg].", "V+", about_y),
    Form("RZ", "angle -> frame", "A turn about z [deg].", "V+", about_z),
    Form("NULL", "-> frame", "No way and no turn.", "VAL", lambda: NULL, tags="constant"),
    Form("HERE", "-> frame", "Where the tool is.", "VAL", lambda c: c.arm.here(now=c.now).tool,
         tags="constant context"),
    Form("DEST", "-> frame", "Where the tool goes.", "VAL-II", lambda c: c.arm.destination(now=c.now).tool,
         tags="constant context"),
    Form("TOOL", "-> frame", "The tool transformation in force.", "V+", lambda c: c.arm.tool(),
         tags="constant context"),
    Form("BASE", "-> frame", "The base in force, where no variable is called so.", "V+", lambda c: c.arm.base(),
         usage="BASE", tags="context unreserved"),
    Form("#PPOINT", "j1?=0, j2?=0, j3?=0, j4?=0, j5?=0, j6?=0 -> location", "A precision point [deg].", "VAL-II",
         _ppoint),
    Form("#HERE", "-> location", "Where the arm is, as a precision point.", "ours",
         lambda c: c.arm.here(now=c.now).joints, tags="constant context"),
    Form("#DEST", "-> location", "Where the arm goes, as a precision point.", "V+",
         lambda c: c.arm.destination(now=c.now).joints, tags="constant context"),
    # Of files, bytes and tasks.
    Form("IOSTAT", "unit, select?=0 -> real", "1 if what was last wanted of a unit is done, else why not.", "V+",
         lambda c, unit, _: c.units.status(unit), tags="context"),
    Form("GETC", "unit, mode?=0 -> real", "Code of the next character of a file, or why there's none.", "V+",
         lambda c, unit, _: c.units.character(whole(unit)), tags="context"),
    Form("$ERROR", "code? -> string",
         "Text of an error that IOSTAT gives; without a code, of the task's last error.", "V+", _error,
         tags="context"),
    Form("LNGB", "text:string, from?=1 -> real", "An integer of four characters, the highest first.", "V+",
         lambda text, first: _of_bytes(">i", text, first)),
    Form("FLTB", "text:string, from?=1 -> real", "A number of four characters.", "V+",
         lambda text, first: _of_bytes(">f", text, first)),
    Form("$LNGB", "value -> string", "Four characters of an integer.", "V+",
         lambda value: _bytes(">i", whole(value))),
    Form("$FLTB", "value -> string", "Four characters of a number.", "V+", lambda value: _bytes(">f", value)),
    Form("TASK", "select?=0, task:task?=0 -> real", "Number of this task; 1: state of a task.", "V+", _task,
         tags="context reading"),
    Form("STATUS", "program:string -> real", "State of the task that runs a program, as TASK(1) has it.", "V+",
         _status, tags="context reading"),
)  # fmt: skip

FUNCTIONS: Final[dict[str, Form]] = {row.name: row for row in _FUNCTIONS}
"""Functions and constants, with their prefixes."""

UNRESERVED: Final = {row.name: row for row in FUNCTIONS.values() if "unreserved" in row.tags}
"""What may be written without parentheses, and may be a variable's name, too: then that's what it is."""

ALIASES: Final = {"PPOINT": "#PPOINT", "#PDEST": "#DEST", "#PHERE": "#HERE"}
"""Other spellings of functions, and what they become."""

CONSTANTS: Final = frozenset(
    [*(row.name for row in FUNCTIONS.values() if "constant" in row.tags), "#PDEST", "#PHERE"]
)
"""What may be written without parentheses, and so can't be a variable's name."""

_OPERATORS: Final = (
    Form("OR", "a:condition, b:condition -> truth", "One holds, or both.", "VAL-II", operator.or_, level=1),
    Form("XOR", "a:condition, b:condition -> truth", "One holds, not both.", "VAL-II", operator.xor, level=1),
    Form("AND", "a:condition, b:condition -> truth", "Both hold.", "VAL-II", operator.and_, level=2),
    Form("NOT", "a:condition -> truth", "It doesn't hold.", "VAL-II", operator.not_, level=3),
    Form("==", "a:alike, b:alike -> truth", "Equal.", "VAL-II", operator.eq, level=4),
    Form("<>", "a:alike, b:alike -> truth", "Not equal.", "VAL-II", operator.ne, level=4),
    Form("<", "a:alike, b:alike -> truth", "Less.", "VAL-II", operator.lt, level=4),
    Form("<=", "a:alike, b:alike -> truth", "Less or equal.", "VAL-II", operator.le, level=4),
    Form(">", "a:alike, b:alike -> truth", "Greater.", "VAL-II", operator.gt, level=4),
    Form(">=", "a:alike, b:alike -> truth", "Greater or equal.", "VAL-II", operator.ge, level=4),
    Form("+", "a:alike, b:alike -> alike", "Sum; strings one behind the other.", "VAL-II",
         lambda a, b: checked(a + b), level=5),
    Form("-", "a, b -> real", "Difference.", "VAL-II", lambda a, b: checked(a - b), level=5),
    Form("BOR", "a, b -> real", "Bits of either.", "VAL-II", _of_bits(operator.or_), level=5),
    Form("BXOR", "a, b -> real", "Bits that differ.", "VAL-II", _of_bits(operator.xor), level=5),
    Form("*", "a, b -> real", "Product.", "VAL-II", lambda a, b: checked(a * b), level=6),
    Form("/", "a, b -> real", "Quotient.", "VAL-II", divide, level=6),
    Form("MOD", "a, b -> real", "Rest of a division.", "VAL-II", modulo, level=6),
    Form("BAND", "a, b -> real", "Bits of both.", "VAL-II", _of_bits(operator.and_), level=6),
    Form("COM", "a -> real", "All bits turned.", "VAL-II", lambda a: float(~whole(a)), level=7),
    Form("^", "a, b -> real", "Power.", "VAL-II", power, level=8),
)  # fmt: skip
OPERATORS: Final = {row.name: row for row in _OPERATORS}
"""Operators; of those that bind as tightly, the first one comes first."""
NEGATION: Final = Form("-", "a -> real", "The other sign.", "VAL-II", operator.neg, level=7)


def row_of(e: Apply) -> Form:
    """The row of a function or an operator."""
    if e.function in FUNCTIONS:
        return FUNCTIONS[e.function]
    return NEGATION if e.function == "-" and len(e.arguments) == 1 else OPERATORS[e.function]
