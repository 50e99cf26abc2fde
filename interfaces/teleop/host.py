"""An arm's end of a connection: which operator it follows, whose clock it goes by, and what its body is to do.

Everything is decided some `lead` ahead of the robot's clock: what the body has been given for the next ticks never
changes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from interfaces.teleop.hosting import Host, HostConfig
from interfaces.teleop.messages import Orders, Report
from interfaces.teleop.robot import JointReference, RobotSite, RobotSiteConfig
from vrs.model import Array, RobotModel


@dataclass(frozen=True, slots=True)
class RobotHostConfig(HostConfig):
    """How an arm's end of a connection behaves."""

    site: RobotSiteConfig = field(default_factory=RobotSiteConfig)
    """How its site behaves."""

    def decided(self) -> RobotSiteConfig:
        """How the site behaves that decides a lead ahead: a stop at T_loss is decided that much sooner."""
        watchdog = self.site.watchdog
        if watchdog is None:
            return self.site
        return replace(self.site, watchdog=replace(watchdog, timeout=max(watchdog.timeout - self.lead, 0.1)))


class RobotHost(Host[RobotSite, Orders, Report]):
    """See `Host`; what the body is to do are joints."""

    def __init__(
        self, model: RobotModel, q: Array, *, now: float, config: RobotHostConfig | None = None, seed: int = 0
    ) -> None:
        """Stand at rest, and wait for an operator.

        Args:
            model: The robot.
            q: Joints [rad], (n,).
            now: By the robot's clock [s].
            config: How to behave.
            seed: Random number in [0, 2**32), new for each life of the robot: echoes of an earlier one don't count.
        """
        self.config = RobotHostConfig() if config is None else config
        super().__init__(self.config, now=now, seed=seed)
        self._model = model
        self._q = np.array(q, float)

    def _make(self, t: float) -> RobotSite:
        site = replace(self.config.site, watchdog=self.watchdog(self.config.site.watchdog))
        config = replace(self.config, site=site).decided()
        reported = max(0, math.floor(1000.0 * t))
        return RobotSite(self._model, self._q, now=t, config=config, reported=reported)

    def _left(self, site: RobotSite, now: float) -> None:  # noqa: ARG002 - it's this site's
        self._q = self.reference(np.array([now])).q[0]

    def reference(self, t: Array) -> JointReference:
        """What the body is to do, (k, n) each, at ascending times of the robot's clock [s] if no more is heard."""
        if self.site is None:
            still = np.zeros((len(t), len(self._q)))
            return JointReference(still + self._q, still, still)
        play = self.site.foreseen(np.asarray(t, float) + self.offset)
        return self.site.reference(play)

    def measured(self, q: Array, *, at: float, now: float) -> bool:
        """Take in measured joints.

        Args:
            q: Joints [rad], (n,).
            at: When they were to be there, by the robot's clock [s].
            now: By the robot's clock [s].

        Returns:
            Whether one is too far away, so that the robot stops and is to be held where it was measured.
        """
        return self.site is not None and self.site.measured(q, now=self.site_time(now), at=at + self.offset)

    def fault(self, reason: str, q: Array, *, now: float) -> None:
        """Stop, for the body has left its references by itself.

        Args:
            reason: What to report.
            q: Where it will rest [rad], (n,).
            now: By the robot's clock [s].
        """
        if self.site is None:
            self._q = np.array(q, float)
        else:
            self.site.halt(reason, now=self.site_time(now), measured=q)
