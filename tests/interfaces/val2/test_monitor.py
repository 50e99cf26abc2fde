"""The monitor: every command, dialogues, states, confirmations, files, control, type-ahead; in virtual time."""

from __future__ import annotations

import re

import numpy as np
import pytest

from interfaces.val2.errors import ValError
from interfaces.val2.geometry import from_oat, to_oat
from interfaces.val2.monitor import commands, words
from interfaces.val2.monitor.commands import COMMANDS, command, unique
from interfaces.val2.monitor.handlers import HANDLERS
from interfaces.val2.monitor.monitor import LONGEST, OVERLONG, WAITING
from interfaces.val2.syntax import Number, Variable
from interfaces.val2.values import PrecisionPoint, Transformation

from .sitting import Sitting

HELLO = ("EDIT hello", 'TYPE "hello"', "E")
LOOP = ("EDIT loop", "WHILE TRUE DO", "DELAY 0.1", "END", "E")
ASK = ("EDIT ask", 'PROMPT "n? ", n', 'TYPE "n is", n', "E")
AWAY = "DO MOVE TRANS(400,0,200,90,0,0)"


@pytest.fixture
def sitting(tmp_path):
    return Sitting(tmp_path)


def numbers(shown: str) -> list[float]:
    return [float(text) for text in re.findall(r"-?\d+\.\d+", shown)]


# Words.


def test_every_command_has_a_handler_and_a_line_of_help():
    assert set(HANDLERS) | {"EXIT", "QUIT"} == set(COMMANDS)
    for one in COMMANDS.values():
        assert one.help.endswith((".", ",,10")), one.name
        assert len(one.help) <= 79, one.name
        assert all(len(usage) <= 60 for usage in one.usage), one.name


@pytest.mark.parametrize(
    ("word", "name"),
    [("cali", "CALIBRATE"), ("CA", "CALIBRATE"), ("ex", "EXECUTE"), ("exec", "EXECUTE"), ("a", "ABORT"),
     ("do", "DO"), ("WHERE", "WHERE"), ("wh", "WHERE"), ("sto", "STORE"), ("STOREL", "STOREL"), ("del", "DELETE"),
     ("En", "ENABLE"),
     ("pan", "PANIC"), ("proc", "PROCEED"), ("retr", "RETRY"), ("n", "NEXT"), ("x", "XSTEP"), ("status", "STATUS")],
)  # fmt: skip
def test_commands_are_abbreviated_to_a_unique_beginning(word, name):
    assert command(word).name == name


@pytest.mark.parametrize("word", ["l", "LIST", "re", "st", "di", "qui", "exi"])
def test_what_several_begin_with_or_may_not_be_abbreviated_is_refused(word):
    with pytest.raises(ValError, match=r"^\*(Ambiguous|Invalid) command\*"):
        command(word)


def test_every_unique_beginning_is_taken():
    names = [one.name for one in COMMANDS.values() if not one.whole]
    for name in names:
        for end in range(1, len(name) + 1):
            others = [other for other in names if other.startswith(name[:end]) and other != name]
            if not others:
                assert command(name[:end].lower()).name == name


def test_switches_are_abbreviated_too(sitting):
    sitting.type("DISABLE po")
    assert not sitting.controller.switches["POWER"]
    sitting.type("en PO, dry")
    assert sitting.controller.switches["POWER"]
    assert sitting.controller.switches["DRY.RUN"]
    assert "*Invalid switch*" in sitting.type("ENABLE NONSENSE")
    with pytest.raises(ValError, match="Ambiguous"):
        unique("A", ["AB", "AC"], "word")


def test_an_instruction_or_an_assignment_at_the_prompt_says_what_to_type(sitting):
    assert "DO MOVE p" in sitting.type("MOVE p")
    assert "DO x = 3" in sitting.type("x = 3")
    assert "did you mean" in sitting.type("WHER3")
    assert sitting.shown.startswith("*Invalid command*")


def test_every_word_can_be_explained(sitting):
    for name in COMMANDS:
        assert next(words.explained(name))[2]
    assert "behind a location" in sitting.type("HELP APPRO")
    assert "DRY.RUN" in sitting.type("HELP dry")
    assert sitting.type("HELP xyzzy").startswith("*Unknown word*")
    for line in sitting.type("HELP").splitlines():
        assert len(line) <= 79


# Where it is.


def test_where_at_ready(sitting):
    shown = numbers(sitting.type("DO READY", "WHERE"))
    np.testing.assert_allclose(shown[:6], [-20.3, 150.05, 863.6 + 56.25, 90, -90, 0], atol=0.01)
    np.testing.assert_allclose(shown[6:12], [0, -90, 90, 0, 0, 0], atol=0.01)
    assert "X/JT1" in sitting.shown
    assert "A/JT5" in sitting.shown


def test_do_gives_the_prompt_back_when_the_arm_stands(sitting):
    begun = sitting.now
    sitting.line(AWAY)
    assert sitting.monitor.prompt == ""
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert sitting.now - begun > 0.5
    x = numbers(sitting.type("WHERE"))[:6]
    np.testing.assert_allclose(x, [400, 0, 200, 90, 0, 0], atol=0.01)
    sitting.pass_time(1.0)
    assert numbers(sitting.type("WHERE"))[:6] == x


def test_where_1_repeats_until_a_line_comes(sitting):
    sitting.type(*LOOP)
    sitting.type("EDIT go", "READY", "MOVE TRANS(400,0,200,90,0,0)", "READY", "E", "EXECUTE go")
    sitting.shown = ""
    sitting.line("WHERE 1")
    sitting.pass_time(1.2)
    rows = len(sitting.shown.splitlines())
    assert rows >= 5
    sitting.line("")
    before = sitting.shown
    sitting.pass_time(2.0)
    assert "X/JT1" not in sitting.shown.removeprefix(before)


@pytest.mark.parametrize("oat", [(90, -90, 0), (90, 90, 35), (10, 20, 30), (-170, -45, 100), (0, 89.99999, -179)])
def test_here_store_and_load_give_every_pose_back(sitting, oat):
    goal = from_oat(350.0, 120.0, 310.0, *oat)
    sitting.controller.memory.set(Variable("goal"), goal)
    shown = sitting.type("DO MOVE goal", "HERE p", "", "HERE #p", "", "STORE keep")
    assert "keep.v2" in shown
    place = sitting.arm.here(now=sitting.now)
    np.testing.assert_allclose(place.tool.X, goal.X, atol=1e-6)
    sitting.type("ZERO", "Y", "LOAD keep")
    memory = sitting.controller.memory
    np.testing.assert_allclose(memory.get(Variable("p")).X, place.tool.X, atol=1e-9)
    np.testing.assert_allclose(memory.get(Variable("#p")).joints, place.joints.joints, atol=1e-12)


def test_here_takes_changes_until_there_are_none(sitting):
    shown = sitting.type("HERE p", ",,10", "1,,,,45", "")
    assert shown.count("X/JT1") == 1
    np.testing.assert_allclose(to_oat(sitting.controller.memory.get(Variable("p")))[:5], [1, 150.05, 10, 90, 45])


def test_changes_that_are_no_numbers_are_asked_again(sitting):
    shown = sitting.type("HERE #p", "1,2,3,4,5,6,7", "abc", ",1e400", "nan")
    assert shown.count("*Invalid argument*") == 4
    assert sitting.monitor.prompt == "Change? "
    sitting.type(",,91", "")
    assert sitting.controller.memory.get(Variable("#p")).joints[2] == 91.0


def test_here_in_a_compound_makes_the_last_part_relative(sitting):
    sitting.type("DO SET a = TRANS(100,0,0)", "DO SET b = RZ(30)", "HERE a:b:c", "")
    memory = sitting.controller.memory
    whole = memory.get(Variable("a")) @ memory.get(Variable("b")) @ memory.get(Variable("c"))
    np.testing.assert_allclose(whole.X, sitting.arm.here(now=sitting.now).tool.X, atol=1e-9)
    assert sitting.type("HERE nowhere:c").startswith("*Undefined")
    assert sitting.type("HERE a:#p").startswith("*")
    assert sitting.type("HERE $s").startswith("*Invalid argument*")


def test_what_was_not_accepted_is_not_kept(sitting):
    sitting.type("HERE p")
    sitting.monitor.interrupt(now=sitting.now)
    assert sitting.monitor.prompt == "."
    assert sitting.type("LISTL") == "No locations\n"


def test_point_defines_and_changes(sitting):
    sitting.type("POINT p", ",,,,0", "")
    assert to_oat(sitting.controller.memory.get(Variable("p"))) == pytest.approx((0, 0, 0, 90, 0, 0))
    sitting.type("POINT #j", "1,-90,90", "")
    assert sitting.controller.memory.get(Variable("#j")) == PrecisionPoint((1.0, -90.0, 90.0, 0.0, 0.0, 0.0))
    sitting.type("POINT q[2] = p:TRANS(0,0,5)", "")
    element = sitting.controller.memory.get(Variable("q", (Number(2.0),)))
    assert isinstance(element, Transformation)
    assert sitting.type("POINT p = 3").startswith("*Invalid argument*")
    assert sitting.type("POINT #j = p").startswith("*Invalid argument*")
    assert sitting.type("POINT").startswith("*Missing argument*")


def test_teach_records_and_lets_commands_in_between(sitting):
    sitting.type("TEACH p[1]", "", "DO DRIVE 1,10,100", "", "E")
    names = [name for name, _ in sitting.controller.memory.listing("location")]
    assert names == ["p[1]", "p[2]"]
    first, second = (value for _, value in sitting.controller.memory.listing("location"))
    assert np.linalg.norm(first.X[:3, 3] - second.X[:3, 3]) > 20.0
    sitting.type("TEACH #q", "", "", "E")
    assert [name for name, _ in sitting.controller.memory.listing("point")] == ["#q1", "#q2"]
    assert sitting.monitor.prompt == "."


def test_tool_and_base_are_shown_and_set(sitting):
    sitting.type("TOOL TRANS(0,0,100)")
    assert numbers(sitting.type("TOOL"))[:3] == [0, 0, 100]
    assert numbers(sitting.type("WHERE"))[2] == pytest.approx(1019.85, abs=0.01)
    sitting.type("TOOL NULL", "BASE 100,,50")
    where = numbers(sitting.type("WHERE"))
    assert where[:3] == pytest.approx([-120.3, 150.05, 869.85], abs=0.01)
    assert numbers(sitting.type("BASE"))[:3] == [100, 0, 50]
    assert sitting.type("TOOL nowhere").startswith("*Undefined")


def test_rewind_shows_the_past_and_where_real_has_no_other_twin_here(sitting):
    sitting.type("DO READY", AWAY)
    then = sitting.joints()
    sitting.pass_time(1.0)
    sitting.type("DO DRIVE 1,30,100")
    shown = numbers(sitting.type(f"REWIND {sitting.now - 0.0}"))
    assert shown[8:14] == pytest.approx(sitting.joints(), abs=0.002)
    ago = sitting.now - 1.0
    t = next(
        t
        for t in np.arange(0.0, ago, 0.05)
        if np.allclose(sitting.arm.past(t, now=sitting.now).joints.joints, then)
    )
    assert numbers(sitting.type(f"REWIND {t}"))[8:14] == pytest.approx(then, abs=0.002)
    assert sitting.type("WHERE REAL").startswith("*No other twin*")


# Programs.


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
    assert sitting.type("SPEED 150", "SPEED") == "Monitor speed 100 %\n"


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


# Memory and files.


def test_delete_and_zero_ask_and_only_y_does_it(sitting):
    sitting.type(*HELLO, "DO x = 1", "DO SET p = NULL", 'DO $s = "a"', "DO a[1] = 1", "DO a[2] = 2")
    for line in ("DELETE hello", "DELETER x", "DELETEL p", "DELETES $s", "ZERO"):
        for answer in ("", "N", "no", "x"):
            sitting.line(line)
            assert sitting.monitor.prompt.endswith("(Y/N)? "), line
            sitting.type(answer)
    assert "hello" in sitting.controller.memory.programs
    assert sitting.controller.memory.get(Variable("x")) == 1.0
    sitting.type("DELETE hello", "y", "DELETEL p", "YES", "DELETES $s", "y", "DELETER a[1]", "y")
    assert sitting.type("LISTR") == "a[2] = 2\nx    = 1\n"
    assert sitting.type("LISTL", "LISTS", "LISTP") == "No locations\nNo strings\nNo programs\n"
    sitting.type("ZERO", "y")
    assert sitting.type("LISTR") == "No reals\n"
    assert sitting.type("DELETE nothing").startswith("*Undefined program name*")


def test_lists_take_names_patterns_and_expressions(sitting):
    sitting.type("DO pa = 1", "DO pb = 2", "DO q = 0.1", "DO a[1,2] = 5", 'DO $x = "hi"')
    assert sitting.type("LISTR p*") == "pa = 1\npb = 2\n"
    assert sitting.type("LISTR pb*pb") == "4\n"
    assert sitting.type("LISTR pi*pb").startswith("6.28318")
    assert sitting.type("LISTR z*") == "*Undefined value* z*\n"
    assert sitting.type("LISTR a") == "a[1,2] = 5\n"
    assert sitting.type("LISTR a[1,2], q") == "a[1,2] = 5\nq      = 0.1\n"
    assert sitting.type("LISTR pa + pb") == "3\n"
    assert sitting.type('LISTS $x + "!"') == '"hi!"\n'
    assert sitting.type("LISTR z").startswith("*Undefined value* z")


def test_copy_and_rename(sitting):
    sitting.type(*HELLO, "COPY two=hello", "RENAME three=two")
    assert sorted(sitting.controller.memory.programs) == ["hello", "three"]
    assert sitting.controller.memory.programs["three"].name == "three"
    sitting.line("COPY hello=three")
    assert "(Y/N)?" in sitting.monitor.prompt
    sitting.type("N")
    for line in ("COPY a", "COPY a=b", "RENAME 1=hello", "COPY =hello"):
        assert sitting.type(line).startswith("*"), line


def test_store_keeps_a_program_with_all_that_it_uses_and_asks_before_it_writes_over(sitting, tmp_path):
    sitting.type("EDIT main", "CALL sub", "MOVE p", "E", "EDIT sub", "x = y", "E", *HELLO)
    sitting.type("DO SET p = TRANS(1,2,3)", "DO SET q = NULL", "DO y = 2", "DO z = 3")
    sitting.type("STORE part=main")
    text = (tmp_path / "part.v2").read_text()
    assert ".PROGRAM main" in text
    assert ".PROGRAM sub" in text
    assert ".PROGRAM hello" not in text
    sitting.line("STOREP part")
    assert "write over" in sitting.monitor.prompt.lower()
    sitting.type("n")
    assert (tmp_path / "part.v2").read_text() == text
    sitting.type("ZERO", "y", "LOAD part")
    assert sorted(sitting.controller.memory.programs) == ["main", "sub"]
    assert sitting.type("LISTR") == "y = 2\n"
    assert [name for name, _ in sitting.controller.memory.listing("location")] == ["p"]
    assert sitting.type("FLIST") == "part\n"
    assert list(tmp_path.iterdir()) == [tmp_path / "part.v2"]


def test_parts_are_stored_alone(sitting, tmp_path):
    sitting.type(*HELLO, "DO SET p = NULL", "DO SET #j = #PPOINT(1)", "DO x = 1", 'DO $s = "a"')
    sitting.type("STOREP a", "STOREL b", "STORER c", "STORES d", "STOREL e=#*")
    found = {path.stem: path.read_text() for path in tmp_path.iterdir()}
    assert ".PROGRAM hello" in found["a"]
    assert ".LOCATIONS" not in found["a"]
    assert "#j" in found["b"]
    assert "p " in found["b"]
    assert ".REALS" in found["c"]
    assert ".LOCATIONS" not in found["c"]
    assert "$s" in found["d"]
    assert "#j" in found["e"]
    assert "\np " not in found["e"]


@pytest.mark.parametrize("name", ["../x", "/etc/passwd", "a/b", ".hidden", "x.txt", "..", "", "a" * 200, "con\\x"])
def test_files_lead_nowhere_else(sitting, name, tmp_path):
    sitting.type(*HELLO)
    for line in (f"LOAD {name}", f"STORE {name}"):
        assert re.match(r"\*(Invalid file name|Missing argument)\*", sitting.type(line)), line
    assert not list(tmp_path.iterdir())


def test_a_link_leads_nowhere_either_and_a_broken_file_changes_nothing(sitting, tmp_path):
    (tmp_path / "link.v2").symlink_to("/etc/passwd")
    assert sitting.type("LOAD link").startswith("*Invalid file name*")
    (tmp_path / "bad.v2").write_text(".PROGRAM a\n x = 1\n.END\n.PROGRAM b\n MOVE (\n.END\n")
    assert re.match(r"\*Syntax error\*.*line 5", sitting.type("LOAD bad"))
    assert not sitting.controller.memory.programs
    assert sitting.type("LOAD none").startswith("*Nonexistent file*")
    (tmp_path / "half.v2").write_text(".LOCATIONS\n a 1 2 3 90 -90 0\n.END\n.REALS\n x 5\n p 7\n.END\n")
    sitting.type("DO x = 1", "DO SET p = NULL")
    assert sitting.type("LOAD half").startswith("*Variable type mismatch*")
    assert sitting.type("LISTR") == "x = 1\n"
    assert [name for name, _ in sitting.controller.memory.listing("location")] == ["p"]


# Signals, switches, parameters.


def test_signals_are_set_shown_and_reset(sitting):
    sitting.type("SIGNAL 1,-2,1003,2001")
    shown = sitting.type("IO")
    assert re.search(r"Outputs +1 10000000 ", shown)
    assert re.search(r"Inputs +1001 00100000 ", shown)
    assert re.search(r"Internal +2001 10000000 ", shown)
    sitting.type("RESET")
    assert re.search(r"Outputs +1 00000000 ", sitting.type("SIGNAL"))
    assert sitting.type("SIGNAL 5,99").startswith("*Illegal digital signal*")
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


# Lines of all kinds.


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


# Who is in control, and when it's over.


class Held:
    """Control that somebody else has, or that takes time to come; of a robot that may be in trouble."""

    looks = 0.1
    kept = True

    def __init__(self, *answers):
        self.answers, self.released = list(answers), 0
        self.why = ""
        self.wrong = None

    def trouble(self, *, now):
        return self.wrong

    def lapsed(self):
        why, self.why = self.why, ""
        return why

    def wanted(self, person=None, *, now):
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]

    def release(self, *, now):
        self.released += 1

    def resume(self, *, now):
        pass


def test_without_control_it_only_looks(tmp_path):
    sitting = Sitting(tmp_path, control=Held("somebody has the lease"))
    changing = (
        "DO READY, EXECUTE a, SPEED 50, SIGNAL 1, LOAD a, STORE a, TOOL NULL, HERE p, PANIC, ENABLE CP, ZERO, "
        "EDIT a, UNDO, PARAMETER HAND.TIME = 1, AT 1, ABORT"
    )
    for line in changing.split(", "):
        assert sitting.type(line).startswith("*No control*"), line
        assert "somebody" in sitting.shown
    for line in ("WHERE", "STATUS", "SPEED", "TOOL", "BASE", "IO", "SIGNAL", "LISTR", "PARAMETER", "SWITCH", "ID"):
        assert "*No control*" not in sitting.type(line), line


def test_a_command_waits_until_control_has_come(tmp_path):
    sitting = Sitting(tmp_path, control=Held(None, None, None, None, ""))
    sitting.line("DO x = 1")
    assert sitting.monitor.prompt == ""
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert sitting.type("LISTR x") == "x = 1\n"


def test_a_command_that_waits_in_vain_is_told_so_once(tmp_path):
    control = Held("", None, None, "nobody gave it", None, None, "nobody gave it", None)
    sitting = Sitting(tmp_path, control=control)
    sitting.line("DO x = 1")
    sitting.line("DO y = 1")
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert sitting.shown == "*No control* DO: nobody gave it\n" * 2
    assert sitting.type("LISTR x") != "x = 1\n"


@pytest.mark.parametrize("line", ["EXECUTE loop", "DO DELAY 5"])
def test_a_lapse_of_control_interrupts_what_runs_even_if_it_is_there_again(tmp_path, line):
    control = Held("")
    sitting = Sitting(tmp_path, control=control)
    sitting.type(*LOOP)
    sitting.line(line)
    sitting.pass_time(0.5)
    assert sitting.controller.running or sitting.controller.doing
    sitting.shown, control.why = "", "somebody else commands"
    sitting.line("SPEED 50")
    assert not sitting.controller.running
    assert not sitting.controller.doing
    assert "*Motion interrupted* somebody else commands" in sitting.shown
    sitting.pass_time(5.0)
    assert sitting.shown.count("*Motion interrupted*") == 1
    assert sitting.type("DO x = 1", "LISTR x").endswith("x = 1\n")


def test_a_terminal_that_has_lost_control_gives_way_to_another(tmp_path):
    control = Held("")
    sitting = Sitting(tmp_path, control=control)
    second = sitting.terminal()
    sitting.type(*LOOP, "EXECUTE loop")
    control.kept = False
    second.line("DO x = 1", now=sitting.now)
    assert not sitting.controller.running
    sitting.pass_time(0.1)
    assert "loop stands before" in sitting.shown
    assert second.prompt == "."


def test_a_robot_in_trouble_is_told_of_at_once_and_once(tmp_path):
    control = Held("")
    sitting = Sitting(tmp_path, control=control)
    second = sitting.terminal()
    sitting.pass_time(1.0)
    control.wrong = ValError("Robot halted", "nothing came")
    assert sitting.monitor.next_deadline() <= sitting.now + 0.1
    sitting.pass_time(0.15)
    assert sitting.shown == "*Robot halted* nothing came\n"
    assert sitting.monitor.prompt == "."
    second.advance(now=sitting.now)
    assert "".join(piece.text for piece in second.output()) == "*Robot halted* nothing came\n"
    sitting.shown = ""
    sitting.pass_time(5.0)
    assert sitting.shown == ""
    control.wrong = None
    sitting.pass_time(0.15)
    assert sitting.shown == "The robot follows again\n"


def test_trouble_before_control_has_come_is_no_news(tmp_path):
    control = Held(None, None, None, "")
    control.wrong = ValError("Robot halted", "it hasn't been met yet")
    sitting = Sitting(tmp_path, control=control)
    sitting.pass_time(0.03)
    control.wrong = None
    sitting.pass_time(1.0)
    assert sitting.shown == ""


def test_a_second_terminal_looks_until_the_first_has_left(sitting):
    second = sitting.terminal()
    sitting.type(*LOOP, "EXECUTE loop")
    second.line("DO READY", now=sitting.now)
    assert "*No control*" in "".join(piece.text for piece in second.output())
    assert second.prompt == "*"
    second.line("LISTP loop", now=sitting.now)
    assert ".PROGRAM loop" in "".join(piece.text for piece in second.output())
    sitting.monitor.leave(now=sitting.now)
    assert not sitting.controller.running
    second.line("DO x = 1", now=sitting.now)
    second.advance(now=sitting.now + 0.1)
    assert "*" not in "".join(piece.text for piece in second.output())
    assert second.prompt == "."


def test_from_a_pipe_lines_wait_for_the_end_of_a_program_or_its_question(tmp_path):
    sitting = Sitting(tmp_path, patient=True)
    sitting.type("EDIT ask", "DELAY 1", "BREAK", 'PROMPT "n? ", n', 'TYPE "n is", n', "E", *HELLO)
    sitting.line("EXECUTE ask")
    assert not sitting.monitor.takes("7")
    assert sitting.monitor.takes("WHERE")
    assert not sitting.monitor.takes("EXECUTE hello")
    sitting.until(lambda: sitting.monitor.takes("7"))
    sitting.line("7")
    sitting.line("EXECUTE hello")
    sitting.monitor.end_of_input(now=sitting.now)
    sitting.until(lambda: sitting.monitor.done)
    assert sitting.shown.index("n is 7") < sitting.shown.index("hello\n")


def test_the_end_of_input_waits_for_the_program_and_ends_a_question(sitting):
    sitting.type("EDIT slow", "DELAY 3", "E", "EXECUTE slow")
    sitting.monitor.end_of_input(now=sitting.now)
    sitting.pass_time(1.0)
    assert not sitting.monitor.done
    sitting.until(lambda: sitting.monitor.done)
    other = Sitting(sitting.files.directory)
    other.type(*ASK)
    other.line("EXECUTE ask")
    other.monitor.end_of_input(now=other.now)
    other.pass_time(0.1)
    assert other.monitor.done
    assert "*End of input*" in other.shown


@pytest.mark.parametrize("line", ["QUIT", "exit"])
def test_it_can_be_left(sitting, line):
    sitting.line(line)
    assert sitting.monitor.done
    assert sitting.board.holder is None
    assert commands.COMMANDS
