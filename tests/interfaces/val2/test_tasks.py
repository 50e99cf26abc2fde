"""Tasks: programs beside the main one, and which of them has the arm."""

from __future__ import annotations

import numpy as np
import pytest

from interfaces.val2.errors import ValError
from interfaces.val2.playing import Listeners, Rehearsal, rehearse
from interfaces.val2.source import parse_file
from robots import puma560
from tests.interfaces.val2.sitting import Sitting

MODEL = puma560.model()
READY = "MOVE #PPOINT(0, -90, 90, 0, 0, 0)"


def programs(**named: str) -> str:
    """The text of programs, whose steps stand between semicolons."""
    steps = {name: "\n".join(lines.split("; ")) for name, lines in named.items()}
    return "".join(f".PROGRAM {name}()\n{lines}\n.END\n" for name, lines in steps.items())


def rehearsed(**named: str) -> tuple[Rehearsal, str]:
    """What becomes of programs, the first of which is the main one; and what they type."""
    typed: list[str] = []
    found = rehearse(parse_file(programs(**named), "t.v2"), MODEL, listeners=Listeners(typed.append))
    return found, "".join(typed)


def test_tasks_share_variables_and_take_turns() -> None:
    found, typed = rehearsed(
        main="n = 0; EXECUTE 3 beside; FOR i = 1 TO 5000; n = n + 1; END; WAIT done; TYPE n, seen > 0, seen < 5000",
        beside="WAIT n > 0; seen = n; done = TRUE",
    )
    assert found.findings == ()
    assert typed == " 5000 -1 -1\n"


def test_a_task_doesnt_move_the_arm_before_it_has_attached_it() -> None:
    found, _ = rehearsed(main="EXECUTE 1 other; DELAY 1", other=READY)
    (one,) = found.findings
    assert str(one.error).startswith(
        "*Robot not attached* MOVE in task 1; task 0 has the arm; allowed: ATTACH first, program other, step 1"
    )


@pytest.mark.parametrize("word", ["SPEED 50", "TOOL", "OPEN", "OPENI", "ALTER (1) 3", "LEFTY", "BREAK", "GRASP 5"])
def test_nor_does_it_change_how_the_arm_moves(word: str) -> None:
    found, _ = rehearsed(main="PCEXECUTE other; DELAY 1", other=word)
    (one,) = found.findings
    assert one.error.what == "Robot not attached"


def test_the_arm_goes_from_one_task_to_the_other() -> None:
    found, typed = rehearsed(
        main="moved = FALSE; EXECUTE 1 other; DELAY 0.5; DETACH; WAIT moved; ATTACH; "
        f"{READY}; BREAK; TYPE TASK(1, 1), DZ(HERE) > 900",
        other="ATTACH; MOVE TRANS(0, 500, 0, 90, 90, 0); BREAK; SPEED 50 MONITOR; DETACH; moved = TRUE",
    )
    assert found.findings == ()
    assert typed == " 1 -1\n"


def test_a_run_goes_on_as_long_as_a_task_has_the_arm() -> None:
    found, typed = rehearsed(
        main="EXECUTE 1 mover; EXECUTE 2 watcher, -1",
        mover="ATTACH; MOVE TRANS(0, 500, 0, 90, 90, 0); BREAK; TYPE TASK(), TASK(1, 0), TASK(1, 2)",
        watcher="WAIT",
    )
    assert found.findings == ()
    assert typed == " 1 1 4\n"
    np.testing.assert_allclose(found.timeline.end, found.end, atol=0.1)


def test_reactions_are_of_the_task_that_asked_for_them() -> None:
    found, typed = rehearsed(
        main="n = 0; EXECUTE 1 beside; DELAY 0.2; BREAK; SIGNAL 2001; DELAY 0.2; BREAK; n = 3; DELAY 0.2",
        beside="REACT 2001, noticed; WAIT n == 3; TYPE 3",
        noticed="TYPE TASK()",
    )
    assert found.findings == ()
    assert typed == " 1\n 3\n"


def test_an_error_of_a_task_leaves_the_others_alone() -> None:
    found, typed = rehearsed(main="EXECUTE 1 wrong; DELAY 0.5; BREAK; TYPE TASK(1, 1)", wrong="x = 1 / 0")
    assert [one.error.what for one in found.findings] == ["Division by zero"]
    assert typed == " 2\n"


def test_what_cant_be_is_one_line() -> None:
    for step, said in (
        ("EXECUTE 28 main", "*Illegal task number* 28: 0 to 27"),
        ("EXECUTE 0 main", "*Program already running*"),
        ("PROCEED 5", "*No program to proceed* task 5"),
        ("KILL 5", "*No program to proceed* task 5"),
        ("PCEND", "*No program running* task 1"),
    ):
        (one,) = rehearsed(main=step)[0].findings
        assert str(one.error).startswith(said)
        assert one.severity == "error"


def test_process_control_runs_beside_at_the_prompt(sitting: Sitting) -> None:
    sitting.type("EDIT watch", "n = n + 1", "WAIT.EVENT , 0.1", "E", "EDIT slow", "DELAY 2", "E", "DO n = 0")
    sitting.type("PCEXECUTE watch, -1")
    sitting.line("EXECUTE slow")
    assert sitting.monitor.prompt == "*"
    sitting.pass_time(0.05)
    assert "Task 1: watch, step 2: running\n" in sitting.line("STATUS")
    assert "slow has ended (END)\n" in sitting.finish()
    assert sitting.type("PCABORT") == "watch, task 1, stands before step 2 (ABORT)\n"
    n = sitting.controller.evaluate(expression("n"), now=sitting.now)
    assert n > 15
    sitting.pass_time(1.0)
    assert sitting.controller.evaluate(expression("n"), now=sitting.now) == n
    assert sitting.type("PCPROCEED", "PCEND") == ""
    sitting.pass_time(1.0)
    assert sitting.controller.evaluate(expression("n"), now=sitting.now) == n + 1
    assert "Task 1: watch, step 2: idle (END)\n" in sitting.type("STATUS")


def expression(text: str):
    from interfaces.val2.parser import parse_expression

    return parse_expression(text)


def test_a_task_that_has_the_arm_keeps_a_do_from_moving_it(sitting: Sitting) -> None:
    sitting.type("EDIT hold", "ATTACH", "WAIT go", "E", "DO go = FALSE", "EXECUTE 2 hold")
    sitting.pass_time(0.1)
    assert sitting.type("DO READY").startswith("*Robot not attached* READY in task 0; task 2 has the arm")
    sitting.type("DO go = TRUE")
    assert sitting.type("DO READY") == ""


def test_leaving_stops_all_tasks(sitting: Sitting) -> None:
    sitting.type("EDIT loop", "WHILE TRUE DO", "WAIT", "END", "E", "EXECUTE 3 loop")
    assert sitting.controller.busy
    sitting.line("QUIT")
    assert not sitting.controller.busy


def test_a_main_program_isnt_begun_while_another_task_has_the_arm(sitting: Sitting) -> None:
    sitting.type("EDIT hold", "ATTACH", "WAIT FALSE", "E", "EXECUTE 2 hold")
    sitting.pass_time(0.1)
    assert sitting.type("EXECUTE hold") == "*Robot attached* to task 2; allowed: DETACH there first\n"
    with pytest.raises(ValError, match="Program already running"):
        sitting.controller.execute("hold", number=2, now=sitting.now)
