import itertools

import numpy as np
import pytest

from robots import puma560
from robots.puma560 import parameters
from robots.puma560.batch import BRANCHES
from vrs.errors import InvalidValueError, UnreachablePoseError
from vrs.model import Limits

MODEL = puma560.model()
LOW, HIGH = MODEL.limits.q_min, MODEL.limits.q_max
ELBOW = np.arctan2(parameters.D4, parameters.A3)
FAR = np.hypot(parameters.A2 + np.hypot(parameters.A3, parameters.D4), parameters.D3)


def shoulder_zero(q2, q3):
    """Distance of the wrist centre from the waist axis in the arm's plane."""
    return parameters.A2 * np.cos(q2) + parameters.A3 * np.cos(q2 + q3) - parameters.D4 * np.sin(q2 + q3)


def over_the_shoulder(q3):
    """Joint 2 that puts the wrist centre at the side of the waist axis."""
    x = parameters.A2 + parameters.A3 * np.cos(q3) - parameters.D4 * np.sin(q3)
    y = parameters.A3 * np.sin(q3) + parameters.D4 * np.cos(q3)
    return np.pi / 2 - np.arctan2(y, x)


def many_q(k, seed, low=LOW, high=HIGH):
    """Random joints, a third of them at or next to one or more singular sets."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(low, high, (k, 6))
    near = rng.choice((0.0, 1e-15, 1e-12, 1e-10, 1e-9, 1e-7, 1e-5, 1e-3), (k, 3)) * rng.choice((-1, 1), (k, 3))
    chosen = rng.random((k, 3)) < 0.12
    q[:, 4] = np.where(chosen[:, 0], near[:, 0], q[:, 4])
    q[:, 2] = np.where(chosen[:, 1], -ELBOW + near[:, 1], q[:, 2])
    q[:, 1] = np.where(chosen[:, 2], over_the_shoulder(q[:, 2]) + near[:, 2], q[:, 1])
    return np.clip(q, low, high)


def wrapped(angle):
    """The angle in [−π, π)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi


def apart(a, b):
    """Largest joint difference modulo turns."""
    return np.abs(wrapped(a - b)).max(axis=-1)


def tolerances(q):
    """What rounding in the pose may do to the joints: on the arm, and on how joints 4 and 6 share a turn."""
    arm = 3e-14 / max(min(abs(np.sin(q[2] + ELBOW)), abs(shoulder_zero(q[1], q[2]))), 1e-8)
    return max(arm, 1e-9), (arm + 1e-14) / max(abs(np.sin(q[4])), 1e-16)


def found_among(solutions, q):
    """Whether q is among the solutions, or what shares its singular wrist."""
    arm, wrist = tolerances(q)
    gap = solutions - q
    if wrist > 1e-4:
        gap[:, 5] = apart(gap[:, 3:4] + gap[:, 5:], 0.0)
        gap[:, 3] = 0.0
    else:
        gap[:, 5] = gap[:, 3] + gap[:, 5]
        gap[:, 3] *= arm / max(wrist, arm)
    return len(gap) > 0 and np.abs(gap).max(axis=1).min() < arm


def test_round_trip_of_100_000_poses():
    q = many_q(100_000, 2, -np.pi * np.ones(6), np.pi * np.ones(6))
    X = MODEL.forward(q)
    for part in range(0, len(q), 20_000):
        wanted = X[part : part + 20_000]
        solutions = puma560.inverse_batch(wanted)
        there = ~np.isnan(solutions).any(axis=2)
        assert there.any(axis=1).all()
        assert np.array_equal(there, ~np.isnan(solutions).all(axis=2))
        reached = MODEL.forward(solutions[there])
        assert np.abs(reached - np.repeat(wanted, there.sum(axis=1), axis=0)).max() <= 1e-9
        assert (np.abs(solutions[there]) <= np.pi).all()


def test_regular_poses_have_eight_branches_that_differ():
    q = np.random.default_rng(3).uniform(-np.pi, np.pi, (5000, 6))
    solutions = puma560.inverse_batch(MODEL.forward(q))
    assert not np.isnan(solutions).any()
    for i, j in itertools.combinations(range(8), 2):
        assert apart(solutions[:, i], solutions[:, j]).min() > 1e-7
    assert apart(solutions, q[:, None]).min(axis=1).max() < 1e-7


def test_no_branch_within_limits_is_missed():
    for q in many_q(3000, 4):
        X = MODEL.forward(q)
        solutions = MODEL.inverse(X)
        assert found_among(solutions, q)
        assert np.abs(MODEL.forward(solutions) - X).max() <= 1e-9
        assert ((solutions >= LOW) & (solutions <= HIGH)).all()


def test_turns_are_complete():
    """Independent count: principal branches times the turns that an exhaustive search admits."""
    shifts = 2 * np.pi * np.array(list(itertools.product((-1, 0, 1), repeat=6)))
    most = 0
    for q in np.random.default_rng(5).uniform(LOW, HIGH, (200, 6)):
        X = MODEL.forward(q)
        every = (MODEL.inverse(X, within_limits=False)[:, None] + shifts).reshape(-1, 6)
        inside = every[((every >= LOW) & (every <= HIGH)).all(axis=1)]
        solutions = MODEL.inverse(X)
        assert len(solutions) == len(inside)
        order, expected = (s[np.lexsort(s.round(6).T)] for s in (solutions, inside))
        assert np.abs(order - expected).max() < 1e-9
        most = max(most, len(solutions))
    assert most > 8


def test_joint_6_has_its_turns():
    q = np.array([0.3, 0.4, -2.0, 0.5, 0.6, np.radians(200)])
    solutions = MODEL.inverse(MODEL.forward(q))
    turned = q - [0, 0, 0, 0, 0, 2 * np.pi]
    assert np.abs(solutions - q).max(axis=1).min() < 1e-9
    assert np.abs(solutions - turned).max(axis=1).min() < 1e-9


@pytest.mark.parametrize("corner", list(itertools.product((0, 1), repeat=6)))
def test_corners_of_the_limits_are_solutions(corner):
    q = np.where(corner, HIGH, LOW)
    assert found_among(MODEL.inverse(MODEL.forward(q)), q)
    assert np.allclose(MODEL.inverse_near(MODEL.forward(q), q), q, rtol=0, atol=1e-9)


@pytest.mark.parametrize("q5", [0.0, 1e-13, 1e-9, -1e-8, 1e-6])
@pytest.mark.parametrize("q4", [LOW[3], HIGH[3]])
@pytest.mark.parametrize("q6", [LOW[5], 0.1, HIGH[5]])
def test_limits_at_the_singular_wrist(q4, q5, q6):
    q = np.array([0.3, 0.4, -2.0, q4, q5, q6])
    X = MODEL.forward(q)
    solutions = MODEL.inverse(X)
    assert found_among(solutions.copy(), q)
    assert np.abs(MODEL.forward(solutions) - X).max() <= 1e-9
    near = MODEL.inverse_near(X, q)
    assert np.abs(MODEL.forward(near) - X).max() <= 1e-9
    assert np.abs(near - q).max() < 1e-6


def test_batch_and_single_agree():
    q = np.random.default_rng(6).uniform(LOW, HIGH, (1500, 6))
    q[:300, 4] = 0.0
    X = MODEL.forward(q)
    for pose, row in zip(X, puma560.inverse_batch(X), strict=True):
        single = MODEL.inverse(pose, within_limits=False)
        assert apart(single, row[~np.isnan(row[:, 0])]).max() < 1e-9


def test_batch_names_its_branches():
    solutions = puma560.inverse_batch(MODEL.forward(np.random.default_rng(7).uniform(LOW, HIGH, (100, 6))))
    for row in solutions:
        assert [MODEL.configuration(q) for q in row] == list(BRANCHES)


def test_branches_bear_the_toolbox_s_names():
    import roboticstoolbox

    toolbox = roboticstoolbox.models.DH.Puma560()
    for q in np.random.default_rng(8).uniform(LOW, HIGH, (20, 6)):
        X = MODEL.forward(q)
        raised = X + parameters.PEDESTAL * np.outer((0, 0, 1, 0), (0, 0, 0, 1))
        for name, ours in zip(BRANCHES, puma560.inverse_batch(X[None])[0], strict=True):
            arm, elbow, wrist = name.split()
            letters = arm[0].lower() + {"ABOVE": "u", "BELOW": "d"}[elbow] + wrist[0].lower()
            assert apart(toolbox.ikine_a(raised, letters).q, ours) < 1e-6


def test_singular_wrist_has_one_representative():
    for q5 in (0.0, np.pi):
        q = np.array([0.3, 0.4, -2.0, 0.5, q5, 0.9])
        principal = MODEL.inverse(MODEL.forward(q), within_limits=False)
        same_arm = principal[np.abs(principal[:, :3] - q[:3]).max(axis=1) < 1e-9]
        assert len(same_arm) == 1
        assert same_arm[0, 3] == 0.0
        assert np.isclose(same_arm[0, 5], 0.9 + (0.5 if q5 == 0 else -0.5))


def test_singular_wrist_within_limits_that_exclude_q4_zero():
    low, high = LOW.copy(), HIGH.copy()
    low[3], high[3], low[5], high[5] = 0.2, 0.6, -1.0, 1.0
    model = puma560.model(Limits(low, high, np.ones(6), np.ones(6)))
    q = np.array([0.3, 0.4, -2.0, 0.5, 0.0, 0.95])
    solutions = model.inverse(model.forward(q))
    same_arm = solutions[np.abs(solutions[:, :3] - q[:3]).max(axis=1) < 1e-9]
    assert np.allclose(same_arm, [[0.3, 0.4, -2.0, 0.45, 0.0, 1.0]])


def test_wide_limits_admit_several_turns_of_every_joint():
    bound = np.full(6, 1.5 * np.pi)
    model = puma560.model(Limits(-bound, bound, np.ones(6), np.ones(6)))
    q = np.array([3.5, -4.0, 3.3, 4.5, -3.6, -4.6])
    assert np.abs(model.inverse(model.forward(q)) - q).max(axis=1).min() < 1e-9
    assert np.allclose(model.inverse_near(model.forward(q), q), q, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "q",
    [
        [0.2, 0.7, -ELBOW, 0.3, 0.4, 0.5],
        [0.2, 0.7, np.pi - ELBOW, 0.3, 0.4, 0.5],
        [0.2, over_the_shoulder(-2.0), -2.0, 0.3, 0.4, 0.5],
        [0.2, np.pi / 2, -ELBOW, 0.3, 0.0, 0.5],
        *(list(pose) for pose in MODEL.poses.values()),
    ],
)
def test_boundary_of_the_workspace_is_reached(q):
    solutions = MODEL.inverse(MODEL.forward(q), within_limits=False)
    assert np.abs(MODEL.forward(solutions) - MODEL.forward(q)).max() <= 1e-9
    assert found_among(np.array(q) + wrapped(solutions - q), np.array(q))
    for i, j in itertools.combinations(range(len(solutions)), 2):
        assert apart(solutions[i], solutions[j]) > 1e-7


def test_near_keeps_the_joints_it_came_from():
    for q in many_q(2000, 9):
        near = MODEL.inverse_near(MODEL.forward(q), q)
        assert np.abs(near - q).max() < 1e-6


def test_near_is_the_nearest_of_its_configuration():
    rng = np.random.default_rng(10)
    used = set()
    for q, start in zip(rng.uniform(LOW, HIGH, (1500, 6)), rng.uniform(LOW, HIGH, (1500, 6)), strict=True):
        X = MODEL.forward(q)
        solutions = MODEL.inverse(X)
        own = [s for s in solutions if MODEL.configuration(s) == MODEL.configuration(start)]
        expected = min(own or list(solutions), key=lambda s: np.linalg.norm(s - start))
        used.add(bool(own))
        assert np.abs(MODEL.inverse_near(X, start) - expected).max() < 1e-9
    assert used == {True, False}


@pytest.mark.parametrize("words", ["LEFTY", "righty", "Below flip", "noflip", "above", *BRANCHES])
def test_asked_configuration_is_kept_and_nearest(words):
    rng = np.random.default_rng(11)
    found = 0
    for q, start in zip(rng.uniform(LOW, HIGH, (200, 6)), rng.uniform(LOW, HIGH, (200, 6)), strict=True):
        X = MODEL.forward(q)
        match = [s for s in MODEL.inverse(X) if set(words.upper().split()) <= set(MODEL.configuration(s).split())]
        if match:
            found += 1
            expected = min(match, key=lambda s: np.linalg.norm(s - start))
            assert np.abs(MODEL.inverse_near(X, start, words) - expected).max() < 1e-9
        else:
            with pytest.raises(UnreachablePoseError, match=r"joint [1-6] would be at"):
                MODEL.inverse_near(X, start, words)
    assert found > 5


def test_near_splits_the_move_at_the_singular_wrist():
    q = np.array([0.3, 0.4, -2.0, 0.5, 0.0, 0.9])
    moved = MODEL.inverse_near(MODEL.forward(q + 0.2 * np.eye(6)[3]), q)
    assert np.allclose(moved, q + 0.1 * np.eye(6)[[3, 5]].sum(axis=0))
    assert np.allclose(MODEL.inverse_near(MODEL.forward(q), q, "FLIP"), q)
    assert np.allclose(MODEL.inverse_near(MODEL.forward(q), q, "NOFLIP"), q)


def test_configuration_of_named_poses():
    assert MODEL.configuration(MODEL.poses["ready"]) == "RIGHTY ABOVE NOFLIP"
    assert MODEL.configuration(MODEL.poses["nominal"]) == "RIGHTY ABOVE FLIP"


def test_ties_are_named_the_same_with_rounding():
    q = np.array([0.2, 0.7, -ELBOW, 0.3, 0.0, 0.5])
    noise = 1e-14 * np.random.default_rng(12).uniform(-1, 1, (50, 6))
    assert {MODEL.configuration(q + e) for e in noise} == {"RIGHTY ABOVE NOFLIP"}


@pytest.mark.parametrize(
    ("p", "reason"),
    [
        ((0.1, 0.0, 0.3), r"0\.05005 m too close to the waist axis"),
        ((0.0, 0.0, 0.5), r"too close to the waist axis"),
        ((FAR + 0.1, 0.0, 0.0), r"m beyond the reach of 0\.864"),
        ((1e200, 0.0, 0.0), "beyond the reach"),
        ((0.0, parameters.D3, 1e-5), "too close to the shoulder"),
    ],
)
def test_out_of_reach_says_by_how_much(p, reason):
    X = np.eye(4)
    X[:3, 3] = p
    assert MODEL.inverse(X).shape == (0, 6)
    assert np.isnan(puma560.inverse_batch(X[None])).all()
    with pytest.raises(UnreachablePoseError, match=reason):
        MODEL.inverse_near(X, MODEL.poses["ready"])


def test_out_of_limits_names_the_joint():
    model = puma560.model(Limits(-0.5 * np.ones(6), 0.5 * np.ones(6), np.ones(6), np.ones(6)))
    q = np.array([0.3, 0.4, 0.2, 0.1, 0.9, 0.2])
    with pytest.raises(UnreachablePoseError, match=r"joint 5 would be at 51\.\d+ deg, 22\.9 deg outside"):
        model.inverse_near(model.forward(q), np.zeros(6), MODEL.configuration(q))


@pytest.mark.parametrize("words", ["UP", "RIGHTY LEFTY", "RIGHTY, SIDEWAYS", 5])
def test_unknown_words_are_refused(words):
    q = MODEL.poses["nominal"]
    with pytest.raises(InvalidValueError, match="configuration"):
        MODEL.inverse_near(MODEL.forward(q), q, words)


def broken(**changes):
    X = MODEL.forward(MODEL.poses["nominal"])
    for place, value in changes.items():
        X[int(place[1]), int(place[2])] = value
    return X


@pytest.mark.parametrize(
    "X",
    [
        *(broken(**{f"x{i}{j}": bad}) for i in range(4) for j in range(4) for bad in (np.nan, np.inf)),
        broken(x00=5.0),
        broken(x33=2.0),
        -np.eye(4) + 2 * np.diag([0, 0, 0, 1.0]),
        np.eye(3),
        np.zeros((2, 4, 4)),
        np.eye(4).astype(str),
        [[1, 0], [0]],
        None,
    ],
)
def test_bad_poses_are_refused(X):
    for solve in (
        MODEL.inverse,
        lambda X: MODEL.inverse_near(X, MODEL.poses["nominal"]),
        lambda X: MODEL.inverse_near(X, MODEL.poses["nominal"], "LEFTY"),
        lambda X: puma560.inverse_batch(X if X is None else [X]),
    ):
        with pytest.raises(InvalidValueError, match="X must be"):
            solve(X)


@pytest.mark.parametrize("q", [[0.0] * 5, [np.nan] * 6, None, [[0.0] * 6], [[0], [0, 1]]])
def test_bad_start_is_refused(q):
    with pytest.raises(InvalidValueError, match="q must be"):
        MODEL.inverse_near(MODEL.forward(MODEL.poses["nominal"]), q)


def test_rotation_that_is_slightly_off_is_made_orthonormal():
    q = MODEL.poses["nominal"]
    X = MODEL.forward(q)
    rough = X.copy()
    rough[:3, :3] += 2e-7 * np.random.default_rng(13).uniform(-1, 1, (3, 3))
    assert np.abs(MODEL.inverse_near(rough, q) - q).max() < 1e-6
    assert len(MODEL.inverse(rough)) == len(MODEL.inverse(X))
    assert apart(puma560.inverse_batch(rough[None])[0], puma560.inverse_batch(X[None])[0]).max() < 1e-5


def test_answers_are_the_caller_s_own():
    q = np.array(MODEL.poses["nominal"])
    X = MODEL.forward(q)
    kept = X.copy()
    MODEL.inverse_near(X, q)[:] = 0
    puma560.inverse_batch(X[None])
    assert np.array_equal(X, kept)
    assert np.array_equal(q, MODEL.poses["nominal"])


def test_empty_batch():
    assert puma560.inverse_batch(np.empty((0, 4, 4))).shape == (0, 8, 6)
