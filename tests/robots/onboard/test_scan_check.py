"""What of a scan a map explains, beam by beam."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.onboard.gsp_map import Lines
from robots.onboard.laser import LaserScan, deskewed
from robots.onboard.line_filter import CLOSE, THROUGH, evidence, judged


@pytest.mark.parametrize("noise", [0.001, 0.04])
def test_shares_of_the_beams_by_how_far_they_went(noise: float) -> None:
    close, far = max(CLOSE, 3 * noise), max(THROUGH, 5 * noise)
    # Two at the line, one before it, one a little behind, which says nothing, two through, and one into the blue.
    difference = np.array([0.0, -0.9 * close, -2 * close, 0.9 * far, 1.1 * far, 3.0, -math.inf])
    found = judged(difference, noise)
    assert np.array(found) == pytest.approx(np.array([2, 1, 2, 1]) / 7)


@pytest.mark.parametrize(("ahead", "fits"), [(2.0, "explained"), (1.4, "before"), (2.4, "through")])
def test_a_wall_that_is_nearer_or_farther_than_the_maps(ahead: float, fits: str) -> None:
    wall = Lines.of([[2.0, 0.0, math.pi / 2]], [[-50.0, 50.0]], [[1e-6, 1e-6]], [10])
    angles = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 181)
    ranges = np.where(np.abs(angles) < 0.6, ahead / np.maximum(np.cos(angles), 0.1), np.inf)
    found = evidence(wall, deskewed(LaserScan(0.0, ranges)), (0.0, 0.0, 0.0), 0.01)
    assert getattr(found, fits) == 1.0
    assert evidence(wall, deskewed(LaserScan(0.0, np.full(181, np.inf))), (0.0, 0.0, 0.0), 0.01).blank == 1.0
