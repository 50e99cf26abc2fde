"""Statements of lines: what a keyword and the text behind it mean."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from typing import Any, Final, TypeAlias

from interfaces.val2 import forms, grammar
from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.functions import row_of
from interfaces.val2.grammar import Node, type_of
from interfaces.val2.rows import MISSING, TOO_MANY, Form, nearest
from interfaces.val2.syntax import (
    Apply,
    Compound,
    Expression,
    Instruction,
    Number,
    Text,
    Variable,
    literal,
)

HIGHEST_LABEL: Final = 65535
MOST_LOOPS: Final = 100
"""What EXIT and NEXT may count."""
_SIMPLE: Final = re.compile(r"\s*([#$]?[A-Za-z][A-Za-z0-9_.]*)\s*\Z")
_PLAIN: Final = re.compile(
    r"\s*(#?[A-Za-z][A-Za-z0-9_.]*)[ \t]*"
    r"\(((?:[ \t]*-?[0-9]{1,15}(?:\.[0-9]*)?[ \t]*,)*[ \t]*-?[0-9]{1,15}(?:\.[0-9]*)?[ \t]*)\)\s*\Z"
)
_NUMBER: Final = re.compile(r"(-?)([0-9]+(?:\.[0-9]*)?)")
_CHANNEL: Final = re.compile(
    r"(\s*)\(([^()]*)\)(\s*)(?=[0-9.(A-Za-z])(?!(?:AND|X?OR|MOD|B(?:AND|X?OR)|EQ|NE|L[TE]|G[TE])(?![A-Za-z0-9_.]))",
    re.IGNORECASE | re.ASCII,
)
_KIND: Final = re.compile(r"\s*(REAL|DOUBLE|LOC)\s+(?=[A-Za-z#$])", re.IGNORECASE | re.ASCII)
_SETTING: Final = re.compile(r"\s*([A-Za-z][A-Za-z0-9_.]*)\s*(=(?!=))?")
_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_.]*")
_TIMED: Final = re.compile(
    r"(.*?[^\s+\-*/^(,:<>=])\s+(MOVES?T?|APPROS?|DEPARTS?|DRIVE|DRAW|READY|NEST|ALIGN)(?![A-Za-z0-9_.])",
    re.IGNORECASE | re.ASCII,
)
_BETWEEN: Final = ("EQUALS", "TO", "STEP", "BY", "THEN", "GOTO", "DO", "OF")
"""Words of the grammar between operands."""

Word: TypeAlias = tuple[str, TextPosition]
"""A word behind an operand, upper case, and where it stands."""
Worded: TypeAlias = tuple[Expression | None, tuple[Word, ...]]
"""An operand, and the words behind it."""


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
        self.at, self.line, self._behind = at, at.line, behind

    @property
    def empty(self) -> bool:
        """Whether there's nothing."""
        return not self.text.strip()

    @property
    def end(self) -> TextPosition:
        """Behind the last character of the line."""
        return TextPosition(self.line, max(len(self.text.rstrip()), self._behind) + 1)

    @property
    def start(self) -> TextPosition:
        """At the first character behind the keyword."""
        return TextPosition(self.line, len(self.text) - len(self.text.lstrip()) + 1)

    def unreadable(self, detail: str, at: TextPosition | None = None) -> ValError:
        """The error of a rest that can't be; at its start unless it's told where."""
        return ValError("Syntax error", detail, place=at or self.start)

    def skip(self, characters: int) -> None:
        """Have blanks in place of the first characters."""
        self.text = " " * characters + self.text[characters:]

    def tree(self, start: str) -> list[Node]:
        """The children of Lark's tree."""
        return list(grammar.read(self.text, start, self.line).children)

    def expression(self) -> Expression:
        """The expression that all of it is."""
        return grammar.expression(grammar.read(self.text, "expression", self.line), self.line)

    def operands(self) -> list[Worded]:
        """The operands between commas, with the words behind each; none if the rest is empty."""
        if self.empty:
            return []
        if (simple := _SIMPLE.match(self.text)) and simple[1].upper() not in forms.CONSTANTS:
            return [(Variable(grammar.name_of(simple[1]), (), TextPosition(self.line, simple.start(1) + 1)), ())]
        if (plain := _PLAIN.match(self.text)) and (built := self._call_of_numbers(plain)) is not None:
            return [(built, ())]
        return [self._worded(node) for node in self.tree("operands")]

    def _worded(self, node: Node) -> Worded:
        if node is None:
            return None, ()
        first, *words = node.children if getattr(node, "data", "") == "worded" else [node]
        found = tuple((word.upper(), TextPosition(self.line, word.column)) for word in words)
        return grammar.expression(first, self.line), found

    def _call_of_numbers(self, plain: re.Match[str]) -> Apply | None:
        """A call such as `TRANS(1, 2, -3.5)`, of which long programs are full, without the grammar; or None."""
        name = forms.ALIASES.get(plain[1].upper(), plain[1].upper())
        row = forms.FUNCTIONS.get(name)
        arguments: list[Expression] = []
        for found in _NUMBER.finditer(plain[2]):
            column = plain.start(2) + found.start() + 1
            at = TextPosition(self.line, column)
            value = Number(float(found[2]), TextPosition(self.line, column + len(found[1])))
            arguments.append(Apply("-", (value,), at) if found[1] else value)
        if row is None or len(arguments) != len(row.slots):
            return None
        return Apply(name, tuple(arguments), TextPosition(self.line, plain.start(1) + 1))

    def by_rule(self, row: Form, start: str) -> list[Any]:
        """The operands that a rule of the grammar finds, by an instruction's slots; words between them left out.

        Raises:
            ValError: If the text isn't what the rule says.
        """
        if row.slots[0].required:
            self.require(row)
        elif self.empty:
            return []
        nodes = [node for node in self.tree(start) if type_of(node) not in _BETWEEN]
        return [self._by_kind(node, row.slot(n).kind) for n, node in enumerate(nodes)]

    def _by_kind(self, node: Node, kind: str) -> Any:
        if node is None:
            return None
        if kind == "variable":
            return grammar.variable(node, self.line)
        if type_of(node) == "FORMAT":
            return grammar.form_of(node, self.line)
        operand = grammar.expression(node, self.line)
        return self.label(operand) if kind == "label" else operand

    def label(self, operand: Expression | None) -> Number:
        """The label that an operand names.

        Raises:
            ValError: If it isn't one.
        """
        if isinstance(operand, Number) and operand.value.is_integer() and operand.value <= HIGHEST_LABEL:
            return operand
        place = operand.at if operand else self.start
        raise ValError("Invalid label", f"allowed: 0 to {HIGHEST_LABEL}", place=place)

    def require(self, row: Form) -> None:
        """See that there's something.

        Raises:
            ValError: If there's nothing.
        """
        if self.empty:
            raise ValError(MISSING, row.usage, place=self.end)

    def operands_and_words(self, row: Form) -> tuple[list[Any], tuple[str, ...]]:
        """Tell operands from words, which look like variables where no operand stands before them.

        Raises:
            ValError: If a word isn't allowed.
        """
        operands: list[Expression | None] = []
        found: list[Word] = []
        for operand, words in self.operands():
            word = as_word(operand)
            if operand is not None and word in row.allowed_words:
                found.append((word, operand.at))
            else:
                operands.append(operand)
            found += words
        ordered = []
        for group in row.words:
            here = [(word, at) for word, at in found if word in group]
            if len(here) > 1:
                raise self.unreadable(f"one of {', '.join(group)} is allowed", here[1][1])
            ordered += [word for word, _ in here]
        for word, at in found:
            if word not in row.allowed_words:
                raise self.unreadable(f"unexpected {word}; allowed: {row.usage}", at)
        return _given(operands), tuple(ordered)

    def passed_over(self, keyword: str) -> Instruction:
        """What is recognised but has no meaning here."""
        return Instruction(keyword, at=self.at, passed=self.text.strip())

    def too_many(self, row: Form, extra: Expression | None = None) -> ValError:
        """The error of too many operands, where the first one stands that is too many."""
        return ValError(TOO_MANY, f"allowed: {row.usage}", place=self.end if extra is None else extra.at)

    def count(self, row: Form, operands: list[Any]) -> None:
        """Count the operands.

        Raises:
            ValError: If there are too few or too many of them.
        """
        if len(operands) > len(row.slots) and not row.repeats:
            raise self.too_many(row, operands[len(row.slots)])
        for i, slot in enumerate(row.slots):
            if slot.required and (i >= len(operands) or operands[i] is None):
                raise ValError(MISSING, f"{slot.name}; allowed: {row.usage}", place=self.end)

    def has_strangers(self, names: list[str], kind: str, known: Collection[str]) -> bool:
        """Whether some of what is named isn't known here: then it's V+'s, and passed over.

        Raises:
            ValError: If one looks like one that is known, or stands beside one.
        """
        strange = [name for name in names if name not in known]
        for name in strange:
            close = nearest(name, known)
            if close or len(names) > len(strange):
                detail = f"{name}{close}; allowed: {', '.join(sorted(known))}"
                raise ValError(f"Unknown {kind}", detail, place=self.start)
        return bool(strange)


def _given(operands: list[Any]) -> list[Any]:
    """Operands without those at the end that were left out."""
    while operands and operands[-1] is None:
        operands.pop()
    return operands


def as_word(operand: Expression | None) -> str:
    """The word that an operand looks like, upper case; empty if it looks like none."""
    if isinstance(operand, Variable) and not operand.indices and not operand.array:
        return operand.name.upper()
    return operand.value.upper() if isinstance(operand, Text) else ""


def statement(keyword: str, rest: OperandText) -> Instruction:
    """The statement of a keyword, upper case, and what stands behind it.

    Raises:
        ValError: If that can't be.
    """
    row = forms.INSTRUCTIONS.get(keyword)
    if row is not None:
        if row.rule in _READERS:
            return _READERS[row.rule](row, rest)
        return Instruction(keyword, tuple(_given(rest.by_rule(row, row.rule))), (), rest.at)
    if keyword in forms.IGNORED:
        return rest.passed_over(keyword)
    if rest.text.lstrip().startswith("=="):
        raise rest.unreadable("'==' compares, '=' assigns")
    detail = f"{keyword}{nearest(keyword, forms.INSTRUCTIONS)}"
    if keyword in ("ELSEIF", "ELIF"):
        detail = f"{keyword}; allowed: ELSE on a line, and an IF of its own on the next"
    raise ValError("Undefined instruction", detail, place=rest.at)


def assignment(rest: OperandText) -> Instruction:
    """`x = 3`, or a location without SET before it."""
    target, value = rest.by_rule(forms.INSTRUCTIONS["SET"], "assignment")
    match value:
        case Apply():
            located = row_of(value).gives in ("frame", "location")
        case _:
            located = isinstance(value, Compound) or (isinstance(value, Variable) and value.prefix == "#")
    return Instruction("SET" if located or target.prefix == "#" else "=", (target, value), (), rest.at)


def _instruction(row: Form, rest: OperandText) -> Instruction:
    """Operands between commas, and words behind them."""
    if row.rule == "channel" and (found := _CHANNEL.match(rest.text)):
        # `ALTER (1) 3` reads like `ALTER 1, 3`.
        channel = found[2] if found[2].strip() or row.name != "ACCEL" else "1"
        rest.text = f"{found[1]} {channel},{found[3]}{rest.text[found.end() :]}"
    operands, words = rest.operands_and_words(row)
    if row.name == "ACCEL" and len(operands) == 3:
        operands = operands[1:]
    rest.count(row, operands)
    if row.name == "GRASP" and len(operands) == 2:
        operands[1] = rest.label(operands[1])
    if row.name == "WAIT" and operands:
        operands[0] = _channel_wait(operands[0])
    return Instruction(row.name, tuple(operands), words, rest.at)


def _channel_wait(condition: Expression) -> Expression:
    """`WAIT 3` and `WAIT -3` of VAL wait for an input."""
    value = literal(condition)
    if value is None or not value.is_integer() or abs(value) < 1:
        return condition
    at = condition.at if isinstance(condition, Number) else condition.arguments[0].at  # type: ignore[union-attr]
    channel = Number(abs(value) + 1000 if abs(value) <= 32 else abs(value), at)
    return Apply("SIG", (channel if value > 0 else Apply("-", (channel,), at),), at)


def timed(text: str) -> tuple[int, int, int] | None:
    """Where the time of `AT time motion` ends, and its motion's keyword begins and ends; None without a motion."""
    found = _TIMED.match(text)
    return None if found is None else (found.end(1), found.start(2), found.end(2))


def _at(row: Form, rest: OperandText) -> Instruction:
    """`AT time`, or with a motion behind it."""
    places = timed(rest.text)
    if places is None:
        return _instruction(row, rest)
    end, begin, behind = places
    time = grammar.read(rest.text[:end], "expression", rest.line)
    motion = OperandText(rest.text, behind, TextPosition(rest.line, begin + 1))
    made = _instruction(forms.INSTRUCTIONS[rest.text[begin:behind].upper()], motion)
    return replace(made, begins=grammar.expression(time, rest.line))


def _bare(row: Form, rest: OperandText) -> Instruction:
    if row.name == "ANY":
        rest.text = rest.text.rstrip().removesuffix(":")
    if not rest.empty:
        raise rest.unreadable(f"unexpected '{rest.text.strip()}' behind {row.name}; allowed: the end of the line")
    return Instruction(row.name, (), (), rest.at)


def _shift(row: Form, rest: OperandText) -> Instruction:
    target, *way = rest.by_rule(row, "shift")
    if len(way) > 3:
        raise rest.too_many(row)
    return Instruction("SET", (target, Apply("SHIFT", (target, *way), rest.at)), (), rest.at)


def _setting(row: Form, rest: OperandText) -> Instruction:
    """`PARAMETER name = value`."""
    rest.require(row)
    found = _SETTING.match(rest.text)
    if found is None:
        raise rest.unreadable(f"allowed: {row.usage}")
    name = found[1].upper()
    if rest.has_strangers([name], "parameter", forms.PARAMETERS):
        return rest.passed_over(row.name)
    if found[2] is None:
        raise ValError(MISSING, f"allowed: {row.usage}", place=TextPosition(rest.line, found.end() + 1))
    rest.skip(found.end())
    return Instruction(row.name, (rest.expression(),), (name,), rest.at)


def _switches(row: Form, rest: OperandText) -> Instruction:
    rest.require(row)
    names = []
    for operand, words in rest.operands():
        names.append(as_word(operand))
        if not isinstance(operand, Variable) or not names[-1] or words:
            raise rest.unreadable(f"allowed: {row.usage}", None if operand is None else operand.at)
    if rest.has_strangers(names, "switch", forms.SWITCHES):
        return rest.passed_over(row.name)
    return Instruction(row.name, (), tuple(names), rest.at)


def _react(row: Form, rest: OperandText) -> Instruction:
    operands, words = rest.operands_and_words(row)
    rest.count(row, operands[:2])
    if len(operands) > 3:
        raise rest.too_many(row)
    match operands[1:2]:
        case [] | [None]:
            program = ""
        case [Variable(name, (), prefix="")]:
            program = name
        case [Apply(name, ())] if name[0] not in "#$":
            program = name.lower()
        case [other]:
            raise rest.unreadable("allowed: the name of a program", other.at)
    return Instruction(row.name, (operands[0],), words, rest.at, program=program)


def _goto(row: Form, rest: OperandText) -> Instruction:
    operands = rest.operands()
    if len(operands) != 1 or operands[0][1]:
        raise ValError(MISSING if rest.empty else "Syntax error", f"allowed: {row.usage}", place=rest.end)
    return Instruction(row.name, (rest.label(operands[0][0]),), (), rest.at)


def _value(row: Form, rest: OperandText) -> Instruction:
    rest.text = rest.text.rstrip().removesuffix(":")
    rest.require(row)
    operands = rest.operands()
    for operand, words in operands:
        if operand is None or words:
            raise rest.unreadable(f"allowed: {row.usage}", words[0][1] if words else None)
    return Instruction(row.name, tuple(operand for operand, _ in operands), (), rest.at)


def _loops(row: Form, rest: OperandText) -> Instruction:
    text = rest.text.strip() or "1"
    plain = text.isascii() and text.isdigit() and len(text) <= len(str(MOST_LOOPS))
    if not plain or not 1 <= int(text) <= MOST_LOOPS:
        raise rest.unreadable(f"allowed: a number of loops, 1 to {MOST_LOOPS}")
    return Instruction(row.name, (Number(float(text)),) if int(text) > 1 else (), (), rest.at)


def _call(row: Form, rest: OperandText) -> Instruction:
    rest.require(row)
    name, arguments = rest.tree("call")
    if not _NAME.fullmatch(name):
        raise rest.unreadable("allowed: the name of a program", TextPosition(rest.line, name.column))
    given: list[Expression | None] = []
    for node in arguments.children if arguments is not None else ():
        if type_of(node) in ("FORMAT", "BY"):
            raise rest.unreadable(f"unexpected {node}", TextPosition(rest.line, node.column))
        given.append(None if node is None else grammar.expression(node, rest.line))
    if given == [None]:
        given = []
    return Instruction(row.name, tuple(given), (), rest.at, program=grammar.name_of(name))


def _prompt(row: Form, rest: OperandText) -> Instruction:
    operands = rest.operands() or [(None, ())]
    text = operands[0][0]
    for operand, words in operands:
        if words:
            raise rest.unreadable(f"unexpected {words[0][0]}; allowed: {row.usage}", words[0][1])
        if operand is not text and (not isinstance(operand, Variable) or operand.array):
            raise rest.unreadable("allowed: variables behind the text", None if operand is None else operand.at)
    targets = [operand for operand, _ in operands[1:] if operand is not None]
    return Instruction(row.name, (Text("", rest.at) if text is None else text, *targets), (), rest.at)


def _local(row: Form, rest: OperandText) -> Instruction:
    words: tuple[str, ...] = ()
    if found := _KIND.match(rest.text):
        words = ("LOC" if found[1].upper() == "LOC" else "REAL",)
        rest.skip(found.end())
    return Instruction(row.name, tuple(rest.by_rule(row, "names")), words, rest.at)


_READERS: Final[Mapping[str, Callable[[Form, OperandText], Instruction]]] = {
    "operands": _instruction, "channel": _instruction, "nothing": _bare, "timed": _at, "shift": _shift,
    "parameter": _setting, "switches": _switches, "reaction": _react, "goto": _goto, "values": _value,
    "loops": _loops, "call": _call, "prompt": _prompt, "names": _local,
}  # fmt: skip
"""What reads what stands behind a keyword, by the rule of its row, where that isn't a rule of the grammar alone."""
