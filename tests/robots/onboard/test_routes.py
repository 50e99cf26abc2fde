"""Routes: they keep their distance, are hardly longer than the shortest way, and say why there's none."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.lab.goals.scenes import Shortest
from robots.ipr.parameters import IPR
from robots.mobile.navigation import route_config, route_map
from robots.onboard.path import Arc, Pivot
from robots.onboard.routes import NoRoute, Route, RouteConfig, RouteMap
from robots.rooms import Block, Room
from vrs.errors import InvalidValueError

CONFIG = route_config(IPR.footprint)


def room(*boxes: tuple[float, float, float, float, float]) -> Room:
    """8 m × 6 m with walls and boxes x, y, length, width, angle."""
    walls = [
        (4.0, 0.0, 8.1, 0.1, 0.0),
        (4.0, 6.0, 8.1, 0.1, 0.0),
        (0.0, 3.0, 0.1, 6.1, 0.0),
        (8.0, 3.0, 0.1, 6.1, 0.0),
    ]
    blocks = tuple(Block(f"box {k}", *box, 1.0) for k, box in enumerate([*walls, *boxes]))
    return Room("made", 8.0, 6.0, blocks=blocks)


def off(place: tuple[float, float], block: Block) -> float:
    """Exact distance of a place to a box [m]."""
    dx, dy = place[0] - block.x, place[1] - block.y
    c, s = math.cos(block.angle), math.sin(block.angle)
    along, across = abs(c * dx + s * dy) - block.length / 2, abs(c * dy - s * dx) - block.width / 2
    return math.hypot(max(along, 0.0), max(across, 0.0))


boxes = st.lists(
    st.tuples(st.floats(1, 7), st.floats(1, 5), st.floats(0.2, 2.5), st.floats(0.2, 1.5), st.floats(0, math.pi)),
    min_size=1, max_size=5,
)  # fmt: skip
places = st.tuples(st.floats(0.5, 7.5), st.floats(0.5, 5.5))


@settings(deadline=None, max_examples=40)
@given(boxes, places, places)
def test_a_route_keeps_its_distance_and_turns_where_there_is_room(
    things: list[tuple[float, float, float, float, float]], start: tuple[float, float], goal: tuple[float, float]
) -> None:
    made = room(*things)
    roads = route_map(made, IPR.footprint)
    found = roads.route(start, goal)
    if isinstance(found, NoRoute):
        assert found.reason
        return
    for place in found.places(0.05).tolist():
        assert min(off(place, block) for block in made.blocks) >= CONFIG.half_width + CONFIG.least - 1e-6
    for place in found.points:
        assert min(off(place, block) for block in made.blocks) >= CONFIG.turning + CONFIG.least - 1e-6
    assert found.length >= math.dist(start, goal) - 1e-9


def test_a_route_is_hardly_longer_than_the_shortest_way() -> None:
    ratios = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        at, size = rng.uniform((1.5, 1.5), (6.5, 4.5), (4, 2)), rng.uniform(0.3, 1.6, (4, 2))
        made = room(*((*middle, *sides, 0.0) for middle, sides in zip(at.tolist(), size.tolist(), strict=True)))
        roads, disc = route_map(made, IPR.footprint), Shortest(made, CONFIG.half_width + CONFIG.margin)
        for start, goal in rng.uniform((0.6, 0.6), (7.4, 5.4), (12, 2, 2)).tolist():
            found = roads.route(start, goal)
            if isinstance(found, Route) and math.dist(start, goal) > 1.5:
                ratios.append(found.length / disc.length(start, goal))
    assert len(ratios) > 10
    assert min(ratios) >= 0.985
    assert np.median(ratios) <= 1.05


def test_a_wall_with_a_closed_door_has_no_way_and_with_an_open_one_the_way_leads_through_it() -> None:
    closed = room((3.0, 3.0, 0.1, 6.0, 0.0))
    assert isinstance(route_map(closed, IPR.footprint).route((1.0, 1.0), (6.0, 1.0)), NoRoute)
    opened = room((3.0, 1.0, 0.1, 2.0, 0.0), (3.0, 4.5, 0.1, 3.0, 0.0))
    found = route_map(opened, IPR.footprint).route((1.0, 1.0), (6.0, 1.0))
    assert isinstance(found, Route)
    crossing = [(a, b) for a, b in pairwise(found.points) if a[0] < 3.0 <= b[0]]
    ((a, b),) = crossing
    y = a[1] + (3.0 - a[0]) / (b[0] - a[0]) * (b[1] - a[1])
    assert 2.0 + CONFIG.half_width < y < 3.0 - CONFIG.half_width


def test_what_is_newly_seen_is_gone_round_or_leaves_no_way() -> None:
    roads = route_map(room((3.0, 1.0, 0.1, 2.0, 0.0), (3.0, 4.5, 0.1, 3.0, 0.0)), IPR.footprint)
    start, goal = (1.0, 1.0), (6.0, 1.0)
    straight = roads.route((4.0, 1.0), (7.0, 1.0))
    assert isinstance(straight, Route)
    assert len(straight.points) == 2
    chair = np.array([(5.5, 1.0), (5.55, 1.05), (5.5, 1.1)])
    assert roads.crosses(straight.points, chair)
    round_it = roads.route((4.0, 1.0), (7.0, 1.0), blocked=chair)
    assert isinstance(round_it, Route)
    assert len(round_it.points) > 2
    assert not roads.crosses(round_it.points, chair)
    door = np.column_stack([np.full(20, 3.0), np.linspace(2.0, 3.0, 20)])
    assert isinstance(roads.route(start, goal, blocked=door), NoRoute)
    assert isinstance(roads.route(start, goal), Route)
    at_goal = roads.route(start, goal, blocked=[goal])
    assert isinstance(at_goal, NoRoute)
    assert "(6.00, 1.00)" in at_goal.reason


def test_the_route_as_a_path_ends_at_the_goal() -> None:
    pieces = Route(((0.0, 0.0), (1.0, 0.0), (1.0, 2.0))).pieces(0.0, math.pi)
    assert pieces == [Arc(0.0, 1.0), Pivot(math.pi / 2), Arc(0.0, 2.0), Pivot(math.pi / 2)]
    assert Route(((1.0, 1.0),)).pieces(0.3) == []


def test_known_things_and_their_outlines() -> None:
    roads = RouteMap((4.0, 4.0), [[(1, 1), (2, 1), (2, 2), (1, 2)]], RouteConfig(0.4, 0.2))
    assert roads.knows(np.array([(2.05, 1.5), (2.2, 1.5), (1.5, 1.5)]), 0.1).tolist() == [True, False, True]
    ring = roads.outlines(0.1)
    assert np.abs(np.abs(ring - 1.5).max(axis=1) - 0.5).max() < 1e-12
    assert np.hypot(*np.diff(ring, axis=0).T).max() <= 0.1 + 1e-12


@pytest.mark.parametrize("bad", [{"turning": 0.0}, {"half_width": 0.5}, {"margin": -1.0}, {"least": 0.1}])
def test_what_makes_no_sense_is_refused(bad: dict[str, float]) -> None:
    with pytest.raises(InvalidValueError):
        RouteConfig(**{"turning": 0.4, "half_width": 0.2, **bad})
    with pytest.raises(InvalidValueError):
        RouteMap((0.0, 1.0), [], RouteConfig(0.4, 0.2))
    with pytest.raises(InvalidValueError):
        RouteMap((4.0, 4.0), [], RouteConfig(0.4, 0.2)).route((math.nan, 0.0), (1.0, 1.0))


def test_a_door_is_driven_through_in_which_the_robot_could_not_turn() -> None:
    wide = 2 * (CONFIG.half_width + CONFIG.margin) + 0.06
    assert wide < 2 * CONFIG.turning
    low, high = 3.0 - wide / 2, 6.0 - 3.0 - wide / 2
    made = room((3.0, low / 2, 0.1, low, 0.0), (3.0, 6.0 - high / 2, 0.1, high, 0.0))
    roads = route_map(made, IPR.footprint)
    assert not roads.is_free((3.0, 3.0))
    found = roads.route((1.0, 1.0), (6.0, 5.0))
    assert isinstance(found, Route)
    assert all(abs(x - 3.0) > 0.05 for x, _ in found.points)


def test_what_stands_where_the_robot_will_turn_is_in_its_way() -> None:
    """A turn takes more room than a drive: beside the way it's free, beside the corner it isn't."""
    roads = RouteMap((8.0, 6.0), [], CONFIG)
    way = [(1.0, 1.0), (4.0, 1.0), (4.0, 4.0)]
    between = 0.5 * (CONFIG.half_width + CONFIG.turning)
    assert not roads.crosses(way, [(2.0, 1.0 - between)])
    assert roads.crosses(way, [(4.0, 1.0 - between)])
