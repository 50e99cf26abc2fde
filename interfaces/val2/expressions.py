"""Expressions as closures: each takes the names of a call, and returns a value.

Global names are bound when a program is compiled, its arguments and its own names by their number in the call.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final, TypeAlias

import numpy as np

from interfaces.val2 import formats, forms, functions, kinds
from interfaces.val2.context import Context, Warned
from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.forms import OperandSlot
from interfaces.val2.functions import truth
from interfaces.val2.memory import MOST_DIMENSIONS, Key, Slots, VariableSlot, index, mismatch, undefined
from interfaces.val2.syntax import Apply, Binary, Compound, Expression, Format, Number, Text, Unary, Variable
from interfaces.val2.values import Location, PrecisionPoint, Transformation, Value

Closure: TypeAlias = Callable[[Slots], Any]
Real: TypeAlias = Callable[[Slots], float]
String: TypeAlias = Callable[[Slots], str]
Frame: TypeAlias = Callable[[Slots], Transformation]
Test: TypeAlias = Callable[[Slots], bool]

RELATIONS: Final[dict[str, Callable[[Any, Any], bool]]] = {
    "==": operator.eq, "<>": operator.ne, "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
}  # fmt: skip
_LOGICAL: Final = ("AND", "OR", "XOR")


class Expressions:
    """Makes closures of the expressions of one program."""

    def __init__(self, context: Context, scope: Mapping[str, int | VariableSlot] | None = None) -> None:
        """Bind to a context.

        Args:
            context: Holds the memory.
            scope: Where the program's own names are: numbers in the call's slots, or slots that last.
        """
        self.context = context
        self._scope = scope or {}

    @staticmethod
    def kind(e: Expression) -> str:
        """What an expression is by its text; nothing for a name without a prefix: a real or a transformation."""
        return kinds.kind_of(e, {})

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
        parts, at = [self.real(i) for i in variable.indices], variable.at
        if len(parts) > MOST_DIMENSIONS:
            raise ValError("Invalid array index", f"{MOST_DIMENSIONS} dimensions at most", place=at)
        if len(parts) == 1:
            part = parts[0]
            return lambda s: index(part(s), at)
        return lambda s: tuple(index(p(s), at) for p in parts)

    def found(self, variable: Variable) -> Callable[[Slots], VariableSlot | None]:
        """The slot of a variable; None for an element that doesn't exist."""
        place = self.slot(variable.name)
        if not variable.indices:
            return (lambda s: s[place]) if isinstance(place, int) else (lambda _: place)
        key = self.key(variable)

        def element(s: Slots) -> VariableSlot | None:
            array: VariableSlot = s[place] if isinstance(place, int) else place
            return array.elements.get(key(s)) if array.elements else None

        return element

    def reference(self, variable: Variable) -> Callable[[Slots], VariableSlot]:
        """The slot of a variable, made if need be: to be set, or an argument."""
        place = self.slot(variable.name)
        if not variable.indices:
            return (lambda s: s[place]) if isinstance(place, int) else (lambda _: place)
        key, memory = self.key(variable), self.context.memory
        if isinstance(place, int):
            return lambda s: memory.element(s[place], key(s))
        return lambda s: memory.element(place, key(s))

    def read(self, variable: Variable, *, location: bool = False) -> Closure:
        """The value of a variable, whatever it is."""
        place = self.slot(variable.name)
        key = self.key(variable) if variable.indices else None

        def value(s: Slots) -> Value:
            slot: VariableSlot | None = s[place] if isinstance(place, int) else place
            k = None
            if key is not None:
                assert slot is not None
                k = key(s)
                slot = slot.elements.get(k) if slot.elements else None
            if slot is None or slot.value is None:
                raise undefined(variable, k, location=location)
            return slot.value

        return value

    # Reals.

    def real(self, e: Expression) -> Real:
        """A closure of a real expression.

        Raises:
            ValError: If it's of another type by its text; the closure, for what comes out at run time.
        """
        match e:
            case Number(value):
                return lambda _: value
            case Variable():
                return self._real_variable(e)
            case Unary():
                return self._unary(e)
            case Binary(operator) if operator in RELATIONS or operator in _LOGICAL:
                test = self.condition(e)
                return lambda s: -1.0 if test(s) else 0.0
            case Binary() if self.kind(e) == "real":
                return _joined(e.operator, self.real(e.left), self.real(e.right), e.at)
            case Apply() if self.kind(e) == "real":
                return self.function(e)
            case Apply():
                raise ValError("Invalid expression", e.function, place=e.at)
            case _:
                raise ValError("Invalid expression", "a number was expected", place=e.at)

    def _real_variable(self, e: Variable) -> Real:
        if e.prefix:
            raise mismatch(e)
        read = self.read(e)

        def slow(s: Slots) -> float:
            value = read(s)
            if type(value) is float:
                return value
            raise mismatch(e)

        place = self.slot(e.name)
        if e.indices:
            return slow
        if isinstance(place, int):

            def local(s: Slots) -> float:
                value = s[place].value
                return value if value.__class__ is float else slow(s)

            return local

        def global_(s: Slots) -> float:
            value = place.value
            return value if value.__class__ is float else slow(s)

        return global_

    def _unary(self, e: Unary) -> Real:
        if isinstance(e.operand, Number) and e.operator == "-":
            value = -e.operand.value
            return lambda _: value
        a = self.real(e.operand)
        return _placed(functions.UNARY[e.operator], [a], e.at)

    # Conditions.

    def condition(self, e: Expression) -> Test:
        """A closure of whether an expression isn't 0; both sides of AND and OR are evaluated, as V+ does."""
        if isinstance(e, Unary) and e.operator == "NOT":
            inner = self.condition(e.operand)
            return lambda s: not inner(s)
        if isinstance(e, Binary) and e.operator in RELATIONS:
            return self._relation(e)
        if isinstance(e, Binary) and e.operator in _LOGICAL:
            left, right = self.condition(e.left), self.condition(e.right)
            match e.operator:
                case "AND":
                    return lambda s: left(s) & right(s)
                case "OR":
                    return lambda s: left(s) | right(s)
                case _:
                    return lambda s: left(s) ^ right(s)
        value = self.real(e)
        return lambda s: value(s) != 0.0

    def _relation(self, e: Binary) -> Test:
        if "string" in (self.kind(e.left), self.kind(e.right)):
            relation = RELATIONS[e.operator]
            left, right = self.string(e.left), self.string(e.right)
            return lambda s: relation(left(s), right(s))
        a, b = self.real(e.left), self.real(e.right)
        tests: dict[str, Test] = {  # Without a call in between, which costs more than the comparison.
            "==": lambda s: a(s) == b(s),
            "<>": lambda s: a(s) != b(s),
            "<": lambda s: a(s) < b(s),
            "<=": lambda s: a(s) <= b(s),
            ">": lambda s: a(s) > b(s),
            ">=": lambda s: a(s) >= b(s),
        }
        return tests[e.operator]

    # Strings and locations.

    def string(self, e: Expression) -> String:
        """A closure of a string expression.

        Raises:
            ValError: If it's of another type.
        """
        match e:
            case Text(value):
                return lambda _: value
            case Variable() if e.prefix == "$":
                return self.read(e)
            case Binary() if e.operator == "+":
                left, right = self.string(e.left), self.string(e.right)
                return lambda s: left(s) + right(s)
            case Apply() if self.kind(e) == "string":
                return self.function(e)
            case _:
                raise ValError("Invalid expression", "a string was expected", place=e.at)

    def transformation(self, e: Expression) -> Frame:
        """A closure of a transformation.

        Raises:
            ValError: If it's of another type.
        """
        match e:
            case Variable() if not e.prefix:
                read = self.read(e, location=True)

                def variable(s: Slots) -> Transformation:
                    value = read(s)
                    if value.__class__ is Transformation:
                        return value
                    raise mismatch(e)

                return variable
            case Compound(parts):
                frames = [self.transformation(p) for p in parts]

                def compound(s: Slots) -> Transformation:
                    X = frames[0](s).X
                    for frame in frames[1:]:
                        X = X @ frame(s).X
                    if not np.isfinite(X).all():
                        raise ValError("Arithmetic overflow", place=e.at)
                    return Transformation(X)

                return compound
            case Apply() if self.kind(e) == "frame":
                return self.function(e)
            case _:
                raise ValError("Invalid expression", "a transformation was expected", place=e.at)

    def point(self, e: Expression) -> Callable[[Slots], PrecisionPoint]:
        """A closure of a precision point; HERE and DEST give the joints where one is wanted.

        Raises:
            ValError: If it's of another type.
        """
        match e:
            case Variable() if e.prefix == "#":
                return self.read(e)
            case Apply("HERE" | "DEST"):
                return self.function(Apply(f"#{e.function}", (), e.at))
            case Apply() if self.kind(e) == "point":
                return self.function(e)
            case _:
                raise ValError("Invalid expression", "a precision point was expected", place=e.at)

    def location(self, e: Expression) -> Callable[[Slots], Location]:
        """A closure of a transformation or a precision point, as the text tells."""
        return self.point(e) if self.kind(e) == "point" else self.transformation(e)

    def value(self, e: Expression) -> Closure:
        """A closure of whatever an expression is."""
        return self.of_kind(self.kind(e) or "any", e)

    def of_kind(self, kind: str, e: Expression) -> Closure:
        """A closure of an expression that has to be of a kind.

        Raises:
            ValError: If it's of another one.
        """
        match kind:
            case "string":
                return self.string(e)
            case "frame":
                return self.transformation(e)
            case "point":
                return self.point(e)
            case "location":
                return self.location(e)
            case "any":
                return self.read(e) if isinstance(e, Variable) and not e.prefix else self.value(e)
            case _:
                return self.real(e)

    # Functions.

    def operands(
        self, slots: Sequence[OperandSlot], given: Sequence[Expression | Format | None], word: str, at: TextPosition
    ) -> list[Closure]:
        """Closures of the operands of an instruction or a function, as its slots say.

        Raises:
            ValError: If one is missing, or of another kind.
        """
        made: list[Closure] = []
        for i in range(max(len(given), len(slots)) if slots else 0):
            slot, operand = slots[min(i, len(slots) - 1)], given[i] if i < len(given) else None
            if operand is None and slot.default is None and slot.required:
                raise ValError("Missing argument", word, place=at)
            made.append(_constant(slot.default) if operand is None else self.of_kind(slot.kind, operand))  # type: ignore[arg-type]
        return made

    def function(self, e: Apply) -> Closure:
        """A closure of a function.

        Raises:
            ValError: If its arguments aren't what it takes.
        """
        row, given = forms.FUNCTIONS[e.function], e.arguments
        if row.idle:
            return self._idle(e, "" if row.gives == "string" else 0.0)
        if e.function in _OF_NAMES:
            return _placed(_OF_NAMES[e.function](self, e), [lambda s: s], e.at)
        if row.repeats and row.slots[-1].default is None:
            given = tuple(a for a in given if a is not None)
        parts = self.operands(row.slots, given, e.function, e.at)
        if e.function in functions.OF_CONTEXT:
            return _placed(partial(functions.OF_CONTEXT[e.function], self.context), parts, e.at)
        function = functions.OF_VALUES[e.function]
        return _placed(function, parts, e.at) if parts else _constant(function())

    def _idle(self, e: Apply, value: float | str) -> Closure:
        """Of files and other tasks: 0 or an empty string, with a warning."""
        warning = Warned(f"{e.function} has no meaning here")

        def nothing(_: Slots) -> float | str:
            self.context.warn(warning)
            return value

        return nothing


def _constant(value: Any) -> Closure:
    return lambda _: value


def _placed(function: Callable[..., Any], parts: Sequence[Closure], at: TextPosition) -> Closure:
    """A closure of a function of values, whose errors stand at a place."""
    if len(parts) == 1:
        (a,) = parts

        def one(s: Slots) -> Any:
            try:
                return function(a(s))
            except ValError as error:
                raise error.at(place=at) from None

        return one

    def several(s: Slots) -> Any:
        try:
            return function(*[p(s) for p in parts])
        except ValError as error:
            raise error.at(place=at) from None

    return several


def _joined(symbol: str, a: Real, b: Real, at: TextPosition) -> Real:
    """A closure of two reals with an operator between them; the frequent ones without a call in between."""

    def overflow() -> ValError:
        return ValError("Arithmetic overflow", place=at)

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

    quick = {"+": add, "-": subtract, "*": multiply}
    if symbol in quick:
        return quick[symbol]
    function = functions.BINARY[symbol]

    def binary(s: Slots) -> float:
        try:
            return function(a(s), b(s))
        except ValError as error:
            raise error.at(place=at) from None

    return binary


# Functions of names.


def _defined(x: Expressions, e: Apply) -> Callable[[Slots], float]:
    variable = e.arguments[0]
    if not isinstance(variable, Variable):
        raise ValError("Invalid expression", "DEFINED takes a name", place=e.at)
    found = x.found(variable)

    def defined(s: Slots) -> float:
        slot = found(s)
        return truth(slot is not None and slot.defined())

    return defined


def _last(x: Expressions, e: Apply) -> Callable[[Slots], float]:
    variable = e.arguments[0]
    if not isinstance(variable, Variable) or variable.indices:
        raise ValError("Invalid expression", "LAST takes an array", place=e.at)
    found = x.found(variable)

    def last(s: Slots) -> float:
        slot = found(s)
        keys = [k for k, v in ((slot and slot.elements) or {}).items() if v.value is not None]
        return float(max((k if isinstance(k, int) else k[0] for k in keys), default=-1))

    return last


def _setting(x: Expressions, e: Apply) -> Callable[[Slots], float]:
    """SWITCH and PARAMETER."""
    variable, kind = e.arguments[0], e.function.lower()
    if not isinstance(variable, Variable):
        raise ValError("Invalid expression", f"{e.function} takes a name", place=e.at)
    name, values = variable.name.upper(), x.context.switches if kind == "switch" else x.context.parameters
    if name not in values:
        raise ValError(f"Unknown {kind}", name, place=e.at)
    return lambda _: truth(bool(values[name])) if kind == "switch" else values[name]


def _encode(x: Expressions, e: Apply) -> Callable[[Slots], str]:
    items = [_constant(a) if isinstance(a, Format) else x.value(a) for a in e.arguments if a is not None]
    return lambda s: formats.spelled([item(s) for item in items])[0]


def _decode(x: Expressions, e: Apply) -> Callable[[Slots], str]:
    source = e.arguments[0]
    if not isinstance(source, Variable):
        raise ValError("Invalid expression", "$DECODE takes a string variable first", place=e.at)
    read, slot = x.string(source), x.reference(source)
    marks, skip = x.operands(forms.FUNCTIONS["$DECODE"].slots[1:], e.arguments[1:], e.function, e.at)

    def decode(s: Slots) -> str:
        text, ends, marked = read(s), marks(s), skip(s) > 0.0
        n = next((i for i, c in enumerate(text) if (c in ends) != marked), len(text))
        slot(s).value = text[n:]
        return text[:n]

    return decode


_OF_NAMES: Final[dict[str, Callable[[Expressions, Apply], Closure]]] = {
    "DEFINED": _defined, "LAST": _last, "PARAMETER": _setting, "SWITCH": _setting, "$DECODE": _decode,
    "$ENCODE": _encode,
}  # fmt: skip
FUNCTIONS: Final = {*_OF_NAMES, *functions.OF_VALUES, *functions.OF_CONTEXT}
"""What functions closures are made of, beside those without meaning here."""
