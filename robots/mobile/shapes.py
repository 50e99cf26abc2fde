"""What mobile robots look like on their wheels, and rooms: closed bodies, built with trimesh.

A robot is its body in the robot's frame (middle of the driving axle, on the floor, x forward), the right and the
left wheel about their middles, y the axle, and casters about the floor points under their swivel axes.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from robots.base import upright
from robots.mobile.chassis import Chassis
from robots.mobile.drive_train import as_posture
from robots.rooms import Block, Column, Door, Person, Room, is_wall
from robots.solids import Builder, LinkShape, drum, hull, lathe, loft
from vrs.model import Array, frozen_array

WHITE: Final = (0.92, 0.92, 0.89)
STEEL: Final = (0.62, 0.64, 0.67)
DARK: Final = (0.15, 0.17, 0.20)
BLUE: Final = (0.12, 0.30, 0.55)
SCREEN: Final = (0.10, 0.22, 0.30)
GLASS: Final = (0.05, 0.06, 0.09)
RUBBER: Final = (0.10, 0.10, 0.11)
BOARD: Final = (0.10, 0.36, 0.22)

WALL: Final = (0.86, 0.84, 0.79)
WOOD: Final = (0.66, 0.50, 0.33)
GROUND: Final = (0.74, 0.74, 0.72)
LEAF: Final = (0.76, 0.67, 0.53)
"""Colour of doors."""
NEW: Final = (0.80, 0.42, 0.20)
"""Of things that the operator's map doesn't have."""
CLOTH: Final = (0.30, 0.36, 0.52)
SKIN: Final = (0.86, 0.68, 0.56)


def box(low: ArrayLike, high: ArrayLike) -> Any:
    """Make a box from its lowest to its highest corner [m]."""
    import trimesh

    low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    pose = np.eye(4)
    pose[:3, 3] = (low + high) / 2
    return trimesh.creation.box(extents=high - low, transform=pose)


def rounded(bounds: tuple[float, float, float, float], low: float, high: float, corner: float, edge: float) -> Any:
    """Make an upright block over (x low, x high, y low, y high), corners round, top and bottom edges broken."""
    x0, x1, y0, y1 = bounds
    middle, a, b = ((x0 + x1) / 2, (y0 + y1) / 2), (x1 - x0) / 2, (y1 - y0) / 2
    layers = [(low, edge), (low + edge, 0.0), (high - edge, 0.0), (high, edge)]
    return loft([(z, middle, a - inset, b - inset, corner - inset) for z, inset in layers])


def add_sonars(build: Builder, body: Chassis, radius: float) -> None:
    """Set a dark disc where each sonar looks out of the outline, standing out by a fifth of its radius."""
    import trimesh

    for k in range(body.sonars):
        angle = k * math.tau / body.sonars
        c, s = math.cos(angle), math.sin(angle)
        out = min(body.length / 2 / max(abs(c), 1e-9), body.width / 2 / max(abs(s), 1e-9))
        ahead, beside = body.length * abs(s) <= body.width * abs(c), body.length * abs(s) >= body.width * abs(c)
        if min(abs(c), abs(s)) > 0.5:
            # The corners are round: the line leaves the housing sooner than the outline.
            n, out = np.array([c, s]), 0.93 * out
        else:
            n = np.array([math.copysign(ahead, c), math.copysign(beside and not ahead, s)])
        x, y = body.centre_x + out * c, out * s
        pose = np.array(
            [[0.0, -n[1], n[0], x], [0.0, n[0], n[1], y], [-1.0, 0.0, 0.0, body.sonar_height], [0, 0, 0, 1]]
        )
        for size, low, high, colour in ((1.0, -0.7, 0.2, STEEL), (0.8, -0.6, 0.3, DARK)):
            r = size * radius
            line = np.array([(0.0, low * radius), (r, low * radius), (r, high * radius), (0.0, high * radius)])
            build.add(trimesh.creation.revolve(line, sections=24, transform=pose), colour)


def wheel(name: str, body: Chassis, outside: int) -> LinkShape:
    """Build a driven wheel: tyre, rim and five spokes' bolts on its outer side (+1 is left)."""
    r, w = body.wheel_radius, body.wheel_width / 2
    build = Builder(name, RUBBER)
    build.add(
        lathe([(0.80 * r, -w), (0.96 * r, -w), (r, -0.6 * w), (r, 0.6 * w), (0.96 * r, w), (0.80 * r, w)], axis="y")
    )
    build.add(drum(0.72 * r, -0.97 * w, 0.97 * w, axis="y", edge=0.04 * r), STEEL)
    low, high = sorted((outside * 0.9 * w, outside * 1.12 * w))
    build.add(drum(0.24 * r, low, high, axis="y", edge=0.03 * r), DARK)
    for k in range(5):
        angle = k * math.tau / 5
        at = (0.48 * r * math.cos(angle), 0.0, 0.48 * r * math.sin(angle))
        build.add(
            lathe([(0.10 * r, min(0.0, outside * w)), (0.10 * r, max(0.0, outside * w))], at=at, axis="y"), DARK
        )
    return build.shape()


def caster(name: str, body: Chassis) -> LinkShape:
    """Build a caster: a swivelling fork with its wheel, or a ball in a cup."""
    r, trail = body.caster_radius, body.caster_trail
    build = Builder(name, STEEL)
    if trail == 0.0:
        import trimesh

        ball = trimesh.creation.icosphere(subdivisions=2, radius=r)
        ball.apply_translation((0.0, 0.0, r + body.caster_lift))
        build.add(ball)
        build.add(lathe([(1.15 * r, 0.8 * r), (1.3 * r, 2.4 * r)]), DARK)
        return build.shape()
    build.add(drum(r, -0.30 * r, 0.30 * r, at=(-trail, 0, r), axis="y", edge=0.08 * r), RUBBER)
    build.add(drum(0.55 * r, -0.34 * r, 0.34 * r, at=(-trail, 0, r), axis="y", edge=0.04 * r), STEEL)
    for side in (-1, 1):
        y0, y1 = sorted((side * 0.36 * r, side * 0.50 * r))
        corners = [
            (-trail - 0.3 * r, 0.85 * r),
            (-trail + 0.3 * r, 0.75 * r),
            (-0.5 * r, 2.2 * r),
            (0.5 * r, 2.2 * r),
        ]
        build.add(hull([(x, y, z) for x, z in corners for y in (y0, y1)]))
    build.add(drum(0.62 * r, 2.1 * r, 2.5 * r, edge=0.05 * r))
    return build.shape()


def on_wheels(body: LinkShape, chassis: Chassis) -> tuple[LinkShape, ...]:
    """Set a body on its wheels: body, right wheel, left wheel, two casters, in the order and frames of `links`."""
    return (
        body,
        wheel("right wheel", chassis, -1),
        wheel("left wheel", chassis, 1),
        *(caster(f"caster {k + 1}", chassis) for k in range(len(chassis.casters))),
    )


def links(chassis: Chassis, posture: ArrayLike) -> Array:
    """Return the poses of a robot's shapes in the world: body, right and left wheel, casters, limbs at angle 0.

    Args:
        chassis: Of the robot.
        posture: x, y [m], θ [rad], (3,).

    Returns:
        (m, 4, 4).

    Raises:
        InvalidValueError: If the posture isn't finite or of the wrong shape.
    """
    side = 0.5 * chassis.wheel_base
    offsets = [(0.0, 0.0, 0.0), (0.0, -side, chassis.wheel_radius), (0.0, side, chassis.wheel_radius)]
    offsets += [(x, y, 0.0) for x, y in chassis.casters] + [limb.joint for limb in chassis.limbs]
    X_RS = np.tile(np.eye(4), (len(offsets), 1, 1))
    X_RS[:, :3, 3] = offsets
    return frozen_array(upright(*as_posture("posture", posture)) @ X_RS)


def room_shapes(room: Room) -> tuple[LinkShape, ...]:
    """Build a room's floor and then its blocks and columns, in the world frame and the room's order.

    Those that come and go are there too; `Block.stands` tells when.
    """
    build = Builder("floor", GROUND)
    build.add(box((-0.1, -0.1, -0.02), (room.length + 0.1, room.width + 0.1, 0.0)))
    return (build.shape(), *(_thing(thing) for thing in room.things))


def _thing(thing: Block | Column) -> LinkShape:
    wall = is_wall(thing)
    build = Builder(thing.name, (WALL if wall else WOOD) if thing.known else NEW)
    if isinstance(thing, Column):
        edge = min(0.01, thing.radius / 4, thing.height / 4)
        build.add(drum(thing.radius, 0.0, thing.height, at=(thing.x, thing.y, 0), edge=edge))
        return build.shape()
    a, b = thing.length / 2, thing.width / 2
    if wall:
        body = box((-a, -b, 0.0), (a, b, thing.height))
    else:
        edge = min(0.01, a / 4, b / 4, thing.height / 4)
        body = rounded((-a, a, -b, b), 0.0, thing.height, 2 * edge, edge)
    body.apply_transform(upright(thing.x, thing.y, thing.angle))
    build.add(body)
    return build.shape()


def door_shape(door: Door) -> LinkShape:
    """Build a door's leaf with a handle, in a frame on the floor under its middle, its first end at −x."""
    a, b = door.length / 2, door.thickness / 2
    build = Builder(door.name, LEAF)
    build.add(box((-a, -b, 0.0), (a, b, door.height)))
    reach, at = min(0.06, a / 4), a - min(0.08, a / 4)
    for side in (-1, 1):
        y0, y1 = sorted((side * b, side * (b + reach)))
        z = min(1.0, 0.8 * door.height)
        build.add(box((at - 0.015, y0, z), (at + 0.015, y1, z + 0.03)), STEEL)
    return build.shape()


def person_shape(person: Person) -> LinkShape:
    """Build somebody, in a frame on the floor under them that doesn't turn."""
    import trimesh

    h, r = person.height, person.radius
    build = Builder(person.name, CLOTH)
    build.add(
        lathe([(0.55 * r, 0.0), (0.60 * r, 0.45 * h), (r, 0.62 * h), (0.95 * r, 0.78 * h), (0.35 * r, 0.84 * h)])
    )
    head = trimesh.creation.icosphere(subdivisions=3, radius=0.075 * h)
    head.apply_translation((0.0, 0.0, 0.925 * h))
    build.add(head, SKIN)
    return build.shape()
