"""The pace and the path of motions: corners, the speed of programs and of the monitor, durations."""

from __future__ import annotations

import numpy as np
import pytest

from interfaces.val2.values import about_z
from tests.interfaces.val2.bench import SQUARE, Bench
from vrs import Status


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
