"""Rows of the table of the language: instructions, functions, operators, switches, parameters.

A row says how a word is written, what it does in a line, whose it is, where it's allowed, and what carries it out.
Parser, printer, compiler, checker, help and completion read rows alone; `forms.py` has all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

from interfaces.val2.errors import TextPosition, ValError

Kind: TypeAlias = Literal[
    "real", "condition", "seconds", "time", "speed", "percent", "joint", "mode", "timer", "task", "channel",
    "opening", "priority", "signal", "output", "string", "alike", "location", "frame", "point", "any", "label",
    "count", "program", "variable", "array", "name", "text",
]  # fmt: skip
"""What an operand is: a `location` is a `frame` or a precision `point`, a `variable` something to be set, a `name`
what isn't read, and operands that are `alike` are numbers or strings, all of them; those of the first line are
numbers."""
Origin: TypeAlias = Literal["VAL", "VAL-II", "V+", "ours"]
"""Where a word is known from; VAL-II took over what VAL has, and V+ what VAL-II has."""

MISSING: Final = "Missing argument"
TOO_MANY: Final = "Too many arguments"
TIGHTEST: Final = 10
"""How tightly functions and names bind."""


@dataclass(frozen=True, slots=True)
class OperandSlot:
    """A place for an operand."""

    name: str
    kind: Kind
    required: bool = True
    default: float | None = None
    """What stands for one that was left out; None where that's for the instruction or function to say."""

    @classmethod
    def read(cls, spelled: str) -> OperandSlot:
        """A slot as `Form` has it."""
        named, _, default = spelled.partition("=")
        name, _, kind = named.rstrip("?*").partition(":")
        return cls(name, kind or "real", "?" not in spelled, float(default) if default else None)  # type: ignore[arg-type]


class Form:
    """How something is written, what it does, and what carries it out."""

    def __init__(
        self,
        name: str,
        spelled: str,
        explanation: str,
        origin: Origin,
        act: Callable[..., Any] | None = None,
        *,
        words: str = "",
        usage: str = "",
        rule: str = "",
        tags: str = "",
        level: int = TIGHTEST,
    ) -> None:
        """Read a row.

        Args:
            name: Upper case; of a function with its prefix.
            spelled: Slots such as `target:location, hand:real?=0`, and what a function gives: `angle -> real`. Of
                a slot that ends in `?` the operand may be left out; the number behind `=` stands for it then. One
                that ends in `*` may come many times.
            explanation: What it does, a line.
            origin: Where it's known from.
            act: Carries it out: of a function, takes the arguments' values; of an instruction, makes the closure
                of a step.
            words: What may stand behind the operands, in their order, one of each group at most: `MMPS|IPS ALWAYS`.
            usage: How it's written, where that isn't told by the slots.
            rule: How an instruction's line goes on behind its keyword: what `grammar.lark` has behind this word, in
                upper case; operands between commas, and words, if nothing is said.
            tags: What else is to be known of it: of a function `constant` (it may be written without parentheses,
                and its name can't be a variable's), `context`, `dialect` (its first argument is that); of an
                instruction `opens`, `closes` (a structure; both: divides one), `program` (it can't stand alone),
                `beside` (DO may do it while a program runs), `whole` (it isn't abbreviated); of a function
                `unreserved` (see `functions.UNRESERVED`); of both `reading` (no source could be read that has more
                than the word: the form is our reading).
            level: How tightly an operator binds.
        """
        operands, _, gives = spelled.partition("-> ")
        self.name, self.help, self.act, self.level = name, explanation, act, level
        self.rule = rule or ("worded" if words else "operands")
        self.tags = frozenset(tags.split())
        self.origin = f"{origin} †" if "reading" in self.tags else origin
        self.gives = gives
        """Of a function: a kind, or `truth`."""
        self.alike = ":alike" in operands
        """Whether its operands are numbers or strings, all of them."""
        self.repeats = "*" in operands
        """Whether the last operand may come many times."""
        self.slots = tuple(OperandSlot.read(part) for part in operands.strip().split(", ") if part)
        self.words = tuple(tuple(group.split("|")) for group in words.split())
        self.allowed_words = tuple(word for group in self.words for word in group)
        self.usage = usage or self._usage()
        self.inside = self.usage.partition("(")[2].partition(")")[0].count(",") + 1
        """Of a logical unit's instruction, how many operands are in parentheses."""

    def _usage(self) -> str:
        shown = ""
        for i, slot in enumerate(self.slots):
            piece = f"{', ' if i else ''}{slot.name}"
            shown += piece if slot.required else f"[{piece}]"
        shown += ", .." if self.repeats else ""
        if self.gives:
            return self.name if "constant" in self.tags else f"{self.name}({shown})"
        return f"{self.name} {shown}".rstrip() + "".join(f" [{'|'.join(group)}]" for group in self.words)

    def slot(self, n: int) -> OperandSlot:
        """The slot of an operand, counted from 0: the last one is that of all behind it."""
        return self.slots[min(n, len(self.slots) - 1)]

    def expect(self, operands: Sequence[object | None], at: TextPosition | None = None) -> None:
        """Count the operands of an instruction or a function.

        Args:
            operands: None where one was left out.
            at: Where the error is, if that's not at one too many.

        Raises:
            ValError: If there are too few or too many of them.
        """
        if len(operands) > len(self.slots) and not self.repeats:
            place = at or getattr(operands[len(self.slots)], "at", None)
            raise ValError(TOO_MANY, f"allowed: {self.usage}", place=place)
        for i in range(max(len(operands), len(self.slots))):
            if self.slot(i).required and (i >= len(operands) or operands[i] is None):
                raise ValError(MISSING, f"{self.slot(i).name}; allowed: {self.usage}", place=at)


@dataclass(frozen=True, slots=True)
class Setting:
    """A switch, which ENABLE and DISABLE turn, or a number that PARAMETER sets."""

    name: str
    default: float
    """Of a switch, whether it's on."""
    help: str
    origin: Origin
    low: float = 0.0
    high: float = 1.0
    unit: str = ""

    def require(self, value: float, what: str = "Illegal value", at: TextPosition | None = None) -> None:
        """See that a parameter may have a value.

        Raises:
            ValError: If it may not.
        """
        if not self.low <= value <= self.high:
            detail = f"{value:.9g}; allowed: {self.name} of {self.low:g} to {self.high:g} {self.unit}"
            raise ValError(what, detail.rstrip(), place=at)


SWITCHES: Final = {
    row.name: row
    for row in (
        Setting("CP", True, "Continuous path: motions go round their destinations.", "VAL-II"),
        Setting("DRY.RUN", False, "Programs run without motion.", "V+"),
        Setting("MESSAGES", True, "TYPE prints.", "VAL-II"),
        Setting("POWER", True, "The arm has power.", "V+"),
        Setting("TRACE", False, "Each step is told as it's done.", "VAL-II"),
        Setting("UPPER", False, "Small letters count as capital ones where strings are compared.", "VAL-II"),
    )
}
"""What ENABLE and DISABLE turn."""
PARAMETERS: Final = {
    row.name: row
    for row in (
        Setting("HAND.TIME", 0.05, "How long OPENI, CLOSEI and RELAXI take.", "VAL-II", 0.0, 60.0, "s"),
        Setting("HAND.LOAD", 0.0, "What the real hand holds while it's closed.", "ours", 0.0, 20.0, "kg"),
        Setting(
            "VPLUS", 0.0, "Angles of the prompt, and of files that don't say: 1 is V+'s yaw, pitch, roll.", "ours"
        ),
    )
}
"""What PARAMETER sets."""
TIMERS: Final = range(16)
CHANNELS: Final = range(1, 33)
"""Of analogue inputs and outputs, and of ports, each."""
TASKS: Final = range(28)
"""Programs that may run beside each other. Task 0 is the main one, which has the arm as it begins."""
NUMBERS: Final = {"timer": TIMERS, "channel": CHANNELS, "task": TASKS, "joint": range(1, 7)}


def numbered(what: str, number: float) -> int:
    """The number of a timer, a channel, a task or a joint.

    Raises:
        ValError: If there's no such one.
    """
    numbers = NUMBERS[what]
    if number not in numbers:
        raise ValError(f"Illegal {what} number", f"{number:.9g}: {numbers[0]} to {numbers[-1]}")
    return int(number)
