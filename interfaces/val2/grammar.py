"""Trees of what stands behind a line's keyword, by the grammar in `grammar.lark`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from importlib import resources
from typing import Any, Final, TypeAlias

from interfaces.val2 import forms, functions
from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.rows import Form, nearest
from interfaces.val2.syntax import (
    Apply,
    Compound,
    Expression,
    Format,
    Number,
    Text,
    Variable,
)

SIGNIFICANT: Final = 15
"""Characters of a name that count, beside its prefix."""
DEEPEST: Final = 100
"""Most levels of an expression."""
_STARTS: Final = (
    "expression", "operands", "items", "assignment", "timing", "loop", "branch", "until", "while", "case", "call",
    "names", "shift", "rule",
)  # fmt: skip
_SPELLINGS: Final = {
    "=": "==", "EQ": "==", "NE": "<>", "LT": "<", "LE": "<=", "GT": ">", "GE": ">=", "=<": "<=", "=>": ">=",
    "**": "^",
}  # fmt: skip
_BASES: Final = {"B": 2, "O": 8, "H": 16}
_VALUE: Final = frozenset({"NUMBER", "STRING", "NAME", "LPAR", "MINUS", "PLUS", "NOT", "COM"})
_PREFIXES: Final = ("NOT", "COM", "MINUS", "PLUS")
_OPERATORS: Final = frozenset({"BINARY", "EQUALS", "PLUS", "MINUS", "OVER"})
_SHOWN: Final = {
    "NUMBER": "a number", "STRING": "a string", "NAME": "a name", "FORMAT": "a format such as /F8.2",
    "LPAR": "'('", "RPAR": "')'", "LSQB": "'['", "RSQB": "']'", "COMMA": "','", "COLON": "':'", "EQUALS": "'='",
    "$END": "the end of the line",
}  # fmt: skip

Node: TypeAlias = Any
"""A tree or a token of Lark's, whose own types say nothing of what they hold."""
Worded: TypeAlias = tuple[Expression | None, tuple[tuple[str, TextPosition], ...]]
"""An operand, and the words behind it."""


def name_of(text: str) -> str:
    """A name as trees have it: lower case, and as much of it as counts."""
    prefix = text[0] if text[0] in "#$" else ""
    return prefix + text[len(prefix) : len(prefix) + SIGNIFICANT].lower()


def read(text: str, start: str, line: int) -> Node:
    """Lark's tree of a text that begins with as many blanks as what stands before it has characters.

    Args:
        text: The text.
        start: Which rule of the grammar.
        line: Number of the line, for errors.

    Raises:
        ValError: If the grammar doesn't take it.
    """
    from lark.exceptions import UnexpectedCharacters, UnexpectedInput, UnexpectedToken

    try:
        return _lark().parse(text, start=start)
    except UnexpectedToken as error:
        if error.token.type == "$END":
            raise _unexpected(
                "the end of the line", error.accepts, TextPosition(line, len(text.rstrip()) + 1)
            ) from None
        shown = f"'{error.token}'"
        allowed = error.accepts or _accepted_behind(text[: error.column - 1], start)
        raise _unexpected(shown, allowed, TextPosition(line, error.column)) from None
    except UnexpectedCharacters as error:
        place = TextPosition(line, error.column)
        if text[error.column - 1] == '"':
            raise ValError("Syntax error", "the string has no closing quote", place=place) from None
        shown = repr(text[error.column - 1])
        raise _unexpected(shown, error.allowed or frozenset(), place) from None
    except UnexpectedInput:
        raise ValError("Syntax error", place=TextPosition(line, 1)) from None


def _accepted_behind(text: str, start: str) -> set[str]:
    """What may stand behind a text: what is found wrong when the text counts as complete leaves Lark without it."""
    parser = _lark().parse_interactive(text, start=start)
    parser.exhaust_lexer()
    accepted: set[str] = parser.accepts()
    return accepted


def _unexpected(what: str, allowed: Sequence[str] | frozenset[str] | set[str], place: TextPosition) -> ValError:
    left = set(allowed) - {"IGNORE"}
    shown = []
    if left.issuperset(_VALUE):
        left -= _VALUE
        shown.append("a value")
    if left.issuperset(_OPERATORS):
        left -= _OPERATORS
        shown.append("an operator")
    last = "$END" in left
    shown += sorted(_SHOWN.get(name, name) for name in left - {"$END"} if not name.startswith("__"))
    if last:
        shown.append(_SHOWN["$END"])
    allowed_here = f"; allowed: {', '.join(shown)}" if shown else ""
    return ValError("Syntax error", f"unexpected {what}{allowed_here}", place=place)


@cache
def _lark() -> Node:
    from lark import Lark

    grammar = resources.files("interfaces.val2").joinpath("grammar.lark").read_text("utf-8")
    return Lark(grammar, parser="lalr", lexer="contextual", start=list(_STARTS), maybe_placeholders=True)


def expression(node: Node, line: int, depth: int = 0) -> Expression:
    """The expression of Lark's tree.

    Raises:
        ValError: If it holds what can't be: an unknown function, a number too large, too many levels.
    """
    if hasattr(node, "type"):
        return _token(node, line)
    if node.data == "expression":
        depth += len(node.children) // 2
    if depth > DEEPEST:
        raise ValError("Expression too complex", f"more than {DEEPEST} levels", place=_first(node, line))
    return _BUILDERS[node.data](node.children, line, depth + 1)


def _token(token: Node, line: int) -> Expression:
    at = TextPosition(line, token.column)
    if token.type == "NUMBER":
        return Number(number(token, line), at)
    return Text(str(token[1:-1]), at)


def number(token: Node, line: int) -> float:
    """The value of a number's token.

    Raises:
        ValError: If it's too large.
    """
    value = float(int(token[2:], _BASES[token[1].upper()])) if token[0] == "^" else float(token)
    if not math.isfinite(value):
        raise ValError("Number too large", str(token), place=TextPosition(line, token.column))
    return value


def _first(node: Node, line: int) -> TextPosition:
    """Where a tree begins."""
    token = next(node.scan_values(lambda _: True), None)
    return TextPosition(line, 1 if token is None else token.column)


def _operation(children: list[Node], line: int, depth: int) -> Expression:
    return _OperatorRow(children, line, depth).expression(0)


class _OperatorRow:
    """Operators and operands in a row."""

    def __init__(self, children: list[Node], line: int, depth: int) -> None:
        self._children, self._line, self._depth = children, line, depth
        self._next = 0

    def expression(self, level: int) -> Expression:
        """What stands from here on, as far as operators bind as tightly as a level or more."""
        left = self._operand(level)
        while self._next < len(self._children):
            token = self._children[self._next]
            spelled = token.upper()
            operator = _SPELLINGS.get(spelled, spelled)
            own = forms.LEVELS[operator]
            if own < level:
                break
            self._next += 1
            at = TextPosition(self._line, token.column)
            left = Apply(operator, (left, self.expression(own + 1)), at)
        return left

    def _operand(self, level: int) -> Expression:
        node = self._children[self._next]
        self._next += 1
        if getattr(node, "type", "") not in _PREFIXES:
            return expression(node, self._line, self._depth)
        row = functions.NEGATION if node.type == "PLUS" else functions.row_of(Apply(node.upper(), (None,)))
        operand = self.expression(max(level, row.level))
        if node.type == "PLUS":
            return operand
        return Apply(node.upper(), (operand,), TextPosition(self._line, node.column))


def _compound(children: list[Node], line: int, depth: int) -> Expression:
    parts: list[Expression] = []
    for child in children:
        part = expression(child, line, depth)
        parts += part.parts if isinstance(part, Compound) else (part,)
    return Compound(tuple(parts), parts[0].at)


def _variable(children: list[Node], line: int, depth: int) -> Expression:
    token, indices = children
    at = TextPosition(line, token.column)
    upper = token.upper()
    if indices is None:
        if upper in forms.CONSTANTS:
            return Apply(forms.ALIASES.get(upper, upper), (), at)
        if upper in forms.OPERATORS:
            raise _misplaced(upper, at)
        return Variable(name_of(token), (), at)
    if not indices.children:
        return Variable(name_of(token), (), at, array=True)
    return Variable(name_of(token), tuple(expression(i, line, depth) for i in indices.children), at)


def variable(node: Node, line: int) -> Variable:
    """The variable of Lark's tree, which is to be set.

    Raises:
        ValError: If its name is a constant's.
    """
    built = expression(node, line)
    if isinstance(built, Variable):
        return built
    name = getattr(built, "function", "it")
    raise ValError("Reserved name", f"{name} is a function", place=built.at)


def _apply(children: list[Node], line: int, depth: int) -> Expression:
    token, rest = children
    at = TextPosition(line, token.column)
    name = forms.ALIASES.get(token.upper(), token.upper())
    function = forms.FUNCTIONS.get(name)
    if function is None:
        if name in forms.OPERATORS:
            raise _misplaced(name, at)
        near = nearest(name, forms.FUNCTIONS)
        raise ValError("Undefined function", f"{token.upper()}{near}; an array has brackets", place=at)
    return Apply(name, _arguments(rest, function, at, depth), at)


def _misplaced(operator: str, at: TextPosition) -> ValError:
    return ValError("Syntax error", f"{operator} can't stand here; parentheses may be missing", place=at)


def _arguments(node: Node, function: Form, at: TextPosition, depth: int) -> tuple[Expression | Format | None, ...]:
    line = at.line
    arguments: list[Expression | Format | None] = []
    for child in node.children:
        kind = getattr(child, "type", "")
        if kind == "BY":
            if function.name != "SHIFT":
                detail = "BY belongs in SHIFT"
                raise ValError("Syntax error", detail, place=TextPosition(line, child.column))
        elif kind == "FORMAT":
            if function.name != "$ENCODE":
                detail = f"a format such as {child} belongs in TYPE and $ENCODE"
                raise ValError("Syntax error", detail, place=TextPosition(line, child.column))
            arguments.append(form_of(child, line))
        else:
            arguments.append(None if child is None else expression(child, line, depth))
    if arguments == [None]:
        arguments = []
    function.expect(arguments, at)
    return tuple(arguments)


def form_of(token: Node, line: int) -> Format:
    """The control item of a token such as `/F8.2`.

    Raises:
        ValError: If there's no such item.
    """
    code = token[1].upper()
    if code not in forms.FORMATS:
        allowed = ", ".join(f"/{c}" for c in forms.FORMATS)
        raise ValError("Invalid format", f"{token}; allowed: {allowed}", place=TextPosition(line, token.column))
    width, _, decimals = token[2:].partition(".")
    if len(width) > 3 or len(decimals) > 2:
        raise ValError("Invalid format", f"{token} is too wide", place=TextPosition(line, token.column))
    return Format(code, int(width) if width else None, int(decimals) if decimals else None)


def operand(node: Node, line: int) -> Worded:
    """An operand, which may be left out, and the words behind it."""
    if node is None:
        return None, ()
    if getattr(node, "data", "") != "worded":
        return expression(node, line), ()
    first, *words = node.children
    return expression(first, line), tuple((w.upper(), TextPosition(line, w.column)) for w in words)


_BUILDERS: Final[dict[str, Callable[[list[Node], int, int], Expression]]] = {
    "expression": _operation,
    "compound": _compound,
    "variable": _variable,
    "apply": _apply,
}
