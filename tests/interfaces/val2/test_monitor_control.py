"""Who is in control at a monitor, several monitors at once, and when it's over."""

from __future__ import annotations

import pytest

from interfaces.val2.errors import ValError
from interfaces.val2.monitor import commands
from interfaces.val2.monitor.control import Control, ControlState

from .sitting import ASK, HELLO, LOOP, Sitting


class Held(Control):
    """Control that somebody else has, or that takes time to come; of a robot that may be in trouble."""

    fault_poll_interval = 0.1
    held = True

    def __init__(self, *answers):
        self.answers, self.released = list(answers), 0
        self.why = ""
        self.wrong = None

    def fault(self, *, now):
        return self.wrong

    def pop_lapse(self):
        why, self.why = self.why, ""
        return why

    def regain(self):
        pass

    def request(self, session=None, *, now):
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]

    def release(self):
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
    sitting = Sitting(
        tmp_path,
        control=Held(
            ControlState.PENDING,
            ControlState.PENDING,
            ControlState.PENDING,
            ControlState.PENDING,
            ControlState.HELD,
        ),
    )
    sitting.line("DO x = 1")
    assert sitting.monitor.prompt == ""
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert sitting.type("LISTR x") == "x = 1\n"


def test_a_command_that_waits_in_vain_is_told_so_once(tmp_path):
    control = Held(
        ControlState.HELD,
        ControlState.PENDING,
        ControlState.PENDING,
        "nobody gave it",
        ControlState.PENDING,
        ControlState.PENDING,
        "nobody gave it",
        ControlState.PENDING,
    )
    sitting = Sitting(tmp_path, control=control)
    sitting.line("DO x = 1")
    sitting.line("DO y = 1")
    sitting.until(lambda: sitting.monitor.prompt == ".")
    assert sitting.shown == "*No control* DO: nobody gave it\n" * 2
    assert sitting.type("LISTR x") != "x = 1\n"


@pytest.mark.parametrize("line", ["EXECUTE loop", "DO DELAY 5"])
def test_a_lapse_of_control_interrupts_what_runs_even_if_it_is_there_again(tmp_path, line):
    control = Held(ControlState.HELD)
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


def test_after_a_lapse_of_control_what_was_asked_for_ahead_is_taken_out_of_the_plan(tmp_path):
    control = Held(ControlState.HELD)
    sitting = Sitting(tmp_path, control=control)
    sitting.type("DO READY", "EDIT go", "DRIVE 1,20,100", "DRIVE 1,20,100", "DRIVE 1,20,100", "E")
    sitting.line("EXECUTE go")
    sitting.pass_time(0.1)
    control.why = "somebody else commands"
    sitting.pass_time(10.0)
    assert 0.0 < sitting.joints()[0] < 20.001


def test_who_leaves_gives_control_back_and_nobody_else_does(tmp_path):
    control = Held(ControlState.HELD)
    sitting = Sitting(tmp_path, control=control)
    second = sitting.terminal()
    sitting.type("DO x = 1")
    second.leave(now=sitting.now)
    assert control.released == 0
    sitting.monitor.leave(now=sitting.now)
    assert control.released == 1


def test_a_terminal_that_has_lost_control_gives_way_to_another(tmp_path):
    control = Held(ControlState.HELD)
    sitting = Sitting(tmp_path, control=control)
    second = sitting.terminal()
    sitting.type(*LOOP, "EXECUTE loop")
    control.held = False
    second.line("DO x = 1", now=sitting.now)
    assert not sitting.controller.running
    sitting.pass_time(0.1)
    assert "loop stands before" in sitting.shown
    assert second.prompt == "."


def test_a_robot_in_trouble_is_told_of_at_once_and_once(tmp_path):
    control = Held(ControlState.HELD)
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
    control = Held(ControlState.PENDING, ControlState.PENDING, ControlState.PENDING, ControlState.HELD)
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
    sitting = Sitting(tmp_path, queues_commands=True)
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
    assert sitting.shared.holder is None
    assert commands.COMMANDS
