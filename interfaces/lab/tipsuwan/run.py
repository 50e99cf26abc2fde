"""One run of section VII: a robot tracks a path over a network, with or without the middleware, in virtual time."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from typing import Annotated, Final, Protocol

import numpy as np

from interfaces.lab.tipsuwan.predictive import PredictiveConfig, PredictiveController
from interfaces.lab.tipsuwan.s_paths import START
from interfaces.link import Channel, Conditions, ConstantDelay, DelayProfile, Echo, HeavyTailedDelay, Probe
from interfaces.link.delays import CORRELATION_TIME
from interfaces.middleware import (
    ActionAgent,
    ActionAgentConfig,
    Controller,
    DriveFeedback,
    DriveSetpoint,
    GainSchedulingMiddleware,
    MiddlewareConfig,
    default_network,
)
from robots.ipr.chassis import MobileReality, Senses
from robots.ipr.robot import BareBody, MobileRobot
from robots.onboard.curve import Curve
from robots.onboard.curve_trackers import QuadraticCurveTracker, QuadraticTrackerConfig
from robots.onboard.driving import Posture
from vrs.checks import number_in, one_of, validated, within
from vrs.mobile import DriveLimits, clipped
from vrs.model import Array

ARRIVAL: Final = 0.05
"""Distance from the path's end at which the robot stops: the paper's [m]."""
LENGTH: Final = 15.0
"""Of a run: the paper's [s]."""
MEDIANS: Final = (0.20, 0.23)
"""Smallest and largest median of the round trips [s]."""
EXTRA: Final = 0.01
"""Median of what a leg takes beyond its shortest time [s]."""
SPREAD: Final = 0.8
"""Standard deviation of its logarithm."""
LONGEST: Final = 0.3
"""Largest [s]."""
LIFTED: Final = DriveLimits(v_max=2.0, w_max=4.0, a_max=2.0, alpha_max=10.0)
"""The IPR's without its safety limits: the tracker's α = 2 m/s and 2α rad/s, and the 2 m/s² that its axle, ahead of
its centre of mass, bears without tipping when it brakes; the wheels' share of that on the spot."""
UNBOUND: Final = DriveLimits(v_max=100.0, w_max=200.0, a_max=1e6, alpha_max=1e6)
_IPR_STEP: Final = 1 / 300
_BLIND: Final = Senses(sonar=None, camera=None)
_PROBE, _ECHO = 28, 44
"""What they take on the wire [byte]."""


class NetworkControl(enum.StrEnum):
    """What drives the robot over the network."""

    DIRECT = "direct"
    """The tracker, without middleware."""
    EXACT = "exact"
    """The tracker behind the middleware, with the exact root."""
    NETWORK = "network"
    """The same with the neural network: the paper's."""
    PREDICTIVE = "mpc"
    """A model-predictive controller in their place."""


ROBOTS: Final = ("kinematic", "ipr")
"""The paper's robot, an exact unicycle; and the IPR in PyBullet, as real as it is."""


LAGS: Final = {"kinematic": 0.0, "ipr": 0.05}
"""What the model-predictive controller knows of their motors [s]."""


class Agent(Protocol):
    """What is at the other end of the network from the robot."""

    def next_deadline(self) -> float | None:
        """When it has something to send by itself [s]."""

    def to_send(self, *, now: float) -> Probe | None:
        """A probe that is due."""

    def receive(self, message: Echo | DriveFeedback, *, now: float) -> DriveSetpoint | None:
        """Take what the robot sent."""


@dataclass(frozen=True, slots=True)
@validated
class NetworkRunSetting:
    """What runs have in common."""

    tracker: QuadraticTrackerConfig = field(
        default_factory=lambda: QuadraticTrackerConfig(2.0, 0.3, 0.1, ARRIVAL, window=math.inf)
    )
    """α, s_max and β, fixed beforehand; the nearest point is looked for on the whole path, as the paper says."""
    middleware: MiddlewareConfig = field(default_factory=MiddlewareConfig)
    """ε = 0.25, T_p = 5 ms, N = 10."""
    agent: ActionAgentConfig = field(default_factory=ActionAgentConfig)
    """T = 10 ms."""
    length: Annotated[float, within(0.1, 3600.0, "s")] = LENGTH
    """Of a run [s], in [0.1, 3600]."""


@dataclass(frozen=True, slots=True, eq=False)
class DriveTrace:
    """What a robot did."""

    curve: Curve
    t: Array
    """Sampling times [s], (k,)."""
    postures: Array
    """True ones then, (k, 3)."""
    drives: Array
    """What it was told to drive from then on, v and ω, (k, 2)."""
    arrived: bool
    """Whether it came to within 0.05 m of the path's end."""


def leg(median: float, correlation_time: float = CORRELATION_TIME) -> HeavyTailedDelay:
    """One way of a network: a fixed time and a correlated log-normal extra.

    Args:
        median: Of both ways' medians together [s], in [0.02, 60].
        correlation_time: Of the extra's logarithm [s], in [0, 3600].
    """
    low = 0.5 * number_in("median", median, 2 * EXTRA, 60.0, unit=" s") - EXTRA
    name, mu = f"leg {median:g}@{correlation_time:g}", math.log(1e3 * EXTRA)
    return HeavyTailedDelay(name, mu, SPREAD, low, low + LONGEST, correlation_time)


def network_of(seed: int) -> HeavyTailedDelay:
    """One way of the network of a delay seed: its median round trip is drawn from 0.20 to 0.23 s."""
    return leg(float(np.random.default_rng([seed, 7]).uniform(*MEDIANS)))


def no_delay() -> DelayProfile:
    """The network that isn't one."""
    return ConstantDelay("none", 0.0)


def agent(control: NetworkControl, curve: Curve, setting: NetworkRunSetting, robot: str = "kinematic") -> Agent:
    """Make what drives a robot along a curve."""
    if control is NetworkControl.PREDICTIVE:
        config = PredictiveConfig(lag=LAGS[one_of("robot", robot, ROBOTS)])
        return PredictiveController(curve, setting.middleware.probing, config)
    return behind(control, QuadraticCurveTracker(curve, setting.tracker).control, setting.middleware)


def behind(control: NetworkControl, controller: Controller, config: MiddlewareConfig) -> GainSchedulingMiddleware:
    """Put a controller behind the middleware; or, directly on the network, before one that does nothing."""
    if control is NetworkControl.DIRECT:
        return GainSchedulingMiddleware(
            controller, MiddlewareConfig(config.epsilon, config.probing, predicts=False, schedules=False)
        )
    return GainSchedulingMiddleware(
        controller, config, network=default_network() if control is NetworkControl.NETWORK else None
    )


def make_robot(kind: str, start: tuple[float, float, float], period: float, seed: int) -> tuple[MobileRobot, int]:
    """Put a robot in its place, which sees nothing; and how many of its steps are a sampling time."""
    if one_of("robot", kind, ROBOTS) == "kinematic":
        reality = MobileReality.ideal(dt=period)
        return BareBody("ipr", start, reality=reality, limits=UNBOUND, senses=_BLIND, period=period), 1
    from robots.ipr.body import MobileBody

    steps = max(round(period / _IPR_STEP), 1)
    reality = MobileReality(dt=period / steps)
    made = MobileBody(
        "ipr",
        start,
        reality=reality,
        limits=LIFTED,
        senses=_BLIND,
        rng=np.random.default_rng([seed, 3]),
        period=period,
    )
    return made, steps


def run(
    curve: Curve,
    driver: Agent,
    delay: DelayProfile,
    seed: int = 0,
    *,
    robot: str = "kinematic",
    setting: NetworkRunSetting | None = None,
    start: tuple[float, float, float] = START,
) -> DriveTrace:
    """Let a robot be driven along a curve; the same arguments give the same to the last bit.

    Args:
        curve: The path.
        driver: What drives it from the other end of the network, made for this run.
        delay: Of either direction; datagrams, none of them lost.
        seed: Of the network and of the robot.
        robot: One of `ROBOTS`.
        setting: What it has in common with other runs.
        start: Where the robot begins.
    """
    setting = NetworkRunSetting() if setting is None else setting
    body, steps = make_robot(robot, start, setting.agent.period, seed)
    with body:
        return _NetworkRun(curve, driver, delay, np.random.default_rng([seed, 5]), body, steps, setting).whole()


class _NetworkRun:
    """A run while it goes on: deliveries, probes and sampling times in the order of their times."""

    def __init__(
        self,
        curve: Curve,
        driver: Agent,
        delay: DelayProfile,
        rng: np.random.Generator,
        body: MobileRobot,
        steps: int,
        setting: NetworkRunSetting,
    ) -> None:
        self._curve, self._driver = curve, driver
        there, back = rng.spawn(2)
        self._there: Channel[DriveSetpoint | Probe] = Channel(Conditions(delay=delay), there)
        self._back: Channel[DriveFeedback | Echo] = Channel(Conditions(delay=delay), back)
        self._body, self._steps = body, steps
        self._limits = body.limits
        self._setting = setting
        self._robot = ActionAgent(setting.agent)
        self._end = curve.at(curve.length)

    def whole(self) -> DriveTrace:
        period = self._setting.agent.period
        rows: list[tuple[float, ...]] = []
        arrived = False
        for k in range(round(self._setting.length / period) + 1):
            now = k * period
            self._until(now)
            x, y, theta = self._body.truth
            report = self._robot.sample(Posture(x, y, theta), now=now)
            self._back.send(report, now, report.size)
            # Without delay the command of this very report holds at once.
            self._until(now)
            drive = self._robot.driving(now=now)
            rows.append((now, x, y, theta, *drive))
            arrived = math.hypot(self._end.x - x, self._end.y - y) <= ARRIVAL
            if arrived:
                break
            v, w = clipped(drive.v, self._limits.v_max), clipped(drive.w, self._limits.w_max)
            self._body.drive(v, w, self._steps)
        made = np.array(rows)
        return DriveTrace(self._curve, made[:, 0], made[:, 1:4], made[:, 4:6], arrived)

    def _until(self, now: float) -> None:
        """Let everything happen that happens on the network and at its other end by now [s]."""
        while True:
            t = math.inf
            for part in (self._there, self._back, self._driver):
                due = part.next_deadline()
                if due is not None and due < t:
                    t = due
            if t > now:
                return
            self._at(t)

    def _at(self, now: float) -> None:
        driver, there, back, robot = self._driver, self._there, self._back, self._robot
        for sent in there.receive(now):
            echo = robot.receive(sent.payload, now=now)
            if echo is not None:
                back.send(echo, now, _ECHO)
        for told in back.receive(now):
            command = driver.receive(told.payload, now=now)
            if command is not None:
                there.send(command, now, command.size)
        probe = driver.to_send(now=now)
        if probe is not None:
            there.send(probe, now, _PROBE)
