from __future__ import annotations

import numpy as np
import pytest

from robots import puma560
from robots.puma560.batch import BRANCHES
from vrs.errors import InvalidValueError
from vrs.model import RobotModel

MODEL = puma560.model()
LIMITS = MODEL.limits


def path(q, goal, k=65):
    return q + np.linspace(0.0, 1.0, k)[:, None] * (goal - q)


def paths_in_one_configuration(count):
    """Short joint paths on which no configuration changes, far beyond the limits for some joints."""
    rng = np.random.default_rng(1)
    while count:
        q = rng.uniform(-1.9 * np.pi, 1.9 * np.pi, 6)
        row = path(q, q + rng.uniform(-0.4, 0.4, 6))
        if len({MODEL.configuration(at) for at in row}) == 1 and np.abs(np.sin(row[:, 4])).min() > 1e-3:
            count -= 1
            yield row


def test_the_model_is_still_one():
    assert isinstance(MODEL, RobotModel)
    assert MODEL.characteristic_length == 0.4318
    assert MODEL.tool_turn_speed == pytest.approx(np.pi / 2)


def test_it_finds_the_joints_of_a_path_again_turns_included():
    for q in paths_in_one_configuration(100):
        assert np.abs(MODEL.follow(MODEL.forward(q), q[0]) - q).max() < 1e-9


def test_every_branch_agrees_with_inverse_batch():
    rng = np.random.default_rng(2)
    start = rng.uniform(LIMITS.q_min, LIMITS.q_max, (40, 6))
    for q in start:
        X = MODEL.forward(q)
        every = puma560.inverse_batch(X[None])[0]
        for words, solution in zip(BRANCHES, every, strict=True):
            if np.isfinite(solution).all():
                found = MODEL.follow(X[None], q, words)[0]
                assert np.abs(np.sin(0.5 * (found - solution))).max() < 1e-9
                assert np.abs(found - q).max() <= np.pi + 1e-9


def test_words_that_are_left_out_are_q_s_own():
    q = np.array([0.3, 0.8, -2.6, 0.4, 0.9, -0.2])
    X = MODEL.forward(q)[None]
    assert MODEL.configuration(q) == "RIGHTY ABOVE FLIP"
    assert MODEL.configuration(MODEL.follow(X, q, "lefty")[0]) == "LEFTY ABOVE FLIP"
    assert MODEL.configuration(MODEL.follow(X, q)[0]) == "RIGHTY ABOVE FLIP"


def test_where_the_arm_doesn_t_reach_all_that_follows_is_nan():
    X = np.tile(MODEL.forward(MODEL.poses["nominal"]), (9, 1, 1))
    X[:, 0, 3] += np.array([0.0, 0.05, 0.1, 2.0, 0.1, 0.05, 0.0, 0.0, 0.0])
    q = MODEL.follow(X, MODEL.poses["nominal"])
    assert np.isfinite(q[:3]).all()
    assert np.isnan(q[3:]).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_from_a_straight_wrist_joint_4_goes_the_shorter_way(sign: float):
    start = np.array([0.2, 0.6, -2.0, 0.5, 0.0, 0.1])
    goal = start.copy()
    goal[4] = sign * 0.5
    q = MODEL.follow(MODEL.forward(path(start, goal)), start)
    assert np.abs(q - path(start, goal)).max() < 1e-9


def test_a_rotation_that_is_none_is_out_of_reach():
    X = MODEL.forward(MODEL.poses["nominal"])[None].copy()
    X[0, :3, :3] *= 1.001
    assert np.isnan(MODEL.follow(X, MODEL.poses["nominal"])).all()


@pytest.mark.parametrize("X", [np.eye(4), np.full((2, 4, 4), np.nan), np.zeros((2, 3, 4)), [["a"]]])
def test_other_shapes_are_refused(X):
    with pytest.raises(InvalidValueError):
        MODEL.follow(X, np.zeros(6))


def test_unknown_words_are_refused():
    with pytest.raises(InvalidValueError):
        MODEL.follow(np.eye(4)[None], np.zeros(6), "SIDEWAYS")


@pytest.mark.parametrize("name", ["tool_speed", "tool_turn_speed"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, "fast"])
def test_speeds_are_positive(name: str, value):
    with pytest.raises(InvalidValueError):
        puma560.model(**{name: value})
