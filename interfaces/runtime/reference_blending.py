"""Going over onto references that came late, within the limits.

An arm in motion followed what it had until they came, so they begin elsewhere than it is. Each joint turns onto
them: at each tick it takes the speed at which it could still brake relative to them, as far as its own limits let
it. Where the references need all of its acceleration themselves, it waits until they don't.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from vrs.model import Array, Limits

BEGIN = 0.05
"""Two motions that were one until so long ago [s], at most, can be merged."""
ASTRAY = 0.15
"""On the way a joint may get as far from its references as twice its acceleration brings it in so long [s]."""
_SHARE = 1.0
"""Twice the share of the acceleration that's left with which a joint counts for coming to rest beside them."""
_PACE = 8.0
"""Share of what is left that it takes off at most [1/s]: the references may turn away meanwhile."""
_LITTLE = 1e-3
"""What is left is little [rad]."""
_SOFT = 4.0
"""In so many ticks it takes off what is left, where that's little."""
_SAME = 1e-11
"""Positions nearer than this [rad] are one: their change in a tick is a speed."""


class ReferenceBlending:
    """Brings joints onto their references, a tick at a time."""

    def __init__(self, limits: Limits, tick: float) -> None:
        """Keep to limits, in ticks of a length [s]."""
        self._tick = tick
        self._speeds, self._accelerations = limits.qd_max.tolist(), limits.qdd_max.tolist()
        self._low, self._high = limits.q_min.tolist(), limits.q_max.tolist()

    def near(self, q: Sequence[float], qd: Sequence[float], row: Array, *, begun: bool) -> bool:
        """Whether references, (3, n), can be gone over to from positions [rad] and speeds [rad/s].

        Args:
            q: Positions, a tick before.
            qd: Speeds.
            row: The references.
            begun: Whether the arm is on the way to them.
        """
        far, fast = (ASTRAY, math.inf) if begun else (BEGIN, BEGIN)
        return all(
            abs(b - a) <= most * far**2 and abs(w - v) <= 2.0 * most * fast
            for a, v, b, w, most in zip(q, qd, *row[:2].tolist(), self._accelerations, strict=True)
        )

    def there(self, q: Sequence[float], qd: Sequence[float], row: Array) -> bool:
        """Whether references, (3, n), go on from the positions [rad] and speeds [rad/s] of the tick before."""
        h = self._tick
        return all(
            abs(a + 0.5 * h * (v + w) - b) <= _SAME and abs(w - v) <= acceleration * h + _SAME
            for a, v, b, w, acceleration in zip(q, qd, *row[:2].tolist(), self._accelerations, strict=True)
        )

    def step(self, q: Sequence[float], qd: Sequence[float], row: Array) -> tuple[list[float], list[float]]:
        """Positions [rad] and speeds [rad/s] of the next tick, whose references are a row, (3, n)."""
        h, positions, speeds = self._tick, [], []
        bounds = zip(self._speeds, self._accelerations, self._low, self._high, strict=True)
        for a, v, b, w, g, (fastest, most, low, high) in zip(q, qd, *row.tolist(), bounds, strict=True):
            ahead = a + 0.5 * h * (v + w) - b
            # What the references take of the acceleration isn't there for coming to rest beside them.
            left = max(most - math.copysign(g, ahead * g), 0.0)
            pace = _PACE if abs(ahead) > _LITTLE else 1.0 / (_SOFT * h)
            wanted = w - math.copysign(min(abs(ahead) * pace, math.sqrt(_SHARE * left * abs(ahead))), ahead)
            up, down = self._stoppable(high - a, v, most), self._stoppable(a - low, -v, most)
            wanted = min(max(wanted, -fastest, -down), fastest, up)
            new = min(max(wanted, v - most * h), v + most * h)
            positions.append(a + 0.5 * h * (v + new))
            speeds.append(new)
        return positions, speeds

    def _stoppable(self, room: float, v: float, most: float) -> float:
        """The speed [rad/s] of the next tick with which a joint can still stop before an end.

        Args:
            room: To the end [rad].
            v: Its speed towards it [rad/s]: until the tick is over it goes on at the mean of both.
            most: Its acceleration [rad/s²].
        """
        change = most * self._tick
        return 0.5 * (math.sqrt(max(change**2 + 4.0 * (2.0 * most * room - change * v), 0.0)) - change)
