"""Steps that DO may do: alone, and while a program runs."""

from __future__ import annotations

from typing import Final

from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.memory import where
from interfaces.val2.syntax import (
    AnyValue,
    Assign,
    Case,
    Decompose,
    Do,
    Else,
    EndBlock,
    Exit,
    For,
    Goto,
    If,
    IfGoto,
    Instruction,
    Local,
    Next,
    Return,
    Set,
    Step,
    Type,
    Until,
    Value,
    While,
)  # fmt: skip

_MEANWHILE: Final = {
    "SIGNAL", "RESET", "ENABLE", "DISABLE", "PARAMETER", "TIMER", "SPEED", "HERE", "ALTOUT", "ALTER", "NOALTER",
}  # fmt: skip
"""What DO may do while a program runs, beside assignments and TYPE."""


def stray(step: Step, at: TextPosition) -> ValError | None:
    """Why a step can't stand alone, as DO wants it; None if it can."""
    match step.statement:
        case (
            If()
            | Else()
            | EndBlock()
            | While()
            | Do()
            | Until()
            | For()
            | Case()
            | Value()
            | AnyValue()
            | Exit()
            | Next()
        ):
            return ValError("Control structure error", "it's for programs", place=where(at))
        case Goto() | IfGoto() | Return() | Local():
            return ValError("Control structure error", "it's for programs", place=where(at))
        case _:
            return None


def meanwhile(step: Step) -> bool:
    """Whether a step takes no time and moves nothing."""
    match step.statement:
        case Assign() | Set() | Type() | Decompose():
            return True
        case Instruction(keyword, _, words):
            return keyword in _MEANWHILE and (keyword != "SPEED" or "MONITOR" in words)
        case _:
            return False
