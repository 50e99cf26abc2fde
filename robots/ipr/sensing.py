"""What a mobile robot senses: sonars, and an overhead camera."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from robots.ipr.chassis import CameraModel, Chassis, SonarModel
from robots.ipr.drive_train import Draws
from vrs.model import Array, frozen_array

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
        x, y, theta = posture
        c, s = math.cos(theta), math.sin(theta)
        turn = np.array([[c, s], [-s, c]])
        return self._origins @ turn + (x, y), self._ways @ turn

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
        self.model, self._draws = model, Draws(rng)
        self._waiting: deque[tuple[float, float, float, float]] = deque(maxlen=_MOST_WAITING)
        self._newest: Fix | None = None

    def look(self, posture: tuple[float, float, float], time: float) -> None:
        """Take a picture of the true posture."""
        take, noise, turn = self._draws.take, self.model.noise, self.model.noise_angle
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
