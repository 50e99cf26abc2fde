"""Files: every section, errors with their place, and that what is stored is what is loaded."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.val2.errors import TextPosition, ValError
from interfaces.val2.parser import parse_expression
from interfaces.val2.signals import SignalRule
from interfaces.val2.source import (
    NamedValue,
    SourceFile,
    numbers_of,
    parse_file,
    parse_rule,
    print_file,
    print_rule,
)
from interfaces.val2.syntax import Number, Variable
from interfaces.val2.values import NULL, VAL2, PrecisionPoint
from tests.interfaces.val2.bench import from_oat

PROGRAMS = sorted((Path(__file__).parent / "programs").glob("*.v2"))
WHOLE = """; a tray
.PROGRAM main() ;first
      MOVE p1
.END
.PROGRAM second(a)
.END
.LOCATIONS
p1   0 300.5 -200 90 -90 0
p[1,2] = 1, 2, 3, 4 5 6 ;element
#safe 0 -90 90 0 0 0
.END
.REALS
n 3
x[0] = -1.5E-3
.END
.STRINGS
$a "hello; x" ;c
$b[3] "say " + $CHR(34) + "hi" + $CHR(34)
.END
.SIGNALS
1001 = SIG(1) AFTER 2 FOR 0.5 ;sensor
2002 = TRUE AT 5
.END
"""


def element(name, *indices):
    return Variable(name, tuple(Number(float(i)) for i in indices))


def test_every_section_is_read():
    source = parse_file(WHOLE, "tray.v2")
    assert source.name == "tray.v2"
    assert [p.name for p in source.programs] == ["main", "second"]
    assert tuple(source.of("locations")) == (
        NamedValue(element("p1"), from_oat(0, 300.5, -200, 90, -90, 0)),
        NamedValue(element("p", 1, 2), from_oat(1, 2, 3, 4, 5, 6)),
        NamedValue(element("#safe"), PrecisionPoint((0, -90, 90, 0, 0, 0))),
    )
    assert source.of("reals") == [NamedValue(element("n"), 3.0), NamedValue(element("x", 0), -0.0015)]
    assert source.of("strings") == [
        NamedValue(element("$a"), "hello; x"),
        NamedValue(element("$b", 3), 'say "hi"'),
    ]
    assert source.signals == (
        SignalRule(1001, parse_expression("SIG(1)"), after=2.0, lasting=0.5),
        SignalRule(2002, parse_expression("TRUE"), at_time=5.0),
    )


@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
def test_what_is_stored_is_loaded(ends):
    source = parse_file(WHOLE.replace("\n", ends), "f.v2")
    text = print_file(source)
    again = parse_file(text, "f.v2")
    assert again == source
    assert print_file(again) == text
    assert text.startswith(
        ".PROGRAM main() ;first\n      MOVE p1\n.END\n.PROGRAM second(a)\n.END\n.LOCATIONS\np1 0 300.5"
    )
    assert '$b[3] "say " + $CHR(34) + "hi" + $CHR(34)\n' in text
    assert "1001 = SIG(1) AFTER 2 FOR 0.5\n2002 = TRUE AT 5\n" in text


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_files_as_people_write_them_come_back(path):
    source = parse_file(path.read_bytes().decode(), path.name)
    again = parse_file(print_file(source), path.name)
    assert again.programs == source.programs
    assert again.signals == source.signals
    for kind in ("reals", "strings"):
        assert again.of(kind) == source.of(kind)
    assert print_file(again) == print_file(source)


angles = st.floats(-180, 180) | st.sampled_from([-180.0, -90.0, 0.0, 90.0, 180.0])
lengths = st.floats(-2000, 2000)


@settings(deadline=None, derandomize=True, database=None, max_examples=200)
@given(lengths, lengths, lengths, angles, st.floats(-90, 90) | st.sampled_from([-90.0, 90.0]), angles)
def test_every_pose_comes_back(x, y, z, o, a, t):
    pose = from_oat(x, y, z, o, a, t)
    text = print_file(SourceFile("f", values=(NamedValue(element("p"), pose),)))
    (entry,) = parse_file(text, "f").values
    assert np.allclose(entry.value.X, pose.X, rtol=0, atol=2e-8)
    assert print_file(SourceFile("f", values=(entry,))) == text


@settings(deadline=None, derandomize=True, database=None, max_examples=200)
@given(
    st.lists(st.floats(-400, 400), min_size=6, max_size=6),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(),
)
def test_joints_reals_and_strings_come_back_exactly(joints, real, text):
    source = SourceFile(
        "f",
        values=(
            NamedValue(element("#p"), PrecisionPoint(tuple(joints))),
            NamedValue(element("r", 2), real),
            NamedValue(element("$s"), text[:60]),
        ),
    )
    assert parse_file(print_file(source), "f") == source


def test_files_of_v_plus_have_other_comments_and_step_numbers():
    text = (
        "# demo\n.PROGRAM main() # x\n  1.  MOVE #p\n  2.\n.END\n.LOCATIONS\n# six\n#p 1 2 3 4 5 6 # joints\n.END\n"
        ".REALS\n# one\nn 3\n.END # of it\n"
    )
    wanted = ".PROGRAM main() ; x\n      MOVE #p\n\n.END\n.LOCATIONS\n#p 1 2 3 4 5 6\n.END\n.REALS\nn 3\n.END\n"
    assert print_file(parse_file(text, "f")) == wanted
    # Without a blank behind it, too, but where a line of values begins: `#six` may be a location there.
    tight = text.replace("# six\n", "").replace("# one\n", "").replace("# ", "#")
    assert print_file(parse_file(tight, "f")) == wanted.replace("; x", ";x")


def test_upright_poses_are_printed_with_o_90():
    upright, down = (NamedValue(Variable("p"), value) for value in (NULL, from_oat(1, 2, 3, 30, 90, 0)))
    assert numbers_of(upright, VAL2) == (0, 0, 0, 90, -90, 0)
    assert numbers_of(down, VAL2)[3:5] == (90, 90)


def test_a_text_without_a_header_is_a_program_of_the_files_name():
    source = parse_file("; old\n  MOVE a\n10 GOTO 10\n", "/tmp/Old Shop-1.v2")
    (program,) = source.programs
    assert (program.name, len(program.steps)) == ("oldshop1", 2)
    assert parse_file("MOVE a", "12.v2").programs[0].name == "p12"
    assert parse_file("", "x.v2") == SourceFile("x.v2")
    assert parse_file("\ufeff.PROGRAM a\n\x1a", "x").programs[0].steps == ()


@pytest.mark.parametrize(
    ("text", "place", "said"),
    [
        (".LOCATIONS\np 1 2 3 4 5", (2, 12), "5 of 6 numbers"),
        (".LOCATIONS\np 1 2 3 4 5 6 7", (2, 15), "allowed: the end of the line"),
        (".LOCATIONS\np 1 2 x 4 5 6", (2, 7), "allowed: a number"),
        (".LOCATIONS\n$p 1 2 3 4 5 6", (2, 1), "allowed: name or #name"),
        (".LOCATIONS\n\n HERE 1 2 3 4 5 6", (3, 2), "HERE is a function"),
        (".LOCATIONS\np[1,2,3,4] 1 2 3 4 5 6", (2, 1), "one to three indices"),
        (".REALS\n#x 3", (2, 1), "#x; allowed: name"),
        (".REALS\nx 1E999", (2, 3), "Number too large"),
        (".REALS\nx", (2, 2), "0 of 1 numbers"),
        ('.STRINGS\ns "a"', (2, 1), "allowed: $name"),
        (".STRINGS\n$s 3", (2, 4), "strings and $CHR"),
        ('.STRINGS\n$s "a', (2, 4), "no closing quote"),
        (".SIGNALS\n1001 == SIG(1)", (2, 7), "allowed: a value"),
        (".SIGNALS\n1001 = SIG(1) AFTER 1 AFTER 2", (2, 23), "a second AFTER"),
        (".SIGNALS\n10.5 = TRUE", (2, 1), "Illegal digital signal"),
        (".PROGRAM a\n.END\nMOVE p", (3, 1), "allowed: .PROGRAM"),
        (".PROGRAM a\n.END\n.PROGRAM A", (3, 1), "Duplicate program"),
        (".LOCATION\n", (1, 1), "did you mean .LOCATIONS?"),
        (".PROGRAM a\n MOVE\n.END", (2, 6), "Missing argument"),
    ],
)
def test_errors_say_where(text, place, said):
    with pytest.raises(ValError) as caught:
        parse_file(text, "f.v2")
    assert said in str(caught.value)
    assert caught.value.place == TextPosition(*place)


def test_rules_take_their_times_in_any_order():
    assert parse_rule("1001 = SIG(1) FOR 3 AFTER 2") == parse_rule("1001=sig(1) after 2 for 3")
    assert print_rule(parse_rule("1001 = SIG(1) AND NOT SIG(-2) FOR 3")) == "1001 = SIG(1) AND NOT SIG(-2) FOR 3"
    assert math.isclose(parse_rule("1001 = TRUE AT 2.5").at_time, 2.5)
