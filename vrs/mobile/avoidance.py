"""Obstacle avoidance of the virtual robot: never into an occupied cell, and past it where there's a way.

Two parts. The **direction** is a vector field histogram in simple form: rays around the robot make sectors, blocked
ones are widened by the robot's radius, and the free sector nearest to where the operator steers, at most a quarter
turn aside, is taken. The **guard** lets a command pass only if the arc that it drives in its period, with the
braking after it on the same arc, keeps the robot's circle out of every occupied cell; else the robot brakes on the
arc that it's on, which was free when the command before passed. So in cells that stay as they are the robot never
enters an occupied one, by induction, if it begins at rest or on such an arc.

Source: Borenstein, Koren, "The vector field histogram", IEEE J. Robot. Automat. 7(3), 1991, which Han et al., 2001,
section 3 point to.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import asin, ceil, copysign, pi
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from vrs.checks import positive, validated, within
from vrs.mobile.environment import Grid, cast
from vrs.mobile.model import DriveLimits, braking, clipped, limited, on_arcs, wrapped
from vrs.model import Array

_Posture = tuple[float, float, float]
_Speeds = tuple[float, float]

_STANDING: _Speeds = (0.0, 0.0)

_SAMPLES = 8
"""Places on an arc that are looked at, at least."""

_TOUCH = 1e-9
"""A distance [m] that's only rounding."""


@dataclass(frozen=True, slots=True)
@validated
class Avoidance:
    """What keeps the virtual robot out of occupied cells: a function of where it is and what is asked."""

    limits: DriveLimits
    """Limits of its commands."""
    radius: Annotated[float, positive()]
    """Of the circle about the reference point that must stay free [m]; the robot's own, with whatever margin."""
    period: Annotated[float, positive()] = 0.1
    """T: time between commands [s]."""
    sectors: Annotated[int, within(8, 100_000)] = 72
    """Directions that are looked in, all around: 5 deg each, as in the source."""
    notice: Annotated[float, positive()] = 1.0
    """How far ahead a sector must be free, beyond the radius, not to count as blocked [m]."""
    look_ahead: Annotated[float, positive()] = 1.0
    """Time after which the operator's arc shows where it is to go [s]."""
    gain: Annotated[float, positive()] = 2.0
    """Angular speed for each radian between the robot's direction and the one that's taken [1/s]."""
    shares: Annotated[int, within(1, 1000)] = 4
    """Slower commands on the same arc that are tried before it brakes."""

    def command(
        self,
        asked: _Speeds,
        before: _Speeds,
        posture: _Posture,
        grid: Grid,
        occupied: NDArray[np.bool_],
    ) -> _Speeds:
        """The command for the next period.

        Args:
            asked: What the operator asks for, v [m/s] and ω [rad/s].
            before: The command that is being executed.
            posture: Where the robot will be when this one begins, (x, y, θ).
            grid: The cells.
            occupied: Which are, (m, n).

        Returns:
            v and ω, within the limits and their rates from `before` on; where it isn't safe otherwise, the first of
            the commands that brake along the present arc.
        """
        if not len(self._within(self.radius + max(self.notice, self._way()) + grid.cell, posture, grid, occupied)):
            return limited(asked, before, self.period, self.limits)
        wanted = [asked]
        steered = self._steered(asked, posture, grid, occupied)
        if steered != asked:
            wanted = [steered, (0.0, steered[1])]
        near = self._near(posture, grid, occupied)
        for v, w in wanted:
            for k in range(self.shares, 0, -1):
                share = k / self.shares
                u = limited((v * share, w * share), before, self.period, self.limits)
                if self.is_safe(u, posture, near, grid.cell):
                    return u
        # What was checked for the command before: the same arc, braking.
        steps = braking(before, self.period, self.limits)
        return steps[0] if steps else _STANDING

    def is_safe(self, u: _Speeds, posture: _Posture, corners: Array, cell: float) -> bool:
        """Whether the robot, on a command for its period and then braking along the same arc, stays free.

        Args:
            u: v [m/s] and ω [rad/s].
            posture: At the start of the command.
            corners: Lower left corners of the occupied cells that it may reach [m], (k, 2).
            cell: Side of a cell [m].
        """
        if u[0] == 0.0 or not len(corners):
            return True
        # On one arc, braking goes on as the command would at full speed for a shorter time.
        stairs = braking(u, self.period, self.limits)
        lasting = self.period * (1.0 + sum(v / u[0] for v, _ in stairs))
        count = max(ceil(abs(u[0]) * lasting / (0.25 * cell)), _SAMPLES)
        times = np.linspace(0.0, lasting, count + 1)
        row = np.broadcast_to(np.array([*posture, *u]), (len(times), 5))
        points = on_arcs(row, times)[:, None, :2]
        gap = np.sqrt((np.maximum(np.maximum(corners - points, points - (corners + cell)), 0.0) ** 2).sum(-1))
        # Between two samples a step apart, the robot is no nearer than this.
        least = 0.5 * (gap[:-1] + gap[1:] - abs(u[0]) * lasting / count)
        # A cell that appeared under the robot lets it go, not come nearer.
        under = gap[0] <= self.radius
        return bool((under | (least > self.radius)).all() and (~under | (gap >= gap[0] - _TOUCH)).all())

    def _near(self, posture: _Posture, grid: Grid, occupied: NDArray[np.bool_]) -> Array:
        """Corners of the occupied cells that the robot could touch before it stands, (k, 2)."""
        cells = self._within(self.radius + self._way() + grid.cell, posture, grid, occupied)
        return grid.corners(cells)

    def _way(self) -> float:
        """How far the robot goes at most before it stands [m]."""
        return self.limits.braking_distance(self.limits.v_max, 2 * self.period)

    def _within(
        self, reach: float, posture: _Posture, grid: Grid, occupied: NDArray[np.bool_]
    ) -> NDArray[np.int64]:
        """The occupied cells in a square round the robot of twice a reach [m], (k, 2)."""
        span = grid.index([[posture[0] - reach, posture[1] - reach], [posture[0] + reach, posture[1] + reach]])
        (m, n), (m_end, n_end) = np.clip(np.add(span, ((0, 0), (1, 1))), 0, grid.shape).tolist()
        return np.add(np.argwhere(occupied[m:m_end, n:n_end]), (m, n))

    def _steered(self, asked: _Speeds, posture: _Posture, grid: Grid, occupied: NDArray[np.bool_]) -> _Speeds:
        """What is asked for, or where its direction is blocked, towards the nearest that is free."""
        v, w = asked
        if v == 0.0:
            return asked
        forward = posture[2] + (pi if v < 0 else 0.0)
        bend = clipped(0.5 * w * self.look_ahead, 0.5 * pi)
        width = 2 * pi / self.sectors
        offsets = width * (np.arange(self.sectors) - self.sectors // 2)
        reach = self.radius + self.notice
        distances = cast(grid, occupied, posture[:2], forward + offsets, reach)
        blocked = np.zeros(self.sectors, bool)
        for k in np.flatnonzero(distances < reach).tolist():
            half = asin(min(1.0, self.radius / max(distances[k], self.radius)))
            wide = ceil(half / width)
            blocked[np.arange(k - wide, k + wide + 1) % self.sectors] = True
        place = round(bend / width) + self.sectors // 2
        if not blocked[place % self.sectors] or blocked.all():
            return asked
        free = np.flatnonzero(~blocked)
        turns = np.array([abs(wrapped(offsets[k] - bend)) for k in free.tolist()])
        if turns.min() > 0.5 * pi:
            # In a dead end it stops: to turn back is for the operator to ask.
            return asked
        # Of two as near, the one to the left: a rule that doesn't hesitate.
        best = int(free[np.flatnonzero(turns <= turns.min() + 1e-9)[-1]])
        aside = wrapped(float(offsets[best]))
        turn = clipped(self.gain * aside, self.limits.w_max)
        slowed = v * max(0.0, 1.0 - abs(aside) / (0.5 * pi))
        return (slowed if abs(slowed) > 1e-3 else copysign(0.0, v)), turn
