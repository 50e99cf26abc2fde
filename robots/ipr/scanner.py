"""The simulated laser scanner: each beam goes from where the robot is when it's that beam's turn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robots.onboard.laser import LaserModel, LaserScan
from vrs.model import Array, frozen_array

Cast = Callable[[Array, Array], Array]
"""How far rays go [m] from origins (k, 2) in directions (k, 2), inf where nothing is within reach."""
_MILLIMETRE = 1e-3


class LaserScanner:
    """Sweeps beam by beam while its robot goes on step by step."""

    def __init__(self, model: LaserModel, rng: np.random.Generator) -> None:
        """Take the model and what noise is drawn from."""
        self.model, self._rng = model, rng
        self._angles = model.angles
        self._next = model.beams
        """The beam whose turn is next."""
        self._exact = np.full(model.beams, np.inf)
        self._start = 0.0
        self.newest: LaserScan | None = None
        """The last whole sweep."""

    @property
    def sweeping(self) -> bool:
        """Whether a sweep is going on."""
        return self._next < self.model.beams

    def begin(self, time: float) -> None:
        """Begin a sweep [s]."""
        self._start, self._next = time, 0
        self._exact = np.full(self.model.beams, np.inf)

    def go_on(
        self,
        before: tuple[float, float, float],
        after: tuple[float, float, float],
        times: tuple[float, float],
        cast: Cast,
    ) -> None:
        """Sweep while the robot goes from one posture to another.

        Args:
            before: True posture at the first time, θ counted on.
            after: And at the second.
            times: Both [s].
            cast: Measures rays at the second time.
        """
        model, (begin, end) = self.model, times
        pause = model.sweep / (model.beams - 1)
        last = model.beams
        if pause > 0:
            last = min(last, int((end - self._start) / pause + 1e-6) + 1)
        turn = np.arange(self._next, last)
        self._next = max(self._next, last)
        share = np.clip((self._start + pause * turn - begin) / (end - begin) if end > begin else 0.0 * turn, 0, 1)
        x, y, theta = (a + share * (b - a) for a, b in zip(before, after, strict=True))
        origins = np.column_stack([x + model.forward * np.cos(theta), y + model.forward * np.sin(theta)])
        ways = theta + self._angles[turn]
        if len(turn):
            self._exact[turn] = cast(origins, np.column_stack([np.cos(ways), np.sin(ways)]))
        if not self.sweeping:
            self._finish()

    def _finish(self) -> None:
        model = self.model
        noise = model.noise * self._rng.standard_normal(model.beams)
        lost = self._rng.random(model.beams) < model.dropouts
        noisy = np.where(np.isfinite(self._exact), self._exact, 0.0) + noise
        seen = np.isfinite(self._exact) & ~lost & (noisy <= model.reach)
        told = np.maximum(np.round(noisy / _MILLIMETRE) * _MILLIMETRE, 0.0)
        ranges = frozen_array(np.where(seen, told, np.inf))
        self.newest = LaserScan(self._start, ranges, model.sweep, model.forward)
