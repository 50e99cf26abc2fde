"""Doors: leaves that turn about their hinge or slide past it, on the plan and in physics alike."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.mobile.floor_plan import FloorPlan
from robots.mobile.robot import place
from robots.rooms import Door, read_room
from robots.simulated import WORLDS
from tests.robots.mobile.worlds import in_room
from vrs.errors import FormatError, InvalidValueError

PLAN = """room 1
size 6 4
wall 3 0  3 1.5
wall 3 2.5  3 4
door 3 1.5  3 2.5  hinged open_deg=-90 repeat  0,0  5,0  6,1  9,1  10,0
door 1 1    2 1    sliding thickness=0.06  2,0.5  4,1
via 1.5 2
place desk 1 2 90
place chair 2 2
"""


def test_a_plan_has_doors_via_points_and_places() -> None:
    room = read_room(PLAN)
    hinged, sliding = room.doors
    assert (hinged.sliding, sliding.sliding) == (False, True)
    assert [hinged.share(t) for t in (0.0, 5.5, 7.0, 9.5, 15.5)] == [0.0, 0.5, 1.0, 0.5, 0.5]
    assert [sliding.share(t) for t in (0.0, 3.0, 99.0)] == [0.5, 0.75, 1.0]
    opened = hinged.at(7.0)
    assert (opened.x, opened.y, opened.angle) == pytest.approx((3.5, 1.5, 0.0), abs=1e-12)
    assert (sliding.at(9.0).x, sliding.at(9.0).y) == pytest.approx((0.5, 1.0))
    assert room.via == ((1.5, 2.0),)
    assert room.place("desk").heading == pytest.approx(math.pi / 2)
    assert room.place("chair").heading is None
    with pytest.raises(InvalidValueError, match="desk, chair"):
        room.place("sofa")
    assert room.known().doors == ()
    assert room.known().places == room.places


BAD = {
    "door 1 1 2 1": "hinged or sliding",
    "door 1 1 2 1 hinged sliding": "hinged or sliding",
    "door 1 1 1 1.1 hinged": "0.3 m to 5 m",
    "door 1 1 2 1 hinged 0,2": "share must be",
    "door 1 1 2 1 hinged 0,0 0.1,1": "0.5 s",
    "door 1 1 2 1 hinged 0,0,1": "t,share",
    "door 1 1 2 1 sliding repeat 0,0 5,1": "ends as it began",
    "via 1": "x, y",
    "via 9 9": "x must be",
    "place 1 2": "a name",
    "place a 1 2 x": "heading",
}


@pytest.mark.parametrize("line", BAD)
def test_a_bad_line_is_named(line: str) -> None:
    with pytest.raises(FormatError) as error:
        read_room(f"room 1\nsize 6 4\n{line}\n", "my.room")
    assert str(error.value).startswith("my.room, line 3: ")
    assert BAD[line] in str(error.value)
    with pytest.raises(FormatError, match="name of its own"):
        read_room("room 1\nsize 6 4\nplace a 1 1\nplace a 2 2\n")


tables = st.lists(st.tuples(st.floats(0.5, 5), st.sampled_from([0.0, 0.25, 1.0])), min_size=2, max_size=5)


@given(tables, st.floats(0, 40), st.booleans(), st.booleans())
def test_a_leaf_keeps_its_hinge_and_stands_as_long_as_it_says(
    steps: list[tuple[float, float]], t: float, repeat: bool, sliding: bool
) -> None:
    times = np.cumsum([dt for dt, _ in steps]).tolist()
    shares = [share for _, share in steps]
    door = Door("d", sliding, 1.0, 2.0, 0.9, 0.3, 0.04, 2.0, 1.2, tuple(times), (*shares[:-1], shares[0]), repeat)
    leaf = door.at(t)
    if not sliding:
        hinge = leaf.x - 0.45 * math.cos(leaf.angle), leaf.y - 0.45 * math.sin(leaf.angle)
        assert hinge == pytest.approx((1.0, 2.0), abs=1e-12)
    else:
        assert leaf.angle == 0.3
        assert math.dist((leaf.x, leaf.y), (1.0, 2.0)) == pytest.approx(abs(0.45 - 0.9 * door.share(t)), abs=1e-12)
    begin, end = door.still(t)
    assert begin <= t <= end
    for share in (0.0, 0.3, 0.999):
        later = t + share * (min(end, t + 50) - t)
        assert door.share(later) == pytest.approx(door.share(t), abs=1e-9)
    soon = door.at(t + 1e-3)
    ends = [one.x + 0.45 * math.cos(one.angle) for one in (leaf, soon)]
    assert abs(ends[1] - ends[0]) <= door.speed * 1e-3 + 1e-9


@pytest.mark.parametrize("world", WORLDS)
def test_the_plan_and_physics_see_the_same_leaves(world: str) -> None:
    room = read_room(PLAN)
    plan = FloorPlan(room)
    with in_room(world, room) as vehicle:
        angles = np.linspace(0, math.tau, 73)
        ways = np.column_stack([np.cos(angles), np.sin(angles)])
        origins = np.tile([2.4, 2.1], (73, 1))
        for t in (0.0, 5.25, 5.6, 6.0, 7.0, 9.3, 12.0, 15.5):
            vehicle.at(t)
            exact, cast = plan.cast(origins, ways, t, 5.0), vehicle.cast(origins, ways, 0.3, 5.0)
            assert np.array_equal(np.isfinite(exact), np.isfinite(cast))
            seen = np.isfinite(exact)
            assert np.abs(exact[seen] - cast[seen]).max() < 2e-3


def test_the_home_has_rooms_doors_and_the_papers_places() -> None:
    home = place("home")
    assert {one.name for one in home.places} >= {"A", "B"}
    front, b = home.doors[0].at(0.0), home.place("B")
    assert math.dist((front.x, front.y), (b.x, b.y)) < 1.2
    assert {door.sliding for door in home.doors} == {False, True}
    assert home.people
    assert len(home.via) >= 4
