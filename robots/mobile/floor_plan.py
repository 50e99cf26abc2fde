"""A room in two dimensions: exact rays, overlaps and distances, without physics.

Its line map has the faces of walls and known things, as far as they can be seen. Its grid says where a robot or a
person can go, and the shortest routes that keep away from things.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robots.onboard.gsp_map import GspMap, Lines
from robots.rooms import Block, Column, Door, Neighbour, Room
from vrs.checks import number_in
from vrs.errors import InvalidValueError
from vrs.model import Array

_TINY = 1e-300


class FloorPlan:
    """What stands in a room at a time, as arrays."""

    def __init__(self, room: Room, height: float = 0.0) -> None:
        """Take a room, and of its things those that are at least so high [m]."""
        self._blocks = [block for block in room.blocks if block.height >= height]
        self._columns = [column for column in room.columns if column.height >= height]
        self._people = [person for person in room.people if person.height >= height]
        movers: tuple[Door | Neighbour, ...] = (*room.doors, *room.neighbours)
        self._movers = [mover for mover in movers if mover.height >= height]
        things: list[Block | Column] = [*self._blocks, *self._columns]
        self.changes = sorted({t for thing in things for t in (thing.start, thing.end) if math.isfinite(t)})
        """When things come or go [s], ascending."""
        self._valid = (math.inf, -math.inf)
        speeds = [person.speed for person in self._people] + [mover.speed for mover in self._movers]
        self.fastest = max(speeds, default=0.0)
        """How fast anything in it moves [m/s]."""

    def cast(self, origins: Array, directions: Array, t: float, reach: float) -> Array:
        """Return how far rays go.

        Args:
            origins: Where they begin [m], (k, 2).
            directions: Unit vectors, (k, 2).
            t: Time [s].
            reach: Longest that counts [m].

        Returns:
            Distances [m], (k,), 0 from inside of something, inf where nothing is within reach.
        """
        self._at(t)
        px, py, dx, dy = origins[:, :1], origins[:, 1:], directions[:, :1], directions[:, 1:]
        nearest = np.full(len(origins), np.inf)
        if self._names:
            enter, leave = self._slabs(origins, directions)
            hits = np.where((enter <= leave) & (leave >= 0), np.maximum(enter, 0.0), np.inf)
            nearest = hits.min(axis=1)
        if len(self._rx):
            ox, oy = px - self._rx, py - self._ry
            b = ox * dx + oy * dy
            over = ox * ox + oy * oy - self._r2
            root = b * b - over
            way = -b - np.sqrt(np.maximum(root, 0.0))
            hits = np.where((root >= 0) & (way >= 0), way, np.inf)
            hits = np.where(over <= 0, 0.0, hits)
            nearest = np.minimum(nearest, hits.min(axis=1))
        return np.where(nearest <= reach, nearest, np.inf)

    def _slabs(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Where rays enter and leave each block [m], (k, blocks); a ray misses those that it leaves before."""
        px, py, dx, dy = origins[:, :1], origins[:, 1:], directions[:, :1], directions[:, 1:]
        c, s = self._cos, self._sin
        ox, oy = px - self._x, py - self._y
        along, across = ox * c + oy * s, oy * c - ox * s
        ux, uy = dx * c + dy * s, dy * c - dx * s
        ux, uy = np.where(ux == 0, _TINY, ux), np.where(uy == 0, _TINY, uy)
        with np.errstate(over="ignore"):
            mx, my = along / ux, across / uy
            hx, hy = self._half_x / np.abs(ux), self._half_y / np.abs(uy)
        return np.maximum(-mx - hx, -my - hy), np.minimum(hx - mx, hy - my)

    def crossed(self, start: tuple[float, float], end: tuple[float, float], t: float) -> Array:
        """Return the thicknesses of the blocks that a line from one point to another passes through.

        Args:
            start: [m].
            end: [m], elsewhere.
            t: Time [s].

        Returns:
            The narrower side of each [m], (m,).
        """
        self._at(t)
        p = np.array([start])
        way = np.array([end]) - p
        length = float(np.hypot(*way[0]))
        enter, leave = self._slabs(p, way / length)
        through = (enter <= leave) & (leave >= 0.0) & (enter <= length)
        return np.asarray(2.0 * np.minimum(self._half_x, self._half_y)[through[0]])

    def clearance(self, x: float, y: float, t: float) -> float:
        """Return the distance from a point to the nearest thing [m], 0 inside of one, inf if nothing is there."""
        self._at(t)
        best = math.inf
        if self._names:
            ox, oy = x - self._x, y - self._y
            along = np.abs(ox * self._cos + oy * self._sin) - self._half_x
            across = np.abs(oy * self._cos - ox * self._sin) - self._half_y
            along, across = np.maximum(along, 0.0), np.maximum(across, 0.0)
            best = math.sqrt(float((along * along + across * across).min()))
        for cx, cy, radius in self._round:
            best = min(best, max(math.hypot(x - cx, y - cy) - radius, 0.0))
        return best

    def touched(self, x: float, y: float, angle: float, half: tuple[float, float], t: float) -> str:
        """Return the name of a thing that a rectangle overlaps, or nothing.

        Args:
            x: Of its middle [m].
            y: Of its middle [m].
            angle: Of its first axis [rad].
            half: Half its sides [m].
            t: Time [s].
        """
        self._at(t)
        a, b = half
        c, s = math.cos(angle), math.sin(angle)
        if self._names:
            ox, oy = self._x - x, self._y - y
            # Axes of both rectangles: apart along any of the four, they don't overlap.
            same, turned = np.abs(c * self._cos + s * self._sin), np.abs(s * self._cos - c * self._sin)
            apart = (
                (np.abs(ox * c + oy * s) > a + self._half_x * same + self._half_y * turned)
                | (np.abs(oy * c - ox * s) > b + self._half_x * turned + self._half_y * same)
                | (np.abs(ox * self._cos + oy * self._sin) > self._half_x + a * same + b * turned)
                | (np.abs(oy * self._cos - ox * self._sin) > self._half_y + a * turned + b * same)
            )
            if not apart.all():
                return self._names[int(np.argmin(apart))]
        for name, (cx, cy, radius) in zip(self._round_names, self._round, strict=True):
            dx, dy = cx - x, cy - y
            beyond_x, beyond_y = abs(dx * c + dy * s) - a, abs(dy * c - dx * s) - b
            if math.hypot(max(beyond_x, 0.0), max(beyond_y, 0.0)) <= radius:
                return name
        return ""

    def grid(self, cell: float, shape: tuple[int, int], t: float) -> NDArray[np.bool_]:
        """Return which square cells things touch at a time.

        Args:
            cell: Side of a cell [m].
            shape: Cells along x and y, (m, n).
            t: Time [s].

        Returns:
            Of that shape; cell (i, j) is [i, i + 1) × [j, j + 1) times the side.
        """
        self._at(t)
        marks = np.zeros(shape, dtype=np.bool_)
        x, y = np.meshgrid(*((np.arange(n) + 0.5) * cell for n in shape), indexing="ij")
        h = cell / 2
        for cx, cy, c, s, a, b in zip(
            self._x, self._y, self._cos, self._sin, self._half_x, self._half_y, strict=True
        ):
            ox, oy, spread = x - cx, y - cy, h * (abs(c) + abs(s))
            marks |= (
                (np.abs(ox) < h + a * abs(c) + b * abs(s))
                & (np.abs(oy) < h + a * abs(s) + b * abs(c))
                & (np.abs(ox * c + oy * s) < a + spread)
                & (np.abs(oy * c - ox * s) < b + spread)
            )
        for cx, cy, radius in self._round:
            along, across = np.maximum(np.abs(x - cx) - h, 0.0), np.maximum(np.abs(y - cy) - h, 0.0)
            marks |= np.hypot(along, across) < radius
        return marks

    def _at(self, t: float) -> None:
        """Bring the arrays to a time."""
        start, end = self._valid
        if not start <= t < end:
            still = [mover.still(t) for mover in self._movers]
            self._valid = (
                max([change for change in self.changes if change <= t] + [a for a, _ in still], default=-math.inf),
                min([change for change in self.changes if change > t] + [b for _, b in still], default=math.inf),
            )
            blocks = [block for block in self._blocks if block.stands(t)] + [mover.at(t) for mover in self._movers]
            self._names = [block.name for block in blocks]
            self._x, self._y, angle, length, width = (
                np.array([[b.x, b.y, b.angle, b.length, b.width] for b in blocks], dtype=np.float64)
                .reshape(-1, 5)
                .T.copy()
            )
            self._cos, self._sin = np.cos(angle), np.sin(angle)
            self._half_x, self._half_y = length / 2, width / 2
            self._standing = [(c.x, c.y, c.radius) for c in self._columns if c.stands(t)]
            names = [c.name for c in self._columns if c.stands(t)]
            self._round_names = names + [person.name for person in self._people]
            self._time = math.nan
        if t != self._time:
            if self._people or math.isnan(self._time):
                walking = [(*person.at(t), person.radius) for person in self._people]
                self._round = self._standing + walking
                self._rx, self._ry, radii = np.array(self._round, dtype=np.float64).reshape(-1, 3).T.copy()
                self._r2 = radii * radii
            self._time = t


_OUTSIDE = 1e-6
"""By how much a face is looked at before it [m]: whether that's inside of another thing."""


def plan_map(
    room: Room, height: float = 0.3, *, doubt: float = 0.0005, turn_doubt: float = 1.5e-4, shortest: float = 0.2
) -> GspMap:
    """Make the map of a floor plan.

    Columns have no straight face, and what comes or goes isn't relied on.

    Args:
        room: What stands there; only what is known counts.
        height: Of the scanner's plane [m]: lower things aren't seen.
        doubt: Standard deviation of a face along its normal [m], in [0, 1]: how well the plan was built.
        turn_doubt: And of its direction [rad], in [0, 1].
        shortest: Shorter faces are left out [m], in [0.01, 10].
    """
    number_in("doubt", doubt, 0.0, 1.0, unit=" m")
    number_in("turn_doubt", turn_doubt, 0.0, 1.0, unit=" rad")
    number_in("shortest", shortest, 0.01, 10.0, unit=" m")
    blocks = [b for b in room.known().blocks if b.height >= height and b.start == -math.inf and b.end == math.inf]
    rows: list[tuple[float, float, float, float]] = []
    for block in blocks:
        for face in _faces(block):
            others = [other for other in blocks if other is not block]
            rows += [row for row in _open(face, others, room) if row[3] >= shortest]
    found = np.array(rows).reshape(-1, 4)
    half = found[:, 3] / 2
    variances = np.tile([doubt**2, turn_doubt**2], (len(found), 1))
    lines = Lines.of(found[:, :3], np.column_stack([-half, half]), variances, np.zeros(len(found)))
    return GspMap.of(room.name, lines)


def _faces(block: Block) -> list[tuple[Array, Array, float]]:
    """The four faces of a block: begin, direction and length, the outside on the left."""
    made = []
    for quarter, (length, width) in enumerate([(block.length, block.width), (block.width, block.length)] * 2):
        # Facing away from the middle, the left of the direction is outside.
        angle = block.angle + quarter * math.pi / 2 + math.pi
        along = np.array([math.cos(angle), math.sin(angle)])
        out = np.array([-along[1], along[0]])
        middle = np.array([block.x, block.y]) + out * width / 2
        made.append((middle - along * length / 2, along, length))
    return made


def _open(
    face: tuple[Array, Array, float], others: list[Block], room: Room
) -> list[tuple[float, float, float, float]]:
    """The parts of a face that aren't covered: centre, direction and length."""
    begin, along, length = face
    out = np.array([-along[1], along[0]])
    before = begin + _OUTSIDE * out
    covered = [span for other in others if (span := _within(before, along, length, other)) is not None]
    covered.append((length, math.inf))
    angle = math.atan2(along[1], along[0])
    parts, at = [], 0.0
    for low, high in sorted(covered):
        if low > at:
            middle = begin + along * (at + low) / 2
            inside = 0 <= middle[0] + 0.01 * out[0] <= room.length and 0 <= middle[1] + 0.01 * out[1] <= room.width
            if inside:
                parts.append((float(middle[0]), float(middle[1]), angle, low - at))
        at = max(at, high)
    return parts


def _within(begin: Array, along: Array, length: float, block: Block) -> tuple[float, float] | None:
    """From where to where a segment is inside a block [m]; None if it isn't."""
    c, s = math.cos(block.angle), math.sin(block.angle)
    dx, dy = begin[0] - block.x, begin[1] - block.y
    low, high = 0.0, length
    for at, way, half in (
        (c * dx + s * dy, c * along[0] + s * along[1], block.length / 2),
        (c * dy - s * dx, c * along[1] - s * along[0], block.width / 2),
    ):
        if abs(way) < 1e-9:
            if abs(at) > half:
                return None
            continue
        ends = sorted(((-half - at) / way, (half - at) / way))
        low, high = max(low, ends[0]), min(high, ends[1])
    return (low, high) if high - low > 1e-9 else None


CELL = 0.05
"""Side of a cell [m]."""
_COMFORT = 0.35
"""So much farther from things than need be, a way costs no more [m]."""


class Ways:
    """The free part of a room, for somebody of a radius; what stands at time 0 counts."""

    def __init__(self, room: Room, radius: float, *, start: tuple[float, float] | None = None) -> None:
        """Work out where there's room enough.

        Args:
            room: Walls and things, known or not; people don't count.
            radius: Of who goes there [m].
            start: Only what can be reached from here [m]; else the largest part that hangs together.

        Raises:
            InvalidValueError: If nothing is free.
        """
        from scipy.ndimage import distance_transform_edt, label

        shape = math.ceil(room.length / CELL - 1e-9), math.ceil(room.width / CELL - 1e-9)
        standing = Room(room.name, room.length, room.width, room.start, room.blocks, room.columns)
        taken = FloorPlan(standing).grid(CELL, shape, 0.0)
        outside = np.pad(taken, 1, constant_values=True)
        self.clearance: Array = distance_transform_edt(~outside)[1:-1, 1:-1] * CELL
        """From each cell to the nearest that's taken [m]."""
        parts, count = label(self.clearance > radius, np.ones((3, 3)))
        if count == 0:
            raise InvalidValueError("room", room.name, f"one with room for {radius:g} m")
        part = int(np.argmax(np.bincount(parts.ravel())[1:])) + 1
        if start is not None and parts[self._cell(start, shape)]:
            part = int(parts[self._cell(start, shape)])
        self.free: NDArray[np.bool_] = parts == part
        """Which cells can be reached."""
        self._radius = radius
        self._graph = self._edges()

    @staticmethod
    def _cell(place: tuple[float, float], shape: tuple[int, int]) -> tuple[int, int]:
        i, j = (min(max(int(x / CELL), 0), n - 1) for x, n in zip(place, shape, strict=True))
        return i, j

    @property
    def places(self) -> Array:
        """Middles of the free cells [m], (k, 2)."""
        return np.asarray((np.argwhere(self.free) + 0.5) * CELL)

    def _edges(self) -> Any:
        """Neighbours with the length of the way, longer near things."""
        from scipy.sparse import coo_matrix

        m, n = self.free.shape
        number = np.arange(m * n).reshape(m, n)
        near = np.clip(self._radius + _COMFORT - self.clearance, 0.0, None) / _COMFORT
        cost = 1.0 + 4.0 * near
        rows, columns, ways = [], [], []
        for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):
            a = slice(0, m - di), slice(max(0, -dj), n - max(0, dj))
            b = slice(di, m), slice(max(0, dj), n + min(0, dj))
            both = self.free[a] & self.free[b]
            rows.append(number[a][both])
            columns.append(number[b][both])
            ways.append(CELL * math.hypot(di, dj) * 0.5 * (cost[a] + cost[b])[both])
        size = m * n
        pairs = np.concatenate(rows), np.concatenate(columns)
        return coo_matrix((np.concatenate(ways), pairs), shape=(size, size)).tocsr()

    def route(self, begin: tuple[float, float], end: tuple[float, float]) -> Array:
        """The way from the free cell nearest to one place to the one nearest to another [m], (k, 2)."""
        from scipy.sparse.csgraph import dijkstra

        first, last = self._nearest(begin), self._nearest(end)
        _, trees = dijkstra(self._graph, directed=False, indices=[last], return_predecessors=True)
        before = trees[0]
        cells = [first]
        while cells[-1] != last:
            cells.append(int(before[cells[-1]]))
        found = np.column_stack(np.unravel_index(cells, self.free.shape))
        return np.asarray((found + 0.5) * CELL)

    def _nearest(self, place: tuple[float, float]) -> int:
        cells = np.argwhere(self.free)
        off = (cells + 0.5) * CELL - place
        i, j = cells[int(np.argmin((off * off).sum(axis=1)))].tolist()
        return int(i * self.free.shape[1] + j)
