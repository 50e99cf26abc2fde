"""Motions: what the arm does with what programs ask of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from interfaces.val2.errors import ValError
from interfaces.val2.geometry import about_z, from_oat, to_oat
from interfaces.val2.motion import Arm, EngineRobot
from interfaces.val2.motion.places import NEST, READY, Frames, aligned
from interfaces.val2.values import NULL, PrecisionPoint
from robots import puma560
from vrs import Engine, ManualClock, Status

model = puma560.model()
DOWN = (90.0, 90.0, 0.0)
SQUARE = [from_oat(x, y, 0, *DOWN) for x, y in ((-100, 500), (100, 500), (100, 600), (-100, 600))]


class Bench:
    """An arm on an engine of its own, and its time."""

    def __init__(self, q=None, **options):
        self.clock = ManualClock(0.0)
        self.engine = Engine(model, q=model.poses["nominal"] if q is None else q, clock=self.clock)
        self.arm = Arm(EngineRobot(self.engine), **options)
        self.now = 0.0

    def until(self, ready):
        for _ in range(1000):
            if ready(now=self.now):
                return self.now
            deadline = self.arm.next_deadline()
            assert self.now < deadline < 1e6
            self.sleep(deadline - self.now)
        raise AssertionError("never")

    def sleep(self, seconds):
        self.now += seconds
        self.clock.set(self.now)

    def settle(self):
        return self.until(self.arm.settled)

    def move(self, *places, straight=False):
        for place in places:
            self.arm.move(place, straight=straight, now=self.now)
            self.until(self.arm.ready)

    def here(self):
        return self.arm.here(now=self.now)

    def tips(self, start, end, n=3001):
        """Times, and the tool's tip in VAL's world [mm]."""
        t = np.linspace(start, end, n)
        X = model.forward(self.engine.timeline.sample(t)) @ Frames(model).tip()
        return t, X[:, :3, 3] * [-1000, -1000, 1000]


def close(where, place):
    return np.abs(where.tool.X - place.X).max()


def square(*, straight=True, speed=100.0, monitor=100.0, stops=False, change=None, continuous=True):
    """Once round the square; the bench, when it began and when it ended."""
    bench = Bench()
    bench.arm.set_continuous_path(continuous)
    bench.move(SQUARE[0])
    start = bench.settle()
    bench.arm.set_monitor_speed(monitor, now=bench.now)
    bench.arm.set_speed(speed, turn=None, unit="%", always=True)
    for k in (1, 2, 3, 0):
        bench.arm.move(SQUARE[k], straight=straight, now=bench.now)
        if change is not None and change[0] == k:
            bench.sleep(change[1])
            bench.arm.set_monitor_speed(change[2], now=bench.now)
        bench.until(bench.arm.settled if stops else bench.arm.ready)
    return bench, start, bench.settle()


def corner_distance(bench, start, end):
    """How far the tip stays away from the three corners between [mm]."""
    _, p = bench.tips(start, end)
    return [np.linalg.norm(p - corner.X[:3, 3], axis=1).min() for corner in SQUARE[1:]]


def slowest(bench, start, end):
    """The tip's least speed between the first and the last tenth [mm/s]."""
    t, p = bench.tips(start, end)
    v = np.linalg.norm(np.gradient(p, t, axis=0), axis=1)
    return v[len(v) // 10 : -len(v) // 10].min()


def off_path(reference, span, other, other_span):
    """The farthest that joints of one run are from the path of another [rad]."""
    s = np.linspace(*span, 20001)
    known = reference.engine.timeline.sample(s)
    worst, k = 0.0, 0
    for t in np.linspace(*other_span, 400):
        q = other.engine.timeline.sample(float(t))
        low = max(k - 50, 0)
        k = low + int(np.argmin(np.abs(known[low : low + 4000] - q).max(axis=1)))
        x = float(s[k])
        for _ in range(8):
            miss = reference.engine.timeline.sample(x) - q
            v = reference.engine.timeline.sample(x, derivative=1)
            if v @ v < 1e-14:
                break
            x = min(max(x - float(miss @ v) / float(v @ v), span[0]), span[1])
        worst = max(worst, float(np.abs(reference.engine.timeline.sample(x) - q).max()))
    return worst


def test_ready_reads_as_the_arm_straight_up():
    bench = Bench()
    bench.arm.go_ready(now=0.0)
    bench.settle()
    where = bench.here()
    assert to_oat(where.tool)[:3] == pytest.approx((-20.3, 150.05, 863.6 + 56.25), abs=0.05)
    assert to_oat(where.tool)[3:] == pytest.approx((90.0, -90.0, 0.0), abs=0.01)
    assert where.joints.joints == pytest.approx(READY.joints, abs=1e-9)


def test_ready_and_nest_dont_depend_on_the_configuration():
    for word in ("LEFTY", "RIGHTY", "FLIP"):
        bench = Bench()
        bench.arm.set_configuration(word)
        bench.arm.go_ready(now=0.0)
        bench.settle()
        assert bench.here().joints.joints == pytest.approx(READY.joints, abs=1e-9)
        bench.arm.nest(now=bench.now)
        bench.settle()
        assert bench.here().joints.joints == pytest.approx(NEST.joints, abs=1e-9)


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


@pytest.mark.parametrize("straight", [True, False])
def test_a_blended_square_doesnt_stop_and_is_rounded_more_when_its_faster(straight):
    rounding = []
    for speed in (10.0, 30.0, 60.0):
        bench, start, end = square(straight=straight, speed=speed)
        assert slowest(bench, start, end) > 0.3 * 500 * speed / 100 * 0.9
        rounding.append(max(corner_distance(bench, start, end)))
    assert 0.1 < rounding[0] < 0.6 * rounding[1] < 0.36 * rounding[2]


@pytest.mark.parametrize("how", [{"stops": True}, {"continuous": False}])
def test_break_and_cp_off_stop_at_each_corner(how):
    bench, start, end = square(**how)
    assert max(corner_distance(bench, start, end)) < 0.05
    assert slowest(bench, start, end) < 1.0
    ends = [receipt.end for receipt in bench.engine.receipts[1:]]
    stands = bench.engine.timeline.sample(np.array(ends), derivative=1)
    assert np.abs(stands).max() < 1e-9
    _, start_of, end_of = square()
    assert end_of - start_of < end - start


@pytest.mark.parametrize("straight", [True, False])
@pytest.mark.parametrize("monitor", [50.0, 12.5])
def test_monitor_speed_stretches_time_and_nothing_else(straight, monitor):
    whole, start, end = square(straight=straight)
    slow, start_of, end_of = square(straight=straight, monitor=monitor)
    assert (end_of - start_of) * monitor / 100 == pytest.approx(end - start, rel=1e-9)
    share = np.linspace(0.0, 1.0, 1001)
    q = whole.engine.timeline.sample(start + share * (end - start))
    assert np.abs(slow.engine.timeline.sample(start_of + share * (end_of - start_of)) - q).max() < 1e-9


@pytest.mark.parametrize(
    ("monitor", "change"), [(100.0, (2, 0.02, 30.0)), (100.0, (3, 0.1, 50.0)), (25.0, (2, 0.3, 100.0))]
)
def test_monitor_speed_changed_in_mid_motion_keeps_the_path(monitor, change):
    whole, start, end = square()
    other, start_of, end_of = square(monitor=monitor, change=change)
    assert off_path(whole, (start, end), other, (start_of, end_of)) < 1e-9
    assert other.arm.monitor_speed() == change[2]
    assert end_of - start_of > 1.05 * (end - start)


@pytest.mark.parametrize("late", [False, True])
def test_a_motion_that_is_asked_for_late_while_the_pace_changes_has_its_corner_rounded_less_and_no_other(late):
    whole, start, end = square()
    bench = Bench()
    bench.move(SQUARE[0])
    start_of = bench.settle()
    for k in (1, 2, 3, 0):
        bench.arm.move(SQUARE[k], straight=True, now=bench.now)
        bench.until(bench.arm.ready)
        if k == 2:
            # The line to the third corner brakes 0.27 s after it begins.
            bench.sleep(0.17 if late else 0.0)
            bench.arm.set_monitor_speed(10.0, now=bench.now)
            bench.sleep(0.0 if late else 0.4)
    end_of = bench.settle()
    assert slowest(bench, start_of, end_of) > 0.3 * 50.0 * 0.9
    usual, here = corner_distance(whole, start, end), corner_distance(bench, start_of, end_of)
    changed = [k for k in range(3) if abs(usual[k] - here[k]) > 0.02]
    assert changed == ([1] if late else [])
    assert here[1] > 1.0
    assert here[1] <= usual[1] + 0.02
    assert off_path(whole, (start, end), bench, (start_of, end_of)) < (0.02 if late else 1e-9)


def test_a_faster_monitor_speed_that_is_refused_on_the_way_to_a_slower_one_comes_after_it():
    refused = 0
    whole, start, end = square()
    for wait in (0.0, 0.02, 0.2):
        bench = Bench()
        bench.move(SQUARE[0])
        start_of = bench.settle()
        for k in (1, 2, 3, 0):
            bench.arm.move(SQUARE[k], straight=True, now=bench.now)
            if k == 2:
                bench.sleep(0.02)
                bench.arm.set_monitor_speed(5.0, now=bench.now)
                bench.sleep(wait)
                bench.arm.set_monitor_speed(100.0, now=bench.now)
            bench.until(bench.arm.ready)
        end_of = bench.settle()
        assert bench.arm.monitor_speed() == 100.0
        assert off_path(whole, (start, end), bench, (start_of, end_of)) < 1e-9
        assert end_of - start_of < 2.0 * (end - start)
        refused += sum(receipt.status is Status.REJECTED for receipt in bench.engine.receipts)
    assert refused > 0


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


def test_program_speed_is_for_the_next_motion_unless_always():
    def times(*settings):
        bench = Bench()
        bench.arm.set_continuous_path(False)
        bench.move(SQUARE[0])
        bench.settle()
        for speed, always in settings:
            bench.arm.set_speed(speed, turn=None, unit="%", always=always)
        spans = []
        for k in (1, 0):
            begun = bench.now
            bench.move(SQUARE[k], straight=True)
            spans.append(bench.settle() - begun)
        return spans

    full, slow = times()[0], times((20, True))[0]
    assert slow > 3 * full
    assert times((20, False)) == pytest.approx([slow, full], rel=1e-3)
    assert times((20, True), (100, False)) == pytest.approx([full, slow], rel=1e-3)


@pytest.mark.parametrize(("value", "unit", "expected"), [(100, "MMPS", 100.0), (4, "IPS", 101.6), (30, "%", 150.0)])
def test_straight_lines_have_the_speed_of_the_tip(value, unit, expected):
    bench = Bench()
    bench.move(SQUARE[3])
    bench.settle()
    bench.arm.set_speed(value, turn=None, unit=unit, always=False)
    begun = bench.now
    bench.move(SQUARE[2], straight=True)
    t, p = bench.tips(begun, bench.settle())
    v = np.linalg.norm(np.gradient(p, t, axis=0), axis=1)
    assert v.max() == pytest.approx(expected, rel=1e-3)
    assert np.abs(p[:, 1:] - [600, 0]).max() < 2e-3


def test_turning_has_a_speed_of_its_own():
    bench = Bench()
    bench.move(SQUARE[0])
    bench.settle()
    spans = []
    for turn in (50.0, 25.0):
        bench.arm.set_speed(100, turn=turn, unit="%", always=False)
        begun, place = bench.now, bench.here().tool
        bench.move(place @ about_z(60.0), straight=True)
        spans.append(bench.settle() - begun)
    assert spans[0] == pytest.approx(60 / (0.5 * 90), abs=0.4)
    assert spans[1] == pytest.approx(60 / (0.25 * 90), abs=0.4)


def test_duration_is_the_least_time_of_a_motion():
    bench = Bench()
    bench.move(SQUARE[0])
    bench.settle()
    bench.arm.set_duration(4.0, always=False)
    begun = bench.now
    bench.move(SQUARE[1])
    assert bench.settle() - begun == pytest.approx(4.0, rel=1e-6)
    begun = bench.now
    bench.move(SQUARE[0])
    assert bench.settle() - begun < 2.0


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
    place = base.inverse() @ from_oat(0, 450, 100, *DOWN)
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
    assert word in bench.arm._frames.configured(q)
    if "FLIP" in word:
        assert (joints[4] < 0) == (word == "FLIP")
    else:
        lifts = model.forward(q + np.eye(6)[1] * 1e-4)[2, 3] - model.forward(q)[2, 3]
        assert (lifts > 0) == (word == "RIGHTY")


def test_above_has_the_elbow_over_the_wrist_line():
    for word in ("ABOVE", "BELOW"):
        for arm in ("LEFTY", "RIGHTY"):
            q = Frames(model).solve(from_oat(100, 500, 100, 90, 0, 0), model.poses["nominal"], (arm, word))
            elbow, wrist = model.links(q)[2][:3, 3], model.forward(q)[:3, 3]
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
    assert (np.abs(bench.engine.timeline.sample(t, derivative=2)) <= model.limits.qdd_max * (1 + 1e-9)).all()
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


@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_alter_steers_the_tip(mode):
    bench = Bench()
    bench.move(from_oat(0, 500, 50, 90, 60, 0))
    bench.settle()
    place = bench.here().tool
    with pytest.raises(ValError, match=r"\*Path isn't altered\*"):
        bench.arm.alter((1, 0, 0, 0, 0, 0), now=bench.now)
    bench.arm.set_alter(mode, now=bench.now)
    for k in range(60):
        sway = (k + 1) * 1.0
        asked = 1.0 if mode & 1 else sway
        bench.arm.alter((0, asked, 0, 0, 0, 0), now=bench.now)
        bench.sleep(0.028)
    bench.arm.set_alter(None, now=bench.now)
    bench.settle()
    moved = bench.here().tool.X[:3, 3] - place.X[:3, 3]
    axis = np.eye(3)[1] if mode & 2 else place.X[:3, 1]
    assert moved @ axis == pytest.approx(60.0, abs=12.0)
    assert np.linalg.norm(np.cross(moved, axis)) < 2.0


def test_alter_waits_for_motions():
    bench = Bench()
    bench.arm.set_alter(0, now=0.0)
    bench.arm.move(SQUARE[0], straight=False, now=0.0)
    with pytest.raises(ValError, match=r"\*Robot is moving\*"):
        bench.arm.alter((1, 0, 0, 0, 0, 0), now=0.0)


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
