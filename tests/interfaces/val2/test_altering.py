"""ALTER and ALTOUT: every correction moves the tool by exactly what it says."""

from __future__ import annotations

import numpy as np
import pytest

from interfaces.link import delay_profile
from interfaces.val2.errors import ValError
from interfaces.val2.motion import Arm
from interfaces.val2.motion.remote import RemoteRobot
from interfaces.val2.playing import Listeners
from interfaces.val2.source import parse_file
from interfaces.val2.twins import play
from interfaces.val2.values import Transformation, about_x, about_z
from robots import load
from robots.robot import exact_arm
from tests.interfaces.joined import MODEL, bad, constant

from .bench import SQUARE, Bench, close, from_oat, to_oat
from .sitting import Sitting, numbers
from .test_remote import Line

PLACE = from_oat(0, 500, 50, 90, 60, 0)


def offset(x=0.0, y=0.0, z=0.0, turn=None):
    X = np.eye(4) if turn is None else turn.X.copy()
    X[:3, 3] = x, y, z
    return Transformation(X)


def altering(mode, place=PLACE):
    bench = Bench()
    bench.move(place)
    bench.settle()
    bench.arm.set_alter(mode, now=bench.now)
    return bench


def correct(bench, *values):
    bench.arm.alter((*values, *[0.0] * (6 - len(values))), now=bench.now)


def test_what_the_issue_says(tmp_path):
    sitting = Sitting(tmp_path)
    shown = sitting.type(
        "DO LEFTY", "DO MOVE TRANS(400,100,100,90,90,0)", "DO ALTER (1) 3", "DO ALTOUT 5,0,0", "WHERE"
    )
    assert numbers(shown)[:6] == [405.0, 100.0, 100.0, 90.0, 90.0, 0.0]


@pytest.mark.parametrize("mode", [0, 1, 2, 3])
@pytest.mark.parametrize("step", [0.05, 1.0, 20.0])
def test_corrections_in_a_row_come_to_what_they_say(mode, step):
    bench = altering(mode)
    for k in range(8):
        correct(bench, 0.0, step if mode & 1 else step * (k + 1))
        bench.until(bench.arm.ready)
    bench.settle()
    way = offset(y=8 * step)
    expected = PLACE.X[:3, 3] + way.X[:3, 3] if mode & 2 else (PLACE @ way).X[:3, 3]
    assert bench.here().tool.X[:3, 3] == pytest.approx(expected, abs=1e-6)
    assert bench.here().tool.X[:3, :3] == pytest.approx(PLACE.X[:3, :3], abs=1e-9)


def test_turns_are_about_the_tip():
    bench = altering(1)
    bench.arm.set_tool(offset(z=120.0))
    place = bench.here().tool
    correct(bench, 1, 2, 3, 10)
    bench.settle()
    assert close(bench.here(), place @ offset(1, 2, 3) @ about_x(10)) < 1e-6
    bench.arm.set_alter(3, now=bench.now)
    before = bench.here().tool
    correct(bench, 0, 0, 0, 0, 0, 30)
    bench.settle()
    after = bench.here().tool.X
    assert after[:3, 3] == pytest.approx(before.X[:3, 3], abs=1e-6)
    assert after[:3, :3] == pytest.approx(about_z(30).X[:3, :3] @ before.X[:3, :3], abs=1e-9)


def test_world_axes_are_those_of_base(tmp_path):
    sitting = Sitting(tmp_path)
    shown = sitting.type(
        "DO LEFTY", "DO MOVE TRANS(400,100,100,90,90,0)", "BASE 10,20,30,90", "WHERE", "DO ALTER (1) 3",
        "DO ALTOUT 5,-3,2", "WHERE",
    )  # fmt: skip
    values = numbers(shown)
    assert np.subtract(values[13:16], values[:3]) == pytest.approx([5, -3, 2], abs=0.02)


def test_a_correction_to_nothing_goes_back_without_bit_1():
    bench = altering(2)
    for values in ((5, 5, 5, 3, 2, 1), (0, 0, -4), (0, 0, 0)):
        correct(bench, *values)
        bench.until(bench.arm.ready)
    bench.settle()
    assert close(bench.here(), PLACE) < 1e-6


def test_corrections_count_from_where_a_motion_or_a_stop_left_the_arm():
    bench = altering(2)
    correct(bench, 0, 0, 30)
    bench.settle()
    bench.move(SQUARE[0])
    bench.settle()
    correct(bench, 0, 0, 5)
    bench.settle()
    assert bench.here().tool.X[:3, 3] == pytest.approx([-100, 500, 5], abs=1e-6)
    correct(bench, 0, 0, 60)
    bench.sleep(0.05)
    bench.arm.brake(now=bench.now)
    bench.settle()
    stopped = bench.here().tool
    assert 5 < stopped.X[2, 3] < 60
    correct(bench, 0, 0, 1)
    bench.settle()
    assert bench.here().tool.X[2, 3] == pytest.approx(stopped.X[2, 3] + 1, abs=1e-6)


def test_what_is_meant_for_the_next_motion_waits_for_that():
    bench = altering(3)
    bench.arm.set_speed(10, turn=None, unit="%", always=False)
    bench.arm.set_hand(False)
    correct(bench, 0, 0, 5)
    begun = bench.settle()
    assert begun < 2.0
    assert bench.here().hand == 100.0
    bench.move(SQUARE[0])
    slow = bench.settle() - begun
    assert bench.here().hand == 0.0
    plain = Bench()
    plain.move(from_oat(0, 500, 55, 90, 60, 0))
    begun = plain.settle()
    plain.move(SQUARE[0])
    assert slow > 3 * (plain.settle() - begun)


def test_a_brake_before_a_correction_begins_keeps_its_own_settings():
    bench = altering(3)
    bench.arm.set_speed(20, turn=None, unit="%", always=False)
    correct(bench, 0, 0, 40)
    correct(bench, 0, 0, 40)
    bench.arm.brake(now=bench.now)
    bench.settle()
    begun = bench.now
    bench.move(SQUARE[0])
    assert bench.settle() - begun > 2.0


def test_alter_comes_first_and_needs_power(tmp_path):
    bench = Bench()
    with pytest.raises(ValError, match=r"\*Path isn't altered\*"):
        correct(bench, 1)
    for mode in (4, -1):
        with pytest.raises(ValError, match=r"\*Illegal value\* mode .*0 to 3"):
            bench.arm.set_alter(mode, now=bench.now)
    sitting = Sitting(tmp_path)
    sitting.type("DO ALTER (1) 3", "DISABLE POWER")
    stood = sitting.joints()
    assert "*Arm power off*" in sitting.type("DO ALTOUT 0,0,-5")
    sitting.pass_time(1.0)
    assert sitting.joints() == stood


def test_what_is_out_of_reach_is_refused_and_nothing_moves():
    bench = altering(3)
    with pytest.raises(ValError, match=r"\*Straight line not possible\*|\*Location out of range\*"):
        correct(bench, 5000)
    correct(bench, 0, 0, 5)
    bench.settle()
    assert bench.here().tool.X[:3, 3] == pytest.approx(PLACE.X[:3, 3] + [0, 0, 5], abs=1e-6)


def test_a_dry_run_moves_the_destination_alone():
    bench = altering(3)
    stood = bench.here().tool
    bench.arm.set_dry_run(True)
    correct(bench, 0, 0, 5)
    assert close(bench.here(), stood) == 0.0
    assert bench.arm.destination(now=bench.now).tool.X[2, 3] == pytest.approx(stood.X[2, 3] + 5)


LOOP = """.PROGRAM main()
    LEFTY
    MOVE TRANS(400, 100, 100, 90, 90, 0)
    BREAK
    ALTER (1) {mode}
    TIMER 1 = 0
    FOR i = 1 TO 50
        ALTOUT {correction}
    END
    t = TIMER(1)
    NOALTER
    SET p = HERE
    TYPE /F12.6, t, DX(p), DY(p), DZ(p)
.END
"""


def played(text, delay="none"):
    typed = []
    run = play(parse_file(text, "a.v2"), load("puma560"), delay_profile(delay), exact_arm, seed=1,
               listeners=Listeners(typed.append))  # fmt: skip
    assert run.error is None
    return run.run, [float(word) for word in "".join(typed).split()]


@pytest.mark.parametrize(
    ("mode", "correction", "expected"),
    [
        (3, "0.2, 0, 0", (410, 100, 100)),
        (2, "0.2*i, 0, 0", (410, 100, 100)),
        (1, "0.2, 0, 0", None),
        (3, "0, 0.3, -0.1", (400, 115, 95)),
    ],
)
def test_a_loop_takes_28_ms_a_correction(mode, correction, expected):
    _, (seconds, *reached) = played(LOOP.format(mode=mode, correction=correction))
    assert seconds == pytest.approx(50 * 0.028, abs=0.05)
    if expected is None:
        expected = (from_oat(400, 100, 100, 90, 90, 0) @ offset(x=10)).X[:3, 3]
    assert reached == pytest.approx(expected, abs=1e-4)


def test_a_loop_that_asks_for_more_than_the_arm_can_takes_longer_and_is_exact():
    _, (seconds, *reached) = played(LOOP.format(mode=3, correction="2, 0, 0"))
    assert 50 * 0.028 < seconds < 3.0
    assert reached == pytest.approx([500, 100, 100], abs=1e-4)


def test_the_real_arm_makes_the_same_corrections_under_delay():
    run, (_, *reached) = played(LOOP.format(mode=2, correction="3*SIN(i*36), 0.5*i, 0"), delay="mon")
    assert reached == pytest.approx([400, 125, 100], abs=1e-4)
    assert np.abs(run.q_real[-1] - run.q_virtual[-1]).max() < 1e-6


def test_delays_and_waits_between_corrections():
    text = """.PROGRAM main()
    MOVE TRANS(0, 500, 50, 90, 60, 0)
    ALTER (1) 3
    FOR i = 1 TO 5
        ALTOUT 0, 0, 1
        DELAY 0.1
        ALTOUT 0, 0, 1
        WAIT.EVENT , 0.028
    END
    NOALTER
    TYPE DZ(HERE)
.END
"""
    assert played(text)[1] == pytest.approx([60], abs=1e-3)


@pytest.mark.parametrize("link", [constant(0.0), constant(0.2), bad(0.1, 0.1, 0.05, 0.02)])
def test_an_arm_elsewhere_makes_the_same_corrections(link):
    line = Line(link)
    arm = Arm(RemoteRobot(line, MODEL))
    arm.move(from_oat(-100, 550, 0, 90, 90, 0), straight=False, now=line.now)
    line.until(arm.settled)
    arm.set_alter(3, now=line.now)
    for _ in range(5):
        arm.alter((2, 0, 0, 0, 0, 0), now=line.now)
        with pytest.raises(ValError, match=r"\*Robot is moving\* .* no answer yet"):
            arm.alter((2, 0, 0, 0, 0, 0), now=line.now)
        line.until(arm.ready)
    line.until(arm.settled)
    assert to_oat(arm.here(now=line.now).tool)[:3] == pytest.approx((-90, 550, 0), abs=1e-5)
