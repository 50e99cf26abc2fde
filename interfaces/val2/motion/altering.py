"""ALTER: corrections of where the tool stands, each a straight motion by exactly what was asked for."""

from __future__ import annotations

from typing import Final

import numpy as np

from interfaces.val2.errors import ValError
from interfaces.val2.values import Transformation
from vrs.planning.course import rotations

CUMULATIVE: Final = 1
"""Bit of the mode: each correction adds to those before."""
WORLD: Final = 2
"""Bit of the mode: along the axes of BASE, not the tool's."""
MODES: Final = range(4)
_SAME: Final = 1e-6
"""Elements of poses nearer than this are one [mm]."""


class Alterations:
    """Where corrections since ALTER lead."""

    def __init__(self) -> None:
        self.mode: int | None = None
        """None while the path isn't altered."""
        self._nominal: Transformation | None = None
        """Where the tool would be without corrections."""
        self._newest: Transformation | None = None
        """Where the newest correction leads."""

    def set(self, mode: int | None) -> None:
        """Begin, or end with None.

        Raises:
            ValError: If there's no such mode.
        """
        if mode is not None and mode not in MODES:
            detail = f"mode {mode}: {MODES[0]} to {MODES[-1]}; 1 is cumulative, 2 along world axes, 3 both"
            raise ValError("Illegal value", detail)
        self.mode, self._nominal, self._newest = mode, None, None

    def corrected(self, values: tuple[float, ...], destination: Transformation) -> Transformation:
        """The tool's place after a correction.

        Without CUMULATIVE a correction counts from the uncorrected place: where the tool was going before the first
        correction, or since something else has moved it.

        Args:
            values: X, Y, Z [mm], and the turn of the tip: a rotation vector's x, y, z [deg].
            destination: Where the tool goes.

        Raises:
            ValError: If the path isn't altered, or the values aren't six finite numbers.
        """
        if self.mode is None:
            raise ValError("Path isn't altered", "ALTER comes first")
        asked = np.array(values, dtype=np.float64)
        if asked.shape != (6,) or not np.isfinite(asked).all():
            raise ValError("Illegal value", "a correction is X, Y, Z [mm] and three turns [deg]")
        before = self._newest
        if before is None or np.abs(before.X - destination.X).max() > _SAME:
            before = self._nominal = destination
        start = before if self.mode & CUMULATIVE or self._nominal is None else self._nominal
        X, turn = np.array(start.X), rotations(np.radians(asked[None, 3:]))[0]
        if self.mode & WORLD:
            X[:3, :3] = turn @ X[:3, :3]
            X[:3, 3] += asked[:3]
        else:
            X[:3, 3] += X[:3, :3] @ asked[:3]
            X[:3, :3] = X[:3, :3] @ turn
        return Transformation(X)

    def taken(self, place: Transformation) -> None:
        """A correction was asked for that leads to a place."""
        self._newest = place
