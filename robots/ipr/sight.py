"""What the camera in the IPR's head sees: the room, what comes and goes in it, people, and the robot's own body."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from robots.bullet.camera import Picture, Studio
from robots.bullet.rooms import EMPTY, Room
from robots.ipr.camera import Lens, Look, lens_pose
from robots.ipr.shapes import GROUND, box, door_shape, headless, person_shape, room_shapes, upright
from robots.solids import Builder, LinkShape
from vrs.model import Array

TILE: Final = 0.5
"""Side of the floor's tiles [m]: a floor of one colour doesn't show that the robot moves."""
_JOINT: Final = 0.93
"""How dark every second tile is."""
_AROUND: Final = 12.0
"""So far the floor of no room is drawn around the robot [m]."""
_CEILING: Final = (0.90, 0.90, 0.88)
_MOST_TILES: Final = 4000


class Sight:
    """Draws a room as the robot's camera sees it; `close` it in the end."""

    def __init__(self, room: Room, lens: Lens | None = None) -> None:
        """Build the room once.

        Args:
            room: Where the robot is.
            lens: Of the camera.
        """
        self.lens = Lens() if lens is None else lens
        self._room, self._studio = room, Studio()
        self._endless = room == EMPTY
        if self._endless:
            self._floor = self._tile((-_AROUND, -_AROUND), (_AROUND, _AROUND), TILE)
        else:
            self._tile((0.0, 0.0), (room.length, room.width), _tile_side(room))
            self._cover()
        add = self._studio.add
        _, *things = room_shapes(room)
        self._things = [(add(shape), thing) for shape, thing in zip(things, room.things, strict=True)]
        self._doors = [(add(door_shape(door)), door) for door in room.doors]
        self._people = [(add(person_shape(person)), person) for person in room.people]
        self._body = add(headless())

    def close(self) -> None:
        """Let the renderer go; a second call does nothing."""
        self._studio.close()

    def draw(self, posture: tuple[float, float, float], look: Look, t: float) -> Picture:
        """Draw what is seen.

        Args:
            posture: Where the robot is, x, y [m], θ [rad].
            look: Where its camera looks.
            t: Time in the room [s]: who walks in it, and what stands.
        """
        X_WR, place = upright(*posture), self._studio.place
        if self._endless:
            # By whole pairs of tiles: the floor seems to lie still.
            x, y = (2 * TILE * round(part / (2 * TILE)) for part in posture[:2])
            place(self._floor, upright(x, y, 0.0))
        for figure, thing in self._things:
            if math.isfinite(thing.start) or math.isfinite(thing.end):
                place(figure, np.eye(4) if thing.stands(t) else None)
        for figure, door in self._doors:
            leaf = door.at(t)
            place(figure, upright(leaf.x, leaf.y, leaf.angle))
        for figure, person in self._people:
            place(figure, upright(*person.at(t), 0.0))
        place(self._body, X_WR)
        lens = self.lens
        return self._studio.draw(
            _lens_in_world(X_WR, look),
            width=lens.width,
            height=lens.height,
            view=lens.view,
            near=lens.near,
            far=lens.far,
        )

    def _tile(self, low: tuple[float, float], high: tuple[float, float], side: float) -> int:
        """Lay a floor of tiles, light and dark in turn."""
        x0, y0 = np.meshgrid(*(np.arange(a, b - 1e-9, side) for a, b in zip(low, high, strict=True)), indexing="ij")
        x1, y1 = np.minimum(x0 + side, high[0]), np.minimum(y0 + side, high[1])
        corners = np.stack([x0, y0, x1, y0, x1, y1, x0, y1], axis=-1).reshape(-1, 2)
        first = 4 * np.arange(len(corners) // 4)[:, None, None]
        faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
        odd = np.add.outer(np.arange(len(x0)), np.arange(x0.shape[1])).ravel() % 2
        shade = np.repeat(np.where(odd, _JOINT, 1.0), 2)[:, None]
        ground = np.array(GROUND)
        vertices = np.column_stack([corners, np.zeros(len(corners))])
        return self._studio.add(LinkShape("floor", vertices, faces, ground, shade * ground))

    def _cover(self) -> None:
        """Put a ceiling on the highest walls, if there are any."""
        walls = [thing.height for thing in self._room.blocks if thing.name.startswith("wall")]
        if not walls or max(walls) < 2.0:
            return
        build = Builder("ceiling", _CEILING)
        z = max(walls)
        build.add(box((-0.1, -0.1, z), (self._room.length + 0.1, self._room.width + 0.1, z + 0.02)))
        self._studio.add(build.shape())


def _tile_side(room: Room) -> float:
    """Side of a room's tiles [m]: larger in a hall, so that there aren't too many."""
    side = TILE
    while room.length * room.width > _MOST_TILES * side * side:
        side *= 2.0
    return side


def _lens_in_world(X_WR: Array, look: Look) -> Array:
    X: Array = X_WR @ lens_pose(look)
    return X
