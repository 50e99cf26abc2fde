"""Values of VAL-II. Lengths are millimetres and angles degrees, as everywhere in the language."""

from __future__ import annotations

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
