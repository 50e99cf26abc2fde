"""Values of VAL-II, and how they stand for poses and joints.

Lengths are millimetres and angles degrees, as everywhere in the language. A dialect says what the three angles of
a transformation are: VAL-II's O, A, T turn it by R = Rz(O - 90) Ry(A + 90) Rz(T), V+'s yaw, pitch, roll by
R = Rz Ry Rz as they are. Values are poses, so that files of both dialects mean what they say beside each other.

What VAL's world, hand and joints are on an arm is told by `motion.conventions`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from vrs.model import Array, frozen_array


@dataclass(frozen=True, slots=True, eq=False)
class Transformation:
    """A pose relative to a frame: a homogeneous transform, translations in mm."""

    X: Array
    """(4, 4), read-only."""

    def __init__(self, X: ArrayLike) -> None:
        object.__setattr__(self, "X", frozen_array(X))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Transformation) and np.array_equal(self.X, other.X)

    def __hash__(self) -> int:
        return hash(self.X.tobytes())

    def __matmul__(self, other: Transformation) -> Transformation:
        return Transformation(self.X @ other.X)

    def inverse(self) -> Transformation:
        """The transformation back."""
        X = np.eye(4)
        X[:3, :3] = self.X[:3, :3].T
        X[:3, 3] = -X[:3, :3] @ self.X[:3, 3]
        return Transformation(X)


@dataclass(frozen=True, slots=True)
class PrecisionPoint:
    """Joint values, with VAL's signs and zeros."""

    joints: tuple[float, ...]
    """[deg], six."""


Location: TypeAlias = Transformation | PrecisionPoint
Value: TypeAlias = float | str | Transformation | PrecisionPoint

NULL: Final = Transformation(np.eye(4))
"""`NULL`: no translation, no turn; O, A, T of it are 90, -90, 0."""
_VERTICAL: Final = 1e-9
"""Sine of the angle between tool and vertical under which O and T can't be told apart."""


def about_x(angle: float) -> Transformation:
    """A turn about the x axis by an angle [deg]."""
    return _turn(angle, 1, 2)


def about_y(angle: float) -> Transformation:
    """A turn about the y axis by an angle [deg]."""
    return _turn(angle, 2, 0)


def about_z(angle: float) -> Transformation:
    """A turn about the z axis by an angle [deg]."""
    return _turn(angle, 0, 1)


def _turn(angle: float, i: int, j: int) -> Transformation:
    c, s = _cos_sin(angle)
    X = np.eye(4)
    X[i, i] = X[j, j] = c
    X[i, j], X[j, i] = -s, s
    return Transformation(X)


def _cos_sin(degrees: float) -> tuple[float, float]:
    """Exact at right angles."""
    quarters, rest = divmod(degrees + 45.0, 90.0)
    angle = math.radians(rest - 45.0)
    c, s = math.cos(angle), math.sin(angle)
    match int(quarters) % 4:
        case 0:
            return c, s
        case 1:
            return -s, c
        case 2:
            return -c, -s
        case _:
            return s, -c


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a dialect writes the turn of a transformation: as Rz Ry Rz by three angles, less its offsets."""

    name: str
    angles: tuple[str, str, str]
    """What its angles are called."""
    offsets: tuple[float, float, float]
    """Its angles of no turn [deg]."""

    def transformation(self, x: float, y: float, z: float, o: float, a: float, t: float) -> Transformation:
        """The transformation of X, Y, Z [mm] and the dialect's three angles [deg]."""
        first, second, third = self.offsets
        (c1, s1), (c2, s2), (c3, s3) = _cos_sin(o - first), _cos_sin(a - second), _cos_sin(t - third)
        return Transformation(
            [
                [c1 * c2 * c3 - s1 * s3, -c1 * c2 * s3 - s1 * c3, c1 * s2, x],
                [s1 * c2 * c3 + c1 * s3, -s1 * c2 * s3 + c1 * c3, s1 * s2, y],
                [-s2 * c3, s2 * s3, c2, z],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )

    def numbers(self, location: Location) -> tuple[float, ...]:
        """The six numbers of a location: joints [deg], or X, Y, Z [mm] and the dialect's angles [deg].

        The first and the third angle are in (-180, 180], the second turns by 0 to 180. Where it turns by either of
        these, the others can't be told apart: the first is that of no turn.
        """
        if isinstance(location, PrecisionPoint):
            return location.joints
        R, (x, y, z) = location.X[:3, :3], location.X[:3, 3].tolist()
        level = math.hypot(R[0, 2], R[1, 2])
        if level < _VERTICAL:
            turns = 0.0, 0.0 if R[2, 2] > 0 else 180.0, math.degrees(math.atan2(R[1, 0], R[1, 1]))
        else:
            o, a = math.atan2(R[1, 2], R[0, 2]), math.atan2(level, R[2, 2])
            turns = math.degrees(o), math.degrees(a), math.degrees(math.atan2(R[2, 1], -R[2, 0]))
        first, second, third = self.offsets
        return x, y, z, _wrapped(turns[0] + first), turns[1] + second, _wrapped(turns[2] + third)


VAL2: Final = Dialect("VAL-II", ("O", "A", "T"), (90.0, -90.0, 0.0))
VPLUS: Final = Dialect("V+", ("y", "p", "r"), (0.0, 0.0, 0.0))
"""Yaw, pitch and roll."""


def _wrapped(degrees: float) -> float:
    """In (-180, 180]."""
    turned = math.remainder(degrees, 360.0)
    return 180.0 if turned == -180.0 else turned + 0.0
