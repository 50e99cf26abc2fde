"""Obstacle avoidance in random rooms: nothing is touched; round where there's room, and back; else it stands."""

from __future__ import annotations

import math
import os
import random

import numpy as np
import pytest

from robots.onboard.avoidance import AvoidanceConfig, ObstacleAvoidance, Outline, SonarMount
from robots.onboard.driving import IPR_LIMITS, Drive
from robots.onboard.path import Arc, MovingPath, Pivot
from robots.onboard.path_following import PathFollowingConfig, PathFollowingController
from tests.robots.onboard.driven import Unicycle, assert_kept
from tests.robots.onboard.rooms import IPR, Room, box, ring
from vrs.errors import InvalidValueError

ROOMS = int(os.environ.get("VRS_ROOMS", "8"))
"""How many random rooms are driven through; 200 for the record."""
LIMITS, MOUNTS, PERIOD = IPR_LIMITS, ring(IPR), 0.05
WALLS = box(3, 0, 9, 6)


def driven(room, pieces, *, seconds, seed=0, tau=0.08, avoids=True):
    """(Least distance to anything, rows (t, posture, drive), way left) of a robot that follows a path in a room."""
    path, rng = MovingPath((0, 0, 0)), np.random.default_rng(seed)
    for piece in pieces:
        path.append(piece)
    avoidance = ObstacleAvoidance(AvoidanceConfig(IPR, MOUNTS))
    follower, robot = PathFollowingController(path, PathFollowingConfig()), Unicycle((0, 0, 0), tau)
    rows, least, v = [], math.inf, 0.0
    for i in range(round(seconds / PERIOD)):
        now = i * PERIOD
        if i % 2 == 0:
            avoidance.hear(room.scan(MOUNTS, robot.posture, rng), robot.posture, now=now)
        drive = follower.control(robot.posture, v_before=v)
        place = follower.projection
        if avoids:
            drive = avoidance.drive(
                drive, robot.posture, now=now, towards=follower.direction, v_before=v, left=place.to_stop
            )
        v = drive.v
        robot.run(drive, PERIOD)
        rows.append((now, robot.posture, drive))
        least = min(least, room.gap(IPR, robot.posture))
        if place.left < 0.01 and abs(v) < 1e-3:
            break
    assert_kept([row[2] for row in rows], LIMITS, PERIOD)
    return least, rows, place.left


def random_room(rng):
    segments, circles = list(WALLS), []
    for _ in range(rng.randint(1, 7)):
        x, y = rng.uniform(-1, 7), rng.uniform(-2.5, 2.5)
        if math.hypot(x, y) > 1.1:
            if rng.random() < 0.5:
                segments += box(x, y, rng.uniform(0.2, 1.2), rng.uniform(0.2, 0.8), rng.uniform(0, 3))
            else:
                circles.append((x, y, rng.uniform(0.06, 0.3)))
    return Room(segments, circles)


@pytest.mark.parametrize("seed", range(ROOMS))
def test_nothing_is_touched_in_random_rooms(seed):
    rng = random.Random(seed + 1000)
    room = random_room(rng)
    if room.gap(IPR, (0, 0, 0)) < 0.12:
        pytest.skip("the room has no place for the robot at its start")
    bend = rng.choice([0.0, 0.15, -0.2])
    shapes = [
        [Arc(0.0, 2.0), Arc(bend, 2.5), Arc(-bend, 1.0)],
        [Arc(0.3, 2.0), Pivot(-2.0), Arc(0.0, 2.0)],
        [Arc(0.0, 1.5), Arc(0.5, 1.5, -1), Arc(0.0, 3.0)],
    ]
    least, _, _ = driven(room, rng.choice(shapes), seconds=20, seed=seed)
    assert least > 0.01


def test_the_rooms_are_dangerous():
    """Without avoidance the robot of the tests below drives into what is there."""
    room = Room(WALLS + box(2.2, 0.05, 0.5, 0.5))
    assert driven(room, [Arc(0.0, 5.0)], seconds=10, avoids=False)[0] == 0.0


@pytest.mark.parametrize("beside", [0.05, -0.2])
def test_round_a_box_and_back_to_the_path(beside):
    room = Room(WALLS + box(2.2, beside, 0.5, 0.5))
    least, rows, left = driven(room, [Arc(0.0, 5.0)], seconds=40)
    assert least > 0.03
    assert left < 0.02
    assert max(abs(row[1].y) for row in rows) > 0.3
    assert all(abs(row[1].y) < 0.03 for row in rows if row[1].x > 4.4)


def test_it_stands_where_there_is_no_room():
    """A wall from side to side: it stops before it, near, and for good."""
    room = Room([*WALLS, (2.5, -3.0, 2.5, 3.0)])
    least, rows, _ = driven(room, [Arc(0.0, 5.0)], seconds=25)
    assert least > 0.03
    assert max(row[1].x for row in rows) + IPR.front < 2.5
    assert max(row[1].x for row in rows) > 1.2


def test_a_dock_is_reached_although_the_wall_is_near():
    room = Room([*WALLS, (2.5, -3.0, 2.5, 3.0)])
    _, rows, left = driven(room, [Arc(0.0, 1.9)], seconds=15)
    assert left < 0.02
    assert all(abs(row[1].y) < 0.02 for row in rows)


def test_in_reverse_it_brakes():
    room = Room([*WALLS, (-1.2, -3.0, -1.2, 3.0)])
    least, rows, _ = driven(room, [Arc(0.0, 2.0, -1)], seconds=15)
    assert 0.03 < least < 0.2
    assert rows[-1][2].v == pytest.approx(0.0, abs=1e-6)


def test_where_nothing_is_near_nothing_is_changed():
    avoidance = ObstacleAvoidance(AvoidanceConfig(IPR, MOUNTS))
    avoidance.hear([3.0] * 14 + [math.nan, 2.9], (0, 0, 0), now=0.0)
    wanted = Drive(0.4, 0.3)
    assert avoidance.drive(wanted, (0, 0, 0), now=0.0, towards=0.5, v_before=0.4) == wanted
    assert not avoidance.acts


@pytest.mark.parametrize("sense", [1, -1])
def test_ways_equal_brute_force(sense):
    """The exact way on a curve, against small steps of the outline, grown by the clearance, and the points."""
    outline, rng = Outline(0.3, 0.22, 0.225), np.random.default_rng(8)
    config = AvoidanceConfig(outline, (SonarMount(0.0, 0.0, 0.0),), half_cone=0.0, clearance=0.06)
    for _ in range(60):
        avoidance = ObstacleAvoidance(config)
        bearing, r = rng.uniform(-math.pi, math.pi), rng.uniform(0.6, 1.3)
        avoidance.hear([r], (0, 0, bearing), now=0.0)
        k = float(rng.choice([0.0, *rng.uniform(-3, 3, 3)]))
        found = avoidance.free_way((0, 0, 0), k, now=0.0, sense=sense)
        s = np.linspace(0, 1.6, 4001)
        turned = k * s
        chord = sense * s * np.sinc(turned / 2 / math.pi)
        # The direction of travel turns by k a metre, and so does the heading.
        x, y = chord * np.cos(turned / 2), chord * np.sin(turned / 2)
        dx, dy = r * math.cos(bearing) - x, r * math.sin(bearing) - y
        u, v = np.cos(turned) * dx + np.sin(turned) * dy, np.cos(turned) * dy - np.sin(turned) * dx
        inside = (u <= 0.36) & (u >= -0.28) & (np.abs(v) <= 0.285)
        expected = s[np.argmax(inside)] if inside.any() else math.inf
        if expected < math.inf:
            assert found == pytest.approx(expected, abs=2e-3)
        else:
            assert found > 1.59


def test_a_reading_wipes_out_what_it_looks_through():
    avoidance = ObstacleAvoidance(AvoidanceConfig(IPR, (SonarMount(0.3, 0.0, 0.0),)))
    avoidance.hear([0.5], (0, 0, 0), now=0.0)
    assert avoidance.free_way((0, 0, 0), 0.0, now=0.0) == pytest.approx(0.44, abs=0.02)
    avoidance.hear([3.0], (0, 0, 0), now=0.1)
    assert avoidance.free_way((0, 0, 0), 0.0, now=0.1) < 0.5, "a miss says nothing"
    avoidance.hear([2.0], (0, 0, 0), now=0.2)
    assert avoidance.free_way((0, 0, 0), 0.0, now=0.2) > 1.0
    avoidance.hear([0.5], (0, 0, 0), now=0.3)
    assert avoidance.free_way((0, 0, 0), 0.0, now=2.0) > 1.0, "an old reading doesn't count"


def test_wrong_values_are_refused():
    with pytest.raises(InvalidValueError):
        AvoidanceConfig(IPR, ())
    with pytest.raises(InvalidValueError):
        Outline(0.0, 0.1, 0.1)
    with pytest.raises(InvalidValueError):
        ObstacleAvoidance(AvoidanceConfig(IPR, MOUNTS)).hear([1.0], (0, 0, 0), now=0.0)


def test_what_is_behind_the_goal_is_nothing_to_go_round():
    """Before a dock the robot drives straight on to it, and stops short of what stands behind."""
    for left, acts in ((0.3, False), (2.0, True)):
        avoidance = ObstacleAvoidance(AvoidanceConfig(IPR, MOUNTS))
        avoidance.stand(np.array([(1.1, y) for y in np.linspace(-0.6, 0.2, 17)]))
        wanted = Drive(0.2, 0.0)
        drive = avoidance.drive(wanted, (0.0, 0.0, 0.0), now=0.0, towards=0.0, v_before=0.2, left=left)
        assert avoidance.acts is acts
        assert (drive == wanted) is not acts
