"""Commands within the limits of acceleration."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vrs.errors import InvalidValueError
from vrs.mobile import DriveLimits, braking, limited

LATE = settings(deadline=None)
LIMITS = DriveLimits(0.5, math.radians(45), 0.52, 2.6)
ANY = st.tuples(st.floats(-5, 5), st.floats(-5, 5))
WITHIN = st.tuples(st.floats(-0.5, 0.5), st.floats(-math.radians(45), math.radians(45)))
PERIOD = st.sampled_from([0.02, 0.1, 0.25])


@LATE
@given(ANY, WITHIN, PERIOD)
def test_a_limited_command_is_the_nearest_that_is_allowed(u, before, T):
    made = limited(u, before, T, LIMITS)
    for got, wanted, last, most, rate in zip(made, u, before, (0.5, LIMITS.w_max), (0.52, 2.6), strict=True):
        low, high = max(-most, last - rate * T), min(most, last + rate * T)
        assert low - 1e-12 <= got <= high + 1e-12
        assert got == pytest.approx(min(max(wanted, low), high), abs=1e-12)


@LATE
@given(WITHIN, PERIOD)
def test_braking_keeps_the_arc_and_the_rates(u, T):
    steps = [u, *braking(u, T, LIMITS), (0.0, 0.0)]
    for (v, w), (after_v, after_w) in pairwise(steps):
        assert abs(after_v - v) <= 0.52 * T * (1 + 1e-8)
        assert abs(after_w - w) <= 2.6 * T * (1 + 1e-8)
        assert after_v * u[1] == pytest.approx(after_w * u[0], abs=1e-15)
        assert abs(after_v) <= abs(v)
    # None fewer would do: what needs n steps has one that's nearly full.
    full = max(abs(u[0]) / (0.52 * T), abs(u[1]) / (2.6 * T))
    assert len(steps) - 2 < max(full, 1e-9) + 1e-6


def test_a_stop_begun_stays_what_it_was():
    u = (0.43, -0.3)
    steps = braking(u, 0.1, LIMITS)
    for k in range(len(steps)):
        rest = braking(steps[k], 0.1, LIMITS)
        assert len(rest) == len(steps) - k - 1
        for got, was in zip(rest, steps[k + 1 :], strict=True):
            assert got == pytest.approx(was, abs=1e-15)


@pytest.mark.parametrize("bad", [{"T": 0.0}, {"T": math.nan}, {"u": (math.inf, 0.0)}])
def test_what_is_no_command_is_refused(bad):
    arguments = {"u": (0.1, 0.0), "before": (0.0, 0.0), "T": 0.1, "limits": LIMITS, **bad}
    with pytest.raises(InvalidValueError):
        limited(**arguments)


@pytest.mark.parametrize("name", ["v_max", "w_max", "a_max", "alpha_max"])
def test_limits_are_positive(name):
    with pytest.raises(InvalidValueError, match=name):
        DriveLimits(**{"v_max": 1, "w_max": 1, "a_max": 1, "alpha_max": 1, name: 0})


@LATE
@given(st.floats(0, 5), st.floats(0, 1), st.floats(0, 0.5))
def test_from_its_braking_speed_the_robot_slows_down_within_the_distance(distance, reaction, end):
    """By stairs of a millisecond, apart from the formula."""
    v, way, dt = LIMITS.braking_speed(distance, reaction, end), 0.0, 1e-3
    assert v >= end
    if v == end:
        return
    way = v * reaction
    while v > end:
        step = min(LIMITS.a_max * dt, v - end)
        way += (v - 0.5 * step) * step / LIMITS.a_max
        v -= step
    assert way == pytest.approx(distance, abs=1e-9)


@LATE
@given(st.floats(-5, 5), st.floats(0, 1))
def test_the_braking_distance_is_the_inverse_either_way(v, reaction):
    assert LIMITS.braking_speed(LIMITS.braking_distance(v, reaction), reaction) == pytest.approx(abs(v), abs=1e-9)


def test_an_obstacle_behind_allows_no_speed():
    assert LIMITS.braking_speed(-1.0, 0.2) == pytest.approx(0.0, abs=1e-15)
