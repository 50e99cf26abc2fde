"""Commands, their parts, and the receipts that answer them.

Stamps are seconds on the timeline of the engine that receives the command.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from vrs.errors import InvalidValueError
from vrs.model import Array, frozen_array


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


class Status(enum.StrEnum):
    """Outcome of a motion command."""

    ACCEPTED = "accepted"
    POSTPONED = "postponed"
    REJECTED = "rejected"


def finite(name: str, value: object, allowed: str = "a finite number") -> float:
    """Return value as a float.

    Raises:
        InvalidValueError: If value is not a real number, or NaN or infinite.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InvalidValueError(name, value, allowed)
    number = float(value)
    if not math.isfinite(number):
        raise InvalidValueError(name, value, allowed)
    return number


def finite_array(name: str, value: ArrayLike, shape: tuple[int, ...] | None, allowed: str) -> Array:
    """Copy value into a read-only array of finite numbers of the given shape.

    Raises:
        InvalidValueError: If it holds anything else.
    """
    try:
        raw = np.asarray(value)
    except ValueError:
        raise InvalidValueError(name, value, allowed) from None
    if raw.dtype.kind not in "iuf" or (shape is not None and raw.shape != shape):
        raise InvalidValueError(name, value, allowed)
    array = frozen_array(raw)
    if not np.isfinite(array).all():
        raise InvalidValueError(name, value, allowed)
    return array


@dataclass(frozen=True, slots=True, eq=False)
class JointTarget:
    """A target in joint space."""

    q: Array
    """Joint values [rad], shape (n,)."""

    def __init__(self, q: ArrayLike) -> None:
        array = finite_array("target q", q, None, "finite joint values [rad], shape (n,)")
        if array.ndim != 1:
            raise InvalidValueError("target q", q, "finite joint values [rad], shape (n,)")
        object.__setattr__(self, "q", array)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, JointTarget) and np.array_equal(self.q, other.q)

    def __hash__(self) -> int:
        return hash(self.q.tobytes())


@dataclass(frozen=True, slots=True, eq=False)
class PoseTarget:
    """A target pose of the last link in the base frame."""

    X: Array
    """Homogeneous transform, (4, 4), with a proper rotation."""
    configuration: str | None
    """Asked-for arm configuration, as `LEFTY BELOW FLIP` or a part of it; None keeps the arm's own."""

    def __init__(self, X: ArrayLike, configuration: str | None = None) -> None:
        allowed = "a homogeneous transform of shape (4, 4) with a rotation matrix orthonormal to 1e-6"
        array = finite_array("target X", X, (4, 4), allowed)
        R = array[:3, :3]
        proper = np.abs(R @ R.T - np.eye(3)).max() <= 1e-6 and np.linalg.det(R) > 0
        if not proper or not np.array_equal(array[3], (0.0, 0.0, 0.0, 1.0)):
            raise InvalidValueError("target X", X, allowed)
        if configuration is not None and not isinstance(configuration, str):
            raise InvalidValueError("configuration", configuration, "None or the words of a configuration")
        object.__setattr__(self, "X", array)
        object.__setattr__(self, "configuration", configuration)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PoseTarget):
            return False
        return self.configuration == other.configuration and np.array_equal(self.X, other.X)

    def __hash__(self) -> int:
        return hash((self.X.tobytes(), self.configuration))


Target: TypeAlias = JointTarget | PoseTarget


@dataclass(frozen=True, slots=True)
class MotionCommand:
    """Move to a target: (p, t, v) of eq. (1), Doulgeri, Zikos, Delopoulos."""

    target: Target
    issued_at: float | None = None
    """Issue time t_iss [s]; None is stamped by whoever registers the command.

    An engine in real-time mode stamps its present time; a command for an earlier t_exec then is rejected, so one
    that was issued in time and comes late must carry its own stamp to be postponed.
    """
    execute_at: float | None = None
    """Execution time t_exec [s]; None means as soon as possible: now, or the end of the plan when offline."""
    speed: float = 1.0
    """Share v of the nominal speeds, in (0, 1]. The paper's v = 0 would never arrive, so it is refused."""
    motion: Motion = Motion.JOINT
    profile: Profile = Profile.PARABOLIC
    insertion: Insertion = Insertion.SPLICE

    def __post_init__(self) -> None:
        if not isinstance(self.target, (JointTarget, PoseTarget)):
            raise InvalidValueError("target", self.target, "a JointTarget or a PoseTarget")
        _check_stamps(self)
        speed = finite("speed", self.speed, "a number in (0, 1]")
        if not 1e-3 <= speed <= 1:
            raise InvalidValueError("speed", self.speed, "a number in (0, 1], at least 0.001 so that it arrives")
        object.__setattr__(self, "speed", speed)
        for name, kind in (("motion", Motion), ("profile", Profile), ("insertion", Insertion)):
            value = getattr(self, name)
            try:
                object.__setattr__(self, name, kind(value))
            except ValueError:
                words = ", ".join(str(item) for item in kind)
                raise InvalidValueError(name, value, f"one of {words}") from None


@dataclass(frozen=True, slots=True)
class PositionQuery:
    """Ask for the position at time t: g of eq. (4)."""

    t: float | None = None
    """Timeline time [s]; None means now (offline: the end of the plan)."""

    def __post_init__(self) -> None:
        if self.t is not None:
            object.__setattr__(self, "t", finite("t", self.t, "None or finite seconds"))


@dataclass(frozen=True, slots=True)
class ParameterChange:
    """Change an internal simulation parameter; `Engine.parameters` names them."""

    name: str
    value: Any


@dataclass(frozen=True, slots=True)
class DriveCommand:
    """Drive a mobile robot on an arc at constant speeds."""

    v: float
    """Linear speed [m/s], forward positive."""
    w: float
    """Angular speed [rad/s], to the left positive."""
    duration: float
    """[s], positive."""
    issued_at: float | None = None
    """Issue time t_iss [s]; None is stamped by whoever registers the command."""
    execute_at: float | None = None
    """Execution time t_exec [s]; None means as soon as possible."""

    def __post_init__(self) -> None:
        for name in ("v", "w", "duration"):
            object.__setattr__(self, name, finite(name, getattr(self, name)))
        if self.duration <= 0:
            raise InvalidValueError("duration", self.duration, "positive seconds")
        _check_stamps(self)


def _check_stamps(command: MotionCommand | DriveCommand) -> None:
    for name in ("issued_at", "execute_at"):
        value = getattr(command, name)
        if value is not None:
            stamp = finite(name, value, "None or finite seconds")
            if abs(stamp) > 1e9:
                raise InvalidValueError(name, value, "within ±1e9 s: times count from the session's origin")
            object.__setattr__(command, name, stamp)


Command: TypeAlias = MotionCommand | DriveCommand | PositionQuery | ParameterChange


@dataclass(frozen=True, slots=True, eq=False)
class Position:
    """Answer to a position query."""

    t: float
    """Timeline time the answer is for [s]."""
    q: Array
    """Joint values [rad], (n,)."""
    X: Array
    """Pose of the last link in the base frame, (4, 4)."""


@dataclass(frozen=True, slots=True, eq=False)
class Receipt:
    """What became of a motion command; it belongs to one version of the timeline."""

    command_id: int
    """Id of the command, from 1; rejected commands have one too."""
    status: Status
    issued_at: float | None
    """Issue time [s]; None where none was given to an offline engine."""
    asked_at: float | None
    """Execution time that was asked for [s]; None where none was."""
    execute_at: float | None = None
    """Start of the motion [s]; None when rejected."""
    end: float | None = None
    """Arrival [s]; None when rejected."""
    q: Array | None = None
    """Joints of the target [rad], (n,), poses resolved; None when rejected."""
    reason: str = ""
    """Why it was postponed or rejected, or what else the user must know."""
    version: int = 0
    """Version of the timeline that the command made, or left when rejected."""
    shifted: tuple[int, ...] = ()
    """Ids of commands whose moves now come later."""
    shift: float = 0.0
    """Δ by which they were shifted [s]."""
    superseded: tuple[int, ...] = ()
    """Ids of commands that will not arrive any more, wholly or in part."""
    superseded_by: int | None = None
    """Id of the later command that cut this one short or dropped it; None while it stands."""
    undone: bool = False
    """Whether it was taken back."""
