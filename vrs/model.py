"""What a robot must be for the engine: kinematics, limits, named poses."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vrs.errors import InvalidValueError, OutOfLimitsError

Array = NDArray[np.float64]


def frozen_array(values: ArrayLike) -> Array:
    """Copy values into a read-only float64 array."""
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


def unit_of(joint: int, prismatic: Collection[int]) -> str:
    """Unit of a joint's position, counted from 0: `m` of a prismatic one, else `rad`."""
    return "m" if joint in prismatic else "rad"


def for_people(joint: int, value: float, prismatic: Collection[int]) -> tuple[float, str]:
    """A joint's position, or what it's off by, as people are told it: in metres, or in degrees."""
    return (value, "m") if joint in prismatic else (math.degrees(value), "deg")


@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Joint limits, each of shape (n,); of prismatic joints in m for rad."""

    q_min: Array
    """Lowest position [rad]."""
    q_max: Array
    """Highest position [rad], above q_min."""
    qd_max: Array
    """Largest speed [rad/s], positive."""
    qdd_max: Array
    """Largest acceleration [rad/s²], positive."""
    qddd_max: Array = field(default_factory=lambda: np.empty(0))
    """Largest jerk [rad/s³], positive; qdd_max / 0.1 s unless given (an assumption)."""

    def __post_init__(self) -> None:
        if np.size(self.qddd_max) == 0:
            object.__setattr__(self, "qddd_max", np.asarray(self.qdd_max, dtype=np.float64) / 0.1)
        shape = np.shape(self.q_min)
        for item in fields(self):
            value = frozen_array(getattr(self, item.name))
            if value.ndim != 1 or value.shape != shape or not np.isfinite(value).all():
                raise InvalidValueError(item.name, getattr(self, item.name), f"finite, of shape {shape}")
            object.__setattr__(self, item.name, value)
        if not (self.q_min < self.q_max).all():
            raise InvalidValueError("q_max", self.q_max, f"above q_min = {self.q_min}")
        for name in ("qd_max", "qdd_max", "qddd_max"):
            if not (getattr(self, name) > 0).all():
                raise InvalidValueError(name, getattr(self, name), "positive")

    @property
    def dof(self) -> int:
        """Number of joints, n."""
        return len(self.q_min)

    def check(self, q: Array, prismatic: Collection[int] = ()) -> None:
        """Raise OutOfLimitsError unless q, (n,) [rad], of prismatic joints [m], lies within the position limits."""
        # Of few numbers, plain floats are several times quicker than arrays.
        joints = zip(q.tolist(), self.q_min.tolist(), self.q_max.tolist(), strict=True)
        for j, (value, low, high) in enumerate(joints):
            if not low <= value <= high:
                raise OutOfLimitsError(j, value, low, high, unit_of(j, prismatic))


@runtime_checkable
class RobotModel(Protocol):
    """Kinematics and limits of an arm of n joints. Poses are of the last link in the base frame."""

    @property
    def name(self) -> str:
        """Short name, as in `robots.<name>`."""

    @property
    def limits(self) -> Limits:
        """Joint limits."""

    @property
    def prismatic(self) -> Collection[int]:
        """Joints that move along their axes, counted from 0: their values are in m where others' are in rad."""

    @property
    def poses(self) -> Mapping[str, Array]:
        """Named joint positions, each (n,) [rad]."""

    @property
    def tool_speed(self) -> float:
        """Nominal linear speed of the tool [m/s]."""

    @property
    def tool_turn_speed(self) -> float:
        """Nominal angular speed of the tool [rad/s]."""

    @property
    def characteristic_length(self) -> float:
        """Length [m] by which linear rows of the Jacobian are divided before its condition number is taken."""

    def forward(self, q: ArrayLike) -> Array:
        """Pose of the last link, (4, 4), or (k, 4, 4) for q of shape (k, n)."""

    def links(self, q: ArrayLike) -> Array:
        """Poses of base and links, (n + 1, 4, 4), or (k, n + 1, 4, 4) for q of shape (k, n)."""

    def jacobian(self, q: ArrayLike) -> Array:
        """Geometric Jacobian in the base frame, linear rows, then angular rows.

        (6, n), or (k, 6, n) for q of shape (k, n).
        """

    def inverse(self, X: ArrayLike, within_limits: bool = True) -> Array:
        """Every joint solution of one pose, (m, n), some where there's no end of them; m is 0 where none exists."""

    def inverse_near(self, X: ArrayLike, q: ArrayLike, configuration: str | None = None) -> Array:
        """The solution within limits nearest to q, (n,), of the asked configuration, else of q's own first.

        Raises:
            UnreachablePoseError: If no solution exists within the limits.
        """

    def follow(self, X: ArrayLike, q: ArrayLike, configuration: str | None = None) -> Array:
        """Inverse kinematics along a path: solutions of poses in a row, (k, 4, 4), that go on from q, (n,).

        They keep q's configuration, or that which is asked for, and no joint jumps; position limits aren't
        considered. (k, n), NaN from the first pose on that isn't reached. At a pose that leaves joints free,
        they may be anything. Those of an arm of more than six joints depend on the pose and q alone, not on the
        poses between; its q may be (2, n), the second row joint values to arrive at.
        """

    def configuration(self, q: ArrayLike) -> str:
        """Name of the arm configuration at q, for example `RIGHTY ABOVE NOFLIP`."""


def home(model: RobotModel) -> Array:
    """Where an arm stands unless told otherwise, (n,): its pose `nominal`, or amid its joints' ranges."""
    found = model.poses.get("nominal")
    return frozen_array(0.5 * (model.limits.q_min + model.limits.q_max) if found is None else found)
