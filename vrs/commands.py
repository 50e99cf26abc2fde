"""Commands and their parts.

Stamps are seconds on the timeline of the engine that receives the command.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import inf
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import numpy as np
from msgspec import Meta, field
from numpy.typing import ArrayLike

from vrs.checks import finite, normal, number_in, sized_array, word
from vrs.errors import InvalidValueError
from vrs.model import Array
from vrs.record import LARGEST, Number, Pose, Record, Time, Twist, Value, set_field

FARTHEST = 1e6
"""Largest distance in a command [m]."""
_UNCHANGED = 1.0
"""A share that changes nothing, and isn't written."""
ENDLESS = "inf"
"""How infinity is written, of which JSON knows nothing."""

_Share = Annotated[float, Meta(ge=1e-3, le=1)]
_Distance = Annotated[float, Meta(ge=0, le=FARTHEST)]
if TYPE_CHECKING:
    _Extent: TypeAlias = float
    _Parameter: TypeAlias = Any
else:
    _Extent = _Distance | Literal["inf"]
    _Parameter = (
        bool
        | Annotated[int, Meta(ge=-(10**9), le=10**9)]
        | Value
        | Annotated[str, Meta(max_length=200)]
        | Annotated[list[Value], Meta(min_length=1, max_length=64)]
        | None
    )


class Endless(float):
    """Infinity, as it's held; it's written as `ENDLESS`."""


_FOR_EVER = Endless(inf)


class Motion(enum.StrEnum):
    """How the tool travels."""

    JOINT = "joint"
    """Joint-interpolated: all joints start and arrive together."""
    LINE = "line"
    """The tool on a straight line."""


class Profile(enum.StrEnum):
    """The time law of a move."""

    PARABOLIC = "parabolic"
    """Linear with parabolic blends: bounded acceleration."""
    JERK_LIMITED = "jerk-limited"
    """Bounded jerk, continuous acceleration."""


class Insertion(enum.StrEnum):
    """What a command does to what is scheduled."""

    SPLICE = "splice"
    """Replace the interrupted move, shift the moves after it."""
    REPLACE = "replace"
    """Drop everything scheduled from the execution time on."""
    APPEND = "append"
    """Keep everything, start at the end."""


class Lateness(enum.StrEnum):
    """What happens to a command whose execution time has passed."""

    POSTPONE = "postpone"
    REJECT = "reject"


class Frame(enum.StrEnum):
    """Where a twist is expressed."""

    BASE = "base"
    """The robot's base frame."""
    TOOL = "tool"
    """The frame of the last link."""


class JointTarget(Record, frozen=True, omit_defaults=True, gc=False, eq=False, tag_field="type", tag="joints"):
    """A target in joint space."""

    q: Array
    """Joint values [rad], shape (n,)."""

    if TYPE_CHECKING:

        def __init__(self, q: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        set_field(self, "q", _joints("target q", self.q, "finite joint values [rad], shape (n,)"))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, JointTarget) and np.array_equal(self.q, other.q)

    def __hash__(self) -> int:
        return hash(self.q.tobytes())


class PoseTarget(Record, frozen=True, omit_defaults=True, gc=False, eq=False, tag_field="type", tag="pose"):
    """A target pose of the last link in the base frame."""

    X: Pose
    """Homogeneous transform, (4, 4), by rows, with a proper rotation."""
    configuration: Annotated[str, Meta(max_length=200)] | None = None
    """Asked-for arm configuration, as `LEFTY BELOW FLIP` or a part of it; None: the arm's own."""

    if TYPE_CHECKING:

        def __init__(self, X: ArrayLike, configuration: str | None = None) -> None: ...

    def __post_init__(self) -> None:
        set_field(self, "X", _transform("target X", self.X))
        if self.configuration is not None and not isinstance(self.configuration, str):
            raise InvalidValueError("configuration", self.configuration, "None or the words of a configuration")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PoseTarget):
            return False
        return self.configuration == other.configuration and np.array_equal(self.X, other.X)

    def __hash__(self) -> int:
        return hash((self.X.tobytes(), self.configuration))


Target: TypeAlias = JointTarget | PoseTarget


class _Command(Record, frozen=True, omit_defaults=True, gc=False, tag_field="type"):
    """A command, named by its type where it crosses; `_CHECKS` says what its fields may be."""

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            check = _CHECKS.get(name)
            value = getattr(self, name)
            if check is not None and (value is not None or name in _NEEDED):
                set_field(self, name, check(name, value))


class MotionCommand(_Command, frozen=True, omit_defaults=True, gc=False, eq=False, tag="move"):
    """Move to a target: (p, t, v) of eq. (1), Doulgeri, Zikos, Delopoulos."""

    target: Target
    """Where to."""
    issued_at: Time | None = None
    """Issue time t_iss [s]; None: whoever registers the command stamps it.

    An engine in real-time mode stamps its present time; a command for an earlier t_exec then is rejected, so one
    that was issued in time and comes late must carry its own stamp to be postponed.
    """
    execute_at: Time | None = None
    """Execution time t_exec [s]; None: as soon as possible, which is now, or the end of the plan when offline."""
    speed: _Share = field(default_factory=lambda: 1.0)
    """Share v of the nominal speeds, in (0, 1]. The paper's v = 0 would never arrive, so it is refused."""
    motion: Motion = Motion.JOINT
    profile: Profile = Profile.PARABOLIC
    insertion: Insertion = Insertion.SPLICE
    deviation: _Extent = field(default_factory=float)
    """How far the tool may stay away from where the move before it ends [m], so as not to stop there; 0 stops.

    Infinity, written as `inf`, is a continuous path: the move begins where the one before it begins to brake, or so
    late that it's at its speed when that one ends. Such moves take half of the acceleration, so that any two can
    overlap.
    """
    pace: _Share = _UNCHANGED
    """Planned as at 1, a move takes 1/pace times as long on the same path, roundings included; in [0.001, 1]."""
    acceleration: Annotated[float, Meta(ge=1e-2, le=1)] = _UNCHANGED
    """Share of the limits of acceleration and jerk that the move takes, in [0.01, 1]."""
    tool: Pose | None = None
    """What goes straight and keeps the deviation: a frame in the last link's, (4, 4), by rows; None: that link.

    Targets stay the last link's.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, least in (("speed", 1e-3), ("pace", 1e-3), ("acceleration", 1e-2)):
            share = normal(finite(name, getattr(self, name), "a number in (0, 1]"))
            if not least <= share <= 1:
                raise InvalidValueError(name, share, f"a number in (0, 1], at least {least:g} so that it arrives")
            set_field(self, name, _UNCHANGED if share == 1.0 and name != "speed" else share)
        set_field(self, "deviation", _distance("deviation", self.deviation, endless=True))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MotionCommand) and self._values() == other._values()

    def __hash__(self) -> int:
        return hash(self._values())

    def _values(self) -> tuple[object, ...]:
        tool = None if self.tool is None else tuple(self.tool.ravel().tolist())
        return (*(getattr(self, name) for name in self.__struct_fields__ if name != "tool"), tool)


class PositionQuery(_Command, frozen=True, omit_defaults=True, gc=False, tag="query"):
    """Ask for the position at time t: g of eq. (4)."""

    t: Time | None = None
    """Timeline time [s]; None: now (offline: the end of the plan)."""


class ParameterChange(_Command, frozen=True, omit_defaults=True, gc=False, tag="parameter"):
    """Change a parameter of the simulation, at rest; `Engine.parameters` names them."""

    name: Annotated[str, Meta(max_length=200)]
    value: _Parameter = None


class DriveCommand(_Command, frozen=True, omit_defaults=True, gc=False, tag="drive"):
    """Drive a mobile robot on an arc at constant speeds."""

    v: Value
    """Linear speed [m/s], forward positive."""
    w: Value
    """Angular speed [rad/s], to the left positive."""
    duration: Annotated[float, Meta(gt=0, le=LARGEST)]
    """[s], positive."""
    issued_at: Time | None = None
    """Issue time t_iss [s]; None: whoever registers the command stamps it."""
    execute_at: Time | None = None
    """Execution time t_exec [s]; None: as soon as possible."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.duration <= 0:
            raise InvalidValueError("duration", self.duration, "positive seconds")


class SteerCommand(_Command, frozen=True, omit_defaults=True, gc=False, tag="steer"):
    """Move as a hand on a joystick asks: joint rates, or a twist of the tool; it ends by itself."""

    rates: Array | None = None
    """Joint rates [rad/s], (n,)."""
    twist: Twist | None = None
    """Twist of the tool, (6,): linear [m/s], then angular [rad/s]; instead of rates."""
    frame: Frame = Frame.BASE
    """Frame of the twist."""
    issued_at: Time | None = None
    """Issue time t_iss [s]; an input older than 0.2 s moves nothing."""
    execute_at: Time | None = None
    """Execution time t_exec [s]; None: as soon as possible."""

    def __post_init__(self) -> None:
        if (self.rates is None) == (self.twist is None):
            raise InvalidValueError("steering", (self.rates, self.twist), "either rates or a twist")
        super().__post_init__()


class Retime(_Command, frozen=True, omit_defaults=True, gc=False, tag="retime"):
    """Let a scheduled move begin at another time."""

    command_id: Number
    execute_at: Time
    """New start [s]."""
    issued_at: Time | None = None

    def __post_init__(self) -> None:
        finite("execute_at", self.execute_at, "finite seconds")
        super().__post_init__()


class Cancel(_Command, frozen=True, omit_defaults=True, gc=False, tag="cancel"):
    """Take a scheduled move out of the plan; one under way brakes."""

    command_id: Number
    issued_at: Time | None = None
    execute_at: Time | None = None
    """When [s]; None: as soon as possible."""


class InsertVia(_Command, frozen=True, omit_defaults=True, gc=False, tag="via"):
    """Let a scheduled move, or what is left of one under way, go by another place."""

    command_id: Number
    target: Target
    deviation: _Distance = field(default_factory=float)
    """How far the tool may stay away from the via [m], so as not to stop there; 0 stops."""
    issued_at: Time | None = None
    execute_at: Time | None = None
    """When a move under way turns to the via [s]; None: as soon as possible."""

    def __post_init__(self) -> None:
        super().__post_init__()
        set_field(self, "deviation", _distance("deviation", self.deviation))


class ScaleTime(_Command, frozen=True, omit_defaults=True, gc=False, tag="scale"):
    """Run what is scheduled `factor` times as fast: the path stays, holds are scaled too."""

    factor: Annotated[float, Meta(ge=1e-3, le=1e3)]
    """Ratio of the new pace to the present one, 0.001 to 1000."""
    issued_at: Time | None = None
    execute_at: Time | None = None
    """When it begins [s]; None: as soon as possible (offline: the start of the timeline)."""


class Stop(_Command, frozen=True, omit_defaults=True, gc=False, tag="stop"):
    """Stop along the present motion as fast as the limits allow, and drop what is scheduled."""

    issued_at: Time | None = None
    execute_at: Time | None = None
    """When [s]; None: as soon as possible. A late stop stops at once, whatever the lateness policy."""


class Resume(_Command, frozen=True, omit_defaults=True, gc=False, tag="resume"):
    """Go on with what a stop interrupted and dropped."""

    issued_at: Time | None = None
    execute_at: Time | None = None
    """When [s]; None: as soon as possible."""


class Redo(_Command, frozen=True, omit_defaults=True, gc=False, tag="redo"):
    """Take back the newest undo: the plan is again what it was, unless something else was commanded since."""


class Alter(_Command, frozen=True, omit_defaults=True, gc=False, eq=False, tag="alter"):
    """Add an offset to the path of the tool that's planned; given again and again, it's followed.

    It's reached 56 ms after it was issued; or, from one on that comes later than 28 ms after that, so much later.
    Where no other one comes, it goes back to nothing.
    """

    offset: Twist | None = None
    """Translation [m], then rotation vector [rad], (6,): all of it, not what's added to the one before.

    None ends it: the path with the offset is what's planned from now on.
    """
    frame: Frame = Frame.BASE
    """Axes of the offset; those of the tool are those of `tool`, as it's planned to be turned."""
    tool: Pose | None = None
    """What is offset: a frame in the last link's, (4, 4), by rows; None: that link."""
    stays: bool = False
    """Whether it stays where the plan is over by then; else it's stayed at 0.1 s longer before it goes back."""
    issued_at: Time | None = None
    """Issue time t_iss [s], from which its delay counts; one older than 0.2 s moves nothing."""
    execute_at: Time | None = None
    """When the path begins to change [s]; None: as soon as possible."""


class Grip(_Command, frozen=True, omit_defaults=True, gc=False, tag="grip"):
    """Let the hand go to an opening, and stay at it, pressing on what is in between.

    The timeline stays as it is, and an undo doesn't take it back.
    """

    opening: _Extent = field(default_factory=float)
    """Between its fingers [m]: 0 closes it; infinity, written as `inf`, opens it as far as it goes."""
    issued_at: Time | None = None
    """Issue time t_iss [s]; None: whoever registers the command stamps it."""
    execute_at: Time | None = None
    """When [s]; None: as soon as possible, which is now, or the end of the plan when offline."""

    def __post_init__(self) -> None:
        super().__post_init__()
        set_field(self, "opening", _distance("opening", self.opening, endless=True))


PlanEdit: TypeAlias = Retime | Cancel | InsertVia | ScaleTime | Stop | Resume | Alter
"""Edits of what is scheduled."""


def _joints(name: str, value: ArrayLike, allowed: str) -> Array:
    array = sized_array(name, value, None, allowed)
    if array.ndim != 1:
        raise InvalidValueError(name, value, allowed)
    return array


def _command_id(name: str, value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        raise InvalidValueError(name, value, "a command's id, an integer from 1")
    return int(value)


def _target(name: str, value: object) -> object:
    if not isinstance(value, (JointTarget, PoseTarget)):
        raise InvalidValueError(name, value, "a JointTarget or a PoseTarget")
    return value


def _distance(name: str, value: object, *, endless: bool = False) -> float:
    if endless and isinstance(value, str | float) and value in (ENDLESS, inf):
        return _FOR_EVER
    return normal(number_in(name, value, 0.0, FARTHEST, unit=" m"))


def _transform(name: str, value: ArrayLike) -> Array:
    allowed = "a homogeneous transform of shape (4, 4) with a rotation matrix orthonormal to 1e-6"
    array = sized_array(name, value, (4, 4), allowed, largest=FARTHEST)
    R = array[:3, :3]
    proper = np.abs(R @ R.T - np.eye(3)).max() <= 1e-6 and np.linalg.det(R) > 0
    if not proper or not np.array_equal(array[3], (0.0, 0.0, 0.0, 1.0)):
        raise InvalidValueError(name, value, allowed)
    return array


def _seconds(name: str, value: object) -> float:
    return normal(finite(name, value, "None or finite seconds"))


def _stamp(name: str, value: object) -> float:
    stamp = _seconds(name, value)
    if abs(stamp) > LARGEST:
        raise InvalidValueError(name, value, "within ±1e9 s: times count from the session's origin")
    return stamp


def _large(name: str, value: object) -> float:
    return normal(number_in(name, value, -LARGEST, LARGEST))


_CHECKS: dict[str, Callable[[str, Any], object]] = {
    "target": _target,
    "command_id": _command_id,
    "issued_at": _stamp,
    "execute_at": _stamp,
    "t": _seconds,
    "motion": partial(word, kind=Motion),
    "profile": partial(word, kind=Profile),
    "insertion": partial(word, kind=Insertion),
    "frame": partial(word, kind=Frame),
    "tool": _transform,
    "factor": partial(number_in, low=1e-3, high=1e3),
    "v": _large,
    "w": _large,
    "duration": _large,
    "rates": partial(_joints, allowed="finite joint rates [rad/s], shape (n,)"),
    "twist": partial(sized_array, shape=(6,), allowed="six finite numbers (v, w)"),
    "offset": partial(sized_array, shape=(6,), allowed="a translation [m] and a rotation vector [rad], (6,)"),
}
"""What the fields of commands may be, by name; None passes where a command may leave them out."""
_NEEDED = frozenset(_CHECKS) - {"issued_at", "execute_at", "t", "tool", "rates", "twist", "offset"}


Command: TypeAlias = (
    MotionCommand | SteerCommand | DriveCommand | PlanEdit | Grip | Redo | PositionQuery | ParameterChange
)


@dataclass(frozen=True, slots=True, eq=False)
class Position:
    """Answer to a position query."""

    t: float
    """Timeline time the answer is for [s]."""
    q: Array
    """Joint values [rad], (n,); of a mobile robot the posture (x, y, θ), (3,)."""
    X: Array
    """Pose of the last link in the base frame, (4, 4); of a mobile robot its own in the world frame."""
