"""Trees of what stands behind a line's keyword, by the grammar in `grammar.lark`."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Collection
from functools import cache
from importlib import resources
from typing import Any, Final, TypeAlias

from interfaces.val2 import forms
from interfaces.val2.errors import TextPosition, ValError, syntax_error
from interfaces.val2.functions import NEGATION, OPERATORS, row_of
from interfaces.val2.rows import nearest
from interfaces.val2.syntax import Apply, Compound, Expression, Format, Number, Text, Variable

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
_INFIXES: Final = frozenset({"BINARY", "EQUALS", "PLUS", "MINUS", "OVER"})
_END: Final = "the end of the line"
_SHOWN: Final = {
    "NUMBER": "a number", "STRING": "a string", "NAME": "a name", "FORMAT": "a format such as /F8.2",
    "LPAR": "'('", "RPAR": "')'", "LSQB": "'['", "RSQB": "']'", "COMMA": "','", "COLON": "':'", "EQUALS": "'='",
}  # fmt: skip

Node: TypeAlias = Any
"""A tree or a token of Lark's, whose own types say nothing of what they hold."""


def name_of(text: str) -> str:
    """A name as trees have it: lower case, and as much of it as counts."""
    return text[: SIGNIFICANT + (text[0] in "#$")].lower()


def type_of(node: Node) -> str:
    """What kind of token a node is; empty of a tree, and of nothing."""
    return getattr(node, "type", "")


def read(text: str, start: str, line: int) -> Node:
    """Lark's tree of a text that begins with as many blanks as what stands before it has characters.

    Args:
        text: The text.
        start: Which rule of the grammar.
        line: Number of the line, for errors.

    Raises:
        ValError: If the grammar doesn't take it.
    """
    from lark.exceptions import UnexpectedCharacters, UnexpectedToken

    try:
        return _lark().parse(text, start=start)
    except UnexpectedToken as error:
        if error.token.type == "$END":
            raise _unexpected(_END, error.accepts, line, len(text.rstrip()) + 1) from None
        allowed = error.accepts or _accepted_behind(text[: error.column - 1], start)
        raise _unexpected(f"'{error.token}'", allowed, line, error.column) from None
    except UnexpectedCharacters as error:
        character = text[error.column - 1]
        if character == '"':
            raise syntax_error("the string has no closing quote", line, error.column) from None
        raise _unexpected(repr(character), error.allowed or (), line, error.column) from None


def _accepted_behind(text: str, start: str) -> set[str]:
    """What may stand behind a text: what is found wrong when the text counts as complete leaves Lark without it."""
    parser = _lark().parse_interactive(text, start=start)
    parser.exhaust_lexer()
    accepted: set[str] = parser.accepts()
    return accepted


def _unexpected(what: str, allowed: Collection[str], line: int, column: int) -> ValError:
    left, shown = set(allowed) - {"IGNORE", "$END"}, []
    for several, name in ((_VALUE, "a value"), (_INFIXES, "an operator")):
        if left.issuperset(several):
            left -= several
            shown.append(name)
    shown += sorted(_SHOWN.get(name, name) for name in left if not name.startswith("__"))
    shown += [_END] if "$END" in allowed else []
    allowed_here = f"; allowed: {', '.join(shown)}" if shown else ""
    return syntax_error(f"unexpected {what}{allowed_here}", line, column)


@cache
def _lark() -> Node:
    from lark import Lark

    grammar = resources.files("interfaces.val2").joinpath("grammar.lark").read_text("utf-8")
    return Lark(grammar, parser="lalr", lexer="contextual", start=list(_STARTS), maybe_placeholders=True)


def number(token: Node, line: int) -> float:
    """The value of a number's token.

    Raises:
        ValError: If it's too large.
    """
    value = float(int(token[2:], _BASES[token[1].upper()])) if token[0] == "^" else float(token)
    if not math.isfinite(value):
        raise syntax_error(str(token), line, token.column, "Number too large")
    return value


def expression(node: Node, line: int, depth: int = 0) -> Expression:
    """The expression of Lark's tree.

    Raises:
        ValError: If it holds what can't be: an unknown function, a number too large, too many levels.
    """
    kind = type_of(node)
    if kind:
        at = TextPosition(line, node.column)
        return Number(number(node, line), at) if kind == "NUMBER" else Text(str(node[1:-1]), at)
    if node.data == "expression":
        depth += len(node.children) // 2
    if depth > DEEPEST:
        first = next(node.scan_values(lambda _: True), None)
        detail = f"more than {DEEPEST} levels"
        raise syntax_error(detail, line, 1 if first is None else first.column, "Expression too complex")
    match node.data:
        case "expression":
            return _operation(node.children, line, depth + 1)
        case "compound":
            parts = [expression(child, line, depth + 1) for child in node.children]
            flat = [inner for part in parts for inner in (part.parts if isinstance(part, Compound) else (part,))]
            return Compound(tuple(flat), flat[0].at)
        case "variable":
            return _variable(node, line, depth + 1)
        case _:
            return _apply(node, line, depth + 1)


def _operation(children: list[Node], line: int, depth: int) -> Expression:
    """Operators and operands in a row: what binds more tightly comes first, else the left one does."""
    left_over = deque(children)

    def row(level: int) -> Expression:
        """What stands from here on, as far as operators bind as tightly as a level or more."""
        node = left_over.popleft()
        if type_of(node) in _PREFIXES:
            own = NEGATION if node.type == "PLUS" else row_of(Apply(node.upper(), (None,)))
            left = row(max(level, own.level))
            if node.type != "PLUS":
                left = Apply(own.name, (left,), TextPosition(line, node.column))
        else:
            left = expression(node, line, depth)
        while left_over:
            token = left_over[0]
            own = OPERATORS[_SPELLINGS.get(token.upper(), token.upper())]
            if own.level < level:
                break
            left_over.popleft()
            left = Apply(own.name, (left, row(own.level + 1)), TextPosition(line, token.column))
        return left

    return row(0)


def _variable(node: Node, line: int, depth: int) -> Expression:
    token, indices = node.children
    at, upper = TextPosition(line, token.column), token.upper()
    if indices is None:
        if upper in forms.CONSTANTS:
            return Apply(forms.ALIASES.get(upper, upper), (), at)
        if upper in forms.OPERATORS:
            raise _misplaced(upper, at)
        return Variable(name_of(token), (), at)
    inner = tuple(expression(i, line, depth) for i in indices.children)
    return Variable(name_of(token), inner, at, array=not inner)


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


def _apply(node: Node, line: int, depth: int) -> Expression:
    token, rest = node.children
    at = TextPosition(line, token.column)
    name = forms.ALIASES.get(token.upper(), token.upper())
    function = forms.FUNCTIONS.get(name)
    if function is None:
        if name in forms.OPERATORS:
            raise _misplaced(name, at)
        near = nearest(name, forms.FUNCTIONS)
        raise ValError("Undefined function", f"{token.upper()}{near}; an array has brackets", place=at)
    arguments: list[Expression | Format | None] = []
    for child in rest.children:
        match type_of(child):
            case "BY" if name != "SHIFT":
                raise syntax_error("BY belongs in SHIFT", line, child.column)
            case "BY":
                pass
            case "FORMAT" if name != "$ENCODE":
                detail = f"a format such as {child} belongs in TYPE and $ENCODE"
                raise syntax_error(detail, line, child.column)
            case "FORMAT":
                arguments.append(form_of(child, line))
            case _:
                arguments.append(None if child is None else expression(child, line, depth))
    if arguments == [None]:
        arguments = []
    function.expect(arguments, at)
    return Apply(name, tuple(arguments), at)


def _misplaced(operator: str, at: TextPosition) -> ValError:
    return ValError("Syntax error", f"{operator} can't stand here; parentheses may be missing", place=at)


def form_of(token: Node, line: int) -> Format:
    """The control item of a token such as `/F8.2`.

    Raises:
        ValError: If there's no such item.
    """
    code = token[1].upper()
    if code not in forms.FORMATS:
        allowed = ", ".join(f"/{c}" for c in forms.FORMATS)
        raise syntax_error(f"{token}; allowed: {allowed}", line, token.column, "Invalid format")
    width, _, decimals = token[2:].partition(".")
    if len(width) > 3 or len(decimals) > 2:
        raise syntax_error(f"{token} is too wide", line, token.column, "Invalid format")
    return Format(code, int(width) if width else None, int(decimals) if decimals else None)
