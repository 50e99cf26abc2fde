"""From trees to text: keywords in upper case, names in lower case; parsing it gives the same trees."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

from interfaces.val2.functions import NEGATION, OPERATORS, row_of
from interfaces.val2.instructions import STATEMENTS
from interfaces.val2.rows import TIGHTEST
from interfaces.val2.syntax import (
    Apply,
    Compound,
    Expression,
    Format,
    Instruction,
    Number,
    Program,
    Step,
    Text,
    Variable,
    children,
)

INDENT: Final = 2
"""Blanks for each level of structure."""
MARGIN: Final = 6
"""Columns in which labels stand."""

_COMPOUND: Final = TIGHTEST - 1
_SIGN: Final = NEGATION.level


def print_expression(expression: Expression) -> str:
    """The text of an expression."""
    return _spelled(expression, 0)


def _spelled(expression: Expression, level: int) -> str:
    """The text of an expression, in parentheses if it binds less than a level asks for."""
    text, own = _text(expression)
    return f"({text})" if own < level else text


def _text(expression: Expression) -> tuple[str, int]:
    match expression:
        case Number(value):
            return number(value), TIGHTEST if value >= 0 else _SIGN
        case Text(value):
            return string(value)
        case Variable():
            return _variable(expression), TIGHTEST
        case Apply():
            return _applied(expression), row_of(expression).level
        case Compound(parts):
            return ":".join(_spelled(part, TIGHTEST) for part in parts), _COMPOUND


def _applied(e: Apply) -> str:
    level, operator = row_of(e).level, f"{e.function} " if e.function.isalpha() else e.function
    match children(e):
        case _ if e.function not in OPERATORS:
            return _called(e)
        case (operand,):
            return operator + _spelled(operand, level)
        case (left, right) if operator == "^":
            return f"{_spelled(left, level)}^{_exponent(right)}"
        case (left, right):
            return f"{_spelled(left, level)} {e.function} {_spelled(right, level + 1)}"
    raise AssertionError(e)


def _exponent(expression: Expression) -> str:
    match expression, children(expression):
        case Apply("-" | "COM" as operator), (operand,):
            return f"{operator.replace('COM', 'COM ')}{_exponent(operand)}"
    return _spelled(expression, _COMPOUND)


def number(value: float) -> str:
    """The shortest text of a number that gives it again exactly."""
    text = repr(float(value)).upper()
    return text.removesuffix(".0")


def string(value: str) -> tuple[str, int]:
    """The text of a string, with `$CHR` for what can't stand between quotes, and how tightly it binds."""
    pieces = [piece for piece in re.split(r'(["\r\n])', value) if piece] or [""]
    parts = [f"$CHR({ord(piece)})" if piece and piece in '"\r\n' else f'"{piece}"' for piece in pieces]
    return " + ".join(parts), TIGHTEST if len(parts) == 1 else OPERATORS["+"].level


def _variable(variable: Variable) -> str:
    if variable.array:
        return f"{variable.name}[]"
    if not variable.indices:
        return variable.name
    return f"{variable.name}[{','.join(_spelled(i, 0) for i in variable.indices)}]"


def _called(e: Apply) -> str:
    if not e.arguments:
        return e.function if "constant" in row_of(e).tags else f"{e.function}()"
    if e.function in ("SHIFT", "SCALE") and len(e.arguments) > 1:
        return f"{e.function}({_item(e.arguments[0])} BY {_listed(e.arguments[1:])})"
    return f"{e.function}({_listed(e.arguments)})"


def _listed(items: tuple[Expression | Format | None, ...]) -> str:
    """Items with commas between them."""
    shown = ""
    for i, item in enumerate(items):
        text = _item(item)
        shown += ("," if i else "") + (" " if i and text else "") + text
    return shown


def _item(item: Expression | Format | None) -> str:
    if item is None:
        return ""
    return _format(item) if isinstance(item, Format) else _spelled(item, 0)


def _format(item: Format) -> str:
    width = "" if item.width is None else str(item.width)
    return f"/{item.code}{width}" + ("" if item.decimals is None else f".{item.decimals}")


def print_statement(statement: Instruction) -> str:
    """The text of a statement."""
    if statement.passed is not None:
        return f"{statement.keyword} {statement.passed}".rstrip()
    if statement.begins is not None:
        return f"AT {print_expression(statement.begins)} {print_statement(replace(statement, begins=None))}"
    keyword, words, listed = statement.keyword, statement.words, _listed(statement.operands)
    match STATEMENTS[keyword].rule, [_item(operand) for operand in statement.operands]:
        case "assignment" | "set" | "timing" | "group", [*_, value]:
            targets = ", ".join(_spelled(one, _COMPOUND) for one in statement.operands[:-1] if one is not None)
            return f"{keyword} {targets} = {value}".removeprefix("= ")
        case "parameter", [value]:
            return f"{keyword} {words[0]} = {value}"
        case "branch", [condition, *label]:
            return f"{keyword} {condition} " + (f"GOTO {label[0]}" if label else "THEN")
        case "while", [condition]:
            return f"{keyword} {condition} DO"
        case "loop", [variable, start, stop, *step]:
            return " ".join([f"{keyword} {variable} = {start} TO {stop}", *(f"STEP {by}" for by in step)])
        case "case", [value]:
            return f"{keyword} {value} OF"
        case "values", [*_, _]:
            return f"{keyword} {listed}:"
        case "call", given:
            return f"{keyword} {statement.program}" + (f"({listed})" if given or keyword == "CALL" else "")
        case "tasks", [task, *numbers]:
            others = ", ".join(numbers[:2]).rstrip(", ")
            called = " ".join(filter(None, (keyword, task, statement.program)))
            return f"{called}({_listed(statement.operands[3:])})" + (f", {others}" if others else "")
        case "device", _:
            inside = STATEMENTS[keyword].inside
            unit, others = _listed(statement.operands[:inside]).rstrip(","), _listed(statement.operands[inside:])
            return f"{keyword} ({unit}) {others}".rstrip() if statement.operands else keyword
        case "worded", given if statement.program:
            listed = ", ".join([*given[:1], statement.program, *given[1:]])
        case "switches", _:
            return f"{keyword} {', '.join(words)}"
        case "names", _:
            return " ".join([keyword, *words, listed])
    return " ".join(filter(None, (keyword, listed, *words)))


def print_step(step: Step) -> str:
    """The text of a step: label, statement and comment, without indentation."""
    label = "" if step.label is None else str(step.label)
    comment = None if step.comment is None else f";{step.comment}"
    return " ".join(filter(None, (label, print_statement(step.statement), comment)))


def print_program(program: Program) -> str:
    """The text of a program from `.PROGRAM` to `.END`, indented by its structure, with a newline at the end."""
    parameters = ", ".join(_variable(p) for p in program.parameters)
    comment = "" if program.comment is None else f" ;{program.comment}"
    lines = [f".PROGRAM {program.name}({parameters}){comment}"]
    level = 0
    for step in program.steps:
        i = step.statement
        goes = i.passed is not None or (i.keyword == "IF" and len(i.operands) > 1)
        tags = frozenset[str]() if goes else STATEMENTS[i.keyword].tags
        level = max(level - ("closes" in tags), 0)
        lines.append(_line(step, level))
        level += "opens" in tags
    return "\n".join([*lines, ".END", ""])


def _line(step: Step, level: int) -> str:
    label, body = "" if step.label is None else str(step.label), print_step(replace(step, label=None))
    return (label.ljust(MARGIN - 1) + " " + " " * (INDENT * level) + body).rstrip() if body or label else ""
