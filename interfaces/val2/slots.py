"""How words of the language are written: what a row of the tables in `forms.py` holds."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from interfaces.val2.errors import TextPosition, ValError

Kind: TypeAlias = Literal[
    "real", "string", "location", "any", "label", "program", "variable", "frame", "point", "array", "text"
]
"""What an operand is: a `location` is a `frame` or a precision `point`, a `variable` something to be set."""
Origin: TypeAlias = Literal["VAL", "VAL-II", "V+", "ours"]
"""Where a word is known from; VAL-II took over what VAL has, and V+ what VAL-II has."""

MISSING: Final = "Missing argument"
TOO_MANY: Final = "Too many arguments"


@dataclass(frozen=True, slots=True)
class OperandSlot:
    """A place for an operand."""

    name: str
    kind: Kind
    required: bool = True


@dataclass(frozen=True, slots=True)
class InstructionForm:
    """How an instruction is written."""

    keyword: str
    slots: tuple[OperandSlot, ...]
    words: tuple[tuple[str, ...], ...]
    """Words behind the operands, in their order, one of each group at most."""
    help: str
    origin: Origin
    group: str
    repeats: bool = False
    """Whether the last operand may come many times."""
    usage: str = ""
    """How it's written."""
    own: bool = False
    """Whether it has a node of its own in the tree, and isn't an `Instruction`."""

    @property
    def allowed_words(self) -> tuple[str, ...]:
        """All the words that may stand behind the operands."""
        return tuple(word for group in self.words for word in group)


@dataclass(frozen=True, slots=True)
class Function:
    """How a function is written."""

    name: str
    slots: tuple[OperandSlot, ...]
    gives: Kind
    help: str
    origin: Origin
    repeats: bool = False
    constant: bool = False
    """It may be written without parentheses, and its name can't be a variable's."""
    usage: str = ""
    idle: bool = False
    """It's recognised, but has no meaning here: 0, or an empty string."""

    def expect(self, arguments: Sequence[object | None], at: TextPosition) -> None:
        """Count the arguments.

        Raises:
            ValError: If there are too few or too many of them.
        """
        if len(arguments) > len(self.slots) and not self.repeats:
            raise ValError(TOO_MANY, f"{self.name}: {self.usage}", place=at)
        for i, slot in enumerate(self.slots):
            if slot.required and (i >= len(arguments) or arguments[i] is None):
                raise ValError(MISSING, f"{self.name}: {self.usage}", place=at)


@dataclass(frozen=True, slots=True)
class Switch:
    """Something that ENABLE and DISABLE turn on and off."""

    name: str
    default: bool
    help: str
    origin: Origin


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number that PARAMETER sets."""

    name: str
    default: float
    low: float
    high: float
    unit: str
    help: str
    origin: Origin


def slots_of(spelled: str) -> tuple[tuple[OperandSlot, ...], bool]:
    """Slots such as `target:location, hand:real?`, and whether the last (`*`) repeats."""
    slots = []
    for part in filter(None, (p.strip() for p in spelled.split(","))):
        name, _, kind = part.rstrip("?*").partition(":")
        slots.append(OperandSlot(name, kind or "real", required="?" not in part))  # type: ignore[arg-type]
    return tuple(slots), "*" in spelled


def form(
    keyword: str,
    spelled: str,
    explanation: str,
    origin: Origin,
    group: str,
    *,
    words: str = "",
    usage: str = "",
    own: bool = False,
) -> InstructionForm:
    """A row of the table: slots as `slots_of` reads them, words as `MMPS|IPS ALWAYS`."""
    slots, repeats = slots_of(spelled)
    groups = tuple(tuple(group.split("|")) for group in words.split())
    return InstructionForm(
        keyword,
        slots,
        groups,
        explanation,
        origin,
        group,
        repeats,
        usage or _usage(keyword, slots, groups, repeats),
        own,
    )


def function(
    name: str,
    spelled: str,
    gives: Kind,
    explanation: str,
    origin: Origin,
    *,
    constant: bool = False,
    usage: str = "",
    idle: bool = False,
) -> Function:
    """A row of the table of functions."""
    slots, repeats = slots_of(spelled)
    shown = usage or (name if constant and not slots else f"{name}({_listed(slots, repeats)})")
    return Function(name, slots, gives, explanation, origin, repeats, constant, shown, idle)


def _usage(keyword: str, slots: tuple[OperandSlot, ...], groups: tuple[tuple[str, ...], ...], repeats: bool) -> str:
    words = "".join(f" [{'|'.join(group)}]" for group in groups)
    return f"{keyword} {_listed(slots, repeats)}".rstrip() + words


def _listed(slots: tuple[OperandSlot, ...], repeats: bool) -> str:
    shown = ""
    for i, slot in enumerate(slots):
        piece = f"{', ' if i else ''}{slot.name}"
        shown += piece if slot.required else f"[{piece}]"
    return shown + (", .." if repeats else "")


def nearest(word: str, words: Iterable[str]) -> str:
    """`; did you mean MOVES?`, or nothing."""
    close = nearest_word(word, words)
    return f"; did you mean {close}?" if close else ""


def nearest_word(word: str, words: Iterable[str]) -> str:
    """The word that is most like another, upper case; empty where none is."""
    return next(iter(difflib.get_close_matches(word.upper(), list(words), n=1, cutoff=0.7)), "")
