"""The printer: what it prints is read as the tree that it was printed from."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings

from interfaces.val2.parser import parse_expression, parse_line
from interfaces.val2.printer import print_expression, print_program, print_step
from interfaces.val2.source import parse_file, parse_program
from interfaces.val2.syntax import Text, Variable

sys.path.insert(0, str(Path(__file__).parent))
import trees

PROGRAMS = sorted((Path(__file__).parent / "programs").glob("*.v2"))
QUICK = settings(deadline=None, suppress_health_check=list(HealthCheck), derandomize=True, database=None)


@settings(QUICK, max_examples=200)
@given(trees.expressions)
def test_a_printed_expression_reads_the_same(expression):
    assert parse_expression(print_expression(expression)) == expression


@settings(QUICK, max_examples=400)
@given(trees.steps)
def test_a_printed_step_reads_the_same(step):
    assert parse_line(print_step(step)) == step


@settings(QUICK, max_examples=60)
@given(trees.programs)
def test_a_printed_program_reads_the_same(program):
    text = print_program(program)
    again = parse_program(text)
    assert again == program
    assert print_program(again) == text


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_programs_as_people_write_them_read_the_same(path):
    text = path.read_bytes().decode()
    for program in parse_file(text, path.name).programs:
        assert parse_program(print_program(program), program.dialect) == program


@pytest.mark.parametrize(
    ("given_text", "printed"),
    [
        ("1-(2-3)", "1 - (2 - 3)"),
        ("(1-2)-3", "1 - 2 - 3"),
        ("-(2^2)", "-2^2"),
        ("(-2)^2", "(-2)^2"),
        ("2^-1", "2^-1"),
        ("2^(1+1)", "2^(1 + 1)"),
        ("2^3^4", "2^3^4"),
        ("2^(3^4)", "2^(3^4)"),
        ("2**3", "2^3"),
        ("not (a and b)", "NOT (a AND b)"),
        ("NOT a == 1 AND b", "NOT a == 1 AND b"),
        ("(NOT a) == 1", "(NOT a) == 1"),
        ("a eq b or c ne d", "a == b OR c <> d"),
        ("a*(b+c)", "a * (b + c)"),
        ("(a:b):inverse(c)", "a:b:INVERSE(c)"),
        ("rz(-ang):p[i+1,2]", "RZ(-ang):p[i + 1,2]"),
        ("shift(p by 1,,-3)", "SHIFT(p BY 1,, -3)"),
        ("scale(p, 2)", "SCALE(p BY 2)"),
        ("trans(,,100)", "TRANS(,, 100)"),
        ("Here", "HERE"),
        ("random()", "RANDOM"),
        ('$encode(/f8.2,x,"a ,b",/s)', '$ENCODE(/F8.2, x, "a ,b", /S)'),
        ("com 3 band 5", "COM 3 BAND 5"),
        ("^HfF + .5e-3 + 3.", "255 + 0.0005 + 3"),
    ],
)
def test_how_expressions_are_printed(given_text, printed):
    assert print_expression(parse_expression(given_text)) == printed


def test_programs_are_indented_by_their_structure():
    text = (
        ".PROGRAM p( A, b[] ) ;why\nif a==1 then\n10 do\n;note\nuntil sig(1)\nelse\n\n"
        "case a of\nvalue 1:\nmove p1\nend\nend\n.END"
    )
    assert print_program(parse_program(text)).splitlines() == [
        ".PROGRAM p(a, b[]) ;why",
        "      IF a == 1 THEN",
        "10      DO",
        "          ;note",
        "        UNTIL SIG(1)",
        "      ELSE",
        "",
        "        CASE a OF",
        "        VALUE 1:",
        "          MOVE p1",
        "        END",
        "      END",
        ".END",
    ]


def test_a_string_with_quotes_or_line_ends_is_printed_as_a_sum():
    assert print_expression(Text('a"b\n')) == '"a" + $CHR(34) + "b" + $CHR(10)'
    assert print_expression(Text("")) == '""'
    assert print_expression(Text('"')) == "$CHR(34)"


def test_a_whole_array_is_told_from_a_name():
    assert print_expression(Variable("a", array=True)) == "a[]"
    assert parse_expression("LAST(a[])") != parse_expression("LAST(a)")
