"""Program speeds, accelerations and durations, and the shares of the robot's own that they are."""

from __future__ import annotations

import numpy as np
import pytest

from interfaces.val2.errors import ValError
from interfaces.val2.motion.speeds import SLOWEST, SettingsInForce, Speed
from robots import puma560
from vrs.model import Array

MODEL = puma560.model()


def turned(angle: float, way: float) -> Array:
    """A pose that is so far [m], and turned [rad] about z."""
    X = np.eye(4)
    X[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    X[0, 3] = way
    return X


def test_a_speed_is_a_share_of_the_nominal_one_in_its_unit_and_never_more() -> None:
    for speed, share in (
        (Speed(30.0), 0.3),
        (Speed(125.0, "MMPS"), 0.25),
        (Speed(2.0, "IPS"), 0.1016),
        (Speed(1e-9), SLOWEST),
        (Speed(300.0), 1.0),
        (Speed(800.0, "MMPS"), 1.0),
    ):
        assert speed.share(MODEL) == pytest.approx(share)


def test_of_way_and_turn_the_slower_one_counts() -> None:
    way, turn = 0.2, 0.3
    times = way / (0.4 * MODEL.tool_speed), turn / (0.1 * MODEL.tool_turn_speed)
    share = Speed(40.0, turn=10.0).line_share(MODEL, np.eye(4), turned(turn, way))
    whole = max(way / MODEL.tool_speed, turn / MODEL.tool_turn_speed)
    assert whole / share == pytest.approx(max(times))
    assert Speed(40.0, turn=10.0).line_share(MODEL, np.eye(4), turned(0.0, way)) == pytest.approx(0.4)
    assert Speed(40.0, turn=10.0).line_share(MODEL, np.eye(4), turned(turn, 0.0)) == pytest.approx(0.1)
    assert Speed(40.0, turn=10.0).line_share(MODEL, np.eye(4), np.eye(4)) == pytest.approx(0.4)


def test_what_is_not_said_of_turning_follows_percents_alone() -> None:
    settings = SettingsInForce()
    for asked, speed in (
        ((20.0, None, "%"), Speed(20.0, "%", 20.0)),
        ((20.0, 70.0, "%"), Speed(20.0, "%", 70.0)),
        ((20.0, None, "MMPS"), Speed(20.0, "MMPS", 100.0)),
    ):
        settings.set_speed(*asked, always=False)
        assert settings.next.speed == speed
    settings.next = settings.always
    assert settings.next.speed == Speed()
    with pytest.raises(ValError, match="above 0"):
        settings.set_speed(20.0, 0.0, "%", always=True)


@pytest.mark.parametrize(("up", "down", "share"), [(50, 80, 0.5), (80, 30, 0.3), (0.1, 100, 0.01), (300, 200, 1.0)])
def test_of_both_accelerations_the_smaller_counts(up: float, down: float, share: float) -> None:
    settings = SettingsInForce()
    settings.set_acceleration(up, down)
    assert settings.always.acceleration == settings.next.acceleration == pytest.approx(share)
