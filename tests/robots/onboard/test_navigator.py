"""The navigator and echoes: those ahead and those of known things are none, others keep it from backing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.ipr.parameters import IPR
from robots.mobile.navigation import BodyNavigator
from robots.mobile.robot import BareBody
from robots.onboard.driving import Posture
from robots.onboard.navigator import Navigator
from robots.rooms import read_room

ROOM = read_room("room 1\nsize 6 4\nstart 1.2 2 0\nwall 0 0  6 0\nwall 6 0  6 4\nwall 6 4  0 4\nwall 0 4  0 0\n")
MIDDLE, AT_WALL = Posture(3.0, 2.0, 0.0), Posture(1.0, 2.0, 0.0)


def heard(echoes: dict[int, float], posture: Posture) -> Navigator:
    """A navigator that stands at a posture, after a scan of such echoes [m] by the sonars' numbers."""
    body = BareBody(IPR, room=ROOM)
    navigator = BodyNavigator(body, 0.05).navigator
    ranges = np.full(len(body.sonar_angles), math.inf)
    for k, r in echoes.items():
        ranges[k] = r
    navigator.hear(ranges, posture, time=0.0, now=0.0)
    return navigator


def way_back(navigator: Navigator, posture: Posture) -> float:
    return navigator.avoidance.free_way(posture, 0.0, now=0.0, sense=-1)


def test_something_behind_keeps_it_from_backing_and_what_is_ahead_is_the_lasers() -> None:
    # Sonar 8 of 16 looks astern, sonar 0 ahead.
    assert way_back(heard({}, MIDDLE), MIDDLE) > 1.0
    assert way_back(heard({8: 0.4}, MIDDLE), MIDDLE) == pytest.approx(0.38, abs=0.05)
    ahead = heard({0: 0.4}, MIDDLE)
    assert ahead.avoidance.free_way(MIDDLE, 0.0, now=0.0) > 1.0


def test_the_echo_of_a_known_wall_is_explained() -> None:
    """The wall is there anyhow: an echo of it, a cone wide, would only keep the robot from turning."""
    body = BareBody(IPR, room=ROOM)
    behind = AT_WALL.x + float(body.sonar_places[8, 0]) - 0.05
    assert way_back(heard({8: behind}, AT_WALL), AT_WALL) > 1.0
    assert way_back(heard({8: behind - 0.3}, AT_WALL), AT_WALL) < behind - 0.2


def test_a_scan_that_was_heard_is_no_news() -> None:
    navigator = heard({8: 0.4}, MIDDLE)
    navigator.hear(np.full(16, math.inf), MIDDLE, time=0.0, now=0.1)
    assert navigator.avoidance.free_way(MIDDLE, 0.0, now=0.1, sense=-1) < 0.5
