"""Expressions as closures: each takes the names of a call, and returns a value.

Global names are bound when a program is compiled, its arguments and its own names by their number in the call.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from enum import Enum, auto
from typing import Any, Final, NamedTuple, TypeAlias, cast

import numpy as np

from interfaces.val2 import arithmetic
from interfaces.val2.arithmetic import Real, Slots, joined, placed
from interfaces.val2.context import Context
from interfaces.val2.errors import ValError
from interfaces.val2.memory import MOST_DIMENSIONS, Key, VariableSlot, index, mismatch, undefined, where
from interfaces.val2.syntax import Apply, Binary, Compound, Expression, Number, Text, Unary, Variable
from interfaces.val2.values import Location, PrecisionPoint, Transformation, Value

String: TypeAlias = Callable[[Slots], str]
Frame: TypeAlias = Callable[[Slots], Transformation]

RELATIONS: Final[dict[str, Callable[[Any, Any], bool]]] = {
    "==": operator.eq,
    "<>": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


class ResultKind(Enum):
    """What an expression is, as far as its text tells."""

    REAL = auto()
    STRING = auto()
    TRANSFORMATION = auto()
    POINT = auto()
    NAME = auto()
    """A name without a prefix: a real or a transformation."""


class Functions(NamedTuple):
    """Makes closures of functions of the language, whose arguments are expressions again."""

    results: Mapping[str, ResultKind]
    """What functions give that aren't reals."""
    real: Callable[[Expressions, Apply], Real]
    string: Callable[[Expressions, Apply], String]
    frame: Callable[[Expressions, Apply], Frame]
    point: Callable[[Expressions, Apply], Callable[[Slots], PrecisionPoint]]


class Expressions:
    """Makes closures of the expressions of one program."""

    def __init__(
        self, context: Context, functions: Functions, scope: dict[str, int | VariableSlot] | None = None
    ) -> None:
        """Bind to a context.

        Args:
            context: Holds the memory.
            functions: Of the language.
            scope: Where the program's own names are: numbers in the call's slots, or slots that last.
        """
        self.context = context
        self._functions = functions
        self._scope = scope or {}

    def kind(self, e: Expression) -> ResultKind:
        """What an expression is."""
        match e:
            case Number() | Unary():
                return ResultKind.REAL
            case Text():
                return ResultKind.STRING
            case Compound():
                return ResultKind.TRANSFORMATION
            case Variable():
                return {"$": ResultKind.STRING, "#": ResultKind.POINT}.get(e.prefix, ResultKind.NAME)
            case Apply():
                return self._functions.results.get(e.function, ResultKind.REAL)
            case Binary():
                both = (self.kind(e.left), self.kind(e.right))
                return ResultKind.STRING if e.operator == "+" and ResultKind.STRING in both else ResultKind.REAL

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
            raise ValError("Invalid array index", f"{MOST_DIMENSIONS} dimensions at most", place=where(at))
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

    def read(self, variable: Variable, *, location: bool = False) -> Callable[[Slots], Value]:
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
            case Binary():
                if e.operator in RELATIONS or e.operator in {"AND", "OR", "XOR"}:
                    test = self.condition(e)
                    return lambda s: -1.0 if test(s) else 0.0
                return self._binary(e)
            case Apply():
                return self._functions.real(self, e)
            case _:
                raise ValError("Invalid expression", "a number was expected", place=where(e.at))

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
        a, function, at = self.real(e.operand), arithmetic.UNARY[e.operator], e.at

        def unary(s: Slots) -> float:
            value = a(s)
            try:
                return function(value)
            except ValError as error:
                raise placed(error, at) from None

        return unary

    def _binary(self, e: Binary) -> Real:
        if self.kind(e) is ResultKind.STRING:
            raise ValError("Invalid expression", "a number was expected", place=where(e.at))
        return joined(e.operator, self.real(e.left), self.real(e.right), e.at)

    # Conditions.

    def condition(self, e: Expression) -> Callable[[Slots], bool]:
        """A closure of whether an expression isn't 0; both sides of AND and OR are evaluated, as V+ does."""
        if isinstance(e, Unary) and e.operator == "NOT":
            inner = self.condition(e.operand)
            return lambda s: not inner(s)
        if isinstance(e, Binary) and e.operator in RELATIONS:
            return self._relation(e)
        if isinstance(e, Binary) and e.operator in {"AND", "OR", "XOR"}:
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

    def _relation(self, e: Binary) -> Callable[[Slots], bool]:
        if ResultKind.STRING in (self.kind(e.left), self.kind(e.right)):
            relation = RELATIONS[e.operator]
            left, right = self.string(e.left), self.string(e.right)
            return lambda s: relation(left(s), right(s))
        a, b = self.real(e.left), self.real(e.right)
        match e.operator:
            case "==":
                return lambda s: a(s) == b(s)
            case "<>":
                return lambda s: a(s) != b(s)
            case "<":
                return lambda s: a(s) < b(s)
            case "<=":
                return lambda s: a(s) <= b(s)
            case ">":
                return lambda s: a(s) > b(s)
            case _:
                return lambda s: a(s) >= b(s)

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
                return cast("String", self.read(e))
            case Binary() if e.operator == "+":
                left, right = self.string(e.left), self.string(e.right)
                return lambda s: left(s) + right(s)
            case Apply() if self.kind(e) is ResultKind.STRING:
                return self._functions.string(self, e)
            case _:
                raise ValError("Invalid expression", "a string was expected", place=where(e.at))

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
                        raise ValError("Arithmetic overflow", place=where(e.at))
                    return Transformation(X)

                return compound
            case Apply() if self.kind(e) is ResultKind.TRANSFORMATION:
                return self._functions.frame(self, e)
            case _:
                raise ValError("Invalid expression", "a transformation was expected", place=where(e.at))

    def point(self, e: Expression) -> Callable[[Slots], PrecisionPoint]:
        """A closure of a precision point; HERE and DEST give the joints where one is wanted.

        Raises:
            ValError: If it's of another type.
        """
        if isinstance(e, Variable) and e.prefix == "#":
            return cast("Callable[[Slots], PrecisionPoint]", self.read(e))
        if isinstance(e, Apply):
            return self._functions.point(self, e)
        raise ValError("Invalid expression", "a precision point was expected", place=where(e.at))

    def location(self, e: Expression) -> Callable[[Slots], Location]:
        """A closure of a transformation or a precision point, as the text tells."""
        return self.point(e) if self.kind(e) is ResultKind.POINT else self.transformation(e)

    def value(self, e: Expression) -> Callable[[Slots], Value]:
        """A closure of whatever an expression is."""
        match self.kind(e):
            case ResultKind.REAL:
                return self.real(e)
            case ResultKind.STRING:
                return self.string(e)
            case ResultKind.TRANSFORMATION:
                return self.transformation(e)
            case ResultKind.POINT:
                return self.point(e)
            case ResultKind.NAME:
                assert isinstance(e, Variable)
                return self.read(e)
