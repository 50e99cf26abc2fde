"""The posture estimator: eq. (8)–(10) as printed, and its laws."""

from __future__ import annotations

import math
import random
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.memory import values_held
from vrs.errors import InvalidValueError
from vrs.mobile import Feedback, PostureEstimator, advanced, increment, rotation, wrapped

close = partial(np.testing.assert_allclose, rtol=0.0)

T = 0.1


def inputs(count, seed=0):
    rng = random.Random(seed)
    return [(rng.uniform(-0.5, 0.5), rng.uniform(-0.7, 0.7)) for _ in range(count)]


def driven(start, commands):
    """Postures after 0, 1, … commands."""
    path = [start]
    for v, w in commands:
        path.append(advanced(path[-1], v, w, T))
    return path


@settings(deadline=None)
@given(st.integers(0, 5), st.integers(6, 12), st.tuples(*[st.floats(0, 1)] * 3), st.randoms())
def test_one_feedback_gives_the_printed_sum(j, i, gain, rng):
    """Eq. (9) and (10), with matrices, for i > j."""
    commands = [(rng.uniform(-0.5, 0.5), rng.uniform(-0.7, 0.7)) for _ in range(i)]
    measured = np.array([rng.uniform(-1, 1) for _ in range(3)])
    estimator = PostureEstimator((0.1, 0.2, 0.3), gain=gain, period=T)
    known = [np.array([0.1, 0.2, 0.3])]
    for v, w in commands:
        estimator.command(v, w)
        known.append(known[-1] + rotation(known[-1][2]) @ increment(v, w, T))
    assert estimator.feedback(j, measured) is Feedback.APPLIED
    K = np.diag(gain)
    after = (np.eye(3) - K) @ known[j] + rotation(measured[2]) @ increment(*commands[j], T) + K @ measured
    for v, w in commands[j + 1 :]:
        after = after + rotation(after[2]) @ increment(v, w, T)
    close(estimator.posture, after, atol=1e-12)


@settings(deadline=None)
@given(st.floats(0.05, 1.0), st.tuples(*[st.floats(-1, 1)] * 3), st.integers(0, 2**32))
def test_the_error_shrinks_by_one_minus_the_gain_a_feedback(gain, error, seed):
    commands = inputs(30, seed)
    real = driven((0.0, 0.0, 0.0), commands)
    estimator = PostureEstimator(np.add(real[0], error), gain=gain, period=T)
    for i, (v, w) in enumerate(commands):
        estimator.feedback(i, real[i])
        estimator.command(v, w)
        expected = np.array(error) * (1 - gain) ** (i + 1)
        close(estimator.posture - np.array(real[i + 1]), expected, atol=1e-12)


@settings(deadline=None, max_examples=30)
@given(st.integers(1, 40), st.tuples(*[st.floats(-1, 1)] * 3), st.floats(0.2, 1.0), st.booleans())
def test_no_error_stays_under_a_constant_delay(delay, error, gain, turned):
    commands = inputs(delay + 250)
    real = driven((0.0, 0.0, 0.0), commands)
    estimator = PostureEstimator(np.add(real[0], error), gain=gain, period=T)
    for i, (v, w) in enumerate(commands):
        if i >= delay:
            j = i - delay
            x, y, theta = real[j]
            estimator.feedback(j, (x, y, wrapped(theta) if turned else theta))
        estimator.command(v, w)
    left = estimator.posture - np.array(real[-1])
    assert np.abs(left[:2]).max() <= 1e-9
    assert abs(wrapped(left[2])) <= 1e-9


def test_without_the_index_an_error_would_stay():
    """The law above is about the index: feedback taken for a later command's leaves the robot behind."""
    commands = [(0.4, 0.0)] * 100
    real = driven((0.0, 0.0, 0.0), commands)
    estimator = PostureEstimator(real[0], period=T)
    for i, (v, w) in enumerate(commands):
        if i >= 10:
            estimator.feedback(i, real[i - 10])
        estimator.command(v, w)
    assert abs(estimator.posture[0] - real[-1][0]) > 0.1


@pytest.mark.parametrize("turns", [-2, -1, 1, 3])
def test_the_heading_goes_the_short_way(turns):
    estimator = PostureEstimator((0.0, 0.0, 3.1), gain=0.5)
    estimator.command(0.0, 0.0)
    estimator.feedback(0, (0.0, 0.0, -3.1 + 2 * math.pi * turns))
    assert estimator.posture[2] == pytest.approx(math.pi, abs=1e-12)


@settings(deadline=None)
@given(st.randoms())
def test_the_order_of_arrival_is_of_no_matter(rng):
    commands = inputs(25, rng.randrange(1000))
    real = driven((0.0, 0.0, 0.0), commands)
    feedback = [(j, tuple(np.add(real[j], [rng.gauss(0, 0.02) for _ in range(3)]))) for j in range(26)]
    mixed = feedback * 2
    rng.shuffle(mixed)
    results = []
    for run in (feedback, mixed):
        estimator = PostureEstimator((0.3, 0.1, 0.2), gain=0.3, period=T)
        for v, w in commands:
            estimator.command(v, w)
        given_back = [estimator.feedback(j, posture) for j, posture in run]
        results.append(estimator.posture)
    assert given_back.count(Feedback.REPEATED) == 26
    np.testing.assert_array_equal(*results)


def test_a_robot_that_waits_is_found_in_bounded_memory():
    estimator = PostureEstimator((1.0, 0.0, 0.0), gain=0.01)
    estimator.command(0.1, 0.0)
    estimator.command(0.0, 0.0)
    for k in range(1, 2001):
        assert estimator.feedback(2, (0.0, 0.0, 0.0), number=k) is Feedback.APPLIED
        assert estimator.posture[0] == pytest.approx(1.01 * 0.99**k, rel=1e-9)
        assert values_held(estimator) < 500
    assert estimator.feedback(2, (0.0, 0.0, 0.0), number=2000) is Feedback.REPEATED
    assert estimator.feedback(0, (0.0, 0.0, 0.0)) is Feedback.FORGOTTEN


def test_history_is_bounded_and_feedback_out_of_it_changes_nothing():
    estimator = PostureEstimator((0.0, 0.0, 0.0), history=50)
    for v, w in inputs(500):
        estimator.command(v, w)
    assert (estimator.count, estimator.oldest) == (500, 450)
    assert values_held(estimator) < 500
    before = estimator.posture
    assert estimator.feedback(449, (0, 0, 0)) is Feedback.FORGOTTEN
    assert estimator.feedback(501, (0, 0, 0)) is Feedback.UNKNOWN
    assert estimator.feedback(-1, (0, 0, 0)) is Feedback.UNKNOWN
    np.testing.assert_array_equal(estimator.posture, before)
    assert estimator.feedback(450, (0, 0, 0)) is Feedback.APPLIED
    assert np.abs(estimator.posture - before).max() > 0
    with pytest.raises(InvalidValueError, match="index"):
        estimator.estimate(449)


@pytest.mark.parametrize("gain", [-0.1, 1.5, [0.1, 0.2], math.nan])
def test_a_gain_is_from_0_to_1(gain):
    with pytest.raises(InvalidValueError, match="gain"):
        PostureEstimator((0, 0, 0), gain=gain)


def test_what_is_not_sound_is_refused_and_changes_nothing():
    estimator = PostureEstimator((0, 0, 0))
    estimator.command(0.1, 0.0)
    for bad in ((math.nan, 0, 0), (0, 0), "here"):
        with pytest.raises(InvalidValueError):
            estimator.feedback(0, bad)
    with pytest.raises(InvalidValueError):
        estimator.feedback(0.5, (0, 0, 0))
    with pytest.raises(InvalidValueError):
        estimator.command(0.1, 0.0, 0.0)
    close(estimator.posture, [0.01, 0.0, 0.0], atol=1e-15)
    assert estimator.count == 1
