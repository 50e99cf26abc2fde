"""The syntax tree of VAL-II: a program is a run of steps, a step an optional label and a statement.

Structures stay flat, as they're edited and listed: `IF`, `ELSE` and `END` are steps of their own, and
`structure.py` says which belong together. Names are lower case, keywords upper case. Trees that differ in places
alone are equal.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

from interfaces.val2.errors import NOWHERE, TextPosition
from interfaces.val2.values import VAL2, Dialect


@dataclass(frozen=True, slots=True)
class Number:
    """A number."""

    value: float
    at: TextPosition = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Text:
    """A string between quotes."""

    value: str
    at: TextPosition = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Variable:
    """A name: of a real or a transformation by its use, of a precision point (`#`) or a string (`$`)."""

    name: str
    """Lower case, at most 15 characters beside the prefix, which is part of it."""
    indices: tuple[Expression, ...] = ()
    at: TextPosition = field(default=NOWHERE, compare=False)
    array: bool = False
    """A whole array: `a[]`."""

    @property
    def prefix(self) -> str:
        """`#`, `$` or nothing."""
        return self.name[0] if self.name[0] in "#$" else ""


@dataclass(frozen=True, slots=True)
class Apply:
    """A function, a constant or an operator, such as `TRANS(..)`, `SHIFT(p BY 1,,3)`, `HERE`, `PI`, `-x`, `a+b`."""

    function: str
    """Upper case; with its prefix, as `$ENCODE`, `#PPOINT`; of an operator as in `functions.OPERATORS`."""
    arguments: tuple[Expression | Format | None, ...] = ()
    """None for one that was left out; formats in `$ENCODE` alone."""
    at: TextPosition = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Compound:
    """A compound transformation `a:b:c`, two parts or more."""

    parts: tuple[Expression, ...]
    at: TextPosition = field(default=NOWHERE, compare=False)


Expression: TypeAlias = Number | Text | Variable | Apply | Compound


def children(expression: Expression) -> tuple[Expression, ...]:
    """The expressions that an expression is made of."""
    match expression:
        case Variable(indices=indices):
            return indices
        case Apply(arguments=arguments):
            return tuple(a for a in arguments if a is not None and not isinstance(a, Format))
        case Compound(parts=inner):
            return inner
    return ()


def parts(expression: Expression) -> Iterator[Expression]:
    """An expression and all that it's made of, outer ones first."""
    yield expression
    for child in children(expression):
        yield from parts(child)


def literal(expression: Expression | Format | None) -> float | None:
    """The value of a number that is written down, with a minus or without; None of anything else."""
    match expression:
        case Number(value):
            return value
        case Apply("-", (Number(value),)):
            return -value
    return None


@dataclass(frozen=True, slots=True)
class Format:
    """A control item of `TYPE` and `$ENCODE`: `/S`, `/C2`, `/X3`, `/F8.2`, `/I4`, `/D`..."""

    code: str
    """A letter, upper case."""
    width: int | None = None
    decimals: int | None = None


@dataclass(frozen=True, slots=True)
class Instruction:
    """A keyword with its operands, as `forms.py` describes it: `MOVE`, `IF`, `CALL`, `TYPE`..

    `=` is an assignment to a real or a string, `SET` to a location. The keyword of a blank line, or of a comment
    alone, is empty. `IF .. GOTO` has its label as second operand.
    """

    keyword: str
    """Upper case."""
    operands: tuple[Any, ...] = ()
    """Expressions, `Format` among them for `TYPE`; None for one that was left out."""
    words: tuple[str, ...] = ()
    """Words after them, upper case, in the order of `forms.py`: `MMPS`, `ALWAYS`; names of switches, or of a
    parameter; `REAL` or `LOC` of `AUTO` and its like."""
    at: TextPosition = field(default=NOWHERE, compare=False)
    begins: Expression | None = None
    """Time of `AT time` before a motion, on the same line."""
    program: str = ""
    """What `CALL`, `GOSUB` and `REACT` call; empty for `REACT` that returns from the program that runs."""
    passed: str | None = None
    """The rest of the line as it was written, where it's recognised but has no meaning here: it's passed over,
    with a warning."""

    @property
    def expressions(self) -> list[Expression]:
        """Those that it's made of, none that was left out."""
        return [one for one in (*self.operands, self.begins) if one is not None and not isinstance(one, Format)]


BLANK: Final = Instruction("")
"""Nothing, or a comment alone."""


@dataclass(frozen=True, slots=True)
class Step:
    """A line of a program."""

    statement: Instruction
    label: int | None = None
    """0 to 65535."""
    comment: str | None = None
    """What follows `;`, without it; None for no comment."""
    at: TextPosition = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Program:
    """A program."""

    name: str
    parameters: tuple[Variable, ...] = ()
    """Arguments by reference; `x[]` is a whole array."""
    steps: tuple[Step, ...] = ()
    """Step n is `steps[n - 1]`."""
    comment: str | None = None
    """Of the `.PROGRAM` line."""
    at: TextPosition = field(default=NOWHERE, compare=False)
    dialect: Dialect = VAL2
    """In which its angles are."""
