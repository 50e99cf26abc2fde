"""Floor plans: read, refused with the line named, and what people in them do."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.mobile.robot import PLACES, place
from robots.rooms import MOST_THINGS, Person, load_room, read_room
from vrs.errors import FormatError, InvalidValueError

PLAN = """room 1
name A room   # a comment
size 6 4
start 1 2 90

wall 0 0  3 4  thickness=0.2 height=2
box 3 2  1.2 0.6  angle_deg=30 height=0.75 unknown from=5 until=60
column 5 3 0.2
person 0.25 repeat  0,1,1  4,3,1  8,1,1
"""


def test_a_plan_is_read() -> None:
    room = read_room(PLAN)
    assert (room.name, room.length, room.width) == ("A room", 6.0, 4.0)
    assert room.start == (1.0, 2.0, math.radians(90))
    wall, box = room.blocks
    assert (wall.x, wall.y, wall.width, wall.height, wall.known) == (1.5, 2.0, 0.2, 2.0, True)
    assert wall.length == pytest.approx(5.2, abs=1e-12)
    assert wall.angle == pytest.approx(math.atan2(4, 3), abs=1e-12)
    assert (box.length, box.width, box.angle, box.known) == (1.2, 0.6, math.radians(30), False)
    assert [box.stands(t) for t in (4.9, 5.0, 59.9, 60.0)] == [False, True, True, False]
    assert room.columns[0].radius == 0.2
    assert room.known().things == (wall, room.columns[0])
    assert room.known().people == ()


def test_a_person_walks_by_the_clock() -> None:
    (person,) = read_room(PLAN).people
    assert [person.at(t) for t in (0.0, 2.0, 4.0, 6.0, 8.0)] == [(1, 1), (2, 1), (3, 1), (2, 1), (1, 1)]
    assert person.at(8.0 + 2.0) == person.at(2.0)
    assert person.at(80_002.0) == pytest.approx((2.0, 1.0), abs=1e-9)
    assert person.speed == 0.5
    once = Person("p", 0.2, 1.7, (5.0, 6.0), (0.0, 1.0), (0.0, 0.0))
    assert [once.at(t) for t in (0.0, 5.5, 99.0)] == [(0.0, 0.0), (0.5, 0.0), (1.0, 0.0)]


BAD = {
    "box 3 2 1": "line 6",
    "box 3 2 1 x": "line 6",
    "box 3 2 1 nan": "line 6",
    "box 3 2 1 0": "line 6",
    "box 3 2 1 1 colour=3": "unknown 'colour'",
    "box 3 2 1 1 height=0.5 height=0.5": "height twice",
    "box 3 2 1 1 from=5 until=5": "from must be before until",
    "wall 0 0 7.5 0": "x must be a number in [-1, 7]",
    "wall 1 1 1 1": "at least 0.01 m",
    "wall 0 0 1 inf": "line 6",
    "column 1 1 -1": "radius",
    "person 0.25": "points",
    "person 0.25 0,1,1 0,2,1": "ascend",
    "person 0.25 0,1,1 1,5,1": "3 m/s",
    "person 0.25 0,1 1,5,1": "t,x,y",
    "person 0.25 repeat 0,1,1 5,2,1": "ends where it began",
    "size 3 3": "second size",
    "gate 1 1": "unknown word 'gate'",
}


@pytest.mark.parametrize("line", BAD)
def test_a_bad_line_is_named(line: str) -> None:
    with pytest.raises(FormatError) as error:
        read_room(f"room 1\n# x\nname N\nsize 6 4\n\n{line}\n", "my.room")
    assert str(error.value).startswith("my.room, line 6: ")
    assert BAD[line] in str(error.value)


@pytest.mark.parametrize("text", ["", "size 3 3", "room 2\nsize 3 3", "room 1", "room 1\nbox 1 1 1 1\nsize 3 3"])
def test_what_is_no_plan_is_refused(text: str) -> None:
    with pytest.raises(FormatError):
        read_room(text)


def test_a_plan_is_bounded(tmp_path) -> None:  # type: ignore[no-untyped-def]
    column = "column 1 1 0.1\n"
    assert len(read_room("room 1\nsize 3 3\n" + column * MOST_THINGS).columns) == MOST_THINGS
    with pytest.raises(FormatError, match="more than 1000 things"):
        read_room("room 1\nsize 3 3\n" + column * (MOST_THINGS + 1))
    path = tmp_path / "big.room"
    path.write_bytes(b"#" * 300_000)
    with pytest.raises(FormatError, match=r"big\.room: longer than"):
        load_room(path)
    path.write_bytes(b"room 1\n\xff")
    with pytest.raises(FormatError, match="no UTF-8 at byte 7"):
        load_room(path)


@given(st.text(max_size=200))
def test_any_text_is_read_or_refused_as_a_format(text: str) -> None:
    with pytest.raises(FormatError):
        read_room("room 1\nsize 3 3\n" + text + "\ndoor")


def test_the_rooms_that_come_with_the_package() -> None:
    for name in PLACES:
        assert place(name).blocks
    room = place("fig13")
    assert (room.length, room.width) == (12.5, 6.1)
    hidden = [thing for thing in room.things if not thing.known]
    assert hidden
    assert all(abs(thing.x - 6.25) < 1 and abs(thing.y - 3.05) < 1 for thing in hidden)
    assert place("fig13_person").people
    with pytest.raises(InvalidValueError, match="one of berths"):
        place("../rooms/empty")
