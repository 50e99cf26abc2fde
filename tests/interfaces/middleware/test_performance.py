"""J and its root: against the printed equation, driven arcs, Brent's method, and the docstring's bounds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from interfaces.middleware.middleware import predicted
from interfaces.middleware.performance import (
    LARGEST_EPSILON,
    drive_measure,
    optimal_gain,
    optimal_way,
    optimal_ways,
    tolerance,
)
from robots.onboard.driving import Drive, Posture
from vrs.errors import InvalidValueError

FACTOR = st.one_of(st.floats(-300, 300), st.floats(-9, 2.4).map(lambda x: 10**x))
EPSILON = st.floats(-4, math.log10(LARGEST_EPSILON)).map(lambda x: min(10**x, LARGEST_EPSILON))


def measure(A, u):
    """J of a quadratic factor A [1/m] and u = K τ [m]."""
    return drive_measure(Drive(u, 2 * A * u), 1.0)


measures = np.vectorize(measure)


def printed(A, u):
    """Eq. (26)."""
    turned = 2 * A * u
    return math.sqrt((1 - math.cos(turned)) / (2 * A * A) + turned * turned)


@given(st.floats(0.05, 300), st.floats(0.01, 1))
def test_as_printed(A, u):
    assert measure(A, u) == pytest.approx(printed(A, u), rel=1e-9)
    assert measure(-A, u) == measure(A, u) == measure(A, -u)


@given(FACTOR, st.floats(0.0, 2.0), st.floats(0.05, 0.8))
def test_it_is_how_far_the_robot_goes_astray(A, K, tau):
    """The norm of what the predictor adds, eq. (19)–(24)."""
    drive = Drive(K, 2 * A * K)
    moved = predicted(Posture(0.0, 0.0, 0.0), drive, tau)
    assert drive_measure(drive, tau) == pytest.approx(math.hypot(*moved), rel=1e-9, abs=1e-12)
    assert drive_measure(drive, tau) == pytest.approx(measure(A, K * tau), rel=1e-9, abs=1e-12)


def test_limits():
    assert measure(0.0, 0.3) == 0.3
    assert measure(1e-300, 0.3) == pytest.approx(0.3)
    assert drive_measure(Drive(0.0, -2.0), 0.1) == pytest.approx(0.2)
    assert drive_measure(Drive(1.0, 0.0), 0.1) == pytest.approx(0.1)


@given(FACTOR, EPSILON)
def test_the_root_is_the_largest_gain_that_keeps_the_tolerance(A, epsilon):
    u = optimal_way(A, epsilon)
    assert measure(A, u) == pytest.approx(epsilon, rel=1e-12)
    assert epsilon / math.hypot(1, 2 * A) * (1 - 1e-12) <= u <= epsilon * (1 + 1e-12)
    # Nothing below it is over ε, nothing above it under.
    below, above = np.linspace(0, u, 50), u * np.geomspace(1.000001, 1e3, 200)
    assert measures(A, below).max() <= epsilon * (1 + 1e-12)
    assert measures(A, above).min() >= epsilon


@given(st.floats(-300, 300), st.floats(0.1, 0.8))
def test_the_root_is_brents_too(A, tau):
    u = brentq(lambda u: measure(A, u) - 0.25, 0.0, 1.2 * 0.25, xtol=1e-15, rtol=1e-13)
    assert optimal_gain(A, tau, 0.25) == pytest.approx(u / tau, rel=1e-9)


def test_arrays_of_any_shape():
    A = np.array([[0.0, -5.0], [300.0, 1e-9]])
    assert optimal_ways(A, 0.25).tolist() == [[optimal_way(one, 0.25) for one in row] for row in A.tolist()]


@pytest.mark.parametrize("bad", [0.0, -1.0, 3.1, math.nan, "much"])
def test_what_is_no_tolerance(bad):
    with pytest.raises(InvalidValueError, match="epsilon must be"):
        tolerance(bad)


def test_the_predictor_has_the_straight_line_as_its_limit():
    posture = Posture(1.0, 2.0, 0.5)
    straight = predicted(posture, Drive(0.8, 0.0), 0.3)
    assert straight == pytest.approx((1 + 0.24 * math.cos(0.5), 2 + 0.24 * math.sin(0.5), 0.5))
    for w in (1e-15, -1e-9):
        assert predicted(posture, Drive(0.8, w), 0.3) == pytest.approx(straight, abs=1e-9)
    # Eq. (20)–(22), with A = ω / (2 v).
    A, K, tau = 1.5, 0.8, 0.3
    end = 0.5 + 2 * A * K * tau
    x = 1.0 + (math.sin(end) - math.sin(0.5)) / (2 * A)
    y = 2.0 + (math.cos(0.5) - math.cos(end)) / (2 * A)
    assert predicted(posture, Drive(K, 2 * A * K), tau) == pytest.approx((x, y, end))
