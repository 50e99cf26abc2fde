"""Where robots are sent, from a seed, and the shortest way there, which is the yardstick of their routes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

import numpy as np

from interfaces.lab.goals.trial import TripSetting, seen_all
from robots.mobile.apartments import ApartmentConfig, apartment
from robots.mobile.floor_plan import FloorPlan
from robots.mobile.navigation import route_map
from robots.mobile.robot import place
from robots.onboard.journey import Goal
from robots.onboard.routes import Route, RouteMap
from robots.robot import USUAL_BASE, load
from robots.rooms import Room
from vrs.errors import InvalidValueError
from vrs.model import Array

FURNITURE, ROUND, LATE, SHUT, PEOPLE, PHYSICS = "furniture", "round", "late", "shut", "people", "physics"
TITLES: Final = {
    FURNITURE: "apartments with unknown furniture",
    ROUND: "a home: a closed door on the way, another way round",
    LATE: "a home: a closed door on the only way, opened later",
    SHUT: "a home: the only door stays closed",
    PEOPLE: "apartments with people who stop for nobody",
    PHYSICS: "apartments and the home in PyBullet",
}
"""Groups of goals."""
_SHORTEST = 1.0
"""Trips are at least so long [m]."""
_ALONE = 1.5
"""Nobody is nearer at the start [m]."""
_TRIES = 6000
_APARTMENTS = 20
_DOORWAY = 0.4
"""A way that comes so near to the middle of a door leads through it [m]."""

Rng = np.random.Generator
Point = tuple[float, float]


def setting(group: str, seed: int, number: int) -> TripSetting:
    """The number-th trip of a group."""
    return _MAKERS[group](seed, number)


def _furniture(seed: int, number: int) -> TripSetting:
    return _in_an_apartment(seed, number, 1)


def _people(seed: int, number: int) -> TripSetting:
    return _in_an_apartment(seed, number, 2, people=1 + number % 2)


def _physics(seed: int, number: int) -> TripSetting:
    made = _round(seed, number) if number % 3 == 2 else _furniture(seed, number)
    return replace(made, body=load(USUAL_BASE).usual_body)


def _in_an_apartment(seed: int, number: int, group: int, people: int = 0) -> TripSetting:
    """A trip in the first apartment that has room for one."""
    rng = _rng(seed, number, group)
    for k in range(_APARTMENTS):
        made = int(np.random.SeedSequence([seed, number, 5, *([k] if k else [])]).generate_state(1)[0])
        room = apartment(made, ApartmentConfig(rooms=1 + number % 5, people=people))
        with suppress(InvalidValueError):
            return _drawn(room, rng, (seed, group, number))
    raise InvalidValueError("apartments", f"{_APARTMENTS} of them", "one with room for a trip")


def _round(seed: int, number: int) -> TripSetting:
    """One of three doors on a round is closed for good, and it's on the way that the map has."""
    rng = _rng(seed, number, 3)
    home = _home()
    loop = [k for k, door in enumerate(home.doors) if door.shares[0] == 1.0]
    closed = loop[int(rng.integers(len(loop)))]
    room = _with_doors(home, {k: ((0.0, 0.0 if k == closed else 1.0),) for k in loop})
    door = room.doors[closed].at(0.0)
    return _drawn(room, rng, (seed, 3, number), through=(door.x, door.y))


def _late(seed: int, number: int) -> TripSetting:
    """The bedroom's door opens after a while."""
    rng = _rng(seed, number, 4)
    home = _home()
    opens = float(rng.uniform(8.0, 25.0))
    only = _only(home)
    room = _with_doors(home, {only: ((0.0, 0.0), (opens, 0.0), (opens + 2.0, 1.0))})
    after = _with_doors(home, {only: ((0.0, 1.0),)})
    return _drawn(room, rng, (seed, 4, number), through=_doorway(home, only), truth=after)


def _shut(seed: int, number: int) -> TripSetting:
    """The bedroom's door stays closed."""
    rng = _rng(seed, number, 6)
    home = _home()
    only = _only(home)
    room, opened = (_with_doors(home, {only: ((0.0, share),)}) for share in (0.0, 1.0))
    return _drawn(room, rng, (seed, 6, number), through=_doorway(home, only), truth=opened)


_MAKERS: Final[dict[str, Callable[[int, int], TripSetting]]] = {
    FURNITURE: _furniture,
    ROUND: _round,
    LATE: _late,
    SHUT: _shut,
    PEOPLE: _people,
    PHYSICS: _physics,
}


def _rng(seed: int, number: int, group: int) -> Rng:
    return np.random.default_rng([seed, number, group])


def _home() -> Room:
    """The home with nobody in it, its inner doors open or closed for good."""
    home = replace(place("home"), people=())
    return _with_doors(home, {k: ((0.0, door.shares[0]),) for k, door in enumerate(home.doors)})


def _only(home: Room) -> int:
    """The door that is the only way into a room: the last of those that are closed at first."""
    return max(k for k, door in enumerate(home.doors) if door.shares[0] == 0.0)


def _doorway(home: Room, number: int) -> Point:
    door = replace(home.doors[number], times=(0.0,), shares=(0.0,)).at(0.0)
    return door.x, door.y


def _with_doors(room: Room, timetables: dict[int, tuple[tuple[float, float], ...]]) -> Room:
    """A room some of whose doors have other timetables, of times [s] and shares."""
    doors = list(room.doors)
    for k, table in timetables.items():
        times, shares = zip(*table, strict=True)
        doors[k] = replace(doors[k], times=times, shares=shares, repeat=False)
    return replace(room, doors=tuple(doors))


def _drawn(
    room: Room, rng: Rng, seed: tuple[int, ...], *, through: Point | None = None, truth: Room | None = None
) -> TripSetting:
    """A trip that is possible.

    Args:
        room: Where.
        rng: What starts and goals are drawn from.
        seed: Of the robot.
        through: A doorway that the way that the map has leads through.
        truth: What the trip is possible in; the room as it stands at first, unless given.

    Raises:
        InvalidValueError: If the room has none.
    """
    footprint = load(USUAL_BASE).base.body
    whole = route_map(seen_all(room if truth is None else truth), footprint)
    # Where it begins the robot must have room as things are at first.
    first = route_map(seen_all(room), footprint)
    mapped = route_map(room, footprint)
    for _ in range(_TRIES):
        start, goal = _place(room, rng), _place(room, rng)
        free = first.is_free(start) and whole.is_free(goal) and whole.is_free(start)
        if not free or math.dist(start, goal) < _SHORTEST or not _is_alone(room, start):
            continue
        if not _leads(mapped, start, goal, through) or not isinstance(whole.route(start, goal), Route):
            continue
        headings = rng.uniform(-math.pi, math.pi, 2).tolist()
        return TripSetting(room, (*start, headings[0]), Goal(*goal, headings[1]), seed)
    raise InvalidValueError("room", room.name, "one with room for a trip")


def _place(room: Room, rng: Rng) -> Point:
    return float(rng.uniform(0.0, room.length)), float(rng.uniform(0.0, room.width))


def _is_alone(room: Room, start: Point) -> bool:
    return all(math.dist(who.at(t), start) > _ALONE for who in room.people for t in (0.0, 1.0, 2.0))


def _leads(roads: RouteMap, start: Point, goal: Point, through: Point | None) -> bool:
    """Whether there's a way on the map, and it leads through a doorway if it's to."""
    found = roads.route(start, goal)
    if not isinstance(found, Route):
        return False
    if through is None:
        return True
    places = found.places(0.1)
    return bool(np.hypot(*(places - through).T).min() < _DOORWAY)


CELL = 0.025
"""Side of a cell [m]."""
_NEIGHBOURS = ((1, 0), (0, 1), (1, 1), (1, -1), (1, 2), (2, 1), (1, -2), (2, -1))


class Shortest:
    """Shortest ways in a room as it stands at a time, for a disc."""

    def __init__(self, room: Room, radius: float, t: float = 0.0) -> None:
        """Measure how far everything is from things.

        Args:
            room: Walls, things and doors; people count as well.
            radius: Of the disc [m].
            t: Time [s].
        """
        from scipy.ndimage import distance_transform_edt

        shape = math.ceil(room.length / CELL - 1e-9), math.ceil(room.width / CELL - 1e-9)
        taken = np.pad(FloorPlan(room).grid(CELL, shape, t), 1, constant_values=True)
        # From middle to middle: a thing's edge is half a cell nearer.
        clearance: Array = distance_transform_edt(~taken)[1:-1, 1:-1] * CELL - CELL / 2
        self._free = clearance >= radius
        self._graph = self._edges(_NEIGHBOURS)

    def length(self, begin: tuple[float, float], end: tuple[float, float]) -> float:
        """Of the shortest way from place to place [m]; infinite if there's none."""
        from scipy.sparse.csgraph import dijkstra

        first, last = self._cell(begin), self._cell(end)
        if not (self._free[first] and self._free[last]):
            return math.inf
        m = self._free.shape[1]
        source, target = first[0] * m + first[1], last[0] * m + last[1]
        ways, before = dijkstra(self._graph, directed=False, indices=source, return_predecessors=True)
        if not math.isfinite(ways[target]):
            return math.inf
        cells = [target]
        while cells[-1] != source:
            cells.append(int(before[cells[-1]]))
        places = np.column_stack(np.divmod(cells[::-1], m)).astype(float)
        return min(float(ways[target]), self._cut(places))

    def length_along_axes(self, begin: tuple[float, float], end: tuple[float, float]) -> float:
        """Of the shortest way that goes along x and y alone [m]; infinite if there's none."""
        from scipy.sparse.csgraph import dijkstra

        (i, j), (k, m), n = self._cell(begin), self._cell(end), self._free.shape[1]
        return float(dijkstra(self._edges(_NEIGHBOURS[:2]), directed=False, indices=i * n + j)[k * n + m])

    def _cell(self, place: tuple[float, float]) -> tuple[int, int]:
        i, j = (min(max(int(x / CELL), 0), n - 1) for x, n in zip(place, self._free.shape, strict=True))
        return i, j

    def _edges(self, neighbours: Sequence[tuple[int, int]]) -> Any:
        from scipy.sparse import coo_matrix

        m, n = self._free.shape
        number = np.arange(m * n).reshape(m, n)
        rows, columns, ways = [], [], []
        for di, dj in neighbours:
            a = slice(0, m - di), slice(max(0, -dj), n - max(0, dj))
            b = slice(di, m), slice(max(0, dj), n + min(0, dj))
            both = self._free[a] & self._free[b]
            rows.append(number[a][both])
            columns.append(number[b][both])
            ways.append(np.full(int(both.sum()), CELL * math.hypot(di, dj)))
        pairs = np.concatenate(rows), np.concatenate(columns)
        return coo_matrix((np.concatenate(ways), pairs), shape=(m * n, m * n)).tocsr()

    def _cut(self, places: Array) -> float:
        """Length of a way of cells with its corners cut, each as far on as can be seen [m]."""
        total, k = 0.0, 0
        while k < len(places) - 1:
            low, high = k + 1, len(places) - 1
            while low < high:
                middle = (low + high + 1) // 2
                low, high = (middle, high) if self._sees(places[k], places[middle]) else (low, middle - 1)
            total += CELL * math.dist(places[k], places[low])
            k = low
        return total

    def _sees(self, a: Array, b: Array) -> bool:
        count = max(2, math.ceil(2 * math.dist(a, b)))
        i, j = np.rint(np.linspace(a, b, count)).astype(int).T
        return bool(self._free[i, j].all())
