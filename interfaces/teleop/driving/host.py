"""A mobile robot's end of a connection."""

from __future__ import annotations

from collections.abc import Callable

from interfaces.teleop.architectures.messages import DriveOrders, DriveReport
from interfaces.teleop.driving.robot import DrivenRobot
from interfaces.teleop.hosting import Host, HostConfig
from robots.onboard.driving import STAND, Drive


class DrivenHost(Host[DrivenRobot, DriveOrders, DriveReport]):
    """See `Host`; what the body is to do is a drive for each control period."""

    def __init__(
        self, make: Callable[[float], DrivenRobot], config: HostConfig, *, now: float, seed: int = 0
    ) -> None:
        """Stand at rest, and wait for an operator.

        Args:
            make: Makes the robot's site for an operator's time [s].
            config: How to behave.
            now: By the robot's clock [s].
            seed: See `Host`.
        """
        super().__init__(config, now=now, seed=seed)
        self._make_site = make

    def _make(self, t: float) -> DrivenRobot:
        return self._make_site(t)

    def _left(self, site: DrivenRobot, now: float) -> None:
        """Nothing is to be kept: the next site finds the robot where it stands."""

    def drive(self, *, now: float) -> Drive:
        """What to drive for the next period, from the robot's time now [s] on."""
        return STAND if self.site is None else self.site.drive(now=self.site_time(now))
