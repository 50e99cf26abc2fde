"""The quadratic-curve tracker: the paper's equations one by one, both ways of reversing, and whole paths."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.onboard.curve import Curve
from robots.onboard.curve_trackers import (
    Backwards,
    PurePursuit,
    PurePursuitConfig,
    QuadraticCurveTracker,
    QuadraticTrackerConfig,
    parabola_drive,
    wheel_rates,
)
from vrs.errors import InvalidValueError
from vrs.mobile import advanced, speeds
from vrs.mobile.model import Wheels

S = Curve([(0, 1), (1, 1.8), (2.5, 0.3), (3.5, 1)])
COORDINATE = st.floats(-5, 5).filter(lambda value: abs(value) > 1e-3)


def driven(control, posture, seconds, period=0.01):
    rows = [posture]
    for _ in range(round(seconds / period)):
        v, w = control(posture)
        posture = advanced(posture, v, w, period)
        rows.append(posture)
    return np.array(rows)


def away(curve, rows):
    return max(math.dist(curve.at(curve.nearest(x, y))[:2], (x, y)) for x, y, _ in rows.tolist())


@given(COORDINATE, COORDINATE, st.floats(0.1, 5))
def test_as_printed(e_x, e_y, alpha):
    """Eq. (9), (13), (15), (16), letter by letter."""
    A = math.copysign(1, e_x) * e_y / e_x**2
    K = math.copysign(1, e_x) * alpha / (1 + abs(A))
    assert parabola_drive(e_x, e_y, alpha) == pytest.approx((K, 2 * A * K))


@given(COORDINATE, COORDINATE)
def test_along_the_parabola_the_point_is_reached_either_way(e_x, e_y):
    """y = A x² goes through the point, v leads to its side, and ω bends the way as the parabola at its vertex."""
    v, w = parabola_drive(e_x, e_y, 1.0, Backwards.PARABOLA)
    assert v * e_x > 0
    A = w / (2 * v)
    assert A * e_x**2 == pytest.approx(e_y)
    assert w == pytest.approx(2 * A * v)


def test_a_point_beside_or_upon_the_robot_is_no_division_by_0():
    assert parabola_drive(0.0, 0.0, 2.0) == (0.0, 0.0)
    assert parabola_drive(0.0, 0.3, 2.0) == (0.0, 4.0)
    assert parabola_drive(0.0, -0.3, 2.0) == (0.0, -4.0)
    v, w = parabola_drive(1e-200, 0.3, 2.0)
    assert (v, w) == pytest.approx((0.0, 4.0))


def test_the_reference_point_is_nearer_where_the_path_bends():
    straight, bent = Curve([(0, 0), (5, 0)]), Curve([(0, 0), (0.5, 0.5), (1.0, 0)])
    config = QuadraticTrackerConfig(alpha=1.0, s_max=0.4, beta=0.5)
    v, w = QuadraticCurveTracker(straight, config).control((1.0, 0.1, 0.0))
    assert w / (2 * v) == pytest.approx(-0.1 / 0.4**2)
    tracker = QuadraticCurveTracker(bent, config)
    posture = (0.1, 0.1, 0.3)
    found = tracker.control(posture)
    s = bent.nearest(0.1, 0.1)
    ahead = bent.at(s + 0.4 / (1 + 0.5 * bent.most_curvature(s, s + 0.4)))
    dx, dy = ahead.x - 0.1, ahead.y - 0.1
    c, sin = math.cos(0.3), math.sin(0.3)
    assert found == pytest.approx(parabola_drive(c * dx + sin * dy, c * dy - sin * dx, 1.0))
    assert tracker.s == s


@pytest.mark.parametrize("start", [(-0.1, 1.0, 0.0), (0.0, 1.3, 2.5), (0.3, 0.5, -2.0)])
@pytest.mark.parametrize("backwards", list(Backwards))
def test_without_delay_a_path_is_driven_to_its_end(start, backwards):
    tracker = QuadraticCurveTracker(S, QuadraticTrackerConfig(alpha=1.0, backwards=backwards))
    rows = driven(tracker.control, start, 12.0)
    end = S.at(S.length)
    assert math.dist(rows[-1, :2], (end.x, end.y)) <= 0.05
    assert tracker.control(tuple(rows[-1])) == (0.0, 0.0)
    assert away(S, rows[300:]) < 0.06


def test_in_reverse_a_path_is_driven_in_reverse():
    config = QuadraticTrackerConfig(alpha=1.0, backwards=Backwards.PARABOLA)
    rows = driven(QuadraticCurveTracker(S, config).control, (0.0, 1.0, S.at(0).theta + math.pi), 12.0)
    end = S.at(S.length)
    assert math.dist(rows[-1, :2], (end.x, end.y)) <= 0.05
    assert away(S, rows) < 0.06
    moved = np.diff(rows, axis=0)
    forward = moved[:, 0] * np.cos(rows[:-1, 2]) + moved[:, 1] * np.sin(rows[:-1, 2])
    assert forward.max() < 1e-9
    # As printed, the robot turns its front to where it goes.
    printed = driven(QuadraticCurveTracker(S, QuadraticTrackerConfig(alpha=1.0)).control, tuple(rows[0]), 12.0)
    assert abs(math.remainder(printed[-1, 2] - rows[-1, 2], math.tau)) > 2.0


def test_a_figure_eight_isnt_cut_short():
    eight = Curve([(math.sin(t), math.sin(2 * t)) for t in np.linspace(0.1, 0.05 + math.tau, 40)])
    start = eight.at(0.0)
    tracker = QuadraticCurveTracker(eight, QuadraticTrackerConfig(alpha=0.5, s_max=0.2, arrival=0.02, window=0.6))
    # Its end is 5 cm before its beginning.
    rows = driven(tracker.control, start[:3], eight.length / 0.2)
    assert away(eight, rows) < 0.05
    assert np.ptp(rows[:, 0]) > 1.9
    assert tracker.s == pytest.approx(eight.length, abs=0.05)


def test_wheels_turn_as_the_drive_asks():
    """Eq. (17), (18) are the inverse of eq. (1)."""
    wheels = Wheels(base=0.4, radius=0.1)
    right, left = wheel_rates((0.7, -1.3), wheels)
    assert right == pytest.approx(0.7 / 0.1 - 0.4 * 1.3 / 0.2)
    assert speeds((0.1 * right, 0.1 * left), 0.4) == pytest.approx((0.7, -1.3))


def test_pure_pursuit_drives_a_path_to_its_end():
    pursuit = PurePursuit(S, PurePursuitConfig(speed=0.8, most_turning=3.0))
    rows = driven(pursuit.control, (-0.1, 1.0, 0.0), 10.0)
    end = S.at(S.length)
    assert math.dist(rows[-1, :2], (end.x, end.y)) <= 0.05
    assert away(S, rows[100:]) < 0.06
    # The arc to the point: half its chord is its radius times the sine of its angle to the heading.
    ahead = Curve([(0, 0), (10, 0)])
    v, w = PurePursuit(ahead, PurePursuitConfig(speed=0.1, ahead=0.5)).control((1.0, 0.2, 0.0))
    assert w / v == pytest.approx(2 * -0.2 / (0.5**2 + 0.2**2))


def test_pure_pursuit_slows_down_where_it_must_turn():
    v, w = PurePursuit(S, PurePursuitConfig(speed=2.0, most_turning=0.5)).control((0.0, 1.0, -1.0))
    assert w == pytest.approx(0.5)
    assert 0 < v < 2.0


@pytest.mark.parametrize("bad", [
    {"alpha": 0.0}, {"s_max": math.nan}, {"beta": -1.0}, {"arrival": -0.1}, {"window": 0.0}, {"backwards": "side"},
])  # fmt: skip
def test_impossible_constants_are_refused(bad):
    with pytest.raises(InvalidValueError):
        QuadraticTrackerConfig(**bad)


@pytest.mark.parametrize("bad", [{"speed": 0.0}, {"ahead": -1.0}, {"most_turning": 0.0}, {"window": math.inf}])
def test_impossible_constants_of_pure_pursuit_are_refused(bad):
    with pytest.raises(InvalidValueError):
        PurePursuitConfig(**bad)
