"""EDIT: every command of the line editor, and what it leaves behind."""

from __future__ import annotations

import pytest

from interfaces.val2.errors import ValError
from interfaces.val2.monitor.editor import HELP, Editor
from interfaces.val2.parser import parse_line
from interfaces.val2.printer import print_step
from interfaces.val2.source import parse_program
from interfaces.val2.syntax import Program, Variable

from .sitting import Sitting

THREE = parse_program(".PROGRAM p\n x = 1\n y = 2\n z = 3\n.END")


def editor(program: Program = THREE, step: int = 1) -> Editor:
    return Editor(program, step, lambda name: Variable(name or "next1"))


def lines(edited: Editor) -> list[str]:
    return [print_step(step).strip() for step in edited.program.steps]


def test_it_begins_at_a_step_and_shows_it():
    begun = editor(step=2)
    assert begun.begin() == [".PROGRAM p()", "    2  y = 2"]
    assert begun.prompt == "2.? "
    assert editor(step=99).prompt == "4.? "
    assert editor(Program("new")).begin() == [".PROGRAM new()"]


def test_an_instruction_takes_the_place_of_its_step_or_comes_last():
    edited = editor()
    assert edited.line("w = 9") == ["    2  y = 2"]
    assert lines(edited) == ["w = 9", "y = 2", "z = 3"]
    edited.line("s 4")
    edited.line("v = 4")
    assert lines(edited) == ["w = 9", "y = 2", "z = 3", "v = 4"]
    assert edited.prompt == "5.? "


def test_an_empty_line_goes_on_and_stays_behind_the_last():
    edited = editor()
    for prompt in ("2.? ", "3.? ", "4.? ", "4.? "):
        edited.line("")
        assert edited.prompt == prompt


def test_inserting_ends_with_an_empty_line():
    edited = editor(step=2)
    assert edited.line("I") == []
    assert edited.line("a = 1") == []
    assert edited.line("b = 2") == []
    assert edited.line("") == ["    4  y = 2"]
    assert lines(edited) == ["x = 1", "a = 1", "b = 2", "y = 2", "z = 3"]
    edited.line("c = 3")
    assert lines(edited) == ["x = 1", "a = 1", "b = 2", "c = 3", "z = 3"]


def test_deleting_and_undoing():
    edited = editor()
    assert edited.line("d") == ["    1  y = 2"]
    edited.line("u")
    assert lines(edited) == ["x = 1", "y = 2", "z = 3"]
    edited.line("D 2")
    assert lines(edited) == ["z = 3"]
    edited.line("D 99")
    assert lines(edited) == []
    with pytest.raises(ValError, match="No such step"):
        edited.line("D")
    for _ in range(2):
        edited.line("U")
    assert lines(edited) == ["x = 1", "y = 2", "z = 3"]
    with pytest.raises(ValError, match="Nothing to undo"):
        edited.line("U")


def test_going_printing_and_finding():
    edited = editor()
    edited.line("S 3")
    assert edited.prompt == "3.? "
    edited.line("L")
    assert edited.prompt == "2.? "
    edited.line("L 9")
    assert edited.prompt == "1.? "
    assert edited.line("P 2") == ["    1  x = 1", "    2  y = 2"]
    assert len(edited.line("P")) == 3
    edited.line("F Z =")
    assert edited.prompt == "3.? "
    edited.line("f x")
    assert edited.prompt == "1.? "
    with pytest.raises(ValError, match="Not found"):
        edited.line("F nothing")
    assert tuple(edited.line("?")) == HELP


def test_variables_of_one_letter_are_no_commands():
    edited = editor(Program("p"))
    typed = ("d = 1", "i = i + 1", "s = 2", "t = 3", "f = 4", "l = 5", "DO", "e[1] = 2")
    for text in typed:
        edited.line(text)
    assert lines(edited) == [print_step(parse_line(text)).strip() for text in typed]


def test_teaching_inserts_a_motion():
    edited = editor(step=2)
    edited.line("T p1")
    edited.line("T")
    assert lines(edited) == ["x = 1", "MOVE p1", "MOVE next1", "y = 2", "z = 3"]


def test_a_slip_changes_nothing():
    edited = editor()
    with pytest.raises(ValError, match=r"Undefined instruction.*MOVEX"):
        edited.line("MOVEX p")
    assert edited.program == THREE
    assert edited.prompt == "1.? "


def test_quitting_keeps_the_program_as_it_was_and_ending_says_what_is_wrong():
    edited = editor()
    edited.line("d 3")
    assert edited.line("q") == []
    assert edited.done
    assert edited.program == THREE
    other = editor(Program("p"))
    other.line("IF x THEN")
    (said,) = other.line("E")
    assert said.startswith("*Control structure error*")
    assert other.done


def test_editing_at_the_monitor(tmp_path):
    sitting = Sitting(tmp_path)
    shown = sitting.type("EDIT fresh(a, $b)")
    assert shown == ".PROGRAM fresh(a, $b)\n"
    assert sitting.monitor.prompt == "1.? "
    assert "column 6" in sitting.type("MOVE )")
    sitting.type("TYPE a", "T here1", "E")
    assert sitting.type("LISTP fresh").splitlines()[1:] == [
        "    1        TYPE a",
        "    2        MOVE here1",
        ".END",
    ]
    assert [variable.name for variable, _ in sitting.controller.memory.variables()] == ["here1"]
    assert sitting.type("EDIT fresh,2").splitlines()[1] == "    2  MOVE here1"
    sitting.type("D", "Q", "EDIT")
    assert sitting.monitor.prompt == "1.? "
    assert len(sitting.controller.memory.programs["fresh"].steps) == 2
    sitting.type("D 2")
    sitting.monitor.interrupt(now=sitting.now)
    assert len(sitting.controller.memory.programs["fresh"].steps) == 2
    sitting.type("EDIT nothing", "E")
    assert "nothing" not in sitting.controller.memory.programs
    for line in ("EDIT 3", "EDIT a,b", "EDIT a,1,2", "EDIT a("):
        assert sitting.type(line).startswith("*"), line


def test_a_program_that_stands_can_be_mended_and_run_again(tmp_path):
    sitting = Sitting(tmp_path)
    sitting.type("EDIT p", "x = nowhere", "E", "EXECUTE p")
    sitting.type("EDIT p", "x = 2", "E")
    sitting.line("EXECUTE p")
    sitting.pass_time(0.1)
    assert sitting.type("LISTR x") == "x = 2\n"
