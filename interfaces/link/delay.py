"""What a delay profile is, and the simplest one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vrs.checks import number_in
from vrs.commands import finite
from vrs.errors import InvalidValueError

MAX_DELAY = 3600.0
"""Longest one-way delay that a profile may hold [s]."""
CORRELATION_TIME = 2.0
"""Time constant of a link's congestion, where none is given [s]."""


class DelaySource(Protocol):
    """Delays of successive packets; it holds the state of the link's congestion."""

    def draw(self, now: float, size: int = 0) -> float | None:
        """One-way delay [s], ≥ 0, of a packet of `size` bytes sent at now [s]; None when it is lost."""


class DelayProfile(Protocol):
    """A way in which a link delays packets."""

    @property
    def name(self) -> str:
        """The profile as the command line spells it."""

    def source(self, rng: np.random.Generator) -> DelaySource:
        """Start a sequence of delays."""

    def quantile(self, share: float) -> float:
        """One-way delay that the given share of arriving packets does not exceed [s]."""


def share_of(share: float) -> float:
    """Return a share strictly between none and all.

    Raises:
        InvalidValueError: If it isn't in (0, 1).
    """
    if not 0 < finite("share", share, "in (0, 1)") < 1:
        raise InvalidValueError("share", share, "in (0, 1)")
    return share


@dataclass(frozen=True, slots=True)
class ConstantDelay:
    """Every packet takes equally long."""

    name: str
    delay: float
    """One-way delay [s], in [0, 3600]."""

    def __post_init__(self) -> None:
        number_in("delay", self.delay, 0.0, MAX_DELAY, "seconds")

    def source(self, rng: np.random.Generator) -> DelaySource:  # noqa: ARG002
        """Start a sequence of delays; nothing about them is random."""
        return self

    def quantile(self, share: float) -> float:  # noqa: ARG002
        """The delay, for every share [s]."""
        return self.delay

    def draw(self, now: float, size: int = 0) -> float | None:  # noqa: ARG002
        """The delay, at every time and for every size [s]."""
        return self.delay
