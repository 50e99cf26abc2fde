"""Robot API: what every device of a robot can, whatever its model. Generated classes name and type them.

Source: Kim, Suh, Kim, Oh, Fig. 4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Generic, TypeVar, cast

from typing_extensions import override

from interfaces.rsp.errors import DeadlineError
from interfaces.rsp.middleware import Middleware
from interfaces.rsp.model.elements import Command, Effector, Event, Monitor, Sensor
from interfaces.rsp.outbox import DeliveryOutcome
from vrs.checks import finite, integer_in
from vrs.errors import InvalidValueError

V = TypeVar("V", int, float)
T = TypeVar("T")


class Device:
    """One element of the robot."""

    def __init__(self, middleware: Middleware, name: str) -> None:
        """Take the middleware, and the element's name."""
        self._middleware = middleware
        self._index = middleware.model.index(name)
        self.name = name

    def _await(self, fetch: Callable[[], T | None], timeout: float) -> T:
        found: list[T] = []

        def there() -> bool:
            value = fetch()
            if value is not None:
                found.append(value)
            return value is not None

        if not self._middleware.wait_for(there, timeout):
            raise DeadlineError(self.name, timeout)
        return found[0]


class Requested(Device):
    """What the robot tells only while it's asked to."""

    _active = False

    def set_active(self, active: bool) -> None:
        """Ask for it from now on, or no more."""
        with self._middleware.changed:
            self._middleware.core.request(self._index, active)
            self._active = active

    def is_active(self) -> bool:
        """Whether it's asked for by itself; a module may ask for it, too."""
        return self._active


class EffectorDevice(Device, Generic[V]):
    """Something that moves or shows: Fig. 4."""

    @override
    def __init__(self, middleware: Middleware, name: str) -> None:
        super().__init__(middleware, name)
        element = middleware.model.elements[self._index]
        assert isinstance(element, Effector)
        self._element, self._format = element, element.format
        self._activated = False
        self._active = True
        initial = int(element.initial) if element.type.whole else element.initial
        self._values: list[V] = cast("list[V]", [initial] * element.count)

    def write(self, index: int, value: V) -> None:
        """Set one value, raw as on the wire: times the element's scale it's in its unit.

        Args:
            index: Which, from 0.
            value: Within the element's limits.

        Raises:
            InvalidValueError: If there's no such value or it's beyond its limits; nothing changed then.
        """
        # As one: another thread may write another of them.
        with self._middleware.changed:
            values = list(self._values)
            values[_place(self.name, index, len(values))] = value
            self.write_all(values)

    def write_all(self, values: Sequence[V]) -> None:
        """Set all values; arguments and errors as of `write`."""
        element, whole = self._element, self._element.type.whole
        allowed = f"{element.count} of {element.type} in [{element.low:g}, {element.high:g}]"
        if len(values) != element.count:
            raise InvalidValueError(self.name, values, allowed)
        for value in values:
            fits = element.low <= finite(self.name, value, allowed) <= element.high
            if not fits or (whole and int(value) != value):
                raise InvalidValueError(self.name, value, allowed)
        with self._middleware.changed:
            self._values = [cast("V", int(value) if whole else float(value)) for value in values]
            if self._active:
                self._middleware.core.write(self._index, self._format.pack(*self._values))

    def read(self, index: int) -> V:
        """One value of the simulacrum: what was written last."""
        return self._values[_place(self.name, index, len(self._values))]

    def read_all(self) -> tuple[V, ...]:
        """All values of the simulacrum."""
        return tuple(self._values)

    def read_into(self, values: list[V]) -> EffectorDevice[V]:
        """Put all values into a list, from its start; returns the device."""
        values[: len(self._values)] = self._values
        return self

    def set_activated(self, activated: bool) -> None:
        """Let the values be in every packet, or only until the robot has them."""
        with self._middleware.changed:
            self._middleware.core.activate(self._index, activated)
            self._activated = activated
            if activated:
                self._middleware.core.write(self._index, self._format.pack(*self._values))

    def is_activated(self) -> bool:
        """Whether the values are in every packet."""
        return self._activated

    def set_active(self, active: bool) -> None:
        """Let what's written go to the robot, or only into the simulacrum; once it may go, all of it does."""
        with self._middleware.changed:
            if active and not self._active:
                self._middleware.core.write(self._index, self._format.pack(*self._values))
            self._active = active

    def is_active(self) -> bool:
        """Whether what's written goes to the robot."""
        return self._active


class StreamDevice(Device):
    """An effector that plays data."""

    def play(self, data: bytes) -> None:
        """Send data, fragment by fragment, as the robot has buffers for it.

        Raises:
            FullError: If too much waits; nothing of it is taken then.
        """
        with self._middleware.changed:
            self._middleware.core.play(self._index, data)

    def clear(self) -> None:
        """Drop what waits, of all streams, here and at the robot."""
        with self._middleware.changed:
            self._middleware.core.clear()

    def waiting(self) -> int:
        """Fragments that wait here."""
        with self._middleware.changed:
            return len(self._middleware.core.streams)


class ToldDevice(Requested, Generic[V]):
    """What the robot tells in values."""

    @override
    def __init__(self, middleware: Middleware, name: str) -> None:
        super().__init__(middleware, name)
        element = middleware.model.elements[self._index]
        if isinstance(element, Monitor):
            element = middleware.model.effector_of(element)
        assert isinstance(element, Sensor | Effector | Event)
        self._format = element.format

    def add_listener(self, listener: Callable[[tuple[V, ...]], None]) -> Callable[[], None]:
        """Let something be called with the values each time they come; returns what ends that."""
        return self._middleware.listen(self._index, lambda payload: listener(self._unpacked(payload)))

    def _unpacked(self, payload: bytes) -> tuple[V, ...]:
        return cast("tuple[V, ...]", self._format.unpack(payload))


class SensorDevice(ToldDevice[V]):
    """A sensor or a monitor."""

    def read(self, index: int) -> V:
        """One value, raw as on the wire.

        Raises:
            DeadlineError: If nothing came yet.
        """
        values = self.read_all()
        return values[_place(self.name, index, len(values))]

    def read_all(self) -> tuple[V, ...]:
        """All values as they were last told.

        Raises:
            DeadlineError: If nothing came yet.
        """
        _, payload = self._middleware.payload(self._index)
        if payload is None:
            raise DeadlineError(self.name, 0.0)
        return self._unpacked(payload)

    def wait(self, timeout: float) -> tuple[V, ...]:
        """Wait for the next values that differ from the last, at most so long [s].

        Raises:
            DeadlineError: If none came in time.
        """
        before, _ = self._middleware.payload(self._index)

        def fetch() -> tuple[V, ...] | None:
            count, payload = self._middleware.payload(self._index)
            return self._unpacked(payload) if payload is not None and count != before else None

        return self._await(fetch, timeout)


class CommandTicket:
    """A command or memory command that was given."""

    def __init__(self, device: Device, number: int) -> None:
        """Take the device and the ID."""
        self._device, self.id = device, number

    @property
    def outcome(self) -> DeliveryOutcome | None:
        """What became of it; None while nobody knows."""
        return self._device._middleware.outcome(self._device._index, self.id)

    def wait(self, timeout: float) -> DeliveryOutcome:
        """Wait until that's known, at most so long [s].

        Raises:
            DeadlineError: If it isn't by then.
        """
        return self._device._await(lambda: self.outcome, timeout)


class CommandDevice(Device, Generic[V]):
    """A command that must be transferred."""

    def send(self, *values: V) -> CommandTicket:
        """Give the command.

        Raises:
            InvalidValueError: If values are missing or beyond their type.
            FullError: If too many wait.
        """
        element = self._middleware.model.elements[self._index]
        assert isinstance(element, Command)
        low, high = element.type.bounds
        allowed = f"{element.count} of {element.type}"
        whole = element.type.whole
        fits = all(low <= finite(self.name, v, allowed) <= high and (not whole or int(v) == v) for v in values)
        if len(values) != element.count or not fits:
            raise InvalidValueError(self.name, values, allowed)
        with self._middleware.changed:
            return CommandTicket(self, self._middleware.core.command(self._index, element.pack(values)))


class ModuleDevice(Requested):
    """A set of sensors, monitors and events."""


class EventDevice(ToldDevice[V]):
    """An event."""

    def wait(self, timeout: float) -> tuple[V, ...]:
        """Wait for the oldest one that nobody fetched, at most so long [s].

        Raises:
            DeadlineError: If none came in time.
        """
        return self._unpacked(self._await(lambda: self._middleware.came(self._index), timeout))


class MemoryCommandDevice(Device):
    """Data that the robot gets exactly once."""

    def send(self, data: bytes, *, timeout: float) -> CommandTicket:
        """Give the data, to be settled within a time [s].

        Raises:
            InvalidValueError: If it's too long.
            FullError: If too many wait.
        """
        with self._middleware.changed:
            deadline = self._middleware.clock.now() + finite("timeout", timeout, "finite seconds")
            return CommandTicket(self, self._middleware.core.store(self._index, data, deadline=deadline))


class MemoryEventDevice(Device):
    """Data that comes from the robot exactly once."""

    def wait(self, timeout: float) -> bytes:
        """Wait for the oldest that nobody fetched, at most so long [s].

        Raises:
            DeadlineError: If none came in time.
        """
        return self._await(lambda: self._middleware.came(self._index), timeout)

    def add_listener(self, listener: Callable[[bytes], None]) -> Callable[[], None]:
        """Let something be called with each; returns what ends that."""
        return self._middleware.listen(self._index, listener)


def _place(name: str, index: int, count: int) -> int:
    return integer_in(f"index of {name}", index, 0, count - 1)
