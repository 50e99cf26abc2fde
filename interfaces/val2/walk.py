"""Going through trees: the expressions of statements, and the parts of expressions."""

from __future__ import annotations

from collections.abc import Iterator

from interfaces.val2 import forms
from interfaces.val2.slots import Kind
from interfaces.val2.syntax import (
    Apply,
    Assign,
    Binary,
    Call,
    Case,
    Compound,
    Decompose,
    Expression,
    For,
    Format,
    If,
    IfGoto,
    Instruction,
    Prompt,
    React,
    Set,
    Statement,
    Type,
    Unary,
    Until,
    Value,
    Variable,
    While,
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
        case Assign(target, value):
            yield value, "string" if target.prefix == "$" else "real"
        case Set(target, value):
            yield value, "point" if target.prefix == "#" else "frame"
        case Decompose(_, value):
            yield value, "location"
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
        case If(condition) | IfGoto(condition) | While(condition) | Until(condition):
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
        case Assign(target) | Set(target) | Decompose(target):
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
        case Assign(value=value):
            yield value, "any"
        case Type(items):
            yield from ((item, "any") for item in items if not isinstance(item, Format))
