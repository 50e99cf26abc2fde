"""Rooms as they stand in a recording, and back."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

from interfaces.recording.driving.messages import DoorEntry, GridFacts, PersonEntry, RoomEntry, ThingEntry
from vrs.errors import FormatError
from vrs.mobile import Grid

if TYPE_CHECKING:
    from robots.bullet.rooms import Block, Column, Door, Room


def room_entry(room: Room) -> RoomEntry:
    """A room for the file."""
    people = tuple(
        PersonEntry(
            one.name,
            one.radius,
            one.height,
            list(one.times),
            [x for x, _ in one.places],
            [y for _, y in one.places],
            one.repeat,
        )
        for one in room.people
    )
    things = tuple(_thing_entry(one) for one in room.things)
    return RoomEntry(room.name, room.length, room.width, things, people, tuple(map(_door_entry, room.doors)))


def _door_entry(door: Door) -> DoorEntry:
    return DoorEntry(
        door.name, door.kind.value == "sliding", door.x, door.y, door.length, door.angle, door.thickness,
        door.height, door.swing, list(door.times), list(door.shares), door.repeat,
    )  # fmt: skip


def _thing_entry(thing: Block | Column) -> ThingEntry:
    start, end = (t if math.isfinite(t) else None for t in (thing.start, thing.end))
    radius, length, width = (getattr(thing, name, None) for name in ("radius", "length", "width"))
    at = thing.name, thing.x, thing.y, thing.height
    return ThingEntry(*at, length, width, getattr(thing, "angle", 0.0), radius, thing.known, start, end)


def room_of(entry: RoomEntry, where: str) -> Room:
    """The room that an entry stands for.

    Raises:
        FormatError: If a thing or somebody in it makes no sense.
    """
    from robots.bullet.rooms import Door, DoorKind, Person, Room

    things = [_thing(one, where) for one in entry.things]
    people = []
    for one in entry.people:
        if not _ascend(one.times) or not len(one.times) == len(one.x) == len(one.y):
            raise FormatError(where, f"{one.name!r} in its room walks no path")
        places = tuple(zip(one.x, one.y, strict=True))
        repeats = one.repeat and len(one.times) > 1
        people.append(Person(one.name, one.radius, one.height, tuple(one.times), places, repeats))
    doors = []
    for leaf in entry.doors:
        if not _ascend(leaf.times) or len(leaf.times) != len(leaf.shares):
            raise FormatError(where, f"{leaf.name!r} in its room has no timetable")
        kind = DoorKind.SLIDING if leaf.sliding else DoorKind.HINGED
        doors.append(Door(
            leaf.name, kind, leaf.x, leaf.y, leaf.length, leaf.angle, leaf.thickness, leaf.height, leaf.swing,
            tuple(leaf.times), tuple(leaf.shares), leaf.repeat and len(leaf.times) > 1,
        ))  # fmt: skip
    blocks = tuple(thing for thing, entry in zip(things, entry.things, strict=True) if entry.radius is None)
    columns = tuple(thing for thing, entry in zip(things, entry.things, strict=True) if entry.radius is not None)
    size = entry.name, entry.length, entry.width
    moving = {"people": tuple(people), "doors": tuple(doors)}
    return Room(*size, blocks=blocks, columns=columns, **moving)  # type: ignore[arg-type]


def _ascend(times: list[float]) -> bool:
    return all(a < b for a, b in pairwise(times))


def _thing(entry: ThingEntry, where: str) -> Block | Column:
    from robots.bullet.rooms import Block, Column

    start = -math.inf if entry.start is None else entry.start
    end = math.inf if entry.end is None else entry.end
    if entry.radius is not None:
        return Column(entry.name, entry.x, entry.y, entry.radius, entry.height, entry.known, start, end)
    if entry.length is None or entry.width is None:
        raise FormatError(where, f"{entry.name!r} in its room has no size")
    sides = entry.length, entry.width, entry.angle
    return Block(entry.name, entry.x, entry.y, *sides, entry.height, entry.known, start, end)


def grid_facts(grid: Grid) -> GridFacts:
    """The cells of a virtual environment for the file."""
    return GridFacts(list(grid.shape), grid.cell, grid.origin.tolist())


def grid_of(facts: GridFacts) -> Grid:
    """The cells that an entry stands for."""
    m, n = facts.shape
    return Grid((m, n), facts.cell, facts.origin)
