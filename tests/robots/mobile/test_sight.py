"""What the camera sees is where a pinhole has it, in the colours of the 3D view, and goes with the room's time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from robots.base import upright
from robots.mobile.camera import OVERHEAD_VIEW, Lens, Look, Sight, lens_pose
from robots.mobile.renderer import SKY, Picture
from robots.robot import HeadCamera, load
from robots.rooms import EMPTY, read_room

CAMERA = load("ipr").device(HeadCamera)
assert CAMERA is not None
LENS = Lens(width=240, height=180, view=math.radians(60.0))
ROOM = read_room("""room 1
size 10 10
start 2 5 0
box 5 4.5  0.6 0.6 height=1.0
box 2 8  0.6 0.6 height=1.0 unknown from=5 until=9
person 0.25  0,8,2  10,8,8
""")
AHEAD = Look(0.0, 0.0)


@pytest.fixture(scope="module")
def sight() -> Sight:
    return Sight(ROOM, CAMERA, LENS)


def where(picture: Picture, kind: str) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Which pixels are wood, something new, cloth."""
    r, _, b = (picture[..., k].astype(float) for k in range(3))
    if kind == "cloth":
        return b > 1.3 * r
    return b < 0.4 * r if kind == "new" else (b > 0.4 * r) & (b < 0.57 * r)


def projected(
    posture: tuple[float, float, float], look: Look, point: tuple[float, float, float]
) -> tuple[float, float]:
    """Column and row at which a pinhole has a point of the world."""
    X = upright(*posture) @ lens_pose(look, CAMERA)
    x, y, z = X[:3, :3].T @ (np.array(point) - X[:3, 3])
    focus = LENS.width / 2 / math.tan(LENS.view / 2)
    return LENS.width / 2 - focus * y / x, LENS.height / 2 - focus * z / x


@pytest.mark.parametrize(
    ("posture", "look"),
    [((2.0, 5.0, 0.0), AHEAD), ((2.0, 5.0, 0.5), Look(-0.7, 0.1)), ((5.0, 8.0, -2.0), Look(0.4, -0.15))],
)
def test_a_box_is_where_a_pinhole_has_its_corners(
    sight: Sight, posture: tuple[float, float, float], look: Look
) -> None:
    found = where(sight.draw(posture, look, 0.0), "wood")
    columns, rows = np.flatnonzero(found.any(axis=0)), np.flatnonzero(found.any(axis=1))
    corners = [projected(posture, look, (x, y, z)) for x in (4.7, 5.3) for y in (4.2, 4.8) for z in (0.0, 1.0)]
    u, v = np.array(corners).T
    assert (columns[0], columns[-1] + 1) == pytest.approx((u.min(), u.max()), abs=2.5)
    assert (rows[0], rows[-1] + 1) == pytest.approx((v.min(), v.max()), abs=2.5)


def test_who_walks_is_seen_where_they_are_at_that_time(sight: Sight) -> None:
    posture = (2.0, 5.0, 0.0)
    for t in (3.0, 5.0, 7.5):
        column, _ = projected(posture, AHEAD, (*ROOM.people[0].at(t), 1.0))
        seen = np.flatnonzero(where(sight.draw(posture, AHEAD, t), "cloth").any(axis=0))
        assert seen.mean() == pytest.approx(column, abs=3.0)


def test_what_comes_and_goes_is_seen_while_it_stands(sight: Sight) -> None:
    left = Look(math.radians(90.0), 0.0)
    seen = [bool(where(sight.draw((2.0, 5.0, 0.0), left, t), "new").any()) for t in (4.9, 5.0, 8.9, 9.0)]
    assert seen == [False, True, True, False]


def test_a_door_is_in_the_way_until_it_opens() -> None:
    room = read_room("room 1\nsize 6 4\nwall 3 0  3 1.5\nwall 3 2.5  3 4\ndoor 3 1.5  3 2.5 sliding 0,0 2,0 4,1\n")
    sight = Sight(room, CAMERA, LENS)
    shut, half, wide = (sight.draw((1.0, 2.0, 0.0), AHEAD, t)[70:110, 100:140].astype(int) for t in (1, 3, 5))
    # Its leaf is browner than the wall, and beyond it there's nothing but sky and floor.
    brown = [(part[..., 0] - part[..., 2] > 0.2 * part[..., 0]).mean() for part in (shut, half, wide)]
    assert brown[0] == 1.0
    assert 0.2 < brown[1] < 0.8
    assert brown[2] == 0.0


def test_without_walls_there_is_sky_above_and_a_floor_that_moves_below(sight: Sight) -> None:
    one = sight.draw((2.0, 5.0, 0.0), AHEAD, 0.0)
    assert (one[0] == SKY).all()
    moved = sight.draw((2.2, 5.0, 0.0), AHEAD, 0.0)
    assert (one[150:] != moved[150:]).any(axis=-1).mean() > 0.05
    assert (one == sight.draw((2.0, 5.0, 0.0), AHEAD, 0.0)).all()


def test_its_own_display_is_in_the_way_far_down(sight: Sight) -> None:
    down = sight.draw((2.0, 5.0, 0.0), Look(0.0, -0.6), 0.0).astype(int)
    dark = down.sum(axis=-1) < 150
    assert dark.mean() > 0.1
    assert not (sight.draw((2.0, 5.0, 0.0), AHEAD, 0.0).astype(int).sum(axis=-1) < 150).any()


def test_the_floor_of_nowhere_goes_on_and_stays_where_it_is() -> None:
    sight = Sight(EMPTY, CAMERA, LENS)
    at = [sight.draw((x, 0.0, 0.3), Look(0.0, -0.2), 0.0) for x in (0.0, 100.0, 100.25)]
    # By a whole number of pairs of tiles the same, by half a tile another.
    assert (at[0] == at[1]).mean() > 0.99
    assert (at[0] != at[2]).any(axis=-1).mean() > 0.02


def test_walls_carry_a_ceiling() -> None:
    room = read_room("room 1\nsize 4 4\nwall 0 0  4 0\nwall 4 0  4 4\nwall 4 4  0 4\nwall 0 4  0 0\n")
    sight = Sight(room, CAMERA, LENS)
    picture = sight.draw((2.0, 2.0, 0.0), Look(0.0, 0.7), 0.0)
    assert not (picture == SKY).all(axis=-1).any()


def test_from_above_all_is_where_the_map_has_it_and_the_ceiling_is_open() -> None:
    room = read_room(
        "room 1\nsize 8 6\nwall 0 0  8 0\nwall 8 0  8 6\nwall 8 6  0 6\nwall 0 6  0 0\n"
        "box 6 4.5  0.8 0.4 height=0.01\nperson 0.25  0,2,5  10,6,5\n"
    )
    robot = load("ipr")
    sight = Sight(room, CAMERA, LENS, robot.appearance)
    picture = sight.above((2.0, 1.5, 0.7), 5.0)
    # The floor is so far below that 8 m and a twentieth, seen at the height of the walls, fill the picture.
    away = 0.5 * 1.05 * 8.0 / math.tan(OVERHEAD_VIEW / 2) + 2.4
    scale = LENS.width / 2 / math.tan(OVERHEAD_VIEW / 2) / away

    def pixel(x: float, y: float) -> tuple[float, float]:
        return LENS.width / 2 + scale * (x - 4.0), LENS.height / 2 - scale * (y - 3.0)

    rows, columns = np.nonzero(where(picture, "wood"))
    assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx(pixel(6.0, 4.5), abs=1.0)
    assert len(rows) == pytest.approx(scale**2 * 0.8 * 0.4, rel=0.15)
    # From the middle who walks leans away to both sides alike.
    upper = [sight.above((2.0, 1.5, 0.7), t)[: LENS.height // 2] for t in (2.5, 5.0, 7.5)]
    walker = [np.nonzero(where(half, "cloth"))[1].mean() + 0.5 for half in upper]
    assert walker[1] == pytest.approx(pixel(4.0, 0.0)[0], abs=1.0)
    assert walker[0] + walker[2] == pytest.approx(2 * walker[1], abs=2.0)
    assert scale < walker[2] - walker[1] < 1.25 * scale
    alone = sight.above((6.0, 1.5, 0.7), 5.0)
    rows, columns = np.nonzero((picture != alone).any(axis=-1))
    assert (columns.min(), columns.max()) == pytest.approx((pixel(1.75, 0)[0], pixel(6.25, 0)[0]), abs=6.0)
    assert rows.mean() == pytest.approx(pixel(0.0, 1.5)[1], abs=3.0)


def test_the_picture_of_both_is_the_robots_with_the_room_in_its_corner(sight: Sight) -> None:
    posture = (2.0, 5.0, 0.3)
    alone, above, both = (
        sight.draw(posture, AHEAD, 0.0), sight.above(posture, 0.0, share=0.4), sight.both(posture, AHEAD, 0.0)
    )  # fmt: skip
    assert (both[:72, -96:] == above).all()
    assert (both[73:] == alone[73:]).all()
    assert (both[:, :-97] == alone[:, :-97]).all()


def test_of_a_hall_it_shows_what_is_about_the_robot() -> None:
    hall = read_room("room 1\nsize 100 100\nbox 51 50  0.4 0.4 height=0.01\n")
    sight = Sight(hall, CAMERA, LENS)
    near, far = (where(sight.above((x, 50.0, 0.0), 0.0), "wood") for x in (50.0, 70.0))
    assert near.any()
    assert not far.any()
