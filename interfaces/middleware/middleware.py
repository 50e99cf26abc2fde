"""The middleware at the control agent: probes the network, predicts where the robot is, slows what is sent to it.

Any controller that makes (v, ω) of a posture is put behind it unchanged. Sans I/O: time is an argument, messages go
in and out as values. Source: Tipsuwan, Chow, section VI.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

from interfaces.link.round_trip import Echo, Probe, ProbeConfig, RoundTripEstimator, WindowConfig
from interfaces.middleware.messages import DriveFeedback, DriveSetpoint
from interfaces.middleware.network import GainNetwork
from interfaces.middleware.performance import tolerance
from interfaces.middleware.predictor import predicted
from interfaces.middleware.scheduler import GainScheduler, ScheduleCounts, checked
from robots.onboard.driving import Drive, Posture

Controller: TypeAlias = Callable[[Posture], tuple[float, float]]
"""Makes v [m/s] and ω [rad/s] of where the robot is."""


def _probing() -> ProbeConfig:
    """T_p = 5 ms and N = 10: the paper's."""
    return ProbeConfig(period=0.005, most_in_flight=1024, window=WindowConfig(capacity=10))


@dataclass(frozen=True, slots=True)
class MiddlewareConfig:
    """What the middleware does."""

    epsilon: float = 0.25
    """Tolerance ε of J: how far the robot may go astray in a round trip, in [1e-6, 3]."""
    probing: ProbeConfig = field(default_factory=_probing)
    """How the network is probed: T_p and, as its window's capacity, N."""
    predicts: bool = True
    """Whether the controller gets the predicted posture instead of the reported one."""
    schedules: bool = True
    """Whether drives are slowed until J ≤ ε."""

    def __post_init__(self) -> None:
        tolerance(self.epsilon)


class GainSchedulingMiddleware:
    """Between a controller and the network; with neither prediction nor scheduling it passes everything on."""

    def __init__(
        self,
        controller: Controller,
        config: MiddlewareConfig | None = None,
        *,
        network: GainNetwork | None = None,
        session: int = 0,
        start: float = 0.0,
    ) -> None:
        """Stand between a controller and a robot.

        Args:
            controller: What drives the robot as if there were no network.
            config: What to do.
            network: What says the gain; the exact root, unless given.
            session: Random number in [0, 2**32) that marks our probes.
            start: When probing begins [s].

        Raises:
            InvalidValueError: If the network was trained for another ε, or a value is out of range.
        """
        self._controller = controller
        self.config = MiddlewareConfig() if config is None else config
        self.traffic = RoundTripEstimator(session, self.config.probing, start=start)
        """The traffic estimator."""
        self._scheduler = GainScheduler(self.config.epsilon, network)
        self._probes = self.config.predicts or self.config.schedules
        self._heard = -1
        self._sent = 0

    @property
    def counts(self) -> ScheduleCounts:
        """What was scheduled so far."""
        return self._scheduler.counts

    def next_deadline(self) -> float | None:
        """When `to_send` has something to do [s]; None for never."""
        return self.traffic.next_deadline() if self._probes else None

    def to_send(self, *, now: float) -> Probe | None:
        """Give the next probe if it's due; see `RoundTripEstimator.to_send`."""
        return self.traffic.to_send(now=now) if self._probes else None

    def receive(self, message: Echo | DriveFeedback, *, now: float) -> DriveSetpoint | None:
        """Take a message from the robot.

        Args:
            message: The echo of a probe, or what the robot reports.
            now: When it arrived [s], not before that of any call before.

        Returns:
            What the robot is to drive. None for an echo; for a report that is behind a newer one, or isn't made of
            finite numbers; and for every report until the first round trip is known.
        """
        if isinstance(message, Echo):
            self.traffic.receive(message, now=now)
            return None
        if message.number <= self._heard or not all(map(math.isfinite, (*message.posture, *message.drive))):
            return None
        self._heard = message.number
        drive = self.drive(message.posture, message.drive)
        if drive is None:
            return None
        self._sent += 1
        return DriveSetpoint(self._sent - 1, drive)

    def drive(self, posture: Posture, driving: Drive) -> Drive | None:
        """Say what a robot is to drive that was at a posture, driving so, half a round trip before.

        Args:
            posture: Where it was.
            driving: What it drove.

        Returns:
            The drive; None until the first round trip is known.

        Raises:
            InvalidValueError: If the controller's drive isn't made of finite numbers.
        """
        config, traffic = self.config, self.traffic
        if config.predicts:
            median = traffic.median
            if median is None:
                return None
            posture = predicted(posture, driving, median)
        mean = traffic.mean
        if config.schedules and mean is None:
            return None
        wanted = Drive(*self._controller(posture))
        if not config.schedules or mean is None:
            return checked(wanted)
        return self._scheduler.schedule(wanted, mean)
