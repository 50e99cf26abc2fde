"""The centre beside the axle, eq. (2)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.ipr.parameters import IPR
from robots.mobile.chassis import centre_of, centre_rates
from vrs.mobile import advanced

SPEEDS = st.floats(-1, 1)


@given(st.floats(-4, 4), SPEEDS, SPEEDS, st.floats(-0.5, 0.5))
def test_the_rates_are_those_of_the_centre_on_an_arc(theta: float, v: float, w: float, D: float) -> None:
    dt, start = 1e-5, (0.3, -0.2, theta)
    ahead, behind = (np.array(centre_of(advanced(start, v, w, t), D)) for t in (dt, -dt))
    assert (ahead - behind) / (2 * dt) == pytest.approx(centre_rates(theta, D) @ (v, w), abs=1e-8)


def test_the_iprs_centre_is_behind_its_axle_and_there_is_a_way_back() -> None:
    posture = (1.0, 2.0, 0.7)
    assert IPR.centre_x == -0.06
    assert centre_of(centre_of(posture, IPR.centre_x), -IPR.centre_x) == pytest.approx(posture)
