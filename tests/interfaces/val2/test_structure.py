"""Which steps belong together, and where each jumps."""

from __future__ import annotations

import pytest

from interfaces.val2.errors import ValError
from interfaces.val2.source import parse_program
from interfaces.val2.structure import StructureBlock, structure, survey


def of(*lines):
    return structure(parse_program("\n".join([".PROGRAM p", *lines, ".END"])))


def errors(*lines):
    return [(e.what, e.step, e.detail) for e in survey(parse_program("\n".join([".PROGRAM p", *lines])))[1]]


def test_if_jumps_behind_else_or_end():
    found = of("IF a", "MOVE a", "ELSE", "MOVE b", "END", "IF b", "END")
    assert dict(found.jumps) == {0: 3, 2: 5, 5: 7}
    assert found.blocks[0] == found.blocks[2] == found.blocks[4] == StructureBlock("IF", 0, 4, (2,))


def test_loops_go_back_and_leave():
    found = of(
        "WHILE a DO", "FOR i = 1 TO 3", "IF b", "EXIT 2", "END", "NEXT", "END", "NEXT", "END",
        "DO", "NEXT", "EXIT", "UNTIL a",
    )  # fmt: skip
    assert dict(found.jumps) == {0: 9, 1: 7, 2: 5, 3: 9, 5: 6, 6: 1, 7: 8, 8: 0, 10: 12, 11: 13, 12: 10}


def test_case_goes_from_value_to_value():
    found = of("CASE a OF", ";note", "VALUE 1:", "MOVE a", "VALUE 2, 3:", "ANY", "MOVE b", "END")
    assert dict(found.jumps) == {0: 2, 2: 4, 4: 5}
    assert found.blocks[5] == StructureBlock("CASE", 0, 7, (2, 4, 5))
    assert dict(of("CASE a OF", "VALUE 1:", "END").jumps) == {0: 1, 1: 3}
    assert dict(of("CASE a OF", "END").jumps) == {0: 2}


def test_labels():
    found = of("10 MOVE a", "GOTO 20", "IF a GOTO 10", "GRASP 5, 20", "20")
    assert dict(found.labels) == {10: 0, 20: 4}
    assert dict(found.jumps) == {1: 4, 2: 0, 3: 4}


@pytest.mark.parametrize(
    ("lines", "step", "said"),
    [
        (["IF a"], 1, "IF without END"),
        (["DO", "END", "UNTIL a"], 2, "END without IF, WHILE, FOR or CASE; DO of step 1 is still open"),
        (["END"], 1, "END without IF"),
        (["UNTIL a"], 1, "UNTIL without DO"),
        (["WHILE a", "UNTIL b", "END"], 2, "UNTIL without DO; WHILE of step 1 is still open"),
        (["ELSE"], 1, "ELSE is allowed between IF and END"),
        (["IF a", "ELSE", "ELSE", "END"], 3, "a second ELSE"),
        (["VALUE 1:"], 1, "VALUE is allowed between CASE and END"),
        (["CASE a", "ANY", "VALUE 1:", "END"], 3, "VALUE behind ANY"),
        (["CASE a", "MOVE b", "VALUE 1:", "END"], 2, "VALUE is allowed behind CASE"),
        (["CASE a", "IF b", "END", "END"], 2, "VALUE is allowed behind CASE"),
        (["EXIT"], 1, "EXIT is allowed within a loop; here are 0"),
        (["DO", "NEXT 2", "UNTIL a"], 2, "NEXT 2 is allowed within 2 loops; here are 1"),
    ],
)
def test_control_structure_errors(lines, step, said):
    (found,) = errors(*lines)
    assert found[:2] == ("Control structure error", step)
    assert found[2].startswith(said)
    with pytest.raises(ValError, match="Control structure error"):
        of(*lines)


def test_labels_that_are_missing_or_stand_twice():
    assert errors("GOTO 5", "7 MOVE a", "7 MOVE b") == [
        ("Undefined label", 1, "5; the program's labels: 7"),
        ("Duplicate label", 3, "label 7 stands at step 2 already"),
    ]
    assert errors("GRASP 3, 9") == [("Undefined label", 1, "9; the program's labels: none")]


def test_every_error_is_found():
    assert [step for _, step, _ in errors("GOTO 1", "EXIT", "IF a", "DO")] == [1, 2, 3, 4]
    assert len(errors(*["DO"] * 101, *["UNTIL a"] * 101)) == 1
