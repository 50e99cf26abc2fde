"""Trees of lines and expressions, by `grammar.lark` and the table of the language.

Lark calls `_Trees` for each rule that it has recognised, inner ones first. Which keyword takes which operands, and
which of them may be missing, is told by its row in `forms.py`.

One concept in over 600 lines: what each rule of the grammar comes to.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections import deque
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from functools import cache
from importlib import resources
from typing import Any, Final, TypeAlias

from interfaces.val2 import forms
from interfaces.val2.errors import TextPosition, ValError, syntax_error
from interfaces.val2.functions import NEGATION, OPERATORS, row_of
from interfaces.val2.instructions import STATEMENTS
from interfaces.val2.rows import MISSING, TOO_MANY, Form
from interfaces.val2.signals import INPUTS, OUTPUTS, SignalRule
from interfaces.val2.syntax import (
    BLANK,
    Apply,
    Compound,
    Expression,
    Format,
    Instruction,
    Number,
    Program,
    Text,
    Variable,
    children,
    literal,
)
from vrs.checks import did_you_mean

SIGNIFICANT: Final = 15
"""Characters of a name that count, beside its prefix."""
DEEPEST: Final = 100
"""Most levels of an expression."""
HIGHEST_LABEL: Final = 65535
MOST_LOOPS: Final = 100
"""What EXIT and NEXT may count."""
_SPELLINGS: Final = {
    "=": "==", "EQ": "==", "NE": "<>", "LT": "<", "LE": "<=", "GT": ">", "GE": ">=", "=<": "<=", "=>": ">=",
    "**": "^",
}  # fmt: skip
_BASES: Final = {"B": 2, "O": 8, "H": 16}
_SIGNED: Final = re.compile(r"(-?)([0-9.]+)")
_END: Final = "the end of the line"
_HEADER: Final = ".PROGRAM name(arguments)"
_VALUE: Final = frozenset({"NUMBER", "STRING", "NAME", "LPAR"})
_SIGNS: Final = frozenset({"PREFIX", "SIGN"})
_OPERATOR: Final = frozenset({"INFIX", "SIGN", "EQUALS"})
_SHOWN: Final = {
    "NUMBER": "a number", "STRING": "a string", "NAME": "a name", "FORMAT": "a format such as /F8.2",
    "LPAR": "'('", "RPAR": "')'", "LSQB": "'['", "RSQB": "']'", "COMMA": "','", "COLON": "':'", "EQUALS": "'='",
    "SETTING": "a parameter", "MOTION": "a motion", "PROGRAM_NAME": "the name of a program", "TASK": "a task",
    "$END": _END,
}  # fmt: skip
"""Tokens as errors name them; others by the word that they are."""
_UNTOLD: Final = frozenset(
    {"COMMENT", "NOTE", "CALL_OF_NUMBERS", "_CHANNEL", "_CLEAR", "_LAST", "KIND", "REST", "UNIT", "BRACKETS"}
)
"""Tokens that errors don't name."""
_PIECE: Final = re.compile(r"[#$]?[A-Za-z0-9][A-Za-z0-9_.]*|[=<>]+|.", re.DOTALL)
"""What errors quote."""

Node: TypeAlias = Any
"""A tree, or a token of Lark's, whose own types say nothing of what they hold."""


def name_of(text: str) -> str:
    """A name as trees have it: lower case, and as much of it as counts."""
    return text[: SIGNIFICANT + (text[0] in "#$")].lower()


def read(text: str, start: str, line: int) -> Any:
    """What a text is.

    Args:
        text: The text.
        start: Which rule of the grammar: `line`, `header`, `cell` or `expression`.
        line: Number of the line, for errors.

    Raises:
        ValError: If the grammar doesn't take it.
    """
    from lark.exceptions import UnexpectedInput

    parser = _lark().parse_interactive(text, start=start)
    lexer = parser.lexer_thread.state
    lexer.line_ctr.line = line
    try:
        found = parser.resume_parse()
    except UnexpectedInput as error:
        token = getattr(error, "token", None)
        begin = len(text) if type_of(token) == "$END" else error.column - 1
        raise _unexpected(text, begin, start, line) from None
    except ValError as error:
        code = text[: lexer.last_token.start_pos] if type_of(lexer.last_token) == "COMMENT" else text
        raise error.at(place=TextPosition(line, len(code.rstrip()) + 1)) from None
    for root in _roots(found) if len(text) > DEEPEST else ():
        if _levels(root) > DEEPEST:
            raise _too_deep(root.at)
    return found


def _unexpected(text: str, begin: int, start: str, line: int) -> ValError:
    """The error of a text whose grammar ends before a place, counted from 0: what is there, and what is allowed."""
    from lark.exceptions import UnexpectedInput

    piece = _PIECE.match(text, begin)
    if piece is None or piece[0] in ";#":
        what, begin = _END, len(text[:begin].rstrip())
    elif piece[0] == '"' and '"' not in text[begin + 1 :]:
        return syntax_error("the string has no closing quote", line, begin + 1)
    else:
        what = f"'{piece[0]}'" if piece[0].isprintable() else repr(piece[0])
    parser = _lark().parse_interactive(text, start=start)
    with contextlib.suppress(UnexpectedInput):
        for token in parser.lexer_thread.lex(parser.parser_state):
            if token.start_pos >= begin:
                break
            parser.feed_token(token)
    read, allowed = parser.parser_state.value_stack, parser.accepts()
    row = next(filter(None, map(_row_of_keyword, reversed(read))), None)
    form = row.usage if row is not None else _HEADER if start == "header" else ""
    if row is not None and what == _END and row.name == str(read[-1]).upper():
        return syntax_error(f"allowed: {form}", line, begin + 1, MISSING)
    if form and "$END" in allowed:
        return syntax_error(f"unexpected {what}; allowed: {form}", line, begin + 1)
    behind = f"; form: {form}" if form else ""
    return syntax_error(f"unexpected {what}; allowed: {_listed(allowed)}{behind}", line, begin + 1)


def _row_of_keyword(node: Node) -> Form | None:
    """The row of a keyword, or of a statement that has been read."""
    word = node.keyword if isinstance(node, Instruction) else node.upper() if isinstance(node, str) else ""
    return None if type_of(node) == "NAME" else forms.INSTRUCTIONS.get(word)


def _listed(allowed: Collection[str]) -> str:
    """Tokens as errors name them."""
    if "OPERANDS" in allowed:
        return "an instruction, or a variable and '='"
    left, shown = set(allowed) - _UNTOLD, []
    if left >= _VALUE:
        left -= _VALUE | _SIGNS
        shown.append("a value")
    if left >= _OPERATOR:
        left -= _OPERATOR
        shown.append("an operator")
    names = sorted(_SHOWN.get(name, name.strip("_")) for name in left - {"$END"})
    return ", ".join([*shown, *names, *([_END] if "$END" in allowed else [])])


@cache
def _lark() -> Node:
    from lark import Lark

    grammar = resources.files("interfaces.val2").joinpath("grammar.lark").read_text("utf-8")
    keywords = {"passed": [*forms.IGNORED]}
    for row in forms.INSTRUCTIONS.values():
        keywords.setdefault(row.rule, []).append(row.name)
    for short, name in forms.ABBREVIATIONS.items():
        keywords[forms.INSTRUCTIONS[name].rule].append(short)
    terminals = [_terminal(rule, names, r"(?!\s*(\[|=(?!=)))") for rule, names in keywords.items()]
    (units, always), behind = forms.INSTRUCTIONS["SPEED"].words, r'(?=\s*([,;"A-Za-z]|$))'
    for name, words in (("unit", units), ("always", always)):
        terminals.append(_terminal(name, [f'"?{word}"?' for word in words], behind))
    terminals.append(_terminal("setting", forms.PARAMETERS))
    return Lark(
        "\n".join([grammar, *terminals]),
        parser="lalr",
        lexer="contextual",
        start=["line", "header", "cell", "expression"],
        maybe_placeholders=True,
        transformer=_Trees(),
        lexer_callbacks={rule.upper(): _spelled_out for rule in keywords},
    )


def _spelled_out(token: Node) -> Node:
    """A keyword, in full where it's abbreviated."""
    name = forms.ABBREVIATIONS.get(token.upper())
    return token if name is None else token.update(value=name)


def _terminal(name: str, words: Iterable[str], behind: str = "") -> str:
    """A terminal of words, which end where a name would, and what has to come behind them."""
    some = "|".join(word.replace(".", r"\.") for word in sorted(words))
    return rf"{name.upper()}.3: /(?ai:{some})(?![A-Za-z0-9_.]){behind}/"


def undefined(i: Instruction) -> ValError | None:
    """The error of a line whose word is no instruction; None where it's one."""
    if i.keyword in forms.IGNORED or i.keyword in STATEMENTS:
        return None
    named = forms.INSTRUCTIONS.items()
    begun = sorted(name for name, row in named if name.startswith(i.keyword) and "whole" not in row.tags)
    if len(begun) > 1:
        return ValError("Ambiguous instruction", f"{i.keyword}: {', '.join(begun)}", place=i.at)
    detail = f"{i.keyword}{did_you_mean(i.keyword, forms.INSTRUCTIONS)}"
    if i.keyword in ("ELSEIF", "ELIF"):
        detail = f"{i.keyword}; allowed: ELSE on a line, and an IF of its own on the next"
    return ValError("Undefined instruction", detail, place=i.at)


def type_of(node: Node) -> str:
    """What kind of token a node is; empty of anything else."""
    return getattr(node, "type", "")


def _at(token: Node) -> TextPosition:
    return TextPosition(token.line, token.column)


def _number(text: str, at: TextPosition) -> Number:
    value = float(int(text[2:], _BASES[text[1].upper()])) if text[0] == "^" else float(text)
    if not math.isfinite(value):
        raise ValError("Number too large", text, place=at)
    return Number(value, at)


def _roots(found: Any) -> list[Expression]:
    """The expressions of what was read."""
    match found:
        case (_, Instruction() as statement, _):
            return statement.expressions
        case SignalRule(value=value):
            return [value]
    return [found]


def _levels(expression: Expression) -> int:
    return 1 + max(map(_levels, children(expression)), default=0)


def _too_deep(at: TextPosition) -> ValError:
    return ValError("Expression too complex", f"more than {DEEPEST} levels", place=at)


class _Trees:
    """What each rule of the grammar comes to, of what its parts came to; words of the grammar are tokens."""

    def line(self, parts: list[Any]) -> tuple[int | None, Instruction, str | None]:
        """The label of a line, its statement, and its comment."""
        label, statement, comment = parts
        if label is not None and (len(label.lstrip("0")) > 5 or int(label) > HIGHEST_LABEL):
            raise ValError("Invalid label", f"allowed: 0 to {HIGHEST_LABEL}", place=_at(label))
        comment = comment and comment[1:].rstrip()
        if isinstance(statement, tuple):
            statement, comment = statement
        return label and int(label), statement or BLANK, comment

    def end(self, parts: list[Any]) -> Instruction | tuple[Instruction, str]:
        """END, and behind it a comment, with a semicolon or without."""
        keyword, behind = parts
        statement = Instruction("END", at=_at(keyword))
        return statement if behind is None else (statement, behind.strip())

    def remark(self, parts: list[Any]) -> tuple[Instruction, str]:
        """REMARK: a comment alone."""
        text = parts[1] or ""
        return BLANK, (text[1:] if text[:1].isspace() else text).rstrip()

    def note(self, parts: list[Any]) -> tuple[Instruction, str]:
        """A comment alone that a name seems to begin."""
        return BLANK, parts[0][1:].rstrip()

    def passed(self, parts: list[Any]) -> Instruction:
        """What is recognised but has no meaning here."""
        keyword, rest = parts
        return Instruction(keyword.upper(), at=_at(keyword), passed=(rest or "").strip())

    def unknown(self, parts: list[Any]) -> Instruction:
        """No keyword, and no assignment either; see `undefined`."""
        word, rest = parts
        if rest and rest.startswith("=="):
            raise syntax_error("'==' compares, '=' assigns", word.line, rest.column)
        return self.passed(parts)

    def switches(self, parts: list[Any]) -> Instruction:
        """ENABLE, DISABLE, and PARAMETER of what may be a parameter of V+: that's passed over.

        Raises:
            ValError: If one looks like one that is known, or stands beside one.
        """
        keyword, rest = parts
        row = forms.INSTRUCTIONS[keyword.upper()]
        if rest is None:
            raise ValError(MISSING, f"allowed: {row.usage}")
        names = [name.strip().upper() for name in rest.strip(" ()").split(",")]
        kind, known = "switch", forms.SWITCHES.keys()
        if row.rule == "parameter":
            kind, known, names = "parameter", forms.PARAMETERS.keys(), [names[0].partition("=")[0].strip()]
        strange = [name for name in names if name not in known]
        for name in strange:
            close = did_you_mean(name, known)
            if close or len(names) > len(strange):
                detail = f"{name}{close}; allowed: {', '.join(sorted(known))}"
                raise ValError(f"Unknown {kind}", detail, place=_at(rest))
        if kind == "parameter" and not strange:
            raise ValError("Syntax error", f"allowed: {row.usage}", place=_at(rest))
        return self.passed(parts) if strange else Instruction(row.name, (), tuple(names), _at(keyword))

    def assignment(self, parts: list[Any]) -> Instruction:
        """`x = 3`, or a location without SET before it."""
        target, _, value = parts
        variable = _target(target)
        match value:
            case Apply():
                located = row_of(value).gives in ("frame", "location")
            case _:
                located = isinstance(value, Compound) or (isinstance(value, Variable) and value.prefix == "#")
        return Instruction("SET" if located or variable.prefix == "#" else "=", (variable, value), (), variable.at)

    def statement(self, parts: list[Any]) -> Instruction:
        """A keyword with operands and words, as its row says."""
        keyword, *given = parts
        row, words = forms.INSTRUCTIONS[keyword.upper()], [part for part in given if type_of(part)]
        operands = [part for part in given if not type_of(part)]
        while operands and operands[-1] is None:
            operands.pop()
        if row.rule == "group":
            operands[-1:-1] = [None] * (len(row.slots) - len(operands))
        if row.name == "ACCEL" and (len(operands) == 3 or operands[:1] == [None]):
            operands = operands[1:]
        row.expect(operands)
        made = [operand and _of_kind(row, row.slot(n).kind, operand) for n, operand in enumerate(operands)]
        called = "".join(one for one in made if isinstance(one, str))
        made = [one for one in made if not isinstance(one, str)]
        built = Instruction(row.name, tuple(made), _words(row, words), _at(keyword), program=called)
        return _MEANT[row.name](built) if row.name in _MEANT else built

    def tasks(self, parts: list[Any]) -> Instruction:
        """A program that is run beside this one: the task, cycles and the first step come before its arguments."""
        keyword, task, name, given, *numbers = parts
        row = forms.INSTRUCTIONS[keyword.upper()]
        if len(numbers) > 2:
            raise ValError(TOO_MANY, f"allowed: {row.usage}")
        number = (
            task and self.variable([task, None])
            if task and task[0].isalpha()
            else task and Number(float(task.rstrip(":")), _at(task))
        )
        before = (number, *numbers, *[None] * (2 - len(numbers)))
        called = self.call([keyword, name, given])
        return replace(called, operands=(*before, *called.operands))

    def device(self, parts: list[Any]) -> Instruction:
        """What is done with a logical unit: operands in parentheses, then others."""
        keyword, unit, *others = parts
        row = forms.INSTRUCTIONS[keyword.upper()]
        inside = [] if unit == [None] else unit or []
        if len(inside) > row.inside:
            raise ValError(TOO_MANY, f"allowed: {row.usage}")
        padded = [*inside, *[None] * (row.inside - len(inside)), *others]
        return self.statement([keyword, *padded])

    def timed(self, parts: list[Any]) -> Instruction:
        """`AT time`, or with a motion behind it."""
        keyword, time, motion = parts
        return replace(motion, begins=time) if motion else Instruction("AT", (time,), (), _at(keyword))

    def call(self, parts: list[Any]) -> Instruction:
        keyword, name, given = parts
        for token in filter(type_of, given or ()):
            raise ValError("Syntax error", f"unexpected {token}", place=_at(token))
        arguments = () if given in (None, [None]) else tuple(given)
        return Instruction(keyword.upper(), arguments, (), _at(keyword), program=name_of(name))

    def header(self, parts: list[Any]) -> Program:
        """A program without its steps."""
        keyword, name, *parameters, comment = parts
        given: dict[str, Variable] = {}
        for variable in filter(None, parameters):
            if given.setdefault(variable.name, variable) is not variable:
                raise ValError("Duplicate name", variable.name, place=variable.at)
        comment = comment and comment[1:].rstrip()
        return Program(name_of(name), tuple(given.values()), (), comment, TextPosition(keyword.line, 1))

    def parameter(self, parts: list[Any]) -> Variable:
        """An argument's name; with brackets, a whole array's."""
        token, brackets = parts
        if brackets:
            return Variable(name_of(token), (), _at(token), array=True)
        return _target(self.variable([token, None]))

    def cell(self, parts: list[Any]) -> SignalRule:
        """A line of `.SIGNALS`."""
        signal, _, value, *rest = parts
        if not signal.value.is_integer():
            raise ValError("Illegal digital signal", f"{signal.value:.9g}", place=signal.at)
        times: dict[str, float] = {}
        for word, seconds in zip(rest[::2], rest[1::2], strict=True):
            if word.type in times:
                raise ValError("Syntax error", f"a second {word}", place=_at(word))
            times[word.type] = seconds.value
        return SignalRule(
            int(signal.value), value, times.get("AFTER", 0.0), times.get("FOR"), times.get("AT"), signal.at
        )

    def operations(self, parts: list[Any]) -> Expression:
        """Operators and operands in a row: what binds more tightly comes first, else the left one does."""
        left_over = deque(parts)
        if len(parts) > 2 * DEEPEST:
            first = next(part for part in parts if not type_of(part))
            raise _too_deep(first.at)

        def row(level: int) -> Expression:
            """What stands from here on, as far as operators bind as tightly as a level or more."""
            node = left_over.popleft()
            if type_of(node):
                own = NEGATION if node in "+-" else OPERATORS[node.upper()]
                left = row(max(level, own.level))
                left = left if node == "+" else Apply(own.name, (left,), _at(node))
            else:
                left = node
            while left_over:
                token = left_over[0]
                own = OPERATORS[_SPELLINGS.get(token.upper(), token.upper())]
                if own.level < level:
                    break
                left_over.popleft()
                left = Apply(own.name, (left, row(own.level + 1)), _at(token))
            return left

        return row(0)

    def compound(self, parts: list[Any]) -> Compound:
        flat = [inner for part in parts for inner in (part.parts if isinstance(part, Compound) else (part,))]
        return Compound(tuple(flat), flat[0].at)

    def number(self, parts: list[Any]) -> Number:
        return _number(parts[0], _at(parts[0]))

    def string(self, parts: list[Any]) -> Text:
        return Text(str(parts[0][1:-1]), _at(parts[0]))

    def format(self, parts: list[Any]) -> Format:
        """`/F8.2`, and such.

        Raises:
            ValError: If there's no such item.
        """
        (token,) = parts
        code = token[1].upper()
        width, _, decimals = token[2:].partition(".")
        if code not in forms.FORMATS:
            allowed = ", ".join(f"/{c}" for c in forms.FORMATS)
            raise ValError("Invalid format", f"{token}; allowed: {allowed}", place=_at(token))
        if len(width) > 3 or len(decimals) > 2:
            raise ValError("Invalid format", f"{token} is too wide", place=_at(token))
        return Format(code, int(width) if width else None, int(decimals) if decimals else None)

    def variable(self, parts: list[Any]) -> Expression:
        token, indices = parts
        upper = token.upper()
        if indices is None and upper in forms.CONSTANTS:
            return Apply(forms.ALIASES.get(upper, upper), (), _at(token))
        if indices is None and upper in forms.OPERATORS:
            raise _misplaced(token, _at(token))
        return Variable(name_of(token), tuple(indices or ()), _at(token), array=indices == [])

    unit: Final = staticmethod(list[Any])
    indices = arguments = unit

    def apply(self, parts: list[Any]) -> Apply:
        token, given = parts
        arguments = []
        for one in given:
            match type_of(one):
                case "BY" if token.upper() not in ("SHIFT", "SCALE"):
                    raise ValError("Syntax error", "BY belongs in SHIFT and SCALE", place=_at(one))
                case "FORMAT" if token.upper() != "$ENCODE":
                    detail = f"a format such as {one} belongs in TYPE and $ENCODE"
                    raise ValError("Syntax error", detail, place=_at(one))
                case "FORMAT":
                    arguments.append(self.format([one]))
                case "":
                    arguments.append(one)
        return _applied(token, _at(token), arguments)

    def numbers(self, parts: list[Any]) -> Apply:
        """A function of numbers that are written down, which is one token."""
        (token,) = parts
        return _of_numbers(token, token.line, token.column)


def _of_numbers(text: str, line: int, column: int) -> Apply:
    """A function of numbers that are written down."""
    name, _, listed = text.partition("(")
    begin = column + len(name) + 1
    arguments: list[Expression] = []
    for found in _SIGNED.finditer(listed):
        value = _number(found[2], TextPosition(line, begin + found.start(2)))
        signed = found[1] and Apply("-", (value,), TextPosition(line, begin + found.start(1)))
        arguments.append(signed or value)
    return _applied(name.rstrip(), TextPosition(line, column), arguments)


@cache
def _moves() -> tuple[frozenset[str], re.Pattern[str]]:
    """Motions to a place and nothing else, and how lines look that are one to a function of numbers."""
    words = (row.name for row in forms.INSTRUCTIONS.values() if row.rule == "motion" and len(row.slots) == 1)
    called = _lark().get_terminal("CALL_OF_NUMBERS").pattern.value
    return frozenset(words), re.compile(rf"([ \t]*)([A-Za-z]+)([ \t]+)({called})[ \t]*")


def read_move(text: str, line: int) -> Instruction | None:
    """A motion to a function of numbers, of which long programs are full, without the grammar; None of all else.

    Raises:
        ValError: If there's no such function, or it takes another number of them.
    """
    words, looks = _moves()
    found = looks.fullmatch(text)
    if found is None or (word := found[2].upper()) not in words:
        return None
    place = _of_numbers(found[4], line, found.start(4) + 1)
    return Instruction(word, (place,), at=TextPosition(line, found.start(2) + 1))


def _applied(word: str, at: TextPosition, arguments: Sequence[Expression | Format | None]) -> Apply:
    """A function of arguments.

    Raises:
        ValError: If there's no such function, or it takes another number of them.
    """
    upper = word.upper()
    name = forms.ALIASES.get(upper, upper)
    function = forms.FUNCTIONS.get(name)
    if function is None:
        if name in forms.OPERATORS:
            raise _misplaced(word, at)
        detail = f"{upper}{did_you_mean(name, forms.FUNCTIONS)}; an array has brackets"
        raise ValError("Undefined function", detail, place=at)
    given = () if arguments == [None] else tuple(arguments)
    function.expect(given, at)
    return Apply(name, given, at)


def _misplaced(word: str, at: TextPosition) -> ValError:
    return ValError("Syntax error", f"{word.upper()} can't stand here; parentheses may be missing", place=at)


def _words(row: Form, tokens: Sequence[Node]) -> tuple[str, ...]:
    """The words behind an instruction's operands, in the order of its row.

    Raises:
        ValError: If one isn't allowed, or is a second one of its group.
    """
    words = {str(token).strip('"').upper(): token for token in tokens if token.type not in ("EQUALS", "BY")}
    if not row.words:
        return tuple("REAL" if word == "DOUBLE" else word for word in words)
    ordered = []
    for group in row.words:
        here = [word for word in words if word in group]
        if len(here) > 1:
            detail = f"one of {', '.join(group)} is allowed"
            raise ValError("Syntax error", detail, place=_at(words[here[1]]))
        ordered += here
    return tuple(ordered)


def _of_kind(row: Form, kind: str, operand: Any) -> Any:
    """An operand as its slot has it; the name of a program as text."""
    match kind, operand:
        case "label", Number(value) if value.is_integer() and value <= HIGHEST_LABEL:
            return operand
        case "label", _:
            raise ValError("Invalid label", f"allowed: 0 to {HIGHEST_LABEL}", place=operand.at)
        case "count", Number(value) if value.is_integer() and 1 <= value <= MOST_LOOPS:
            return operand
        case "count", _:
            detail = f"allowed: a number of loops, 1 to {MOST_LOOPS}"
            raise ValError("Syntax error", detail, place=operand.at)
        case "program", Variable(name, (), prefix="") | Apply(name, ()) if name[0] not in "#$":
            return name.lower()
        case "program", _:
            raise ValError("Syntax error", "allowed: the name of a program", place=operand.at)
        case "variable", _ if row.name != "HERE":
            return _target(operand)
    return operand


def _target(operand: Expression) -> Variable:
    """A variable that is to be set.

    Raises:
        ValError: If it's none.
    """
    if isinstance(operand, Variable):
        return operand
    if isinstance(operand, Apply) and operand.function in forms.CONSTANTS:
        raise ValError("Reserved name", f"{operand.function} is a function", place=operand.at)
    raise ValError("Syntax error", "unexpected value; allowed: a variable", place=operand.at)


def _shift(i: Instruction) -> Instruction:
    """`SHIFT p BY 1,,3` sets p."""
    return Instruction("SET", (i.operands[0], Apply("SHIFT", i.operands, i.at)), (), i.at)


def _inverse(i: Instruction) -> Instruction:
    """`INVERSE a = b` of VAL sets a."""
    return Instruction("SET", (i.operands[0], Apply("INVERSE", i.operands[1:], i.at)), (), i.at)


def _wait(i: Instruction) -> Instruction:
    """`WAIT 3` and `WAIT -3` of VAL wait for an input."""
    value = literal(i.operands[0]) if i.operands else None
    if value is None or not value.is_integer() or abs(value) < 1:
        return i
    (condition,) = i.operands
    at = condition.at if isinstance(condition, Number) else condition.arguments[0].at
    channel = Number(abs(value) + INPUTS[0] - 1 if abs(value) <= OUTPUTS[-1] else abs(value), at)
    return replace(i, operands=(Apply("SIG", (channel if value > 0 else Apply("-", (channel,), at),), at),))


def _loops(i: Instruction) -> Instruction:
    """`EXIT 1` is `EXIT`."""
    return replace(i, operands=()) if i.operands == (Number(1.0),) else i


def _prompt(i: Instruction) -> Instruction:
    """Without a text it's an empty one."""
    text, *names = i.operands or (None,)
    if None in names:
        raise ValError("Syntax error", "allowed: variables behind the text", place=i.at)
    return replace(i, operands=(text or Text("", i.at), *names))


def _correction(i: Instruction) -> Instruction:
    """`ALTER () 0, 0, 5` of V+ is a correction: there it's ALTON that has a mode."""
    return replace(i, keyword="ALTOUT", operands=i.operands[1:]) if i.operands and i.operands[0] is None else i


_MEANT: Final[dict[str, Callable[[Instruction], Instruction]]] = {
    "INVERSE": _inverse, "SHIFT": _shift, "WAIT": _wait, "EXIT": _loops, "NEXT": _loops, "PROMPT": _prompt,
    "ALTER": _correction,
}  # fmt: skip
"""What is written shortly, and what it stands for."""
