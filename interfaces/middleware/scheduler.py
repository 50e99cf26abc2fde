"""The gain scheduler: slows a drive down as far as the delay demands, and keeps its curve.

Source: Tipsuwan, Chow, section VI, 3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from interfaces.middleware.network import GainNetwork
from interfaces.middleware.performance import drive_measure, optimal_gain, tolerance
from robots.onboard.driving import Drive
from vrs.errors import InvalidValueError

_STRAIGHTEST_PIVOT = 1e9
"""From this |A| on [1/m] a drive is a turn on the spot: its curve has a radius under a nanometre."""


@dataclass(frozen=True, slots=True)
class ScheduleCounts:
    """What a scheduler has done so far."""

    drives: int
    """All that it was given."""
    slowed: int
    """Of which J would have been over ε."""
    exact: int
    """Of these, those whose gain is the exact root, as the network's broke J ≤ ε, or it isn't trained on them."""


class GainScheduler:
    """Passes on drives with J ≤ ε to rounding, whatever it is given and whatever its network says."""

    def __init__(self, epsilon: float = 0.25, network: GainNetwork | None = None) -> None:
        """Take the tolerance.

        Args:
            epsilon: ε of J, in [1e-6, 3].
            network: What says the gain; the exact root, unless given.

        Raises:
            InvalidValueError: If the network was trained for another tolerance.
        """
        self.epsilon = tolerance(epsilon)
        if network is not None and network.epsilon != self.epsilon:
            raise InvalidValueError("network", network.epsilon, f"one that was trained for ε = {self.epsilon:g}")
        self._network = network
        self._drives = self._slowed = self._exact = 0

    @property
    def counts(self) -> ScheduleCounts:
        """What it has done so far."""
        return ScheduleCounts(self._drives, self._slowed, self._exact)

    def schedule(self, drive: Drive, tau: float) -> Drive:
        """Return the drive itself, or a slower one on the same curve.

        Args:
            drive: What a controller wants.
            tau: Predicted delay [s]: the mean round trip.

        Raises:
            InvalidValueError: If the drive isn't made of finite numbers, or the delay is negative or not finite.
        """
        v, w = checked(drive)
        if not 0 <= tau < math.inf:
            raise InvalidValueError("tau", tau, "finite seconds, 0 or more")
        self._drives += 1
        if drive_measure(drive, tau) <= self.epsilon:
            return drive
        self._slowed += 1
        if abs(w) >= 2 * _STRAIGHTEST_PIVOT * abs(v):
            self._exact += 1
            return _scaled(drive, self.epsilon / (tau * math.hypot(v, w)))
        A, network = 0.5 * w / v, self._network
        if network is not None and network.covers(A, tau):
            slowed = _scaled(drive, network.gain(A, tau) / abs(v))
            if abs(slowed.v) > 0.0 and drive_measure(slowed, tau) <= self.epsilon:
                return slowed
        self._exact += 1
        return _scaled(drive, optimal_gain(A, tau, self.epsilon) / abs(v))


def checked(drive: Drive) -> Drive:
    """Return a drive.

    Raises:
        InvalidValueError: If it isn't made of finite numbers.
    """
    if not (math.isfinite(drive.v) and math.isfinite(drive.w)):
        raise InvalidValueError("drive", tuple(drive), "v and ω, two finite numbers, from the controller")
    return drive


def _scaled(drive: Drive, share: float) -> Drive:
    return Drive(drive.v * share, drive.w * share)
