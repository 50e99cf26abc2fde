"""Shapes of robots and rooms: closed, of the chassis's size, and where the physics has them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
import trimesh

from robots.ipr.parameters import IPR, MICRO
from robots.ipr.shapes import ipr_shapes, micro_shapes
from robots.mobile.chassis import Chassis
from robots.mobile.robot import PLACES, place
from robots.mobile.shapes import links, person_shape, room_shapes
from robots.solids import LinkShape
from vrs.errors import InvalidValueError
from vrs.model import Array

KINDS = [IPR, MICRO]


def shapes(chassis: Chassis) -> tuple[LinkShape, ...]:
    return ipr_shapes() if chassis is IPR else micro_shapes()


def mesh(shape: LinkShape, X: Array | None = None) -> Any:
    corners = shape.vertices if X is None else shape.vertices @ X[:3, :3].T + X[:3, 3]
    return trimesh.Trimesh(corners, shape.faces, process=False)


@lru_cache
def whole(chassis: Chassis) -> Any:
    poses = links(chassis, (0, 0, 0))
    return trimesh.util.concatenate([mesh(s, X) for s, X in zip(shapes(chassis), poses, strict=True)])


@pytest.mark.parametrize("chassis", KINDS, ids=lambda one: one.kind)
def test_every_body_is_closed_and_faces_outwards(chassis: Chassis) -> None:
    for shape in shapes(chassis):
        for body in mesh(shape).split(only_watertight=False):
            assert body.is_watertight, shape.name
            assert body.volume > 0, shape.name


@pytest.mark.parametrize("chassis", KINDS, ids=lambda one: one.kind)
def test_a_robot_is_as_large_as_its_chassis_and_stands_on_the_floor(chassis: Chassis) -> None:
    part = chassis
    low, high = whole(chassis).bounds
    tolerance = 0.02 * part.length
    assert low[2] == pytest.approx(0.0, abs=1e-3)
    assert high[2] == pytest.approx(part.height, abs=tolerance)
    assert (low[0], high[0]) == pytest.approx(
        (part.centre_x - part.length / 2, part.centre_x + part.length / 2), abs=tolerance
    )
    assert (low[1], high[1]) == pytest.approx((-part.width / 2, part.width / 2), abs=tolerance)
    assert sum(len(shape.faces) for shape in shapes(chassis)) <= 20_000


@pytest.mark.parametrize("chassis", KINDS, ids=lambda one: one.kind)
def test_links_are_where_the_posture_says(chassis: Chassis) -> None:
    part = chassis
    poses = links(chassis, (2.0, 3.0, np.pi / 2))
    assert poses.shape == (len(shapes(chassis)), 4, 4) == (5, 4, 4)
    assert poses[0][:3, 3] == pytest.approx([2, 3, 0])
    # The right wheel is to the right.
    assert poses[1][:3, 3] == pytest.approx([2 + part.wheel_base / 2, 3, part.wheel_radius], abs=1e-12)
    assert poses[1][:3, 0] == pytest.approx([0, 1, 0], abs=1e-12)
    assert poses[2][:3, 3] == pytest.approx([2 - part.wheel_base / 2, 3, part.wheel_radius], abs=1e-12)
    x, y = part.casters[1]
    assert poses[4][:3, 3] == pytest.approx([2 - y, 3 + x, 0], abs=1e-12)
    with pytest.raises(InvalidValueError):
        links(chassis, (0, 0))


@pytest.mark.parametrize("name", PLACES)
def test_a_room_looks_as_it_is(name: str) -> None:
    room = place(name)
    floor, *things = room_shapes(room)
    assert mesh(floor).bounds[1][2] == 0.0
    assert len(things) == len(room.things)
    for shape, thing in zip(things, room.things, strict=True):
        body = mesh(shape)
        assert body.is_watertight
        assert body.bounds[:, 2] == pytest.approx([0.0, thing.height], abs=1e-9)
        assert body.center_mass[:2] == pytest.approx([thing.x, thing.y], abs=1e-6)
    for block, shape in zip(room.blocks, things, strict=False):
        full = block.length * block.width * block.height
        assert mesh(shape).volume == pytest.approx(full, rel=0.05)
    for person in room.people:
        low, high = mesh(person_shape(person)).bounds
        assert high == pytest.approx([person.radius, person.radius, person.height], abs=0.01)
        assert low[2] == pytest.approx(0.0, abs=1e-9)
