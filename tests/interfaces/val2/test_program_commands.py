"""What a person does with programs: answers, pauses, aborts, single steps, DO; in virtual time."""

from __future__ import annotations

import math

import pytest

from interfaces.val2.context import Asked, ProgramEnded, ProgramFailed, ProgramPaused, ProgramState, Warned
from interfaces.val2.errors import ValError
from interfaces.val2.syntax import Variable
from tests.interfaces.val2.rig import Rig, body, failure, run


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
    assert rig.when(ProgramEnded)


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
    rig.run(body("FOR i = 1 TO 3", "SELECT ROBOT = 1", "END", "TYPE 1"))
    (warning,) = (e for _, e in rig.when(Warned))
    assert warning == Warned("SELECT is passed over: there is one robot, program main, step 2")


def test_cycles() -> None:
    rig = Rig()
    rig.run(body("TYPE 1", "STOP", "TYPE 2"), cycles=3)
    assert rig.typed() == " 1\n" * 3
    assert [e for _, e in rig.when(ProgramEnded)] == [ProgramEnded("main", "STOP")]
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
    assert rig.when(ProgramPaused) == [(pytest.approx(1.0), ProgramPaused("main", 4, "PAUSE"))]
    status = rig.controller.status()
    assert (status.state, status.program, status.step, status.word) == (ProgramState.PAUSED, "main", 4, "PAUSE")
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
    rig.controller.execute("main", single=True, now=0.0)
    rig.advance()
    steps = []
    while rig.controller.status().state is ProgramState.PAUSED:
        steps.append((rig.controller.status().program, rig.controller.status().step))
        rig.controller.proceed(single=True, now=rig.now)
        rig.advance()
    assert steps[:3] == [("main", 2), ("f", 1), ("f", 1)]
    assert rig.typed() == " 2\n"
    assert rig.when(ProgramEnded)


def test_do() -> None:
    rig = Rig()
    rig.do("MOVE TRANS(7)")
    assert rig.now == pytest.approx(1.0)
    rig.do("TYPE DX(HERE)")
    assert rig.typed() == " 7\n"
    assert [e for _, e in rig.when(ProgramEnded)] == [ProgramEnded("", "DO")] * 2
    rig.do("TYPE nothing")
    (failed,) = (e for _, e in rig.when(ProgramFailed))
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
