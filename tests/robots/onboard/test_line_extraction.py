"""Lines in scans of rooms that are known exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.mobile.floor_plan import FloorPlan
from robots.onboard.laser import LaserScan, beam_angles, deskewed
from robots.onboard.line_extraction import ExtractionConfig, extract
from robots.rooms import read_room
from vrs.model import Array

ROOM = read_room(
    "room 1\nsize 6 4\nwall 0 0 6 0\nwall 6 0 6 4\nwall 6 4 0 4\nwall 0 4 0 0\n"
    "box 5.5 1 0.8 0.6\ncolumn 4 2.6 0.2\n"
)
Posture = tuple[float, float, float]


def scan(
    posture: tuple[float, float, float], noise: float, rng: np.random.Generator, beams: int = 361
) -> LaserScan:
    x, y, theta = posture
    ways = theta + beam_angles(beams)
    origins = np.tile((x, y), (beams, 1))
    exact = FloorPlan(ROOM).cast(origins, np.column_stack([np.cos(ways), np.sin(ways)]), 0.0, 8.0)
    return LaserScan(0.0, exact + noise * rng.standard_normal(beams))


def errors(posture: Posture, noise: float, rng: np.random.Generator) -> list[Array]:
    """What the lines on the left and the right wall are off, in their own deviations, (k, 2)."""
    found, _ = extract(deskewed(scan(posture, noise, rng)), ExtractionConfig(), noise)
    placed = found.moved(posture)
    made = []
    for pose, variance in zip(placed.poses, placed.variances, strict=True):
        for face, direction in ((0.05, 0.0), (3.95, math.pi)):
            turn = math.remainder(pose[2] - direction, math.tau)
            if abs(pose[1] - face) < 0.1 and abs(turn) < 0.1:
                off = (pose[1] - face) * math.cos(direction)
                made.append(np.array([off, turn]) / np.sqrt(variance))
    return made


@pytest.mark.parametrize("noise", [0.01, 0.02])
def test_lines_are_as_sure_as_they_say(noise: float) -> None:
    rng = np.random.default_rng(7)
    found = [
        one
        for _ in range(120)
        for one in errors((2.0 + rng.uniform(-1, 1), 2.0, rng.uniform(-0.5, 0.5)), noise, rng)
    ]
    squares = np.array(found) ** 2
    assert len(squares) > 150
    assert 0.6 < squares[:, 0].mean() < 1.8
    assert 0.6 < squares[:, 1].mean() < 1.8


def test_without_noise_lines_are_exact_and_the_free_side_is_on_the_left() -> None:
    posture = (2.0, 2.0, 0.3)
    found, _ = extract(deskewed(scan(posture, 0.0, np.random.default_rng(0))), ExtractionConfig(), 1e-3)
    placed = found.moved(posture)
    expected = [(1, 0.05, 0.0), (1, 3.95, math.pi), (0, 5.95, math.pi / 2), (0, 5.1, math.pi / 2)]
    for axis, face, direction in expected:
        off = np.abs(placed.poses[:, axis] - face)
        turn = np.abs(np.remainder(placed.poses[:, 2] - direction + math.pi, math.tau) - math.pi)
        assert ((off < 1e-3) & (turn < 3e-3)).any(), (axis, face)
    assert (np.sum((np.array(posture[:2]) - placed.poses[:, :2]) * placed.normals, axis=1) > 0).all()


def test_the_noise_is_told_by_the_lines() -> None:
    rng = np.random.default_rng(3)
    for noise in (0.005, 0.01, 0.02):
        said = [
            extract(deskewed(scan((2.0, 2.0, 0.0), noise, rng)), ExtractionConfig(), noise)[1] for _ in range(15)
        ]
        assert np.mean(said) == pytest.approx(noise, rel=0.1)


@pytest.mark.parametrize("beams", [181, 361, 721])
def test_a_column_is_no_line_and_few_points_are_none(beams: int) -> None:
    rng = np.random.default_rng(5)
    found, _ = extract(deskewed(scan((2.0, 2.6, 0.0), 0.005, rng, beams)), ExtractionConfig(length=0.3), 0.005)
    placed = found.moved((2.0, 2.6, 0.0))
    assert len(placed) >= 3
    assert (np.hypot(placed.poses[:, 0] - 4, placed.poses[:, 1] - 2.6) > 0.3).all()
    nothing = LaserScan(0.0, np.full(beams, np.inf))
    assert len(extract(deskewed(nothing), ExtractionConfig())[0]) == 0
    few = np.full(beams, np.inf)
    few[10:14] = 1.0
    assert len(extract(deskewed(LaserScan(0.0, few)), ExtractionConfig())[0]) == 0
