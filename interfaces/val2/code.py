"""A compiled program: a closure a step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

from interfaces.val2.errors import ValError
from interfaces.val2.memory import VariableSlot
from interfaces.val2.operations import Slots
from interfaces.val2.syntax import Program

StepFunction: TypeAlias = Callable[[Slots], int]
"""Does a step and returns the next one's index, or SPECIAL."""


@dataclass(frozen=True, slots=True)
class Code:
    """A compiled program."""

    program: Program
    steps: list[StepFunction]
    """One more than the program has: the last is its end."""
    names: int
    """How many names are the call's own: arguments first."""
    kept: int
    """How many FOR and CASE there are."""

    def slots(self, arguments: list[VariableSlot]) -> list[Any]:
        """What a call has of its own.

        Raises:
            ValError: If there are too many arguments.
        """
        if len(arguments) > len(self.program.parameters):
            raise ValError("Too many arguments", f"{self.program.name} takes {len(self.program.parameters)}")
        return [*arguments, *[VariableSlot() for _ in range(self.names - len(arguments))], *[None] * self.kept]
