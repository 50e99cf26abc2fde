"""Expressions as closures: each takes the names of a call, and returns a value.

Global names are bound when a program is compiled, its arguments and its own names by their number in the call.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, Final, TypeAlias

import numpy as np

from interfaces.val2 import formats
from interfaces.val2.context import Context
from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.functions import FUNCTIONS, TRUE, UNRESERVED, row_of, whole
from interfaces.val2.memory import (
    LONGEST_STRING,
    MOST_DIMENSIONS,
    Key,
    Slots,
    VariableSlot,
    index,
    mismatch,
    undefined,
)
from interfaces.val2.rows import Kind, OperandSlot
from interfaces.val2.syntax import Apply, Compound, Expression, Format, Number, Text, Variable
from interfaces.val2.values import Dialect, Transformation, Value

Closure: TypeAlias = Callable[[Slots], Any]
Real: TypeAlias = Callable[[Slots], float]
Test: TypeAlias = Callable[[Slots], bool]
_GIVEN: Final = {"location": "point", "truth": "real"}
"""Of what kind is what functions give, where they say it otherwise."""
WANTED: Final = {
    "real": "a number", "string": "a string", "frame": "a transformation", "point": "a precision point",
    "location": "a location",
}  # fmt: skip
"""What errors call values of a kind."""
PACKED: Final = 128
"""Characters of a string in an array that stands for one text."""
_PREFIXES: Final = {"real": "", "string": "$", "frame": "", "point": "#"}
"""Of names of values of a kind."""


def kind_of(expression: Expression, known: Mapping[str, str] = {}) -> str:
    """`real`, `string`, `frame`, `point`, or nothing if it can't be told by the text.

    Args:
        expression: The expression.
        known: What is known of names without a prefix.
    """
    match expression:
        case Number():
            return "real"
        case Text():
            return "string"
        case Compound():
            return "frame"
        case Variable(name):
            return {"$": "string", "#": "point"}.get(name[0]) or known.get(name, "")
        case Apply(arguments=arguments):
            gives = row_of(expression).gives
            if gives == "alike":
                return "string" if "string" in (kind_of(a, known) for a in arguments) else "real"  # type: ignore[arg-type]
            return _GIVEN.get(gives, gives)


def unset(variable: Variable, key: Key | None = None, *, location: bool = False) -> ValError:
    """The error of reading what is unset; it shows the form of a function of that name."""
    error, row = undefined(variable, key, location=location), FUNCTIONS.get(variable.name.upper())
    if row is None or variable.indices:
        return error
    return ValError(error.what, f"{error.detail}; the function is {row.usage}", place=variable.at)


class Expressions:
    """Makes closures of the expressions of one program."""

    known: Mapping[str, str] = MappingProxyType({})
    """Of what kind values of names without a prefix are, as far as that's known beforehand."""

    def __init__(
        self,
        context: Context,
        scope: Mapping[str, int | VariableSlot] | None = None,
        dialect: Dialect | None = None,
    ) -> None:
        """Bind to a context.

        Args:
            context: Holds the memory.
            scope: Where the program's own names are: numbers in the call's slots, or slots that last.
            dialect: In which angles are; that of the prompt unless given.
        """
        self.context, self.dialect = context, context.dialect if dialect is None else dialect
        self._scope = scope or {}

    # Names.

    def slot(self, name: str) -> int | VariableSlot:
        """Where a name is: a number in the call's slots, or a slot that lasts."""
        found = self._scope.get(name)
        return self.context.memory.slot(name) if found is None else found

    def key(self, variable: Variable) -> Callable[[Slots], Key]:
        """The indices of an element.

        Raises:
            ValError: If there are too many; the closure, if one is out of range.
        """
        parts, at = [self.of_kind("real", i) for i in variable.indices], variable.at
        if len(parts) > MOST_DIMENSIONS:
            raise ValError("Invalid array index", f"{MOST_DIMENSIONS} dimensions at most", place=at)
        if len(parts) == 1:
            part = parts[0]
            return lambda s: index(part(s), at)
        return lambda s: tuple(index(p(s), at) for p in parts)

    def found(self, variable: Variable, *, make: bool = False) -> Closure:
        """The slot of a variable; an element that doesn't exist is made, or None."""
        place, memory = self.slot(variable.name), self.context.memory
        if not variable.indices:
            return (lambda s: s[place]) if isinstance(place, int) else (lambda _: place)
        key = self.key(variable)

        def element(s: Slots) -> VariableSlot | None:
            array: VariableSlot = s[place] if isinstance(place, int) else place
            return memory.element(array, key(s)) if make else (array.elements or {}).get(key(s))

        return element

    def reference(self, variable: Variable) -> Callable[[Slots], VariableSlot]:
        """The slot of a variable, made if need be: to be set, or an argument."""
        return self.found(variable, make=True)

    def read(self, variable: Variable, *, location: bool = False) -> Closure:
        """The value of a variable, whatever it is."""
        found, key = self.found(variable), self.key(variable) if variable.indices else None
        row = None if variable.indices else UNRESERVED.get(variable.name.upper())
        standing = None if row is None else self._function(Apply(row.name, (), variable.at))

        def value(s: Slots) -> Value:
            slot: VariableSlot | None = found(s)
            if slot is not None and slot.value is not None:
                return slot.value
            if standing is None:
                raise unset(variable, None if key is None else key(s), location=location)
            value: Value = standing(s)
            return value

        return value

    # Values.

    def value(self, e: Expression) -> Closure:
        """A closure of whatever an expression is."""
        return self.of_kind("any", e)

    def condition(self, e: Expression) -> Test:
        """A closure of whether an expression isn't 0; both sides of AND and OR are evaluated, as V+ does."""
        return self.of_kind("condition", e)

    def of_kind(self, kind: str, e: Expression) -> Closure:
        """A closure of an expression that has to be of a kind.

        Raises:
            ValError: If it's of another one by its text; the closure, for what comes out at run time.
        """
        if kind == "condition":
            if isinstance(e, Apply) and row_of(e).gives == "truth":
                return self._function(e)
            number = self.of_kind("real", e)
            return lambda s: number(s) != 0.0
        own, asked = kind_of(e, self.known), kind
        if kind == "any":
            if isinstance(e, Variable) and not own:
                return self.read(e)
            kind = own
        elif kind == "location":
            kind = "point" if own == "point" else "frame"
        elif kind not in WANTED:
            kind = "real"
        match e:
            case Number(value) | Text(value) if own == kind:
                return _constant(value)
            case Variable(prefix=prefix) if prefix == _PREFIXES[kind] and own in ("", kind):
                return self._typed(e, float if kind == "real" else Transformation) if not prefix else self.read(e)
            case Variable() if kind == "real" and not own:
                raise mismatch(e)
            case Compound() if kind == "frame":
                return self._compound(e)
            case Apply("HERE" | "DEST" as name) if kind == "point":
                return self._function(Apply(f"#{name}", (), e.at))
            case Apply("+") if kind == "string":
                return self._function(e, "string")
            case Apply() if own == kind:
                made = self._function(e)
                return (lambda s: TRUE if made(s) else 0.0) if row_of(e).gives == "truth" else made
        where = f"{WANTED[own]} where " if own else ""
        raise ValError("Mixed types", f"{where}{WANTED.get(asked, WANTED[kind])} is wanted", place=e.at)

    def _typed(self, e: Variable, type_: type) -> Closure:
        """A closure of a variable without a prefix."""
        read, place = self.read(e, location=type_ is Transformation), self.slot(e.name)

        def checked(s: Slots) -> Any:
            value = read(s)
            if value.__class__ is type_:
                return value
            raise mismatch(e)

        if e.indices or isinstance(place, int):
            return checked

        def quick(s: Slots) -> Any:
            value = place.value
            return value if value.__class__ is type_ else checked(s)

        return quick

    def _compound(self, e: Compound) -> Closure:
        frames = [self.of_kind("frame", p) for p in e.parts]

        def compound(s: Slots) -> Transformation:
            X = frames[0](s).X
            for frame in frames[1:]:
                X = X @ frame(s).X
            if not np.isfinite(X).all():
                raise ValError("Arithmetic overflow", place=e.at)
            return Transformation(X)

        return compound

    def operands(self, slots: Sequence[OperandSlot], given: Sequence[Expression | Format | None]) -> list[Closure]:
        """Closures of the operands of an instruction or a function, as its slots say, which have counted them.

        Raises:
            ValError: If one is of another kind.
        """
        made: list[Closure] = []
        for i in range(max(len(given), len(slots)) if slots else 0):
            slot, operand = slots[min(i, len(slots) - 1)], given[i] if i < len(given) else None
            made.append(_constant(slot.default) if operand is None else self.of_kind(slot.kind, operand))  # type: ignore[arg-type]
        return made

    def _function(self, e: Apply, alike: Kind | None = None) -> Closure:
        """A closure of a function or an operator, of the kind that its row gives; its operands are of a kind."""
        row, given = row_of(e), e.arguments
        if row.act is None:
            return _placed(OF_NAMES[row.name](self, e), [lambda s: s], e.at)
        slots, act = row.slots, row.act
        if row.alike:
            texts = alike or "string" in map(kind_of, given)  # type: ignore[arg-type]
            slots = (OperandSlot("", "string" if texts else "real"),)
            act = operator.add if texts and row.name == "+" else act
            act = partial(self._compared, act) if texts and row.gives == "truth" else act
        parts = self.operands(slots, given)
        if "context" in row.tags:
            return _placed(partial(act, self.context), parts, e.at)
        if "dialect" in row.tags:
            return _placed(partial(act, self.dialect), parts, e.at)
        return _placed(act, parts, e.at) if parts else _constant(act())

    def _compared(self, compare: Callable[[str, str], bool], a: str, b: str) -> bool:
        """A comparison of strings, of any case where UPPER says so."""
        return compare(a.upper(), b.upper()) if self.context.switches["UPPER"] else compare(a, b)


def _constant(value: Any) -> Closure:
    return lambda _: value


def _placed(function: Callable[..., Any], parts: Sequence[Closure], at: TextPosition) -> Closure:
    """A closure of a function of values, whose errors stand at a place."""

    def several(s: Slots) -> Any:
        try:
            return function(*[p(s) for p in parts])
        except ValError as error:
            raise error.at(place=at) from None

    def two(s: Slots) -> Any:
        try:
            return function(a(s), b(s))
        except ValError as error:
            raise error.at(place=at) from None

    def one(s: Slots) -> Any:
        try:
            return function(a(s))
        except ValError as error:
            raise error.at(place=at) from None

    if len(parts) > 2 or not parts:
        return several
    a, b = parts[0], parts[-1]
    return one if len(parts) == 1 else two


# Functions of names.


def _named(e: Apply) -> Variable:
    """The variable that a function of a name is of.

    Raises:
        ValError: If it's something else.
    """
    if isinstance(variable := e.arguments[0], Variable):
        return variable
    raise ValError("Invalid expression", f"{e.function} takes a name first: {row_of(e).usage}", place=e.at)


def _defined(x: Expressions, e: Apply) -> Callable[[Slots], float]:
    found = x.found(_named(e))

    def defined(s: Slots) -> float:
        slot = found(s)
        return TRUE if slot is not None and slot.defined() else 0.0

    return defined


def _last(x: Expressions, e: Apply) -> Callable[[Slots], float]:
    variable = _named(e)
    if variable.indices:
        raise ValError("Invalid expression", "LAST takes an array", place=e.at)
    found = x.found(variable)

    def last(s: Slots) -> float:
        slot = found(s)
        keys = [k for k, v in ((slot and slot.elements) or {}).items() if v.value is not None]
        return float(max((k if isinstance(k, int) else k[0] for k in keys), default=-1))

    return last


def _setting(x: Expressions, e: Apply) -> Callable[[Slots], float]:
    """SWITCH and PARAMETER."""
    name, kind = _named(e).name.upper(), e.function.lower()
    values = x.context.switches if kind == "switch" else x.context.parameters
    if name not in values:
        raise ValError(f"Unknown {kind}", name, place=e.at)
    return lambda _: (TRUE if values[name] else 0.0) if kind == "switch" else values[name]


def _encode(x: Expressions, e: Apply) -> Callable[[Slots], str]:
    items = [_constant(a) if isinstance(a, Format) else x.value(a) for a in e.arguments if a is not None]
    return lambda s: formats.spelled([item(s) for item in items], x.dialect)[0]


def _decode(x: Expressions, e: Apply) -> Callable[[Slots], str]:
    source = _named(e)
    read, slot = x.of_kind("string", source), x.reference(source)
    marks, skip = x.operands(FUNCTIONS["$DECODE"].slots[1:], e.arguments[1:])

    def decode(s: Slots) -> str:
        text: str
        text, ends, marked = read(s), marks(s), skip(s) > 0.0
        n = next((i for i, c in enumerate(text) if (c in ends) != marked), len(text))
        slot(s).value = text[n:]
        return text[:n]

    return decode


def packed(
    x: Expressions, target: Expression, first: Closure, count: Closure
) -> Callable[[Slots], tuple[list[VariableSlot], str, int, int]]:
    """Elements of an array of strings that stand for one text, `PACKED` characters each.

    Returns:
        Those of a part of that text, what they hold, where the part begins in it, and how long it is.
    """
    if not isinstance(target, Variable) or target.prefix != "$" or not target.indices:
        raise ValError("Invalid argument", "an element of an array of strings is wanted", place=target.at)
    place, key, memory = x.slot(target.name), x.key(target), x.context.memory

    def part(s: Slots) -> tuple[list[VariableSlot], str, int, int]:
        begin, length = whole(first(s)) - 1, whole(count(s))
        if begin < 0 or not 0 <= length <= LONGEST_STRING:
            raise ValError(
                "Illegal value", f"from {begin + 1}, {length} characters: 1 on, {LONGEST_STRING} at most"
            )
        array, found = s[place] if isinstance(place, int) else place, key(s)
        *before, last = found if isinstance(found, tuple) else (found,)
        keys = [last + k for k in range(begin // PACKED, (begin + max(length, 1) - 1) // PACKED + 1)]
        slots = [memory.element(array, (*before, k) if before else k) for k in keys]
        return slots, "".join(str(slot.value or "").ljust(PACKED, "\0") for slot in slots), begin % PACKED, length

    return part


def _unpack(x: Expressions, e: Apply) -> Callable[[Slots], str]:
    first, count = x.operands(FUNCTIONS["$UNPACK"].slots[1:], e.arguments[1:])
    part = packed(x, e.arguments[0], first, count)  # type: ignore[arg-type]

    def unpack(s: Slots) -> str:
        _, text, begin, length = part(s)
        return text[begin : begin + length].rstrip("\0")

    return unpack


OF_NAMES: Final[dict[str, Callable[[Expressions, Apply], Closure]]] = {
    "DEFINED": _defined, "LAST": _last, "PARAMETER": _setting, "SWITCH": _setting, "$DECODE": _decode,
    "$ENCODE": _encode, "$UNPACK": _unpack,
}  # fmt: skip
"""Functions of names, not values."""
