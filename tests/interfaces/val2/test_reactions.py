"""REACT and REACTI: programs that signals call."""

from __future__ import annotations

import pytest

from interfaces.val2.context import ProgramEnded, ProgramState
from interfaces.val2.errors import ValError
from interfaces.val2.signals import Reaction, Reactions
from tests.interfaces.val2.rig import FakeArm, Rig, body

ALARM = ".PROGRAM alarm()\n TYPE TIMER(0)\n.END\n"


def at(t: float, *more: tuple[float, int]) -> str:
    """A cell that pulses 1001 at a time, and other signals."""
    pulses = [(t, 1001), *more]
    lines = [f"{n} = {value} AT {u + later:g}" for u, n in pulses for value, later in (("ON", 0.0), ("OFF", 0.01))]
    return "\n".join([".SIGNALS", *lines, ".END", ""])


def times(rig: Rig) -> list[float]:
    """The numbers that were typed."""
    return [float(t) for t in rig.typed().split()]


def test_react_comes_after_the_present_step() -> None:
    rig = Rig()
    rig.run(body("REACT 1001, alarm", "MOVE TRANS(1)", "BREAK", "TYPE 99") + ALARM + at(0.4))
    assert times(rig) == [pytest.approx(1.0, abs=1e-3), 99.0]
    assert "brake" not in rig.arm.names()


def test_react_comes_amid_a_wait_which_goes_on() -> None:
    rig = Rig()
    rig.run(body("REACT 1001, alarm", "WAIT SIG(1002)", "TYPE TIMER(0)") + ALARM + at(1.0, (3.0, 1002)))
    assert times(rig) == [pytest.approx(1.0, abs=1e-3), pytest.approx(3.0, abs=1e-3)]


def test_react_comes_amid_computing() -> None:
    rig = Rig()
    rig.run(body("REACT 1001, alarm", "n = 0", "WHILE n < 500000 DO", "n = n + 1", "END") + ALARM + at(1.0))
    assert times(rig) == [pytest.approx(1.0, abs=3e-3)]


def test_reacti_brakes_at_once() -> None:
    rig = Rig()
    rig.run(
        body("REACTI 1001, alarm", "MOVE TRANS(50)", "MOVE TRANS(100)", "BREAK", "TYPE DX(HERE)") + ALARM + at(0.4)
    )
    braked = next(a.t for a in rig.arm.asked if a.what == "brake")
    assert braked == pytest.approx(0.4)
    assert times(rig) == [pytest.approx(0.4, abs=1e-3), 100.0]


def test_reacti_gives_up_the_motion_under_way_and_the_next_one_is_asked_anew() -> None:
    rig = Rig()
    rig.run(body("REACTI 1001, alarm", "MOVE TRANS(50)", "MOVE TRANS(100)", "TYPE DX(DEST)") + ALARM + at(0.4))
    assert times(rig) == [pytest.approx(0.4, abs=1e-3), 100.0]
    assert [round(a.t, 2) for a in rig.arm.asked if a.what == "move"] == [0.0, 0.0, 0.4]
    assert rig.when(ProgramEnded)[0][0] == pytest.approx(1.4, abs=1e-2)


@pytest.mark.parametrize("word", ["REACT", "REACTI"])
def test_locked_reactions_wait_for_lock_0(word: str) -> None:
    rig = Rig()
    rig.run(
        body(f"{word} 1001, alarm", "LOCK 10", "WAIT.EVENT , 2", "TYPE 99", "LOCK 0", "TYPE 98") + ALARM + at(1.0)
    )
    assert times(rig) == [99.0, pytest.approx(2.0, abs=1e-2), 98.0]


def test_a_lock_ends_with_the_reaction_that_it_was_said_in_and_with_the_program() -> None:
    rig = Rig()
    locking = ".PROGRAM first()\n LOCK 5\n TYPE 1\n.END\n"
    more = ["REACT 1001, first", "REACT 1002, alarm", "WAIT.EVENT , 3", "LOCK 1"]
    rig.run(body(*more) + ALARM + locking + at(1.0, (2.0, 1002)))
    assert times(rig) == [1.0, pytest.approx(2.0, abs=1e-2)]
    assert rig.controller.reactions.priority == 0


def test_a_priority_isnt_negative() -> None:
    with pytest.raises(ValError, match=r"^\*Illegal value\* -1: a priority is 0 or above"):
        Rig().run(body("LOCK -1"))


def test_a_reaction_is_done_once_or_always() -> None:
    rig = Rig()
    rig.run(body("REACT 1001, alarm", "WAIT.EVENT , 5") + ALARM + at(1.0, (2.0, 1001)))
    assert len(times(rig)) == 1
    rig = Rig()
    rig.run(body("REACT 1001, alarm ALWAYS", "WAIT.EVENT , 5") + ALARM + at(1.0, (2.0, 1001)))
    assert times(rig) == [pytest.approx(1.0, abs=1e-3), pytest.approx(2.0, abs=1e-3)]


def test_it_s_the_turning_that_counts() -> None:
    rig = Rig()
    rig.controller.signals.force(1001)
    rig.run(body("REACT 1001, alarm", "WAIT.EVENT , 1") + ALARM)
    assert times(rig) == []


def test_reactions_to_turning_off() -> None:
    rig = Rig()
    rig.run(body("REACT -1001, alarm", "WAIT.EVENT , 5") + ALARM + at(1.0))
    assert times(rig) == [pytest.approx(1.01, abs=1e-3)]


def test_ignore() -> None:
    rig = Rig()
    rig.run(body("REACT 1001, alarm ALWAYS", "WAIT.EVENT , 1.5", "IGNORE 1001", "WAIT.EVENT , 5") + ALARM
            + at(1.0, (2.0, 1001)))  # fmt: skip
    assert times(rig) == [pytest.approx(1.0, abs=1e-3)]


def test_what_turned_waits_once_and_is_forgotten_with_ignore() -> None:
    watched = Reactions()
    watched.add(Reaction(1001, "alarm", immediate=False, always=True))
    for on in (True, False, True):
        watched.notice(1001, on)
    due = watched.due()
    assert due is not None
    assert due.program == "alarm"
    assert watched.due() is None
    watched.notice(1001, on=True)
    watched.ignore(-1001)
    assert watched.due() is None


def test_a_program_reacts_to_its_own_signals() -> None:
    rig = Rig()
    rig.run(body("REACT 1, alarm", "SIGNAL 1", "TYPE 99") + ALARM)
    assert times(rig) == [pytest.approx(0.0, abs=1e-3), 99.0]


def test_reactions_wait_for_each_other_but_reacti_doesnt() -> None:
    text = (
        body("REACT 1001, slow", "REACT 1002, slow2", "REACTI 1003, alarm", "WAIT.EVENT , 5", "TYPE 99")
        + ".PROGRAM slow()\n TYPE 1\n WAIT.EVENT , 2\n TYPE 2\n.END\n.PROGRAM slow2()\n TYPE 3\n.END\n"
        + ALARM
    )
    rig = Rig()
    rig.run(text + at(0.5, (1.0, 1002), (1.5, 1003)))
    assert times(rig) == [1.0, pytest.approx(1.5, abs=1e-3), 2.0, 3.0, 99.0]


def test_without_a_program_it_returns_from_the_one_that_runs() -> None:
    text = body("CALL loop()", "TYPE 99") + ".PROGRAM loop()\n REACT 1001\n WHILE TRUE DO\n  WAIT\n END\n.END\n"
    rig = Rig()
    rig.run(text + at(1.0))
    assert times(rig) == [99.0]
    assert rig.now == pytest.approx(1.0, abs=0.02)
    rig = Rig()
    rig.run(body("REACTI 1001", "MOVE NULL", "BREAK", "TYPE 99") + at(0.3))
    assert times(rig) == []
    assert [e.word for _, e in rig.when(ProgramEnded)] == ["END"]
    assert rig.when(ProgramEnded)[0][0] == pytest.approx(0.3, abs=1e-3)


def test_a_reaction_may_end_or_stop_the_program() -> None:
    rig = Rig()
    rig.run(
        body("REACTI 1001, stop", "MOVE NULL", "BREAK", "TYPE 99") + ".PROGRAM stop()\n HALT\n.END\n" + at(0.3),
        cycles=5,
    )
    assert times(rig) == []
    assert [e.word for _, e in rig.when(ProgramEnded)] == ["HALT"]


def test_a_reaction_moves_and_the_program_goes_on() -> None:
    text = body("REACTI 1001, away", "MOVE TRANS(1)", "MOVE TRANS(2)", "BREAK", "TYPE DX(HERE)")
    rig = Rig()
    rig.run(text + ".PROGRAM away()\n MOVE TRANS(500)\n BREAK\n TYPE DX(HERE)\n.END\n" + at(0.5))
    assert times(rig) == [500.0, 2.0]
    rig = Rig(FakeArm(latency=0.1))
    rig.run(text + ".PROGRAM away()\n TYPE 7\n.END\n" + at(1.5))
    assert times(rig) == [7.0, 1.0]


def test_a_missing_program_is_said_at_the_react() -> None:
    with pytest.raises(ValError, match=r"\*Undefined program name\* nowhere, program main, step 1"):
        Rig().run(body("REACT 1001, nowhere"))
    with pytest.raises(ValError, match="Illegal digital signal"):
        Rig().run(body("REACT 5000"))


def test_an_error_in_a_reaction_stops_the_program_there() -> None:
    rig = Rig()
    with pytest.raises(ValError, match=r"\*Undefined value\* x, program bad, step 1"):
        rig.run(body("REACT 1001, bad", "WAIT.EVENT , 5") + ".PROGRAM bad()\n TYPE x\n.END\n" + at(1.0))
    assert rig.controller.status().state is ProgramState.PAUSED
    assert rig.controller.status().stack == (("main", 2), ("bad", 1))
    rig.controller.proceed(now=rig.now)
    rig.advance()
    assert rig.when(ProgramEnded)
    assert rig.now == pytest.approx(5.0, abs=1e-3)


def test_reactions_end_with_the_program() -> None:
    rig = Rig()
    rig.run(body("REACTI 1001, alarm") + ALARM)
    rig.controller.signals.force(1001)
    rig.advance()
    assert "brake" not in rig.arm.names()


def test_a_reaction_waits_for_one_of_a_higher_priority_and_comes_into_one_of_a_lower() -> None:
    text = (
        body("REACT 1001, slow, 5", "REACT 1002, alarm, 6", "REACT 1003, last, 4", "WAIT.EVENT , 5", "TYPE 99")
        + ".PROGRAM slow()\n TYPE 1\n WAIT.EVENT , 2\n TYPE 2\n.END\n.PROGRAM last()\n TYPE 3\n.END\n"
        + ALARM
    )
    rig = Rig()
    rig.run(text + at(0.5, (1.0, 1003), (1.5, 1002)))
    assert times(rig) == [1.0, pytest.approx(1.5, abs=1e-3), 2.0, 3.0, 99.0]


def test_lock_lets_pass_what_has_a_higher_priority() -> None:
    rig = Rig()
    rig.run(body("REACT 1001, alarm, 11", "LOCK 10", "WAIT.EVENT , 2", "TYPE 99") + ALARM + at(1.0))
    assert times(rig) == [pytest.approx(1.0, abs=1e-3), 99.0]


TRAP = ".PROGRAM trap()\n TYPE $ERROR()\n RETURNE\n.END\n"


def test_an_error_calls_what_reacte_names_and_the_program_goes_on_with_the_next_step() -> None:
    rig = Rig()
    rig.run(body("REACTE trap", "x = 1 / 0", "n = missing", "CALL other()", "TYPE 99") + TRAP
            + ".PROGRAM other()\n SIGNAL 3000\n TYPE 98\n.END\n")  # fmt: skip
    assert rig.typed().splitlines() == [
        "*Division by zero*", "*Undefined value* missing",
        "*Illegal digital signal* 3000; allowed: 1 to 512, 2001 to 2512", " 98", " 99",
    ]  # fmt: skip


def test_a_place_out_of_reach_is_an_error_that_reacte_knows() -> None:
    rig = Rig()
    rig.run(body("REACTE trap", "PARAMETER VPLUS = 2", "MOVE TRANS(1)", "BREAK", "TYPE DX(HERE)") + TRAP)
    assert rig.typed().splitlines() == ["*Illegal value* 2; allowed: VPLUS of 0 to 1", " 1"]


def test_reactions_wait_for_what_reacte_calls() -> None:
    rig = Rig()
    slow = ".PROGRAM trap()\n TYPE 1\n WAIT.EVENT , 2\n TYPE 2\n.END\n"
    rig.run(body("REACTE trap", "REACTI 1001, alarm, 200", "x = missing", "TYPE 99") + slow + ALARM + at(1.0))
    assert times(rig) == [1.0, 2.0, pytest.approx(2.0, abs=1e-2), 99.0]


@pytest.mark.parametrize("ends", ["REACTE", "LOCK 254"])
def test_without_reacte_an_error_stops_the_program_again(ends: str) -> None:
    rig = Rig()
    with pytest.raises(ValError, match=r"\*Undefined value\* missing, program main, step 4"):
        rig.run(body("REACTE trap", "n = missing", ends, "n = missing") + TRAP)
    assert rig.typed() == "*Undefined value* missing\n"


def test_an_error_in_what_reacte_calls_stops_the_program() -> None:
    rig = Rig()
    with pytest.raises(ValError, match=r"\*Undefined value\* x, program trap, step 1"):
        rig.run(body("REACTE trap", "n = missing") + ".PROGRAM trap()\n TYPE x\n.END\n")
    assert rig.controller.status().stack == (("main", 2), ("trap", 1))


def test_errors_without_end_leave_room_for_others() -> None:
    rig = Rig()
    rig.run(body("REACTE trap", "10 n = missing", "IF TIMER(1) < 1 GOTO 10", "TYPE 99")
            + ".PROGRAM trap()\n.END\n")  # fmt: skip
    assert times(rig) == [99.0]
    assert rig.now == pytest.approx(1.0, abs=0.01)


def test_each_task_has_a_reacte_of_its_own() -> None:
    rig = Rig()
    other = ".PROGRAM beside()\n REACTE trap\n n = missing\n TYPE 98\n.END\n"
    with pytest.raises(ValError, match=r"\*Undefined value\* more, program main, step 3"):
        rig.run(body("EXECUTE 2 beside()", "WAIT TASK(1, 2) == 1", "n = more") + other + TRAP)
    assert rig.typed() == "*Undefined value* missing\n 98\n"
