"""Of what kind expressions are and have to be: what can be told without running them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from interfaces.val2 import forms
from interfaces.val2.errors import ValError
from interfaces.val2.forms import Kind
from interfaces.val2.syntax import (
    Apply,
    Assign,
    Binary,
    Call,
    Case,
    Compound,
    Conditional,
    Expression,
    For,
    Format,
    Goto,
    Instruction,
    Number,
    Prompt,
    React,
    Statement,
    Text,
    Type,
    Unary,
    Value,
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


def reads(statement: Statement) -> Iterator[tuple[Expression, Kind]]:
    """What a statement reads, and what kind each has to be of; indices of what it sets among it."""
    match statement:
        case Assign(target, value, "SET"):
            yield value, "point" if target.prefix == "#" else "frame"
        case Assign(_, value, "DECOMPOSE"):
            yield value, "location"
        case Assign(target, value):
            yield value, "string" if target.prefix == "$" else "real"
        case Instruction("HERE", (Compound(parts=(*others, _)),)):
            yield from ((other, "frame") for other in others)
        case Instruction("HERE"):
            pass
        case Instruction("BASE", (Variable() | Apply() | Compound() as only,)):
            yield only, "any"
        case Instruction(keyword, operands):
            row = forms.INSTRUCTIONS[keyword]
            slots = row.slots
            for i, operand in enumerate(operands):
                if operand is not None and slots:
                    yield operand, slots[min(i, len(slots) - 1)].kind
        case Conditional(_, condition) | Goto(_, condition) if condition is not None:
            yield condition, "real"
        case For(_, start, stop, step):
            yield from ((part, "real") for part in (start, stop, step) if part is not None)
        case Case(value):
            yield value, "any"
        case Value(values):
            yield from ((value, "any") for value in values)
        case Call(arguments=arguments):
            yield from ((a, "any") for a in arguments if a is not None and not isinstance(a, Variable))
        case React(signal):
            yield signal, "real"
        case Type(items):
            yield from ((item, "any") for item in items if not isinstance(item, Format))
        case Prompt(text):
            yield text, "string"
    if isinstance(statement, Instruction) and statement.begins is not None:
        yield statement.begins, "real"
    for target in writes(statement):
        yield from ((index, "real") for index in target.indices)


def writes(statement: Statement) -> Iterator[Variable]:
    """The variables that a statement may set."""
    match statement:
        case Assign(target):
            yield target
        case Instruction("HERE", (Variable() as target,)):
            yield target
        case Instruction("HERE", (Compound(parts=(*_, Variable() as target)),)):
            yield target
        case For(variable):
            yield variable
        case Prompt(_, targets):
            yield from targets
        case Call(arguments=arguments):
            yield from (a for a in arguments if isinstance(a, Variable))
    for expression, _ in _decoded(statement):
        for part in parts(expression):
            match part:
                case Apply("$DECODE", (Variable() as target, *_)):
                    yield target


def _decoded(statement: Statement) -> Iterator[tuple[Expression, Kind]]:
    """Where `$DECODE` may stand, which shortens its first argument."""
    match statement:
        case Assign(_, value, ""):
            yield value, "any"
        case Type(items):
            yield from ((item, "any") for item in items if not isinstance(item, Format))


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


def mistakes(expression: Expression, wanted: Kind, known: Mapping[str, str]) -> Iterable[ValError]:
    """What in an expression can't be of the kind that it has to be of.

    Args:
        expression: The expression.
        wanted: What it has to be.
        known: What is known of names without a prefix.
    """
    kind = kind_of(expression, known)
    if wanted == "point" and isinstance(expression, Apply) and expression.function in _STANDING:
        kind = POINT
    if kind and wanted in _FITS and kind not in _FITS[wanted]:
        yield ValError("Mixed types", f"{_SHOWN[kind]} where {_SHOWN[wanted]} is wanted", place=expression.at)
        return
    match expression:
        case Apply(name, arguments):
            slots = forms.FUNCTIONS[name].slots
            for i, argument in enumerate(arguments):
                if argument is not None and not isinstance(argument, Format):
                    yield from mistakes(argument, slots[min(i, len(slots) - 1)].kind, known)
        case Compound(parts):
            for part in parts:
                yield from mistakes(part, "frame", known)
        case Binary(operator, left, right) if operator == "+" or operator in _RELATIONS:
            yield from _alike(expression, left, right, known)
        case _:
            for child in children(expression):
                yield from mistakes(child, "real", known)


def _alike(whole: Binary, left: Expression, right: Expression, known: Mapping[str, str]) -> Iterable[ValError]:
    """`+` and relations take two numbers or two strings."""
    kinds = {kind_of(left, known), kind_of(right, known)} - {""}
    if kinds == {"real", "string"}:
        yield ValError("Mixed types", f"a number and a string with {whole.operator} between them", place=whole.at)
        return
    wanted: Kind = "string" if kinds == {"string"} else "real"
    if kinds:
        yield from mistakes(left, wanted, known)
        yield from mistakes(right, wanted, known)
