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
from interfaces.middleware.network import GainNetwork
from interfaces.middleware.performance import drive_measure, optimal_gain, tolerance
from robots.onboard.driving import STAND, Drive, Posture
from vrs.checks import number_in
from vrs.errors import InvalidValueError
from vrs.mobile import advanced


@dataclass(frozen=True, slots=True)
class DriveSetpoint:
    """What the robot is to drive until it hears otherwise."""

    number: int
    """It rises from command to command: one that arrives behind a newer one is stale."""
    drive: Drive

    size = 28
    """What it takes on the wire [byte]."""


@dataclass(frozen=True, slots=True)
class DriveFeedback:
    """What the robot reports at each of its sampling times."""

    number: int
    """It rises from report to report."""
    posture: Posture
    """Where the robot takes itself to be."""
    drive: Drive
    """What it drives from then on; A and K of eq. (20) follow from it."""

    size = 52
    """What it takes on the wire [byte]."""


def predicted(posture: Posture, drive: Drive, tau: float) -> Posture:
    """Return where a robot will be when a command reaches it, from where it was a round trip before.

    The robot keeps the drive that it reported. Equations (21) and (22) divide by A and are the exact arc of
    `vrs.mobile.advanced`, which has the straight line as its limit.

    Args:
        posture: Where it was when it reported.
        drive: What it was driving then.
        tau: Time from the report to when a command that is sent now reaches it [s]: the median round trip.

    Source: Tipsuwan, Chow, eq. (19)–(22).
    """
    return Posture(*advanced(posture, drive.v, drive.w, tau))


_STRAIGHTEST_PIVOT = 1e9
"""From this |A| on [1/m] a drive is a turn on the spot: its curve has a radius under a nanometre."""


class GainScheduler:
    """Passes on drives with J ≤ ε to rounding, whatever it is given and whatever its network says.

    It slows a drive down as far as the delay demands, and keeps its curve.

    Source: Tipsuwan, Chow, section VI, 3).
    """

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
        self.drives = 0
        """How many it was given so far."""
        self.slowed = 0
        """Of which J would have been over ε."""
        self.exact = 0
        """Of these, those given the exact root, as the network's broke J ≤ ε, or it isn't trained on them."""

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
        self.drives += 1
        if drive_measure(drive, tau) <= self.epsilon:
            return drive
        self.slowed += 1
        if abs(w) >= 2 * _STRAIGHTEST_PIVOT * abs(v):
            self.exact += 1
            return _scaled(drive, self.epsilon / (tau * math.hypot(v, w)))
        A, network = 0.5 * w / v, self._network
        if network is not None and network.covers(A, tau):
            slowed = _scaled(drive, network.gain(A, tau) / abs(v))
            if abs(slowed.v) > 0.0 and drive_measure(slowed, tau) <= self.epsilon:
                return slowed
        self.exact += 1
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


class ActionAgent:
    """The robot's end: drives the newest command, echoes probes, reports where it is; it reads no clock.

    It takes messages as they arrive, and has its turn once a period. The policy of the link is `hold`: a starved
    robot stops, and goes on with the next command; there's no age gate.
    """

    def __init__(self, starved: float = 0.5) -> None:
        """Stand until the first command.

        Args:
            starved: How long a command holds when no other comes [s], in [1e-3, 60].
        """
        self._starved = number_in("starved", starved, 1e-3, 60.0, unit=" s")
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
        if self._newest is None or now - self._since > self._starved:
            return STAND
        return self._newest.drive


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
        self.scheduler = GainScheduler(self.config.epsilon, network)
        """What slows drives, and counts them."""
        self._probes = self.config.predicts or self.config.schedules
        self._heard = -1
        self._sent = 0

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
            median = traffic.delays.median
            if median is None:
                return None
            posture = predicted(posture, driving, median)
        mean = traffic.delays.mean
        if config.schedules and mean is None:
            return None
        wanted = Drive(*self._controller(posture))
        if not config.schedules or mean is None:
            return checked(wanted)
        return self.scheduler.schedule(wanted, mean)
