"""The simulated scanner: exact against the plan, from where the robot is beam by beam, noisy as said."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from robots.ipr.parameters import IPR
from robots.mobile.body import MobileBody
from robots.mobile.chassis import MobileReality, Senses
from robots.mobile.floor_plan import FloorPlan
from robots.mobile.robot import BareBody, MobileRobot, place
from robots.onboard.laser import LaserModel
from robots.simulated import WORLDS
from vrs.errors import InvalidValueError
from vrs.mobile import advanced

IDEAL = MobileReality.ideal(dt=1 / 60)
START = (1.2, 1.3, 0.4)


def robot(
    laser: LaserModel, *, seed: int = 0, kind: Callable[..., MobileRobot] = BareBody, **more: object
) -> MobileRobot:
    senses = Senses(sonar=None, camera=None, laser=laser)
    return kind(IPR, START, room="furnished", senses=senses, rng=seed, **more)


def exact(posture: tuple[float, float, float], laser: LaserModel, beam: int) -> float:
    x, y, theta = posture
    origin = np.array([[x + laser.forward * math.cos(theta), y + laser.forward * math.sin(theta)]])
    way = theta + laser.angles[beam]
    plan = FloorPlan(place("furnished"), laser.height)
    return float(plan.cast(origin, np.array([[math.cos(way), math.sin(way)]]), 0.0, laser.reach)[0])


@pytest.mark.parametrize("step", [0.25, 0.5, 1.0])
def test_each_beam_is_measured_from_where_the_robot_was_then(step: float) -> None:
    laser = LaserModel(noise=0.0, dropouts=0.0, sweep=0.1, step_deg=step)
    body = robot(laser, reality=IDEAL)
    body.drive(0.3, 0.5, 30)
    scan = body.laser
    assert scan is not None
    assert len(scan.ranges) == laser.beams == round(180 / step) + 1
    assert scan.time == pytest.approx(0.4)
    for beam in range(0, laser.beams, 40 * round(0.5 / step) or 20):
        t = scan.time + laser.sweep * beam / (laser.beams - 1)
        posture = advanced(START, 0.3, 0.5, t)
        assert scan.ranges[beam] == pytest.approx(exact(posture, laser, beam), abs=2e-3)


def test_ranges_have_the_noise_and_the_dropouts_that_were_asked_for() -> None:
    laser = LaserModel(noise=0.02, dropouts=0.1)
    body = robot(laser)
    off, lost = [], []
    clean = robot(LaserModel(noise=0.0, dropouts=0.0))
    for _ in range(20):
        for one in (body, clean):
            one.drive(0.0, 0.0, 12)
        assert body.laser is not None
        assert clean.laser is not None
        seen = np.isfinite(body.laser.ranges) & np.isfinite(clean.laser.ranges)
        off.append(body.laser.ranges[seen] - clean.laser.ranges[seen])
        lost.append(1 - seen.sum() / np.isfinite(clean.laser.ranges).sum())
    assert np.concatenate(off).std() == pytest.approx(0.02, rel=0.05)
    assert abs(np.concatenate(off).mean()) < 0.001
    assert np.mean(lost) == pytest.approx(0.1, abs=0.02)


def test_calls_split_in_any_way_give_the_same_scans() -> None:
    whole, parts = (robot(LaserModel(sweep=0.1), seed=3) for _ in range(2))
    whole.drive(0.3, 0.2, 61)
    for n in (1, 5, 7, 13, 2, 33):
        parts.drive(0.3, 0.2, n)
    assert whole.laser is not None
    assert parts.laser is not None
    assert whole.laser.time == parts.laser.time
    assert np.array_equal(whole.laser.ranges, parts.laser.ranges)


def test_a_laser_changes_nothing_else() -> None:
    with_laser, without = robot(LaserModel(), seed=5), BareBody(IPR, START, room="furnished", rng=5)
    for body in (with_laser, without):
        body.drive(0.3, 0.2, 100)
    assert with_laser.truth == without.truth
    assert with_laser.encoders == without.encoders


@pytest.mark.parametrize("world", WORLDS)
def test_physics_sees_the_same_walls(world: str) -> None:
    laser = LaserModel(noise=0.0, dropouts=0.0)
    with robot(laser, kind=partial(MobileBody, world=world)) as body:
        body.drive(0.0, 0.0, 12)
        assert body.laser is not None
        seen = np.minimum(body.laser.ranges[::10], 9.0)
        expected = np.minimum([exact(body.truth, laser, beam) for beam in range(0, laser.beams, 10)], 9.0)
    # Columns are prisms to PyBullet's rays; corners are seen by one of both alone.
    off = np.abs(seen - expected)
    assert np.median(off) < 1e-3
    assert np.mean(off < 6e-3) > 0.9


@pytest.mark.parametrize("kind", [BareBody, *(partial(MobileBody, world=world) for world in WORLDS)])
def test_a_robot_that_is_carried_off_turns_no_wheel(kind: Callable[..., MobileRobot]) -> None:
    with robot(LaserModel(), kind=kind) as body:
        body.drive(0.0, 0.0, 12)
        before = body.odometry
        body.carry((5.5, 2.5, -2.0))
        body.drive(0.0, 0.0, 240)
        assert np.abs(body.posture - (5.5, 2.5, -2.0)).max() < 2e-3
        assert np.abs(body.odometry - before).max() < 2e-3
        with pytest.raises(InvalidValueError, match="stands free"):
            body.carry((3.5, 2.4, 0.0))
