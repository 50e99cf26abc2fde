"""What is wrong with programs, as far as it can be told without running them."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Final

from typing_extensions import override

from interfaces.val2 import forms
from interfaces.val2.compiler import compiled_step
from interfaces.val2.context import MOST_PERCENT
from interfaces.val2.controller import Controller
from interfaces.val2.errors import CheckFinding, TextPosition, ValError
from interfaces.val2.expressions import Closure, kind_of, unset
from interfaces.val2.functions import FUNCTIONS, UNRESERVED, row_of
from interfaces.val2.grammar import SIGNIFICANT
from interfaces.val2.instructions import STATEMENTS, ProgramCompiler, arguments_of
from interfaces.val2.memory import Slots
from interfaces.val2.motion import Arm, EngineRobot
from interfaces.val2.parser import lines_of, split_comment
from interfaces.val2.rows import NUMBERS
from interfaces.val2.signals import HIGHEST, legal, require_bits, settable
from interfaces.val2.source import SourceFile, read_all, says_dialect
from interfaces.val2.structure import Structure, StructureBlock, survey
from interfaces.val2.syntax import (
    BLANK,
    Apply,
    Compound,
    Expression,
    Instruction,
    Program,
    Variable,
    children,
    literal,
    parts,
)
from interfaces.val2.values import VAL2, VPLUS, Dialect
from robots import puma560
from vrs.checks import did_you_mean
from vrs.engine import Engine

_WORD: Final = re.compile(r'"[^"]*"|[#$]?[A-Za-z][A-Za-z0-9_.]*')


def _error(error: ValError) -> CheckFinding:
    return CheckFinding("error", error, error.place)


def _warning(error: ValError) -> CheckFinding:
    return CheckFinding("warning", error, error.place)


def check_text(text: str, name: str) -> tuple[SourceFile | None, list[CheckFinding]]:
    """Read a file and check it; see `check_files`."""
    (only,) = check_files([(text, name)])
    return only


def check_files(
    files: Sequence[tuple[str, str]], dialect: Dialect | None = None
) -> list[tuple[SourceFile | None, list[CheckFinding]]]:
    """Read files and check them, each with the programs and values of all.

    Args:
        files: Texts and names.
        dialect: In which their angles are, as far as they don't say; VAL-II's unless given.

    Returns:
        Of each what it holds, None if not every line could be read; and what was found, in the order of its lines.
    """
    read = [read_all(*file, dialect or VAL2) for file in files]
    names, twice, checked = _Names(read), set[str](), list[tuple[SourceFile | None, list[CheckFinding]]]()
    for (text, _), (source, unreadable, _) in zip(files, read, strict=True):
        found = [_error(error) for error in unreadable.values()]
        if not (names.programs or found or checked):
            found.append(_error(ValError("Undefined program", "the file holds none", place=TextPosition(1, 1))))
        for program in source.programs:
            if program.name in twice:
                found.append(_error(ValError("Duplicate program", program.name, place=program.at)))
            twice.add(program.name)
            found += _Checker(program, names, unreadable.keys()).findings()
        found += _alike_names(text)
        found += _strange_angles(source, said=dialect is not None or says_dialect(text))
        checked.append((None if unreadable else source, sorted(found, key=_order)))
    return checked


def _order(finding: CheckFinding) -> tuple[int, int]:
    place = finding.place
    return (0, 0) if place is None else (place.line, place.column)


class _Names:
    """What files set, and what their programs take."""

    def __init__(self, read: Sequence[tuple[SourceFile, Mapping[int, ValError], Collection[str]]]) -> None:
        """Gather it from files, their lines that can't be read, and the names that those may have set."""
        self.programs: dict[str, Program] = {}
        self._unknown: set[str] = set()
        """Programs whose arguments can't be read."""
        self.context = Controller(Arm(EngineRobot(Engine(puma560.model()))))
        """For what compiling shows; nothing runs in it."""
        self._set: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
        """Names that are set, by the programs whose own they are, and the kinds of what they're set to; the empty
        name stands for all programs."""
        for source, unreadable, words in read:
            for entry in source.values:
                kind = {float: "real", str: "string"}.get(type(entry.value), "frame")
                self._set[""][entry.variable.name].add(kind)
            for program in source.programs:
                self._gather(self.programs.setdefault(program.name, program))
                self._unknown |= {program.name} if program.at.line in unreadable else set()
            for word in words:
                self._set[""][word].update()

    def _gather(self, program: Program) -> None:
        own = _own(program)
        self._set[program.name] |= {parameter.name: set() for parameter in program.parameters}
        for i in (step.statement for step in program.steps):
            for name in (variable.name for variable in _written(i)):
                self._set[program.name if name in own else ""][name].add(_given(i))

    def usable(self, program: Program) -> dict[str, set[str]]:
        """Names that a program may read, and the kinds of what they're set to."""
        own = _own(program)
        return {name: kinds for name, kinds in self._set[""].items() if name not in own} | self._set[program.name]

    def wrong_calls(self, i: Instruction) -> Iterator[ValError]:
        """What is wrong with the program that a statement calls, or with its arguments."""
        if not i.program:
            return
        called = self.programs.get(i.program)
        if called is None:
            yield ValError("Undefined program", f"{i.program}{did_you_mean(i.program, self.programs)}", place=i.at)
        elif STATEMENTS[i.keyword].rule in ("call", "tasks") and i.program not in self._unknown:
            parameters, arguments = called.parameters, arguments_of(i)
            if len(arguments) > len(parameters):
                detail = f"{i.program} takes {len(parameters)}, and here are {len(arguments)}"
                yield ValError("Too many arguments", detail, place=i.at)
            for argument, parameter in zip(arguments, parameters, strict=False):
                if argument is not None:
                    yield from _passed(argument, parameter)


def _own(program: Program) -> set[str]:
    """Names that are the program's own."""
    local = (step.statement for step in program.steps if step.statement.keyword in ("AUTO", "LOCAL"))
    return {v.name for v in (*program.parameters, *(v for i in local for v in i.operands))}


class _Checker(ProgramCompiler):
    """Compiles a program to find out what is wrong with it, and goes on after what is wrong."""

    def __init__(self, program: Program, names: _Names, unreadable: Collection[int]) -> None:
        found, self._errors = survey(program)
        jumps = defaultdict(int, found.jumps)
        blocks = defaultdict(lambda: StructureBlock("IF", 0, 0), found.blocks)
        super().__init__(program, names.context, Structure(found.labels, jumps, blocks))
        self._names, self._usable, self._unreadable = names, names.usable(program), unreadable
        parameters = {parameter.name for parameter in program.parameters}
        self.known = {
            name: next(iter(kinds))
            for name, kinds in self._usable.items()
            if len(kinds) == 1 and name not in parameters
        }
        self.known = {name.lower(): row.gives for name, row in UNRESERVED.items()} | self.known
        """Kinds of names without a prefix."""
        self._reported: set[str] = set()
        self._warnings: list[ValError] = []
        self._statement = BLANK

    def findings(self) -> Iterator[CheckFinding]:
        """What is wrong with the program."""
        steps = {step.at.line: (n, step) for n, step in enumerate(self.program.steps)}
        for n, step in steps.values():
            if step.at.line not in self._unreadable:
                self._check(step.statement, n)
        for finding in (*map(_warning, self._warnings), *map(_error, self._errors)):
            if finding.place is None or finding.place.line not in self._unreadable:
                n, step = steps[finding.place.line] if finding.place is not None else (0, self.program.steps[0])
                error = finding.error.at(program=self.program.name, step=n + 1, place=step.at)
                yield CheckFinding(finding.severity, error, error.place)

    def _check(self, i: Instruction, n: int) -> None:
        self._statement = i
        if i.passed is not None and i.keyword not in forms.UNAVAILABLE:
            why = f": {forms.PASSED[i.keyword]}" if i.keyword in forms.PASSED else ""
            detail = f"{i.keyword} {i.passed}".rstrip() + f" is passed over{why}"
            self._warnings.append(ValError("No meaning here", detail, place=i.at))
        self._errors += self._names.wrong_calls(i)
        before = len(self._errors)
        try:
            compiled_step(self, n, i)
            match i:
                case Instruction("PARAMETER", (operand,), (name,)) if (value := literal(operand)) is not None:
                    forms.PARAMETERS[name].require(value, "Value out of range", operand.at)
                case Instruction("=", (Variable("bits", ()), operand)) if literal(operand) is not None:
                    detail = f"a variable is set; of signals: {STATEMENTS['BITS'].usage}"
                    self._warnings.append(ValError("Looks like an instruction", detail, place=i.at))
                case Instruction("BITS", (_, count, operand)) if (value := literal(operand)) is not None:
                    if (many := 1.0 if count is None else literal(count)) is not None:
                        require_bits(many, value)
        except ValError as error:
            if len(self._errors) == before:
                self._errors.append(error.at(place=i.at))

    @override
    def of_kind(self, kind: str, e: Expression) -> Closure:
        """A closure of an expression, after what is wrong with it has been noted."""
        error = _mistake(kind, e, self.known)
        if error is not None:
            self._errors.append(error)
            return _nothing
        shares = kind == "percent" or (kind == "speed" and not {"MMPS", "IPS"} & set(self._statement.words))
        value = literal(e) if shares else None
        if value is not None and value > MOST_PERCENT:
            detail = f"{self._statement.keyword} {value:.9g} % counts as {MOST_PERCENT:g} %"
            self._warnings.append(ValError("Value out of range", detail, place=e.at))
        try:
            made = super().of_kind(kind, e)
        except ValError as failure:
            error, made = failure.at(place=e.at), _nothing
        known = isinstance(e, Variable) and (e.name in self._usable or e.name.upper() in UNRESERVED)
        if error is None and isinstance(e, Variable) and not known:
            if e.name in self._reported:
                return made
            self._reported.add(e.name)
            error = unset(e, location=kind in ("location", "frame", "point"))
            if e.name.upper() not in FUNCTIONS:
                error = ValError(error.what, f"{error.detail}; nothing in the file sets it", place=e.at)
        self._errors += [] if error is None else [error]
        return made


def _nothing(_: Slots) -> None:
    """Stand for what can't be compiled."""


def _given(statement: Instruction) -> str:
    """What a statement sets names to: a real, a location, or either."""
    match statement:
        case Instruction("=" | "DECOMPOSE" | "FOR" | "SETI"):
            return "real"
        case Instruction("SET" | "HERE"):
            return "frame"
    return ""


def _passed(argument: Expression, parameter: Variable) -> Iterator[ValError]:
    kind = kind_of(argument, {})
    wanted = {"$": "string", "#": "point"}.get(parameter.prefix)
    if kind and (kind != wanted if wanted else kind in ("string", "point")):
        yield ValError("Mixed types", f"an argument for {parameter.name}", place=argument.at)


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


_STRANGE: Final = {
    VAL2: ("A is -90 to 90 deg; a line ;VPLUS says that the angles are yaw, pitch, roll", 90.0, 1.0),
    VPLUS: ("pitch is 0 to 180 deg; a line ;VAL2 says that the angles are O, A, T", 0.0, -1.0),
}  # fmt: skip
"""What second angles a dialect prints, and from where on, on which side, one looks like the other dialect's."""


_VPLUS_ALONE: Final = (
    "ATTACH", "AUTO", "DETACH", "EXECUTE", "FCLOSE", "GLOBAL", "LOCAL", "READ", "SELECT", "WRITE",
)  # fmt: skip
"""Instructions that no program of VAL-II's has."""


def _strange_angles(source: SourceFile, *, said: bool) -> Iterator[CheckFinding]:
    """A warning where the first angles of a file look like those of the other dialect.

    Args:
        source: The file.
        said: Whether somebody has said which they are; else instructions that V+ alone has look like it, too.
    """
    angles = [(entry.second, entry.variable.at, source.dialect) for entry in source.of("locations")]
    words: list[Instruction] = []
    for program in source.programs:
        for i in (step.statement for step in program.steps):
            words += [i] if i.keyword in _VPLUS_ALONE else []
            inner = [part for expression in i.expressions for part in parts(expression)]
            angles += [
                (literal(part.arguments[4]) if len(part.arguments) > 4 else None, part.at, program.dialect)
                for part in inner
                if isinstance(part, Apply) and part.function == "TRANS" and len(part.arguments) > 3
            ]
    for second, at, dialect in angles:
        why, edge, side = _STRANGE[dialect]
        if second is not None and (second - edge) * side > _ROUNDED:
            yield _warning(ValError("Angles of another dialect", f"{second:.9g}: {why}", place=at))
            return
    for _, at, dialect in angles:
        if words and dialect is VAL2 and not said:
            detail = f"read as O, A, T, and {words[0].keyword} is V+'s; a line ;VPLUS, or ;VAL2, says which"
            yield _warning(ValError("Angles of another dialect", detail, place=at))
            return


_ROUNDED: Final = 1e-3
"""Angles of a location that was written with few decimals [deg]."""


def _written(i: Instruction) -> Iterator[Variable]:
    """The variables that a statement may set; `$DECODE` shortens its first argument."""
    if i.keyword == "ATTACH" and i.operands and isinstance(i.operands[0], Variable):
        yield i.operands[0]
    if i.passed is not None or i.keyword in ("AUTO", "LOCAL", "GLOBAL"):
        return
    row = STATEMENTS[i.keyword]
    for n, operand in enumerate(i.operands):
        last = operand.parts[-1] if i.keyword == "HERE" and isinstance(operand, Compound) else operand
        if isinstance(last, Variable) and (i.program or row.slot(n).kind == "variable"):
            yield last
        elif i.keyword in ("=", "TYPE") and isinstance(operand, Apply | Compound):
            for part in parts(operand):
                match part:
                    case Apply("$DECODE", (Variable() as target, *_)):
                        yield target


def _range(low: float, high: float, allowed: str) -> Callable[[float], None]:
    def require_valid(value: float) -> None:
        if not low <= value <= high:
            raise ValError("Value out of range", f"allowed: {allowed}")

    return require_valid


_CHECKS: Final[Mapping[str, Callable[[float], object]]] = {
    "signal": legal,
    "output": settable,
    "seconds": _range(0, 1e6, "seconds, not negative"),
    "time": _range(0, 1e9, "seconds, not negative"),
    "speed": _range(1e-3, 1e6, "a speed above 0"),
    "opening": _range(0, math.inf, "an opening of 0 mm or above"),
    "mode": _range(0, 3, "a mode, 0 to 3"),
    "priority": _range(1, HIGHEST, f"a priority, 1 to {HIGHEST:g}"),
    **{what: _range(n[0], n[-1], f"a {what}, {n[0]} to {n[-1]}") for what, n in NUMBERS.items()},
}
"""What numbers that are written down have to be."""


def _mistake(asked: str, e: Expression, known: Mapping[str, str]) -> ValError | None:
    """What an expression that has to be of a kind can't be, apart from what it's made of.

    Args:
        asked: What it has to be.
        e: The expression.
        known: What is known of names without a prefix.
    """
    value = literal(e) if asked in _CHECKS else None
    if value is not None:
        try:
            _CHECKS[asked](value)
        except ValError as error:
            return error.at(place=e.at)
    if isinstance(e, Apply) and row_of(e).alike and {"real", "string"} == {kind_of(p, known) for p in children(e)}:
        return ValError("Mixed types", f"a number and a string with {e.function} between them", place=e.at)
    return None
