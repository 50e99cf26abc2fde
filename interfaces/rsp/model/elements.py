"""Robot models: eight kinds of element as frozen values, and elements that fit together."""

from __future__ import annotations

import enum
import keyword
import math
import re
import struct
from collections.abc import Iterable, Iterator
from dataclasses import MISSING, dataclass, fields
from typing import Annotated, Any, Final, TypeAlias, get_args

from vrs.checks import finite, integer_in, validated, within
from vrs.errors import InvalidValueError

MOST_VALUES: Final = 1024
"""Most values of an element."""
MOST_BYTES: Final = 16_384
"""Most bytes of data of a stream, a memory command or a memory event."""
LONGEST_NAME: Final = 48
_NAME: Final = re.compile(r"[a-z](?:_?[a-z0-9])*")
_PLAIN: Final = re.compile(r"[ !#-&(-\[\]-~]*")


class Scalar(enum.StrEnum):
    """What a value is on the wire, in network order."""

    I8 = "i8"
    U8 = "u8"
    I16 = "i16"
    U16 = "u16"
    I32 = "i32"
    U32 = "u32"
    F32 = "f32"

    @property
    def code(self) -> str:
        """As `struct` spells it."""
        return {"i8": "b", "u8": "B", "i16": "h", "u16": "H", "i32": "i", "u32": "I", "f32": "f"}[self.value]

    @property
    def size(self) -> int:
        """[byte]."""
        return int(self.value[1:]) // 8

    @property
    def whole(self) -> bool:
        """Whether values are integers."""
        return self is not Scalar.F32

    @property
    def bounds(self) -> tuple[float, float]:
        """The least and the greatest value."""
        bits = int(self.value[1:])
        if self is Scalar.F32:
            return -3.4028234663852886e38, 3.4028234663852886e38
        return (0, 2**bits - 1) if self.value[0] == "u" else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


class Filling(enum.StrEnum):
    """What the motion filter makes of values that are missing."""

    HOLD = "hold"
    """The last ones again."""
    LINEAR = "linear"
    """What lies in between, where those after them are there; else the last ones."""


class OnLoss(enum.StrEnum):
    """What an effector does when nothing comes from the local system any more."""

    HOLD = "hold"
    """It keeps its values, as a posture."""
    REST = "rest"
    """It goes back to its initial values, as wheels to standing."""


@dataclass(frozen=True, slots=True)
class _Named:
    name: str
    """Of letters a to z, digits and underscores, as in Python."""

    def __post_init__(self) -> None:
        check_name(self.name)


def check_name(name: object) -> None:
    """Refuse what can't be the name of an element or a robot.

    Raises:
        InvalidValueError: If it isn't one.
    """
    good = isinstance(name, str) and len(name) <= LONGEST_NAME and _NAME.fullmatch(name)
    if not good or keyword.iskeyword(str(name)):
        allowed = f"a to z, digits and single underscores, {LONGEST_NAME} at most, and no word of Python's"
        raise InvalidValueError("name", name, allowed)


def _plain(what: str, element: _Named, text: object) -> None:
    """Refuse a text that isn't short and plain: it stands in generated code, too."""
    if not isinstance(text, str) or len(text) > LONGEST_NAME or not _PLAIN.fullmatch(text):
        allowed = f"printable ASCII without quotes and backslashes, {LONGEST_NAME} characters at most"
        raise InvalidValueError(f"{what} of {element.name}", text, allowed)


def _word(element: _Named, what: str, words: type[enum.StrEnum]) -> None:
    """Make an attribute one of some words."""
    value = getattr(element, what)
    try:
        object.__setattr__(element, what, words(value))
    except ValueError:
        raise InvalidValueError(f"{what} of {element.name}", value, f"one of {', '.join(words)}") from None


@dataclass(frozen=True, slots=True)
class _Valued(_Named):
    type: Scalar = Scalar.I16
    """Of each value."""
    count: int = 1
    """How many values, 1 to 1024."""
    unit: str = ""
    """Of a value times `scale`, for readers."""
    scale: float = 1.0
    """What a value is multiplied by to be in `unit`; finite, not 0."""
    binding: str = ""
    """What of the robot's body it is, as `wheel.left`; none where nothing moves or measures."""

    def __post_init__(self) -> None:
        _Named.__post_init__(self)
        _word(self, "type", Scalar)
        integer_in(f"count of {self.name}", self.count, 1, MOST_VALUES)
        if finite(f"scale of {self.name}", self.scale, "a finite number, not 0") == 0:
            raise InvalidValueError(f"scale of {self.name}", self.scale, "a finite number, not 0")
        for what, text in (("unit", self.unit), ("binding", self.binding)):
            _plain(what, self, text)

    @property
    def format(self) -> struct.Struct:
        """Of its values on the wire."""
        return struct.Struct(f"!{self.count}{self.type.code}")

    def pack(self, values: Iterable[float]) -> bytes:
        """Values as they are on the wire."""
        return self.format.pack(*(map(int, values) if self.type.whole else values))


@dataclass(frozen=True, slots=True)
class Effector(_Valued):
    """An input element: motor, LCD, LED. With a stream, what it's given is data that it plays in order."""

    low: float = -math.inf
    """Least value; that of the type unless given."""
    high: float = math.inf
    """Greatest value."""
    initial: float = 0.0
    """Its values until something comes."""
    filling: Filling = Filling.HOLD
    """What the motion filter does where values are missing."""
    on_loss: OnLoss = OnLoss.HOLD
    """What it does when the link is lost."""
    stream: int = 0
    """Bytes of data in a fragment, 1 to 16,384; 0 for an element with values."""

    def __post_init__(self) -> None:
        _Valued.__post_init__(self)
        least, greatest = self.type.bounds
        object.__setattr__(self, "low", max(_limit("low", self, self.low), least))
        object.__setattr__(self, "high", min(_limit("high", self, self.high), greatest))
        if not self.low <= self.initial <= self.high:
            raise InvalidValueError(f"initial of {self.name}", self.initial, f"in [{self.low:g}, {self.high:g}]")
        if self.type is not Scalar.F32 and self.initial != int(self.initial):
            raise InvalidValueError(f"initial of {self.name}", self.initial, "a whole number")
        integer_in(f"stream of {self.name}", self.stream, 0, MOST_BYTES)
        _word(self, "filling", Filling)
        _word(self, "on_loss", OnLoss)

    @property
    def wire_limits(self) -> tuple[float, float]:
        """`low` and `high` as they come over the wire: of f32 the values nearest to them, maybe beyond."""
        if self.type is not Scalar.F32:
            return self.low, self.high
        low, high = struct.unpack("!2f", struct.pack("!2f", self.low, self.high))
        return low, high


def _limit(what: str, element: Effector, value: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
        raise InvalidValueError(f"{what} of {element.name}", value, "a number")
    return float(value)


@dataclass(frozen=True, slots=True)
class Sensor(_Valued):
    """An output element: proximity, luminance."""


@dataclass(frozen=True, slots=True)
class Monitor(_Named):
    """Tells the state of an effector, in a payload of the effector's size."""

    effector: str
    """Its name."""


@dataclass(frozen=True, slots=True)
class Command(_Valued):
    """A user's command that must be transferred: sent again and again until it's acknowledged."""


@dataclass(frozen=True, slots=True)
class Module(_Named):
    """A set of elements, switched on and off together; it has no payload."""

    members: tuple[str, ...]
    """Names of sensors, monitors and events."""

    def __post_init__(self) -> None:
        _Named.__post_init__(self)
        object.__setattr__(self, "members", tuple(self.members))
        if not self.members or len(set(self.members)) != len(self.members):
            raise InvalidValueError(f"members of {self.name}", self.members, "one or more, each once")


@dataclass(frozen=True, slots=True)
class Event(_Valued):
    """A kind of sensor that speaks only when its condition is met."""


@dataclass(frozen=True, slots=True)
class _Stored(_Named):
    size: int = 256
    """Most bytes of data, 1 to 16,384."""
    binding: str = ""
    """What of the robot's body it is."""

    def __post_init__(self) -> None:
        _Named.__post_init__(self)
        integer_in(f"size of {self.name}", self.size, 1, MOST_BYTES)
        _plain("binding", self, self.binding)


@dataclass(frozen=True, slots=True)
class MemoryCommand(_Stored):
    """Data that the robot must get exactly once, sent once and again only where the acknowledgement fails."""


@dataclass(frozen=True, slots=True)
class MemoryEvent(_Stored):
    """The same from the robot to the local system."""


Element: TypeAlias = Effector | Sensor | Monitor | Command | Module | Event | MemoryCommand | MemoryEvent
KINDS: Final[tuple[type[Element], ...]] = get_args(Element)


def stated(element: Element) -> Iterator[tuple[str, Any]]:
    """Fields of an element that aren't at their defaults, by name; an effector's limits are its type's then."""
    for item in fields(element):
        default, value = item.default, getattr(element, item.name)
        if isinstance(element, Effector) and item.name in ("low", "high"):
            default = element.type.bounds[item.name == "high"]
        if default is MISSING or value != default:
            yield item.name, value


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
