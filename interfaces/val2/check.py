"""What is wrong with programs, as far as it can be told without running them."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Final

from interfaces.val2 import forms
from interfaces.val2.compiler import compiled, refusal, standalone_error
from interfaces.val2.context import MOST_PERCENT, TIMERS, Context
from interfaces.val2.errors import CheckFinding, TextPosition, ValError
from interfaces.val2.expressions import kind_of
from interfaces.val2.functions import row_of
from interfaces.val2.grammar import SIGNIFICANT
from interfaces.val2.instructions import STATEMENTS, stands_for_frame
from interfaces.val2.memory import mismatch
from interfaces.val2.motion import Arm, EngineRobot
from interfaces.val2.parser import lines_of, split_comment
from interfaces.val2.rows import Kind, nearest
from interfaces.val2.signals import legal, settable
from interfaces.val2.source import SourceFile, read_all
from interfaces.val2.structure import survey
from interfaces.val2.syntax import (
    Apply,
    Compound,
    Expression,
    Format,
    Instruction,
    Program,
    Step,
    Text,
    Variable,
    children,
    literal,
    parts,
)
from robots import puma560
from vrs.engine import Engine

_WORD: Final = re.compile(r'"[^"]*"|[#$]?[A-Za-z][A-Za-z0-9_.]*')


def _error(error: ValError) -> CheckFinding:
    return CheckFinding("error", error, error.place)


def _warning(error: ValError) -> CheckFinding:
    return CheckFinding("warning", error, error.place)


def check_text(text: str, name: str) -> tuple[SourceFile | None, list[CheckFinding]]:
    """Read a file and check it.

    Args:
        text: Text of the file.
        name: Its name.

    Returns:
        What it holds, None if not every line could be read; and what was found, in the order of its lines.
    """
    source, unreadable, words = read_all(text, name)
    found = [_error(error) for error in unreadable.values()]
    if not source.programs and not unreadable:
        found.append(_error(ValError("Undefined program", "the file holds none", place=TextPosition(1, 1))))
    checker = _Checker(source, unreadable.keys(), words)
    for program in source.programs:
        found += checker.program(program)
    found += _alike_names(text)
    return None if unreadable else source, sorted(found, key=_order)


def _order(finding: CheckFinding) -> tuple[int, int]:
    place = finding.place
    return (0, 0) if place is None else (place.line, place.column)


class _Checker:
    """What is wrong with the programs of a file."""

    def __init__(self, source: SourceFile, unreadable: Collection[int], words: Collection[str]) -> None:
        """Gather what the file sets.

        Args:
            source: The file.
            unreadable: Numbers of lines in whose place others stand: nothing more is said of them.
            words: Names that those lines may have set.
        """
        self._unreadable = unreadable
        self._programs = {program.name: program for program in source.programs}
        self._context = Context(Arm(EngineRobot(Engine(puma560.model()))), compiled)
        """For what compiling shows; nothing runs in it."""
        self._set: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
        """Names that are set, by the programs whose own they are, and the kinds of what they're set to; the empty
        name stands for all programs."""
        for kind, entries in (("frame", source.locations), ("real", source.reals), ("string", source.strings)):
            for entry in entries:
                self._set[""][entry.variable.name].add(kind)
        for program in source.programs:
            own = self._own(program)
            self._set[program.name] |= {parameter.name: set() for parameter in program.parameters}
            for i in (step.statement for step in program.steps):
                for name in (variable.name for variable in writes(i)):
                    self._set[program.name if name in own else ""][name].add(_given(i))
        for word in words:
            self._set[""][word].update()

    @staticmethod
    def _own(program: Program) -> set[str]:
        """Names that are the program's own."""
        local = (step.statement for step in program.steps if step.statement.keyword in ("AUTO", "LOCAL"))
        return {v.name for v in (*program.parameters, *(v for i in local for v in i.operands))}

    def program(self, program: Program) -> Iterator[CheckFinding]:
        """What is wrong with a program."""
        structure, errors = survey(program)
        yield from (_error(e) for e in errors if e.place is None or e.place.line not in self._unreadable)
        own, parameters = self._own(program), {parameter.name for parameter in program.parameters}
        usable = {name: kinds for name, kinds in self._set[""].items() if name not in own} | self._set[program.name]
        known = {
            name: next(iter(kinds)) for name, kinds in usable.items() if len(kinds) == 1 and name not in parameters
        }
        reported: set[str] = set()
        for number, step in enumerate(program.steps, 1):
            if step.at.line in self._unreadable:
                continue
            head = structure.blocks.get(number - 1)
            above = None if head is None else program.steps[head.start]
            for error in () if above is None or above.at.line in self._unreadable else _case(step, above, known):
                yield _error(error.at(program=program.name, step=number, place=step.at))
            for finding in self._step(step, known, usable, reported):
                error = finding.error.at(program=program.name, step=number, place=step.at)
                yield CheckFinding(finding.severity, error, error.place)

    def _step(
        self, step: Step, known: dict[str, str], usable: Collection[str], reported: set[str]
    ) -> Iterator[CheckFinding]:
        statement, read = step.statement, reads(step.statement)
        if statement.passed is not None and statement.keyword not in forms.UNAVAILABLE:
            detail = f"{statement.keyword} {statement.passed}".rstrip() + " is passed over"
            yield _warning(ValError("No meaning here", detail, place=statement.at))
        yield from (_warning(error) for error in _capped(statement))
        errors = [*self._calls(statement), *_set_parameter(statement)]
        for expression, asked in read:
            errors += [*_misused(expression, asked), *mistakes(expression, asked, known)]
        match statement:
            case Instruction("FOR", (variable, *_)) if variable.prefix:
                errors.append(mismatch(variable))
        if not errors and standalone_error(step) is None:
            # What is no mistake here and can't be compiled would stop the program when it comes there.
            uncompilable = refusal(step, self._context)
            errors += [] if uncompilable is None else [uncompilable]
        yield from (_error(error) for error in errors)
        for expression, asked in read:
            yield from self._unset(expression, asked, usable, reported)

    def _unset(
        self, expression: Expression, asked: Kind, usable: Collection[str], reported: set[str]
    ) -> Iterator[CheckFinding]:
        """Names that nothing in the file sets, each once in a program; functions that do nothing."""
        match expression:
            case Variable(name, _, at) if name not in usable and name not in reported:
                reported.add(name)
                located = name[0] == "#" or asked in ("location", "frame", "point")
                what = "Undefined location" if located else "Undefined value"
                yield _error(ValError(what, f"{name}; nothing in the file sets it", place=at))
            case Apply(name, _, at) if "idle" in row_of(expression).tags:
                gives = '""' if row_of(expression).gives == "string" else "0"
                yield _warning(ValError("No meaning here", f"{name} is {gives}", place=at))
                return
        for child, kind in wanted(expression):
            yield from () if kind == "name" else self._unset(child, kind, usable, reported)

    def _calls(self, statement: Instruction) -> Iterator[ValError]:
        match statement:
            case Instruction("CALL" | "GOSUB", arguments, at=at, program=name):
                called = self._programs.get(name)
                if called is None:
                    yield self._undefined(name, at)
                    return
                if called.at.line in self._unreadable:
                    return
                parameters = called.parameters
                if len(arguments) > len(parameters):
                    detail = f"{name} takes {len(parameters)}, and here are {len(arguments)}"
                    yield ValError("Too many arguments", detail, place=at)
                for argument, parameter in zip(arguments, parameters, strict=False):
                    if argument is not None:
                        yield from _passed(argument, parameter)
            case Instruction("REACT" | "REACTI", at=at, program=name) if name and name not in self._programs:
                yield self._undefined(name, at)

    def _undefined(self, name: str, at: TextPosition) -> ValError:
        close = nearest(name.upper(), [known.upper() for known in self._programs])
        return ValError("Undefined program", f"{name}{close.lower()}", place=at)


def _case(step: Step, head: Step, known: dict[str, str]) -> Iterator[ValError]:
    """CASE of what is neither a number nor a string, and VALUE of what can't be the same."""
    i = step.statement
    if head.statement.keyword != "CASE":
        return
    (given,) = head.statement.operands
    values = i.operands if i.keyword in ("VALUE", "CASE") else ()
    wanted: Kind = "string" if kind_of(given, known) == "string" else "real"
    for value in values:
        yield from mistakes(value, wanted, known)


def _given(statement: Instruction) -> str:
    """What a statement sets names to: a real, a location, or either."""
    match statement:
        case Instruction("=" | "DECOMPOSE" | "FOR"):
            return "real"
        case Instruction("SET" | "HERE"):
            return "frame"
    return ""


def _passed(argument: Expression, parameter: Variable) -> Iterator[ValError]:
    kind = kind_of(argument, {})
    wanted = {"$": "string", "#": "point"}.get(parameter.prefix)
    if kind and (kind != wanted if wanted else kind in ("string", "point")):
        yield ValError("Mixed types", f"an argument for {parameter.name}", place=argument.at)


def _set_parameter(statement: Instruction) -> Iterator[ValError]:
    """A number that a parameter can't be."""
    match statement:
        case Instruction("PARAMETER", (operand,), (name,)) if (value := literal(operand)) is not None:
            row = forms.PARAMETERS[name]
            if not row.low <= value <= row.high:
                allowed = f"{row.low:g} to {row.high:g} {row.unit}"
                yield ValError("Value out of range", f"allowed: {allowed}", place=operand.at)


def _capped(statement: Instruction) -> Iterator[ValError]:
    """Shares that are written down and count as less."""
    shares = ("percent",) if {"MMPS", "IPS"} & set(statement.words) else ("percent", "speed")
    for operand, kind in _operands(statement):
        value = literal(operand)
        if kind in shares and value is not None and value > MOST_PERCENT:
            detail = f"{statement.keyword} {value:.9g} % counts as {MOST_PERCENT:g} %"
            yield ValError("Value out of range", detail, place=operand.at)


def _alike_names(text: str) -> Iterator[CheckFinding]:
    """Names that differ only where names don't count any more."""
    first: dict[str, str] = {}
    try:
        lines = lines_of(text)
    except ValError:
        return
    for number, line in enumerate(lines, 1):
        try:
            code, _ = split_comment(line, number)
        except ValError:
            continue
        for found in _WORD.finditer(code):
            name = found[0].lower()
            counted = name[: SIGNIFICANT + (name[0] in "#$")]
            if name[0] == '"' or len(counted) < SIGNIFICANT:
                continue
            other = first.setdefault(counted, name)
            if other != name:
                detail = f"{name} is the same as {other}: {SIGNIFICANT} characters count"
                first[counted] = name
                yield _warning(ValError("Long names", detail, place=TextPosition(number, found.start() + 1)))


def _operands(i: Instruction) -> Iterator[tuple[Expression, Kind]]:
    """The operands of an instruction, and what kind each has to be of: `variable` for what it may set."""
    match i:
        case Instruction("=" | "SET", (target, value)):
            yield target, "variable"
            if i.keyword == "=":
                yield value, "string" if target.prefix == "$" else "real"
            else:
                yield value, "point" if target.prefix == "#" else "frame"
        case Instruction("HERE", (target,)):
            *others, last = target.parts if isinstance(target, Compound) else (target,)
            yield from ((other, "frame") for other in others)
            if isinstance(last, Variable):
                yield last, "variable"
        case Instruction("BASE", (only,)) if not isinstance(only, Text) and stands_for_frame(i):
            yield only, "any"
        case Instruction("CALL" | "GOSUB", given):
            yield from ((a, "variable" if isinstance(a, Variable) else "any") for a in given if a is not None)
        case Instruction(keyword, operands, passed=None) if keyword not in ("AUTO", "LOCAL", "GLOBAL"):
            row = STATEMENTS[keyword]
            for n, operand in enumerate(operands if row.slots else ()):
                if operand is not None and not isinstance(operand, Format):
                    yield operand, row.slot(n).kind


def reads(statement: Instruction) -> list[tuple[Expression, Kind]]:
    """What a statement reads, and what kind each has to be of; indices of what it sets among it."""
    found = [one for one in _operands(statement) if one[1] != "variable"]
    if statement.begins is not None:
        found.append((statement.begins, "real"))
    return found + [(index, "real") for target in writes(statement) for index in target.indices]


def writes(statement: Instruction) -> Iterator[Variable]:
    """The variables that a statement may set; `$DECODE` shortens its first argument."""
    for operand, kind in _operands(statement):
        if kind == "variable" and isinstance(operand, Variable):
            yield operand
        elif statement.keyword in ("=", "TYPE"):
            for part in parts(operand):
                match part:
                    case Apply("$DECODE", (Variable() as target, *_)):
                        yield target


def wanted(expression: Expression) -> Iterator[tuple[Expression, Kind]]:
    """The parts of an expression, and what kind each has to be of; those of `+` and relations have to be alike."""
    if isinstance(expression, Apply):
        row = row_of(expression)
        for n, argument in enumerate(expression.arguments):
            if argument is not None and not isinstance(argument, Format):
                yield argument, row.slot(n).kind
    else:
        kind: Kind = "frame" if isinstance(expression, Compound) else "real"
        yield from ((child, kind) for child in children(expression))


_SHOWN: Final[Mapping[str, str]] = {
    "real": "a number", "string": "a string", "frame": "a transformation",
    "location": "a location", "point": "a precision point",
}  # fmt: skip
_FITS: Final[Mapping[str, tuple[str, ...]]] = {
    "string": ("string",), "frame": ("frame",), "point": ("point",), "location": ("frame", "point", "location"),
}  # fmt: skip
_UNTOLD: Final = ("any", "alike", "variable", "array", "name", "label", "program", "text")
"""What may be of any kind, or is told elsewhere."""


def _range(low: float, high: float, allowed: str) -> Callable[[float], None]:
    def require_valid(value: float) -> None:
        if not low <= value <= high:
            raise ValError("Value out of range", f"allowed: {allowed}")

    return require_valid


_CHECKS: Final[Mapping[str, Callable[[float], object]]] = {
    "signal": legal,
    "output": settable,
    "joint": _range(1, 6, "a joint, 1 to 6"),
    "seconds": _range(0, 1e6, "seconds, not negative"),
    "time": _range(0, 1e9, "seconds, not negative"),
    "speed": _range(1e-3, 1e6, "a speed above 0"),
    "mode": _range(0, 3, "a mode, 0 to 3"),
    "timer": _range(TIMERS[0], TIMERS[-1], f"a timer, {TIMERS[0]} to {TIMERS[-1]}"),
}
"""What numbers that are written down have to be."""
_STANDING: Final = ("HERE", "DEST")
"""Functions that give joints where a precision point is wanted."""


def _misused(expression: Expression, asked: Kind) -> Iterator[ValError]:
    """What is wrong with the numbers that are written down."""
    value = literal(expression)
    if value is None:
        for part, kind in wanted(expression):
            yield from _misused(part, kind)
    elif asked in _CHECKS:
        try:
            _CHECKS[asked](value)
        except ValError as error:
            yield error.at(place=expression.at)


def mistakes(expression: Expression, asked: Kind, known: Mapping[str, str]) -> Iterable[ValError]:
    """What in an expression can't be of the kind that it has to be of.

    Args:
        expression: The expression.
        asked: What it has to be.
        known: What is known of names without a prefix.
    """
    kind = kind_of(expression, known)
    if asked == "point" and isinstance(expression, Apply) and expression.function in _STANDING:
        kind = "point"
    if kind and asked not in _UNTOLD and kind not in _FITS.get(asked, ("real",)):
        detail = f"{_SHOWN[kind]} where {_SHOWN.get(asked, _SHOWN['real'])} is wanted"
        yield ValError("Mixed types", detail, place=expression.at)
        return
    if isinstance(expression, Apply) and row_of(expression).alike:
        yield from _alike(expression, known)
    else:
        for part, kind_of_part in wanted(expression):
            yield from mistakes(part, kind_of_part, known)


def _alike(whole: Apply, known: Mapping[str, str]) -> Iterable[ValError]:
    """`+` and relations take two numbers or two strings."""
    kinds = {kind_of(part, known) for part in children(whole)} - {""}
    if kinds == {"real", "string"}:
        yield ValError("Mixed types", f"a number and a string with {whole.function} between them", place=whole.at)
        return
    if kinds:
        for part in children(whole):
            yield from mistakes(part, "string" if kinds == {"string"} else "real", known)
