"""Every row of VAL-II's table at work: its help, its completion, a program that uses it, and wrong uses of it.

What is right and wrong is told by the rows' forms, so that a row that's added is walked, too.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from interfaces.val2 import forms
from interfaces.val2.check import check_text
from interfaces.val2.monitor.commands import COMMANDS, MonitorCommand, command, explained, suggestions
from interfaces.val2.monitor.state import split_word
from interfaces.val2.parser import lines_of
from interfaces.val2.playing import rehearse
from interfaces.val2.rows import Form, OperandSlot, Setting
from interfaces.val2.source import parse_file
from interfaces.val2.syntax import Apply, Format, Instruction, parts
from robots import puma560
from tests.interfaces.val2.sitting import Sitting

HERE = Path(__file__).parent
PROGRAMS = sorted([*(HERE / "programs").glob("*.v2"), *(HERE.parents[2] / "examples" / "val2").glob("*.v2")])
CONSOLE = (HERE / "programs" / "console.txt").read_text().splitlines()
"""A session at the prompt."""
TABLES = {
    "instruction": forms.INSTRUCTIONS, "function": forms.FUNCTIONS, "switch": forms.SWITCHES,
    "parameter": forms.PARAMETERS, "command": COMMANDS,
}  # fmt: skip
ROWS = [(kind, row) for kind, table in TABLES.items() for row in table.values()]


def each(*kinds: str) -> pytest.MarkDecorator:
    """Rows of some kinds."""
    rows = [(kind, row) for kind, row in ROWS if kind in kinds]
    return pytest.mark.parametrize(("kind", "row"), rows, ids=[f"{kind}-{row.name}" for kind, row in rows])


# Help.


@each(*TABLES)
def test_its_help_is_one_line_in_words(sitting: Sitting, kind: str, row: Form | Setting | MonitorCommand) -> None:
    (found,) = (one for one in explained(row.name) if one.kind == kind and one.word == row.name)
    assert re.fullmatch(r"[^\n]*[a-z]{2}[^\n]*(\.|,,10)", row.help)
    assert len(row.help) <= 100
    said = " ".join(sitting.type(f"HELP {row.name}").split())
    assert f"{found.usage} ({kind}" in said
    assert found.help in said


# Completion.

BEFORE = {
    "instruction": [("", True), ("10 ", True), ("DO ", False)],
    "function": [("x = ", True), ("DO x = ", False), ("MOVE ", True)],
    "switch": [("ENABLE ", True), ("DISABLE CP, ", True), ("ENABLE ", False), ("DO DISABLE ", False),
               ("SWITCH ", False), ("IF SWITCH(", True), ("DO x = SWITCH(", False)],
    "parameter": [("PARAMETER ", True), ("PARAMETER ", False), ("DO PARAMETER ", False),
                  ("x = PARAMETER(", True)],
    "command": [("", False)],
}  # fmt: skip
"""What stands before a word, and whether in a program's line."""


@each(*TABLES)
def test_it_is_proposed_where_it_is_allowed(sitting: Sitting, kind: str, row: Form | Setting) -> None:
    for before, program in BEFORE[kind]:
        _, words = suggestions(f"{before}{row.name[:-1]}", sitting.monitor.state, program=program)
        alone = kind == "instruction" and not program
        allowed = not (alone and isinstance(row, Form) and "program" in row.tags)
        assert (row.name in [one.word for one in words]) == allowed, before


# Programs.


@cache
def words_used() -> frozenset[tuple[str, str]]:
    """What the programs use: kinds and names."""
    return frozenset(use for path in PROGRAMS for use in _uses(path))


def _uses(path: Path) -> Iterator[tuple[str, str]]:
    text = path.read_bytes().decode()
    lines = lines_of(text)
    for program in parse_file(text, path.name).programs:
        for step in program.steps:
            i, line = step.statement, lines[step.at.line - 1][step.at.column - 1 :]
            if i.passed is None:
                yield "instruction", _keyword(line)
                yield from _uses_within(i)


def _keyword(line: str) -> str:
    """The word that a line begins with; none of an assignment."""
    return "" if re.match(r"[#$\w.]+\s*(\[|=(?!=))", line) else split_word(line)[0].upper()


def _uses_within(i: Instruction) -> Iterator[tuple[str, str]]:
    kind = {"ENABLE": "switch", "DISABLE": "switch", "PARAMETER": "parameter"}.get(i.keyword)
    yield from ((kind, word) for word in i.words if kind)
    for operand in (*i.operands, i.begins):
        inner = () if operand is None or isinstance(operand, Format) else parts(operand)
        yield from (("function", one.function) for one in inner if isinstance(one, Apply))


@each("instruction", "function", "switch", "parameter")
def test_a_program_uses_it(kind: str, row: Form | Setting) -> None:
    assert (kind, row.name) in words_used()


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_the_programs_compile(path: Path) -> None:
    assert [one for one in check_text(path.read_bytes().decode(), path.name)[1] if one.severity == "error"] == []


@pytest.mark.parametrize("stem", ["motions", "functions", "files", "tasks", "angles", "process"])
def test_programs_that_are_there_for_their_words_run(stem: str) -> None:
    text = (HERE / "programs" / f"{stem}.v2").read_text()
    assert rehearse(parse_file(text, stem), puma560.model()).findings == ()


def test_a_session_uses_every_command_and_none_fails(sitting: Sitting) -> None:
    used = set()
    for line in CONSOLE:
        if sitting.monitor.prompt in {".", "*"}:
            used.add(one := command(line).name)
            if COMMANDS[one].act is None:
                sitting.terminal().line(line, now=sitting.now)
                continue
        said = sitting.type(line)
        assert said.startswith("*") == (line == "PANIC"), (line, said)
        sitting.pass_time(1.0)
    assert used == COMMANDS.keys()


# Wrong uses.

SAYS = re.compile(
    r"allowed: .|(is|are) wanted|takes an? |nothing follows|is a whole number|letters, digits| \d\S* to \d"
)
"""How an error says what's allowed; or by the form of the word."""
RIGHT = {
    "string": '"a"', "location": "NULL", "frame": "NULL", "point": "#HERE", "label": "10", "program": "other",
    "variable": "x", "array": "a[]", "name": "x", "condition": "TRUE", "signal": "1001", "text": "words",
}  # fmt: skip
"""An operand of each kind; 1 of all others."""
ANYTHING = {"any", "alike", "text"}
"""Kinds that no operand is wrong for."""
NAMES = {"program": "other", "motion": "READY", "switch": "CP", "name": "HAND.TIME"}
"""What stands in forms beside operands."""
LENIENT = {"remark", "end", "switches", "parameter"}
"""Rules that pass over what they don't know, or take it for a comment."""
UNFAILING = {"EXIT", "QUIT", "PANIC"}
"""Commands that end a session or stop the arm, whatever follows them."""
NAMED = {"SWITCH": "CP", "PARAMETER": "HAND.TIME"}
"""What functions of names take, other than variables."""
TARGETS = {"real": "n", "truth": "n", "string": "$n", "frame": "SET n", "location": "SET #n"}
"""What takes what functions give."""
LINE = 5
PROGRAM = '.PROGRAM main\nx = 1\na[1] = 1\n$x = "a"\n10 {}\n.END\n.PROGRAM other(argument)\n.END\n'


def errors(line: str, *, alone: bool = False) -> list[str]:
    """What is wrong with a line, but for a structure that isn't there, unless it's to be there."""
    found = check_text(PROGRAM.format(line), "t.v2")[1]
    return [str(one.error) for one in found if one.severity == "error" and one.place and one.place.line == LINE
            and (alone or one.error.what != "Control structure error")]  # fmt: skip


def spelled(row: Form, wrong: OperandSlot | None = None) -> str:
    """A row's form with operands, one of them wrong."""
    text = re.sub(r",? ?\[[A-Z|]+\]", "", row.usage.replace(", ..", "")).partition(" ..")[0]
    text = re.sub(r"(?<=\w)\[\w+\]", "[1]", text)
    text = re.sub(r"\[(?!1\])|(?<!\[1)\]", "", text)
    right = NAMES | {slot.name: RIGHT.get(slot.kind, "1") for slot in row.slots}
    right |= {slot.name: "$x" for slot in row.slots if slot.name.startswith("$")}
    right |= {slot.name: NAMED[row.name] for slot in row.slots if slot.kind == "name" and row.name in NAMED}
    if wrong is not None:
        right[wrong.name] = "1" if wrong.kind == "string" else '"b"'
    return re.sub(r"(?<![\w$#\"])\$?[a-z]\w*", lambda found: right[found[0]], text)


def wrong_uses(kind: str, row: Form) -> Iterator[str]:
    """Lines that use a row wrongly: operands too many, missing, of another kind; a function in a wrong place."""
    many, right = ", ".join(["x"] * (len(row.slots) + 2)), spelled(row)
    others = [spelled(row, slot) for slot in row.slots if slot.kind not in ANYTHING]
    if kind == "function":
        yield f"n = {'LEN' if row.gives in {'real', 'truth'} else 'ABS'}({right})"
        target = TARGETS[row.gives]
        if not row.repeats:
            yield f"{target} = {row.name}({many})"
        yield from (f"{target} = {other}" for other in others if other != right)
        return
    if row.rule not in LENIENT:
        yield f"{row.name} )"
        if not row.repeats:
            yield f"{row.name} {many}"
    if row.rule == "switches" or any(slot.required for slot in row.slots):
        yield row.name
    yield from (other for other in others if other != right)


@each("instruction")
def test_an_instruction_in_its_form_is_right(kind: str, row: Form) -> None:
    assert errors(spelled(row)) == []


@each("function")
def test_a_function_in_its_form_is_right(kind: str, row: Form) -> None:
    assert errors(f"{TARGETS[row.gives]} = {spelled(row)}") == []


@each("instruction", "function")
def test_a_wrong_use_is_one_line_that_says_what_is_allowed(kind: str, row: Form) -> None:
    lines = list(wrong_uses(kind, row))
    assert lines or row.rule in {"remark", "end"}
    for line in lines:
        (said,) = errors(line)
        assert "\n" not in said
        assert SAYS.search(said) or row.usage in said, (line, said)


def test_the_end_of_a_structure_alone_is_wrong() -> None:
    for row in forms.INSTRUCTIONS.values():
        if row.tags & {"opens", "closes"}:
            (said,) = errors(spelled(row), alone=True)
            assert said.startswith("*Control structure error* ")


@each("switch")
def test_a_wrong_name_of_a_switch_says_which_there_are(sitting: Sitting, kind: str, row: Setting) -> None:
    (said,) = errors(f"ENABLE {row.name}X")
    for one in (said, sitting.type(f"ENABLE {row.name}X"), sitting.type(f"SWITCH {row.name}X")):
        assert re.match(rf"\*[A-Z][a-z ]+\* {re.escape(row.name)}X.*; allowed: .*{re.escape(row.name)}", one)


@each("parameter")
def test_a_wrong_name_or_value_of_a_parameter_says_what_is_allowed(
    sitting: Sitting, kind: str, row: Setting
) -> None:
    for line in (f"PARAMETER {row.name}X = 1", f"PARAMETER {row.name} = {row.high + 1}"):
        (said,) = errors(line)
        for one in (said, sitting.type(line)):
            assert one.startswith("*")
            assert re.search(rf"; allowed: .*{re.escape(row.name)}| {row.low:g} to {row.high:g} {row.unit}", one)


@pytest.mark.parametrize(
    "row", [row for row in COMMANDS.values() if row.name not in UNFAILING], ids=lambda row: row.name
)
def test_a_wrong_use_of_a_command_is_one_line_that_says_what_is_allowed(
    sitting: Sitting, row: MonitorCommand
) -> None:
    said = sitting.type(f"{row.name} )")
    assert re.fullmatch(r"\*[A-Z][a-z -]+\* .+\n", said)
    assert SAYS.search(said) or any(usage in said for usage in row.usage), said
