"""The syntax tree of VAL-II: a program is a run of steps, a step an optional label and a statement.

Structures stay flat, as they're edited and listed: `IF`, `ELSE` and `END` are steps of their own, and
`structure.py` says which belong together. Names are lower case, keywords upper case. Trees that differ in places
alone are equal.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Literal, TypeAlias

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


class PlainStatement(StrEnum):
    """A statement that is its keyword alone."""

    BLANK = ""
    """Nothing, or a comment alone."""
    ELSE = "ELSE"
    END = "END"
    """Of an `IF`, `WHILE`, `FOR` or `CASE`."""
    DO = "DO"
    """Until `UNTIL`."""
    ANY = "ANY"
    """Of a `CASE`."""
    RETURN = "RETURN"
    """From a program that was called."""


@dataclass(frozen=True, slots=True)
class Assign:
    """`x = 3`, `SET p = a:b` or `DECOMPOSE a[1] = location`: variables get a value."""

    target: Variable
    value: Expression
    keyword: Literal["", "SET", "DECOMPOSE"] = ""
    """Nothing for a real or a string, `SET` for a location, `DECOMPOSE` for six numbers from an element on."""


@dataclass(frozen=True, slots=True)
class Instruction:
    """A keyword with its operands, as `forms.py` describes it: `MOVE`, `SPEED`, `SIGNAL`, `OPENI`..."""

    keyword: str
    """Upper case."""
    operands: tuple[Any, ...] = ()
    """Expressions; None for one that was left out."""
    words: tuple[str, ...] = ()
    """Words after them, upper case, in the order of `forms.py`: `MMPS`, `ALWAYS`; a switch's name for `ENABLE`."""
    at: TextPosition = field(default=NOWHERE, compare=False)
    begins: Expression | None = None
    """Time of `AT time` before a motion, on the same line."""


@dataclass(frozen=True, slots=True)
class Conditional:
    """`IF condition THEN`, `WHILE condition DO` or `UNTIL condition`."""

    keyword: Literal["IF", "WHILE", "UNTIL"]
    condition: Expression


@dataclass(frozen=True, slots=True)
class For:
    """`FOR variable = start TO stop STEP step`."""

    variable: Variable
    start: Expression
    stop: Expression
    step: Expression | None = None


@dataclass(frozen=True, slots=True)
class Case:
    """`CASE value OF`."""

    value: Expression


@dataclass(frozen=True, slots=True)
class Value:
    """`VALUE a, b:` of a `CASE`."""

    values: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class LoopJump:
    """`EXIT n` leaves the n innermost loops, `NEXT n` goes to the next turn of the n-th innermost one."""

    keyword: Literal["EXIT", "NEXT"]
    count: int = 1
    at: TextPosition = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Goto:
    """`GOTO label`, or `IF condition GOTO label`."""

    label: int
    condition: Expression | None = None
    at: TextPosition = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Call:
    """`CALL program(arguments)`, or `GOSUB program`."""

    program: str
    arguments: tuple[Expression | None, ...] = ()
    keyword: str = "CALL"
    """`CALL` or `GOSUB`."""
    at: TextPosition = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class React:
    """`REACT signal, program ALWAYS`: call a program when a signal turns on (off if it's negative)."""

    signal: Expression
    program: str = ""
    """What is called; empty to return from the program that runs."""
    immediate: bool = False
    """`REACTI`: the present motion is stopped at once."""
    always: bool = False
    at: TextPosition = field(default=NOWHERE, compare=False)


@dataclass(frozen=True, slots=True)
class Format:
    """A control item of `TYPE` and `$ENCODE`: `/S`, `/C2`, `/X3`, `/F8.2`, `/I4`, `/D`..."""

    code: str
    """A letter, upper case."""
    width: int | None = None
    decimals: int | None = None


@dataclass(frozen=True, slots=True)
class Type:
    """`TYPE item, item`; also what `$ENCODE` takes."""

    items: tuple[Expression | Format, ...]


@dataclass(frozen=True, slots=True)
class Prompt:
    """`PROMPT "text", variable, variable`."""

    text: Expression
    targets: tuple[Variable, ...] = ()


@dataclass(frozen=True, slots=True)
class Local:
    """`AUTO x, y[10]`, `LOCAL x`, `GLOBAL x`: names of the program's own."""

    keyword: str
    """`AUTO`, `LOCAL` or `GLOBAL`."""
    names: tuple[Variable, ...]
    kind: str = ""
    """`REAL`, `LOC`, or nothing."""


@dataclass(frozen=True, slots=True)
class Ignored:
    """Something that is recognised but has no meaning here: it's passed over, with a warning."""

    keyword: str
    rest: str
    """The rest of the line as it was written."""
    at: TextPosition = field(default=NOWHERE, compare=False)


Statement: TypeAlias = (
    PlainStatement | Assign | Instruction | Conditional | For | Case | Value | LoopJump | Goto | Call | React | Type
    | Prompt | Local | Ignored
)  # fmt: skip


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
