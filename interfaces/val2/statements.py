"""Statements of lines: what a keyword and the text behind it mean."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Any, Final

from interfaces.val2 import forms, grammar
from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.functions import row_of
from interfaces.val2.grammar import Node, Worded
from interfaces.val2.rows import MISSING, TOO_MANY, Form, nearest
from interfaces.val2.syntax import (
    Apply,
    Compound,
    Expression,
    Ignored,
    Instruction,
    Number,
    Statement,
    Text,
    Variable,
    literal,
)

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
                arguments.append(Apply("-", (magnitude,), at))
            else:
                arguments.append(Number(float(found[2]), at))
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
        nodes = [node for node in self.tree(start) if getattr(node, "type", "") not in _BETWEEN]
        return [self._by_kind(node, row.slots[min(n, len(row.slots) - 1)].kind) for n, node in enumerate(nodes)]

    def _by_kind(self, node: Node, kind: str) -> Any:
        if node is None:
            return None
        if kind == "variable":
            return grammar.variable(node, self.line)
        if kind == "label":
            return label_of(self.expression(node), self)
        return grammar.form_of(node, self.line) if getattr(node, "type", "") == "FORMAT" else self.expression(node)

    def require(self, form: Form) -> None:
        """See that there's something.

        Raises:
            ValError: If there's nothing.
        """
        if self.empty:
            raise ValError(MISSING, form.usage, place=self.end)


def operands_and_words(row: Form, given: list[Worded]) -> tuple[list[Expression | None], tuple[str, ...]]:
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


def _ordered(row: Form, found: list[tuple[str, TextPosition]]) -> tuple[str, ...]:
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


def count(row: Form, operands: list[Expression | None], rest: OperandText) -> None:
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


def label_of(operand: Expression | None, rest: OperandText) -> Number:
    """The label that an operand names.

    Raises:
        ValError: If it isn't one.
    """
    if isinstance(operand, Number) and operand.value.is_integer() and operand.value <= HIGHEST_LABEL:
        return operand
    raise ValError("Invalid label", f"allowed: 0 to {HIGHEST_LABEL}", place=operand.at if operand else rest.start)


def reject_misspelling(kind: str, names: list[str], known: Collection[str], at: TextPosition) -> None:
    """See that names which aren't known don't look like those that are, and don't stand beside them.

    Raises:
        ValError: If one does.
    """
    for name in names:
        close = nearest(name, known)
        if name not in known and (close or len(names) > sum(one not in known for one in names)):
            raise ValError(f"Unknown {kind}", f"{name}{close}; allowed: {', '.join(sorted(known))}", place=at)


MOST_LOOPS: Final = 100
"""What EXIT and NEXT may count."""
_BETWEEN: Final = ("EQUALS", "TO", "STEP", "BY", "THEN", "GOTO", "DO", "OF")
"""Words of the grammar between operands."""
_RULES: Final = {
    "SET": "assignment", "DECOMPOSE": "assignment", "TIMER": "timing", "IF": "branch", "WHILE": "while",
    "UNTIL": "until", "FOR": "loop", "CASE": "case", "TYPE": "items",
}  # fmt: skip
"""What of the grammar stands behind keywords."""
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


def statement(keyword: str, rest: OperandText) -> Statement:
    """The statement of a keyword, upper case, and what stands behind it.

    Raises:
        ValError: If that can't be.
    """
    row = forms.INSTRUCTIONS.get(keyword)
    if row is not None and keyword in _RULES:
        operands = rest.by_rule(row, _RULES[keyword])
        while operands and operands[-1] is None:
            operands.pop()
        return Instruction(keyword, tuple(operands), (), rest.at)
    if row is not None:
        return _OWN.get(keyword, _instruction)(row, rest)
    if keyword in forms.IGNORED:
        return Ignored(keyword, rest.text.strip(), rest.at)
    if rest.text.lstrip().startswith("=="):
        raise ValError("Syntax error", "'==' compares, '=' assigns", place=rest.start)
    detail = f"{keyword}{nearest(keyword, forms.INSTRUCTIONS)}"
    if keyword in ("ELSEIF", "ELIF"):
        detail = f"{keyword}; allowed: ELSE on a line, and an IF of its own on the next"
    raise ValError("Undefined instruction", detail, place=rest.at)


def assignment(rest: OperandText) -> Statement:
    """`x = 3`, or a location without SET before it."""
    target, value = rest.by_rule(forms.INSTRUCTIONS["SET"], "assignment")
    located = target.prefix == "#" or _is_location(value)
    return Instruction("SET" if located else "=", (target, value), (), rest.at)


def _is_location(value: Expression) -> bool:
    if isinstance(value, Apply):
        return row_of(value).gives in ("frame", "location")
    return isinstance(value, Compound) or (isinstance(value, Variable) and value.prefix == "#")


def _instruction(row: Form, rest: OperandText) -> Instruction:
    if row.name in ("ACCEL", "ALTER", "ALTON"):
        _open_channel(row, rest)
    operands, words = operands_and_words(row, rest.operands())
    if row.name == "ACCEL" and len(operands) == 3:
        operands = operands[1:]
    count(row, operands, rest)
    if row.name == "GRASP" and len(operands) == 2:
        operands[1] = label_of(operands[1], rest)
    if row.name == "WAIT" and operands:
        operands[0] = _channel_wait(operands[0])
    return Instruction(row.name, tuple(operands), words, rest.at)


def _open_channel(row: Form, rest: OperandText) -> None:
    """`ALTER (1) 3` reads like `ALTER 1, 3`."""
    if found := _CHANNEL.match(rest.text):
        inner = found[2] if found[2].strip() or row.name != "ACCEL" else "1"
        rest.text = f"{found[1]} {inner},{found[3]}{rest.text[found.end() :]}"


def _channel_wait(condition: Expression | None) -> Expression | None:
    """`WAIT 3` and `WAIT -3` of VAL wait for an input."""
    value = literal(condition)
    if value is None or condition is None or not value.is_integer() or abs(value) < 1:
        return condition
    inner = condition.arguments[0] if isinstance(condition, Apply) else condition
    assert isinstance(inner, Number)
    channel = Number(inner.value + 1000 if inner.value <= 32 else inner.value, inner.at)
    signed = channel if inner is condition else Apply("-", (channel,), inner.at)
    return Apply("SIG", (signed,), inner.at)


def timed(text: str) -> tuple[int, int, int] | None:
    """Where the time of `AT time motion` ends, and its motion's keyword begins and ends; None without a motion."""
    found = _TIMED.match(text)
    return None if found is None else (found.end(1), found.start(2), found.end(2))


def _at(row: Form, rest: OperandText) -> Statement:
    """`AT time`, or with a motion behind it."""
    places = timed(rest.text)
    if places is None:
        return _instruction(row, rest)
    end, begin, behind = places
    time = grammar.read(rest.text[:end], "expression", rest.line)
    motion = forms.INSTRUCTIONS[rest.text[begin:behind].upper()]
    made = _instruction(motion, OperandText(rest.text, behind, TextPosition(rest.line, begin + 1)))
    return replace(made, begins=rest.expression(time))


def _plain(row: Form, rest: OperandText) -> Statement:
    if not rest.empty:
        detail = f"unexpected '{rest.text.strip()}' behind {row.name}; allowed: the end of the line"
        raise ValError("Syntax error", detail, place=rest.start)
    return Instruction(row.name, (), (), rest.at)


def _shift(row: Form, rest: OperandText) -> Statement:
    target, *values = rest.by_rule(row, "shift")
    if len(values) > 3:
        raise ValError(TOO_MANY, f"allowed: {row.usage}", place=rest.end)
    return Instruction("SET", (target, Apply("SHIFT", (target, *values), rest.at)), (), rest.at)


def _parameter(row: Form, rest: OperandText) -> Statement:
    rest.require(row)
    found = _SETTING.match(rest.text)
    if found is None:
        raise ValError("Syntax error", f"allowed: {row.usage}", place=rest.start)
    name = found[1].upper()
    if name not in forms.PARAMETERS:
        reject_misspelling("parameter", [name], forms.PARAMETERS, TextPosition(rest.line, found.start(1) + 1))
        return Ignored(row.name, rest.text.strip(), rest.at)
    if found[2] is None:
        raise ValError(MISSING, f"allowed: {row.usage}", place=TextPosition(rest.line, found.end() + 1))
    value = grammar.read(" " * found.end() + rest.text[found.end() :], "expression", rest.line)
    return Instruction(row.name, (rest.expression(value),), (name,), rest.at)


def _switches(row: Form, rest: OperandText) -> Statement:
    rest.require(row)
    names = []
    for operand, words in rest.operands():
        name = as_word(operand)
        if not isinstance(operand, Variable) or not name or words:
            at = operand.at if operand is not None else rest.start
            raise ValError("Syntax error", f"allowed: {row.usage}", place=at)
        names.append(name)
    if any(name not in forms.SWITCHES for name in names):
        reject_misspelling("switch", names, forms.SWITCHES, rest.start)
        return Ignored(row.name, rest.text.strip(), rest.at)
    return Instruction(row.name, (), tuple(names), rest.at)


def _react(row: Form, rest: OperandText) -> Statement:
    operands, words = operands_and_words(row, rest.operands())
    count(row, operands[:2], rest)
    if len(operands) > 3:
        raise ValError(TOO_MANY, f"allowed: {row.usage}", place=rest.end)
    signal, *others = operands
    program = _program_of(others[0]) if others and others[0] is not None else ""
    return Instruction(row.name, (signal,), words, rest.at, program=program)


def _program_of(operand: Expression) -> str:
    if isinstance(operand, Variable) and not operand.prefix and not operand.indices:
        return operand.name
    if isinstance(operand, Apply) and not operand.arguments and not operand.function.startswith(("#", "$")):
        return operand.function.lower()
    raise ValError("Syntax error", "allowed: the name of a program", place=operand.at)


def _goto(row: Form, rest: OperandText) -> Statement:
    operands = rest.operands()
    if len(operands) != 1 or operands[0][1]:
        raise ValError(MISSING if rest.empty else "Syntax error", f"allowed: {row.usage}", place=rest.end)
    return Instruction(row.name, (label_of(operands[0][0], rest),), (), rest.at)


def _value(row: Form, rest: OperandText) -> Statement:
    rest.text = rest.text.rstrip().removesuffix(":")
    rest.require(row)
    operands = rest.operands()
    for operand, words in operands:
        if operand is None or words:
            raise ValError("Syntax error", f"allowed: {row.usage}", place=words[0][1] if words else rest.start)
    return Instruction(row.name, tuple(operand for operand, _ in operands), (), rest.at)


def _any(row: Form, rest: OperandText) -> Statement:
    rest.text = rest.text.rstrip().removesuffix(":")
    return _plain(row, rest)


def _loops(row: Form, rest: OperandText) -> Statement:
    text, count = rest.text.strip(), 1
    plain = text.isascii() and text.isdigit() and len(text) <= len(str(MOST_LOOPS))
    if text and not (plain and 1 <= (count := int(text)) <= MOST_LOOPS):
        raise ValError("Syntax error", f"allowed: a number of loops, 1 to {MOST_LOOPS}", place=rest.start)
    return Instruction(row.name, (Number(float(count)),) if count > 1 else (), (), rest.at)


def _call(row: Form, rest: OperandText) -> Statement:
    rest.require(row)
    name, arguments = rest.tree("call")
    if not _NAME.fullmatch(name):
        raise ValError("Syntax error", "allowed: the name of a program", place=TextPosition(rest.line, name.column))
    given: list[Expression | None] = []
    for node in arguments.children if arguments is not None else ():
        if getattr(node, "type", "") in ("FORMAT", "BY"):
            raise ValError("Syntax error", f"unexpected {node}", place=TextPosition(rest.line, node.column))
        given.append(None if node is None else rest.expression(node))
    if given == [None]:
        given = []
    return Instruction(row.name, tuple(given), (), rest.at, program=grammar.name_of(name))


def _prompt(row: Form, rest: OperandText) -> Statement:
    operands, targets = rest.operands(), []
    first = operands[0][0] if operands else None
    for operand, words in operands:
        if words:
            raise ValError("Syntax error", f"unexpected {words[0][0]}; allowed: {row.usage}", place=words[0][1])
        if operand is not first:
            if not isinstance(operand, Variable) or operand.array:
                at = operand.at if operand is not None else rest.start
                raise ValError("Syntax error", "allowed: variables behind the text", place=at)
            targets.append(operand)
    text = Text("", rest.at) if first is None else first
    return Instruction(row.name, (text, *targets), (), rest.at)


def _local(row: Form, rest: OperandText) -> Statement:
    words: tuple[str, ...] = ()
    if found := _KIND.match(rest.text):
        words = ("LOC" if found[1].upper() == "LOC" else "REAL",)
        rest.text = " " * found.end() + rest.text[found.end() :]
    return Instruction(row.name, tuple(rest.by_rule(row, "names")), words, rest.at)


_OWN: Final[dict[str, Callable[[Form, OperandText], Statement]]] = {
    **dict.fromkeys(("ELSE", "END", "DO", "RETURN"), _plain),
    **dict.fromkeys(("ENABLE", "DISABLE"), _switches),
    **dict.fromkeys(("REACT", "REACTI"), _react),
    **dict.fromkeys(("EXIT", "NEXT"), _loops),
    **dict.fromkeys(("CALL", "GOSUB"), _call),
    **dict.fromkeys(("AUTO", "LOCAL", "GLOBAL"), _local),
    "AT": _at,
    "SHIFT": _shift,
    "PARAMETER": _parameter,
    "VALUE": _value,
    "ANY": _any,
    "GOTO": _goto,
    "PROMPT": _prompt,
}
"""Keywords whose operands aren't a list between commas, nor a rule of the grammar."""
