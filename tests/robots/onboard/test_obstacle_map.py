"""The obstacle map: what a laser sees beside the map stands where it is, goes when it's gone, and walkers walk."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.ipr.parameters import IPR
from robots.mobile.chassis import Senses
from robots.mobile.navigation import route_map
from robots.mobile.robot import BareBody
from robots.onboard.laser import LaserModel, OdometryTrack
from robots.onboard.obstacle_map import ObstacleMap, ObstacleMapConfig
from robots.rooms import Room, read_room
from vrs.errors import InvalidValueError
from vrs.mobile import Grid

WALLS = """room 1
size 6 4
start 1 2 0
wall 0 0  6 0
wall 6 0  6 4
wall 6 4  0 4
wall 0 4  0 0
"""


def watched(
    room: Room, seconds: float, w: float = 0.0, config: ObstacleMapConfig | None = None
) -> tuple[ObstacleMap, list[tuple[float, float]]]:
    """What a robot that turns on the spot has seen, and who moved in each scan."""
    roads = route_map(room, IPR.footprint)
    found = ObstacleMap(Grid((120, 80), 0.05), lambda places: roads.knows(places, 0.07), config)
    body = BareBody(IPR, room=room, senses=Senses(sonar=None, camera=None, laser=LaserModel(noise=0.02)))
    track, movers, seen = OdometryTrack(), [], -1.0
    while body.time < seconds:
        track.add(body.time, body.reckoned)
        scan = body.laser
        if scan is not None and scan.time > seen and track.covers(scan.time, scan.end):
            found.see(scan, track, body.truth)
            seen = scan.time
            movers += found.movers
        body.drive(0.0, w, 3)
    return found, movers


def test_an_unknown_box_stands_where_it_is_and_known_walls_are_none_of_it() -> None:
    room = read_room(WALLS + "box 3 2  0.6 0.8 unknown\ncolumn 4 0.5 0.3\n")
    found, movers = watched(room, 1.5)
    places = found.standing(1.5)
    off = np.hypot(np.maximum(np.abs(places[:, 0] - 3) - 0.3, 0), np.maximum(np.abs(places[:, 1] - 2) - 0.4, 0))
    assert len(places) > 10
    # The noise is 2 cm, and a corner has few beams.
    assert off.max() < 0.08
    assert off.mean() < 0.01
    assert not movers
    assert found.was_free(np.array([(2.0, 2.0), (3.0, 2.0), (4.5, 2.0)])).tolist() == [True, False, False]


def test_what_has_gone_is_forgotten_once_it_is_looked_through() -> None:
    room = read_room(WALLS + "column 3 2 0.3 unknown until=1.0\n")
    assert len(watched(room, 0.9)[0].standing(0.9)) > 5
    assert len(watched(room, 2.0)[0].standing(2.0)) == 0


def test_what_is_out_of_sight_is_remembered() -> None:
    room = read_room(WALLS + "column 2 3 0.3 unknown until=1.0\n")
    # The robot turns away from it before it goes.
    found, _ = watched(room, 3.0, w=-0.75)
    assert len(found.standing(3.0)) > 3
    assert len(found.standing(3.0)) == len(found.places())


def test_somebody_who_walks_moves_and_blocks_no_way() -> None:
    room = read_room(WALLS + "person 0.22  0,3.5,1  1,3.5,1  5,3.5,3\n")
    (person,) = room.people
    found, movers = watched(room, 4.0)
    assert len(movers) > 8
    x, y = person.at(4.0)
    assert math.dist(movers[-1], (x, y)) < 0.3
    standing = found.standing(4.0)
    assert len(standing) < len(found.places())
    beside = np.abs(found.places() - (3.5, y)).max(axis=1)
    assert beside.min() < 0.3


@pytest.mark.parametrize("bad", [{"reach": 0.0}, {"tolerance": -0.1}, {"memory": math.nan}, {"widest": 9.0}])
def test_what_makes_no_sense_is_refused(bad: dict[str, float]) -> None:
    with pytest.raises(InvalidValueError):
        ObstacleMapConfig(**bad)


def test_what_is_out_of_sight_is_forgotten_in_the_end() -> None:
    room = read_room(WALLS + "column 2 3 0.3 unknown until=1.0\n")
    # As before, but nothing is remembered for so long.
    found, _ = watched(room, 3.0, w=-0.75, config=ObstacleMapConfig(memory=1.0))
    assert len(found.places()) == 0


def test_where_something_has_come_to_stand_it_is_not_free() -> None:
    room = read_room(WALLS + "column 3 2 0.3 unknown from=0.6\n")
    before, after = np.array([(2.71, 2.01)]), np.array([(2.71, 2.01), (1.8, 2.0)])
    assert watched(room, 0.5)[0].was_free(before).tolist() == [True]
    assert watched(room, 1.4)[0].was_free(after).tolist() == [False, True]
