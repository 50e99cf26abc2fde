"""Several robots in one room, as a value, from a small TOML file.

    room = "furnished"

    [[robots]]
    robot = "ipr"
    name = "cart"
    count = 20
    body = "bare"

    [[robots]]
    robot = "puma560"
    start = [3.0, 2.0, 90.0]

A robot is what `robots.load` finds, and a room what `--room` takes; of several of a kind the first one stands at
`start`, x and y in metres and its heading in degrees, and each of the next ones `step` further. Those without a
place get the free ones that are nearest to where the room lets a robot begin. `FLEET.toml#cart-3` is one of them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import count
from pathlib import Path
from typing import Annotated, Final

import msgspec
from msgspec import Meta

from robots.base import Footprint
from robots.mobile.floor_plan import FloorPlan
from robots.mobile.robot import find_room
from robots.robot import TIP, Robot, load
from robots.rooms import Block, Neighbour, Posture, Room
from vrs.checks import bounded_text, one_of
from vrs.errors import FormatError
from vrs.record import Record

MOST_ROBOTS: Final = 64
"""Robots of a fleet."""
_MOST_BYTES: Final = 64 * 1024
_APART: Final = 0.3
"""Room that's left between robots that get their places by themselves, and to what stands there [m]."""
_LATTICE: Final = 0.25
"""Distance of the places that they may get [m]."""
_FURTHEST: Final = 60.0
"""No place is further from where the room lets a robot begin [m]."""
_PEDESTAL: Final = 0.05
"""Least half side of what an arm stands on [m]."""

_Length = Annotated[float, Meta(ge=-1000, le=1000)]
_Text = Annotated[str, Meta(min_length=1, max_length=200)]


class _Kind(Record, frozen=True, forbid_unknown_fields=True):
    """Robots of a kind."""

    robot: _Text
    name: Annotated[str, Meta(max_length=40, pattern="^[A-Za-z0-9_.-]*$")] = ""
    """Its own unless given; of several, the beginning of their names."""
    count: Annotated[int, Meta(ge=1, le=MOST_ROBOTS)] = 1
    body: str = ""
    start: tuple[_Length, _Length, Annotated[float, Meta(ge=-360, le=360)]] | None = None
    """x, y [m], heading [deg]."""
    step: tuple[_Length, _Length] = (0.0, 1.0)
    """From one to the next [m]."""


class _File(Record, frozen=True, forbid_unknown_fields=True):
    robots: Annotated[tuple[_Kind, ...], Meta(min_length=1)]
    room: str = "empty"


@dataclass(frozen=True, slots=True, eq=False)
class Member:
    """A robot of a fleet."""

    robot: Robot
    """By the name that it has there, with the body that it has there as its usual one."""
    start: Posture
    """Where it begins; of an arm, where its base is."""

    @property
    def box(self) -> Footprint:
        """What others may run into: the whole of a mobile robot, the base of an arm."""
        if self.robot.is_base:
            return self.robot.base.body
        shapes = self.robot.shapes()
        if not shapes:
            return Footprint(4 * _PEDESTAL, 4 * _PEDESTAL, 4 * _PEDESTAL, 0.0, 0.0)
        low, high = shapes[0].vertices.min(axis=0), shapes[0].vertices.max(axis=0)
        half = [max(float(max(-a, b)), _PEDESTAL) for a, b in zip(low[:2], high[:2], strict=True)]
        return Footprint(2 * half[0], 2 * half[1], float(high[2] - low[2]), 0.0, 0.0)

    def block(self, *, known: bool) -> Block:
        """Its box where it begins."""
        return replace(self.neighbour(lambda: self.start).at(0.0), known=known)

    def neighbour(self, where: Callable[[], Posture]) -> Neighbour:
        """What it is to the others: its box, that moves; an arm's base doesn't."""
        box, fastest = self.box, 0.0
        if self.robot.is_base:
            limits = self.robot.base.limits
            fastest = limits.v_max + limits.w_max * box.radius
        return Neighbour(self.robot.name, box.length, box.width, box.height, -box.axle_offset, fastest, where)


@dataclass(frozen=True, slots=True, eq=False)
class Fleet:
    """Robots in one room."""

    path: Path
    """Its file."""
    room: Room
    members: tuple[Member, ...]

    def place(self, name: str) -> int:
        """Which of its members a name is of, from 0.

        Raises:
            InvalidValueError: If it's of none.
        """
        names = [member.robot.name for member in self.members]
        return names.index(one_of(f"robot of {self.path.name}", name, names))

    def room_of(self, k: int, where: Callable[[int], Posture] | None = None) -> Room:
        """The room as the k-th robot has it: it begins at its place, and arms' bases are in the map.

        Args:
            k: Which.
            where: Says where another mobile robot of the fleet is now, by its number; None where nobody does.
        """
        others = [(j, member) for j, member in enumerate(self.members) if j != k]
        arms = [member.block(known=True) for _, member in others if not member.robot.is_base]
        moving = () if where is None else tuple(
            member.neighbour(partial(where, j)) for j, member in others if member.robot.is_base
        )  # fmt: skip
        room = self.room
        return replace(room, start=self.members[k].start, blocks=(*room.blocks, *arms), neighbours=moving)


def read_fleet(path: Path | str) -> Fleet:
    """Read a fleet.

    Raises:
        FormatError: If it can't be read, or isn't one; the message says what is allowed.
        InvalidValueError: If a robot, a body or the room isn't there, or robots stand in something.
    """
    path = Path(path).expanduser().absolute()
    try:
        return _read(path, path.stat().st_mtime_ns)
    except OSError as error:
        raise FormatError(str(path), error.strerror or str(error)) from None


def member(what: str) -> Robot:
    """The robot of `FLEET.toml#NAME`; errors as of `read_fleet`, or InvalidValueError for a name of none."""
    path, _, name = what.rpartition(TIP)
    fleet = read_fleet(path)
    return fleet.members[fleet.place(name)].robot


@lru_cache(maxsize=4)
def _read(path: Path, _written: int) -> Fleet:
    try:
        file = msgspec.toml.decode(bounded_text(path, _MOST_BYTES), type=_File)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        allowed = "room and [[robots]], each with robot, and name, count, body, start and step where it's said"
        raise FormatError(str(path), f"{error}; a fleet has {allowed}") from None
    room = find_room(file.room, path.parent)
    robots: list[Robot] = []
    starts: list[Posture | None] = []
    for kind in file.robots:
        found = load(_beside(kind.robot, path.parent)).with_body(kind.body)
        called = kind.name or found.name
        for k in range(kind.count):
            name = f"{called}-{k + 1}" if kind.count > 1 else called
            model = replace(found.base, name=name) if found.is_base else found.model
            robots.append(replace(found, name=name, model=model, found_by=f"{path}{TIP}{name}"))
            if kind.start is None:
                starts.append(None)
            else:
                x, y, heading = kind.start
                starts.append((x + k * kind.step[0], y + k * kind.step[1], math.radians(heading)))
    if len(robots) > MOST_ROBOTS:
        raise FormatError(str(path), f"has {len(robots)} robots; at most {MOST_ROBOTS} are a fleet")
    twice = [name for name, n in Counter(robot.name for robot in robots).items() if n > 1]
    if twice:
        raise FormatError(str(path), f"has several robots called {', '.join(twice)}: each has a name of its own")
    return Fleet(path, room, _placed(path, room, robots, starts))


def _beside(what: str, folder: Path) -> str:
    """What a robot is found by: a file's name counts from the fleet's file on."""
    name, hashed, rest = what.partition(TIP)
    return f"{folder / name}{hashed}{rest}" if (folder / name).is_file() else what


def _placed(
    path: Path, room: Room, robots: Sequence[Robot], starts: Sequence[Posture | None]
) -> tuple[Member, ...]:
    """The robots where they're said to begin, the others where there's room.

    Raises:
        FormatError: If one stands in something, or finds no place.
    """
    given = {k: Member(robots[k], start) for k, start in enumerate(starts) if start is not None}
    for k, member in given.items():
        others = tuple(other.block(known=False) for j, other in given.items() if j < k)
        block = member.block(known=False)
        plan = FloorPlan(replace(room, blocks=(*room.blocks, *others)))
        half = block.length / 2, block.width / 2
        if thing := plan.touched(block.x, block.y, block.angle, half, 0.0):
            raise FormatError(str(path), f"{member.robot.name} would stand in {thing}")
    plan, taken = FloorPlan(room), {k: (*member.start[:2], member.box.radius) for k, member in given.items()}
    for k, robot in enumerate(robots):
        if k in given:
            continue
        radius = Member(robot, room.start).box.radius
        spot = next(_free(room, plan, radius, list(taken.values())), None)
        if spot is None:
            raise FormatError(str(path), f"finds no place for {robot.name} in {room.name}: give it a start")
        taken[k] = *spot, radius
        given[k] = Member(robot, (*spot, room.start[2]))
    return tuple(given[k] for k in range(len(robots)))


def _free(
    room: Room, plan: FloorPlan, radius: float, taken: Sequence[tuple[float, float, float]]
) -> Iterator[tuple[float, float]]:
    """Places where a robot of a radius [m] stands free, the nearest to the room's start first."""
    x0, y0, _ = room.start
    for ring in count():
        if ring * _LATTICE > _FURTHEST:
            return
        side = range(-ring, ring + 1)
        around = [(i, j) for i in side for j in side if ring in (abs(i), abs(j))]
        for i, j in sorted(around, key=lambda cell: math.hypot(*cell)):
            x, y = x0 + i * _LATTICE, y0 + j * _LATTICE
            inside = 0.0 <= x <= room.length and 0.0 <= y <= room.width
            if (
                inside
                and all(math.dist((x, y), (a, b)) >= radius + r + _APART for a, b, r in taken)
                and plan.clearance(x, y, 0.0) >= radius + _APART / 2
            ):
                yield x, y
