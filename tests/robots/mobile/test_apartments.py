"""Made-up apartments, ways through them, and the map of a floor plan."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.mobile.apartments import ApartmentConfig, apartment, apartment_plan
from robots.mobile.floor_plan import FloorPlan, Ways, plan_map
from robots.mobile.robot import PLACES, place
from robots.onboard.gsp_map import cast_lines
from robots.rooms import Room, read_room
from vrs.errors import InvalidValueError

SEEDS = range(8)


@pytest.mark.parametrize("seed", SEEDS)
def test_every_room_of_an_apartment_can_be_reached_and_nobody_walks_through_walls(seed: int) -> None:
    count, people = 1 + seed % 5, seed % 4
    room = apartment(seed, ApartmentConfig(rooms=count, people=people))
    assert apartment_plan(seed, ApartmentConfig(rooms=count, people=people)) == apartment_plan(
        seed, ApartmentConfig(rooms=count, people=people)
    )
    ways = Ways(room, 0.4)
    assert Ways(room, 0.4, start=room.start[:2]).free.sum() == ways.free.sum()
    assert ways.free.sum() * 0.05**2 > 0.2 * room.length * room.width
    assert len(room.people) == people
    plan = FloorPlan(Room("", room.length, room.width, blocks=room.blocks, columns=room.columns))
    for person in room.people:
        for t in np.linspace(0, person.times[-1] * 1.5, 60).tolist():
            assert plan.clearance(*person.at(t), 0.0) > 0.9 * person.radius
        assert person.speed < 1.0


def test_another_seed_is_another_apartment() -> None:
    assert len({apartment_plan(seed) for seed in SEEDS}) == len(SEEDS)


@pytest.mark.parametrize("wrong", [{"rooms": 9}, {"people": -1}, {"furniture": 4.0}, {"known": 2}])
def test_what_can_not_be_made_is_refused(wrong: dict) -> None:
    with pytest.raises(InvalidValueError):
        ApartmentConfig(**wrong)


def test_ways_keep_away_from_things_and_are_not_much_longer_than_need_be() -> None:
    room = apartment(3, ApartmentConfig(rooms=4))
    ways = Ways(room, 0.4)
    plan, rng = FloorPlan(room), np.random.default_rng(0)
    for _ in range(5):
        a, b = ways.places[rng.integers(len(ways.places), size=2)].tolist()
        route = ways.route((a[0], a[1]), (b[0], b[1]))
        assert math.dist(route[0], a) < 0.05
        assert math.dist(route[-1], b) < 0.05
        assert np.abs(np.diff(route, axis=0)).max() < 0.05 + 1e-9
        assert min(plan.clearance(x, y, 0.0) for x, y in route.tolist()) > 0.33
    with pytest.raises(InvalidValueError, match="room"):
        Ways(read_room("room 1\nsize 1 1\nbox 0.5 0.5 1 1\n"), 0.4)


@pytest.mark.parametrize("name", sorted(set(PLACES) - {"empty"}) + [f"seed {seed}" for seed in (1, 2, 4)])
def test_the_map_of_a_plan_is_what_rays_meet(name: str) -> None:
    room = apartment(int(name.split()[1])) if name.startswith("seed") else place(name)
    known = room.known()
    standing = [b for b in known.blocks if b.height >= 0.3 and b.start == -math.inf and b.end == math.inf]
    walls = Room("", room.length, room.width, blocks=tuple(standing))
    plan, rng = FloorPlan(walls), np.random.default_rng(1)
    origins = rng.uniform((0, 0), (room.length, room.width), (400, 2))
    origins = origins[[plan.clearance(x, y, 0.0) > 0.02 for x, y in origins.tolist()]]
    angles = rng.uniform(-math.pi, math.pi, len(origins))
    ways = np.column_stack([np.cos(angles), np.sin(angles)])
    lines = plan_map(room, shortest=0.01).lines
    expected, found = plan.cast(origins, ways, 0.0, 30.0), cast_lines(lines.ends, origins, ways)
    # Faces end where a thing covers them to within a hair; what's outside the floor isn't on the map.
    met = np.isfinite(expected)
    hits = origins + np.where(met, expected, 0.0)[:, None] * ways
    inside = met & (hits >= 0).all(axis=1) & (hits <= (room.length, room.width)).all(axis=1)
    assert np.mean(np.abs(expected[inside] - found[inside]) < 1e-6) > 0.99


def test_the_maps_lines_face_the_free_side_and_unknown_things_are_not_on_it() -> None:
    room = read_room("room 1\nsize 6 4\nwall 0 0 6 0\nbox 3 2 1 1\nbox 5 2 0.5 0.5 unknown\nbox 1 3 1 1 until=9\n")
    lines = plan_map(room).lines
    assert len(lines) == 1 + 4
    for pose, normal in zip(lines.poses, lines.normals, strict=True):
        before, behind = (FloorPlan(room).clearance(*(pose[:2] + side * normal), 20.0) for side in (0.01, -0.01))
        assert before > 0
        assert behind == 0


def test_ways_are_those_of_the_part_in_which_they_start() -> None:
    divided = read_room("room 1\nsize 6 4\nstart 1 2 0\nwall 2 0  2 4\n")
    largest, smaller = Ways(divided, 0.3), Ways(divided, 0.3, start=(1.0, 2.0))
    assert (largest.places[:, 0] > 2.0).all()
    assert (smaller.places[:, 0] < 2.0).all()
    assert largest.free.sum() > smaller.free.sum() > 100
