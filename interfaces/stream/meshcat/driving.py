"""Two mobile robots in a room: as their scene once, then what changes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from interfaces.stream.meshcat.committed import Committed
from interfaces.stream.meshcat.meshes import Bodies, bodies, shaded
from interfaces.stream.meshcat.scene import COLOURS, PATH_PERIOD, ROOT, TwinScene, set_transform
from robots.robot import Display, Robot
from vrs.checks import finite_array, number_in
from vrs.mobile import Grid
from vrs.model import Array

if TYPE_CHECKING:
    from robots.bullet.rooms import Room

WALL: Final = 0.25
"""Walls are drawn up to here [m]: one looks over them."""
LEAF: Final = 0.6
"""And doors up to here [m]: one sees that they're none."""
LOOKED_FROM: Final = {"elevation": 0.9, "azimuth": -0.47 * math.pi, "away": 0.85}
"""Where the camera stands at first: angles [rad] above the floor and about z; how far away."""
PIECE: Final = 64
"""Points of a piece of the path that was driven: what is driven later leaves it as it is."""
ROUND: Final = 1.5
"""How far the floor goes on around a start where nothing else says what is to be seen [m]."""
LEARNED: Final = 0xE0A030
"""Colour of cells that the virtual environment has."""
FLOOR: Final = 0xE6E4DF
"""Colour of a room's floor."""
DRIVEN: Final = {"virtual": (0.10, 0x2F7DE1), "real": (0.26, 0x6E675C)}
"""Width of a path that was driven, as a share of the robot, and its colour: where both lie, both are seen."""
SCREEN_LIFT: Final = 0.011
"""How far a message shines before the middle of the robot's display [m]: just before its glass."""
_CELL = 4.0
"""Side of the grid that the page draws [m]."""
_HEIGHTS: Final = {"learned": 0.004, "real": 0.008, "virtual": 0.012, "committed": 0.03}
"""Above the floor [m], so that none hides in another."""


class _OnFloor:
    """Kinematics of a point a little above the floor."""

    def forward(self, q: ArrayLike) -> Array:
        """Poses (k, 4, 4) of postures (k, 3); only places are set."""
        postures = np.atleast_2d(np.asarray(q, dtype=np.float64))
        X = np.tile(np.eye(4), (len(postures), 1, 1))
        X[:, :2, 3] = postures[:, :2]
        return X


class MobileScene(TwinScene):
    """Two mobile robots, the paths that they drove, what is committed, and the room with those who walk in it."""

    def __init__(
        self,
        robot: Robot,
        start: ArrayLike,
        *,
        room: Room | None = None,
        grid: Grid | None = None,
        extent: ArrayLike | None = None,
        looks: Bodies | None = None,
    ) -> None:
        """Make the scene, with both robots at the start and only the virtual one shown.

        Args:
            robot: A mobile robot.
            start: Where both begin (x, y, θ) [m, m, rad], (3,).
            room: Where they drive; an endless floor unless given.
            grid: Of the cells of the virtual environment, where there's one.
            extent: Least and largest x and y that are to be seen [m], (2, 2); the room, or some of the floor around
                the start, unless given.
            looks: `bodies` of the robot, which take their time and may be made in a thread.

        Raises:
            InvalidValueError: If something isn't finite or has another shape.
        """
        from interfaces.stream.meshcat import objects

        posture = finite_array("start", start, (3,), "three finite numbers (x, y, θ)")
        length = robot.base.body.length
        tool = np.array([0.0, 0.0, _HEIGHTS["committed"] * min(length / 0.45, 1.0)])
        super().__init__(_OnFloor(), tool, scale=length / 0.2)
        self._objects, self._robot, self._grid = objects, robot, grid
        self._length = length
        self._pieces: dict[tuple[str, int], tuple[int, bytes]] = {}
        self._cells: tuple[tuple[int, int], ...] = ()
        self._room = room
        self._furnish(posture, extent)
        self._put_robots(posture, bodies(robot) if looks is None else looks)
        self._newest.wake()

    def show(
        self,
        *,
        virtual: ArrayLike,
        real: ArrayLike | None = None,
        path: Committed | None = None,
        driven: Mapping[str, Array] | None = None,
        learned: tuple[tuple[int, int], ...] = (),
        t: float = 0.0,
        now: float,
    ) -> None:
        """Show both robots where they are now; to be called at the rate of frames, also while they rest.

        Args:
            virtual: Posture of the virtual robot (x, y, θ) [m, m, rad], (3,).
            real: The real one's; None hides it.
            path: What the real robot is committed to; None for no path.
            driven: Where `virtual` and `real` drove until now [m], (k, 2) each; all of it, so that what was given
                before begins with it or is its beginning. None leaves what is drawn.
            learned: Cells that the virtual environment has.
            t: Time in the room [s]: who walks in it, and what comes and goes.
            now: [s], never less than before; the same origin as ever, it only spaces updates.

        Raises:
            InvalidValueError: If a posture has another shape or isn't finite; nothing changes then.
        """
        number_in("now", now, -1e15, 1e15)
        number_in("t", t, -1e9, 1e9)
        poses = {"virtual": self._robot.placed(virtual)}
        if real is not None:
            poses["real"] = self._robot.placed(real)
        before = self._newest.version
        for twin, links in poses.items():
            self._move(twin, links)
        self._set(f"{ROOT}/real", "visible", real is not None)
        self._live(t)
        if now >= self.path_due:
            self.path_due = now + PATH_PERIOD
            self._draw(path)
            for twin, points in (driven or {}).items():
                self._drive(twin, points)
            self._learn(learned)
        if self._newest.version != before:
            self._newest.wake()

    def say(self, text: str) -> None:
        """Show a message on the real robot's display, if it has one; an empty one clears it."""
        display = self._robot.device(Display)
        if display is None:
            return
        path = f"{ROOT}/real/body/0/screen"
        if text:
            from interfaces.stream.meshcat.objects import text_picture

            X = display.pose()
            X[:3, 3] += SCREEN_LIFT * X[:3, 0]
            self._set_object(path, self._objects.sign(path, text_picture(text), display.size, X))
        self._set(path, "visible", bool(text))
        self._newest.wake()

    def _put_robots(self, posture: Array, looks: Bodies) -> None:
        rest = self._robot.placed(posture)
        for twin in COLOURS:
            for i, mesh in enumerate(looks.meshes):
                path = f"{ROOT}/{twin}/body/{i}"
                body = (self._objects.ghost if twin == "virtual" else self._objects.solid)(path, mesh)
                self._set_object(path, body)
            self._move(twin, rest)
        self._set(f"{ROOT}/real", "visible", False)

    def _furnish(self, posture: Array, extent: ArrayLike | None) -> None:
        """Put up the room, and say what is to be seen of it."""
        room = self._room
        if extent is not None:
            low, high = finite_array("extent", extent, (2, 2), "two points, (2, 2)")
        elif room is None:
            low, high = posture[:2] - ROUND, posture[:2] + ROUND
        else:
            low, high = np.zeros(2), np.array([room.length, room.width])
        self._set(ROOT, "box", [[*low.tolist(), 0.0], [*high.tolist(), 0.8]])
        for name, value in LOOKED_FROM.items():
            self._set(ROOT, name, value)
        self._set("/Axes", "visible", False)
        self._put("/Grid", set_transform("/Grid", _grid_at(low, high)))
        self._set("/Grid", "visible", room is None)
        if room is not None:
            self._build(room)

    def _build(self, room: Room) -> None:
        from robots.ipr.shapes import door_shape, person_shape, room_shapes

        things = tuple(
            replace(thing, height=min(thing.height, WALL)) if thing.name.startswith("wall") else thing
            for thing in room.things
        )
        blocks, columns = things[: len(room.blocks)], things[len(room.blocks) :]
        shapes = room_shapes(replace(room, blocks=blocks, columns=columns))  # type: ignore[arg-type]
        for i, shape in enumerate(shapes):
            path, mesh = f"{ROOT}/room/{i}", shaded(shape)
            lowered = self._objects.solid(path, mesh) if i else self._objects.plain(path, mesh, FLOOR)
            self._set_object(path, lowered)
        for i, door in enumerate(room.doors):
            path = f"{ROOT}/doors/{i}"
            leaf = door_shape(replace(door, height=min(door.height, LEAF)))
            self._set_object(path, self._objects.solid(path, shaded(leaf)))
        for i, person in enumerate(room.people):
            path = f"{ROOT}/people/{i}"
            self._set_object(path, self._objects.solid(path, shaded(person_shape(person))))
        self._live(0.0)

    def _live(self, t: float) -> None:
        """Put those who walk, and doors, where they are at a time [s], and show what stands then."""
        if self._room is None:
            return
        for i, door in enumerate(self._room.doors):
            leaf, path = door.at(t), f"{ROOT}/doors/{i}"
            c, s, X = math.cos(leaf.angle), math.sin(leaf.angle), np.eye(4)
            X[:2, :2], X[:2, 3] = [[c, -s], [s, c]], (leaf.x, leaf.y)
            self._put(path, set_transform(path, X))
        for i, person in enumerate(self._room.people):
            path = f"{ROOT}/people/{i}"
            X = np.eye(4)
            X[:2, 3] = person.at(t)
            self._put(path, set_transform(path, X))
        for i, thing in enumerate(self._room.things, start=1):
            if math.isfinite(thing.start) or math.isfinite(thing.end):
                self._set(f"{ROOT}/room/{i}", "visible", thing.stands(t))

    def _drive(self, twin: str, points: Array) -> None:
        """Draw where a robot drove, in pieces that stay as they are once they're whole."""
        places = np.column_stack([points, np.full(len(points), _HEIGHTS[twin])])
        count = max(math.ceil((len(points) - 1) / PIECE), 0)
        for k in range(count):
            piece = places[k * PIECE : (k + 1) * PIECE + 1]
            state = len(piece), piece[-1].tobytes()
            if self._pieces.get((twin, k)) != state:
                path = f"{ROOT}/driven/{twin}/{k}"
                width, colour = DRIVEN[twin]
                self._set_object(path, self._objects.band(path, piece, width * self._length, colour))
                self._set(path, "visible", True)
                self._pieces[twin, k] = state
        for _, k in [key for key in self._pieces if key[0] == twin and key[1] >= count]:
            self._set(f"{ROOT}/driven/{twin}/{k}", "visible", False)
            del self._pieces[twin, k]

    def _learn(self, cells: tuple[tuple[int, int], ...]) -> None:
        if cells == self._cells or self._grid is None:
            return
        self._cells = cells
        path, grid = f"{ROOT}/learned/cells", self._grid
        self._set(path, "visible", bool(cells))
        if cells:
            middles = np.array(grid.origin) + grid.cell * (np.array(cells) + 0.5)
            places = np.column_stack([middles, np.full(len(cells), _HEIGHTS["learned"])])
            self._set_object(path, self._objects.tiles(path, places, 0.92 * grid.cell, LEARNED))


def _grid_at(low: Array, high: Array) -> Array:
    """Where the page's grid lies, and how large it is, to be under all that is to be seen."""
    scale = max(math.ceil(float((high - low).max()) / _CELL / 5), 1) * 5.0
    X = np.diag([scale, scale, 1.0, 1.0])
    X[:2, 3] = np.round((low + high) / 2)
    X[2, 3] = -0.001
    return X
