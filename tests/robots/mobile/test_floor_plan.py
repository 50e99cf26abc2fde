"""The 2D plan against brute force, and against the worlds' rays in the same room."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.mobile.floor_plan import FloorPlan
from robots.mobile.robot import PLACES, place
from robots.rooms import Room, read_room
from robots.simulated import WORLDS
from tests.robots.mobile.worlds import in_room
from vrs.model import Array

PLAN = read_room(
    "room 1\nsize 8 6\nbox 2 2 1.4 0.6 angle_deg=33\nbox 6 4 1 1 from=5 until=9\nwall 0 0 8 0\nwall 4 0.5 4.5 4\n"
    "column 5.5 1.5 0.4\ncolumn 1 5 0.2\nperson 0.3 0,3,5 10,7,5\n"
)


def inside(room: Room, points: Array, t: float) -> Array:
    """Which points (k, 2) lie in something, straight from what the things are."""
    found = np.zeros(len(points), dtype=bool)
    for block in room.blocks:
        if block.stands(t):
            c, s = math.cos(block.angle), math.sin(block.angle)
            local = (points - (block.x, block.y)) @ np.array([[c, -s], [s, c]])
            found |= (np.abs(local) <= (block.length / 2, block.width / 2)).all(axis=1)
    rounds = [(c.x, c.y, c.radius) for c in room.columns if c.stands(t)]
    rounds += [(*person.at(t), person.radius) for person in room.people]
    for x, y, radius in rounds:
        found |= np.hypot(points[:, 0] - x, points[:, 1] - y) <= radius
    return found


def rays(rng: np.random.Generator, room: Room, count: int) -> tuple[Array, Array]:
    origins = rng.uniform((0.0, 0.0), (room.length, room.width), (count, 2))
    angles = rng.uniform(-math.pi, math.pi, count)
    return origins, np.column_stack([np.cos(angles), np.sin(angles)])


@pytest.mark.parametrize("t", [0.0, 5.0, 8.99, 9.0, 30.0])
def test_rays_end_where_points_begin_to_lie_in_something(t: float) -> None:
    rng = np.random.default_rng(int(t * 100))
    plan = FloorPlan(PLAN)
    origins, ways = rays(rng, PLAN, 300)
    distances = plan.cast(origins, ways, t, 3.0)
    far = np.linspace(0.0, 3.0, 601)
    for origin, way, distance in zip(origins, ways, distances, strict=True):
        hits = inside(PLAN, origin + far[:, None] * way, t)
        if np.isfinite(distance):
            assert not hits[far < distance - 1e-9].any()
            # A ray may graze a corner by less than the comb's teeth; a hair inside there must be something.
            assert inside(PLAN, (origin + (distance + 1e-9) * way)[None], t).any()
        else:
            assert not hits.any()


def test_rays_along_the_axes_are_exact() -> None:
    plan = FloorPlan(read_room("room 1\nsize 8 6\nbox 4 3 1 2\n"))
    origins = np.array([[1.0, 3.0], [4.0, 0.0], [7.0, 3.5], [4.0, 3.0], [1.0, 5.0]])
    ways = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [1.0, 0.0], [1.0, 0.0]])
    assert plan.cast(origins, ways, 0.0, 9.0).tolist() == [2.5, 2.0, 2.5, 0.0, math.inf]
    assert plan.cast(origins, ways, 0.0, 2.2).tolist() == [math.inf, 2.0, math.inf, 0.0, math.inf]


def test_overlaps_and_clearance_agree_with_points() -> None:
    rng = np.random.default_rng(3)
    plan = FloorPlan(PLAN)
    u, v = np.meshgrid(np.linspace(-0.26, 0.26, 41), np.linspace(-0.225, 0.225, 37))
    grid = np.column_stack([u.ravel(), v.ravel()])
    touched = 0
    for _ in range(120):
        x, y, angle = *rng.uniform((0, 0), (8, 6)), rng.uniform(-4, 4)
        c, s = math.cos(angle), math.sin(angle)
        points = grid @ np.array([[c, s], [-s, c]]) + (x, y)
        name = plan.touched(x, y, angle, (0.26, 0.225), 6.0)
        hits = inside(PLAN, points, 6.0).any()
        assert bool(name) or not hits
        if name and not hits:
            # The grid's points are 13 mm apart: a little larger, and one of them must see it.
            assert inside(PLAN, (points - (x, y)) * 1.08 + (x, y), 6.0).any()
        touched += bool(name)
        clearance = plan.clearance(x, y, 6.0)
        ring = np.column_stack([np.cos(np.linspace(0, 7, 6000)), np.sin(np.linspace(0, 7, 6000))])
        assert not inside(PLAN, (x, y) + 0.999 * clearance * ring, 6.0).any() or clearance == 0
        assert inside(PLAN, (x, y) + (clearance + 2e-3) * ring, 6.0).any()
    assert 12 < touched < 108


def test_cells_that_things_touch() -> None:
    marks = FloorPlan(PLAN).grid(0.1, (80, 60), 6.0)
    rng = np.random.default_rng(4)
    points = rng.uniform((0, 0), (8, 6), (20_000, 2))
    hit = inside(PLAN, points, 6.0)
    i, j = (points / 0.1).astype(int).T
    assert marks[i[hit], j[hit]].all()
    corners = np.stack(np.meshgrid(np.linspace(0, 0.1, 9), np.linspace(0, 0.1, 9)), axis=-1).reshape(-1, 2)
    full = sum(inside(PLAN, corners + 0.1 * cell, 6.0).any() for cell in np.argwhere(marks))
    assert full >= 0.98 * marks.sum()


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("name", [*PLACES, "mixed"])
def test_the_worlds_see_the_same(name: str, world: str) -> None:
    room = PLAN if name == "mixed" else place(name)
    plan = FloorPlan(room, 0.45)
    rng = np.random.default_rng(5)
    with in_room(world, room) as vehicle:
        for t in (0.0, 6.0, 20.0):
            vehicle.at(t)
            vehicle.step((0.0, 0.0), (0.0, 0.0))
            origins, ways = rays(rng, room, 400)
            free = ~inside(room, origins, t)
            exact = plan.cast(origins[free], ways[free], t, 3.0)
            seen = vehicle.cast(origins[free], ways[free], 0.45, 3.0)
            both = np.isfinite(exact) & np.isfinite(seen)
            assert both.sum() > 100
            error = np.abs(exact[both] - seen[both])
            if world == "mujoco":
                assert error.max() < 1e-9
                assert (np.isfinite(exact) == np.isfinite(seen)).all()
                continue
            # PyBullet makes prisms of cylinders.
            assert (error > 5e-3).mean() < 0.01
            if name == "empty":
                assert error.max() < 1e-9
            elif not room.columns and not room.people:
                # Corners that stand out are a little round.
                assert (error > 1e-9).mean() < 0.01
            # Only what's grazed, or just out of reach, is seen by one alone.
            assert (np.isfinite(exact) != np.isfinite(seen)).mean() < 0.01
