"""Programs: control flow, calls, motion, waiting, dialogue and commands, in virtual time."""

from __future__ import annotations

import math
import time

import pytest

from interfaces.val2.controller import STATEMENT
from interfaces.val2.errors import ValError
from interfaces.val2.events import Asked, Ended, Failed, Paused, SignalChanged, Warned
from interfaces.val2.interpreter import MOST_CALLS, State
from interfaces.val2.syntax import Variable
from interfaces.val2.values import PrecisionPoint
from tests.interfaces.val2.rig import READY, FakeArm, Rig, body, run


def failure(text: str) -> ValError:
    """The error that stops a program."""
    with pytest.raises(ValError) as raised:
        Rig().run(text)
    return raised.value


# Control.


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


# Calls.


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


# Errors.


def test_an_error_names_program_step_and_column_and_nothing_is_half_done() -> None:
    rig = Rig()
    with pytest.raises(ValError) as raised:
        rig.run(body("x = 1", "MOVET NULL, x + y"))
    assert str(raised.value) == "*Undefined value* y, program main, step 2, column 17"
    assert rig.arm.names() == ["begin_program"]
    rig = Rig()
    with pytest.raises(ValError, match="Illegal digital signal"):
        rig.run(body("SIGNAL 1, 99"))
    assert not rig.when(SignalChanged)


def test_what_is_wrong_behind_the_program_s_way_doesnt_matter() -> None:
    assert run("IF FALSE THEN", "$s = 3", "END", "TYPE 1") == " 1\n"


def test_an_error_stops_the_program_and_it_goes_on_after_a_mend() -> None:
    rig = Rig()
    with pytest.raises(ValError, match="Undefined value"):
        rig.run(body("TYPE 1", "TYPE x", "TYPE 3"))
    assert rig.controller.status().state is State.PAUSED
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
    assert rig.when(Failed)[0][0] == 0.2


# Motion and waiting.

TWO_MOVES = ("SET a = TRANS(100)", "SET b = TRANS(200)", "MOVE a", "SIGNAL 1", "MOVE b", "SIGNAL 2")


@pytest.mark.parametrize("latency", [0.0, 0.25])
def test_forward_processing(latency: float) -> None:
    rig = Rig(FakeArm(latency=latency))
    rig.run(body(*TWO_MOVES))
    changes = [(t, e.number) for t, e in rig.when(SignalChanged)]
    assert changes == [(pytest.approx(latency, abs=1e-3), 1), (pytest.approx(latency + 1.0, abs=1e-3), 2)]
    first, second = (a.t for a in rig.arm.asked if a.what == "move")
    assert first == 0.0
    assert second == pytest.approx(latency, abs=1e-3)
    assert rig.when(Ended)[0][0] == pytest.approx(latency + 2.0, abs=1e-3)


def test_break_waits_for_the_arm() -> None:
    rig = Rig()
    rig.run(body("MOVE TRANS(100)", "TYPE DX(HERE), DX(DEST)", "BREAK", "TYPE DX(HERE)"))
    assert rig.typed() == " 0 100\n 100\n"
    assert rig.now == pytest.approx(1.0)


@pytest.mark.parametrize("word", ["OPENI", "CLOSEI", "RELAXI", "TOOL NULL", "BASE 1,2,3,4"])
def test_what_breaks(word: str) -> None:
    rig = Rig()
    rig.run(body("MOVE TRANS(1)", word))
    assert rig.arm.asked[-1].t == pytest.approx(1.0) or rig.arm.asked[-1].what.startswith("set_")
    assert rig.now >= 1.0


def test_a_configuration_lets_the_next_motion_begin_at_rest() -> None:
    rig = Rig()
    rig.run(body("MOVE TRANS(1)", "LEFTY", "SIGNAL 1", "MOVE TRANS(2)"))
    assert [t for t, _ in rig.when(SignalChanged)] == [0.0]
    assert [a.t for a in rig.arm.asked if a.what == "move"] == [0.0, pytest.approx(1.0)]


def test_motions_and_settings_reach_the_arm() -> None:
    rig = Rig()
    rig.run(
        body(
            "SPEED 50 ALWAYS", "SPEED 30, 20 MMPS", "SPEED 80 MONITOR", "ACCEL 50", "DURATION 2", "COARSE",
            "FINE 20 ALWAYS", "NONULL", "OPEN", "MOVES TRANS(1)", "MOVET #PPOINT(1), 30", "MOVEST NULL, TRUE",
            "APPRO NULL, 50",
            "APPROS NULL, -50", "DEPART 10", "DEPARTS 20", "DRIVE 3, 40, 50", "DRAW 1,,3", "READY", "NEST", "ALIGN",
            "DELAY 0.5", "RIGHTY", "DISABLE CP", "ENABLE DRY.RUN", "AT 99", "ALTER (0) 3", "ALTOUT 1,2", "NOALTER",
            "BRAKE",
        )
    )  # fmt: skip
    asked = [(a.what, *a.values) for a in rig.arm.asked]
    for expected in [
        ("set_speed", 50.0, None, "%", True), ("set_speed", 30.0, 20.0, "MMPS", False), ("set_monitor_speed", 80.0),
        ("set_acceleration", 50.0, 50.0), ("set_duration", 2.0, False), ("set_tolerance", None, False, False),
        ("set_tolerance", 20.0, True, True), ("set_nulling", False, False), ("set_hand", True),
        ("appros", *asked[13][1:2], -50.0), ("depart", 10.0), ("departs", 20.0), ("drive", 3, 40.0, 50.0),
        ("draw", 1.0, 0.0, 3.0), ("ready",), ("nest",), ("align",), ("delay", 0.5), ("set_configuration", "RIGHTY"),
        ("set_continuous_path", False), ("set_dry_run", True), ("at", 99.0), ("set_alter", 3),
        ("alter", 1.0, 2.0, 0.0, 0.0, 0.0, 0.0), ("set_alter", None), ("brake",),
    ]:  # fmt: skip
        assert expected in asked
    hands = [a.values[1] for a in rig.arm.asked if a.what in {"move", "moves"}]
    assert hands == [None, 30.0, True]
    assert PrecisionPoint((1.0, 0.0, 0.0, 0.0, 0.0, 0.0)) in [a.values[0] for a in rig.arm.asked if a.values]


def test_a_time_before_a_motion_is_for_that_one() -> None:
    rig = Rig()
    rig.run(body("t = 3", "AT t+1.5 MOVE #PPOINT(1)", "AT 9 DRIVE 2, 5, 50"))
    assert [(a.what, a.values[0]) for a in rig.arm.asked if a.what in {"at", "drive"}] == [
        ("at", 4.5), ("at", 9.0), ("drive", 2),
    ]  # fmt: skip


def test_a_time_is_taken_back_with_its_motion() -> None:
    rig = Rig()

    def refuse(*_, **__) -> None:
        raise ValError("Location out of range")

    rig.arm.move = refuse
    with pytest.raises(ValError, match="out of range"):
        rig.run(body("AT 4 MOVE NULL"))
    assert [a.values for a in rig.arm.asked if a.what == "at"] == [(4.0,), (None,)]


def test_a_joint_that_doesnt_exist() -> None:
    assert failure(body("DRIVE 7, 10, 50")).what == "Illegal joint number"


def test_without_power_nothing_moves() -> None:
    assert failure(body("TYPE 1", "DISABLE POWER", "MOVE NULL")).what == "Arm power off"


def test_here_records_the_arm_and_the_last_part_of_a_compound() -> None:
    rig = Rig()
    rig.run(body("SET a = TRANS(100,0,0,0,0,0)", "MOVE TRANS(100,50)", "BREAK", "HERE p", "HERE #q", "HERE a:b",
                 "TYPE DISTANCE(a:b, HERE), DX(p), DY(p)", "SET t = HERE", "SET #u = #HERE"))  # fmt: skip
    distance, x, y = (float(v) for v in rig.typed().split())
    assert (distance, x, y) == (pytest.approx(0.0, abs=1e-9), 100.0, 50.0)
    assert rig.value("#q") == rig.value("#u") == READY
    assert rig.value("t") == rig.value("p")


def test_grasp_goes_to_its_label_or_fails_where_nothing_is_held() -> None:
    assert run("GRASP 20, 10", "TYPE 1", "STOP", "10 TYPE 2") == " 2\n"
    assert failure(body("GRASP 20")).what == "Nothing in the hand"
    assert run("GRASP 0, 10", "TYPE 1", "STOP", "10 TYPE 2") == " 1\n"


def test_timers_and_waits() -> None:
    rig = Rig()
    rig.run(body("TIMER 3 = 10", "WAIT TIMER(3) >= 12.5", "TYPE TIMER(3)", "WAIT.EVENT , 1", "WAIT"))
    assert float(rig.typed()) == pytest.approx(12.5, abs=0.017)
    assert rig.now == pytest.approx(3.5, abs=0.05)


def test_delay_is_a_motion() -> None:
    rig = Rig()
    rig.run(body("MOVE NULL", "DELAY 3", "TYPE 1", "BREAK"))
    assert rig.now == pytest.approx(4.0)
    assert rig.arm.asked[-1].t == 0.0


def test_computing_takes_session_time_and_an_endless_loop_comes_to_no_harm() -> None:
    rig = Rig()
    rig.run(body("n = 0", "WHILE TRUE DO", "n = n + 1", "END"), until=1.0)
    assert rig.controller.running
    n = rig.value("n")
    assert isinstance(n, float)
    assert n == pytest.approx(1.0 / STATEMENT / 3, rel=0.01)
    rig.controller.abort(now=rig.now)
    rig.advance()
    assert [e.word for _, e in rig.when(Paused)] == ["ABORT"]


def test_a_late_driver_doesnt_wait_long_for_one_turn() -> None:
    rig = Rig()
    rig.load(body("n = 0", "WHILE TRUE DO", "n = n + 1", "END"))
    rig.controller.execute("main", now=0.0)
    rig.controller.advance(now=0.0)
    n = rig.value("n")
    rig.controller.advance(now=3600.0)
    assert isinstance(n, float)
    assert 0 < rig.value("n") - n < 1000


def test_computing_loops_are_quick() -> None:
    text = body("s = 0", "FOR i = 1 TO 20000", "s = s + i * 2", "IF s > 1E9 THEN", "s = 0", "END", "END")
    best = math.inf
    for _ in range(3):
        rig = Rig()
        rig.load(text)
        rig.controller.execute("main", now=0.0)
        begin = time.perf_counter()
        rig.advance()
        best = min(best, time.perf_counter() - begin)
    assert 80_000 / best > 100_000


# Dialogue.


def test_prompt_asks_until_the_answer_is_right() -> None:
    rig = Rig()
    rig.run(body('PROMPT "Two? ", a, b[1]', "TYPE a + b[1]", 'PROMPT "Name? ", $n', 'TYPE "<", $n, ">"', "PROMPT"))
    for line in ("5", "5, x", "1,2,3", "5, 6\r\n", " Ann, B ", ""):
        assert rig.controller.asking
        rig.controller.answer(line, now=rig.now)
        rig.advance()
    assert not rig.controller.asking
    assert [e.text for _, e in rig.when(Asked)] == ["Two? "] * 4 + ["Name? ", ""]
    assert rig.typed().count("*Illegal value*") == 3
    assert rig.typed().endswith(" 11\n< Ann, B >\n")
    assert rig.when(Ended)


def test_prompt_of_numbers_and_a_string() -> None:
    rig = Rig()
    rig.run(body('PROMPT "?", x, $s', 'TYPE x, "|", $s'))
    rig.controller.answer("3.5 a b, c", now=rig.now)
    rig.advance()
    assert rig.typed() == " 3.5|a b, c\n"


def test_an_answer_without_a_question() -> None:
    with pytest.raises(ValError, match="No program asks"):
        Rig().controller.answer("1", now=0.0)


def test_abort_while_it_asks() -> None:
    rig = Rig()
    rig.run(body('PROMPT "?", x', "TYPE 1"))
    rig.controller.abort(now=rig.now)
    rig.advance()
    assert not rig.controller.asking
    rig.controller.retry(now=rig.now)
    rig.advance()
    assert [e.text for _, e in rig.when(Asked)] == ["?", "?"]


def test_what_has_no_meaning_is_a_warning_once() -> None:
    rig = Rig()
    rig.run(body("FOR i = 1 TO 3", "ATTACH (1)", "END", "TYPE 1"))
    (warning,) = (e for _, e in rig.when(Warned))
    assert warning == Warned("ATTACH has no meaning here: program main, step 2")


# Commands.


def test_cycles() -> None:
    rig = Rig()
    rig.run(body("TYPE 1", "STOP", "TYPE 2"), cycles=3)
    assert rig.typed() == " 1\n" * 3
    assert [e for _, e in rig.when(Ended)] == [Ended("main", "STOP")]
    assert rig.arm.names().count("begin_program") == 3
    rig = Rig()
    rig.run(body("n = 0", "MOVE NULL"), cycles=-1, until=9.5)
    assert rig.arm.names().count("move") == 10
    rig = Rig()
    rig.run(body("TYPE 1", "HALT"), cycles=-1)
    assert rig.typed() == " 1\n"


def test_pause_and_proceed() -> None:
    rig = Rig()
    rig.run(body("MOVE NULL", "TYPE 1", "PAUSE", "TYPE 2"))
    assert rig.when(Paused) == [(pytest.approx(1.0), Paused("main", 4, "PAUSE"))]
    status = rig.controller.status()
    assert (status.state, status.program, status.step, status.word) == (State.PAUSED, "main", 4, "PAUSE")
    rig.controller.proceed(now=rig.now)
    rig.advance()
    assert rig.typed() == " 1\n 2\n"
    with pytest.raises(ValError, match="No program to proceed"):
        rig.controller.proceed(now=rig.now)


def test_abort_brakes_and_retry_asks_for_the_motion_again() -> None:
    rig = Rig()
    rig.run(body("MOVE TRANS(100)", "BREAK", "TYPE DX(HERE)"), until=0.4)
    rig.controller.abort(now=rig.now)
    rig.advance()
    assert rig.arm.names()[-1] == "brake"
    assert rig.typed() == ""
    rig.controller.retry(now=rig.now)
    rig.advance()
    assert rig.arm.names()[-1] == "retry"
    assert rig.typed() == " 100\n"
    assert rig.now == pytest.approx(1.4, abs=0.01)


def test_proceed_after_an_abort_gives_up_the_step() -> None:
    rig = Rig()
    rig.run(body("MOVE TRANS(100)", "BREAK", "TYPE DX(HERE)"), until=0.4)
    rig.controller.abort(now=rig.now)
    rig.controller.proceed(now=rig.now)
    rig.advance()
    assert rig.typed() == " 0\n"


def test_abort_between_steps_gives_up_none() -> None:
    rig = Rig()
    rig.run(body("n = 0", "WHILE n < 100000 DO", "n = n + 1", "END", "TYPE n"), until=0.1)
    rig.controller.abort(now=rig.now)
    rig.controller.proceed(now=rig.now)
    rig.advance()
    assert rig.typed() == " 100000\n"


def test_single_steps() -> None:
    rig = Rig()
    rig.load(".PROGRAM main()\n x = 1\n CALL f()\n MOVE NULL\n TYPE x\n.END\n.PROGRAM f()\n x = 2\n.END\n")
    rig.controller.xstep("main", now=0.0)
    rig.advance()
    steps = []
    while rig.controller.status().state is State.PAUSED:
        steps.append((rig.controller.status().program, rig.controller.status().step))
        rig.controller.xstep(now=rig.now)
        rig.advance()
    assert steps[:3] == [("main", 2), ("f", 1), ("f", 1)]
    assert rig.typed() == " 2\n"
    assert rig.when(Ended)


def test_do() -> None:
    rig = Rig()
    rig.do("MOVE TRANS(7)")
    assert rig.now == pytest.approx(1.0)
    rig.do("TYPE DX(HERE)")
    assert rig.typed() == " 7\n"
    assert [e for _, e in rig.when(Ended)] == [Ended("", "DO")] * 2
    rig.do("TYPE nothing")
    (failed,) = (e for _, e in rig.when(Failed))
    assert (failed.error.what, failed.error.detail, failed.error.place.column) == ("Undefined value", "nothing", 6)
    for line in ("IF TRUE THEN", "GOTO 5", "FOR i = 1 TO 2", "RETURN"):
        with pytest.raises(ValError, match="Control structure error"):
            rig.do(line)


def test_do_while_a_program_runs() -> None:
    rig = Rig()
    rig.run(body("x = 0", "WAIT x == 3", "TYPE 1"), until=2.0)
    for line in ("MOVE NULL", "BREAK", "CALL main()"):
        with pytest.raises(ValError, match="Program already running"):
            rig.do(line)
    with pytest.raises(ValError, match="Program already running"):
        rig.controller.execute("main", now=rig.now)
    rig.do("x = 3")
    rig.advance()
    assert rig.typed() == " 1\n"
    assert rig.now == pytest.approx(2.0, abs=0.001)


def test_do_between_pause_and_proceed_leaves_the_program_alone() -> None:
    rig = Rig()
    rig.run(body("x = 1", "PAUSE", "TYPE x"))
    rig.do("x = 2")
    rig.do("DEPART 5")
    rig.controller.proceed(now=rig.now)
    rig.advance()
    assert rig.typed() == " 2\n"


def test_execute_with_arguments_and_a_first_step() -> None:
    rig = Rig()
    rig.load(".PROGRAM f(a, b)\n TYPE 0\n a = a + b\n.END\n")
    rig.controller.memory.set(Variable("x"), 1.0)
    rig.controller.execute("f", (Variable("x"), Variable("x")), step=2, now=0.0)
    rig.advance()
    assert rig.value("x") == 2.0
    assert rig.typed() == ""
    with pytest.raises(ValError, match="Invalid step"):
        rig.controller.execute("f", step=9, now=rig.now)
    with pytest.raises(ValError, match="Undefined program name"):
        rig.controller.execute("g", now=rig.now)


def test_zero_forgets_everything() -> None:
    rig = Rig()
    rig.run(body("x = 1", "a[1] = 2", "SIGNAL 3"))
    rig.controller.forget()
    assert rig.controller.memory.programs == {}
    assert list(rig.controller.memory.variables()) == []
    assert rig.value("SIG(3)") == 0.0
    rig.run(body("SET x = NULL", 'TYPE "ok"'))
    assert rig.typed() == "ok\n"


def test_parameters_have_ranges() -> None:
    rig = Rig()
    rig.run(body("PARAMETER HAND.TIME = 0.2"))
    assert rig.controller.parameters["HAND.TIME"] == 0.2
    assert failure(body("PARAMETER HAND.TIME = -1")).what == "Illegal value"


def test_messages_off_types_nothing() -> None:
    assert run("TYPE 1", "DISABLE MESSAGES", "TYPE 2", "ENABLE MESSAGES", "TYPE 3") == " 1\n 3\n"


def test_an_idle_controller_wants_nothing() -> None:
    rig = Rig()
    assert rig.controller.next_deadline() == math.inf
    assert rig.controller.advance(now=5.0) == ()
