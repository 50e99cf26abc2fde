"""Parts of localization beside a robot in a room: what a survey has covered, how much odometry is trusted."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from robots.ipr.parameters import IPR
from robots.mobile.chassis import MobileReality, Senses
from robots.mobile.floor_plan import plan_map
from robots.mobile.robot import BareBody
from robots.onboard.laser import LaserModel
from robots.onboard.line_filter import MotionConfig
from robots.onboard.localization import LocalizationConfig, Tracker
from robots.onboard.map_building import Surveyor
from robots.rooms import read_room

ROOM = read_room(
    "room 1\nsize 6 4\nstart 2 2 0\nwall 0 0  6 0\nwall 6 0  6 4\nwall 6 4  0 4\nwall 0 4  0 0\n"
    "box 4.5 1  1 0.6 height=1\n"
)
LASER = Senses(sonar=None, camera=None, laser=LaserModel(noise=0.005, dropouts=0.0))


def test_a_survey_covers_half_of_a_turn_at_first_and_all_of_it_after_one() -> None:
    body = BareBody(IPR, room=ROOM, reality=MobileReality.ideal(dt=1 / 60), senses=LASER)
    surveyor, covered = Surveyor(), []
    for _ in range(90):
        body.follow(0.0, math.tau / 8.0)
        surveyor.move(body.time, body.reckoned)
        if body.laser is not None and surveyor.see(body.laser):
            covered.append((body.reckoned[2], surveyor.seen_around))
    assert covered[0][1] == pytest.approx(0.5)
    for turned, share in covered:
        # Scans are kept each 12 deg.
        assert share == pytest.approx(min(0.5 + (turned - covered[0][0]) / math.tau, 1.0), abs=0.06)
    assert covered[-1][1] == 1.0


def test_odometry_that_is_worse_than_it_was_said_is_trusted_less() -> None:
    known, ideal, most = plan_map(ROOM), MobileReality.ideal(dt=1 / 60), []
    for slip in (0.0, 0.1):
        body = BareBody(
            IPR, room=ROOM, reality=replace(ideal, slip_spread=slip, slip_time=2.0), senses=LASER, rng=1
        )
        config = LocalizationConfig(motion=MotionConfig(wheel=0.002, base_error=0.001, rolling=0.001))
        tracker, unrest = Tracker(known, body.truth, np.diag([0.01, 0.01, 0.01]) ** 2, config), 1.0
        for k in range(120):
            body.follow(0.4 if k % 60 < 30 else -0.4, 0.2)
            tracker.move(body.time, body.reckoned)
            if body.laser is not None:
                tracker.see(body.laser)
            unrest = max(unrest, tracker.filter.unrest)
        most.append(unrest)
    assert most[0] < 2.0
    assert most[1] > 4.0
