"""Out of the way of what comes: the robot goes where it's least met in the next seconds.

Obstacle avoidance brakes before what stands. Somebody who walks stops for nobody, and is faster than the robot: one
that stands is run into. So the drive that is wanted, and others on either side, forward and in reverse, are played
ahead together with what moves, at constant velocities. If the wanted one keeps its distance it's driven; else the
one that keeps the most. All go only as far as there's room among what stands.

Source: Fiorini, Shiller, "Motion planning in dynamic environments using velocity obstacles", Int. J. Robotics
Research 17(7), 1998, and the dynamic window of Fox, Burgard, Thrun, 1997; with a few drives tried instead of sets.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robots.drive_limits import IPR_LIMITS
from robots.onboard.avoidance import ObstacleAvoidance
from robots.onboard.driving import Drive
from robots.onboard.free_ways import Outline
from robots.onboard.movers import Mover
from vrs.checks import number_in
from vrs.mobile import DriveLimits
from vrs.model import Array

_MORE = 0.15
"""By so much more than its space [m] the wanted drive must keep before the robot leaves off yielding."""
_KEEP = 0.1
"""So much more distance [m] another drive must promise than the one that was chosen last."""
_SOONER = 0.015
"""What a metre of distance is worth less for each step ahead: what is foreseen far ahead is doubtful."""


@dataclass(frozen=True, slots=True)
class YieldingConfig:
    """What the robot is, and how far it looks ahead."""

    outline: Outline
    radius: float = 0.25
    """Of whatever moves [m], in [0, 1]."""
    space: float = 0.7
    """Distance that it keeps from it [m], in [0, 2]."""
    doubt: float = 1.5
    """So many deviations to either side of its way it may go, in [0, 10]."""
    horizon: float = 5.0
    """How far ahead it looks [s], in [0.2, 20]."""
    step: float = 0.2
    """Between two places that are looked at [s], in [0.01, 1]."""
    limits: DriveLimits = IPR_LIMITS
    """Of the robot."""

    def __post_init__(self) -> None:
        for name, low, high in (
            ("radius", 0.0, 1.0), ("space", 0.0, 2.0), ("doubt", 0.0, 10.0), ("horizon", 0.2, 20.0),
            ("step", 0.01, 1.0),
        ):  # fmt: skip
            number_in(name, getattr(self, name), low, high)


class Yielding:
    """Changes what the robot is told to drive where somebody comes; it knows no clock."""

    def __init__(self, config: YieldingConfig, avoidance: ObstacleAvoidance) -> None:
        """Take what knows where there's room."""
        self._config, self._avoidance = config, avoidance
        limits = config.limits
        self._others = [
            Drive(a * limits.v_max, b * limits.w_max)
            for a in (-1.0, -0.6, 0.0, 0.6, 1.0)
            for b in (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0)
        ]
        self._times = np.arange(1, round(config.horizon / config.step) + 1) * config.step
        self._chosen: Drive | None = None
        self.acts = False
        """Whether the last drive isn't what was wanted."""

    def drive(
        self,
        wanted: Drive,
        movers: Sequence[Mover],
        posture: tuple[float, float, float],
        *,
        now: float,
        v_before: float,
    ) -> Drive:
        """Say what to drive until the next call.

        Args:
            wanted: What would be driven if nobody came.
            movers: What moves, where it is now.
            posture: Where the robot is, (x, y, θ) [m, m, rad].
            now: Time [s].
            v_before: Linear speed that it was told to drive last [m/s].
        """
        self.acts = False
        if not movers:
            self._chosen = None
            return wanted
        drives = [wanted, *self._others]
        gaps = self._gaps(drives, movers, posture, now, v_before)
        if gaps[0] >= self._config.space + (_MORE if self._chosen is not None else 0.0):
            self._chosen = None
            return wanted
        worth = np.minimum(gaps, self._config.space + 2 * _MORE)
        if self._chosen is not None:
            worth[drives.index(self._chosen)] += _KEEP
        best = int(np.argmax(worth))
        if worth[best] <= worth[0] + 0.02:
            self._chosen = None
            return wanted
        self._chosen, self.acts = drives[best], True
        return self._avoidance.slowed(drives[best], posture, now=now, v_before=v_before)

    def _supposed(self, mover: Mover) -> list[tuple[float, float]]:
        """How it may move [m/s]: as it's thought to, and to either side as far as that's doubtful."""
        vx, vy = mover.vx, mover.vy
        share = self._config.doubt * mover.across / max(math.hypot(vx, vy), 1e-9)
        return [(vx - side * vy, vy + side * vx) for side in ((0.0, share, -share) if share else (0.0,))]

    def _gaps(
        self,
        drives: Sequence[Drive],
        movers: Sequence[Mover],
        posture: tuple[float, float, float],
        now: float,
        v_before: float,
    ) -> Array:
        """Least distance between outline and movers that each drive leads to [m], (n,)."""
        config, steps = self._config, len(self._times)
        v, w = np.array(drives).T
        ways = self._avoidance.free_ways(posture, v, w, now=now)
        # The speed follows along its ramp; where there's no more room it stands, and doesn't turn.
        t = self._times
        ramp = np.abs(v - v_before) / config.limits.a_max
        grown = np.minimum(t, ramp[:, None])
        s = v[:, None] * t + (v_before - v)[:, None] * (grown - 0.5 * grown**2 / np.maximum(ramp, 1e-9)[:, None])
        turns = np.abs(v) < 1e-9
        s = np.clip(s, -ways[:, None], ways[:, None])
        k = np.where(turns, 0.0, w / np.where(turns, 1.0, v))
        turned = np.where(turns[:, None], w[:, None] * t, k[:, None] * s)
        half = 0.5 * turned
        chord = s * np.sinc(half / math.pi)
        x, y, theta = posture
        px, py, heading = x + chord * np.cos(theta + half), y + chord * np.sin(theta + half), theta + turned
        # Then it stands: who runs away along the way of somebody quicker is only met later.
        last = np.minimum(np.arange(2 * steps), steps - 1)
        px, py, heading = px[:, last], py[:, last], heading[:, last]
        t = config.step * np.arange(1, 2 * steps + 1)
        cos, sin = np.cos(heading), np.sin(heading)
        outline = config.outline
        least = np.full(len(v), np.inf)
        for mover, vx, vy in [(one, *speeds) for one in movers for speeds in self._supposed(one)]:
            dx, dy = mover.x + vx * t - px, mover.y + vy * t - py
            ahead, aside = cos * dx + sin * dy, np.abs(cos * dy - sin * dx)
            beyond = np.hypot(
                np.maximum(np.maximum(ahead - outline.front, -outline.rear - ahead), 0.0),
                np.maximum(aside - outline.half_width, 0.0),
            )
            inside = np.hypot(dx, dy) * 1e-3
            gap = np.where(beyond > 0, beyond, inside - 0.1) - config.radius
            least = np.minimum(least, (gap + _SOONER * np.arange(len(t))).min(axis=1))
        return least
