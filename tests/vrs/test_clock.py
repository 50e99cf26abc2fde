"""A slewed clock keeps its rate, arrives where it should, and doesn't care how often it's asked."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vrs.clock import ManualClock, SlewedClock, WallClock
from vrs.errors import InvalidValueError

SHIFTS = st.floats(-4000.0, 4000.0)


def test_it_slews_at_the_stated_rate_and_then_keeps_pace():
    base = ManualClock(100.0)
    clock = SlewedClock(base, D=-0.3, slew=0.05)
    assert clock.now() == 99.7
    clock.follow(-0.4)
    assert (clock.target, clock.D) == (-0.4, pytest.approx(-0.3))
    base.advance(1.0)
    assert clock.now() == pytest.approx(100.65)
    base.advance(1.0)
    assert clock.now() == pytest.approx(101.6)
    base.advance(50.0)
    assert clock.now() == pytest.approx(151.6)
    assert abs(clock.D + 0.4) < 1e-9
    clock.follow(0.0)
    base.advance(1.0)
    assert clock.now() == pytest.approx(152.65)


@given(
    st.lists(st.tuples(st.floats(0.0, 100.0), st.none() | SHIFTS), max_size=40),
    SHIFTS,
    st.sampled_from([0.001, 0.05, 0.5, 0.999]),
)
def test_it_never_runs_back_and_never_jumps(schedule, D, slew):
    """Whatever it's told to follow, an hour back included."""
    base = ManualClock(0.0)
    clock = SlewedClock(base, D, slew)
    readings = [(base.now(), clock.now())]
    for dt, target in schedule:
        base.advance(dt)
        if target is not None:
            clock.follow(target)
        readings.append((base.now(), clock.now()))
        assert abs(clock.D - clock.target) <= 8001.0
    for (t, reading), (t_next, reading_next) in pairwise(readings):
        assert reading_next >= reading
        assert abs((reading_next - reading) - (t_next - t)) <= slew * (t_next - t) + 1e-9
    base.advance(8001.0 / slew)
    assert clock.now() == pytest.approx(base.now() + clock.target, abs=1e-6)


@given(st.lists(st.floats(0.0, 3.0), min_size=1, max_size=20), st.floats(-1.0, 1.0))
def test_its_reading_does_not_depend_on_how_often_it_is_asked(waits, target):
    base = ManualClock(0.0)
    asked, left_alone = SlewedClock(base), SlewedClock(base)
    asked.follow(target)
    left_alone.follow(target)
    for wait in waits:
        base.advance(wait)
        asked.now()
    assert asked.now() == left_alone.now()


@pytest.mark.parametrize(("start", "shift"), [(1.7e9, 0.0), (0.3, 1.7e9), (1.7e9, -1.7e9)])
def test_rounding_does_not_run_it_back(start, shift):
    """Steps near the rounding of Unix time, the target changing before it's reached and after."""
    rng = np.random.default_rng(0)
    base = ManualClock(start)
    clock = SlewedClock(base, shift)
    readings = [clock.now()]
    for dt in (10.0 ** rng.uniform(-8, -6, 5000)).tolist():
        base.advance(dt)
        if rng.random() < 0.3:
            clock.follow(shift + 1e-6 * rng.uniform(-1, 1))
        readings.append(clock.now())
    assert readings == sorted(readings)


@pytest.mark.parametrize("slew", [0.0, 1.0, -0.1, math.nan, math.inf])
def test_a_slew_that_stands_or_runs_back_is_refused(slew):
    with pytest.raises(InvalidValueError):
        SlewedClock(ManualClock(), slew=slew)


def test_nonsense_is_refused_and_changes_nothing():
    base = ManualClock(1.0)
    clock = SlewedClock(base, D=2.0)
    with pytest.raises(InvalidValueError):
        clock.follow(math.nan)
    with pytest.raises(InvalidValueError):
        SlewedClock(base, D=math.inf)
    assert (clock.now(), clock.target) == (3.0, 2.0)


def test_a_wall_clock_can_be_made_again_from_its_origin():
    clock = WallClock(5.0)
    before = clock.now()
    again = WallClock.since(clock.origin).now()
    assert before <= again <= clock.now()
    assert again >= 5.0
    with pytest.raises(InvalidValueError, match="origin"):
        WallClock.since(math.nan)
