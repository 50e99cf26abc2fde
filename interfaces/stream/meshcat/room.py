"""The room that mobile robots drive in: its floor, what stands and walks there, and what was learned of it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from interfaces.stream.meshcat.meshes import shaded
from interfaces.stream.meshcat.newest import ROOT, Nodes
from vrs.checks import finite_array
from vrs.mobile import Grid
from vrs.model import Array

if TYPE_CHECKING:
    from robots.rooms import Room

WALL: Final = 0.25
"""Walls are drawn up to here [m]: one looks over them."""
LEAF: Final = 0.6
"""And doors up to here [m]: one sees that they're none."""
LOOKED_FROM: Final = {"elevation": 0.9, "azimuth": -0.47 * math.pi, "away": 0.85}
"""Where the camera stands at first: angles [rad] above the floor and about z; how far away."""
ROUND: Final = 1.5
"""How far the floor goes on around a start where nothing else says what is to be seen [m]."""
LEARNED: Final = 0xE0A030
"""Colour of cells that the virtual environment has."""
FLOOR: Final = 0xE6E4DF
"""Colour of a room's floor."""
_CELL = 4.0
"""Side of the grid that the page draws [m]."""
_LIFT = 0.004
"""How far cells lie above the floor [m]."""


class DrawnRoom:
    """A room with those who walk in it, or some of an endless floor."""

    def __init__(
        self,
        nodes: Nodes,
        start: Array,
        room: Room | None = None,
        grid: Grid | None = None,
        extent: ArrayLike | None = None,
    ) -> None:
        """Put up the room, and say what is to be seen of it.

        Args:
            nodes: The scene that it's part of.
            start: Where robots begin (x, y, θ) [m, m, rad], (3,).
            room: Where they drive; an endless floor unless given.
            grid: Of the cells of the virtual environment, where there's one.
            extent: Least and largest x and y that are to be seen [m], (2, 2); the room, or some of the floor around
                the start, unless given.

        Raises:
            InvalidValueError: If the extent isn't finite or has another shape.
        """
        from interfaces.stream.meshcat import objects

        self._nodes, self._objects, self._room, self._grid = nodes, objects, room, grid
        self._cells: tuple[tuple[int, int], ...] = ()
        if extent is not None:
            low, high = finite_array("extent", extent, (2, 2), "two points, (2, 2)")
        elif room is None:
            low, high = start[:2] - ROUND, start[:2] + ROUND
        else:
            low, high = np.zeros(2), np.array([room.length, room.width])
        nodes.put_property(ROOT, "box", [[*low.tolist(), 0.0], [*high.tolist(), 0.8]])
        for name, value in LOOKED_FROM.items():
            nodes.put_property(ROOT, name, value)
        nodes.put_property("/Axes", "visible", False)
        nodes.put_transform("/Grid", grid_at(low, high))
        nodes.put_property("/Grid", "visible", room is None)
        if room is not None:
            self._build(room)

    def _build(self, room: Room) -> None:
        from robots.mobile.shapes import door_shape, person_shape, room_shapes

        things = tuple(
            replace(thing, height=min(thing.height, WALL)) if thing.name.startswith("wall") else thing
            for thing in room.things
        )
        blocks, columns = things[: len(room.blocks)], things[len(room.blocks) :]
        shapes = room_shapes(replace(room, blocks=blocks, columns=columns))  # type: ignore[arg-type]
        for i, shape in enumerate(shapes):
            path, mesh = f"{ROOT}/room/{i}", shaded(shape)
            lowered = self._objects.solid(path, mesh) if i else self._objects.plain(path, mesh, FLOOR)
            self._nodes.put_object(path, lowered)
        for i, door in enumerate(room.doors):
            path = f"{ROOT}/doors/{i}"
            leaf = door_shape(replace(door, height=min(door.height, LEAF)))
            self._nodes.put_object(path, self._objects.solid(path, shaded(leaf)))
        for i, person in enumerate(room.people):
            path = f"{ROOT}/people/{i}"
            self._nodes.put_object(path, self._objects.solid(path, shaded(person_shape(person))))
        self.show(0.0)

    def show(self, t: float) -> None:
        """Put those who walk, and doors, where they are at a time [s], and show what stands then."""
        if self._room is None:
            return
        for i, door in enumerate(self._room.doors):
            leaf, path = door.at(t), f"{ROOT}/doors/{i}"
            c, s, X = math.cos(leaf.angle), math.sin(leaf.angle), np.eye(4)
            X[:2, :2], X[:2, 3] = [[c, -s], [s, c]], (leaf.x, leaf.y)
            self._nodes.put_transform(path, X)
        for i, person in enumerate(self._room.people):
            path = f"{ROOT}/people/{i}"
            X = np.eye(4)
            X[:2, 3] = person.at(t)
            self._nodes.put_transform(path, X)
        for i, thing in enumerate(self._room.things, start=1):
            if math.isfinite(thing.start) or math.isfinite(thing.end):
                self._nodes.put_property(f"{ROOT}/room/{i}", "visible", thing.stands(t))

    def learn(self, cells: tuple[tuple[int, int], ...]) -> None:
        """Show the cells that the virtual environment has."""
        if cells == self._cells or self._grid is None:
            return
        self._cells = cells
        path, grid = f"{ROOT}/learned/cells", self._grid
        self._nodes.put_property(path, "visible", bool(cells))
        if cells:
            middles = np.array(grid.origin) + grid.cell * (np.array(cells) + 0.5)
            places = np.column_stack([middles, np.full(len(cells), _LIFT)])
            self._nodes.put_object(path, self._objects.tiles(path, places, 0.92 * grid.cell, LEARNED))


def grid_at(low: Array, high: Array) -> Array:
    """Where the page's grid lies, and how large it is, to be under all that is to be seen."""
    scale = max(math.ceil(float((high - low).max()) / _CELL / 5), 1) * 5.0
    X = np.diag([scale, scale, 1.0, 1.0])
    X[:2, 3] = np.round((low + high) / 2)
    X[2, 3] = -0.001
    return X
