"""Motions: what the arm does with what programs ask of it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from interfaces.val2.errors import ValError
from interfaces.val2.motion.conventions import PUMA
from interfaces.val2.motion.places import Frames, aligned, with_word
from interfaces.val2.values import NULL, PrecisionPoint
from robots import puma560
from tests.interfaces.val2.bench import DOWN, MODEL, SQUARE, Bench, close, from_oat, to_oat
from vrs import Status


def test_ready_reads_as_the_arm_straight_up():
    bench = Bench()
    bench.arm.go_ready(now=0.0)
    bench.settle()
    where = bench.here()
    assert to_oat(where.tool)[:3] == pytest.approx((-20.3, 150.05, 863.6 + 56.25), abs=0.05)
    assert to_oat(where.tool)[3:] == pytest.approx((90.0, -90.0, 0.0), abs=0.01)
    assert where.joints.joints == pytest.approx(PUMA.ready.joints, abs=1e-9)


def test_ready_and_nest_dont_depend_on_the_configuration():
    for word in ("LEFTY", "RIGHTY", "FLIP"):
        bench = Bench()
        bench.arm.set_configuration(word)
        bench.arm.go_ready(now=0.0)
        bench.settle()
        assert bench.here().joints.joints == pytest.approx(PUMA.ready.joints, abs=1e-9)
        bench.arm.nest(now=bench.now)
        bench.settle()
        assert bench.here().joints.joints == pytest.approx(PUMA.nest.joints, abs=1e-9)


@pytest.mark.parametrize(
    "numbers",
    [
        (180, 470, 120, *DOWN),
        (180, 470, 120, 0, 90, 35),
        (180, 450, 400, 90, -90, 0),
        (180, 450, 400, -170, -90, 20),
        (180, 470, 120, 60, 40, -75),
    ],
)
def test_where_goes_round_by_its_numbers(numbers):
    bench = Bench()
    place = from_oat(*numbers)
    bench.move(place)
    bench.settle()
    read = bench.here()
    assert close(read, place) < 1e-9
    again = Bench()
    again.move(from_oat(*to_oat(read.tool)))
    again.settle()
    assert close(again.here(), place) < 1e-9
    by_joints = Bench()
    by_joints.move(read.joints)
    by_joints.settle()
    assert close(by_joints.here(), place) < 1e-9


def test_break_reads_the_destination_exactly():
    bench = Bench()
    bench.move(*SQUARE[:2])
    bench.move(SQUARE[2], straight=True)
    assert close(bench.arm.destination(now=bench.now), SQUARE[2]) < 1e-9
    assert close(bench.here(), SQUARE[2]) > 1.0
    bench.settle()
    assert close(bench.here(), SQUARE[2]) < 1e-9
    assert not bench.engine.timeline.sample(bench.now, derivative=1).any()


def test_a_motion_may_be_asked_for_when_the_one_before_has_begun():
    bench = Bench()
    bench.arm.move(SQUARE[0], straight=False, now=0.0)
    assert bench.arm.ready(now=0.0)
    assert not bench.arm.settled(now=0.0)
    bench.arm.move(SQUARE[1], straight=False, now=0.0)
    assert not bench.arm.ready(now=0.0)
    begun = bench.until(bench.arm.ready)
    first, second = bench.engine.receipts
    assert begun == second.execute_at < first.end


def test_approach_and_depart_go_along_the_tools_axis():
    bench = Bench()
    place = from_oat(150, 520, -50, 120, 60, 10)
    bench.arm.approach(place, 80.0, straight=False, now=0.0)
    bench.settle()
    behind = place.X[:3, 3] - 80 * place.X[:3, 2]
    assert bench.here().tool.X[:3, 3] == pytest.approx(behind, abs=1e-9)
    bench.move(place, straight=True)
    bench.arm.depart(50.0, straight=True, now=bench.now)
    bench.settle()
    assert bench.here().tool.X[:3, 3] == pytest.approx(place.X[:3, 3] - 50 * place.X[:3, 2], abs=1e-9)


def test_drive_turns_one_joint_from_where_it_goes():
    bench = Bench()
    bench.arm.go_ready(now=0.0)
    bench.until(bench.arm.ready)
    bench.arm.drive(3, 40.0, 50.0, now=bench.now)
    bench.settle()
    assert bench.here().joints.joints == pytest.approx((0, -90, 130, 0, 0, 0), abs=1e-9)
    with pytest.raises(ValError, match=r"\*Location out of range\* Jt 3"):
        bench.arm.drive(3, 100.0, 50.0, now=bench.now)
    with pytest.raises(ValError, match=r"\*Illegal joint number\*"):
        bench.arm.drive(7, 1.0, 50.0, now=bench.now)


def test_draw_and_align():
    bench = Bench()
    bench.move(from_oat(0, 500, 0, 100, 80, 5))
    bench.arm.draw(30, -20, 10, now=bench.now)
    bench.settle()
    assert bench.here().tool.X[:3, 3] == pytest.approx((30, 480, 10), abs=1e-9)
    bench.arm.align(now=bench.now)
    bench.settle()
    assert bench.here().tool.X[:3, 2] == pytest.approx((0, 0, -1), abs=1e-9)
    assert bench.here().tool.X[:3, 3] == pytest.approx((30, 480, 10), abs=1e-9)


def test_aligned_keeps_a_tool_that_is():
    for place in (NULL, from_oat(1, 2, 3, *DOWN), from_oat(0, 0, 0, 0, 0, 30)):
        assert pytest.approx(place.X, abs=1e-12) == aligned(place).X


def test_a_delay_stands_and_the_next_motion_waits_for_it():
    bench = Bench()
    bench.move(SQUARE[0])
    end = bench.engine.timeline.end
    bench.arm.delay(0.75, now=bench.now)
    assert bench.until(bench.arm.ready) == end
    bench.arm.move(SQUARE[1], straight=False, now=bench.now)
    bench.until(bench.arm.ready)
    assert bench.now == pytest.approx(end + 0.75)
    bench.settle()
    bench.arm.delay(0.5, now=bench.now)
    begun = bench.now
    assert bench.settle() == pytest.approx(begun + 0.5)


def test_tool_and_base_change_where_and_how_things_are():
    bench = Bench()
    tool, base = from_oat(0, 30, 120, 90, -90, 0), from_oat(50, 20, -10, 90 + 30, -90, 0)
    bench.arm.set_tool(tool)
    bench.arm.set_base(base)
    place = base @ from_oat(0, 450, 100, *DOWN)
    bench.move(place)
    bench.settle()
    assert close(bench.here(), place) < 1e-9
    start, goal = place, place @ from_oat(60, 0, 0, 90 + 40, -90, 0)
    begun = bench.now
    bench.move(goal, straight=True)
    bench.settle()
    assert close(bench.here(), goal) < 1e-9
    t = np.linspace(begun, bench.now, 201)
    tips = np.array([bench.arm.past(x, now=bench.now).tool.X[:3, 3] for x in t])
    way = goal.X[:3, 3] - start.X[:3, 3]
    aside = np.cross(tips - start.X[:3, 3], way / np.linalg.norm(way))
    assert np.abs(aside).max() < 2e-3


@pytest.mark.parametrize("word", ["LEFTY", "RIGHTY", "FLIP", "NOFLIP"])
def test_a_configuration_is_taken_at_the_next_joint_motion(word):
    bench = Bench()
    place = from_oat(100, 500, 100, *DOWN)
    bench.move(place)
    bench.arm.set_configuration(word)
    bench.move(place)
    bench.settle()
    assert close(bench.here(), place) < 1e-9
    joints, q = bench.here().joints.joints, bench.engine.joints(bench.now)
    assert word in Frames(MODEL).configured(q)
    if "FLIP" in word:
        assert (joints[4] < 0) == (word == "FLIP")
    else:
        lifts = MODEL.forward(q + np.eye(6)[1] * 1e-4)[2, 3] - MODEL.forward(q)[2, 3]
        assert (lifts > 0) == (word == "RIGHTY")


def test_of_a_pair_the_last_word_counts_and_the_others_stay() -> None:
    asked: tuple[str, ...] = ()
    for word in ("LEFTY", "FLIP", "ABOVE", "RIGHTY", "NOFLIP", "NOFLIP"):
        asked = with_word(asked, word)
    assert asked == ("ABOVE", "RIGHTY", "NOFLIP")
    with pytest.raises(ValError, match="a configuration is RIGHTY, LEFTY"):
        with_word(asked, "UPWARDS")


@pytest.mark.parametrize("end", ["q_min", "q_max"])
@pytest.mark.parametrize("share", [1.0, *np.linspace(0.2, 0.9, 8)])
def test_a_joint_may_stand_at_its_limit_and_no_farther(end, share):
    usual = MODEL.limits
    limits = replace(usual, q_min=share * usual.q_min, q_max=share * usual.q_max)
    frames = Frames(puma560.model(limits))
    for k in range(6):
        for turn in (0.0, 1e-6, -1e-6):
            q = np.zeros(6)
            q[k] = getattr(limits, end)[k] + turn
            point = PUMA.point(q, limits)
            if limits.q_min[k] <= q[k] <= limits.q_max[k]:
                assert frames.joints(point) == pytest.approx(q, abs=1e-12)
                limits.check(frames.joints(point))
            else:
                with pytest.raises(ValError, match=rf"\*Location out of range\* Jt {k + 1} would be"):
                    frames.joints(point)


def test_angles_are_read_in_one_turn():
    for o, a, t in ((-180, 20, 30), (180, 20, 30), (10, 20, -180), (10, 20, 180), (-90, 0, -180), (270, -45, 540)):
        read = to_oat(from_oat(1, 2, 3, o, a, t))[3:]
        assert all(-180.0 < angle <= 180.0 for angle in read), read
        assert np.cos(np.radians(read)) == pytest.approx(np.cos(np.radians((o, a, t))), abs=1e-9)


def test_above_has_the_elbow_over_the_wrist_line():
    for word in ("ABOVE", "BELOW"):
        for arm in ("LEFTY", "RIGHTY"):
            q = Frames(MODEL).solve(from_oat(100, 500, 100, 90, 0, 0), MODEL.poses["nominal"], (arm, word))
            elbow, wrist = MODEL.links(q)[2][:3, 3], MODEL.forward(q)[:3, 3]
            height = elbow[2] - wrist[2] * np.hypot(*elbow[:2]) / np.hypot(*wrist[:2])
            assert (height > 0) == (word == "ABOVE")


def test_what_cant_be_reached_changes_nothing():
    bench = Bench()
    bench.move(SQUARE[0])
    bench.settle()
    before = bench.engine.timeline
    bench.arm.set_speed(10, turn=None, unit="%", always=False)
    bench.arm.set_hand(False)
    with pytest.raises(ValError, match=r"beyond the reach of 864\.077 mm"):
        bench.arm.move(from_oat(900, 900, 0, *DOWN), straight=False, now=bench.now)
    for target in (from_oat(900, 900, 0, *DOWN), PrecisionPoint((0, 60, 0, 0, 0, 0))):
        with pytest.raises(ValError, match=r"\*Location out of range\*"):
            bench.arm.move(target, straight=False, now=bench.now)
    with pytest.raises(ValError, match=r"\*Straight line not possible\*"):
        bench.arm.move(from_oat(100, -500, 0, *DOWN), straight=True, now=bench.now)
    assert bench.engine.timeline is before
    assert bench.arm.settled(now=bench.now)
    begun = bench.now
    bench.move(SQUARE[1], straight=True)
    assert bench.settle() - begun > 3.0
    assert bench.here().hand == 0.0


def test_the_hand_moves_with_its_motion_and_takes_its_time():
    gripped = []
    bench = Bench(parameters={"HAND.TIME": 0.2}, gripped=lambda t, holds: gripped.append((t, holds)))
    bench.move(SQUARE[0])
    bench.arm.set_hand(False)
    bench.arm.move(SQUARE[1], straight=False, now=bench.now)
    assert bench.here().hand == 100.0
    assert bench.arm.destination(now=bench.now).hand == 0.0
    begun = bench.until(bench.arm.ready)
    bench.sleep(0.1)
    assert bench.here().hand == pytest.approx(50.0)
    bench.settle()
    assert bench.here().hand == 0.0
    assert gripped == [(begun + 0.2, True)]
    bench.arm.actuate(True, now=bench.now)
    opened = bench.now
    assert gripped[1:] == [(opened, False)]
    assert bench.settle() == pytest.approx(opened + 0.2)
    bench.arm.move(SQUARE[0], straight=True, hand=30.0, now=bench.now)
    bench.settle()
    assert bench.here().hand == 30.0


def test_braking_keeps_the_limits_and_a_retry_does_the_motion_again():
    bench = Bench()
    bench.move(SQUARE[0])
    bench.settle()
    bench.move(SQUARE[1], straight=True)
    bench.sleep(0.3)
    bench.arm.brake(now=bench.now)
    begun, stopped = bench.now, bench.settle()
    assert 0.0 < stopped - begun < 0.5
    t = np.linspace(begun, stopped, 400, endpoint=False)
    assert (np.abs(bench.engine.timeline.sample(t, derivative=2)) <= MODEL.limits.qdd_max * (1 + 1e-9)).all()
    assert close(bench.here(), SQUARE[1]) > 1.0
    assert bench.arm.retry(now=bench.now)
    bench.settle()
    assert close(bench.here(), SQUARE[1]) < 1e-9
    assert not bench.arm.retry(now=bench.now)


def test_what_was_asked_for_a_motion_that_hadnt_begun_is_for_the_next_one_again():
    bench = Bench()
    bench.move(SQUARE[0])
    bench.settle()
    bench.arm.move(SQUARE[1], straight=True, now=bench.now)
    bench.arm.set_speed(10, turn=None, unit="%", always=False)
    bench.arm.set_hand(False)
    bench.arm.move(SQUARE[2], straight=True, now=bench.now)
    bench.sleep(0.2)
    bench.arm.brake(now=bench.now)
    bench.settle()
    assert bench.here().hand == 100.0
    assert bench.arm.retry(now=bench.now)
    bench.settle()
    assert close(bench.here(), SQUARE[1]) < 1e-9
    begun = bench.now
    bench.move(SQUARE[2], straight=True)
    assert bench.settle() - begun > 100 / 50
    assert bench.here().hand == 0.0


def test_a_dry_run_moves_nothing_and_knows_what_it_cant_reach():
    bench = Bench()
    before = bench.here()
    bench.arm.set_dry_run(True)
    bench.move(SQUARE[0])
    bench.arm.depart(50, straight=True, now=bench.now)
    assert bench.settle() == 0.0
    assert close(bench.here(), before.tool) == 0.0
    assert bench.arm.destination(now=0.0).tool.X[:3, 3] == pytest.approx((-100, 500, 50), abs=1e-9)
    with pytest.raises(ValError, match=r"\*Location out of range\*"):
        bench.move(from_oat(2000, 0, 0, *DOWN))
    bench.arm.set_dry_run(False)
    assert close(bench.arm.destination(now=0.0), before.tool) == 0.0


def test_what_was_asked_for_motions_to_come_ends_with_the_program():
    bench, plain = Bench(), Bench()
    bench.arm.set_configuration("RIGHTY")
    bench.arm.at(9.0)
    bench.arm.set_hand(False)
    bench.arm.set_speed(10, turn=None, unit="%", always=True)
    bench.arm.begin_program()
    for one in (bench, plain):
        one.move(SQUARE[0])
        one.settle()
    assert bench.engine.joints(bench.now) == pytest.approx(plain.engine.joints(plain.now), abs=1e-12)
    assert (bench.now, bench.here().hand) == (pytest.approx(plain.now), 100.0)


def test_a_motion_at_a_time_begins_then():
    bench = Bench()
    bench.arm.at(2.5)
    bench.arm.move(SQUARE[0], straight=False, now=0.0)
    assert bench.until(bench.arm.ready) == 2.5
    assert bench.engine.receipts[-1].execute_at == 2.5


def test_the_newest_motion_can_be_taken_back():
    bench = Bench()
    bench.arm.move(SQUARE[0], straight=False, now=0.0)
    bench.arm.at(9.0)
    bench.arm.move(SQUARE[1], straight=False, now=0.0)
    assert [line.split()[0] for line in bench.arm.timeline(now=0.0)] == ["1", "2"]
    assert bench.arm.undo(now=0.0) == "Command 2 was taken back"
    assert [line.split()[0] for line in bench.arm.timeline(now=0.0)] == ["1"]
    assert bench.arm.ready(now=0.0)
    bench.settle()
    assert close(bench.here(), SQUARE[0]) < 1e-9


@pytest.mark.parametrize("value", [0.0, -5.0, math.inf, math.nan])
def test_impossible_settings_are_refused(value):
    arm = Bench().arm
    for call in (
        lambda: arm.set_speed(value, turn=None, unit="%", always=True),
        lambda: arm.set_acceleration(value, 100.0),
        lambda: arm.set_monitor_speed(value, now=0.0),
        lambda: arm.set_tolerance(value, fine=True, always=False),
        lambda: arm.drive(1, 1.0, value, now=0.0),
    ):
        with pytest.raises(ValError, match=r"\*Illegal value\*"):
            call()


def test_motions_are_commands_that_can_be_inspected():
    bench = Bench()
    bench.move(*SQUARE[:3], straight=False)
    statuses = {receipt.status for receipt in bench.engine.receipts}
    assert statuses == {Status.ACCEPTED}
    assert len(bench.engine.receipts) == 3
