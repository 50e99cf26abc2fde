"""What planning needs of a robot's limits again and again, made once for each `Limits` value."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from vrs.errors import PlanningError
from vrs.model import Array, Limits

TOLERANCE = 5e-10
"""Relative overshoot that a certificate lets pass: rounding, half of what the laws allow."""


@dataclass(frozen=True, slots=True, eq=False)
class Bounds:
    """Limits as plain floats: for six joints these are several times quicker than arrays."""

    qd_max: tuple[float, ...]
    """[rad/s]."""
    qdd_max: tuple[float, ...]
    """[rad/s²]."""
    qddd_max: tuple[float, ...]
    """[rad/s³]."""
    lowest: tuple[float, ...]
    """q_min [rad], less the tolerance."""
    highest: tuple[float, ...]
    """q_max [rad] and the tolerance."""
    slack: tuple[Array, Array]
    """What a tolerance is relative to at q_min and at q_max [rad], (n,) each, at least 1."""

    def check_inside(self, q: list[float]) -> None:
        """Raise PlanningError unless q [rad] lies within the position limits."""
        for j, value in enumerate(q):
            if not self.lowest[j] <= value <= self.highest[j]:
                raise PlanningError(f"joint {j + 1} would pass its position limit")


@lru_cache(maxsize=64)
def bounds(limits: Limits) -> Bounds:
    """The bounds of limits, which are compared by identity."""
    at_low, at_high = abs(limits.q_min).clip(1.0), abs(limits.q_max).clip(1.0)
    return Bounds(
        tuple(limits.qd_max.tolist()),
        tuple(limits.qdd_max.tolist()),
        tuple(limits.qddd_max.tolist()),
        tuple((limits.q_min - TOLERANCE * at_low).tolist()),
        tuple((limits.q_max + TOLERANCE * at_high).tolist()),
        (at_low, at_high),
    )
