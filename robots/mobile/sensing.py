"""What a mobile robot senses: sonars, an overhead camera, and a laser scanner.

Each beam of the scanner goes from where the robot is when it's that beam's turn.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robots.mobile.chassis import CameraModel, Chassis, SonarModel
from robots.mobile.drive_train import standard_normals
from robots.onboard.laser import LaserModel, LaserScan
from vrs.mobile.model import placed, turned
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


_MOST_WAITING = 512
"""Pictures that are kept, more than 240 a second for 2 s; the oldest that nobody asked for are dropped."""


@dataclass(frozen=True, slots=True, eq=False)
class SonarScan:
    """One reading of all sonars."""

    time: float
    """When it was taken [s]."""
    ranges: Array
    """From the body's surface [m], (16,), counter-clockwise from straight ahead; inf without an echo."""


@dataclass(frozen=True, slots=True, eq=False)
class Fix:
    """A posture that somebody measured."""

    time: float
    """When it was so [s]."""
    posture: Array
    """x, y [m], heading [rad], (3,)."""


class SonarRing:
    """Sonars evenly around a body, each a fan of rays; the shortest way is its range."""

    def __init__(self, chassis: Chassis, model: SonarModel, rng: np.random.Generator) -> None:
        """Place the sonars where lines from the body's middle leave its outline."""
        self.model, self._rng = model, rng
        self._near, self.reach = chassis.sonar_reach
        self.angles = frozen_array(np.arange(chassis.sonars) * (math.tau / chassis.sonars))
        """Where each looks [rad], (16,), in the robot's frame."""
        half_x, half_y = chassis.length / 2, chassis.width / 2
        c, s = np.cos(self.angles), np.sin(self.angles)
        with np.errstate(divide="ignore"):
            out = np.minimum(half_x / np.abs(c), half_y / np.abs(s))
        self.places = frozen_array(np.column_stack([chassis.centre_x + out * c, out * s]))
        """Where each sits [m], (16, 2), in the robot's frame."""
        spread = np.linspace(-1.0, 1.0, model.rays) * model.half_angle if model.rays > 1 else np.zeros(1)
        ways = (self.angles[:, None] + spread).ravel()
        self._origins = np.repeat(self.places, model.rays, axis=0)
        self._ways = np.column_stack([np.cos(ways), np.sin(ways)])

    def rays(self, posture: tuple[float, float, float]) -> tuple[Array, Array]:
        """Return where rays begin [m] and their unit vectors, (16 × rays, 2) each, in the world frame."""
        return placed(self._origins, posture), turned(self._ways, posture[2])

    def scan(self, distances: Array, time: float) -> SonarScan:
        """Make a scan of the rays' exact distances, (16 × rays,), inf where nothing was met."""
        model, count = self.model, len(self.angles)
        exact = distances.reshape(count, model.rays).min(axis=1)
        noise = self._rng.standard_normal(count)
        lost = self._rng.random(count) < model.misses
        seen = np.isfinite(exact)
        at = np.where(seen, exact, 0.0)
        noisy = at + noise * np.hypot(model.noise, model.noise_share * at)
        kept = seen & ~lost & (noisy <= self.reach)
        return SonarScan(time, frozen_array(np.where(kept, np.maximum(noisy, self._near), np.inf)))


class OverheadCamera:
    """Takes pictures at its rate and tells their postures a latency later."""

    def __init__(self, model: CameraModel, rng: np.random.Generator) -> None:
        """Begin without a picture."""
        self.model, self._normal = model, standard_normals(rng).__next__
        self._waiting: deque[tuple[float, float, float, float]] = deque(maxlen=_MOST_WAITING)
        self._newest: Fix | None = None

    def look(self, posture: tuple[float, float, float], time: float) -> None:
        """Take a picture of the true posture."""
        take, noise, turn = self._normal, self.model.noise, self.model.noise_angle
        x, y, theta = posture
        self._waiting.append((time, x + noise * take(), y + noise * take(), theta + turn * take()))

    def newest(self, now: float) -> Fix | None:
        """Return the newest posture that is known at a time, None before the first."""
        found = None
        while self._waiting and self._waiting[0][0] + self.model.latency <= now + 1e-9:
            found = self._waiting.popleft()
        if found is not None:
            self._newest = Fix(found[0], frozen_array(found[1:]))
        return self._newest
