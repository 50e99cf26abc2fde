"""Rooms and apartments made up from a seed, as floor plans: walls with doors, furniture, people who walk about.

A rectangle is divided by walls into rooms of 2.4 m at least; each dividing wall has a door. Pillars stand in some
corners, furniture along walls and in the middle, never so that a part can't be reached any more. The operator's map
has walls, pillars and some of the furniture; the rest is unknown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np

from robots.mobile.floor_plan import CELL, Ways
from robots.rooms import Room, read_room
from vrs.checks import validated, within
from vrs.errors import InvalidValueError

WALL = 0.1
"""How thick walls are [m]."""
_ROBOT = 0.4
"""Everything has to be reached by somebody of this radius [m]."""
_PERSON = 0.3
_DOOR = (1.0, 1.25)
_SMALLEST = 2.4
_REACHED = 0.97
"""Furniture may cut off the rest of the floor."""
_TRIES = 60


@dataclass(frozen=True, slots=True)
@validated
class ApartmentConfig:
    """What is made."""

    rooms: Annotated[int, within(0, 8)] = 0
    """How many, 1 to 8; 0 draws 1 to 5."""
    people: Annotated[int, within(0, 16)] = 0
    """Who walk about, 0 to 16."""
    furniture: Annotated[float, within(0.0, 3.0)] = 1.0
    """How much of it, in [0, 3]; 1 is some four pieces a room."""
    known: Annotated[float, within(0.0, 1.0)] = 0.4
    """Share of the furniture that the map has, in [0, 1]."""


@dataclass(frozen=True, slots=True)
class _Wall:
    """A dividing wall: across at `at`, from `low` to `high` along the other axis."""

    vertical: bool
    at: float
    low: float
    high: float


Box = tuple[float, float, float, float]
"""x and y of two opposite corners [m]."""


def apartment(seed: int, config: ApartmentConfig | None = None) -> Room:
    """Return a room or an apartment; the same seed gives the same."""
    return read_room(apartment_plan(seed, config), f"apartment {seed}")


def apartment_plan(seed: int, config: ApartmentConfig | None = None) -> str:
    """Return the same as the text of a floor plan."""
    config = ApartmentConfig() if config is None else config
    return _Maker(np.random.default_rng(seed), config, f"Apartment {seed}").text()


class _Maker:
    """Makes one plan."""

    def __init__(self, rng: np.random.Generator, config: ApartmentConfig, name: str) -> None:
        self._rng, self._config = rng, config
        count = config.rooms or int(rng.integers(1, 6))
        side = math.sqrt(count)
        self._length = round(float(rng.uniform(3.2, 4.6)) * side + 0.8, 2)
        self._width = round(float(rng.uniform(2.8, 3.8)) * side + 0.8, 2)
        self._lines = ["room 1", f"name {name}", f"size {self._length} {self._width}"]
        x, y = self._length, self._width
        for ends in ((0, 0, x, 0), (x, 0, x, y), (x, y, 0, y), (0, y, 0, 0)):
            self._wall(*ends)
        self._leaves: list[Box] = [(0.0, 0.0, x, y)]
        self._walls: list[_Wall] = []
        self._doors: list[tuple[float, float]] = []
        self._divide(count)

    def text(self) -> str:
        self._open_doors()
        self._furnish()
        self._populate()
        return "\n".join(self._lines) + "\n"

    def _uniform(self, low: float, high: float) -> float:
        return round(float(self._rng.uniform(low, high)), 2)

    def _wall(self, x0: float, y0: float, x1: float, y1: float) -> None:
        self._lines.append(f"wall {x0:g} {y0:g}  {x1:g} {y1:g}  thickness={WALL}")

    def _divide(self, count: int) -> None:
        for _ in range(4 * count):
            if len(self._leaves) >= count:
                return
            leaf = max(self._leaves, key=lambda b: (b[2] - b[0]) * (b[3] - b[1]))
            x0, y0, x1, y1 = leaf
            vertical = x1 - x0 > y1 - y0
            low, high = (x0, x1) if vertical else (y0, y1)
            if high - low < 2 * _SMALLEST + 0.2:
                return
            at = self._uniform(max(low + _SMALLEST, low + 0.3 * (high - low)), high - _SMALLEST)
            self._leaves.remove(leaf)
            if vertical:
                self._leaves += [(x0, y0, at, y1), (at, y0, x1, y1)]
                self._walls.append(_Wall(True, at, y0, y1))
            else:
                self._leaves += [(x0, y0, x1, at), (x0, at, x1, y1)]
                self._walls.append(_Wall(False, at, x0, x1))

    def _open_doors(self) -> None:
        """Cut a door into each dividing wall where no other wall meets it."""
        for wall in self._walls:
            door = self._uniform(*_DOOR)
            meets = [
                other.at for other in self._walls
                if other.vertical != wall.vertical and wall.at in (other.low, other.high)
                and wall.low < other.at < wall.high
            ]  # fmt: skip
            bounds = [wall.low, *sorted(meets), wall.high]
            free = [(a, b) for a, b in pairwise(bounds) if b - a > door + 0.3]
            low, high = free[int(self._rng.integers(len(free)))]
            at = self._uniform(low + 0.15, high - 0.15 - door)
            for a, b in ((wall.low, at), (at + door, wall.high)):
                if b - a > 0.05:
                    self._wall(*((wall.at, a, wall.at, b) if wall.vertical else (a, wall.at, b, wall.at)))
            middle = at + door / 2
            self._doors.append((wall.at, middle) if wall.vertical else (middle, wall.at))

    def _room(self, *more: str) -> Room:
        return read_room("\n".join([*self._lines, *more]) + "\n", "made")

    def _furnish(self) -> None:
        self._free = Ways(self._room(), _ROBOT)
        taken: list[Box] = []
        for leaf in self._leaves:
            for _ in range(int(self._rng.integers(0, 3))):
                self._try(self._pillar(leaf), taken)
            area = (leaf[2] - leaf[0]) * (leaf[3] - leaf[1])
            for _ in range(round(self._config.furniture * area * float(self._rng.uniform(0.2, 0.4)))):
                self._try(self._piece(leaf), taken)

    def _pillar(self, leaf: Box) -> tuple[str, Box]:
        """A pillar in a corner or at a wall, on the map."""
        a, b = self._uniform(0.2, 0.6), self._uniform(0.2, 0.5)
        box = self._at_wall(leaf, a, b, 0.0)
        return self._boxed(box, "height=2.4"), box

    def _piece(self, leaf: Box) -> tuple[str, Box]:
        known = "" if self._rng.random() < self._config.known else " unknown"
        kind = self._rng.random()
        height = f"height={self._uniform(0.4, 2.0)}"
        if kind < 0.6:
            box = self._at_wall(leaf, self._uniform(0.5, 2.0), self._uniform(0.3, 0.9), self._uniform(0.0, 0.06))
            return self._boxed(box, height + known), box
        x, y = self._uniform(leaf[0] + 0.8, leaf[2] - 0.8), self._uniform(leaf[1] + 0.8, leaf[3] - 0.8)
        if kind < 0.8:
            r = self._uniform(0.12, 0.3)
            return f"column {x:g} {y:g} {r:g} {height}{known}", (x - r, y - r, x + r, y + r)
        a, b = self._uniform(0.5, 1.4), self._uniform(0.4, 0.9)
        r = math.hypot(a, b) / 2
        turned = f"angle_deg={self._uniform(0, 180)} {height}{known}"
        return self._boxed((x - a / 2, y - b / 2, x + a / 2, y + b / 2), turned), (x - r, y - r, x + r, y + r)

    def _at_wall(self, leaf: Box, length: float, depth: float, gap: float) -> Box:
        """A rectangle along one of the four walls of a room."""
        x0, y0, x1, y1 = leaf[0] + WALL / 2, leaf[1] + WALL / 2, leaf[2] - WALL / 2, leaf[3] - WALL / 2
        side = int(self._rng.integers(4))
        if side % 2 == 0:
            length = min(length, x1 - x0)
            a = self._uniform(x0, max(x0, x1 - length))
            b = y0 + gap if side == 0 else y1 - gap - depth
            return a, b, a + length, b + depth
        length = min(length, y1 - y0)
        b = self._uniform(y0, max(y0, y1 - length))
        a = x0 + gap if side == 3 else x1 - gap - depth
        return a, b, a + depth, b + length

    @staticmethod
    def _boxed(box: Box, rest: str) -> str:
        x0, y0, x1, y1 = box
        return f"box {(x0 + x1) / 2:.4f} {(y0 + y1) / 2:.4f}  {x1 - x0:.4f} {y1 - y0:.4f} {rest}"

    def _try(self, made: tuple[str, Box], taken: list[Box]) -> None:
        """Put something there, unless it's in the way."""
        line, (x0, y0, x1, y1) = made
        if any(x0 < b[2] and b[0] < x1 and y0 < b[3] and b[1] < y1 for b in taken):
            return
        if any(x0 - 0.8 < x < x1 + 0.8 and y0 - 0.8 < y < y1 + 0.8 for x, y in self._doors):
            return
        try:
            after = Ways(self._room(line), _ROBOT)
        except InvalidValueError:
            return
        # What the thing itself and its surroundings take is gone; what else is lost was cut off.
        gone = (x1 - x0 + 2 * _ROBOT + 0.2) * (y1 - y0 + 2 * _ROBOT + 0.2) / CELL**2
        if int(after.free.sum()) < _REACHED * (int(self._free.free.sum()) - gone):
            return
        if not all(self._reaches(after, leaf) for leaf in self._leaves):
            return
        self._free = after
        taken.append((x0, y0, x1, y1))
        self._lines.append(line)

    @staticmethod
    def _reaches(ways: Ways, leaf: Box) -> bool:
        """Whether somebody can stand somewhere in a room."""
        i0, j0, i1, j1 = (int(edge / CELL) for edge in leaf)
        return int(ways.free[i0:i1, j0:j1].sum()) > 100

    def _populate(self) -> None:
        rng, places = self._rng, self._free.places
        clear = self._free.clearance[self._free.free]
        roomy = places[clear >= min(0.55, float(np.quantile(clear, 0.6)))]
        x, y = roomy[int(rng.integers(len(roomy)))].tolist()
        self._lines.insert(3, f"start {x:.3f} {y:.3f} {rng.uniform(-180, 180):.1f}")
        if not self._config.people:
            return
        ways = Ways(self._room(), _PERSON)
        for _ in range(self._config.people):
            self._lines.append(self._person(ways, (x, y)))

    def _person(self, ways: Ways, start: tuple[float, float]) -> str:
        """Somebody who goes from place to place and back to the first, and begins again."""
        rng, places = self._rng, ways.places
        far = places[np.hypot(*(places - start).T) > min(1.5, 0.3 * math.hypot(self._length, self._width))]
        goals = [far[int(rng.integers(len(far)))], *(places[int(k)] for k in rng.integers(len(places), size=6))]
        t, points = 0.0, [(0.0, *goals[0].tolist())]
        for a, b in zip(goals, [*goals[1:], goals[0]], strict=True):
            speed = float(rng.uniform(0.3, 0.9))
            route = ways.route((float(a[0]), float(a[1])), (float(b[0]), float(b[1])))
            for place in [*route[8::8].tolist(), b.tolist()]:
                way = math.dist(points[-1][1:], place)
                if way < 0.02:
                    continue
                t += way / speed
                points.append((t, *place))
            t += float(rng.uniform(0.5, 4.0))
            points.append((t, *points[-1][1:]))
        points.append((t + 0.1, *points[0][1:]))
        told = " ".join(f"{t:.2f},{x:.3f},{y:.3f}" for t, x, y in points)
        return f"person {self._uniform(0.15, 0.25)} repeat {told}"
