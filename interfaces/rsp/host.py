"""A body at the robot's side of RSP: elements of the model move and measure what their bindings name.

Whatever the model, no code is written for it. An effector without a binding, or with one that the body hasn't got,
is a register: its monitor tells what it was told. A sensor without one says 0.
"""

from __future__ import annotations

import logging
from typing import Final, Protocol

from interfaces.rsp.errors import FullError
from interfaces.rsp.model.elements import Command, Effector, Event, MemoryCommand, MemoryEvent, Scalar, Sensor
from interfaces.rsp.motion_filter import Values
from interfaces.rsp.outputs import Commanded, RobotChange, Stored
from interfaces.rsp.robot import RobotCore
from interfaces.rsp.session import SLACK
from vrs.errors import InvalidValueError

_LOG: Final = logging.getLogger(__name__)

PERIOD: Final = 0.016
"""Between two looks at effectors and sensors [s]; rounded to whole steps of the body."""
FRAGMENT_TIME: Final = 0.02
"""How long a fragment of sound is played [s]."""
MEMORY_PATIENCE: Final = 5.0
"""A memory event that isn't acknowledged after so long is given up [s]."""
MOST_BEHIND: Final = 0.25
"""How much the body makes up for at most when its host was late [s]; the rest of the time it stood still."""


class HostedBody(Protocol):
    """What a host needs of a body; values are in the units of its bindings."""

    def move(self, binding: str, values: Values) -> None:
        """Let something be done from now on."""

    def carry_out(self, binding: str, values: Values) -> None:
        """Do something once."""

    def sound(self, data: bytes | None) -> None:
        """Play a fragment, or silence."""

    def measure(self, binding: str) -> Values | None:
        """What a sensor says; None where there's no such binding."""

    def events(self) -> list[str]:
        """Bindings of what happened since the last call."""

    def memories(self) -> list[tuple[str, bytes]]:
        """Bindings of memory events since the last call, and their data."""

    def go_on(self, steps: int = 1) -> None:
        """Go on by steps."""

    @property
    def resting(self) -> bool:
        """Whether it stands still."""

    @property
    def step(self) -> float:
        """Of its physics [s]."""


class RspHost:
    """Runs a body and a robot's core together; it knows no socket and no clock."""

    def __init__(self, core: RobotCore, body: HostedBody, moves: frozenset[str], *, now: float = 0.0) -> None:
        """Join a body to a core.

        Args:
            core: Of the robot's side.
            body: Its body.
            moves: Bindings of effectors that the body has.
            now: When it begins [s].
        """
        self.core, self.body, self.model = core, body, core.model
        self._moves = moves
        self._steps = max(1, round(PERIOD / body.step))
        self.stored: dict[str, bytes] = {}
        """Newest data of each memory command, by name."""
        self._next = self._sound = now
        self._speakers = [i for i, e in enumerate(self.model) if isinstance(e, Effector) and e.stream]
        self._sensors = [(i, e) for i, e in enumerate(self.model) if isinstance(e, Sensor)]
        self._events: dict[str, list[tuple[int, Event]]] = {}
        self._memories: dict[str, list[int]] = {}
        for index, element in enumerate(self.model):
            if isinstance(element, Event):
                self._events.setdefault(element.binding, []).append((index, element))
            elif isinstance(element, MemoryEvent):
                self._memories.setdefault(element.binding, []).append(index)
            elif isinstance(element, Effector) and element.initial and not element.stream:
                self._move(element, (element.initial,) * element.count)
        self._measure()

    @property
    def period(self) -> float:
        """Between two looks [s]."""
        return self._steps * self.body.step

    def next_deadline(self) -> float:
        """When the body is to go on [s]."""
        return self._next

    def advance(self, *, now: float) -> None:
        """Let the body live up to now [s]."""
        lost = now - MOST_BEHIND - self._next
        if lost > 0:
            self._next += lost
            self._sound += lost
        while self._next <= now + SLACK:
            self._look(self._next)
            self.body.go_on(self._steps)
            self._next += self.period
            self._measure()

    def _look(self, now: float) -> None:
        """Do what the core says, and play what is due."""
        for index, values in self.core.effectors(now=now).items():
            element = self.model.elements[index]
            assert isinstance(element, Effector)
            self._move(element, values)
        if self.core.stopping and self.body.resting:
            self.core.rested()
        for output in self.core.take():
            match output:
                case Commanded(index=index, payload=payload):
                    self._command(index, payload)
                case Stored(index=index, data=data):
                    self.stored[self.model.elements[index].name] = data
                    element = self.model.elements[index]
                    assert isinstance(element, MemoryCommand)
                    self.body.carry_out(element.binding or element.name, (float(len(data)),))
                case RobotChange.CLEARED:
                    self.body.sound(None)
        while self._sound <= now + SLACK:
            self._sound += FRAGMENT_TIME
            for index in self._speakers:
                self.body.sound(self.core.streams.take(index))
        for binding in self.body.events():
            for index, event in self._events.get(binding, ()):
                self.core.occur(index, packed(event, (1.0,) * event.count))
        for binding, data in self.body.memories():
            for index in self._memories.get(binding, ()):
                self._store(index, data, now)

    def _store(self, index: int, data: bytes, now: float) -> None:
        """Let the local system get a memory event, if there is one and it has room."""
        if self.core.session is None:
            return
        try:
            self.core.store(index, data, deadline=now + MEMORY_PATIENCE)
        except (InvalidValueError, FullError) as error:
            _LOG.warning("a memory event of %s is left out: %s", self.model.elements[index].name, error)

    def _move(self, element: Effector, values: Values) -> None:
        if element.binding in self._moves:
            self.body.move(element.binding, tuple(element.scale * value for value in values))

    def _command(self, index: int, payload: bytes) -> None:
        element = self.model.elements[index]
        assert isinstance(element, Command)
        values = tuple(element.scale * value for value in element.format.unpack(payload))
        self.body.carry_out(element.binding or element.name, values)

    def _measure(self) -> None:
        for index, element in self._sensors:
            values = self.body.measure(element.binding) if element.binding else None
            self.core.measure(index, packed(element, values or ()))


def packed(element: Sensor | Event | Command | Effector, values: Values) -> bytes:
    """Values in an element's unit as they are on the wire: rounded, within its type, 0 where there are too few."""
    low, high = element.type.bounds
    raw = [min(max(value / element.scale, low), high) for value in values[: element.count]]
    raw += [0.0] * (element.count - len(raw))
    return element.format.pack(*(raw if element.type is Scalar.F32 else map(round, raw)))
