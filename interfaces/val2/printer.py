"""From trees to text: keywords in upper case, names in lower case; parsing it gives the same trees."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from interfaces.val2 import forms
from interfaces.val2.syntax import (
    Apply,
    Assign,
    Binary,
    Call,
    Case,
    Compound,
    Conditional,
    Expression,
    For,
    Format,
    Goto,
    Ignored,
    Instruction,
    Local,
    LoopJump,
    Number,
    PlainStatement,
    Program,
    Prompt,
    React,
    Statement,
    Step,
    Text,
    Type,
    Unary,
    Value,
    Variable,
)

INDENT: Final = 2
"""Blanks for each level of structure."""
MARGIN: Final = 6
"""Columns in which labels stand."""

_NOT, _SIGN, _POWER, _COMPOUND, _ATOM = forms.LEVEL_OF_NOT, forms.LEVEL_OF_SIGN, forms.LEVELS["^"], 9, 10


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
            return number(value), _ATOM if value >= 0 else _SIGN
        case Text(value):
            return string(value)
        case Variable():
            return _variable(expression), _ATOM
        case Apply(name, arguments):
            return _apply(name, arguments), _ATOM
        case Unary("NOT", operand):
            return f"NOT {_spelled(operand, _NOT)}", _NOT
        case Unary(operator, operand):
            blank = " " if operator == "COM" else ""
            return f"{operator}{blank}{_spelled(operand, _SIGN)}", _SIGN
        case Binary("^", left, right):
            return f"{_spelled(left, _POWER)}^{_exponent(right)}", _POWER
        case Binary(operator, left, right):
            level = forms.LEVELS[operator]
            return f"{_spelled(left, level)} {operator} {_spelled(right, level + 1)}", level
        case Compound(parts):
            return ":".join(_spelled(part, _ATOM) for part in parts), _COMPOUND


def _exponent(expression: Expression) -> str:
    if isinstance(expression, Unary) and expression.operator != "NOT":
        blank = " " if expression.operator == "COM" else ""
        return f"{expression.operator}{blank}{_exponent(expression.operand)}"
    return _spelled(expression, _COMPOUND)


def number(value: float) -> str:
    """The shortest text of a number that gives it again exactly."""
    text = repr(float(value)).upper()
    return text.removesuffix(".0")


def string(value: str) -> tuple[str, int]:
    """The text of a string, with `$CHR` for what can't stand between quotes, and how tightly it binds."""
    parts: list[str] = []
    plain = ""
    for character in value:
        if character in '"\r\n':
            parts += [f'"{plain}"'] if plain else []
            parts.append(f"$CHR({ord(character)})")
            plain = ""
        else:
            plain += character
    if plain or not parts:
        parts.append(f'"{plain}"')
    return " + ".join(parts), _ATOM if len(parts) == 1 else forms.LEVELS["+"]


def _variable(variable: Variable) -> str:
    if variable.array:
        return f"{variable.name}[]"
    if not variable.indices:
        return variable.name
    return f"{variable.name}[{','.join(_spelled(i, 0) for i in variable.indices)}]"


def _apply(name: str, arguments: tuple[Expression | Format | None, ...]) -> str:
    if not arguments:
        return name if forms.FUNCTIONS[name].constant else f"{name}()"
    if name == "SHIFT" and len(arguments) > 1:
        return f"SHIFT({_item(arguments[0])} BY {_listed(arguments[1:])})"
    return f"{name}({_listed(arguments)})"


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


_OPENING: Final = {"IF": "THEN", "WHILE": "DO", "UNTIL": ""}
"""What stands behind the condition of a keyword."""


def print_statement(statement: Statement) -> str:
    """The text of a statement."""
    match statement:
        case PlainStatement():
            return statement.value
        case Assign(target, value, keyword):
            return f"{keyword} {_variable(target)} = {print_expression(value)}".lstrip()
        case Instruction():
            return _instruction(statement)
        case Conditional(keyword, condition):
            return f"{keyword} {print_expression(condition)} {_OPENING[keyword]}".rstrip()
        case For(variable, start, stop, step):
            head = f"FOR {_variable(variable)} = {print_expression(start)} TO {print_expression(stop)}"
            return head if step is None else f"{head} STEP {print_expression(step)}"
        case Case(value):
            return f"CASE {print_expression(value)} OF"
        case Value(values):
            return f"VALUE {_listed(values)}:"
        case LoopJump(keyword, count):
            return keyword if count == 1 else f"{keyword} {count}"
        case Goto(label, condition):
            return f"GOTO {label}" if condition is None else f"IF {print_expression(condition)} GOTO {label}"
        case _:
            return _other(statement)


def _other(statement: Statement) -> str:
    match statement:
        case Call(program, arguments, keyword):
            call = f"{keyword} {program}"
            return call if keyword == "GOSUB" and not arguments else f"{call}({_listed(arguments)})"
        case React(signal, program, immediate, always):
            head = f"{'REACTI' if immediate else 'REACT'} {print_expression(signal)}"
            return head + (f", {program}" if program else "") + (" ALWAYS" if always else "")
        case Type(items):
            return f"TYPE {_listed(items)}".rstrip()
        case Prompt(text, targets):
            return f"PROMPT {_listed((text, *targets))}"
        case Local(keyword, names, kind):
            return " ".join(filter(None, (keyword, kind, _listed(names))))
        case Ignored(keyword, rest):
            return f"{keyword} {rest}".rstrip()
        case _:
            raise AssertionError(statement)


def _instruction(statement: Instruction) -> str:
    if statement.begins is not None:
        return f"AT {print_expression(statement.begins)} {_instruction(replace(statement, begins=None))}"
    keyword, operands = statement.keyword, statement.operands
    match keyword:
        case "PARAMETER":
            return f"PARAMETER {statement.words[0]} = {_listed(operands)}"
        case "TIMER":
            index, value = (_item(o) for o in operands)
            return f"TIMER {index} = {value}"
        case "ENABLE" | "DISABLE":
            return f"{keyword} {', '.join(statement.words)}"
    return " ".join(filter(None, (keyword, _listed(operands), *statement.words)))


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
        out, inside = _shape(step.statement)
        level = max(level - out, 0)
        lines.append(_line(step, level))
        level += inside
    return "\n".join([*lines, ".END", ""])


def _shape(statement: Statement) -> tuple[int, int]:
    """How many levels a statement stands further out, and how many what follows it stands further in."""
    match statement:
        case PlainStatement.END | Conditional("UNTIL"):
            return 1, 0
        case PlainStatement.ELSE | Value() | PlainStatement.ANY:
            return 1, 1
        case Conditional() | For() | Case() | PlainStatement.DO:
            return 0, 1
    return 0, 0


def _line(step: Step, level: int) -> str:
    label = "" if step.label is None else str(step.label)
    text = print_statement(step.statement)
    comment = "" if step.comment is None else f";{step.comment}"
    body = " ".join(filter(None, (text, comment)))
    return (label.ljust(MARGIN - 1) + " " + " " * (INDENT * level) + body).rstrip() if body or label else ""
