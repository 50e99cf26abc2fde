"""Operands of instructions, as closures."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from interfaces.val2.context import Context
from interfaces.val2.errors import ValError
from interfaces.val2.expressions import Expressions
from interfaces.val2.memory import where
from interfaces.val2.operations import Real, Slots
from interfaces.val2.syntax import Expression, Instruction

Ask: TypeAlias = Callable[[], None]
"""Asks for what an instruction wants; its operands have been evaluated."""


class Operands:
    """The operands of one instruction, as closures."""

    def __init__(self, x: Expressions, instruction: Instruction) -> None:
        self.x, self.given, self.instruction = x, instruction.operands, instruction

    def present(self, i: int) -> bool:
        """Whether it's there."""
        return i < len(self.given) and self.given[i] is not None

    def expression(self, i: int) -> Expression:
        """An operand.

        Raises:
            ValError: If it's missing.
        """
        if self.present(i):
            return self.given[i]  # type: ignore[return-value]
        raise ValError("Missing argument", self.instruction.keyword, place=where(self.instruction.at))

    def real(self, i: int, otherwise: float | None = None) -> Real:
        """A real; without `otherwise` it must be there."""
        if otherwise is not None and not self.present(i):
            return lambda _: otherwise
        return self.x.real(self.expression(i))

    def reals(self, count: int, otherwise: float = 0.0) -> list[Real]:
        """The first few, those that were left out filled up."""
        return [self.real(i, otherwise) for i in range(count)]

    def says(self, word: str) -> bool:
        """Whether a word follows."""
        return word in self.instruction.words


Preparation: TypeAlias = Callable[[Operands, Context], Callable[[Slots], Ask]]
"""Makes a closure that evaluates an instruction's operands, and gives what then asks."""


def numbers(o: Operands, count: int, ask: Callable[..., None], *, all_given: bool = True) -> Callable[[Slots], Ask]:
    """Prepare a call with the first few operands, reals all; `all_given` if none of them may be left out."""
    parts = [o.real(i) for i in range(count)] if all_given else o.reals(count)

    def prepare(s: Slots) -> Ask:
        values = [p(s) for p in parts]
        return lambda: ask(*values)

    return prepare
