"""The robot's end of the network: drives the newest command, echoes probes, reports where it is.

The policy of the link is `hold`: a starved robot stops, and goes on with the next command; there's no age gate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from interfaces.link.round_trip import Echo, Probe
from interfaces.middleware.messages import DriveFeedback, DriveSetpoint
from robots.onboard.driving import STAND, Drive, Posture
from vrs.checks import validated, within


@dataclass(frozen=True, slots=True)
@validated
class ActionAgentConfig:
    """How the robot's end works."""

    period: Annotated[float, within(1e-4, 1.0, "s")] = 0.01
    """T: between two sampling times [s], in [1e-4, 1]."""
    starved: Annotated[float, within(1e-3, 60.0, "s")] = 0.5
    """How long a command holds when no other comes [s], in [1e-3, 60]."""


class ActionAgent:
    """Takes messages as they arrive, and has its turn once a period; it reads no clock."""

    def __init__(self, config: ActionAgentConfig | None = None) -> None:
        """Stand until the first command."""
        self.config = ActionAgentConfig() if config is None else config
        self._newest: DriveSetpoint | None = None
        self._since = -math.inf
        self._reports = 0
        self.stale = 0
        """Commands that were dropped, as they came behind a newer one."""

    def receive(self, message: DriveSetpoint | Probe, *, now: float) -> Echo | None:
        """Take a message from the control agent.

        Args:
            message: A command, or a probe.
            now: When it arrived [s], by the robot's clock.

        Returns:
            What answers a probe, at once; None for a command.
        """
        if isinstance(message, Probe):
            return message.echo(now)
        if self._newest is not None and message.number <= self._newest.number:
            self.stale += 1
            return None
        if all(map(math.isfinite, message.drive)):
            self._newest, self._since = message, now
        return None

    def sample(self, posture: Posture, *, now: float) -> DriveFeedback:
        """Have a turn: what to drive from now on is in the report that goes back.

        Args:
            posture: Where the robot takes itself to be.
            now: By the robot's clock [s].
        """
        self._reports += 1
        return DriveFeedback(self._reports - 1, posture, self.driving(now=now))

    def driving(self, *, now: float) -> Drive:
        """What the robot drives now [s], by its own clock."""
        if self._newest is None or now - self._since > self.config.starved:
            return STAND
        return self._newest.drive
