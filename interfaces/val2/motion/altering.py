"""ALTER: corrections from outside, as steering."""

from __future__ import annotations

from typing import Final

import numpy as np

from interfaces.val2.errors import ValError
from interfaces.val2.motion.places import AXES, Frames
from vrs.commands import Frame, SteerCommand

PERIOD: Final = 0.028
"""Time in which a correction is made [s], as in VAL-II."""
CUMULATIVE: Final = 1
"""Bit of the mode: each correction adds to those before."""
WORLD: Final = 2
"""Bit of the mode: along the world's axes, not the tool's."""


class Alterations:
    """What ALTOUT asked for since ALTER."""

    def __init__(self) -> None:
        self.mode: int | None = None
        """None while the path isn't altered."""
        self._sum = np.zeros(6)

    def set(self, mode: int | None) -> None:
        """Begin, or end with None."""
        self.mode = mode
        self._sum = np.zeros(6)

    def steering(self, values: tuple[float, ...], frames: Frames) -> SteerCommand:
        """Steer so that a correction is made in one period.

        Args:
            values: X, Y, Z [mm] and turns about x, y, z [deg], of the tool's tip.
            frames: The tool.

        Raises:
            ValError: If the path isn't altered, or the values aren't six finite numbers.
        """
        if self.mode is None:
            raise ValError("Path isn't altered", "ALTER comes first")
        asked = np.array(values, dtype=np.float64)
        if asked.shape != (6,) or not np.isfinite(asked).all():
            raise ValError("Illegal value", "a correction is X, Y, Z [mm] and three turns [deg]")
        step = asked if self.mode & CUMULATIVE else asked - self._sum
        self._sum = self._sum + step
        v, w = step[:3] / 1000.0 / PERIOD, np.radians(step[3:]) / PERIOD
        if self.mode & WORLD:
            return SteerCommand(twist=np.concatenate([AXES @ v, AXES @ w]), frame=Frame.BASE)
        tip = frames.tip()
        v, w = tip[:3, :3] @ v, tip[:3, :3] @ w
        return SteerCommand(twist=np.concatenate([v - np.cross(w, tip[:3, 3]), w]), frame=Frame.TOOL)
