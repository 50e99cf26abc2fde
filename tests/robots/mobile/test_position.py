"""Where a robot takes itself to be: late pictures of a robot that drives, and how much each of them counts."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from robots.ipr.parameters import IPR
from robots.mobile.chassis import CameraModel, MobileReality, Senses
from robots.mobile.position import FusedPosition, LaserPosition, OdometryPosition, TruePosition
from robots.mobile.robot import BareBody
from vrs.errors import InvalidValueError

EXACT = Senses(sonar=None, camera=CameraModel(latency=0.4, noise=0.0, noise_angle=0.0))
IDEAL = MobileReality.ideal(dt=1 / 60)
CURVE = (0.4, 0.5)


def test_late_pictures_of_an_exact_robot_change_nothing() -> None:
    """They're compared with where it was when they were taken: else it would fall behind."""
    body = BareBody(IPR, (1.0, 2.0, 0.5), reality=IDEAL, senses=EXACT)
    fused = FusedPosition(body)
    for _ in range(60):
        body.follow(*CURVE)
        assert np.abs(np.array(fused.posture()) - body.posture).max() < 1e-9


@pytest.mark.parametrize(("share", "turn_share"), [(0.1, 0.05), (0.5, 0.0), (0.0, 0.3)])
def test_each_picture_takes_away_its_share_of_the_difference(share: float, turn_share: float) -> None:
    body = BareBody(IPR, (1.0, 2.0, 0.5), reality=IDEAL, senses=EXACT)
    fused = FusedPosition(body, share=share, turn_share=turn_share)
    fused.posture()
    # Somebody lifts it: its odometry doesn't know.
    body.carry((1.3, 1.6, 0.7 + math.tau))
    for _ in range(6):
        body.follow(0.0, 0.0)
        fused.posture()
    off, pictures = [], []
    for _ in range(12):
        body.follow(0.0, 0.0)
        x, y, theta = fused.posture()
        off.append((math.hypot(x - 1.3, y - 1.6), abs(theta - 0.7)))
        pictures.append(body.camera.time if body.camera is not None else -1.0)
    assert len({*pictures}) == len(pictures)
    for (far, turned), (near, less) in pairwise(off):
        assert near == pytest.approx((1 - share) * far, rel=1e-6)
        assert less == pytest.approx((1 - turn_share) * turned, rel=1e-6)


def test_the_others_are_what_they_say() -> None:
    body = BareBody(IPR, (1.0, 2.0, 0.5), rng=3)
    for _ in range(50):
        body.follow(*CURVE)
    assert TruePosition(body).posture() == body.truth
    assert OdometryPosition(body).posture() == body.reckoned
    assert body.truth != body.reckoned
    with pytest.raises(InvalidValueError, match="laser"):
        LaserPosition(body)
