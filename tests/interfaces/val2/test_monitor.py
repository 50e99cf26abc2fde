"""The monitor: programs that run, motions, signals, switches, and lines of all kinds; in virtual time."""

from __future__ import annotations

import re

import numpy as np
import pytest

from interfaces.val2.monitor.commands import COMMANDS
from interfaces.val2.monitor.monitor import LONGEST, OVERLONG, WAITING

from .sitting import ASK, AWAY, HELLO, LOOP, numbers


def test_execute_types_and_ends(sitting):
    sitting.type(*HELLO)
    sitting.shown = ""
    sitting.line("EXECUTE hello")
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert sitting.shown == "hello\nhello has ended (END)\n"
    sitting.shown = ""
    sitting.line("EX hello,3")
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert sitting.shown.count("hello\n") == 3


def test_the_prompt_is_a_star_while_a_program_runs(sitting):
    sitting.type(*LOOP, "EXECUTE loop")
    assert sitting.monitor.prompt == "*"
    sitting.pass_time(5.0)
    assert sitting.monitor.prompt == "*"
    for line in (
        "EXECUTE loop",
        "DO READY",
        "EDIT loop",
        "ZERO",
        "DELETE loop",
        "TOOL NULL",
        "CALIBRATE",
        "PROCEED",
    ):
        assert re.match(r"\*Program (already )?running\*", sitting.type(line)), line
    for line in (
        "WHERE",
        "STATUS",
        "LISTP",
        "IO",
        "DIRECTORY",
        "SPEED 50",
        "SIGNAL 2",
        "ENABLE CP",
        "FREE",
        "DO x = 1",
    ):
        assert "*Program" not in sitting.type(line), line
    assert "for ever" not in sitting.type("STATUS")
    sitting.type("ABORT")
    assert sitting.monitor.prompt == "."
    assert sitting.type("ABORT").startswith("*No program running*")


def test_arguments_cycles_and_first_step(sitting):
    sitting.type("EDIT add(a, b, c)", "c = a + b", "TYPE c", "E", "DO x = 4", "EXECUTE add(x, 3, y)")
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert sitting.type("LISTR y") == "y = 7\n"
    sitting.line("EXECUTE add(1, 1, y),1,2")
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert sitting.type("LISTR y") == "y = 7\n"
    for line in (
        "EXECUTE add,0",
        "EXECUTE add,-2",
        "EXECUTE add,1,99",
        "EXECUTE add,x",
        "EXECUTE 3",
        "EXECUTE add(1,,2)",
    ):
        assert sitting.type(line).startswith("*"), line
        assert sitting.monitor.prompt == ".", line


def test_the_answer_to_prompt_is_the_next_line(sitting):
    sitting.type(*ASK)
    sitting.line("EXECUTE ask")
    sitting.until(lambda: sitting.monitor.prompt == "n? ")
    sitting.shown = ""
    sitting.line("42")
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert sitting.shown.startswith("n is 42\n")


def test_abort_pause_proceed_retry_and_steps(sitting):
    sitting.type("EDIT p", "x = 1", "PAUSE", "x = 2", "x = 3", "x = 4", "E")
    sitting.line("EXECUTE p")
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert "(PAUSE)" in sitting.shown
    assert "paused" in sitting.type("STATUS")
    sitting.line("NEXT")
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert sitting.type("LISTR x") == "x = 2\n"
    sitting.line("NEXT 2")
    sitting.pass_time(0.1)
    assert sitting.type("LISTR x") == "x = 4\n"
    sitting.line("PROCEED")
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert sitting.type("PROCEED").startswith("*No program to proceed*")
    sitting.line("XSTEP p")
    sitting.pass_time(0.1)
    assert sitting.type("LISTR x") == "x = 1\n"


def test_abort_in_motion_brakes_within_the_limits_and_retry_gets_there(sitting):
    sitting.type("EDIT go", "MOVE TRANS(400,0,200,90,0,0)", "E", "EXECUTE go")
    sitting.pass_time(0.4)
    sitting.type("ABORT")
    braking = np.linspace(sitting.now - 0.4, sitting.now + 2.0, 500)
    sitting.pass_time(3.0)
    limits, timeline = sitting.engine.model.limits, sitting.engine.timeline
    assert np.abs(timeline.sample(braking, derivative=2)).max() > 0.1
    assert (np.abs(timeline.sample(braking, derivative=2)) <= limits.qdd_max * (1 + 1e-9)).all()
    assert (np.abs(timeline.sample(braking, derivative=1)) <= limits.qd_max * (1 + 1e-9)).all()
    stood = sitting.joints()
    assert abs(stood[2] - 90) > 1
    sitting.line("RETRY")
    sitting.until(lambda: sitting.monitor.prompt == ".")
    where = numbers(sitting.type("WHERE"))
    assert where[:6] == pytest.approx([400, 0, 200, 90, 0, 0], abs=0.01)


def test_ctrl_c_is_abort_while_something_moves_and_nothing_otherwise(sitting):
    sitting.line(AWAY)
    sitting.pass_time(0.3)
    sitting.monitor.interrupt(now=sitting.now)
    assert sitting.monitor.prompt == "."
    sitting.pass_time(2.0)
    stood = sitting.joints()
    sitting.monitor.interrupt(now=sitting.now)
    sitting.pass_time(1.0)
    assert sitting.joints() == stood
    assert numbers(sitting.type("WHERE"))[0] != pytest.approx(400, abs=1)


def test_panic_turns_the_power_off_until_it_is_enabled(sitting):
    sitting.type("EDIT go", "MOVE TRANS(400,0,200,90,0,0)", "E", "EXECUTE go")
    sitting.pass_time(0.3)
    assert "*Arm power off*" in sitting.type("PANIC")
    sitting.pass_time(2.0)
    stood = sitting.joints()
    assert "*Arm power off*" in sitting.type("DO READY")
    assert sitting.type("CALIBRATE").startswith("*Arm power off*")
    sitting.pass_time(2.0)
    assert sitting.joints() == stood
    sitting.type("DO x = 1")
    assert sitting.type("LISTR x") == "x = 1\n"
    sitting.type("ENABLE POWER", "DO READY")
    assert sitting.joints() == pytest.approx((0, -90, 90, 0, 0, 0))


def test_an_error_stops_the_program_and_not_the_monitor(sitting):
    sitting.type("EDIT bad", "x = 1", "MOVE nowhere", "E")
    sitting.shown = ""
    sitting.line("EXECUTE bad")
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert re.search(r"^\*Undefined location\* nowhere, program bad, step 2", sitting.shown, re.MULTILINE)
    assert sitting.type("LISTR x") == "x = 1\n"


def test_status_shows_the_stack_and_speeds(sitting):
    sitting.type("EDIT inner", "PAUSE", "E", "EDIT outer", "CALL inner", "E", "SPEED 40")
    sitting.line("EXECUTE outer,7")
    sitting.until(lambda: sitting.monitor.prompt == ".")
    shown = sitting.type("STATUS")
    assert re.search(r"inner, step \d: paused \(PAUSE\), cycles left: 7", shown)
    assert "called from outer, step 1" in shown
    assert "40 %" in shown


def test_monitor_speed_counts_at_once(sitting):
    sitting.type("DO READY")
    begun = sitting.now
    sitting.type(AWAY)
    full = sitting.now - begun
    sitting.type("DO READY", "SPEED 50")
    begun = sitting.now
    sitting.type(AWAY)
    assert sitting.now - begun == pytest.approx(2 * full, rel=0.05)
    assert sitting.type("SPEED") == "Monitor speed 50 %\n"
    for wrong in ("0", "-5", "abc", "1,2"):
        assert sitting.type(f"SPEED {wrong}").startswith("*"), wrong
    assert sitting.arm.monitor_speed() == 50.0
    assert sitting.type("SPEED 150", "SPEED") == "*Warning* SPEED 150 % counts as 100 %\nMonitor speed 100 %\n"
    for _ in range(2):
        assert sitting.type("DO SPEED 150") == "*Warning* SPEED 150 % counts as 100 %\n"


def test_at_schedules_a_motion_undo_takes_it_back(sitting):
    sitting.line(f"AT {sitting.now + 3.0} DO DRIVE 1,20,100")
    sitting.pass_time(0.5)
    assert sitting.joints()[0] == pytest.approx(0.0)
    assert sitting.monitor.prompt == "."
    assert "JT 6" in sitting.type("TIMELINE")
    assert sitting.type("UNDO")
    sitting.pass_time(6.0)
    assert sitting.joints()[0] == pytest.approx(0.0)
    begun = sitting.now
    sitting.line("AT +2")
    sitting.line("DO DRIVE 1,20,100")
    sitting.pass_time(1.9)
    assert sitting.joints()[0] == pytest.approx(0.0)
    sitting.until(lambda: abs(sitting.joints()[0] - 20.0) < 1e-6)
    assert 2.0 < sitting.now - begun < 4.0


def test_at_takes_a_motion_on_its_line(sitting):
    sitting.line("AT +1 DRIVE 1,20,100")
    sitting.pass_time(0.9)
    assert sitting.joints()[0] == pytest.approx(0.0)
    sitting.until(lambda: abs(sitting.joints()[0] - 20.0) < 1e-6)


def test_rewind_tells_past_from_plan(sitting):
    assert "0.000 s ago" in sitting.line("REWIND 0")
    assert "5.000 s from now, as planned" in sitting.line("REWIND 5")


def test_signals_are_set_shown_and_reset(sitting):
    sitting.type("SIGNAL 1,-2,1003,2001")
    shown = sitting.type("IO")
    assert re.search(r"Outputs +1 10000000 ", shown)
    assert re.search(r"Inputs +1001 00100000 ", shown)
    assert re.search(r"Internal +2001 10000000 ", shown)
    sitting.type("SIGNAL 34,1512")
    shown = sitting.type("IO")
    assert re.search(r"Outputs +33 01000000 .* 64\b", shown)
    assert re.search(r"Inputs +1481 .*00000001 1512", shown)
    assert len(re.findall(r"^(?:Outputs|Inputs|Internal) ", shown, re.MULTILINE)) == 5
    sitting.type("RESET")
    assert re.search(r"Outputs +1 00000000 ", sitting.type("SIGNAL"))
    assert sitting.type("SIGNAL 5,999").startswith("*Illegal digital signal*")
    assert re.search(r"Outputs +1 00000000 ", sitting.type("IO"))


def test_switches_and_parameters(sitting):
    sitting.type("DISABLE CP")
    assert re.search(r"^CP +OFF$", sitting.type("SWITCH"), re.MULTILINE)
    assert sitting.type("SWITCH cp") == "CP  OFF\n"
    sitting.type("PARAMETER HAND.TIME = 0.25")
    assert sitting.type("PARAM hand.t") == "HAND.TIME  = 0.25\n"
    for wrong in ("PARAMETER HAND.TIME = -1", "PARAMETER x = 1", "PARAMETER HAND.TIME = $s", "PARAMETER = 3"):
        assert sitting.type(wrong).startswith("*"), wrong
    assert sitting.controller.parameters["HAND.TIME"] == 0.25


def test_coarse_and_others_say_their_state(sitting):
    assert sitting.type("coarse ?").startswith("COARSE")
    assert sitting.type("CP ?") == "CP is ON\n"
    assert sitting.type("HAND.LOAD ?") == "HAND.LOAD = 0\n"
    assert sitting.type("SPEED ?") == "Monitor speed 100 %\n"


def test_blank_lines_comments_tabs_and_control_characters_do_no_harm(sitting):
    assert sitting.type("", "   ", "; a comment", "\t") == ""
    assert sitting.type("\tLISTR\t; all") == "No reals\n"
    assert sitting.type("LIST\x07R\x1b") == "No reals\n"


def test_a_line_that_is_too_long_is_an_error(sitting):
    assert sitting.type("x" * (LONGEST + 1)).startswith("*Line too long*")
    assert sitting.type(OVERLONG).startswith("*Line too long*")


def test_lines_typed_during_a_do_wait_and_are_bounded(sitting):
    sitting.line(AWAY)
    for _ in range(WAITING):
        assert sitting.line("DO x = x0 + 1") == ""
    assert sitting.line("DO y = 1").startswith("*Too many lines waiting*")
    sitting.line("ABORT")
    sitting.pass_time(0.1)
    assert sitting.monitor.prompt == "."
    assert sitting.type("LISTR") == "No reals\n"


def test_abort_and_panic_act_whatever_is_asked_and_keep_what_is_edited(sitting):
    sitting.type("EDIT p", "x = 1", "PANIC")
    assert not sitting.controller.switches["POWER"]
    assert sitting.monitor.prompt == "2.? "
    sitting.type("E", "ENABLE POWER", *ASK)
    assert len(sitting.controller.memory.programs["p"].steps) == 1
    for word in ("abort", "panic"):
        sitting.line("EXECUTE ask")
        sitting.until(lambda: sitting.monitor.prompt == "n? ")
        sitting.type(word)
        assert sitting.monitor.prompt == "."
        assert not sitting.controller.running


def test_no_line_ends_the_monitor(sitting):
    rng = np.random.default_rng(1)
    pieces = [
        *COMMANDS,
        "p",
        "#j",
        "$s",
        "=",
        ",",
        "(",
        ")",
        ":",
        "1",
        "-2",
        "1e9",
        "?",
        "*",
        '"',
        "[",
        "]",
        ";",
        "TRANS(1",
    ]
    for _ in range(1500):
        line = " ".join(rng.choice(pieces, size=rng.integers(1, 6)))
        if not line.startswith(("QUIT", "EXIT", "STORE")):
            sitting.line(line)
            if sitting.monitor.prompt not in {".", "*"}:
                sitting.monitor.interrupt(now=sitting.now)
    assert sitting.monitor.prompt in {".", "*", ""}
    assert not sitting.monitor.done


def test_kill_gives_up_a_program_that_stands(sitting):
    sitting.type(*LOOP, "EXECUTE loop")
    assert sitting.type("KILL").startswith("*Program running*")
    sitting.type("ABORT")
    assert sitting.type("KILL") == "loop has ended (KILL)\n"
    for line in ("KILL", "PROCEED", "RETRY"):
        assert sitting.type(line) == "*No program to proceed*\n"
    assert "idle" in sitting.type("STATUS")
    assert "*Invalid argument*" in sitting.type("KILL loop")
    sitting.type(*HELLO, "EXECUTE hello")
    assert sitting.finish() == "hello\nhello has ended (END)\n"


@pytest.mark.parametrize("cycles", [5, -1])
def test_done_ends_a_program_with_its_present_cycle(sitting, cycles):
    sitting.type("EDIT turn", "DELAY 1", "BREAK", 'TYPE "turn"', "E")
    sitting.line(f"EXECUTE turn,{cycles}")
    sitting.pass_time(1.5)
    sitting.line("DONE")
    assert sitting.finish() == "turn\nturn has ended (END)\n"
    assert sitting.type("DONE") == "*No program running*\n"
    assert sitting.type("DONE 3") == "*No program running* task 3\n"
    assert sitting.type("DONE x").startswith("*Invalid argument*")
