"""Of what kind expressions are: what can be told without running them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from interfaces.val2 import forms
from interfaces.val2.errors import ValError
from interfaces.val2.slots import Kind
from interfaces.val2.syntax import (
    Apply,
    Binary,
    Compound,
    Expression,
    Format,
    Number,
    Text,
    Unary,
    Variable,
)
from interfaces.val2.walk import children

POINT: Final = "precision point"
_RELATIONS: Final = ("==", "<>", "<", "<=", ">", ">=")
_SHOWN: Final[Mapping[str, str]] = {
    "real": "a number", "string": "a string", "frame": "a transformation", "location": "a location",
    POINT: "a precision point", "point": "a precision point",
}  # fmt: skip
_FITS: Final[Mapping[str, tuple[str, ...]]] = {
    "real": ("real",),
    "string": ("string",),
    "frame": ("frame",),
    "point": (POINT,),
    "location": ("frame", POINT, "location"),
}
_STANDING: Final = ("HERE", "DEST")
"""Functions that give joints where a precision point is wanted."""


def kind_of(expression: Expression, known: Mapping[str, str]) -> str:
    """`real`, `string`, `frame`, `precision point`, or nothing if it can't be told.

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
