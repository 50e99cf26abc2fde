"""Of what kind expressions are and have to be: what can be told without running them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from interfaces.val2 import forms
from interfaces.val2.errors import ValError
from interfaces.val2.forms import Kind
from interfaces.val2.syntax import (
    Apply,
    Binary,
    Compound,
    Expression,
    Format,
    Instruction,
    Number,
    Statement,
    Text,
    Unary,
    Variable,
)


def children(expression: Expression) -> tuple[Expression, ...]:
    """The expressions that an expression is made of."""
    match expression:
        case Variable(indices=indices):
            return indices
        case Apply(arguments=arguments):
            return tuple(a for a in arguments if a is not None and not isinstance(a, Format))
        case Unary(operand=operand):
            return (operand,)
        case Binary(left=left, right=right):
            return (left, right)
        case Compound(parts=parts):
            return parts
    return ()


def parts(expression: Expression) -> Iterator[Expression]:
    """An expression and all that it's made of, outer ones first."""
    yield expression
    for child in children(expression):
        yield from parts(child)


def _operands(i: Statement) -> Iterator[tuple[Expression, Kind]]:
    """The operands of an instruction, and what kind each has to be of: `variable` for what it may set."""
    match i:
        case Instruction("=" | "SET", (target, value)):
            yield target, "variable"
            if i.keyword == "=":
                yield value, "string" if target.prefix == "$" else "real"
            else:
                yield value, "point" if target.prefix == "#" else "frame"
        case Instruction("HERE", (target,)):
            *others, last = target.parts if isinstance(target, Compound) else (target,)
            yield from ((other, "frame") for other in others)
            if isinstance(last, Variable):
                yield last, "variable"
        case Instruction("BASE", (Variable() | Apply() | Compound() as only,)):
            yield only, "any"
        case Instruction("CALL" | "GOSUB", given):
            yield from ((a, "variable" if isinstance(a, Variable) else "any") for a in given if a is not None)
        case Instruction(keyword, operands) if keyword not in ("", "AUTO", "LOCAL", "GLOBAL"):
            slots = forms.INSTRUCTIONS[keyword].slots
            for n, operand in enumerate(operands if slots else ()):
                if operand is not None and not isinstance(operand, Format):
                    yield operand, slots[min(n, len(slots) - 1)].kind


def reads(statement: Statement) -> list[tuple[Expression, Kind]]:
    """What a statement reads, and what kind each has to be of; indices of what it sets among it."""
    found = [one for one in _operands(statement) if one[1] != "variable"]
    if isinstance(statement, Instruction) and statement.begins is not None:
        found.append((statement.begins, "real"))
    return found + [(index, "real") for target in writes(statement) for index in target.indices]


def writes(statement: Statement) -> Iterator[Variable]:
    """The variables that a statement may set; `$DECODE` shortens its first argument."""
    for operand, kind in _operands(statement):
        if kind == "variable" and isinstance(operand, Variable):
            yield operand
        elif statement.keyword in ("=", "TYPE"):
            for part in parts(operand):
                match part:
                    case Apply("$DECODE", (Variable() as target, *_)):
                        yield target


def wanted(expression: Expression) -> Iterator[tuple[Expression, Kind]]:
    """The parts of an expression, and what kind each has to be of; those of `+` and relations have to be alike."""
    if isinstance(expression, Apply):
        slots = forms.FUNCTIONS[expression.function].slots
        for i, argument in enumerate(expression.arguments):
            if argument is not None and not isinstance(argument, Format):
                yield argument, slots[i].kind if i < len(slots) else slots[-1].kind
    else:
        kind: Kind = "frame" if isinstance(expression, Compound) else "real"
        yield from ((child, kind) for child in children(expression))


POINT: Final = "point"
_RELATIONS: Final = ("==", "<>", "<", "<=", ">", ">=")
_SHOWN: Final[Mapping[str, str]] = {
    "real": "a number", "string": "a string", "frame": "a transformation", "location": "a location",
    "point": "a precision point",
}  # fmt: skip
_FITS: Final[Mapping[str, tuple[str, ...]]] = {
    "real": ("real",),
    "string": ("string",),
    "frame": ("frame",),
    "point": ("point",),
    "location": ("frame", "point", "location"),
}
_STANDING: Final = ("HERE", "DEST")
"""Functions that give joints where a precision point is wanted."""


def kind_of(expression: Expression, known: Mapping[str, str]) -> str:
    """`real`, `string`, `frame`, `point`, or nothing if it can't be told.

    Args:
        expression: The expression.
        known: What is known of names without a prefix.
    """
    match expression:
        case Number() | Unary():
            return "real"
        case Text():
            return "string"
        case Compound():
            return "frame"
        case Variable(name):
            return {"$": "string", "#": POINT}.get(name[0]) or known.get(name, "")
        case Apply(name):
            gives = forms.FUNCTIONS[name].gives
            return POINT if gives == "location" else gives
        case Binary("+", left, right):
            return "string" if "string" in (kind_of(left, known), kind_of(right, known)) else "real"
        case Binary():
            return "real"


def mistakes(expression: Expression, asked: Kind, known: Mapping[str, str]) -> Iterable[ValError]:
    """What in an expression can't be of the kind that it has to be of.

    Args:
        expression: The expression.
        asked: What it has to be.
        known: What is known of names without a prefix.
    """
    kind = kind_of(expression, known)
    if asked == "point" and isinstance(expression, Apply) and expression.function in _STANDING:
        kind = POINT
    if kind and asked in _FITS and kind not in _FITS[asked]:
        yield ValError("Mixed types", f"{_SHOWN[kind]} where {_SHOWN[asked]} is wanted", place=expression.at)
        return
    if isinstance(expression, Binary) and (expression.operator == "+" or expression.operator in _RELATIONS):
        yield from _alike(expression, expression.left, expression.right, known)
    else:
        for part, kind_of_part in wanted(expression):
            yield from mistakes(part, kind_of_part, known)


def _alike(whole: Binary, left: Expression, right: Expression, known: Mapping[str, str]) -> Iterable[ValError]:
    """`+` and relations take two numbers or two strings."""
    kinds = {kind_of(left, known), kind_of(right, known)} - {""}
    if kinds == {"real", "string"}:
        yield ValError("Mixed types", f"a number and a string with {whole.operator} between them", place=whole.at)
        return
    if kinds:
        for part in (left, right):
            yield from mistakes(part, "string" if kinds == {"string"} else "real", known)
