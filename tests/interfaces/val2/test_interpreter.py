"""Programs: control flow, calls and errors, in virtual time."""

from __future__ import annotations

import pytest

from interfaces.val2.context import MOST_CALLS, ProgramFailed, ProgramState, SignalChanged
from interfaces.val2.errors import ValError
from tests.interfaces.val2.rig import FakeArm, Rig, body, failure, run


def test_if_else() -> None:
    lines = ["FOR i = 1 TO 3", "IF i == 2 THEN", "TYPE /S, 2", "ELSE", "TYPE /S, 0", "END", "END"]
    assert run(*lines) == " 0 2 0"
    assert run("IF FALSE THEN", "TYPE 1", "END", "TYPE 2") == " 2\n"


@pytest.mark.parametrize(
    ("head", "values", "after"),
    [
        ("FOR i = 1 TO 3", [1, 2, 3], 4),
        ("FOR i = 3 TO 1 STEP -1", [3, 2, 1], 0),
        ("FOR i = 1 TO 2 STEP 0.5", [1, 1.5, 2], 2.5),
        ("FOR i = 3 TO 1", [], 3),
        ("FOR i = 1 TO 3 STEP -1", [], 1),
        ("FOR i = -1 TO -5 STEP -3", [-1, -4], -7),
    ],
)
def test_for(head: str, values: list[float], after: float) -> None:
    rig = Rig()
    typed = rig.run(body(head, "TYPE /S, i", "END"))
    assert [float(t) for t in typed.split()] == values
    assert rig.value("i") == after


def test_for_evaluates_its_limits_once() -> None:
    assert run("n = 3", "FOR i = 1 TO n STEP n - 2", "n = 100", "TYPE /S, i", "END") == " 1 2 3"


def test_for_of_step_0_is_an_error() -> None:
    assert failure(body("FOR i = 1 TO 2 STEP 0", "END")).step == 1


def test_for_may_count_with_an_element() -> None:
    assert run("j = 2", "FOR a[j] = 1 TO 2", "j = 7", "TYPE /S, a[2]", "END") == " 1 2"


def test_while_do_until_exit_next() -> None:
    assert run("i = 0", "WHILE i < 3 DO", "i = i + 1", "TYPE /S, i", "END") == " 1 2 3"
    assert run("i = 5", "DO", "TYPE /S, i", "i = i + 1", "UNTIL i > 3") == " 5"
    assert run("FOR i = 1 TO 9", "IF i == 2 THEN", "NEXT", "END", "IF i == 4 THEN", "EXIT", "END",
               "TYPE /S, i", "END", "TYPE /S, i") == " 1 3 4"  # fmt: skip
    assert run("i = 0", "DO", "i = i + 1", "IF i < 3 THEN", "NEXT", "END", "TYPE /S, i", "UNTIL i >= 4") == " 3 4"


def test_exit_and_next_of_outer_loops() -> None:
    lines = [
        "FOR i = 1 TO 3", "WHILE TRUE DO", "IF i == 2 THEN", "NEXT 2", "END", "TYPE /S, i",
        "IF i == 3 THEN", "EXIT 2", "END", "EXIT", "END", "TYPE /S, 0", "END", "TYPE /S, 9",
    ]  # fmt: skip
    assert run(*lines) == " 1 0 3 9"


def test_case() -> None:
    lines = ["FOR i = 1 TO 5", "CASE i OF", "VALUE 1, 3:", 'TYPE /S, "a"', "VALUE 1 + 3:", 'TYPE /S, "b"', "ANY",
             'TYPE /S, "c"', "END", "END"]  # fmt: skip
    assert run(*lines) == "acabc"
    assert run("CASE 7 OF", "VALUE 1:", "TYPE 1", "END", "TYPE 2") == " 2\n"
    assert run('$s = "go"', "CASE $s OF", 'VALUE "stop", "go":', "TYPE 1", "END") == " 1\n"
    assert run("CASE TRUE OF", "VALUE 1 > 2:", "TYPE 1", "VALUE 2 > 1:", "TYPE 2", "END") == " 2\n"


def test_goto() -> None:
    assert run("i = 0", "10 i = i + 1", "IF i < 3 GOTO 10", "GOTO 20", "TYPE 1", "20 TYPE i") == " 3\n"


def test_goto_out_of_loops_and_into_a_while() -> None:
    out = ["FOR i = 1 TO 9", "WHILE TRUE DO", "IF i == 2 GOTO 10", "EXIT", "END", "END", "10 TYPE i"]
    assert run(*out) == " 2\n"
    assert run("i = 1", "GOTO 5", "WHILE i < 3 DO", "5 TYPE /S, i", "i = i + 1", "END") == " 1 2"


def test_goto_into_a_for_is_an_error_at_its_end() -> None:
    error = failure(body("i = 1", "GOTO 5", "FOR i = 1 TO 3", "5 TYPE i", "END"))
    assert (error.what, error.step) == ("Control structure error", 5)


def test_a_broken_structure_is_said_before_anything_runs() -> None:
    rig = Rig()
    rig.load(body("TYPE 1", "IF TRUE THEN"))
    with pytest.raises(ValError, match=r"\*Control structure error\*"):
        rig.controller.execute("main", now=0.0)
    assert not rig.controller.running
    assert rig.arm.asked == []


def test_arguments_are_by_reference_and_expressions_by_value() -> None:
    text = """
.PROGRAM main()
 x = 1
 a[4] = 10
 $s = "a"
 SET p = NULL
 CALL change(x, a[4], x + 1, $s, p, new)
 TYPE x, a[4], $s, DX(p), new
.END
.PROGRAM change(u, v, w, $t, q, n)
 u = u + 1
 v = v * 2
 w = 99
 $t = $t + "b"
 SET q = TRANS(5)
 n = 7
.END
"""
    assert Rig().run(text) == " 2 20ab 5 7\n"


def test_arrays_are_passed_whole() -> None:
    text = """
.PROGRAM main()
 a[1] = 1
 CALL fill(a[], 3)
 TYPE a[1], a[2], a[3], LAST(a[])
.END
.PROGRAM fill(b[], n)
 AUTO i
 FOR i = 2 TO n
  b[i] = b[i-1] * 2
 END
 CALL less(b[])
.END
.PROGRAM less(c[])
 c[1] = c[1] - 1
.END
"""
    assert Rig().run(text) == " 0 2 4 3\n"


def test_arguments_that_are_left_out_are_unset() -> None:
    text = ".PROGRAM main()\n CALL f(, 2)\n CALL f(1)\n.END\n.PROGRAM f(a, b)\n TYPE DEFINED(a), DEFINED(b)\n.END\n"
    assert Rig().run(text) == " 0 -1\n -1 0\n"


def test_wrong_arguments() -> None:
    callee = ".PROGRAM f(a)\n.END\n"
    assert failure(".PROGRAM main()\n CALL f(1,2)\n.END\n" + callee).what == "Too many arguments"
    assert failure('.PROGRAM main()\n CALL f("a")\n.END\n' + callee).what == "Variable type mismatch"


def test_a_missing_program_says_where() -> None:
    error = failure(body("x = 1", "  CALL nowhere(1)"))
    assert error.what == "Undefined program name"
    assert str(error) == "*Undefined program name* nowhere, program main, step 2, column " + str(error.place.column)
    assert error.place.column >= 3


def test_recursion_with_names_of_its_own() -> None:
    text = """
.PROGRAM main()
 CALL hanoi(5, 1, 3, 2)
 TYPE moves
 CALL fact(10, f)
 TYPE f
.END
.PROGRAM hanoi(n, from, to, via)
 IF n == 1 THEN
  IF NOT DEFINED(moves) THEN
   moves = 0
  END
  moves = moves + 1
  RETURN
 END
 CALL hanoi(n-1, from, via, to)
 CALL hanoi(1, from, to, via)
 CALL hanoi(n-1, via, to, from)
.END
.PROGRAM fact(n, r)
 AUTO s
 IF n <= 1 THEN
  r = 1
 ELSE
  CALL fact(n-1, s)
  r = n * s
 END
.END
"""
    assert Rig().run(text) == " 31\n 3628800\n"


def test_recursion_is_bounded() -> None:
    rig = Rig()
    with pytest.raises(ValError, match=r"\*Too many calls\*.*program deeper, step 2") as raised:
        rig.run(".PROGRAM main()\n CALL deeper()\n.END\n.PROGRAM deeper()\n n[0] = 1\n CALL deeper()\n.END\n")
    assert raised.value.step == 2
    assert len(rig.controller.status().stack) == MOST_CALLS


def test_auto_is_of_the_call_and_local_of_the_program() -> None:
    text = """
.PROGRAM main()
 x = 1
 y = 1
 CALL f()
 CALL f()
 TYPE x, y
.END
.PROGRAM f()
 AUTO x
 LOCAL y
 IF NOT DEFINED(y) THEN
  y = 10
 END
 y = y + 1
 TYPE DEFINED(x), y
 x = 5
.END
"""
    assert Rig().run(text) == " 0 11\n 0 12\n 1 1\n"


def test_auto_arrays_are_given_back() -> None:
    text = ".PROGRAM main()\n FOR i = 1 TO 300\n  CALL f()\n END\n.END\n.PROGRAM f()\n AUTO a[1000]\n AUTO j\n"
    text += " FOR j = 1 TO 400\n  a[j] = j\n END\n.END\n"
    assert Rig().run(text) == ""


def test_gosub_and_return() -> None:
    assert (
        Rig().run(".PROGRAM main()\n GOSUB f\n TYPE 2\n.END\n.PROGRAM f\n TYPE 1\n RETURN\n TYPE 9\n.END\n")
        == " 1\n 2\n"
    )


def test_a_changed_program_is_compiled_anew() -> None:
    rig = Rig()
    rig.run(body("TYPE 1"))
    rig.run(body("TYPE 2"))
    assert rig.typed() == " 1\n 2\n"


def test_an_error_names_program_step_and_column_and_nothing_is_half_done() -> None:
    rig = Rig()
    with pytest.raises(ValError) as raised:
        rig.run(body("x = 1", "MOVET NULL, x + y"))
    assert str(raised.value) == "*Undefined value* y, program main, step 2, column 17"
    assert rig.arm.names() == ["begin_program"]
    rig = Rig()
    with pytest.raises(ValError, match="Illegal digital signal"):
        rig.run(body("SIGNAL 1, 999"))
    assert not rig.when(SignalChanged)


def test_what_is_wrong_behind_the_program_s_way_doesnt_matter() -> None:
    assert run("IF FALSE THEN", "$s = 3", "END", "TYPE 1") == " 1\n"


def test_an_error_stops_the_program_and_it_goes_on_after_a_mend() -> None:
    rig = Rig()
    with pytest.raises(ValError, match="Undefined value"):
        rig.run(body("TYPE 1", "TYPE x", "TYPE 3"))
    assert rig.controller.status().state is ProgramState.PAUSED
    assert rig.controller.status().step == 2
    rig.do("x = 2")
    rig.controller.retry(now=rig.now)
    rig.advance()
    assert rig.typed() == " 1\n 2\n 3\n"


def test_proceed_after_an_error_goes_on_behind_it() -> None:
    rig = Rig()
    with pytest.raises(ValError, match="Undefined value"):
        rig.run(body("TYPE 1", "TYPE x", "TYPE 3"))
    rig.controller.proceed(now=rig.now)
    rig.advance()
    assert rig.typed() == " 1\n 3\n"


def test_a_motion_that_is_refused_later_stops_the_program_at_it() -> None:
    arm = FakeArm(latency=0.2)
    arm.refuse = ValError("Location out of range")
    rig = Rig(arm)
    with pytest.raises(ValError, match=r"\*Location out of range\*, program main, step 1"):
        rig.run(body("MOVE NULL", "TYPE 1"))
    assert rig.when(ProgramFailed)[0][0] == 0.2
