"""S-shaped paths at random, a robot's run along one over a network, and what is said of the run."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Annotated, Final, NamedTuple, TypeAlias

import numpy as np

from interfaces.engine_server.site import earliest
from interfaces.lab.tipsuwan.predictive import PredictiveController
from interfaces.link import Channel, Conditions, ConstantDelay, DelayProfile, Echo, HeavyTailedDelay, Probe
from interfaces.link.delays import CORRELATION_TIME
from interfaces.middleware import (
    ActionAgent,
    Controller,
    DriveFeedback,
    DriveSetpoint,
    GainSchedulingMiddleware,
    MiddlewareConfig,
    default_network,
)
from robots.ipr.parameters import IPR
from robots.mobile.chassis import MobileReality, Senses
from robots.mobile.robot import BareBody, MobileRobot
from robots.onboard.curve import Curve
from robots.onboard.curve_trackers import QuadraticCurveTracker, QuadraticTrackerConfig
from robots.onboard.driving import Posture
from robots.robot import load
from vrs.checks import number_in, one_of, validated, within
from vrs.mobile import DriveLimits, clipped
from vrs.model import Array

START: Final = (-0.1, 1.0, 0.0)
"""Where the robot begins: the paper's (x, y, θ) [m, m, rad]."""
BEGIN: Final = (0.0, 1.0)
"""Where every path begins [m]."""
MOST_CURVATURE: Final = 6.0
"""[1/m]."""
T_PRED: Final = (8.0, 9.0)
"""Of the random paths [s]: at most 9, so that the middleware has the time; not much less, as a robot without it
gets to the end of a short path in 15 s, too, swinging (the map has the shorter ones)."""
SHORTER: Final = (6.0, 9.0)
"""Of random paths of which many are shorter [s]."""
SLOWEST: Final = 0.23
"""Round trip that counts in T_pred [s]: the longest median."""
_FLATTER: Final = 0.95
"""How deep an S is beside the one before that bent too much."""


def predicted_time(curve: Curve, tau: float, epsilon: float) -> float:
    """Return T_pred = (τ/ε) ∫ √(1 + κ²) ds [s]: how long the path takes where J = ε all along.

    Args:
        curve: The path.
        tau: Round trip [s].
        epsilon: Tolerance ε.
    """
    s, _, curvature = curve.table
    root = np.sqrt(1.0 + curvature * curvature)
    return tau / epsilon * float(np.sum(np.diff(s) * 0.5 * (root[1:] + root[:-1])))


@lru_cache(maxsize=256)
def s_path(
    seed: int,
    t_pred: float | None = None,
    *,
    within: tuple[float, float] = T_PRED,
    tau: float = SLOWEST,
    epsilon: float = 0.25,
) -> Curve:
    """Draw an S: two bends, one to either side, as a cubic spline from (0, 1) on.

    Shapes that bend more than 6 /m are drawn anew, flatter and flatter: a short path holds no deep S.

    Args:
        seed: Of the shape.
        t_pred: Its predicted time, which sets its size [s]; drawn, unless given.
        within: From where it's drawn, least and most [s].
        tau: Round trip of that time [s].
        epsilon: Tolerance ε of that time.
    """
    rng = np.random.default_rng([seed, 13])
    wanted = float(rng.uniform(*within)) if t_pred is None else t_pred
    depth = 1.0
    while True:
        curve = _sized(_shape(rng, depth), wanted, tau, epsilon)
        if float(curve.table[2].max()) <= MOST_CURVATURE:
            return curve
        depth *= _FLATTER


def _shape(rng: np.random.Generator, depth: float) -> list[tuple[float, float]]:
    """Points of an S from (0, 0) on, about 3 m wide."""
    side = float(rng.choice((-1.0, 1.0)))
    x = np.cumsum(rng.uniform(0.7, 1.3, 3)).tolist()
    first, second = (depth * rng.uniform(0.5, 1.0, 2)).tolist()
    last = depth * float(rng.uniform(-0.3, 0.3))
    return [(0.0, 0.0), (x[0], side * first), (x[1], -side * second), (x[2], last)]


def _sized(points: list[tuple[float, float]], wanted: float, tau: float, epsilon: float) -> Curve:
    """The shape at the size of which T_pred is what is wanted, by bisection: it grows with the size."""
    low, high = 0.05, 50.0
    for _ in range(40):
        scale = (low * high) ** 0.5
        if predicted_time(_scaled(points, scale), tau, epsilon) < wanted:
            low = scale
        else:
            high = scale
    return _scaled(points, low)


def _scaled(points: list[tuple[float, float]], scale: float) -> Curve:
    return Curve([(BEGIN[0] + scale * x, BEGIN[1] + scale * y) for x, y in points])


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
    UNSCHEDULED = "unscheduled"
    """The tracker behind a middleware that predicts, but slows nothing down."""
    PREDICTIVE = "mpc"
    """A model-predictive controller in their place."""


ROBOTS: Final = ("kinematic", "ipr")
"""The paper's robot, an exact unicycle; and the IPR with physics, as real as it is."""


LAGS: Final = {"kinematic": 0.0, "ipr": 0.05}
"""What the model-predictive controller knows of their motors [s]."""


Agent: TypeAlias = GainSchedulingMiddleware | PredictiveController
"""What is at the other end of the network from the robot."""


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
    period: Annotated[float, within(1e-4, 1.0, "s")] = 0.01
    """T: between two sampling times [s], in [1e-4, 1]."""
    length: Annotated[float, within(0.1, 3600.0, "s")] = LENGTH
    """Of a run [s], in [0.1, 3600]."""
    body: str = ""
    """Of the IPR, by its world of physics; the usual one unless given."""


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
        return PredictiveController(curve, setting.middleware.probing, LAGS[one_of("robot", robot, ROBOTS)])
    return behind(control, QuadraticCurveTracker(curve, setting.tracker).control, setting.middleware)


def behind(control: NetworkControl, controller: Controller, config: MiddlewareConfig) -> GainSchedulingMiddleware:
    """Put a controller behind the middleware; or, directly on the network, before one that does nothing."""
    if control is NetworkControl.DIRECT:
        return GainSchedulingMiddleware(
            controller, MiddlewareConfig(config.epsilon, config.probing, predicts=False, schedules=False)
        )
    if control is NetworkControl.UNSCHEDULED:
        return GainSchedulingMiddleware(
            controller, MiddlewareConfig(config.epsilon, config.probing, schedules=False)
        )
    return GainSchedulingMiddleware(
        controller, config, network=default_network() if control is NetworkControl.NETWORK else None
    )


def make_robot(
    kind: str, start: tuple[float, float, float], setting: NetworkRunSetting, seed: int
) -> tuple[MobileRobot, int]:
    """Put a robot in its place, which sees nothing; and how many of its steps are a sampling time."""
    period = setting.period
    if one_of("robot", kind, ROBOTS) == "kinematic":
        reality = MobileReality.ideal(dt=period)
        return BareBody(IPR, start, reality=reality, limits=UNBOUND, senses=_BLIND, period=period), 1
    steps = max(round(period / _IPR_STEP), 1)
    reality = MobileReality(dt=period / steps)
    made: MobileRobot = load(kind).body(setting.body)(
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
    body, steps = make_robot(robot, start, setting, seed)
    there_rng, back_rng = np.random.default_rng([seed, 5]).spawn(2)
    there: Channel[DriveSetpoint | Probe] = Channel(Conditions(delay=delay), there_rng)
    back: Channel[DriveFeedback | Echo] = Channel(Conditions(delay=delay), back_rng)
    robot_end = ActionAgent()

    def exchange(until: float) -> None:
        """Let everything happen by then [s] on the network and at its other end, in the order of its times."""
        while (now := earliest(there.next_deadline(), back.next_deadline(), driver.next_deadline())) is not None:
            if now > until:
                return
            for sent in there.receive(now):
                echo = robot_end.receive(sent.payload, now=now)
                if echo is not None:
                    back.send(echo, now, _ECHO)
            for told in back.receive(now):
                command = driver.receive(told.payload, now=now)
                if command is not None:
                    there.send(command, now, command.size)
            probe = driver.to_send(now=now)
            if probe is not None:
                there.send(probe, now, _PROBE)

    end, arrived = curve.at(curve.length), False
    rows: list[tuple[float, ...]] = []
    with body:
        for k in range(round(setting.length / setting.period) + 1):
            now = k * setting.period
            exchange(now)
            x, y, theta = body.truth
            report = robot_end.sample(Posture(x, y, theta), now=now)
            back.send(report, now, report.size)
            # Without delay the command of this very report holds at once.
            exchange(now)
            drive = robot_end.driving(now=now)
            rows.append((now, x, y, theta, *drive))
            arrived = math.hypot(end.x - x, end.y - y) <= ARRIVAL
            if arrived:
                break
            body.drive(clipped(drive.v, body.limits.v_max), clipped(drive.w, body.limits.w_max), steps)
    made = np.array(rows)
    return DriveTrace(curve, made[:, 0], made[:, 1:4], made[:, 4:6], arrived)


EVERY: Final = 0.05
"""Between postures that are measured [s]."""
LAST: Final = 5.0
"""Of a run that failed, what its reason is read from [s]."""
WINDOW: Final = 0.2
"""How far along the path a robot is looked for from where it was [m]: twice what it goes in 0.05 s at 2 m/s."""
_SWINGS: Final = 4
"""Changes of side or of direction in the last seconds that make a cycle."""


class Reason(enum.StrEnum):
    """Why a robot didn't arrive."""

    ARRIVED = "arrived"
    """It did."""
    CIRCLING = "circling"
    """It turned round and round, one way: by a full turn or more in the last 5 s."""
    LIMIT_CYCLE = "limit cycle"
    """It swung from side to side of the path, or to and fro, four times or more in the last 5 s."""
    STUCK = "stuck"
    """It made less than 1 cm/s in the last 5 s."""
    SLOW = "slow"
    """It was on its way."""


def beside(track: DriveTrace) -> tuple[Array, Array]:
    """Distances to the path's nearest point, left positive [m], and ways along it [m], every 0.05 s, (k,) each.

    The way is looked for about where the robot was, so that none is made by a robot that comes across a later part;
    the distance is that to the whole path.
    """
    curve, away, ways, at = track.curve, [], [], 0.0
    for x, y, _ in _sampled(track).tolist():
        place = curve.at(curve.nearest(x, y))
        left = math.cos(place.theta) * (y - place.y) - math.sin(place.theta) * (x - place.x)
        away.append(math.copysign(math.hypot(x - place.x, y - place.y), left))
        at = curve.nearest(x, y, around=at, window=WINDOW)
        ways.append(at)
    return np.array(away), np.array(ways)


class PathMeasures(NamedTuple):
    """What is said of a run."""

    arrived: bool
    seconds: float
    """How long it took [s]."""
    error: float
    """Mean distance of the robot from the path until it arrived, or the run was over [m]."""
    progress: float
    """Share of the path that was made, in [0, 1]."""
    reason: Reason
    """Why it didn't arrive."""


def measured(track: DriveTrace) -> PathMeasures:
    """Measure a run."""
    away, ways = beside(track)
    progress = 1.0 if track.arrived else float(ways.max()) / track.curve.length
    error, reason = float(np.abs(away).mean()), _reason(track, away, ways)
    return PathMeasures(track.arrived, float(track.t[-1]), error, progress, reason)


def _reason(track: DriveTrace, away: Array, ways: Array) -> Reason:
    """Why the robot didn't arrive, read from its last 5 s."""
    if track.arrived:
        return Reason.ARRIVED
    count = round(LAST / EVERY)
    heading = _sampled(track)[-count:, 2]
    if abs(heading[-1] - heading[0]) >= math.tau:
        return Reason.CIRCLING
    since = track.t >= track.t[-1] - LAST
    if max(_changes(away[-count:]), _changes(track.drives[since, 0])) >= _SWINGS:
        return Reason.LIMIT_CYCLE
    return Reason.STUCK if ways[-1] - ways[-count:][0] < 0.01 * LAST else Reason.SLOW


def _sampled(track: DriveTrace) -> Array:
    period = float(track.t[1] - track.t[0]) if len(track.t) > 1 else EVERY
    return track.postures[:: max(round(EVERY / period), 1)]


def _changes(values: Array) -> int:
    """How often values change their sign."""
    signs = np.sign(values[values != 0])
    return int(np.count_nonzero(signs[1:] != signs[:-1]))
