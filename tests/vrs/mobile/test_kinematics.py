"""Kinematics against the printed equations, and against integration in many digits."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vrs import ArcSegment
from vrs.mobile.model import (
    advanced,
    all_wrapped,
    constraint,
    displaced,
    increment,
    jacobian,
    on_arcs,
    rotation,
    speeds,
    wheel_speeds,
    wrapped,
)

close = partial(np.testing.assert_allclose, rtol=0.0)

LATE = settings(deadline=None)
V, W = st.floats(-0.5, 0.5), st.floats(-math.pi / 4, math.pi / 4)
TINY = st.floats(-1e-7, 1e-7)
POSTURE = st.tuples(st.floats(-10, 10), st.floats(-10, 10), st.floats(-50, 50))
DURATION = st.floats(1e-3, 20.0)
ANY_W = st.one_of(W, TINY, st.just(0.0))


@LATE
@given(V, W, st.floats(0.05, 0.6))
def test_wheels_and_speeds_are_each_others_inverse(v, w, base):
    u = np.array([v, w])
    matrix = np.array([[0.5, 0.5], [1 / base, -1 / base]])
    wheels = wheel_speeds(u, base)
    close(matrix @ wheels, u, atol=1e-14)
    close(speeds(wheels, base), u, atol=1e-14)
    np.testing.assert_array_equal(wheel_speeds(np.array([u, -u]), base), [wheels, -wheels])


def test_turning_left_lets_the_right_wheel_run():
    right, left = wheel_speeds((0.0, 1.0), 0.4)
    assert (right, left) == (0.2, -0.2)


@LATE
@given(POSTURE, V, W.filter(lambda w: abs(w) > 1e-2), DURATION)
def test_an_arc_is_the_printed_one(posture, v, w, T):
    r = v / w
    H = np.array([r * math.sin(w * T), r * (1 - math.cos(w * T)), w * T])
    close(increment(v, w, T), H, atol=1e-12)
    expected = np.array(posture) + rotation(posture[2]) @ H
    close(advanced(posture, v, w, T), expected, atol=1e-12)


def taylor(v, w, T):
    """H by the series of sine and cosine, exact where ωT is small."""
    a = w * T
    return v * T * (1 - a * a / 6 + a**4 / 120), v * T * (a / 2 - a**3 / 24), a


@LATE
@given(V, st.floats(-1e-3, 1e-3), st.floats(1e-3, 2.0))
def test_nearly_straight_arcs_lose_no_digits(v, w, T):
    close(increment(v, w, T), taylor(v, w, T), atol=1e-15)
    assert increment(v, 0.0, T) == (v * T, 0.0, 0.0)


@LATE
@given(POSTURE, V, ANY_W, DURATION, st.floats(0.0, 1.0))
def test_an_arc_in_two_parts_is_the_arc(posture, v, w, T, share):
    middle = advanced(posture, v, w, share * T)
    close(advanced(middle, v, w, T - share * T), advanced(posture, v, w, T), atol=1e-12)


@LATE
@given(POSTURE, V, ANY_W, st.floats(0.0, 5.0))
def test_the_wheels_never_slide_along_an_arc(posture, v, w, t):
    """Eq. (3): along the whole arc G(θ) times the rate of change is 0, and eq. (1) gives that rate."""
    row = np.array([[*posture, v, w]])
    (rate,) = on_arcs(row, np.array([t]), 1)
    theta = on_arcs(row, np.array([t]))[0, 2]
    assert abs(constraint(theta) @ rate) <= 1e-13
    close(rate, jacobian(theta) @ (v, w), atol=1e-13)


@LATE
@given(POSTURE, V, W, st.floats(0.1, 5.0), st.sampled_from([1, 2, 3]))
def test_derivatives_are_those_of_the_one_before(posture, v, w, t, order):
    h, row = 1e-4, np.array([[*posture, v, w]] * 2)
    low, high = on_arcs(row, np.array([t - h, t + h]), order - 1)
    close(on_arcs(row[:1], np.array([t]), order)[0], (high - low) / (2 * h), atol=1e-6)


@LATE
@given(POSTURE, V, ANY_W, DURATION)
def test_one_and_many_and_the_segment_agree(posture, v, w, t):
    one = advanced(posture, v, w, t)
    close(on_arcs(np.array([[*posture, v, w]]), np.array([t]))[0], one, atol=1e-13)
    close(ArcSegment(0.0, 30.0, posture, v, w).value(t), one, atol=1e-13)


@LATE
@given(POSTURE, POSTURE, V, ANY_W, DURATION)
def test_arcs_move_as_a_rigid_body(origin, to, v, w, t):
    (row,) = displaced(np.array([[*origin, v, w]]), origin, to)
    close(row, [*to, v, w], atol=1e-12)
    ahead = advanced(origin, v, w, t)
    (row,) = displaced(np.array([[*ahead, v, w]]), origin, to)
    close(row[:3], advanced(to, v, w, t), atol=1e-11)


@pytest.mark.parametrize("angle", [0.0, 3.0, 3.2, -3.2, 9.5, 100.0])
def test_a_wrapped_angle_is_the_same_direction(angle):
    assert -math.pi <= wrapped(angle) <= math.pi
    assert math.cos(wrapped(angle) - angle) == pytest.approx(1.0, abs=1e-12)


def test_many_angles_are_wrapped_as_one_is() -> None:
    angles = np.linspace(-20.0, 20.0, 401).reshape(-1, 1)
    one_by_one = np.array([[wrapped(angle)] for angle in angles[:, 0].tolist()])
    assert np.abs(all_wrapped(angles) - one_by_one).max() < 1e-14
    assert all_wrapped(np.array([np.pi, -np.pi])).tolist() == [-np.pi, -np.pi]
