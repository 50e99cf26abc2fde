"""What stands behind a keyword: its operands and words."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Final

from interfaces.val2 import forms, grammar
from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.grammar import Node, Worded
from interfaces.val2.slots import MISSING, TOO_MANY, InstructionForm, nearest
from interfaces.val2.syntax import Apply, Expression, Number, Text, Unary, Variable

HIGHEST_LABEL: Final = 65535
_SIMPLE: Final = re.compile(r"\s*([#$]?[A-Za-z][A-Za-z0-9_.]*)\s*\Z")
_PLAIN: Final = re.compile(
    r"\s*(#?[A-Za-z][A-Za-z0-9_.]*)[ \t]*"
    r"\(((?:[ \t]*-?[0-9]{1,15}(?:\.[0-9]*)?[ \t]*,)*[ \t]*-?[0-9]{1,15}(?:\.[0-9]*)?[ \t]*)\)\s*\Z"
)
_NUMBER: Final = re.compile(r"(-?)([0-9]+(?:\.[0-9]*)?)")


class OperandText:
    """What stands behind a keyword: the line with blanks in place of all before it."""

    def __init__(self, code: str, behind: int, at: TextPosition) -> None:
        """Keep the rest of a line.

        Args:
            code: The line, without its comment.
            behind: How many characters the keyword and what stands before it have.
            at: Where the keyword stands.
        """
        self.text = " " * behind + code[behind:]
        self.at, self.line, self.behind = at, at.line, behind

    @property
    def empty(self) -> bool:
        """Whether there's nothing."""
        return not self.text.strip()

    @property
    def end(self) -> TextPosition:
        """Behind the last character of the line."""
        return TextPosition(self.line, max(len(self.text.rstrip()), self.behind) + 1)

    @property
    def start(self) -> TextPosition:
        """At the first character behind the keyword."""
        return TextPosition(self.line, len(self.text) - len(self.text.lstrip()) + 1)

    def tree(self, start: str) -> list[Node]:
        """The children of Lark's tree."""
        return list(grammar.read(self.text, start, self.line).children)

    def expression(self, node: Node) -> Expression:
        """The expression of a tree."""
        return grammar.expression(node, self.line)

    def operands(self) -> list[Worded]:
        """The operands between commas, with the words behind each; none if the rest is empty."""
        if self.empty:
            return []
        if (simple := _SIMPLE.match(self.text)) and simple[1].upper() not in forms.CONSTANTS:
            return [(Variable(grammar.name_of(simple[1]), (), TextPosition(self.line, simple.start(1) + 1)), ())]
        if (plain := _PLAIN.match(self.text)) and (built := self._call_of_numbers(plain)) is not None:
            return [(built, ())]
        return [grammar.operand(node, self.line) for node in self.tree("operands")]

    def _call_of_numbers(self, plain: re.Match[str]) -> Apply | None:
        """A call such as `TRANS(1, 2, -3.5)`, of which long programs are full, without the grammar; or None."""
        name = forms.ALIASES.get(plain[1].upper(), plain[1].upper())
        row = forms.FUNCTIONS.get(name)
        arguments: list[Expression] = []
        for found in _NUMBER.finditer(plain[2]):
            at = TextPosition(self.line, plain.start(2) + found.start() + 1)
            if found[1]:
                magnitude = Number(float(found[2]), TextPosition(self.line, at.column + 1))
                arguments.append(Unary("-", magnitude, at))
            else:
                arguments.append(Number(float(found[2]), at))
        if row is None or len(arguments) != len(row.slots):
            return None
        return Apply(name, tuple(arguments), TextPosition(self.line, plain.start(1) + 1))

    def require(self, form: InstructionForm) -> None:
        """See that there's something.

        Raises:
            ValError: If there's nothing.
        """
        if self.empty:
            raise ValError(MISSING, form.usage, place=self.end)


def operands_and_words(
    row: InstructionForm, given: list[Worded]
) -> tuple[list[Expression | None], tuple[str, ...]]:
    """Tell operands from words, which look like variables where no operand stands before them.

    Raises:
        ValError: If a word isn't allowed.
    """
    operands: list[Expression | None] = []
    found: list[tuple[str, TextPosition]] = []
    allowed = row.allowed_words
    for operand, words in given:
        word = as_word(operand)
        if word in allowed and isinstance(operand, Variable | Text):
            found.append((word, operand.at))
        else:
            operands.append(operand)
        found += words
    while operands and operands[-1] is None:
        operands.pop()
    return operands, _ordered(row, found)


def _ordered(row: InstructionForm, found: list[tuple[str, TextPosition]]) -> tuple[str, ...]:
    words = []
    for group in row.words:
        here = [(word, at) for word, at in found if word in group]
        if len(here) > 1:
            raise ValError("Syntax error", f"one of {', '.join(group)} is allowed", place=here[1][1])
        words += [word for word, _ in here]
    for word, at in found:
        if word not in row.allowed_words:
            detail = f"unexpected {word}; allowed: {row.usage}"
            raise ValError("Syntax error", detail, place=at)
    return tuple(words)


def as_word(operand: Expression | None) -> str:
    """The word that an operand looks like, upper case; empty if it looks like none."""
    if isinstance(operand, Variable) and not operand.indices and not operand.array:
        return operand.name.upper()
    return operand.value.upper() if isinstance(operand, Text) else ""


def count(row: InstructionForm, operands: list[Expression | None], rest: OperandText) -> None:
    """Count the operands.

    Raises:
        ValError: If there are too few or too many of them.
    """
    if len(operands) > len(row.slots) and not row.repeats:
        extra = operands[len(row.slots)]
        raise ValError(TOO_MANY, f"allowed: {row.usage}", place=extra.at if extra is not None else rest.end)
    for i, slot in enumerate(row.slots):
        if slot.required and (i >= len(operands) or operands[i] is None):
            raise ValError(MISSING, f"{slot.name}; allowed: {row.usage}", place=rest.end)


def label(token: Node, rest: OperandText) -> int:
    """The label of a token.

    Raises:
        ValError: If there can't be such a label.
    """
    return checked_label(grammar.number(token, rest.line), TextPosition(rest.line, token.column))


def checked_label(value: float, at: TextPosition) -> int:
    """The label of a number.

    Raises:
        ValError: If there can't be such a label.
    """
    if not value.is_integer() or value > HIGHEST_LABEL:
        raise ValError("Invalid label", f"allowed: 0 to {HIGHEST_LABEL}", place=at)
    return int(value)


def label_of(operand: Expression | None, rest: OperandText) -> int:
    """The label that an operand names.

    Raises:
        ValError: If it isn't one.
    """
    if isinstance(operand, Number):
        return checked_label(operand.value, operand.at)
    raise ValError("Invalid label", f"allowed: 0 to {HIGHEST_LABEL}", place=operand.at if operand else rest.start)


def see_no_slip(kind: str, names: list[str], known: Collection[str], at: TextPosition) -> None:
    """See that names which aren't known don't look like those that are, and don't stand beside them.

    Raises:
        ValError: If one does.
    """
    for name in names:
        close = nearest(name, known)
        if name not in known and (close or len(names) > sum(one not in known for one in names)):
            raise ValError(f"Unknown {kind}", f"{name}{close}; allowed: {', '.join(sorted(known))}", place=at)
