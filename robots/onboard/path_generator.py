"""The path generator: restores the moving path of the virtual robot from its commands.

Source: Han, Kim, Kim, Kim, section 3.1; the exact arcs are their eq. (4)–(5).
"""

from __future__ import annotations

from dataclasses import dataclass

from robots.onboard.driving import Posture
from robots.onboard.path import Arc, MovingPath, Pivot
from vrs.checks import number_in
from vrs.mobile import advanced


@dataclass(frozen=True, slots=True)
class PathGeneratorConfig:
    """How commands become pieces of a path."""

    period: float = 0.1
    """T, how long each command was driven by the virtual robot [s], in [1e-4, 60]."""
    pivot_radius: float = 1e-3
    """Arcs of a smaller radius [m] are driven as turns on the spot, in [0, 0.1]; their ends stay exact."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "period", number_in("period", self.period, 1e-4, 60.0, unit=" s"))
        radius = number_in("pivot_radius", self.pivot_radius, 0.0, 0.1, unit=" m")
        object.__setattr__(self, "pivot_radius", radius)


class PathGenerator:
    """Adds to a path what each command adds to the virtual robot's."""

    def __init__(self, path: MovingPath, config: PathGeneratorConfig | None = None) -> None:
        """Take the path; the virtual robot is at its end."""
        self._path = path
        self._config = PathGeneratorConfig() if config is None else config
        self._posture = path.end

    @property
    def posture(self) -> Posture:
        """Where the virtual robot is after the last command."""
        return self._posture

    def receive(self, v: float, w: float, *, duration: float | None = None) -> bool:
        """Add a command.

        Args:
            v: Linear speed [m/s].
            w: Angular speed [rad/s].
            duration: How long it was driven [s]; by default the period.

        Returns:
            Whether the path had room; if not, neither it nor the virtual robot's posture has changed, and what
            follows would begin elsewhere: stop, and begin a new path.

        Raises:
            InvalidValueError: If a value isn't finite, or a time isn't positive.
        """
        v = number_in("v", v, -100.0, 100.0, unit=" m/s")
        w = number_in("w", w, -1000.0, 1000.0, unit=" rad/s")
        T = self._config.period if duration is None else number_in("duration", duration, 1e-9, 86_400.0, unit=" s")
        if v == 0.0 and w == 0.0:
            return True
        posture = Posture(*advanced(self._posture, v, w, T))
        if abs(v) <= self._config.pivot_radius * abs(w):
            # Where |v| is tiny, w·T may be 0 in floating point only if w is.
            taken = self._path.append(Pivot(w * T), end=posture) if w * T else True
        else:
            length = abs(v) * T
            taken = self._path.append(Arc(w / abs(v), length, 1 if v > 0 else -1), end=posture) if length else True
        if taken:
            self._posture = posture
        return taken
