"""What memory and disk hold: LIST.., DIRECTORY, FREE, ID; LOAD, STORE, DELETE, COPY, RENAME, ZERO, FLIST."""

from __future__ import annotations

import re
from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, TypeVar

from interfaces.val2.errors import ValError
from interfaces.val2.memory import KINDS, MOST_VALUES, Memory
from interfaces.val2.monitor import layout
from interfaces.val2.monitor.state import Dialogue, Style, TerminalState, halves, named, nothing, pieces
from interfaces.val2.parser import parse_expression
from interfaces.val2.printer import number, print_expression, print_program
from interfaces.val2.source import NamedValue, SourceFile, print_file, read_file, with_called
from interfaces.val2.syntax import Program, Variable
from interfaces.val2.syntax import parts as parts_of
from interfaces.val2.values import Value

T = TypeVar("T")
_WORDS: Final = {"programs": "program name", "locations": "location", "reals": "value", "strings": "value"}
"""What one of them is called that there isn't."""
_PATTERN: Final = re.compile(r"[#$]?[A-Za-z*?][A-Za-z0-9._*?]*(\[[-0-9, *]*\])?")
"""A name, of an element of an array too, in which `*` and `?` may stand for others."""


def list_programs(state: TerminalState, rest: str) -> None:
    """LISTP: programs with their steps."""
    programs = _programs(state, rest)
    for program in programs.values():
        head, *steps, end = print_program(program).splitlines()
        state.say(head, *layout.numbered(steps), end)
    if not programs:
        state.say("No programs")


def list_values(state: TerminalState, rest: str, *, kind: str) -> None:
    """LISTL, LISTR, LISTS, by the kind: `locations`, `reals` or `strings`; of the last two an expression, too."""
    # Precision points come last.
    entries = sorted(_entries(state.controller.memory, kind).items(), key=lambda entry: entry[0].startswith("#"))
    known = {name: entry.value for name, entry in entries}
    computed = not all(_PATTERN.fullmatch(piece) for piece in pieces(rest))
    if kind == "reals" and (computed or _product(rest, known)):
        state.say(number(state.number(rest)))
    elif kind == "strings" and computed:
        value = state.value(rest)
        if not isinstance(value, str):
            raise ValError("Invalid argument", f"{rest}: a string is wanted")
        state.say(f'"{layout.visible(value)}"')
    else:
        state.say_all(
            layout.values(chosen(known, rest, _WORDS[kind]), state.controller.dialect, state.width), f"No {kind}"
        )


def _product(rest: str, known: Iterable[str]) -> bool:
    """Whether a `*` multiplies: no name is meant by it, and it's between two operands."""
    if "*" not in rest or any(matcher(piece).fullmatch(name) for piece in pieces(rest) for name in known):
        return False
    try:
        parse_expression(rest)
    except ValError:
        return False
    return True


def _programs(state: TerminalState, rest: str) -> dict[str, Program]:
    return chosen(dict(sorted(state.controller.memory.programs.items())), rest, _WORDS["programs"])


def chosen(known: Mapping[str, T], rest: str, kind: str) -> dict[str, T]:
    """Those of the known names that are named; all where none is.

    Args:
        known: By name.
        rest: Names between commas; `*` stands for any characters, a name for all elements of an array.
        kind: What they are, for the error.

    Raises:
        ValError: If nothing is so named, or can be.
    """
    if not rest:
        return dict(known)
    found: dict[str, T] = {}
    for piece in pieces(rest):
        wanted = matcher(piece)
        some = {name: value for name, value in known.items() if wanted.fullmatch(name)}
        if not (some or _PATTERN.fullmatch(piece)):
            raise ValError("Invalid argument", f"{piece}: a name is wanted; * stands for any characters")
        if not some:
            raise ValError(f"Undefined {kind}", piece)
        found |= some
    return found


def matcher(pattern: str) -> re.Pattern[str]:
    """What a name with `*` and `?` stands for; an array's name for its elements, too."""
    plain = "".join(pattern.split()).lower()
    spelled = re.escape(plain.removesuffix("[]")).replace(r"\*", ".*").replace(r"\?", ".")
    return re.compile(spelled if plain.endswith("]") and not plain.endswith("[]") else spelled + r"(\[.*\])?")


def directory(state: TerminalState, rest: str) -> None:
    """DIRECTORY: programs in memory."""
    rows = []
    for name, program in _programs(state, rest).items():
        comment = f";{program.comment}" if program.comment else ""
        parameters = ", ".join(variable.name for variable in program.parameters)
        rows.append((f".PROGRAM {name}({parameters})", _counted(len(program.steps), "step"), comment))
    state.say_all(layout.table(rows), "No programs")


def free(state: TerminalState, _rest: str) -> None:
    """FREE: what is in memory."""
    memory = state.controller.memory
    steps = sum(len(program.steps) for program in memory.programs.values())
    values = {kind: len(_entries(memory, kind)) for kind in KINDS}
    state.say(
        *layout.table([
            ("Programs", f"{len(memory.programs)}, of {steps} steps"),
            *((kind.capitalize(), f"{many}") for kind, many in values.items()),
            ("Free", f"{MOST_VALUES - sum(values.values())} of {MOST_VALUES} values"),
        ])
    )  # fmt: skip


MOST_MEANWHILE: Final = 200
"""Values that may be loaded while a program runs: they're set at once."""
_VALUE_WORK: Final = 4
"""How much work setting a value is: as much as reading so many characters."""


def flist(state: TerminalState, rest: str) -> None:
    """FLIST, LISTF: the files."""
    nothing(rest, "FLIST")
    state.say_all(layout.in_columns(state.files.listed(), state.width), "No files")


def load(state: TerminalState, rest: str) -> None:
    """LOAD file: programs and values; all of it or nothing."""
    path = state.files.found(rest)
    state.work = _loading(state, path.name, state.files.read(path))


def _loading(state: TerminalState, name: str, text: str) -> Generator[int, None, None]:
    """Read a file and take what it holds, in slices."""
    source = yield from read_file(text, name, dialect=state.controller.dialect)
    entries = source.values
    if len(entries) > MOST_MEANWHILE and state.controller.busy:
        raise ValError("Program running", f"LOAD of more than {MOST_MEANWHILE} values must wait, or ABORT it")
    state.refuse_in_use(*(program.name for program in source.programs))
    memory = state.controller.memory
    yield from _set_all(memory, entries)
    memory.programs.update({program.name: program for program in source.programs})
    if source.signals:
        state.controller.cell = source.signals
    counts = [(len(source.programs), "program"), (len(entries), "value"), (len(source.signals), "signal rule")]
    said = [_counted(*count) for count in counts if count[0]]
    state.say(f"{name}: {', '.join(said) or 'nothing'}", *map(str, source.undefined))


def _set_all(memory: Memory, entries: Sequence[NamedValue]) -> Generator[int, None, None]:
    """Set variables; where one can't be, none is. Few are set at once, and no program runs while many are."""
    done: list[tuple[Variable, Value | None]] = []
    try:
        for entry in entries:
            before = memory.found(entry.variable)
            memory.set(entry.variable, entry.value)
            done.append((entry.variable, before))
            if len(entries) > MOST_MEANWHILE:
                yield _VALUE_WORK
    except (ValError, GeneratorExit):
        for variable, before in reversed(done):
            memory.delete(variable)
            if before is not None:
                memory.set(variable, before)
        raise


def store(state: TerminalState, rest: str, *, parts: str) -> Dialogue:
    """STORE, STOREP, STOREL, STORER, STORES.

    Args:
        state: Whose memory and files.
        rest: The file, and names behind `=`.
        parts: What is written; empty for all, with what is used.
    """
    name, names = halves(rest)
    path = state.files.path(name)
    source = _source(state, path.name, parts, names or "")

    def write() -> None:
        state.files.write(path, print_file(source))
        counts = [(len(source.programs), "program"), (len(source.values), "value")]
        state.say(f"{path.name}: {', '.join(_counted(*count) for count in counts)}")

    yield from state.confirm(f"{state.files.shown(path)} exists. Write over it" if path.exists() else "", write)


def _counted(many: int, what: str) -> str:
    return f"{many} {what}{'s' * (many != 1)}"


def _source(state: TerminalState, name: str, parts: str, names: str) -> SourceFile:
    """What a file is to hold."""
    memory, programs, used = state.controller.memory, {}, set()
    if parts in {"", "programs"}:
        programs = dict(memory.programs)
        if names:
            programs = with_called(programs, chosen(programs, names, _WORDS["programs"]))
            statements = (step.statement for program in programs.values() for step in program.steps)
            used = {
                part.name
                for statement in statements
                for expression in statement.expressions
                for part in parts_of(expression)
                if isinstance(part, Variable)
            }
    entries: dict[str, NamedValue] = {}
    for kind in KINDS if not parts else KINDS.keys() & {parts}:
        known = _entries(memory, kind)
        entries |= chosen(known, names, kind.removesuffix("s")) if parts else known
    values = [entry for entry in entries.values() if parts or not names or entry.variable.name in used]
    signals, dialect = () if parts else state.controller.cell, state.controller.dialect
    return SourceFile(name, tuple(programs.values()), tuple(values), signals, dialect)


def _entries(memory: Memory, kind: str) -> dict[str, NamedValue]:
    """Variables of a kind, by how they're written."""
    entries = (NamedValue(*one) for one in memory.variables())
    return {print_expression(e.variable): e for e in entries if isinstance(e.value, KINDS[kind])}


def delete(state: TerminalState, rest: str, *, kind: str) -> Dialogue:
    """DELETE, DELETEP, DELETEL, DELETER, DELETES, by the kind: `programs`, `locations`, `reals` or `strings`."""
    if not rest:
        raise ValError("Missing argument", f"which {kind}?")
    memory = state.controller.memory
    known: Mapping[str, Any] = dict(memory.programs) if kind == "programs" else _entries(memory, kind)
    doomed = chosen(known, rest, _WORDS[kind])
    if kind == "programs":
        state.refuse_in_use(*doomed)

    def act() -> None:
        for name, one in doomed.items():
            if kind == "programs":
                memory.programs.pop(name, None)
            else:
                memory.delete(one.variable)

    listed = list(doomed)
    some = ", ".join(listed) if len(listed) <= 4 else f"{listed[0]} .. {listed[-1]}, {len(listed)} in all"
    yield from state.confirm(f"Delete {some}", act)


def put(state: TerminalState, rest: str, *, keep: bool) -> Dialogue:
    """COPY new=old, RENAME new=old."""
    given, old = halves(rest)
    if old is None:
        raise ValError("Missing argument", f"{'COPY' if keep else 'RENAME'} new=old")
    new, old = named(given, "program"), named(old, "program")
    programs = state.controller.memory.programs
    if old not in programs:
        raise ValError("Undefined program name", old)
    state.refuse_in_use(new, *(() if keep else (old,)))

    def act() -> None:
        program = programs[old] if keep else programs.pop(old)
        programs[new] = replace(program, name=new)

    yield from state.confirm(f"{new} exists. Replace it" if new in programs and new != old else "", act)


def file_delete(state: TerminalState, rest: str) -> Dialogue:
    """FDELETE file."""
    path = _existing(state, rest)
    yield from state.confirm(f"Delete {state.files.shown(path)}", lambda: state.files.delete(path))


def file_rename(state: TerminalState, rest: str) -> Dialogue:
    """FRENAME new=old."""
    given, name = halves(rest)
    if name is None:
        raise ValError("Missing argument", "FRENAME new=old")
    new, old = state.files.path(given), _existing(state, name)
    question = f"{state.files.shown(new)} exists. Replace it" if new.exists() and new != old else ""
    yield from state.confirm(question, lambda: state.files.rename(old, new))


def _existing(state: TerminalState, name: str) -> Path:
    path = state.files.path(name)
    if not path.is_file():
        raise ValError("Nonexistent file", state.files.shown(path))
    return path


def zero(state: TerminalState, _rest: str) -> Dialogue:
    """ZERO: forget everything."""

    def act() -> None:
        state.controller.forget()
        state.controller.cell = ()
        state.say("Memory is empty", style=Style.NOTE)

    yield from state.confirm("Delete all programs and values. Are you sure", act)
