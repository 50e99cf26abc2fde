"""Rooms: floor plans from small text files, with walls, boxes, columns and people who walk timed paths.

The format is line by line, `docs/ipr.md` has all of it:

    room 1
    name Furnished room
    size 6 4
    start 1 1 90
    wall 0 0  6 0  thickness=0.1 height=2.4
    box 3 2  1.2 0.6  angle_deg=30 height=0.75 unknown from=5 until=60
    column 5 3 0.2
    person 0.25 repeat  0,1,1  4,3,1  8,1,1
    door 2 2  2 3  hinged  0,0  10,0  12,1
    via 2.5 2.5
    place table 3 1.2 90
    sound 5.8 0.4  level=62 pitch=440

Lengths in metres, times in seconds, angles in degrees; `#` begins a comment. A thing is unknown if the operator's
map doesn't have it; people and doors always are.

Things are boxes, columns, people and doors, with their timetables.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, TypeAlias

from msgspec import Meta

from vrs.checks import bounded_text, one_of
from vrs.errors import FormatError
from vrs.record import Record, Time

MOST_THINGS = 1000
MOST_POINTS = 1000

Posture: TypeAlias = tuple[float, float, float]
"""x, y [m], θ [rad]."""
Name = Annotated[str, Meta(max_length=200)]
Length = Annotated[float, Meta(ge=-1e6, le=1e6)]
"""[m]."""
Size = Annotated[float, Meta(gt=0, le=1e6)]
"""[m]."""
Timetable = Annotated[tuple[Time, ...], Meta(min_length=1, max_length=MOST_POINTS)]
Way = Annotated[tuple[Length, ...], Meta(min_length=1, max_length=MOST_POINTS)]
Shares = Annotated[tuple[Annotated[float, Meta(ge=0, le=1)], ...], Meta(min_length=1, max_length=MOST_POINTS)]


def between(times: tuple[float, ...], t: float, *, repeat: bool) -> tuple[int, int, float]:
    """Return the entries of a timetable before and after a time, and how far it is from the one to the other.

    Args:
        times: Ascending [s], one at least.
        t: [s].
        repeat: Whether the timetable begins again when it ended.

    Returns:
        Two numbers of entries, the same before the first and after the last; the share, in [0, 1].
    """
    if repeat and t > times[-1] and len(times) > 1:
        t = times[0] + math.fmod(t - times[0], times[-1] - times[0])
    k = bisect_right(times, t)
    if k in (0, len(times)):
        end = min(k, len(times) - 1)
        return end, end, 0.0
    return k - 1, k, (t - times[k - 1]) / (times[k] - times[k - 1])


@dataclass(frozen=True, slots=True)
class Block:
    """A box that stands on the floor, a wall among others."""

    name: str
    x: float
    """Of its middle [m]."""
    y: float
    length: float
    """Along its own first axis [m]."""
    width: float
    angle: float
    """Of its first axis [rad]."""
    height: float
    known: bool = True
    """Whether the operator's map has it."""
    start: float = -math.inf
    """It stands there in [start, end) [s]."""
    end: float = math.inf

    def stands(self, t: float) -> bool:
        """Whether it's there at t [s]."""
        return self.start <= t < self.end


@dataclass(frozen=True, slots=True)
class Column:
    """An upright cylinder."""

    name: str
    x: float
    y: float
    radius: float
    height: float
    known: bool = True
    start: float = -math.inf
    """It stands there in [start, end) [s]."""
    end: float = math.inf

    def stands(self, t: float) -> bool:
        """Whether it's there at t [s]."""
        return self.start <= t < self.end


def is_wall(thing: Block | Column) -> bool:
    """Whether a thing is a wall: its name begins so."""
    return thing.name.startswith("wall")


class Person(Record, frozen=True, omit_defaults=True, gc=False):
    """A cylinder that walks along straight lines between places, at the times that belong to them."""

    name: Name
    radius: Size
    """[m]."""
    height: Size
    """[m]."""
    times: Timetable
    """Ascending [s]."""
    x: Way
    """Where at each time [m]."""
    y: Way
    """[m]."""
    repeat: bool = False
    """Whether the path begins again when it ended; it then ends where it began."""

    def at(self, t: float) -> tuple[float, float]:
        """Where the person is at t [s]; before the first time at the first place, after the last at the last."""
        before, after, share = between(self.times, t, repeat=self.repeat)
        (x0, x1), (y0, y1) = (self.x[before], self.x[after]), (self.y[before], self.y[after])
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0)

    @property
    def speed(self) -> float:
        """Fastest that the person walks [m/s]."""
        places = tuple(zip(self.x, self.y, strict=True))
        steps = zip(self.times, places, self.times[1:], places[1:], strict=False)
        return max((math.dist(p, q) / (b - a) for a, p, b, q in steps), default=0.0)


class Door(Record, frozen=True, omit_defaults=True, gc=False):
    """A leaf in a doorway that opens and closes by a timetable, at even speed in between, and stops for nobody."""

    name: Name
    sliding: bool
    """Whether it slides past its first end; a hinged door swings about it."""
    x: Length
    """Of its first end, where the hinge is [m]."""
    y: Length
    """[m]."""
    length: Size
    """Of the leaf, as wide as the doorway [m]."""
    angle: Length
    """From the first end to the other when it's closed [rad]."""
    thickness: Size
    """[m]."""
    height: Size
    """[m]."""
    swing: Length
    """Turn when it's quite open, to the left positive [rad]; of a hinged door."""
    times: Timetable
    """Ascending [s]."""
    shares: Shares
    """How far it's open at each time, 0 closed, 1 open."""
    repeat: bool = False
    """Whether the timetable begins again when it ended; it then ends as it began."""

    def share(self, t: float) -> float:
        """How far it's open at t [s], in [0, 1]."""
        before, after, share = between(self.times, t, repeat=self.repeat)
        return self.shares[before] + share * (self.shares[after] - self.shares[before])

    def at(self, t: float) -> Block:
        """The leaf as it stands at t [s]."""
        share, half = self.share(t), self.length / 2
        if self.sliding:
            angle, ahead = self.angle, half - share * self.length
        else:
            angle, ahead = self.angle + share * self.swing, half
        x, y = self.x + ahead * math.cos(angle), self.y + ahead * math.sin(angle)
        return Block(self.name, x, y, self.length, self.thickness, angle, self.height, known=False)

    def still(self, t: float) -> tuple[float, float]:
        """From when to when it stands as it does at t [s]; t and t where it moves."""
        before, after, _ = between(self.times, t, repeat=self.repeat)
        if self.shares[before] != self.shares[after]:
            return t, t
        if len(self.times) == 1 or (not self.repeat and t >= self.times[-1]):
            return t, math.inf
        first, last = self.times[0], self.times[-1]
        if t < first:
            return -math.inf, first
        begun = t - first if not self.repeat else math.fmod(t - first, last - first)
        return t, t + (self.times[after] - first - begun) if after != before else t

    @property
    def speed(self) -> float:
        """Fastest that anything of it moves [m/s]."""
        steps = zip(self.times, self.shares, self.times[1:], self.shares[1:], strict=False)
        fastest = max((abs(q - p) / (b - a) for a, p, b, q in steps), default=0.0)
        return fastest * self.length * (1.0 if self.sliding else abs(self.swing))


@dataclass(frozen=True, slots=True, eq=False)
class Neighbour:
    """Another robot in the same room, as its box: it's wherever it's driven."""

    name: str
    length: float
    """Along its heading [m]."""
    width: float
    """[m]."""
    height: float
    """[m]."""
    ahead: float
    """How far its middle is before the point that its posture says [m]."""
    speed: float
    """Fastest that anything of it moves [m/s]."""
    where: Callable[[], Posture]
    """Its true posture now."""

    def at(self, _t: float) -> Block:
        """The box as it stands now, whatever time is asked for: nobody knows where it'll be."""
        x, y, angle = self.where()
        x, y = x + self.ahead * math.cos(angle), y + self.ahead * math.sin(angle)
        return Block(self.name, x, y, self.length, self.width, angle, self.height, known=False)

    def still(self, t: float) -> tuple[float, float]:
        """From when to when it stands as it does at t [s]: it may move at any time."""
        return t, t


Standing = Block | Column | Person | Door | Neighbour
"""What a robot may run into, or what into it."""
_BELOW = -100.0
"""Where things are that aren't there [m]."""


def moves(thing: Standing) -> bool:
    """Whether it ever moves, comes or goes."""
    return isinstance(thing, Person | Door | Neighbour) or thing.start > -math.inf or thing.end < math.inf


def solid(thing: Standing) -> Block | Column:
    """The box or the cylinder that it is, as it stands at time 0."""
    if isinstance(thing, Person):
        x, y = thing.at(0.0)
        return Column(thing.name, x, y, thing.radius, thing.height, known=False)
    return thing.at(0.0) if isinstance(thing, Door | Neighbour) else thing


def pose_at(thing: Standing, t: float) -> tuple[float, float, float, float]:
    """Where the middle of a thing is at a time [s]: x, y, z [m], heading [rad]; far below while it isn't there."""
    if isinstance(thing, Person):
        return *thing.at(t), thing.height / 2, 0.0
    if isinstance(thing, Door | Neighbour):
        thing = thing.at(t)
    angle = thing.angle if isinstance(thing, Block) else 0.0
    return thing.x, thing.y, thing.height / 2 if thing.stands(t) else _BELOW, angle


VERSION = 1
"""Of the format."""
MOST_BYTES = 262_144
_MARGIN = 1.0
_WALL_HEIGHT, _BOX_HEIGHT, _PERSON_HEIGHT, _DOOR_HEIGHT = 2.4, 0.8, 1.7, 2.0


@dataclass(frozen=True, slots=True)
class Place:
    """A point of the map that has a name."""

    name: str
    x: float
    """[m]."""
    y: float
    """[m]."""
    heading: float | None = None
    """[rad]; None for any."""


@dataclass(frozen=True, slots=True)
class Sound:
    """A point from which a tone is heard; what a microphone gets of it is for `robots.mobile.microphone`."""

    name: str
    x: float
    """[m]."""
    y: float
    """[m]."""
    level: float
    """Sound pressure level at 1 m, over whole seconds [dB, re 20 µPa]."""
    pitch: float
    """[Hz]."""
    start: float = -math.inf
    """It sounds in [start, end) [s]."""
    end: float = math.inf


@dataclass(frozen=True, slots=True)
class Room:
    """What stands and walks on a rectangular floor, 0 ≤ x ≤ length, 0 ≤ y ≤ width."""

    name: str
    length: float
    """Along x [m]."""
    width: float
    """Along y [m]."""
    start: Posture = (0.0, 0.0, 0.0)
    """Where a robot begins."""
    blocks: tuple[Block, ...] = ()
    columns: tuple[Column, ...] = ()
    people: tuple[Person, ...] = ()
    doors: tuple[Door, ...] = ()
    via: tuple[tuple[float, float], ...] = ()
    """Via points of the map [m]."""
    places: tuple[Place, ...] = ()
    """Named points of the map."""
    sounds: tuple[Sound, ...] = ()
    """What is heard in it."""
    neighbours: tuple[Neighbour, ...] = ()
    """Other robots in it."""

    @property
    def things(self) -> tuple[Block | Column, ...]:
        """Blocks, then columns."""
        return *self.blocks, *self.columns

    @property
    def standing(self) -> tuple[Standing, ...]:
        """All that stands and moves in it: things, people, doors, other robots."""
        return *self.things, *self.people, *self.doors, *self.neighbours

    def known(self) -> Room:
        """Return what the operator's map has: without unknown things, people, doors and other robots."""
        return replace(
            self,
            blocks=tuple(block for block in self.blocks if block.known),
            columns=tuple(column for column in self.columns if column.known),
            people=(),
            doors=(),
            neighbours=(),
        )

    def place(self, name: str) -> Place:
        """Return the point of that name.

        Raises:
            InvalidValueError: If the map has none.
        """
        by_name = {place.name: place for place in self.places}
        return by_name[one_of("place", name, by_name)]


EMPTY = Room("nothing", 200.0, 200.0)
"""A floor and nothing on it, for a robot anywhere."""


def read_room(text: str, where: str = "room") -> Room:
    """Read a floor plan.

    Args:
        text: The plan.
        where: What it's called in errors.

    Raises:
        FormatError: If it isn't one; the message names the line.
    """
    return _Reader(where).read(text)


def load_room(path: Path | str) -> Room:
    """Read a floor plan from a file; raises as `read_room`, and OSError if there's no such file."""
    path = Path(path)
    return read_room(bounded_text(path, MOST_BYTES), path.name)


_Options = dict[str, tuple[float, float, float]]
"""Low, high and default of each option."""


class _Reader:
    """Reads one plan, line by line."""

    def __init__(self, where: str) -> None:
        self._where, self._line = where, 0
        self._name, self._size, self._start = "", (0.0, 0.0), (0.0, 0.0, 0.0)
        self._blocks: list[Block] = []
        self._columns: list[Column] = []
        self._people: list[Person] = []
        self._doors: list[Door] = []
        self._via: list[tuple[float, float]] = []
        self._places: dict[str, Place] = {}
        self._sounds: list[Sound] = []
        self._seen: set[str] = set()
        self._kinds: dict[str, Callable[[list[str]], None]] = {
            "name": self._read_name,
            "size": self._read_size,
            "start": self._read_start,
            "wall": self._read_wall,
            "box": self._read_box,
            "column": self._read_column,
            "person": self._read_person,
            "door": self._read_door,
            "via": self._read_via,
            "place": self._read_named,
            "sound": self._read_sound,
        }

    def read(self, text: str) -> Room:
        if len(text) > MOST_BYTES:
            raise FormatError(self._where, f"longer than {MOST_BYTES} characters")
        first = True
        for self._line, raw in enumerate(text.splitlines(), 1):
            words = raw.split("#", 1)[0].split()
            if not words:
                continue
            kind, rest = words[0], words[1:]
            if first:
                if kind != "room" or rest != [str(VERSION)]:
                    self._fail(f"a floor plan begins with 'room {VERSION}'")
                first = False
                continue
            if kind not in self._kinds:
                self._fail(f"unknown word {kind!r}; there are {', '.join(self._kinds)}")
            if kind in {"name", "size", "start"}:
                if kind in self._seen:
                    self._fail(f"a second {kind}")
                self._seen.add(kind)
            elif "size" not in self._seen:
                self._fail("the size comes before what stands in the room")
            elif self._count() >= MOST_THINGS:
                self._fail(f"more than {MOST_THINGS} things")
            self._kinds[kind](rest)
        if first:
            self._fail(f"a floor plan begins with 'room {VERSION}'")
        if "size" not in self._seen:
            self._fail("no size")
        return Room(
            self._name or self._where,
            *self._size,
            self._start,
            tuple(self._blocks),
            tuple(self._columns),
            tuple(self._people),
            tuple(self._doors),
            tuple(self._via),
            tuple(self._places.values()),
            tuple(self._sounds),
        )

    def _count(self) -> int:
        things = len(self._blocks) + len(self._columns) + len(self._people) + len(self._doors)
        return things + len(self._via) + len(self._places) + len(self._sounds)

    def _fail(self, problem: str) -> None:
        raise FormatError(f"{self._where}, line {self._line}", problem)

    def _number(self, name: str, word: str, low: float, high: float) -> float:
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            self._fail(f"{name} must be a number in [{low:g}, {high:g}]; given: {word[:40]!r}")
        return value

    def _place(self, words: list[str]) -> tuple[float, float]:
        length, width = self._size
        x = self._number("x", words[0], -_MARGIN, length + _MARGIN)
        return x, self._number("y", words[1], -_MARGIN, width + _MARGIN)

    def _split(
        self, words: list[str], count: int, what: str, options: _Options, flags: set[str]
    ) -> tuple[list[str], dict[str, float], set[str]]:
        """Tell positions from options `name=value` (low, high, default) and flags."""
        positions = [word for word in words if "=" not in word and word not in flags]
        if len(positions) != count:
            self._fail(f"needs {what}; given: {len(positions)} values")
        found = {name: default for name, (_, _, default) in options.items()}
        given: set[str] = set()
        for word in words:
            name, equals, value = word.partition("=")
            if not equals and name not in flags:
                continue
            if name in given:
                self._fail(f"{name} twice")
            given.add(name)
            if equals:
                if name not in options:
                    self._fail(f"unknown {name[:40]!r}; there are {', '.join([*options, *sorted(flags)])}")
                low, high, _ = options[name]
                found[name] = self._number(name, value, low, high)
        return positions, found, given & flags

    def _read_name(self, words: list[str]) -> None:
        self._name = " ".join(words)
        if not 1 <= len(self._name) <= 80:
            self._fail("a name has 1 to 80 characters")

    def _read_size(self, words: list[str]) -> None:
        (length, width), _, _ = self._split(words, 2, "length and width [m]", {}, set())
        self._size = self._number("length", length, 0.1, 200.0), self._number("width", width, 0.1, 200.0)

    def _read_start(self, words: list[str]) -> None:
        if "size" not in self._seen:
            self._fail("the size comes before the start")
        (x, y, angle), _, _ = self._split(words, 3, "x, y [m] and a heading [deg]", {}, set())
        self._start = *self._place([x, y]), math.radians(self._number("heading", angle, -360.0, 360.0))

    def _read_wall(self, words: list[str]) -> None:
        options = {"thickness": (0.01, 1.0, 0.1), "height": (0.01, 5.0, _WALL_HEIGHT), **_TIMES}
        at, option, flags = self._split(words, 4, "x, y of both ends [m]", options, {"unknown"})
        (x0, y0), (x1, y1) = self._place(at[:2]), self._place(at[2:])
        length = math.hypot(x1 - x0, y1 - y0)
        if length < 0.01:
            self._fail("a wall is at least 0.01 m long")
        thick = option["thickness"]
        middle, angle = ((x0 + x1) / 2, (y0 + y1) / 2), math.atan2(y1 - y0, x1 - x0)
        self._add_block("wall", middle, (length + thick, thick), angle, option, flags)

    def _read_box(self, words: list[str]) -> None:
        options = {"angle_deg": (-360.0, 360.0, 0.0), "height": (0.01, 5.0, _BOX_HEIGHT), **_TIMES}
        at, option, flags = self._split(words, 4, "x, y of the middle, length and width [m]", options, {"unknown"})
        sides = self._number("length", at[2], 0.01, 50.0), self._number("width", at[3], 0.01, 50.0)
        self._add_block("box", self._place(at), sides, math.radians(option["angle_deg"]), option, flags)

    def _add_block(
        self,
        kind: str,
        middle: tuple[float, float],
        sides: tuple[float, float],
        angle: float,
        option: dict[str, float],
        flags: set[str],
    ) -> None:
        start, end = self._times(option)
        name, known = f"{kind} in line {self._line}", "unknown" not in flags
        self._blocks.append(Block(name, *middle, *sides, angle, option["height"], known, start, end))

    def _read_column(self, words: list[str]) -> None:
        options = {"height": (0.01, 5.0, _BOX_HEIGHT), **_TIMES}
        at, option, flags = self._split(words, 3, "x, y and a radius [m]", options, {"unknown"})
        x, y = self._place(at)
        radius = self._number("radius", at[2], 0.01, 5.0)
        start, end = self._times(option)
        name = f"column in line {self._line}"
        self._columns.append(Column(name, x, y, radius, option["height"], "unknown" not in flags, start, end))

    def _read_person(self, words: list[str]) -> None:
        points = [word for word in words if "," in word]
        others = [word for word in words if "," not in word]
        options = {"height": (0.5, 2.5, _PERSON_HEIGHT)}
        (radius,), option, flags = self._split(others, 1, "a radius [m], then points t,x,y", options, {"repeat"})
        times: list[float] = []
        places: list[tuple[float, float]] = []
        for t, parts in self._timetable(points, 3, "a person", "t,x,y"):
            place = self._place(parts[1:])
            if times and math.dist(place, places[-1]) > 3.0 * (t - times[-1]):
                self._fail(f"nobody walks faster than 3 m/s; to {','.join(parts)!r} it would be faster")
            times.append(t)
            places.append(place)
        repeat = "repeat" in flags
        if repeat and (len(times) < 2 or places[0] != places[-1]):
            self._fail("a path that repeats ends where it began")
        name, size = f"person in line {self._line}", self._number("radius", radius, 0.05, 1.0)
        x, y = (tuple(way) for way in zip(*places, strict=True))
        self._people.append(Person(name, size, option["height"], tuple(times), x, y, repeat))

    def _read_door(self, words: list[str]) -> None:
        points = [word for word in words if "," in word]
        others = [word for word in words if "," not in word]
        options = {
            "thickness": (0.01, 0.5, 0.04),
            "height": (0.01, 5.0, _DOOR_HEIGHT),
            "open_deg": (-180.0, 180.0, 90.0),
        }
        kinds = {"hinged", "sliding"}
        at, option, flags = self._split(others, 4, "x, y of both ends [m]", options, {"repeat", *kinds})
        if len(flags & kinds) != 1:
            self._fail("a door is either hinged or sliding")
        (x0, y0), (x1, y1) = self._place(at[:2]), self._place(at[2:])
        length = math.hypot(x1 - x0, y1 - y0)
        if not 0.3 <= length <= 5.0:
            self._fail("a door is 0.3 m to 5 m wide")
        timetable = self._timetable(points or ["0,0"], 2, "a door", "t,share")
        shares = [self._number("share", parts[1], 0.0, 1.0) for _, parts in timetable]
        times = [t for t, _ in timetable]
        for k in range(1, len(times)):
            if abs(shares[k] - shares[k - 1]) > 2.0 * (times[k] - times[k - 1]):
                self._fail(f"no door opens or closes within less than 0.5 s; to {points[k]!r} it would")
        repeat = "repeat" in flags
        if repeat and (len(times) < 2 or shares[0] != shares[-1]):
            self._fail("a timetable that repeats ends as it began")
        name, swing = f"door in line {self._line}", math.radians(option["open_deg"])
        self._doors.append(Door(
            name, "sliding" in flags, x0, y0, length, math.atan2(y1 - y0, x1 - x0), option["thickness"],
            option["height"], swing, tuple(times), tuple(shares), repeat,
        ))  # fmt: skip

    def _read_via(self, words: list[str]) -> None:
        self._via.append(self._place(self._split(words, 2, "x, y [m]", {}, set())[0]))

    def _read_named(self, words: list[str]) -> None:
        if len(words) not in (3, 4):
            self._fail("needs a name, x, y [m], and perhaps a heading [deg]")
        name, heading = words[0], None
        if len(name) > 40 or name in self._places:
            self._fail(f"a place has a name of its own, of at most 40 characters; given: {name[:40]!r}")
        if len(words) == 4:
            heading = math.radians(self._number("heading", words[3], -360.0, 360.0))
        self._places[name] = Place(name, *self._place(words[1:3]), heading)

    def _read_sound(self, words: list[str]) -> None:
        options = {"level": (0.0, 130.0, 60.0), "pitch": (50.0, 8000.0, 440.0), **_TIMES}
        at, option, _ = self._split(words, 2, "x, y [m]", options, set())
        start, end = self._times(option)
        name = f"sound in line {self._line}"
        self._sounds.append(Sound(name, *self._place(at), option["level"], option["pitch"], start, end))

    def _timetable(self, points: list[str], count: int, who: str, what: str) -> list[tuple[float, list[str]]]:
        """Times and the words at each, of points such as t,x,y."""
        if not 1 <= len(points) <= MOST_POINTS:
            self._fail(f"{who} has 1 to {MOST_POINTS} points {what}")
        found: list[tuple[float, list[str]]] = []
        for point in points:
            parts = point.split(",")
            if len(parts) != count:
                self._fail(f"a point is {what} without spaces; given: {point[:40]!r}")
            t = self._number("t", parts[0], 0.0, 1e6)
            if found and t <= found[-1][0]:
                self._fail(f"times must ascend; {t:g} comes after {found[-1][0]:g}")
            found.append((t, parts))
        return found

    def _times(self, option: dict[str, float]) -> tuple[float, float]:
        if not option["from"] < option["until"]:
            self._fail("from must be before until")
        return option["from"], option["until"]


_TIMES: _Options = {"from": (0.0, 1e6, -math.inf), "until": (0.0, 1e6, math.inf)}
