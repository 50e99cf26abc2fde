"""Fleets: their files, where their robots stand, and what they sense of each other."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import numpy as np
import pytest

from robots import load
from robots.fleet import Fleet, read_fleet
from robots.mobile.floor_plan import FloorPlan
from robots.mobile.robot import MobileRobot
from robots.robot import BARE
from robots.rooms import Posture
from robots.simulated import WORLDS
from vrs.errors import VrsError

CARTS = """
room = "furnished"

[[robots]]
robot = "ipr"
name = "cart"
count = 4
body = "bare"

[[robots]]
robot = "puma560"
"""
FACING = """
[[robots]]
robot = "ipr"
name = "cart"
count = 2
start = [2.0, 3.0, 0.0]
step = [1.5, 0.0]
"""


def fleet(folder: Path, text: str) -> Fleet:
    path = folder / "fleet.toml"
    path.write_text(text)
    return read_fleet(path)


def test_robots_are_named_and_found_again_by_their_file(tmp_path: Path) -> None:
    found = fleet(tmp_path, CARTS)
    names = [member.robot.name for member in found.members]
    assert names == ["cart-1", "cart-2", "cart-3", "cart-4", "puma560"]
    third = load(f"{tmp_path}/fleet.toml#cart-3")
    assert (third.name, third.base.name, third.usual_body, third.is_base) == ("cart-3", "cart-3", BARE, True)
    assert load(third.found_by).name == "cart-3"
    assert third.recorded_by == f"{tmp_path}/fleet.toml#cart-3"


def test_those_without_a_place_stand_free_and_apart(tmp_path: Path) -> None:
    found = fleet(tmp_path, CARTS)
    plan = FloorPlan(found.room)
    for member in found.members:
        x, y, _ = member.start
        assert plan.clearance(x, y, 0.0) > member.box.radius
    for one, other in itertools.combinations(found.members, 2):
        assert math.dist(one.start[:2], other.start[:2]) > one.box.radius + other.box.radius
    assert found.members[0].start == found.room.start


def test_a_start_and_a_step_are_kept_and_other_files_count_from_this_one(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text("wheelbase = 0.4\nwheel = 0.1\n")
    (tmp_path / "own.room").write_text("room 1\nname Hall\nsize 9 9\nstart 1 1 0\n")
    text = '[[robots]]\nrobot = "own.toml"\ncount = 3\nstart = [2, 2, 90]\nstep = [1, 0.5]\n'
    found = fleet(tmp_path, f'room = "own.room"\n{text}')
    assert [member.start for member in found.members] == [(2 + k, 2 + k / 2, math.pi / 2) for k in range(3)]
    assert (found.room.name, found.members[2].robot.name) == ("Hall", "own-3")


def test_arms_stand_in_the_map_and_mobile_robots_dont(tmp_path: Path) -> None:
    found = fleet(tmp_path, CARTS)
    room = found.room_of(0, lambda k: found.members[k].start)
    assert "puma560" in [block.name for block in room.known().blocks]
    assert [one.name for one in room.neighbours] == ["cart-2", "cart-3", "cart-4"]
    assert room.start == found.members[0].start
    assert room.known().neighbours == ()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "a fleet has room and"),
        ("robots = []", "a fleet has room and"),
        ('[[robots]]\nrobot = "ipr"\ncolour = 3\n', "colour"),
        ('[[robots]]\nrobot = "ipr"\ncount = 0\n', ">= 1"),
        ('[[robots]]\nrobot = "nobody"\n', "robot must be one of"),
        ('[[robots]]\nrobot = "ipr"\nbody = "wood"\n', "body of ipr must be one of"),
        ('room = "moon"\n[[robots]]\nrobot = "ipr"\n', "room must be one of"),
        ('[[robots]]\nrobot = "ipr"\n[[robots]]\nrobot = "ipr"\n', "called ipr"),
        ('[[robots]]\nrobot = "ipr"\ncount = 40\n[[robots]]\nrobot = "micro"\ncount = 40\n', "at most 64"),
        ('[[robots]]\nrobot = "ipr"\nstart = [0, 3, 0]\n', "ipr would stand in wall"),
        (
            '[[robots]]\nrobot = "ipr"\ncount = 2\nstart = [2, 2, 0]\nstep = [0.1, 0]\n',
            "ipr-2 would stand in ipr-1",
        ),
        ('room = "furnished"\n[[robots]]\nrobot = "ipr"\ncount = 60\n', "finds no place for ipr-"),
        ("[[robots", "a fleet has room and"),
    ],
)
def test_what_a_file_cant_say_is_one_clear_error(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(VrsError, match=said):
        fleet(tmp_path, text)


def test_a_name_that_isnt_there_says_which_are(tmp_path: Path) -> None:
    fleet(tmp_path, FACING)
    with pytest.raises(VrsError, match="cart-1, cart-2"):
        load(f"{tmp_path}/fleet.toml#cart-3")


def pair(found: Fleet, body: str, *, seen: bool = True) -> tuple[MobileRobot, MobileRobot]:
    """Two robots that drive beside each other, a control period each in turn."""
    made: dict[int, MobileRobot] = {}

    def where(k: int) -> Posture:
        return made[k].truth if k in made else found.members[k].start

    for k, member in enumerate(found.members):
        make = member.robot.body(body)
        made[k] = make(room=found.room_of(k, where if seen else None), rng=np.random.default_rng(k))
    return made[0], made[1]


@pytest.mark.parametrize("body", [BARE, *WORLDS])
@pytest.mark.parametrize("seen", [True, False])
def test_a_robot_runs_into_another_and_sees_it_come(tmp_path: Path, body: str, *, seen: bool) -> None:
    one, other = pair(fleet(tmp_path, FACING), body, seen=seen)
    with one, other:
        length = one.chassis.length
        for _ in range(200):
            for robot, v in ((one, 0.3), (other, -0.1)):
                robot.drive(v, 0.0, round(0.05 / robot.reality.dt))
        assert [touch.thing for touch in one.collisions[:1]] == (["cart-2"] if seen else [])
        gap = other.truth[0] - one.truth[0]
        assert (gap > 0.9 * length) is seen


def test_a_laser_measures_another_robot_where_it_is_now(tmp_path: Path) -> None:
    one, other = pair(fleet(tmp_path, FACING), BARE)
    with one, other:
        ahead = np.array([[one.truth[0], one.truth[1]]]), np.array([[1.0, 0.0]])
        found = []
        for _ in range(2):
            back = other.truth[0] + other.chassis.centre_x - other.chassis.length / 2
            found.append(float(one.distances(*ahead, 10.0, 0.3)[0]) - (back - one.truth[0]))
            other.drive(0.3, 0.0, 120)
        assert found == pytest.approx([0.0, 0.0], abs=1e-5)
        assert other.truth[0] > 3.6
