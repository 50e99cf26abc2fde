"""What was measured is looked at before it's used, and compared with what was commanded."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots import puma560
from robots.onboard.following import BLIND, SensorMonitor, too_far

MODEL = puma560.model()
Q = MODEL.poses["nominal"]
BAD = [math.nan, math.inf, -math.inf, 1e300, -1e300, 1e18, 20.0, None, "0.1", [0.1]]


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize("joint", [0, 3, 5])
def test_a_bad_number_is_seen_and_says_which_joint(bad: object, joint: int) -> None:
    monitor = SensorMonitor(MODEL.limits)
    q: list[object] = Q.tolist()
    q[joint] = bad
    assert not monitor.look(q, now=1.0)
    assert monitor.blind(now=1.0) is None
    fault = monitor.blind(now=1.0 + BLIND)
    assert fault is not None
    assert fault.joint == joint
    assert str(fault).startswith(f"the encoder of joint {joint + 1} reads ")


@pytest.mark.parametrize("q", [[], [0.0] * 5, [0.0] * 7, np.zeros((1, 6)), 0.0, None, {}, "abcdef"])
def test_a_wrong_shape_is_seen(q: object) -> None:
    monitor = SensorMonitor(MODEL.limits)
    assert not monitor.look(q, now=0.0)
    fault = monitor.blind(now=1.0)
    assert fault is not None
    assert fault.joint is None
    assert "not 6" in str(fault)


def test_speeds_and_torques_are_looked_at_where_there_are_any() -> None:
    monitor = SensorMonitor(MODEL.limits)
    still = [0.0] * 6
    assert monitor.look(Q, still, (), now=0.0)
    assert monitor.look(Q.tolist(), tuple(still), still, now=0.0)
    assert not monitor.look(Q, [0.0] * 5 + [math.nan], still, now=0.0)
    assert not monitor.look(Q, still, [1e300] + [0.0] * 5, now=0.0)
    # As the wrist of an arm whose tool hit something.
    assert monitor.look(Q, [0.0] * 5 + [34.0], still, now=0.0)


def test_a_sound_measurement_ends_it() -> None:
    monitor, bad = SensorMonitor(MODEL.limits), [math.nan] * 6
    for k in range(200):
        assert monitor.look(Q if k % 40 == 39 else bad, now=0.001 * k) is (k % 40 == 39)
        assert monitor.blind(now=0.001 * k) is None
    for k in range(200, 260):
        monitor.look(bad, now=0.001 * k)
    assert monitor.blind(now=0.259) is not None
    assert monitor.look(Q, now=0.26)
    assert monitor.blind(now=0.4) is None


def test_the_joint_that_is_furthest_away_is_named() -> None:
    assert too_far(Q, Q + 0.099, 0.1) is None
    q = Q.copy()
    q[4] += 0.5
    q[1] -= 0.2
    abort = too_far(Q, q, 0.1)
    assert abort is not None
    assert (abort.joint, abort.tolerance) == (4, 0.1)
    assert abort.error == pytest.approx(0.5)
    assert str(abort) == "joint 5 is 0.5 rad from where it should be, more than 0.1 rad"
