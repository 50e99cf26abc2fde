"""Roots of cubics against their own factors and NumPy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.onboard.curve import real_roots

ROOTS = st.floats(-10, 10)


@given(ROOTS, ROOTS, ROOTS, st.floats(0.1, 10))
def test_the_roots_of_a_product_are_found(r1, r2, r3, a):
    coefficients = a * np.poly([r1, r2, r3])
    found = real_roots(*coefficients.tolist())
    size = 1 + max(abs(r1), abs(r2), abs(r3))
    # Roots that lie together are only known to the root of the rounding.
    for root in (r1, r2, r3):
        assert min(abs(root - one) for one in found) < 1e-4 * size
    for one in found:
        assert abs(np.polyval(coefficients, one)) < 1e-9 * a * size**3


@given(st.tuples(*[st.floats(-100, 100)] * 4))
def test_as_many_as_numpy_finds(coefficients):
    a = coefficients[0]
    if abs(a) < 1e-3:
        return
    exact = np.roots(coefficients)
    real = exact[np.abs(exact.imag) < 1e-9 * (1 + np.abs(exact))].real
    found = np.array(real_roots(*coefficients))
    scale = 1 + np.abs(exact).max()
    for root in real:
        assert np.abs(found - root).min() < 1e-4 * scale


@pytest.mark.parametrize(
    ("coefficients", "roots"),
    [
        ((0.0, 1.0, -3.0, 2.0), [1.0, 2.0]),
        ((0.0, 1.0, 0.0, 1.0), []),
        ((0.0, 0.0, 2.0, -4.0), [2.0]),
        ((0.0, 0.0, 0.0, 3.0), []),
        ((0.0, 0.0, 0.0, 0.0), []),
        ((1.0, 0.0, 0.0, 0.0), [0.0]),
        ((0.0, 1.0, 0.0, 0.0), [0.0]),
        ((2.0, 0.0, 0.0, -16.0), [2.0]),
        ((1.0, 1.0, 1e-135, 1e-135), [-1.0, 0.0]),
    ],
)
def test_lesser_degrees_and_triple_roots(coefficients, roots):
    assert sorted(set(real_roots(*coefficients))) == pytest.approx(roots)
