"""Curves by their way: against SciPy's splines, finite differences, and a search along thousands of points."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import BSpline, CubicSpline

from robots.onboard.curve import Curve, CurveKind
from vrs.errors import InvalidValueError

S = [(0, 1), (1, 2), (2, 0.5), (3, 1), (4, 3)]
EIGHT = [(math.sin(t), math.sin(2 * t)) for t in np.linspace(0.1, 0.1 + math.tau, 25)]
KINDS = list(CurveKind)


def random_points(seed):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.uniform(0.3, 1.0, (rng.integers(3, 12), 2)) * rng.choice((-1.0, 1.0, 1.0), (1, 2)), 0)


def along(curve, count=4001):
    s = np.linspace(0, curve.length, count)
    return s, np.array([curve.at(one) for one in s])


def test_a_cubic_curve_is_scipys_natural_spline():
    points = np.array(S, dtype=float)
    chord = np.append(0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    oracle = CubicSpline(chord, points, bc_type="natural")
    curve = Curve(points)
    places = oracle(np.linspace(0, chord[-1], 200))
    assert max(math.dist(curve.at(curve.nearest(*place))[:2], place) for place in places) < 1e-12


def test_a_quadratic_curve_is_scipys_b_spline():
    points = np.array(S, dtype=float)
    knots = [0, 0, 0, 1, 2, 3, 3, 3]
    oracle = BSpline(np.array(knots, dtype=float), points, 2)
    curve = Curve(points, "quadratic")
    places = oracle(np.linspace(0, 3, 200))
    assert max(math.dist(curve.at(curve.nearest(*place))[:2], place) for place in places) < 1e-12
    assert curve.at(0.0)[:2] == pytest.approx(S[0])
    assert curve.at(curve.length)[:2] == pytest.approx(S[-1])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_s_is_the_way_and_theta_and_curvature_are_its_derivatives(kind, seed):
    curve = Curve(random_points(seed), kind)
    s, rows = along(curve)
    step = s[1]
    way = np.hypot(*np.diff(rows[:, :2], axis=0).T)
    assert way.sum() == pytest.approx(curve.length, rel=1e-5)
    assert np.abs(way / step - 1).max() < 2e-3
    direction = np.unwrap(np.arctan2(*np.diff(rows[:, :2], axis=0).T[::-1]))
    theta = np.unwrap(rows[:, 2])
    assert np.abs(np.remainder(direction - 0.5 * (theta[1:] + theta[:-1]) + 1, math.tau) - 1).max() < 1e-3
    turned = np.diff(theta) / step
    inside = 0.5 * (rows[1:, 3] + rows[:-1, 3])
    # Where a quadratic curve's pieces meet the curvature jumps.
    assert np.quantile(np.abs(turned - inside), 0.98) < 2e-2 * max(np.abs(inside).max(), 1)
    assert curve.most_curvature(0, curve.length) == pytest.approx(np.abs(rows[:, 3]).max(), rel=0.05)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("points", [S, EIGHT, [(0, 0), (3, 4)]])
def test_nothing_on_the_curve_is_nearer_than_the_nearest_point(kind, points):
    curve = Curve(points, kind)
    _, rows = along(curve)
    rng = np.random.default_rng(3)
    for x, y in rng.uniform(-2, 5, (200, 2)).tolist():
        s = curve.nearest(x, y)
        place = curve.at(s)
        away = math.hypot(place.x - x, place.y - y)
        assert away <= np.hypot(rows[:, 0] - x, rows[:, 1] - y).min() + 1e-12
        if 1e-9 < s < curve.length - 1e-9:
            # The point lies straight beside it; at the joint of two quadratic pieces, too, as the tangents agree.
            assert abs(math.cos(place.theta) * (x - place.x) + math.sin(place.theta) * (y - place.y)) < 1e-7


@pytest.mark.parametrize("kind", KINDS)
def test_at_a_crossing_the_way_goes_on(kind):
    curve = Curve(EIGHT, kind)
    middle = curve.length / 2
    crossing = curve.at(curve.nearest(0.0, 0.0))
    first = curve.nearest(crossing.x, crossing.y, around=0.4 * curve.length, window=1.0)
    second = curve.nearest(crossing.x, crossing.y, around=0.9 * curve.length, window=1.0)
    assert abs(first - second) > 0.4 * curve.length
    assert first < middle < second


def test_before_its_start_and_after_its_end_a_curve_stands():
    curve = Curve(S)
    assert curve.at(-1.0) == curve.at(0.0)
    assert curve.at(curve.length + 1.0) == curve.at(curve.length)
    assert curve.nearest(-5, 1) == 0.0
    assert curve.nearest(9, 9) == pytest.approx(curve.length)


def test_two_points_are_a_straight_line():
    for kind in KINDS:
        curve = Curve([(1, 1), (4, 5)], kind)
        assert curve.length == pytest.approx(5.0)
        assert curve.at(2.5) == pytest.approx((2.5, 3.0, math.atan2(4, 3), 0.0))


def test_an_unbounded_table_isnt_made():
    curve = Curve([(0, 0), (5000, 5000), (10000, -10000)])
    assert len(curve.table[0]) < 120_000
    assert curve.nearest(5000, 5000) == pytest.approx(curve.nearest(5000, 5000, around=7000, window=1000))


@pytest.mark.parametrize("points", [
    [(0, 0)], [], [(0, 0, 0), (1, 1, 1)], [(0, 0), (math.nan, 1)], [(0, 0), (0, 0)], [(0, 0), (2e4, 0)],
    [(k, k) for k in range(2001)], "points", [(0, 0), (1, 0), (0, 0)],
])  # fmt: skip
def test_what_is_no_curve(points):
    with pytest.raises(InvalidValueError, match="points must be"):
        Curve(points, "quadratic")


def test_a_kind_is_one_of_two():
    with pytest.raises(InvalidValueError, match="cubic, quadratic"):
        Curve(S, "quintic")
