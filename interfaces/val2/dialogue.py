"""TYPE and PROMPT as closures."""

from __future__ import annotations

from collections.abc import Generator

from interfaces.val2 import formats
from interfaces.val2.code import StepFunction
from interfaces.val2.context import SPECIAL, Waiting
from interfaces.val2.events import Asked, Typed
from interfaces.val2.expressions import Expressions
from interfaces.val2.memory import VariableSlot, mismatch
from interfaces.val2.operations import Slots
from interfaces.val2.syntax import Expression, Format, Prompt, Variable


def type_step(x: Expressions, items: tuple[Expression | Format, ...], following: int) -> StepFunction:
    """TYPE."""
    context = x.context
    parts = [i if isinstance(i, Format) else x.value(i) for i in items]

    def type_(s: Slots) -> int:
        text, ends = formats.spelled([p if isinstance(p, Format) else p(s) for p in parts])
        if context.switches["MESSAGES"]:
            context.events.append(Typed(text + "\n" if ends else text))
        return context.go_on(following)

    return type_


def prompt_step(x: Expressions, prompt: Prompt, following: int) -> StepFunction:
    """PROMPT: ask, and ask again until the answer is what is wanted."""
    context, text, names = x.context, x.string(prompt.text), prompt.targets
    slots = [x.reference(v) for v in names]
    if any(v.prefix == "#" for v in names):
        raise mismatch(next(v for v in names if v.prefix == "#"))

    def asking(question: str, targets: list[VariableSlot]) -> Generator[float, None, int]:
        context.answers.clear()
        context.asking = True
        try:
            while True:
                context.events.append(Asked(question))
                while not context.answers:
                    yield float("inf")
                values = _answers(context.answers.pop(), names)
                if values is not None:
                    break
                context.events.append(Typed(f"*Illegal value* {_wanted(names)}\n"))
        finally:
            context.asking = False
        for slot, value, name in zip(targets, values, names, strict=True):
            context.memory.store(slot, value, name)
        return following

    def ask(s: Slots) -> int:
        context.pending = Waiting(asking(text(s), [slot(s) for slot in slots]))
        return SPECIAL

    return ask


def _answers(line: str, names: tuple[Variable, ...]) -> list[float | str] | None:
    """The values in an answer: parted by commas or blanks; a string at the end takes what is left.

    Returns:
        None if it isn't what is wanted.
    """
    rest = line.strip("\r\n")
    values: list[float | str] = []
    for n, name in enumerate(names, 1):
        if n == len(names) and name.prefix:
            return [*values, rest if n == 1 else rest.strip()]
        rest = rest.strip()
        end = next((k for k, c in enumerate(rest) if c == "," or (c.isspace() and not name.prefix)), len(rest))
        field, rest = rest[:end].strip(), rest[end:].lstrip().removeprefix(",")
        value = field if name.prefix else formats.whole_number(field)
        if value is None:
            return None
        values.append(value)
    return None if rest.strip() and names else values


def _wanted(names: tuple[Variable, ...]) -> str:
    return ", ".join(f"{v.name}: {'a string' if v.prefix else 'a number'}" for v in names)
