"""A room in two dimensions: exact rays, overlaps and distances, without physics."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robots.bullet.rooms import Block, Column, Room
from vrs.model import Array

_TINY = 1e-300


class FloorPlan:
    """What stands in a room at a time, as arrays."""

    def __init__(self, room: Room, height: float = 0.0) -> None:
        """Take a room, and of its things those that are at least so high [m]."""
        self._blocks = [block for block in room.blocks if block.height >= height]
        self._columns = [column for column in room.columns if column.height >= height]
        self._people = [person for person in room.people if person.height >= height]
        self._doors = [door for door in room.doors if door.height >= height]
        things: list[Block | Column] = [*self._blocks, *self._columns]
        self.changes = sorted({t for thing in things for t in (thing.start, thing.end) if math.isfinite(t)})
        """When things come or go [s], ascending."""
        self._valid = (math.inf, -math.inf)
        speeds = [person.speed for person in self._people] + [door.speed for door in self._doors]
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
            c, s = self._cos, self._sin
            ox, oy = px - self._x, py - self._y
            along, across = ox * c + oy * s, oy * c - ox * s
            ux, uy = dx * c + dy * s, dy * c - dx * s
            ux, uy = np.where(ux == 0, _TINY, ux), np.where(uy == 0, _TINY, uy)
            with np.errstate(over="ignore"):
                mx, my = along / ux, across / uy
                hx, hy = self._half_x / np.abs(ux), self._half_y / np.abs(uy)
            enter, leave = np.maximum(-mx - hx, -my - hy), np.minimum(hx - mx, hy - my)
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
            still = [door.still(t) for door in self._doors]
            self._valid = (
                max([change for change in self.changes if change <= t] + [a for a, _ in still], default=-math.inf),
                min([change for change in self.changes if change > t] + [b for _, b in still], default=math.inf),
            )
            blocks = [block for block in self._blocks if block.stands(t)] + [door.at(t) for door in self._doors]
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
