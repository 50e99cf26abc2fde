"""Static checks: what is found, where, and that sound programs are left alone; and `vrs check`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from interfaces.cli.main import main
from interfaces.val2.check import check_text

HERE = Path(__file__).parent
EXAMPLES = sorted((Path(__file__).parents[3] / "examples" / "val2").glob("*.v2"))


def found(*lines, sections=""):
    text = "\n".join([".PROGRAM main", *lines, ".END", sections])
    return [
        (f.severity, f.error.what, f.error.detail, f.place.line, f.place.column)
        for f in check_text(text, "t.v2")[1]
    ]


@pytest.mark.parametrize(
    ("line", "what", "column"),
    [
        ("CALL nothing", "Undefined program", 1),
        ("REACT 1001, nothing", "Undefined program", 1),
        ("GOTO 7", "Undefined label", 1),
        ("IF TRUE GOTO 7", "Undefined label", 1),
        ("END", "Control structure error", 1),
        ("MOVE p", "Undefined location", 6),
        ("MOVE #p", "Undefined location", 6),
        ("MOVE SHIFT(p BY 1)", "Undefined location", 12),
        ("MOVE NULL:p", "Undefined location", 11),
        ("x = y + 1", "Undefined value", 5),
        ("x = 1 + DX(p)", "Undefined location", 12),
        ("a[i] = 1", "Undefined value", 3),
        ("TYPE $s", "Undefined value", 6),
        ("SIGNAL -n", "Undefined value", 9),
        ("MOVE 3", "Mixed types", 6),
        ('MOVE "a"', "Mixed types", 6),
        ("x = NULL:NULL + 1", "Mixed types", 5),
        ('x = "a"', "Mixed types", 5),
        ("$x = 1", "Mixed types", 6),
        ('x = 1 + "a"', "Mixed types", 7),
        ('x = 2 * "a"', "Mixed types", 9),
        ('IF "a" == 1 GOTO 7', "Mixed types", 8),
        ("SET p = 1", "Mixed types", 9),
        ('x = SIN("a")', "Mixed types", 9),
        ("x = LEN(3)", "Mixed types", 9),
        ("SET p = NULL:#PPOINT(1)", "Mixed types", 14),
        ("SET p = INVERSE(#PPOINT(1))", "Mixed types", 17),
        ("DRIVE 7, 1, 1", "Value out of range", 7),
        ("DELAY -1", "Value out of range", 7),
        ("SPEED 0", "Value out of range", 7),
        ("SIGNAL 1, 1001", "Illegal digital signal", 11),
        ("PARAMETER HAND.TIME = -1", "Value out of range", 23),
        ("SET p = #PPOINT(1)", "Mixed types", 9),
        ("SET #q = TRANS(1)", "Mixed types", 10),
        ("SET #q = NULL:NULL", "Mixed types", 10),
        ("y = #HERE", "Mixed types", 5),
        ("y = #DEST", "Mixed types", 5),
        ("#y = TRANS(1)", "Mixed types", 6),
        ("SET $t = HERE", "Variable type mismatch", 5),
        ("x = DX(#HERE)", "Mixed types", 8),
        ("x = DISTANCE(HERE, #HERE)", "Mixed types", 20),
        ("SET e = SHIFT(#HERE BY 1)", "Mixed types", 15),
        ("HERE $s", "Invalid location", 1),
        ('PROMPT "x", #q', "Variable type mismatch", 13),
        ("DECOMPOSE $a[0] = HERE", "Variable type mismatch", 11),
        ("DECOMPOSE #a[0] = HERE", "Variable type mismatch", 11),
        ("IF SIG(1, 513) GOTO 7", "Illegal digital signal", 11),
        ("SIGNAL 513", "Illegal digital signal", 8),
        ("SIGNAL 1.5", "Illegal digital signal", 8),
        ("BITS 1001, 4 = 5", "Illegal digital signal", 6),
        ("BITS 1 = 5", "Illegal value", 1),
        ("BITS 1, 2 = 4", "Illegal value", 1),
        ("OPEN -5", "Value out of range", 6),
        ("CLOSEI -0.5", "Value out of range", 8),
        ("x = STATUS(main)", "Mixed types", 12),
        ("IGNORE 0", "Illegal digital signal", 8),
        ("REACT -1513", "Illegal digital signal", 7),
        ("TIMER 16 = 0", "Value out of range", 7),
        ("ALTER (1) 4", "Value out of range", 11),
        ("WAIT .5", "Illegal digital signal", 6),
        ("a[NULL] = 1", "Mixed types", 3),
        ("IF SWITCH(CQ) GOTO 7", "Unknown switch", 4),
        ("MOVE", "Missing argument", 5),
        ("x = (1", "Syntax error", 7),
    ],
)
def test_mistakes_are_found_where_they_are(line, what, column):
    assert ("error", what, 3, column) in [(f[0], f[1], f[3], f[4]) for f in found("", line)]


@pytest.mark.parametrize(
    "lines",
    [
        ["HERE p", "MOVE p:NULL", "HERE p:q", "MOVE q"],
        ["HERE #p", "MOVE #p", "DECOMPOSE a[1] = #p", "x = a[3]"],
        ["FOR i = 1 TO 3", "x[i] = i", "END", "TYPE x[2], LAST(x[])"],
        ['PROMPT "n", n, $s', "TYPE n, $s", '$t = $DECODE($s, ",", 0)'],
        ["CALL main", "IF DEFINED(p) GOTO 5", "5 MOVE HERE"],
        ["SET #p = #PPOINT(1,2,3,4,5,6)", "MOVE #p"],
        ["PARAMETER HAND.TIME = 0.5", "x = PARAMETER(HAND.TIME) + SWITCH(CP)"],
        ["MOVET #PPOINT(0), TRUE", "MOVEST HERE, 40", "BASE 1, 2", "BASE NULL", "TOOL NULL"],
        ['$a = "x" + "y"', 'IF $a == "xy" GOTO 1', "1 TYPE $a, /F8.2, 3, NULL"],
        ["SIGNAL 0, -2001", "WAIT SIG(1001, -2)", "DELAY 0", "x = 1", "SIGNAL -x"],
        ["a = 1", "CASE a OF", "VALUE 1, 2:", "ANY", "END"],
        ["BITS 1 = 1", "BITS 1, 3 = 7", "n = 3", "BITS 1, n = 7", "OPEN 0", "CLOSE n"],
    ],
)
def test_sound_programs_are_left_alone(lines):
    assert found(*lines) == []


def test_names_of_a_programs_own_dont_count_for_others():
    text = ".PROGRAM a\nAUTO x, y\nx = 1\nCALL b(x, y)\n.END\n.PROGRAM b(p, q)\nq = p + x\n.END"
    (finding,) = check_text(text, "t")[1]
    assert (finding.error.what, finding.error.program, finding.error.step, finding.place.line) == (
        "Undefined value",
        "b",
        1,
        7,
    )
    (finding,) = check_text(".PROGRAM a\nx = y\nCALL b\n.END\n.PROGRAM b\nAUTO y\ny = 1\n.END", "t")[1]
    assert (finding.error.program, finding.error.detail) == ("a", "y; nothing in the file sets it")


def test_a_programs_own_name_isnt_set_by_another():
    text = ".PROGRAM a\nAUTO y\nx = y\nx = y\nCALL b\n.END\n.PROGRAM b\ny = x\n.END"
    (finding,) = check_text(text, "t")[1]
    assert (finding.error.program, finding.place.line) == ("a", 3)


def test_a_name_is_reported_once_in_a_program():
    assert [row[3] for row in found("x = y", "x = y + y", "MOVE p", "MOVE p")] == [2, 4]


def test_kinds_of_names_follow_what_they_are_set_to():
    assert [f[1] for f in found("n = 1", "MOVE n")] == ["Mixed types"]
    assert [f[1] for f in found("SET p = HERE", "x = p + 1")] == ["Mixed types"]
    assert [f[1] for f in found("MOVE n", sections=".REALS\nn 1\n.END")] == ["Mixed types"]
    assert found("MOVE p", sections=".LOCATIONS\np 1 2 3 4 5 6\n.END") == []


def test_arguments_are_counted_and_of_the_kinds_of_their_parameters():
    second = ".PROGRAM b(n, $s, #p, x[])\nn = 1\n.END"
    assert [f[1] for f in found("CALL b(1, 2)", sections=second)] == ["Mixed types"]
    assert [f[1] for f in found("CALL b($s)", sections=second)] == ["Mixed types"]
    assert [f[1] for f in found('CALL b(1, "x", #PPOINT(0), y[], 5)', sections=second)] == ["Too many arguments"]
    assert found('CALL b(, "x", #p, y[])', sections=second) == []


def test_what_has_no_meaning_here_is_a_warning():
    rows = found("SELECT ROBOT = 1", "ENABLE COLOR.SPEED", "FSET (5) 1")
    assert [(severity, what, line) for severity, what, _, line, _ in rows] == [
        ("warning", "No meaning here", line) for line in (2, 3, 4)
    ]


def test_a_variable_that_looks_like_an_instruction_is_a_warning():
    assert found("BITS = 7", "bits = BITS(1, 8)", "TYPE bits") == [
        ("warning", "Looks like an instruction", "a variable is set; of signals: BITS first[, count] = value", 2, 1)
    ]


def test_an_unknown_word_that_begins_like_a_structure_leaves_those_around_it_whole():
    assert [f[1:4:2] for f in found("IF 1 == 2 THEN", 'WIBBLE 3, "x"', "END")] == [("Undefined instruction", 3)]
    assert [f[1:4:2] for f in found("WHLE 1 == 2 DO", "END")] == [("Undefined instruction", 2)]


def test_a_function_without_its_arguments_is_told_by_its_form():
    assert [f[1:3] for f in found("x = ADC", "y = STATUS(main)")] == [
        ("Undefined value", "adc; the function is ADC(channel)"), ("Mixed types", "a string is wanted"),
    ]  # fmt: skip


def test_what_is_read_of_a_file_counts_as_set():
    assert found('ATTACH (lun, 4) "DISK"', "READ (lun) $line, n", "TYPE $line, n, lun") == []


def test_long_names_that_become_the_same_are_a_warning():
    (row,) = found("center.position.x = 1", "center.position.y = 2")
    assert row == (
        "warning",
        "Long names",
        "center.position.y is the same as center.position.x: 15 characters count",
        3,
        1,
    )


def test_every_line_that_cant_be_read_is_named():
    text = ".PROGRAM\nMOVE\n.END\n.FOO\n.PROGRAM b\nx = (\nIF a\n.END\n.PROGRAM b\n.END\n.REALS\nx y\n"
    source, findings = check_text(text, "t")
    assert source is None
    assert [(f.error.what, f.place.line) for f in findings] == [
        ("Syntax error", 1),
        ("Missing argument", 2),
        ("Undefined directive", 4),
        ("Syntax error", 6),
        ("Control structure error", 7),
        ("Undefined value", 7),
        ("Duplicate program", 9),
        ("Syntax error", 12),
    ]


def test_a_file_without_a_program_is_an_error():
    assert [f.error.what for f in check_text("; nothing\n", "t")[1]] == ["Undefined program"]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_examples_are_sound(path):
    assert check_text(path.read_text(), path.name)[1] == []


def test_old_programs_have_warnings_at_most():
    for stem in ("val1", "val2", "vplus"):
        text = (HERE / "programs" / f"{stem}.v2").read_bytes().decode()
        assert [f for f in check_text(text, stem)[1] if f.severity == "error"] == []


def exit_code(*arguments):
    """The exit code of `vrs` with arguments."""
    with pytest.raises(SystemExit) as ended:
        main(list(arguments))
    return ended.value.code


def test_vrs_check_says_what_is_wrong_and_exits_2(tmp_path, capsys):
    path = tmp_path / "bad.v2"
    path.write_text(".PROGRAM main\n  MOVE p\n SELECT 3\n.END\n")
    assert exit_code("check", str(path)) == 2
    said = capsys.readouterr().out.splitlines()
    assert said == [
        f"{path}:2:8: error: *Undefined location* p; nothing in the file sets it (program main, step 1)",
        f"{path}:3:2: warning: *No meaning here* SELECT 3 is passed over: there is one robot"
        " (program main, step 2)",
        "1 error, 1 warning.",
    ]
    assert exit_code("check", str(path), "--json") == 2
    report = json.loads(capsys.readouterr().out)
    assert report["findings"][0] == {
        "severity": "error",
        "what": "Undefined location",
        "detail": "p; nothing in the file sets it",
        "program": "main",
        "step": 1,
        "line": 2,
        "column": 8,
    }


def test_vrs_check_plans_the_first_program(tmp_path, capsys):
    path = tmp_path / "far.v2"
    path.write_text(".PROGRAM main\n  FOR i = 1 TO 3\n    MOVE TRANS(5000, 0, 0)\n  END\n.END\n")
    assert exit_code("check", str(path)) == 2
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith(f"{path}:3:")
    assert "*Location out of range*" in said[0]
    assert said[-1] == "1 error, no warnings."
    assert exit_code("check", str(path), "--static") == 0
    assert capsys.readouterr().out == "no errors, no warnings.\n"


def test_vrs_check_plans_a_program_beside_one_that_is_wrong(tmp_path, capsys):
    path = tmp_path / "two.v2"
    path.write_text(
        ".PROGRAM a\n  MOVE p\n.END\n.PROGRAM b\n  CALL c\n.END\n.PROGRAM c\n  MOVE TRANS(5000)\n.END\n"
    )
    assert exit_code("check", str(path), "--program", "b") == 2
    said = capsys.readouterr().out
    assert "*Undefined location* p" in said
    assert "*Location out of range*" in said
    assert exit_code("check", str(path)) == 2
    assert "*Location out of range*" not in capsys.readouterr().out


def test_vrs_check_takes_programs_and_values_of_several_files(tmp_path, capsys):
    program, values, other = (tmp_path / name for name in ("a.v2", "b.lc", "c.v2"))
    program.write_text(".PROGRAM main\n  MOVE p\n  CALL other(x)\n.END\n")
    values.write_text("# taught\n.LOCATIONS\np 9000 0 0 90 90 0\n.END\n")
    other.write_text(".PROGRAM other(n)\n  n = y\n  MOVE q\n.END\n.PROGRAM main\n.END\n")
    assert exit_code("check", str(program), "--static") == 2
    assert "2 errors" in capsys.readouterr().out
    assert exit_code("check", str(program), str(values), str(other)) == 2
    assert capsys.readouterr().out.splitlines() == [
        f"{other}:2:7: error: *Undefined value* y; nothing in the file sets it (program other, step 1)",
        f"{other}:3:8: error: *Undefined location* q; nothing in the file sets it (program other, step 2)",
        f"{other}:5:1: error: *Duplicate program* main",
        "3 errors, no warnings.",
    ]
    other.write_text(".PROGRAM other(n)\n  n = 1\n.END\n")
    assert exit_code("check", str(program), str(values), str(other)) == 2
    assert capsys.readouterr().out.startswith(f"{program}:2:3: error: *Location out of range*")
    assert exit_code("check", str(program), str(values), str(other), "--program", "other", "--json") == 0
    assert [row["findings"] for row in json.loads(capsys.readouterr().out)] == [[], [], []]
    assert exit_code("check", str(program), str(values), str(other), "--program", "none") == 2
    assert "none; allowed: main, other" in capsys.readouterr().err


def test_vrs_check_of_what_isnt_there_is_one_line(tmp_path, capsys):
    assert exit_code("check", str(tmp_path / "no.v2")) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "can't be read" in said


@pytest.mark.parametrize(
    ("lines", "line", "what", "column"),
    [
        (["x = 1", "SET #q = x"], 3, "Mixed types", 10),
        (["SET p = NULL", "SET #q = p"], 3, "Mixed types", 10),
        (["SET p = NULL", "TYPE SIN(p)"], 3, "Mixed types", 10),
        (["FOR $i = 1 TO 3", "END"], 2, "Variable type mismatch", 5),
        (["CASE HERE OF", "VALUE 1:", "END"], 2, "Mixed types", 6),
        (['$s = "a"', "CASE $s OF", 'VALUE "a", 1:', "END"], 4, "Mixed types", 12),
        (["CASE 1 OF", 'VALUE "a":', "END"], 3, "Mixed types", 7),
        (["SET #q = #HERE", "y = #q"], 3, "Mixed types", 5),
    ],
)
def test_types_over_several_lines(lines, line, what, column):
    assert [(f[1], f[3], f[4]) for f in found(*lines)] == [(what, line, column)]


@pytest.mark.parametrize(
    "lines",
    [
        ["SET #q = HERE", "SET #r = DEST", "SET #s = #q", "SET p = HERE", "y = 1", "MOVE #q"],
        ["SIGNAL 0, -512, 2512", "IGNORE 1001", "REACT -2001", "x = SIG(-1512)"],
        ['$s = "a"', "CASE $s OF", 'VALUE "a", $s + "b":', "END", "CASE 1 OF", "VALUE 1, 2:", "ANY", "END"],
    ],
)
def test_what_is_of_the_right_kind_is_left_alone(lines):
    assert found(*lines) == []


@pytest.mark.parametrize(
    "line", ["SPEED 150", "SPEED 50, 101 ALWAYS", "SPEED 300 MONITOR", "DRIVE 1, 1, 120", "ACCEL 200"]
)
def test_what_counts_as_less_is_said(line):
    ((severity, what, detail, *_),) = found(line)
    assert (severity, what) == ("warning", "Value out of range")
    assert detail.endswith("counts as 100 %")


@pytest.mark.parametrize(
    "lines",
    [
        ["IF x = = 1 THEN", "x = 1", "ELSE", "x = 2", "END"],
        ["IF (1 THEN", "END"],
        ["IFF 1 THEN", "x = 1", "END"],
        ["10 IF 1 = GOTO 20", "20 GOTO 10"],
        ["IF ) THEN 20", "20"],
        ["FOR i = 1 TOO 3", "TYPE i", "EXIT", "END"],
        ["FRO i = 1 TO 3", "TYPE i", "NEXT", "END"],
        ["WHILE ) DO", "EXIT", "END"],
        ["WHLE 1 DO", "NEXT", "END"],
        ["DO 5", "x = 1", "UNTIL x == 1"],
        ["DO", "x = 1", "UNTIL x =="],
        ["CASE ) OF", 'VALUE "a":', "VALUE 2:", "ANY", "END"],
        ["CASE 1 OF", "VALUE ):", "ANY", "END"],
        ["CASE 1 OF", "VALUE 1:", "ANY 5", "END"],
        ["IF TRUE THEN", "ELSE 5", "END"],
        ["IF TRUE THEN", "ELSIF", "END"],
        ["10 MOVE )", "GOTO 10"],
        ["n = )", "TYPE n"],
        ["SET p = TRANS(", "MOVE p"],
        ["PROMPT 'n?', n", "TYPE n"],
        ["70000 x = 1", "TYPE x"],
        ["$for = )", "TYPE $for"],
        ["FOR = )"],
    ],
)
def test_one_fault_is_one_message(lines):
    assert len(found(*lines)) == 1


def test_a_header_that_cant_be_read_is_one_message():
    text = ".PROGRAM main()\nCALL part(1, 2)\n.END\n.PROGRAM part(a, b\nTYPE a, b\n.END\n"
    (only,) = check_text(text, "t.v2")[1]
    assert (only.error.what, only.place.line) == ("Syntax error", 4)


def test_faults_beside_one_that_cant_be_read_are_still_found():
    lines = ["FOR i = 1 TOO 3", "x = LEN(3)", "END", "END", "y = z + 1"]
    assert [(f[1], f[3]) for f in found(*lines)] == [
        ("Syntax error", 2), ("Mixed types", 3), ("Control structure error", 5), ("Undefined value", 6),
    ]  # fmt: skip


@pytest.mark.parametrize("line", ["WINDOW 3", "WEAVE 3, 1", "MC LOAD a", "SET.EVENT 1"])
def test_what_a_program_cant_go_without_is_an_error(line):
    ((severity, what, detail, *_),) = found(line)
    assert (severity, what) == ("error", "Not available")
    assert detail.startswith(line.split()[0])


@pytest.mark.parametrize(
    "line", ["ENABLE DRY.RUNN", "ENABLE CP, scale", "DISABLE POWR", "PARAMETER HAND.TIMES = 1"]
)
def test_a_slip_in_a_name_isnt_passed_over(line):
    ((severity, what, detail, *_),) = found(line)
    assert (severity, what[:7]) == ("error", "Unknown")
    assert "allowed: " in detail


def test_values_beside_the_word_of_their_section_arent_passed_over():
    ((_, what, detail, line, column),) = found("x = 1", sections=".REALS count 3\n.END")
    assert (what, detail, line, column) == ("Syntax error", "allowed: .REALS alone on its line", 4, 8)
