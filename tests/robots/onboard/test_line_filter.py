"""The filter against finite differences, Monte Carlo and a batch solution; the paper's update beside it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.onboard.gsp_map import GspMap, Lines
from robots.onboard.line_filter import OWN, LineFilter, MatchingConfig, MotionConfig, Sights, matched
from robots.onboard.localization import injected_update, mean_update, observability, weighted_update, weights
from vrs.mobile import advanced
from vrs.model import Array

POSES = np.array([[0.0, 3.0, 0.0], [4.0, 0.0, -1.6], [-3.0, 0.5, 1.5], [1.0, -2.0, 3.0]])
SPANS = np.tile([-2.0, 2.0], (4, 1))
KNOWN = GspMap.of("", Lines.of(POSES, SPANS, np.tile([1e-4, 1e-5], (4, 1)), np.zeros(4)))
START = (0.3, -0.2, 0.4)
DOUBT = np.diag([0.02, 0.03, 0.02]) ** 2


def seen_from(posture: tuple[float, float, float], known: Lines, noise: Array | float = 0.0) -> Lines:
    """The lines as a robot at a posture has them in its own frame, seen around another centre."""
    x, y, theta = posture
    c, s = math.cos(theta), math.sin(theta)
    centres = known.poses[:, :2] + 0.4 * known.directions + np.atleast_2d(noise)[:, :1] * known.normals
    local = (centres - (x, y)) @ np.array([[c, -s], [s, c]])
    angles = known.poses[:, 2] - theta + np.atleast_2d(noise)[:, -1]
    variances = np.tile([2e-5, 4e-6], (len(known), 1))
    return Lines.of(np.column_stack([local, angles]), known.spans * 0.5, variances, np.full(len(known), 30))


def test_the_derivatives_of_an_innovation() -> None:
    held = LineFilter(START, DOUBT, KNOWN)
    sights = Sights(seen_from((0.32, -0.22, 0.43), KNOWN.lines), np.arange(4))
    found = held.innovation(sights)
    for k, step in enumerate(np.eye(3) * 1e-6):
        moved = held.innovation(sights, np.array(START) + step)
        assert np.allclose((moved.off - found.off) / 1e-6, found.H[:, 0, k], atol=1e-5)
        assert np.allclose((moved.turn - found.turn) / 1e-6, found.H[:, 1, k], atol=1e-5)
    for k in range(4):
        for error, (across, turned) in enumerate(((1e-6, 0.0), (0.0, 1e-6))):
            poses = POSES.copy()
            poses[k, :2] += across * KNOWN.lines.normals[k]
            poses[k, 2] += turned
            other = GspMap.of("", Lines.of(poses, SPANS, np.zeros((4, 2)), np.zeros(4)))
            moved = LineFilter(START, DOUBT, other).innovation(sights)
            assert (moved.off - found.off)[k] / 1e-6 == pytest.approx(found.H[k, 0, 3 + error], abs=1e-5)
            assert (moved.turn - found.turn)[k] / 1e-6 == pytest.approx(found.H[k, 1, 3 + error], abs=1e-5)


def test_a_correction_is_the_batch_solution_with_the_maps_errors_in_it() -> None:
    truth = (0.33, -0.23, 0.43)
    rng = np.random.default_rng(2)
    sights = Sights(seen_from(truth, KNOWN.lines, 1e-3 * rng.standard_normal((4, 2))), np.arange(4), 1e-5)
    standing, building = (LineFilter(START, DOUBT, KNOWN, building=b) for b in (False, True))
    for held in (standing, building):
        held.correct(sights)
    # Longhand: least squares over posture, map errors and the angle that all lines share, by Gauss-Newton.
    state, weight = np.zeros(12), np.concatenate([1 / np.diag(DOUBT), 1 / KNOWN.lines.variances.ravel(), [1e5]])
    held = LineFilter(START, DOUBT, KNOWN)
    for _ in range(20):
        found = held.innovation(sights, np.array(START) + state[:3])
        H = np.zeros((8, 12))
        H.reshape(4, 2, 12)[:, :, :3] = found.H[:, :, :3]
        for k in range(4):
            H[2 * k : 2 * k + 2, 3 + 2 * k : 5 + 2 * k] = found.H[k, :, 3:]
        H[:, 11] = H[:, 2]
        z = np.stack([found.off, found.turn], -1).ravel() + H[:, 3:] @ state[3:]
        R = 1 / sights.lines.variances.ravel()
        A = np.diag(weight) + H.T @ (R[:, None] * H)
        state = state - np.linalg.solve(A, weight * state + H.T @ (R * z))
    for held in (standing, building):
        assert np.allclose(held.posture, np.array(START) + state[:3], atol=2e-5)
        assert np.allclose(held.covariance, np.linalg.inv(A)[:3, :3], rtol=0.02, atol=1e-9)
    # What stands isn't moved; what is built is, as the batch has it.
    assert np.array_equal(standing.lines.poses, POSES)
    moved = np.sum((building.lines.poses[:, :2] - POSES[:, :2]) * KNOWN.lines.normals, axis=1)
    assert np.allclose(moved, state[3:11:2], atol=2e-5)


@pytest.mark.parametrize("only", ["wheel", "base_error", "rolling"])
def test_the_doubt_after_a_way_is_that_of_many_such_ways(only: str) -> None:
    sources = {"wheel": 0.02, "base_error": 0.03, "rolling": 0.01}
    config = MotionConfig(wheel_time=0.5, **{name: size * (name == only) for name, size in sources.items()})
    rng, count, dt = np.random.default_rng(5), 800, 0.05
    held = LineFilter((0.0, 0.0, 0.0), np.zeros((3, 3)), GspMap.of("", Lines.none()), config)
    keep = math.exp(-dt / config.wheel_time)
    wheels, base = config.wheel * rng.standard_normal((count, 2)), config.base_error * rng.standard_normal(count)
    postures = np.zeros((count, 3))
    for k in range(60):
        way, turn = 0.02, 0.02 if k < 30 else -0.03
        held.move(way, turn, dt)
        rolled = np.array([way + 0.5 * config.base * turn, way - 0.5 * config.base * turn])
        noise = config.rolling * np.sqrt(np.abs(rolled)) * rng.standard_normal((count, 2))
        right, left = (rolled * (1 + wheels) + noise).T
        for i in range(count):
            w = (right[i] - left[i]) / (config.base * (1 + base[i]))
            postures[i] = advanced(tuple(postures[i]), 0.5 * (right[i] + left[i]), w, 1.0)
        wheels = keep * wheels + config.wheel * math.sqrt(1 - keep**2) * rng.standard_normal((count, 2))
    sampled = np.cov(postures.T)
    assert np.allclose(held.posture, postures.mean(axis=0), atol=5e-3)
    assert np.allclose(np.diag(held.covariance), np.diag(sampled), rtol=0.2)
    spread = np.sqrt(np.diag(sampled))
    assert np.allclose(held.covariance / np.outer(spread, spread), np.corrcoef(postures.T), atol=0.2)


def test_one_wall_tells_its_distance_and_the_heading_and_nothing_else() -> None:
    held = LineFilter(START, DOUBT, KNOWN)
    sights = Sights(seen_from((0.31, -0.19, 0.41), KNOWN.lines.taken(np.array([1]))), np.array([1]))
    along = KNOWN.lines.directions[1]
    before, place = held.covariance, np.array(held.posture[:2])
    H = held.innovation(sights).H[:, :, :3]
    said = observability(np.einsum("kai,ka,kaj->ij", H, 1 / sights.lines.variances, H), 0.1)
    held.correct(sights)
    assert said.heading
    assert np.abs(np.abs(said.unobservable @ along) - 1).max() < 1e-6
    assert along @ held.covariance[:2, :2] @ along > 0.95 * (along @ before[:2, :2] @ along)
    normal = KNOWN.lines.normals[1]
    assert normal @ held.covariance[:2, :2] @ normal < 0.3 * (normal @ before[:2, :2] @ normal)
    assert abs((np.array(held.posture[:2]) - place) @ along) < 0.01
    nothing = observability(np.zeros((3, 3)), 0.1)
    assert not nothing.heading
    assert len(nothing.unobservable) == 2


def test_a_line_that_all_others_contradict_is_left_out() -> None:
    truth = (0.305, -0.205, 0.405)
    noise = np.zeros((4, 2))
    noise[2] = 0.06, 0.0
    held = LineFilter(START, DOUBT, KNOWN)
    found = matched(held, seen_from(truth, KNOWN.lines, noise), MatchingConfig())
    assert found.of.tolist() == [0, 1, 3]


def test_joined_lines_are_one_and_the_posture_gains() -> None:
    held = LineFilter(START, DOUBT, KNOWN, building=True)
    held.add(seen_from(START, KNOWN.lines.taken(np.array([0, 1]))))
    assert len(held.lines) == 6
    assert held.difference(0, 4) < 1e-6
    before = held.covariance
    held.join(0, 4)
    assert len(held.lines) == 5
    assert held.line_covariance.shape == (10, 10)
    assert held.covariance[1, 1] < before[1, 1]
    assert np.linalg.eigvalsh(held.joint_covariance)[0] > -1e-12
    assert held.joint_covariance.shape == (OWN + 10, OWN + 10)


SQUARE = Lines.of([[0, 2, 0.0], [2, 0, -math.pi / 2]], np.tile([-2.0, 2.0], (2, 1)), np.zeros((2, 2)), [1, 1])


def test_the_papers_weights_take_half_steps_at_two_walls_at_right_angles() -> None:
    of = np.arange(2)
    error = np.array([0.08, -0.05, 0.0])
    placed = Lines.of(SQUARE.poses + error, SQUARE.spans, SQUARE.variances, [1, 1])
    assert np.allclose(mean_update(SQUARE, placed, of), -error)
    assert np.allclose(weights(SQUARE, placed, of), 0.5)
    assert np.allclose(injected_update(SQUARE, placed, of), -0.5 * error)
    for k in range(1, 8):
        step = injected_update(SQUARE, placed, of)
        placed = Lines.of(placed.poses + step, SQUARE.spans, SQUARE.variances, [1, 1])
        assert np.allclose(placed.poses - SQUARE.poses, 0.5**k * error)


def test_what_is_seen_of_a_wall_counts_by_its_share_and_only_across() -> None:
    spans = np.array([[-0.5, 0.5], [-2.0, 2.0]])
    placed = Lines.of(SQUARE.poses + np.array([[0.7, 0.1, 0.0], [0.2, 0.7, 0.0]]), spans, SQUARE.variances, [1, 1])
    assert np.allclose(weights(SQUARE, placed, np.arange(2)), [0.2, 0.8])
    # Along itself a line may be anywhere: eq. (5) believes it, eq. (8) doesn't.
    assert np.allclose(weighted_update(SQUARE, placed, np.arange(2)), [-0.3, -0.58, 0.0])
    assert np.allclose(injected_update(SQUARE, placed, np.arange(2)), [-0.16, -0.02, 0.0])


def test_a_wheel_base_that_is_wider_than_it_was_said_is_found() -> None:
    """The robot turns less than its odometry says, and sees by how much."""
    base_error = 0.02
    held = LineFilter(START, 1e-8 * np.eye(3), KNOWN, MotionConfig(wheel=0.0, rolling=0.0, base_error=0.05))
    truth = START
    for _ in range(8):
        held.move(0.0, 0.3, 0.1)
        truth = advanced(truth, 0.0, 0.3 / (1 + base_error), 1.0)
        held.correct(Sights(seen_from(truth, KNOWN.lines), np.arange(4)))
    assert held.wheels[2] == pytest.approx(base_error, abs=0.005)


def test_the_doubts_of_single_lines_are_those_of_all_together() -> None:
    held = LineFilter(START, DOUBT, KNOWN)
    sights = Sights(seen_from(START, KNOWN.lines), np.arange(4), turned=1e-3)
    found = held.innovation(sights)
    joint = held.joint(found, sights).reshape(4, 2, 4, 2)
    for k, alone in enumerate(held.doubts(found, sights)):
        assert np.allclose(alone, joint[k, :, k], rtol=1e-12, atol=0)
