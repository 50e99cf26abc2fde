"""What is in memory and in files: DELETE, ZERO, LISTs, COPY, RENAME, STOREs and LOADs."""

from __future__ import annotations

import re

import pytest

from interfaces.val2 import parser
from interfaces.val2.memory import Memory
from interfaces.val2.monitor.state import SLICE
from interfaces.val2.printer import print_expression
from interfaces.val2.syntax import Variable
from interfaces.val2.values import Transformation

from .sitting import HELLO, LOOP


def located(memory: Memory) -> list[str]:
    """Names of locations."""
    return [variable.name for variable, value in memory.variables() if isinstance(value, Transformation)]


def test_delete_and_zero_ask_and_only_y_does_it(sitting):
    sitting.type(*HELLO, "DO x = 1", "DO SET p = NULL", 'DO $s = "a"', "DO a[1] = 1", "DO a[2] = 2")
    for line in ("DELETE hello", "DELETER x", "DELETEL p", "DELETES $s", "ZERO"):
        for answer in ("", "N", "no", "x"):
            sitting.line(line)
            assert sitting.monitor.prompt.endswith("(Y/N)? "), line
            sitting.type(answer)
    assert "hello" in sitting.controller.memory.programs
    assert sitting.controller.memory.get(Variable("x")) == 1.0
    sitting.type("DELETE hello", "y", "DELETEL p", "YES", "DELETES $s", "y", "DELETER a[1]", "y")
    assert sitting.type("LISTR") == "a[2] = 2\nx    = 1\n"
    assert sitting.type("LISTL", "LISTS", "LISTP") == "No locations\nNo strings\nNo programs\n"
    sitting.type("ZERO", "y")
    assert sitting.type("LISTR") == "No reals\n"
    assert sitting.type("DELETE nothing").startswith("*Undefined program name*")


def test_lists_take_names_patterns_and_expressions(sitting):
    sitting.type("DO pa = 1", "DO pb = 2", "DO q = 0.1", "DO a[1,2] = 5", 'DO $x = "hi"')
    assert sitting.type("LISTR p*") == "pa = 1\npb = 2\n"
    assert sitting.type("LISTR pb*pb") == "4\n"
    assert sitting.type("LISTR pi*pb").startswith("6.28318")
    assert sitting.type("LISTR z*") == "*Undefined value* z*\n"
    assert sitting.type("LISTR a") == "a[1,2] = 5\n"
    assert sitting.type("LISTR a[1,2], q") == "a[1,2] = 5\nq      = 0.1\n"
    assert sitting.type("LISTR pa + pb") == "3\n"
    assert sitting.type('LISTS $x + "!"') == '"hi!"\n'
    assert sitting.type("LISTR z").startswith("*Undefined value* z")


def test_copy_and_rename(sitting):
    sitting.type(*HELLO, "COPY two=hello", "RENAME three=two")
    assert sorted(sitting.controller.memory.programs) == ["hello", "three"]
    assert sitting.controller.memory.programs["three"].name == "three"
    sitting.line("COPY hello=three")
    assert "(Y/N)?" in sitting.monitor.prompt
    sitting.type("N")
    for line in ("COPY a", "COPY a=b", "RENAME 1=hello", "COPY =hello"):
        assert sitting.type(line).startswith("*"), line


def test_store_keeps_a_program_with_all_that_it_uses_and_asks_before_it_writes_over(sitting, tmp_path):
    sitting.type("EDIT main", "CALL sub", "MOVE p", "E", "EDIT sub", "x = y", "E", *HELLO)
    sitting.type("DO SET p = TRANS(1,2,3)", "DO SET q = NULL", "DO y = 2", "DO z = 3")
    sitting.type("STORE part=main")
    text = (tmp_path / "part.v2").read_text()
    assert ".PROGRAM main" in text
    assert ".PROGRAM sub" in text
    assert ".PROGRAM hello" not in text
    sitting.line("STOREP part")
    assert "write over" in sitting.monitor.prompt.lower()
    sitting.type("n")
    assert (tmp_path / "part.v2").read_text() == text
    sitting.type("ZERO", "y", "LOAD part")
    assert sorted(sitting.controller.memory.programs) == ["main", "sub"]
    assert sitting.type("LISTR") == "y = 2\n"
    assert located(sitting.controller.memory) == ["p"]
    assert sitting.type("FLIST") == "part\n"
    assert list(tmp_path.iterdir()) == [tmp_path / "part.v2"]


def test_parts_are_stored_alone(sitting, tmp_path):
    sitting.type(*HELLO, "DO SET p = NULL", "DO SET #j = #PPOINT(1)", "DO x = 1", 'DO $s = "a"')
    sitting.type("STOREP a", "STOREL b", "STORER c", "STORES d", "STOREL e=#*")
    found = {path.stem: path.read_text() for path in tmp_path.iterdir()}
    assert ".PROGRAM hello" in found["a"]
    assert ".LOCATIONS" not in found["a"]
    assert "#j" in found["b"]
    assert "p " in found["b"]
    assert ".REALS" in found["c"]
    assert ".LOCATIONS" not in found["c"]
    assert "$s" in found["d"]
    assert "#j" in found["e"]
    assert "\np " not in found["e"]


@pytest.mark.parametrize("name", ["../x", "/etc/passwd", "a/b", ".hidden", "x.txt", "..", "", "a" * 200, "con\\x"])
def test_files_lead_nowhere_else(sitting, name, tmp_path):
    sitting.type(*HELLO)
    for line in (f"LOAD {name}", f"STORE {name}"):
        assert re.match(r"\*(Invalid file name|Missing argument)\*", sitting.type(line)), line
    assert not list(tmp_path.iterdir())


def test_a_link_leads_nowhere_either_and_a_broken_file_changes_nothing(sitting, tmp_path):
    (tmp_path / "link.v2").symlink_to("/etc/passwd")
    assert sitting.type("LOAD link").startswith("*Invalid file name*")
    (tmp_path / "bad.v2").write_text(".PROGRAM a\n x = 1\n.END\n.PROGRAM b\n MOVE (\n.END\n")
    assert re.match(r"\*Syntax error\*.*line 5", sitting.type("LOAD bad"))
    assert not sitting.controller.memory.programs
    assert sitting.type("LOAD none").startswith("*Nonexistent file*")
    (tmp_path / "half.v2").write_text(".LOCATIONS\n a 1 2 3 90 -90 0\n.END\n.REALS\n x 5\n p 7\n.END\n")
    sitting.type("DO x = 1", "DO SET p = NULL")
    assert sitting.type("LOAD half").startswith("*Variable type mismatch*")
    assert sitting.type("LISTR") == "x = 1\n"
    assert located(sitting.controller.memory) == ["p"]


def big(count):
    lines = [f"  MOVE TRANS({i},{i % 300},50,90,90,0) ;step" for i in range(count)]
    values = [f"p[{i}] {i} 300 50 90 90 0" for i in range(count)]
    return "\n".join([".PROGRAM big()", *lines, ".END", ".LOCATIONS", *values, ".END", ".REALS", "n 7", ".END"])


def test_a_large_file_is_loaded_in_slices(sitting, tmp_path, monkeypatch):
    (tmp_path / "big.v2").write_text(big(1000))
    read = []
    step = parser.read_line
    monkeypatch.setattr(parser, "read_line", lambda text, line: (read.append(text), step(text, line))[1])
    sitting.line("LOAD big")
    sitting.line("LISTR n")
    slices = 0
    while "big" not in sitting.controller.memory.programs:
        assert sitting.monitor.next_deadline() <= sitting.now
        read.clear()
        sitting.monitor.advance(now=sitting.now)
        assert sum(map(len, read)) < SLICE + parser.LONGEST_LINE
        assert len(read) <= 4
        slices += 1
        assert slices < 5000
    assert slices > 400
    sitting.pass_time(0.1)
    assert sitting.shown == "big.v2: 1 program, 1001 values\nn = 7\n"


@pytest.mark.parametrize("how", ["interrupt", "leave"])
def test_a_load_that_is_left_has_loaded_nothing(sitting, tmp_path, how):
    sitting.type("DO SET p[0] = TRANS(1, 2, 3)")
    (tmp_path / "big.v2").write_text(big(300))
    sitting.line("LOAD big")
    for _ in range(100_000):
        if len(located(sitting.controller.memory)) > 50:
            break
        sitting.monitor.advance(now=sitting.now)
    getattr(sitting.monitor, how)(now=sitting.now)
    memory = sitting.controller.memory
    assert memory.programs == {}
    ((variable, value),) = memory.variables()
    assert (print_expression(variable), value.X[0, 3]) == ("p[0]", 1.0)


def test_many_values_arent_loaded_while_a_program_runs(sitting, tmp_path):
    (tmp_path / "big.v2").write_text(big(300))
    (tmp_path / "few.v2").write_text(big(3))
    sitting.type(*LOOP, "EXECUTE loop")
    assert sitting.type("LOAD few") == "few.v2: 1 program, 4 values\n"
    assert sitting.type("LOAD big") == "*Program running* LOAD of more than 200 values must wait, or ABORT it\n"


def test_a_file_that_is_too_long_is_refused(sitting, tmp_path):
    (tmp_path / "big.v2").write_text(";" * 4_000_001)
    assert sitting.type("LOAD big") == "*File error* big.v2: longer than 4000000 bytes\n"


def test_a_file_with_unknown_instructions_is_loaded_and_all_of_them_are_named(sitting, tmp_path):
    text = ".PROGRAM odd\n TYPE 1\n IF FALSE THEN\n FROBNICATE 3, x ;why\n END\n MVOE p\n.END\n"
    (tmp_path / "odd.v2").write_text(text)
    said = sitting.type("LOAD odd").splitlines()
    assert said[0] == "odd.v2: 1 program"
    assert said[1:] == [
        "*Undefined instruction* FROBNICATE, program odd, step 3, column 2",
        "*Undefined instruction* MVOE; did you mean MOVE?, program odd, step 5, column 2",
    ]
    assert "    FROBNICATE 3, x ;why\n" in sitting.type("LISTP odd")
    said = sitting.type("EXECUTE odd")
    assert "*Undefined instruction* MVOE; did you mean MOVE?, program odd, step 5" in said
    assert "FROBNICATE" not in said


def test_files_are_deleted_and_renamed_and_asked_for_first(sitting, tmp_path):
    sitting.type(*HELLO, "STORE a", "STORE b")
    sitting.line("FDELETE a")
    assert sitting.monitor.prompt == "Delete a.v2 (Y/N)? "
    sitting.type("N", "FRENAME c=a")
    assert sorted(path.name for path in tmp_path.glob("*.v2")) == ["b.v2", "c.v2"]
    sitting.line("FRENAME b=c")
    assert sitting.monitor.prompt == "b.v2 exists. Replace it (Y/N)? "
    sitting.type("", "FDELETE c", "Y", "FRENAME d=b")
    assert [path.name for path in tmp_path.glob("*.v2")] == ["d.v2"]
    assert sitting.monitor.suggestions("FRENAME e=")[1][0].word == "d"
    assert sitting.monitor.suggestions("FDELETE ")[1][0].word == "d"
    for line, wrong in (
        ("FDELETE", "*Missing argument* a file's name"), ("FDELETE e", "*Nonexistent file* e.v2"),
        ("FDELETE ../d", "*Invalid file name* ../d"), ("FRENAME e", "*Missing argument* FRENAME new=old"),
        ("FRENAME e=f", "*Nonexistent file* f.v2"), ("FRENAME ../e=d", "*Invalid file name* ../e"),
    ):  # fmt: skip
        assert sitting.type(line).startswith(wrong), line
    assert "Rename a file" in sitting.type("HELP FRENAME")
