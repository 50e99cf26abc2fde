"""What a robot tells: sensors, monitors and events that are asked for; the sensor processor's protocol."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from interfaces.rsp.layout import ID
from interfaces.rsp.model.elements import Module, Monitor
from interfaces.rsp.model.robot_model import RobotModel
from interfaces.rsp.numbers import MODULUS

MOST_EVENTS: Final = 256
"""Events of an element that wait to be told."""


@dataclass(slots=True)
class _Measured:
    """What a sensor says."""

    payload: bytes
    first: int = -1
    """Number of the first packet that had it."""
    known: bool = False
    """Whether the local system has it."""


@dataclass(slots=True)
class _Events:
    """Events of one element that are to be told."""

    waiting: deque[bytes] = field(default_factory=deque)
    number: int = 0
    left: int = 0
    """Packets that still tell of the first one."""


class Telling:
    """Keeps what is to be told; a value that the local system is known to have isn't told again."""

    def __init__(self, model: RobotModel, repeats: int) -> None:
        """Begin with nothing asked for.

        Args:
            model: Of the robot.
            repeats: Packets that tell of an event.
        """
        self._repeats = repeats
        self._members = {
            index: frozenset(model.index(member) for member in element.members)
            for index, element in enumerate(model)
            if isinstance(element, Module)
        }
        self.monitors: dict[int, list[int]] = {}
        """Monitors of each effector that has some."""
        for index, element in enumerate(model):
            if isinstance(element, Monitor):
                self.monitors.setdefault(model.index(element.effector), []).append(index)
        self._measured: dict[int, _Measured] = {}
        self._unknown: set[int] = set()
        """What is measured and perhaps not known."""
        self._events: dict[int, _Events] = {}
        self._requested: frozenset[int] = frozenset()
        self._bits: frozenset[int] = frozenset()

    def reset(self) -> None:
        """Begin a session: nothing is known or asked for."""
        self._events.clear()
        self._requested = self._bits = frozenset()
        for measured in self._measured.values():
            measured.first, measured.known = -1, False
        self._unknown = set(self._measured)

    def measure(self, index: int, payload: bytes) -> None:
        """Set what a sensor or a monitor says."""
        measured = self._measured.get(index)
        if measured is None or measured.payload != payload:
            self._measured[index] = _Measured(payload)
            self._unknown.add(index)

    def occur(self, index: int, payload: bytes) -> bool:
        """Tell of an event; returns whether it will be told: somebody asked for it, and not too many wait."""
        if index not in self._requested:
            return False
        events = self._events.setdefault(index, _Events())
        if len(events.waiting) >= MOST_EVENTS:
            return False
        events.waiting.append(ID.pack(events.number % MODULUS) + payload)
        events.number += 1
        return True

    def ask(self, bits: Iterable[int]) -> None:
        """Take what a packet requests: sensors, monitors, events, and modules, which stand for their members."""
        bits = frozenset(bits)
        if bits == self._bits:
            return
        self._bits = bits
        asked = frozenset().union(
            bits - self._members.keys(), *(self._members[i] for i in bits & self._members.keys())
        )
        for index in asked - self._requested:
            measured = self._measured.get(index)
            if measured is not None:
                measured.first, measured.known = -1, False
                self._unknown.add(index)
        self._requested = asked

    def heard(self, last: int) -> None:
        """Take the newest of our packets that the local system has."""
        for index in tuple(self._unknown):
            measured = self._measured[index]
            if 0 <= measured.first <= last:
                measured.known = True
                self._unknown.discard(index)

    def fill(self, payloads: dict[int, bytes], packet: int) -> None:
        """Add what is to be told to a packet of a number."""
        for index in self._unknown & self._requested:
            measured = self._measured[index]
            if measured.first < 0:
                measured.first = packet
            payloads[index] = measured.payload
        for index, events in self._events.items():
            if events.waiting:
                payloads[index] = events.waiting[0]
                events.left = (events.left or self._repeats) - 1
                if not events.left:
                    events.waiting.popleft()
