"""A drive within the limits."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots import ipr
from robots.onboard.avoidance import AvoidanceConfig
from robots.onboard.driving import IPR_LIMITS, kept
from robots.onboard.path_following import PathFollowingConfig
from robots.onboard.trajectory_tracking import TrackingConfig
from tests.robots.onboard.rooms import IPR, ring
from vrs.mobile import DriveLimits

LIMITS = DriveLimits(0.4, 0.7, 0.5, 2.0)


@settings(deadline=None)
@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-0.4, 0.4), st.sampled_from([0.02, 0.05, 0.25]))
def test_a_kept_drive_is_the_nearest_that_is_allowed(v, w, before, dt):
    drive = kept(v, w, before, dt, LIMITS)
    low, high = max(-0.4, before - 0.5 * dt), min(0.4, before + 0.5 * dt)
    assert drive.v == pytest.approx(min(max(v, low), high), abs=1e-12)
    assert drive.w == min(max(w, -0.7), 0.7)


def test_what_drives_on_board_keeps_the_models_limits_unless_told_otherwise():
    configs = PathFollowingConfig(), TrackingConfig(), AvoidanceConfig(IPR, ring(IPR))
    assert {config.limits for config in configs} == {IPR_LIMITS} == {ipr.model().limits}
