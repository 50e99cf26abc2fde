"""Expressions: values, types, and what can't be."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.val2.errors import ValError
from interfaces.val2.formats import general, number
from interfaces.val2.memory import MOST_VALUES, Memory
from interfaces.val2.parser import parse_expression
from interfaces.val2.printer import print_expression
from interfaces.val2.syntax import Format, Number, Variable
from interfaces.val2.values import NULL, PrecisionPoint, Transformation
from tests.interfaces.val2.bench import from_oat, to_oat
from tests.interfaces.val2.rig import Rig, body, run


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * 3", 7.0),
        ("-2 ^ 2 + 7 MOD 4", -4.0 + 3.0),
        ("-7 MOD 4", -3.0),
        ("7 / 2", 3.5),
        ("2 ^ -1", 0.5),
        ("3 == 3", -1.0),
        ("3 <> 3", 0.0),
        ("1 < 2 AND 2 <= 2", -1.0),
        ("1 > 2 OR 3 >= 4", 0.0),
        ("TRUE XOR TRUE", 0.0),
        ("NOT 0", -1.0),
        ("NOT 7", 0.0),
        ("12 BAND 10", 8.0),
        ("12 BOR 10", 14.0),
        ("12 BXOR 10", 6.0),
        ("COM 5", -6.0),
        ("TRUE", -1.0),
        ("OFF", 0.0),
        ("SIN(30) + COS(60)", 1.0),
        ("COS(90) + SIN(180) + SIN(-360)", 0.0),
        ("TAN(45)", 1.0),
        ("ATAN2(1,-1)", 135.0),
        ("SQRT(16) + SQR(3)", 13.0),
        ("ABS(-2.5)", 2.5),
        ("INT(-5.7)", -5.0),
        ("FRACT(-5.75)", -0.75),
        ("SIGN(0) + SIGN(-3)", 0.0),
        ("MIN(3,1,2) + MAX(3,1,2)", 4.0),
        ("PI", math.pi),
        ("BMASK(1,3)", 5.0),
        ('LEN("abc")', 3.0),
        ('ASC("abc",2)', 98.0),
        ('ASC("abc",9)', -1.0),
        ('VAL("  -2.5E1mm")', -25.0),
        ('VAL("mm")', 0.0),
        ('POS("abcabc","ca")', 3.0),
        ('POS("abcabc","ab",2)', 4.0),
        ('POS("abc","x")', 0.0),
        ('"a" < "b"', -1.0),
        ('"a" + "b" == "ab"', -1.0),
        ("DEFINED(nothing)", 0.0),
        ("DX(TRANS(1,2,3)) + DY(TRANS(1,2,3)) * 10 + DZ(TRANS(1,2,3)) * 100", 321.0),
        ("DISTANCE(TRANS(3,4),NULL)", 5.0),
        ("SPEED(1)", 100.0),
        ("SWITCH(CP)", -1.0),
        ("PARAMETER(HAND.LOAD)", 0.0),
        ("INRANGE(NULL)", 0.0),
    ],
)
def test_values_of_reals(text: str, value: float) -> None:
    assert Rig().value(text) == pytest.approx(value, abs=1e-15)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ('"a" + $CHR(66) + "c"', "aBc"),
        ('$MID("abcdef",2,3)', "bcd"),
        ('$MID("abc",3,9)', "c"),
        ('$ENCODE(/F6.2,3.14159,/I0,7,"x")', "  3.147x"),
        ("$ENCODE(3)", " 3"),
    ],
)
def test_values_of_strings(text: str, value: str) -> None:
    assert Rig().value(text) == value


@pytest.mark.parametrize(
    ("text", "what", "column"),
    [
        ("1 + x", "Undefined value", 5),
        ("a[3]", "Undefined value", 1),
        ("$s", "Undefined value", 1),
        ("#p", "Undefined location", 1),
        ("DX(p)", "Undefined location", 4),
        ("a:b", "Undefined location", 1),
        ("2 * (1 / 0)", "Division by zero", None),
        ("1 MOD 0", "Division by zero", None),
        ("0 ^ -1", "Division by zero", None),
        ("TAN(90)", "Division by zero", None),
        ("SQRT(-1)", "Square root of a negative number", 1),
        ("(-8) ^ 0.5", "Illegal value", None),
        ("1E300 * 1E300", "Arithmetic overflow", None),
        ("1E308 + 1E308", "Arithmetic overflow", None),
        ("-1E308 - 1E308", "Arithmetic overflow", None),
        ("10 ^ 400", "Arithmetic overflow", None),
        ("1E308 / 1E-10", "Arithmetic overflow", None),
        ("SQR(1E300)", "Arithmetic overflow", None),
        ("1E300 BAND 1", "Illegal value", None),
        ("SIG(0)", "Illegal digital signal", 1),
        ("SIG(513)", "Illegal digital signal", 1),
        ("SIG(1.5)", "Illegal digital signal", 1),
        ("TIMER(99)", "Illegal timer number", 1),
        ("$CHR(256)", "Illegal value", 1),
        ("a[-1]", "Invalid array index", None),
        ("a[1E9]", "Invalid array index", None),
        ("FRAME(NULL,NULL,NULL,NULL)", "Illegal value", 1),
        ("FRAME(NULL,TRANS(1),TRANS(2),NULL)", "Illegal value", 1),
        ('"a" == 1', "Mixed types", None),
        ("NULL + 1", "Mixed types", None),
        ("SPEED(2)", "Illegal value", 1),
    ],
)
def test_what_cant_be_is_an_error_with_its_column(text: str, what: str, column: int | None) -> None:
    with pytest.raises(ValError) as raised:
        Rig().value(text)
    assert raised.value.what == what
    if column is not None:
        assert raised.value.place is not None
        assert raised.value.place.column == column


@given(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))
@settings(max_examples=40, deadline=None)
def test_sine_and_cosine_are_of_degrees(a: float, b: float, c: float) -> None:
    rig = Rig()
    for name, value in (("a", a), ("b", b), ("c", c)):
        rig.controller.memory.set(Variable(name), value)
    assert rig.value("SIN(a)") == pytest.approx(math.sin(math.radians(a)), abs=1e-11)
    assert rig.value("COS(b)") == pytest.approx(math.cos(math.radians(b)), abs=1e-11)
    assert rig.value("SQR(SIN(c)) + SQR(COS(c))") == pytest.approx(1.0, abs=1e-12)


@given(st.text('0123456789.+-*/^()ABXYNOTMODSINQR $"#[]:,<>=', max_size=40))
@settings(max_examples=300, deadline=None)
def test_any_expression_has_a_value_or_is_a_val_error(text: str) -> None:
    try:
        value = Rig().value(text)
    except ValError:
        return
    if isinstance(value, float):
        assert math.isfinite(value)


def test_functions_of_locations() -> None:
    rig = Rig()
    rig.run(
        body(
            "SET a = TRANS(100,200,300,10,20,30)",
            "SET b = TRANS(1,2,3,-40,50,60)",
            "SET c = a:b:RZ(30)",
            "SET d = INVERSE(a):a",
            "SET e = SHIFT(a BY 5,,-10)",
            "SET g = SCALE(a BY 1.25)",
            "SET f = FRAME(TRANS(1,1,1),TRANS(1,5,1),TRANS(1,1,9),a)",
            "SET #q = #PPOINT(1,2,3,,5)",
            "DECOMPOSE n[1] = e",
            "DECOMPOSE j[] = #q",
        )
    )
    a, b = from_oat(100, 200, 300, 10, 20, 30), from_oat(1, 2, 3, -40, 50, 60)
    turn = np.eye(4)
    turn[:2, :2] = [[math.cos(math.pi / 6), -0.5], [0.5, math.cos(math.pi / 6)]]

    def pose(name: str) -> np.ndarray:
        value = rig.value(name)
        assert isinstance(value, Transformation)
        return value.X

    np.testing.assert_allclose(pose("c"), a.X @ b.X @ turn, atol=1e-12)
    np.testing.assert_allclose(pose("d"), np.eye(4), atol=1e-12)
    np.testing.assert_allclose(pose("e")[:3, 3], [105, 200, 290])
    np.testing.assert_array_equal(pose("e")[:3, :3], a.X[:3, :3])
    np.testing.assert_allclose(pose("g")[:3, 3], [125, 250, 375])
    np.testing.assert_array_equal(pose("g")[:3, :3], a.X[:3, :3])
    np.testing.assert_allclose(pose("f")[:3, :3], np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]).T, atol=1e-15)
    np.testing.assert_allclose(pose("f")[:3, 3], [100, 200, 300])
    assert rig.value("#q") == PrecisionPoint((1.0, 2.0, 3.0, 0.0, 5.0, 0.0))
    assert [rig.value(f"n[{i}]") for i in range(1, 7)] == pytest.approx([105, 200, 290, 10, 20, 30])
    assert [rig.value(f"j[{i}]") for i in range(6)] == [1.0, 2.0, 3.0, 0.0, 5.0, 0.0]


def test_tool_is_the_transformation_in_force() -> None:
    rig = Rig()
    assert rig.value("TOOL") == NULL
    rig.run(body("TOOL TRANS(0,0,100)", "SET t = HERE:INVERSE(TOOL)", "TOOL TOOL:RZ(90)", "TYPE DZ(TOOL)"))
    assert rig.typed() == " 100\n"
    assert rig.value("DZ(t)") == -100.0


def test_trans_without_angles_turns_nothing() -> None:
    assert Rig().value("TRANS()") == NULL
    value = Rig().value("TRANS(1,,3,,-60)")
    assert isinstance(value, Transformation)
    assert to_oat(value) == pytest.approx((1, 0, 3, 90, -60, 0))


@pytest.mark.parametrize(
    "lines",
    [
        ("x = 3", "SET x = NULL"),
        ("SET x = NULL", "x = 3"),
        ("SET x = NULL", "y = x + 1"),
        ("x = 3", "MOVE x"),
        ("x = 3", "x[1] = 3"),
        ("x[1] = 3", "x = 3"),
        ("x[1] = 3", "SET x[2] = NULL"),
        ("SET #x = NULL",),
        ("SET x = #PPOINT()",),
        ("$s = 3",),
        ('s = "a"',),
    ],
)
def test_type_conflicts_are_errors(lines: tuple[str, ...]) -> None:
    with pytest.raises(ValError, match=r"\*Variable type mismatch\*|\*Mixed types\*"):
        Rig().run(body(*lines))


def test_arrays_have_three_dimensions() -> None:
    assert run("a[1,2,3] = 5", "b[0] = 1", "TYPE a[b[0],2,3]") == " 5\n"
    with pytest.raises(ValError):
        run("a[1,2,3,4] = 5")


def test_the_integer_part_of_an_index_counts() -> None:
    assert run("a[2] = 5", "TYPE a[2.9]") == " 5\n"


def test_decode_takes_off_what_it_gives() -> None:
    text = run(
        '$s = "12, 34"',
        '$a = $DECODE($s,", ",0)',
        '$b = $DECODE($s,", ",1)',
        'TYPE $a, "|", $b, "|", $s',
    )
    assert text == "12|, |34\n"


def test_strings_dont_grow_without_end() -> None:
    with pytest.raises(ValError, match=r"\*String too long\*"):
        run('$s = "ab"', "DO", "$s = $s + $s", "UNTIL FALSE")


def test_arrays_dont_grow_without_end() -> None:
    memory = Memory()
    slot = memory.slot("a")
    for i in range(MOST_VALUES):
        memory.element(slot, divmod(i, 1000))
    with pytest.raises(ValError, match=r"\*Not enough storage area\*"):
        memory.element(slot, (1000, 0))
    memory.clear()
    memory.set(Variable("a", (Number(1.0),)), 2.0)
    assert memory.get(Variable("a", (Number(1.0),))) == 2.0


def test_memory_by_names() -> None:
    memory = Memory()
    element = Variable("a", (Number(10.0),))
    memory.set(element, 1.0)
    memory.set(Variable("a", (Number(9.0),)), 2.0)
    memory.set(Variable("b"), NULL)
    memory.set(Variable("$s"), "x")
    memory.set(Variable("#q"), PrecisionPoint((0.0,) * 6))
    assert [(print_expression(v), value) for v, value in memory.variables()] == [
        ("#q", PrecisionPoint((0.0,) * 6)), ("$s", "x"), ("a[9]", 2.0), ("a[10]", 1.0), ("b", NULL),
    ]  # fmt: skip
    memory.delete(element)
    memory.delete(Variable("b"))
    for gone in (element, Variable("b")):
        with pytest.raises(ValError, match="Undefined"):
            memory.get(gone)
    with pytest.raises(ValError, match="Undefined"):
        memory.delete(Variable("b"))
    memory.set(Variable("b"), 3.0)
    with pytest.raises(ValError, match="mismatch"):
        memory.set(Variable("b"), NULL)
    with pytest.raises(ValError, match="mismatch"):
        memory.set(Variable("$b"), 3.0)


@pytest.mark.parametrize(
    ("form", "value", "text"),
    [
        (Format("D"), 3.0, " 3"),
        (Format("D"), -0.25, " -0.25"),
        (Format("D"), 123456789.0, " 123456789"),
        (Format("D"), 1 / 3, " 0.3333333"),
        (Format("F", 8, 2), 3.14159, "    3.14"),
        (Format("F", 8, 2), -0.001, "    0.00"),
        (Format("F", 4, 2), 1234.5, "****"),
        (Format("F", 0, 1), 1234.5, "1234.5"),
        (Format("I", 4), 7.6, "   8"),
        (Format("I"), -3.0, "-3"),
        (Format("E", 10, 2), 12345.0, "  1.23E+04"),
        (Format("H"), 255.0, "FF"),
        (Format("O", 5), 8.0, "   10"),
    ],
)
def test_formats(form: Format, value: float, text: str) -> None:
    assert number(value, form) == text


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_the_default_format_is_right_to_seven_digits(value: float) -> None:
    assert float(general(value)) == pytest.approx(value, rel=1e-6, abs=1e-300)


def test_type_with_control_items() -> None:
    assert run('TYPE "a", /X3, "b", /C2, "c", /S', 'TYPE /I3, 5, 6, /D, 7, "."') == "a   b\n\nc  5  6 7.\n"
    assert run("TYPE") == "\n"
    assert run("TYPE TRANS(1,2,3), #PPOINT(1)") == " 1 2 3 90 -90 0 1 0 0 0 0 0\n"


def test_random_is_of_the_seed() -> None:
    first, second = run("TYPE RANDOM, RANDOM"), run("TYPE RANDOM, RANDOM")
    assert first == second
    assert len(set(first.split())) == 2


def test_both_sides_of_a_logical_operator_are_evaluated() -> None:
    with pytest.raises(ValError, match="Undefined value"):
        Rig().value("FALSE AND nothing")


def test_long_expressions() -> None:
    assert Rig().value("1" + "+1" * 90) == 91.0
    assert Rig().value("2" + "-1/1*1" * 30) == -28.0
    assert Rig().value('LEN("a"' + '+"a"' * 90 + ")") == 91.0
    assert Rig().value("1" + " AND 1" * 90) == -1.0


def test_expressions_of_numbers_alone_need_no_names() -> None:
    rig = Rig()
    assert rig.controller.evaluate(parse_expression("2 + 3"), now=0.0) == 5.0
    assert not list(rig.controller.memory.variables())
