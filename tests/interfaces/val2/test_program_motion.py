"""Motions and waiting in programs: what waits for what, and what reaches the arm; in virtual time."""

from __future__ import annotations

import math
import time

import pytest

from interfaces.val2.context import ProgramEnded, ProgramPaused, SignalChanged
from interfaces.val2.controller import STATEMENT
from interfaces.val2.errors import ValError
from interfaces.val2.values import PrecisionPoint
from tests.interfaces.val2.rig import READY, FakeArm, Rig, body, failure, run

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
    assert rig.when(ProgramEnded)[0][0] == pytest.approx(latency + 2.0, abs=1e-3)


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


def test_the_hand_moves_to_an_opening() -> None:
    rig = Rig()
    rig.run(body("OPEN 75", "CLOSE 20", "OPEN", "CLOSE", "CLOSEI 50", "OPENI 30", "OPENI", "CLOSEI"))
    assert [(a.what, *a.values) for a in rig.arm.asked[1:]] == [
        ("set_hand", 75.0), ("set_hand", 20.0), ("set_hand", True), ("set_hand", False),
        ("actuate", 50.0), ("actuate", 30.0), ("actuate", True), ("actuate", False),
    ]  # fmt: skip


@pytest.mark.parametrize("word", ["OPEN", "CLOSE", "OPENI", "CLOSEI"])
def test_an_opening_isnt_negative(word: str) -> None:
    error = failure(body(f"{word} -5"))
    assert (error.what, error.detail) == ("Illegal value", "-5: an opening is 0 mm or above")


def test_state_of_robot_and_motion() -> None:
    text = [
        "TYPE STATE(1), STATE(2)",
        "MOVE TRANS(1)",
        "TYPE STATE(2)",
        "WAIT STATE(2) == 2",
        "TYPE STATE(1), STATE(2)",
    ]
    assert run(*text) == " 7 0\n 1\n 7 2\n"
    assert run("MOVE TRANS(1)", "BRAKE", "TYPE STATE(2)", "MOVE NULL", "TYPE STATE(2)") == " 6\n 1\n"
    assert run("MOVE TRANS(1)", "BREAK", "BRAKE", "TYPE STATE(2)", "DISABLE POWER", "TYPE STATE(1)") == " 2\n 2\n"
    assert failure(body("x = STATE(4)")).detail == "STATE(4): 1 is of the robot, 2 of its motion"


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
    assert [e.word for _, e in rig.when(ProgramPaused)] == ["ABORT"]


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
