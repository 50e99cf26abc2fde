"""The checks of METRICS.md, on a figure eight, and the laws of lag and agreement."""

from __future__ import annotations

import numpy as np
import pytest

from vrs.comparison import best_lag, compare_paths, resample, shifted
from vrs.errors import InvalidValueError

T_END = 60.0


def figure_eight(t):
    """One figure eight in 40 s, then rest; about 0.3 m/s, bent out of the plane."""
    phase = 2 * np.pi * np.clip(t, 0, 40) / 40
    return np.stack((1.5 * np.sin(phase), 0.8 * np.sin(2 * phase), 0.1 * np.cos(phase)), axis=1)


t = np.arange(0, T_END, 0.02)


@pytest.mark.parametrize("lag", [0.0, 1.0, 6.0])
def test_a_late_copy_has_its_lag_and_no_path_error(lag):
    result = compare_paths(t, figure_eight(t), figure_eight(t - lag))
    assert result.time_difference_mean == pytest.approx(lag, abs=1e-3)
    assert result.time_difference_max == pytest.approx(lag, abs=0.01)
    assert result.path_error_max <= 5e-4
    assert result.progress > 0.99


def test_a_sideways_copy_has_its_offset():
    velocity = np.gradient(figure_eight(t), t, axis=0)
    left = np.stack((-velocity[:, 1], velocity[:, 0]), axis=1)
    moving = np.linalg.norm(left, axis=1) > 1e-3
    left[moving] /= np.linalg.norm(left[moving], axis=1, keepdims=True)
    left[~moving] = left[moving][-1]
    leader = figure_eight(t)[:, :2]
    follower = resample(t, leader + 0.2 * left, t - 1.0)
    result = compare_paths(t, leader, follower)
    assert result.time_difference_mean == pytest.approx(1.0, abs=5e-3)
    assert result.path_error_mean == pytest.approx(0.2, abs=2e-3)


def test_a_follower_that_stops_half_way_shows_in_the_progress():
    follower = figure_eight(np.minimum(t - 1.0, 20.0))
    result = compare_paths(t, figure_eight(t), follower)
    assert result.progress == pytest.approx(0.5, abs=0.01)
    assert result.time_difference_mean == pytest.approx(1.0, abs=2e-3)
    assert result.time_difference_bound > 5


def test_noise_does_not_bias_the_time_difference():
    noise = np.random.default_rng(3).normal(0, 5e-3, (len(t), 3))
    result = compare_paths(t, figure_eight(t), figure_eight(t - 1.0) + noise)
    assert result.time_difference_mean == pytest.approx(1.0, abs=5e-3)


def test_holds_on_the_way_do_not_count_as_delay():
    """A leader that rests 5 s half way, a follower 0.5 s late and 2 mm short of every point."""

    def line(t):
        s = np.where(t < 10, 0.1 * t, np.where(t < 15, 1.0, 1.0 + 0.1 * (t - 15)))
        return np.stack((np.clip(s, 0, 2.5), 0 * t), axis=1)

    result = compare_paths(t, line(t), line(t - 0.5) - np.array([0.002, 0.0]))
    assert result.time_difference_max == pytest.approx(0.52, abs=0.06)


@pytest.mark.parametrize("delay", [1.0, 6.0])
@pytest.mark.parametrize("gaps", [[(5.0, 7.0)], [(0.0, 3.0), (11.3, 11.5), (20.0, 24.0)], [(16.0, 99.0)]])
def test_what_was_not_measured_counts_nowhere(gaps, delay):
    """A figure eight replayed later, of which parts weren't measured: what stands there is no matter."""
    follower = figure_eight(t - delay)
    whole = compare_paths(t, figure_eight(t), follower)
    for since, until in gaps:
        follower[(t > since) & (t < until)] = np.nan
    found = compare_paths(t, figure_eight(t), follower)
    assert found.time_difference_mean == pytest.approx(delay, abs=1e-3)
    assert found.time_difference_max < whole.time_difference_max + 0.01
    assert found.path_error_max <= whole.path_error_max <= 5e-4
    assert found.speed_error < 0.02
    assert best_lag(t, figure_eight(t), follower) == pytest.approx(delay, abs=1e-3)


def test_nothing_measured_is_an_error():
    unknown = np.full((len(t), 3), np.nan)
    with pytest.raises(InvalidValueError, match="measured"):
        compare_paths(t, figure_eight(t), unknown)
    assert best_lag(t, figure_eight(t), unknown) is None


def test_a_leader_at_rest_defines_no_delay():
    rest = np.zeros((len(t), 3))
    result = compare_paths(t, rest, rest + np.array([0.03, 0, 0]))
    assert result.path_error_mean == pytest.approx(0.03)
    assert result.time_difference_mean is None
    assert result.progress is None


def test_a_follower_that_never_moves_has_no_progress():
    result = compare_paths(t, figure_eight(t), np.tile(figure_eight(t[:1]), (len(t), 1)))
    assert result.progress < 0.01


@pytest.mark.parametrize("lag", [-0.4, 0.0, 0.013, 1.28])
def test_best_lag_is_found_below_a_step(lag):
    def q(t):
        return np.stack((np.sin(0.7 * t), np.cos(0.3 * t)), axis=1)

    assert best_lag(t, q(t), q(t - lag)) == pytest.approx(lag, abs=5e-4)


@pytest.mark.parametrize("standing", ["leader", "follower", "both"])
def test_robots_at_rest_have_no_lag(standing):
    moving = np.stack((np.sin(0.7 * t), np.cos(0.3 * t)), axis=1)
    # Noise as that of a simulated servo, which makes one lag or another the best.
    rest = 1.0 + np.random.default_rng(5).uniform(0, 1e-7, (len(t), 2))
    leader, follower = (rest if standing in (who, "both") else moving for who in ("leader", "follower"))
    assert best_lag(t, leader, follower) is None


def test_one_joint_that_moves_a_little_is_enough_for_a_lag():
    def q(t):
        return np.stack((1.0 + 0 * t, 1e-4 * np.sin(0.7 * t)), axis=1)

    assert best_lag(t, q(t), q(t - 0.3)) == pytest.approx(0.3, abs=5e-4)


def test_shifting_by_whole_steps_moves_rows():
    values = np.random.default_rng(1).normal(size=(len(t), 2))
    assert np.array_equal(shifted(t, values, 0.4)[:-20], values[20:])
    assert np.array_equal(shifted(t, values, -0.4)[20:], values[:-20])


def test_histories_of_different_shape_are_refused():
    with pytest.raises(InvalidValueError, match="shape"):
        compare_paths(t, np.zeros((len(t), 3)), np.zeros((len(t), 2)))


def test_noise_on_a_slow_path_does_not_bias_the_time_difference():
    def line(t):
        return np.stack((0.05 * np.clip(t, 0, 40), 0 * t), axis=1)

    noise = np.random.default_rng(3).normal(0, 5e-3, (len(t), 2))
    result = compare_paths(t, line(t), line(t - 1.0) + noise)
    assert result.time_difference_mean == pytest.approx(1.0, abs=0.03)


def test_the_match_is_causal():
    result = compare_paths(t, figure_eight(t), figure_eight(t + 1.0))
    assert -0.06 < result.time_difference_mean < 0.06


def test_a_follower_that_is_now_slower_and_now_quicker_has_a_speed_error():
    """The differences of both halves don't make good for each other."""

    def line(t):
        return np.stack((0.2 * t, 0 * t), axis=1)

    slow = 0.15 * np.minimum(t, 20) + 0.25 * np.clip(t - 20, 0, 20)
    result = compare_paths(t, line(np.minimum(t, 40)), np.stack((slow, 0 * t), axis=1))
    assert result.speed_error == pytest.approx(0.05, abs=0.005)
