"""What a controller tells its monitor: values, in the order in which they happened."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from interfaces.val2.errors import ValError


@dataclass(frozen=True, slots=True)
class Typed:
    """A program wrote something."""

    text: str
    """With its line ends."""


@dataclass(frozen=True, slots=True)
class Asked:
    """A program wants a line: `Controller.answer`."""

    text: str
    """What it asks; no line end."""


@dataclass(frozen=True, slots=True)
class ProgramPaused:
    """A program stands before a step, and can go on."""

    program: str
    step: int
    """The next step, from 1."""
    word: str
    """Why: `PAUSE`, `ABORT` or `XSTEP`."""


@dataclass(frozen=True, slots=True)
class ProgramEnded:
    """A program, or a `DO`, is done."""

    program: str
    """Empty for a `DO`."""
    word: str
    """How: `END`, `STOP`, `HALT`, `ABORT` or `DO`."""


@dataclass(frozen=True, slots=True)
class ProgramFailed:
    """A program, or a `DO`, was stopped by an error."""

    error: ValError


@dataclass(frozen=True, slots=True)
class Warned:
    """Something was passed over."""

    text: str


@dataclass(frozen=True, slots=True)
class SignalChanged:
    """A signal turned on or off."""

    number: int
    on: bool


Event: TypeAlias = Typed | Asked | ProgramPaused | ProgramEnded | ProgramFailed | Warned | SignalChanged
