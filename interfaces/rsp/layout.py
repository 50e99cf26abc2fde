"""The device map and the payloads of a robot: which bit is which element, and how long its payload is.

Bit i of the map is element i of the model, both ways: bit 0 is the highest of the first byte. A payload stands in
the packet only for a bit that is 1, in the order of the bits.

| element        | down                            | up                     |
|----------------|---------------------------------|------------------------|
| effector       | its values, or a fragment       | never                  |
| sensor         | requested: nothing              | its values             |
| monitor        | requested: nothing              | the effector's values  |
| command        | ID, values                      | never                  |
| module         | its members requested: nothing  | never                  |
| event          | requested: nothing              | ID, values             |
| memory command | ID, length, data                | ID, acknowledged       |
| memory event   | ID, acknowledged                | ID, length, data       |

IDs and lengths have 2 bytes. A fragment of a stream is its number (4 bytes), a length (2) and as many bytes of data
as the model says, the rest of them 0.
"""

from __future__ import annotations

import enum
import struct
from collections.abc import Mapping
from functools import lru_cache
from typing import Final

from interfaces.rsp.errors import PacketError
from interfaces.rsp.header import LONGEST, SIZE
from interfaces.rsp.model.elements import (
    Command,
    Effector,
    Element,
    Event,
    MemoryCommand,
    MemoryEvent,
    Module,
    Monitor,
    RobotModel,
    Sensor,
)
from interfaces.rsp.session import OVERHEAD
from vrs.errors import InvalidValueError

ID: Final = struct.Struct("!H")
STORED: Final = struct.Struct("!HH")
"""ID and length of what's stored."""
FRAGMENT: Final = struct.Struct("!IH")
"""Number and length of a fragment."""
_MOST: Final = LONGEST - SIZE - OVERHEAD
"""Longest body that UDP carries, sealed or not [byte]."""
_MOST_PLANNED: Final = 16_384
"""Payloads whose places are kept, of all maps: a stranger's maps mustn't fill the memory."""


class PacketDirection(enum.IntEnum):
    """Which way a packet goes."""

    DOWN = 0
    """To the robot."""
    UP = 1
    """To the local system."""


def _size(element: Element, model: RobotModel, way: PacketDirection) -> int | None:
    """Bytes of an element's payload; −1 where it says so itself, None where the bit can't be 1."""
    down = way is PacketDirection.DOWN
    match element:
        case Effector():
            whole = FRAGMENT.size + element.stream if element.stream else element.format.size
            return whole if down else None
        case Sensor():
            return 0 if down else element.format.size
        case Monitor():
            return 0 if down else model.effector_of(element).format.size
        case Command():
            return ID.size + element.format.size if down else None
        case Module():
            return 0 if down else None
        case Event():
            return 0 if down else ID.size + element.format.size
        case MemoryCommand():
            return -1 if down else ID.size
        case MemoryEvent():
            return ID.size if down else -1


class Layout:
    """Joins payloads to the body of a packet, and splits it again."""

    def __init__(self, model: RobotModel) -> None:
        """Lay out a model."""
        self.model = model
        self.count = len(model.elements)
        self.map_size = -(-self.count // 8)
        """Of the device map [byte]."""
        self._spare = 8 * self.map_size - self.count
        self.sizes = tuple(tuple(_size(element, model, way) for element in model) for way in PacketDirection)
        """By way and element: bytes of the payload, −1 if it says so itself, None if there can be none."""
        self._planned = lru_cache(_MOST_PLANNED // self.count)(self._plan)
        self.longest = tuple(self._longest(way) for way in PacketDirection)
        """Longest body, by way [byte]."""
        self.room = tuple(self._room(way) for way in PacketDirection)
        """For memory items in a packet, by way [byte]: what's left beside all values, but always for one."""

    def _longest(self, way: PacketDirection) -> int:
        total = self.map_size
        for index, size in enumerate(self.sizes[way]):
            total += STORED.size + self.longest_data(index) if size == -1 else size or 0
        return total

    def _room(self, way: PacketDirection) -> int:
        sizes = zip(self.model, self.sizes[way], strict=True)
        values = sum(size or 0 for element, size in sizes if size != -1 and not getattr(element, "stream", 0))
        items = [STORED.size + self.longest_data(k) for k, size in enumerate(self.sizes[way]) if size == -1]
        return max([_MOST - self.map_size - values, *items])

    def left(self, payloads: Mapping[int, bytes]) -> int:
        """What payloads leave of a packet [byte]."""
        return _MOST - self.map_size - sum(map(len, payloads.values()))

    def longest_data(self, index: int) -> int:
        """Most bytes of data of a memory command or a memory event."""
        element = self.model.elements[index]
        assert isinstance(element, MemoryCommand | MemoryEvent)
        return element.size

    def check_data(self, index: int, data: bytes) -> None:
        """Refuse data that a memory command or a memory event can't hold.

        Raises:
            InvalidValueError: If it's too long.
        """
        most = self.longest_data(index)
        if len(data) > most:
            raise InvalidValueError(self.model.elements[index].name, f"{len(data)} bytes", f"{most} bytes at most")

    def join(self, payloads: Mapping[int, bytes]) -> bytes:
        """The body of a packet: the map and the payloads, by element; they're trusted to be of their sizes."""
        last = self.count - 1 + self._spare
        bits = 0
        for index in payloads:
            bits |= 1 << (last - index)
        parts = [bits.to_bytes(self.map_size, "big")]
        parts += [payloads[index] for index in sorted(payloads)]
        return b"".join(parts)

    def split(self, body: bytes, way: PacketDirection) -> dict[int, bytes]:
        """Take a body apart.

        Returns:
            Payloads by element, in the order of their bits.

        Raises:
            PacketError: If a bit is set that can't be, or a payload hasn't its size.
        """
        size = self.map_size
        if not size <= len(body) <= self.longest[way]:
            raise PacketError("the length of its body")
        bits = int.from_bytes(body[:size], "big")
        plan = self._planned(bits, way)
        if plan is None:
            return self._searched(body, bits, way)
        if len(body) != (plan[-1][2] if plan else size):
            raise PacketError("the length of its payloads")
        return {index: body[start:end] for index, start, end in plan}

    def _indices(self, bits: int) -> list[int]:
        last = self.count - 1 + self._spare
        return [index for index in range(self.count) if bits >> (last - index) & 1]

    def _plan(self, bits: int, way: PacketDirection) -> tuple[tuple[int, int, int], ...] | None:
        """Where payloads of a map begin and end; None if one of them says how long it is."""
        if bits & ((1 << self._spare) - 1):
            raise PacketError("a device bit beyond its elements")
        at, plan = self.map_size, []
        fixed = True
        for index in self._indices(bits):
            size = self.sizes[way][index]
            if size is None:
                raise PacketError(f"a payload for {self.model.elements[index].name}, which has none this way")
            fixed = fixed and size >= 0
            plan.append((index, at, at + size))
            at += size
        return tuple(plan) if fixed else None

    def _searched(self, body: bytes, bits: int, way: PacketDirection) -> dict[int, bytes]:
        at, found = self.map_size, {}
        for index in self._indices(bits):
            size = self.sizes[way][index]
            assert size is not None
            if size < 0:
                if len(body) < at + STORED.size:
                    raise PacketError("the length of its payloads")
                element = self.model.elements[index]
                assert isinstance(element, MemoryCommand | MemoryEvent)
                _, length = STORED.unpack_from(body, at)
                if length > element.size:
                    raise PacketError(f"the length of {element.name}")
                size = STORED.size + length
            if len(body) < at + size:
                raise PacketError("the length of its payloads")
            found[index] = body[at : at + size]
            at += size
        if at != len(body):
            raise PacketError("the length of its payloads")
        return found
