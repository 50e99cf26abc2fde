"""Adaptive clock offset: how far behind the robot plays, from how late messages come."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from interfaces.link.delay import share_of
from interfaces.link.round_trip import RelativeDelays, WindowConfig
from vrs.checks import validated, within


@dataclass(frozen=True, slots=True)
@validated
class OffsetConfig:
    """How much delay is hidden."""

    share: float = 0.95
    """Share of the messages that come early enough, in (0, 1)."""
    margin: Annotated[float, within(0.0, 60.0)] = 0.05
    """Added to the quantile [s], in [0, 60]: for what the window hasn't seen."""
    window: Annotated[int, within(10, 100_000)] = 2000
    """Messages that count, in [10, 100000]."""
    horizon: Annotated[float, within(1.0, 86_400.0)] = 120.0
    """Age at which a message counts no more [s], in [1, 86400]."""

    def __post_init__(self) -> None:
        share_of(self.share)


class AdaptiveOffset:
    """D = −(quantile of the age of completeness + margin), by the robot's own clock.

    The age is how far the newest complete time lay behind the robot's clock just before a message came: delay,
    heartbeat period, losses and an unknown difference of the clocks are all in it, so that none need be known.
    """

    def __init__(self, config: OffsetConfig | None = None) -> None:
        self._config = OffsetConfig() if config is None else config
        self._ages = RelativeDelays(WindowConfig(self._config.window, self._config.horizon))

    def heard(self, complete_until: float, *, now: float) -> None:
        """A message came.

        Args:
            complete_until: Up to where the timeline was known to be complete before it [s].
            now: By the robot's clock [s].
        """
        self._ages.receive(complete_until, now=now)

    @property
    def D(self) -> float | None:
        """Timeline time less the robot's clock [s]; None before the first message."""
        age = self._ages.quantile(self._config.share)
        return None if age is None else -(age + self._config.margin)
