"""A robot model: a name, an ID and elements that fit together."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Final

from interfaces.rsp.model.elements import (
    KINDS,
    Command,
    Effector,
    Element,
    Event,
    MemoryCommand,
    MemoryEvent,
    Module,
    Monitor,
    Sensor,
    check_name,
)
from vrs.checks import validated, within
from vrs.errors import InvalidValueError

MOST_ELEMENTS: Final = 1024
"""Most elements of a model."""
REQUESTED: Final = (Sensor, Monitor, Event)
"""Kinds that a module may have as members: what the robot tells if it's asked to."""


@dataclass(frozen=True, slots=True)
@validated
class RobotModel:
    """The devices and capabilities of a robot."""

    name: str
    """As an element's."""
    id: Annotated[int, within(0, 65_535)]
    """Model ID, 0 to 65535; a packet of another model is dropped."""
    elements: tuple[Element, ...]
    """In the order of their device bits, 1 to 1024."""
    buffers: Annotated[int, within(1, 255)] = 16
    """Fragments of a stream that the robot holds, 1 to 255."""

    def __post_init__(self) -> None:
        check_name(self.name)
        object.__setattr__(self, "elements", tuple(self.elements))
        if not 1 <= len(self.elements) <= MOST_ELEMENTS:
            raise InvalidValueError("elements", len(self.elements), f"1 to {MOST_ELEMENTS}")
        names: dict[str, Element] = {}
        for element in self.elements:
            if not isinstance(element, KINDS):
                raise InvalidValueError("element", element, f"one of {', '.join(kind.__name__ for kind in KINDS)}")
            if element.name in names:
                raise InvalidValueError("name", element.name, "another for each element")
            names[element.name] = element
        for element in self.elements:
            _fits(element, names)

    def __iter__(self) -> Iterator[Element]:
        return iter(self.elements)

    def index(self, name: str) -> int:
        """The device bit of an element.

        Raises:
            InvalidValueError: If there's none of that name.
        """
        for index, element in enumerate(self.elements):
            if element.name == name:
                return index
        raise InvalidValueError("element", name, f"one of {', '.join(e.name for e in self.elements)}")

    def effector_of(self, monitor: Monitor) -> Effector:
        """The effector that a monitor watches."""
        found = self.elements[self.index(monitor.effector)]
        assert isinstance(found, Effector)
        return found


def _fits(element: Element, names: dict[str, Element]) -> None:
    """Check what an element says of others."""
    if isinstance(element, Monitor):
        watched = names.get(element.effector)
        if not isinstance(watched, Effector) or watched.stream:
            what = f"effector of {element.name}"
            raise InvalidValueError(what, element.effector, "the name of an effector with values")
    elif isinstance(element, Module):
        for member in element.members:
            if not isinstance(names.get(member), REQUESTED):
                raise InvalidValueError(f"member of {element.name}", member, "a sensor, a monitor or an event")


def example(name: str = "rover", model_id: int = 1) -> RobotModel:
    """A small robot with one element of each kind: where a new model begins."""
    wheel = {"unit": "m/s", "scale": 0.001, "low": -500.0, "high": 500.0, "on_loss": "rest"}
    return RobotModel(
        name,
        model_id,
        (
            Effector("left_wheel", binding="wheel.left", **wheel),  # type: ignore[arg-type]
            Effector("right_wheel", binding="wheel.right", **wheel),  # type: ignore[arg-type]
            Sensor("position", count=3, type="i32", unit="m, m, rad", scale=0.001, binding="position"),  # type: ignore[arg-type]
            Monitor("left_wheel_state", "left_wheel"),
            Command("ir_fire", type="u8", binding="ir"),  # type: ignore[arg-type]
            Module("sensing", ("position", "left_wheel_state", "bumper")),
            Event("bumper", type="u8", binding="bumper"),  # type: ignore[arg-type]
            MemoryCommand("program"),
            MemoryEvent("log"),
        ),
    )
