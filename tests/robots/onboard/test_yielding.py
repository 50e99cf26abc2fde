"""A robot that stands or drives goes out of the way of whoever comes, within its limits and not into a wall."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.onboard.avoidance import AvoidanceConfig, ObstacleAvoidance
from robots.onboard.driving import IPR_LIMITS, STAND, Drive, kept
from robots.onboard.movers import Mover, Yielding, YieldingConfig
from tests.robots.onboard.driven import Unicycle, assert_kept
from tests.robots.onboard.rooms import IPR, Room, ring
from vrs.errors import InvalidValueError

MOUNTS, PERIOD = ring(IPR), 0.05


def met(bearing, speed, *, wanted=STAND, walls=(), start=2.6):
    """(Least distances to the one who comes straight on and to walls, drives) until he has passed."""
    avoidance = ObstacleAvoidance(AvoidanceConfig(IPR, MOUNTS))
    yielding, robot = Yielding(YieldingConfig(IPR), avoidance), Unicycle((0, 0, 0), 0.08)
    rng, room, v = np.random.default_rng(0), Room(list(walls)), 0.0
    way = np.array([math.cos(bearing), math.sin(bearing)])
    drives, least, wall = [], math.inf, math.inf
    for k in range(round(2 * start / speed / PERIOD)):
        now = k * PERIOD
        at = way * (start - speed * now)
        if k % 2 == 0:
            avoidance.hear(room.scan(MOUNTS, robot.posture, rng), robot.posture, now=now)
        mover = Mover(*at.tolist(), *(-speed * way).tolist())
        drive = yielding.drive(wanted, [mover], robot.posture, now=now, v_before=v)
        drive = kept(drive.v, drive.w, v, PERIOD, IPR_LIMITS)
        robot.run(drive, PERIOD)
        v = drive.v
        drives.append(drive)
        least = min(least, Room((), [(*at, 0.25)]).gap(IPR, robot.posture))
        if len(room.segments):
            wall = min(wall, room.gap(IPR, robot.posture))
    return least, wall, drives


@pytest.mark.parametrize("bearing_deg", range(-180, 180, 30))
@pytest.mark.parametrize("speed", [0.3, 0.67])
def test_a_robot_that_stands_is_not_met(bearing_deg, speed):
    least, _, drives = met(math.radians(bearing_deg), speed)
    assert least > 0.05
    assert_kept(drives, IPR_LIMITS, PERIOD)


@pytest.mark.parametrize("bearing_deg", [0, 60, 120, 180])
def test_a_robot_that_drives_is_not_met(bearing_deg):
    assert met(math.radians(bearing_deg), 0.5, wanted=Drive(0.3, 0.0), start=3.5)[0] > 0.05


@pytest.mark.parametrize("bearing_deg", [90, 180, 0])
def test_it_does_not_go_into_a_wall_to_yield(bearing_deg):
    walls = [(-3.0, -0.6, 3.0, -0.6), (-0.9, -3.0, -0.9, 3.0)]
    _, wall, _ = met(math.radians(bearing_deg), 0.5, walls=walls)
    assert wall > 0.02


def test_who_passes_by_changes_nothing():
    avoidance = ObstacleAvoidance(AvoidanceConfig(IPR, MOUNTS))
    yielding, wanted = Yielding(YieldingConfig(IPR), avoidance), Drive(0.3, 0.1)
    for mover in (Mover(2.0, 1.8, -0.6, 0.0), Mover(-1.0, 0.0, -0.5, 0.0), Mover(0.0, 1.2, 0.0, 0.5)):
        assert yielding.drive(wanted, [mover], (0, 0, 0), now=0.0, v_before=0.3) == wanted
        assert not yielding.acts
    assert yielding.drive(wanted, [], (0, 0, 0), now=0.0, v_before=0.3) == wanted


def test_a_doubtful_way_is_given_more_room():
    avoidance = ObstacleAvoidance(AvoidanceConfig(IPR, MOUNTS))
    wanted = Drive(0.0, 0.0)
    sure, doubtful = Mover(2.0, 1.4, -0.6, 0.0), Mover(2.0, 1.4, -0.6, 0.0, across=0.4)
    assert (
        Yielding(YieldingConfig(IPR), avoidance).drive(wanted, [sure], (0, 0, 0), now=0.0, v_before=0.0) == wanted
    )
    yielding = Yielding(YieldingConfig(IPR), avoidance)
    assert yielding.drive(wanted, [doubtful], (0, 0, 0), now=0.0, v_before=0.0) != wanted
    assert yielding.acts


def test_wrong_values_are_refused():
    with pytest.raises(InvalidValueError):
        YieldingConfig(IPR, horizon=math.nan)
