"""The syntax tree of VAL-II: a program is a run of steps, a step an optional label and a statement.

Structures stay flat, as they're edited and listed: `IF`, `ELSE` and `END` are steps of their own, and
`structure.py` says which belong together. Names are lower case, keywords upper case. Trees that differ in places
alone are equal.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

from interfaces.val2.errors import NOWHERE, TextPosition


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
    """A function or a constant of the language, such as `TRANS(..)`, `SHIFT(p BY 1,,3)`, `HERE`, `PI`."""

    function: str
    """Upper case; with its prefix, as `$ENCODE`, `#PPOINT`."""
    arguments: tuple[Expression | Format | None, ...] = ()
    """None for one that was left out; formats in `$ENCODE` alone."""
    at: TextPosition = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Unary:
    """`-`, `NOT` or `COM` before an expression."""

    operator: str
    operand: Expression
    at: TextPosition = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Binary:
    """Two expressions with `+ - * / MOD ^ == <> < <= > >= AND OR XOR BAND BOR BXOR` between them."""

    operator: str
    left: Expression
    right: Expression
    at: TextPosition = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Compound:
    """A compound transformation `a:b:c`, two parts or more."""

    parts: tuple[Expression, ...]
    at: TextPosition = field(default=NOWHERE, compare=False)


Expression: TypeAlias = Number | Text | Variable | Apply | Unary | Binary | Compound


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


@dataclass(frozen=True, slots=True)
class Ignored:
    """Something that is recognised but has no meaning here: it's passed over, with a warning."""

    keyword: str
    rest: str
    """The rest of the line as it was written."""
    at: TextPosition = field(default=NOWHERE, compare=False)


Statement: TypeAlias = Instruction | Ignored
BLANK: Final = Instruction("")
"""Nothing, or a comment alone."""


@dataclass(frozen=True, slots=True)
class Step:
    """A line of a program."""

    statement: Statement
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
