"""`vrs run`, and rehearsals: programs from their first step to their end."""

from __future__ import annotations

import json

import numpy as np
import pytest

from interfaces.cli import main
from interfaces.link import delay_profile
from interfaces.val2.errors import ValError
from interfaces.val2.motion.conventions import PUMA
from interfaces.val2.playing import Listeners, rehearse
from interfaces.val2.source import parse_file
from interfaces.val2.twins import play
from robots import load
from robots.robot import exact_arm

robot = load("puma560")
model = robot.arm


def program(*lines, name="main", after=""):
    return "\n".join([f".PROGRAM {name}()", *lines, ".END", after])


def twins(text, *, delay="none", asked=(), **options):
    typed, told, answers = [], [], iter(asked)
    listeners = Listeners(typed.append, told.append, lambda _: next(answers, None))
    source = parse_file(text, "test.v2")
    played = play(source, robot, delay_profile(delay), exact_arm, seed=1, listeners=listeners, **options)
    return played, "".join(typed), told


def vrs(*arguments):
    with pytest.raises(SystemExit) as exit_info:
        main([str(argument) for argument in arguments])
    return exit_info.value.code


def test_the_first_program_runs_once_from_nominal():
    text = program("CALL other", "SET p = HERE", "TYPE DX(p)") + program("TYPE /I0, 7", name="other")
    played, typed, _ = twins(text)
    expected = PUMA.flange_at(model.forward(model.poses["nominal"])).X[0, 3]
    assert typed.split()[0] == "7"
    assert float(typed.split()[1]) == pytest.approx(expected, abs=0.01)
    assert played.error is None
    assert (played.run.q_virtual == model.poses["nominal"]).all()


def test_what_happens_on_the_twins_is_the_same_from_the_same_seed():
    text = program("FOR n = 1 TO 3", "DRIVE 1, 10*RANDOM(), 100", "END", "BREAK", "TYPE TIMER(1)")
    runs = [twins(text, delay="thu") for _ in range(2)]
    assert runs[0][1] == runs[1][1]
    assert (runs[0][0].run.q_real == runs[1][0].run.q_real).all()


def test_signals_come_on_as_motions_begin():
    text = program(
        "SET a = TRANS(-100,500,0,90,90,0)", "SET b = TRANS(100,500,0,90,90,0)", "TIMER 1 = 0",
        "MOVE a", "one = TIMER(1)", "MOVE b", "two = TIMER(1)", "BREAK", "TYPE one, two, TIMER(1)",
    )  # fmt: skip
    played, typed, _ = twins(text)
    one, two, three = (float(word) for word in typed.split())
    first, second = played.run.receipts_virtual
    assert one < 1e-3
    assert two == pytest.approx(second.execute_at, abs=1e-2)
    assert first.execute_at + 0.5 < two < three == pytest.approx(second.end, abs=1e-2)


def test_a_program_that_plans_under_delay_reaches_the_real_arm():
    text = program("READY", "DRIVE 1, 30, 100", "BREAK", "SPEED 50 MONITOR", "DRIVE 1, -30, 100", "BREAK")
    played, _, _ = twins(text, delay="constant:0.5")
    run = played.run
    assert run.corrections == ()
    assert np.abs(run.q_real[-1] - model.poses["ready"]).max() < 1e-9
    assert np.abs(run.q_matched - run.q_real).max() < 1e-9


def test_a_monitor_speed_in_mid_motion_reaches_the_real_arm():
    text = program("READY", "SPEED 30 MONITOR", "DRIVE 1, 30, 100", "SPEED 100 MONITOR", "BREAK")
    played, _, _ = twins(text, delay="thu")
    assert played.run.corrections == ()
    assert np.abs(played.run.q_matched - played.run.q_real).max() < 1e-9


def test_the_hand_takes_a_load_at_the_real_arms_own_time():
    text = program("PARAMETER HAND.LOAD = 1.5", "CLOSEI", "DRIVE 1, 20, 100", "OPENI")
    played, _, _ = twins(text, delay="constant:0.5")
    hands = [event for event in played.run.events if event.kind in ("payload", "release")]
    assert [item.mass for item in played.plan.payloads] == [1.5, None]
    assert [event.kind for event in hands] == ["payload", "release"]
    assert hands[0].t == pytest.approx(played.plan.payloads[0].t + 0.5, abs=0.2)


def test_an_error_stops_the_program_and_not_the_record():
    text = program("DRIVE 1, 10, 100", "MOVE nowhere", "TYPE 1")
    played, typed, _ = twins(text)
    assert isinstance(played.error, ValError)
    assert "*Undefined location* nowhere, program main, step 2" in str(played.error)
    assert typed == ""
    assert played.run.q_real[-1, 0] == pytest.approx(np.radians(10))


@pytest.mark.parametrize(
    ("lines", "error"),
    [
        (["TYPE 1", "WAIT SIG(1001)"], r"\*Waits for ever\*.*, program main, step 2$"),
        (["WHILE TRUE DO", "DELAY 1", "END"], r"\*Program given up\*"),
        (['PROMPT "how many", n'], r"\*No answer\*.*, program main, step 1$"),
    ],
)
def test_what_would_never_end_is_given_up(lines, error):
    played, _, _ = twins(program(*lines), limit=5.0)
    with pytest.raises(ValError, match=error):
        raise played.error


def test_a_prompt_is_answered():
    played, typed, _ = twins(program('PROMPT "how many", n', "TYPE /I0, n*2"), asked=["21"])
    assert typed == "42\n"
    assert played.error is None


def test_a_rehearsal_finds_what_is_out_of_reach_with_line_and_column():
    text = program(
        "SET far = TRANS(2000,0,0,90,90,0)", "MOVE TRANS(0,500,0,90,90,0)", "MOVE far",
        "MOVES TRANS(0,-500,0,90,90,0)", "FOR n = 1 TO 2", "DRIVE 1, 200, 100", "END",
    )  # fmt: skip
    findings = rehearse(parse_file(text, "test.v2"), model).findings
    assert [finding.place.line for finding in findings] == [4, 5, 7]
    assert [finding.error.what for finding in findings] == [
        "Location out of range", "Straight line not possible", "Location out of range",
    ]  # fmt: skip
    assert all(finding.severity == "error" and finding.place.column >= 1 for finding in findings)
    assert [finding.error.step for finding in findings] == [3, 4, 6]


@pytest.mark.parametrize("line", ["WAIT SIG(1001)", 'PROMPT "x", x'])
def test_where_a_rehearsal_sees_no_farther_isnt_an_error(line):
    rehearsal = rehearse(parse_file(program("READY", line, "MOVE nowhere"), "test.v2"), model)
    assert [finding.severity for finding in rehearsal.findings] == ["warning"]
    assert [finding.place.line for finding in rehearsal.findings] == [3]


def test_a_rehearsal_ends_where_a_program_computes_for_ever(monkeypatch):
    monkeypatch.setattr("interfaces.val2.playing.COMPUTING", 0.05)
    rehearsal = rehearse(parse_file(program("WHILE TRUE DO", "n = 1", "END"), "test.v2"), model)
    assert [finding.error.what for finding in rehearsal.findings] == ["Program given up"]
    assert 0.04 < rehearsal.end < 0.1


def test_a_rehearsal_follows_the_cell():
    cell = ".SIGNALS\n1001 = SIG(1) AFTER 2\n.END\n"
    rehearsal = rehearse(parse_file(program("SIGNAL 1", "WAIT SIG(1001)", after=cell), "test.v2"), model)
    assert rehearsal.findings == ()
    assert rehearsal.end == pytest.approx(2.0, abs=0.01)


def test_vrs_run_writes_what_the_demo_writes_and_types_nothing_else(tmp_path, capsys):
    path = tmp_path / "job.v2"
    path.write_text(program('TYPE "hello"', "DRIVE 1, 5, 100", "BREAK", 'TYPE "done"'))
    assert vrs("run", path, "--delay", "none", "--seed", "3", "--out", tmp_path / "out") == 0
    streams = capsys.readouterr()
    assert streams.out == "hello\ndone\n"
    assert "summary.json" in streams.err
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["commands"]["virtual"]["accepted"] == 1
    assert len(summary["attribution"]) == 3
    assert (tmp_path / "out" / "report.html").stat().st_size > 10_000


def test_vrs_run_takes_several_files_and_the_program_that_is_meant(tmp_path, capsys):
    first, values, other = (tmp_path / name for name in ("a.v2", "b.lc", "c.v2"))
    first.write_text(program("TYPE n", "CALL second", name="first"))
    values.write_text(".REALS\nn 7\n.END\n")
    other.write_text(program("TYPE n+1", name="second"))
    files = (first, values, other)
    assert vrs("run", *files, "--delay", "none", "--out", tmp_path / "out") == 0
    assert capsys.readouterr().out == " 7\n 8\n"
    assert vrs("run", *files, "--program", "second", "--delay", "none", "--out", tmp_path / "out") == 0
    assert capsys.readouterr().out == " 8\n"
    assert vrs("run", *files, "--program", "third", "--out", tmp_path / "none") == 2
    assert "third; allowed: first, second" in capsys.readouterr().err


def test_vrs_run_says_what_is_wrong_in_one_line(tmp_path, capsys):
    path = tmp_path / "job.v2"
    path.write_text(program("MOVE nowhere"))
    assert vrs("run", path, "--delay", "none", "--out", tmp_path / "out") == 2
    streams = capsys.readouterr()
    assert streams.out == ""
    assert streams.err.splitlines()[-1].startswith("vrs: *Undefined location* nowhere, program main, step 1")
    for bad in (tmp_path / "missing.v2", tmp_path):
        assert vrs("run", bad) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1


def test_speeds_that_count_as_less_are_said_once():
    text = program(
        "FOR i = 1 TO 3", "SPEED 150", "END", "SPEED 900 MMPS", "SPEED 120 MONITOR", "SPEED 100,100 ALWAYS",
        "DRIVE 1, 1, 130", "BREAK",
    )  # fmt: skip
    _, _, told = twins(text)
    assert told == [
        "SPEED 150 % counts as 100 %", "SPEED 900 MMPS counts as 500 MMPS", "Monitor SPEED 120 % counts as 100 %",
        "DRIVE at 130 % counts as 100 %",
    ]  # fmt: skip


def test_what_isnt_available_ends_the_run(tmp_path):
    path = tmp_path / "weave.v2"
    path.write_text(program("TYPE 1", "WEAVE 3, 1", "TYPE 2"))
    assert vrs("check", path, "--static") == 2
    assert vrs("run", path, "--out", tmp_path / "out") != 0
    played, typed, _ = twins(path.read_text())
    assert played.error.what == "Not available"
    assert (played.error.step, typed.split()) == (2, ["1"])
