"""A run of section IV-B's second experiment: CUBO is led along a path over a bad link, by one of several schemes.

The local system knows the path and the newest position that came; it drives at one speed, and predicts
nothing. All schemes have the same controller, filter, watchdog, body and link; with one seed the links
draw alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from interfaces.lab.kim2006.schemes import Rims, scheme
from interfaces.link.conditions import Conditions, LinkConditions
from interfaces.link.delays import DelayProfile, delay_profile
from interfaces.link.link import Link
from interfaces.link.losses import loss_model
from interfaces.rsp.model import RobotModel, read_model
from robots.cubo import parameters as p
from robots.mobile.chassis import MobileReality, Senses
from robots.mobile.position import FusedPosition
from robots.mobile.robot import BareBody, MobileRobot
from robots.onboard.driving import Posture
from vrs.checks import one_of, validated, within
from vrs.comparison import match_paths
from vrs.mobile import clipped, wrapped
from vrs.model import Array

TICK: Final = 0.02
"""Between two turns of everything, the paper's T [s]."""
SPEED: Final = 0.15
"""Of the robot along the path [m/s]."""
RECOVERY: Final = 0.12
"""λ of the comparison: over what way the local system leads the robot back to the path [m]."""
BRAKING: Final = 0.06
"""Over what way it slows down before the path's end [m]."""
FIRE: Final = 0.5
"""How often it gives a command [s]."""
AFTER: Final = 5.0
"""A run goes on for this after the path's end [s]."""
RESEND: Final = 0.2
"""TCP sends again after so long [s], at the latest: the least that Linux allows, whatever the round trip."""
BODIES: Final = ("cubo", "bare")
"""The body in PyBullet, and the same chassis without physics."""


@dataclass(frozen=True, slots=True)
@validated
class FollowingCase:
    """What is run."""

    scheme: str = "rsp"
    delay: str = "none"
    """Profile of either direction, as the command line spells it."""
    loss: Annotated[float, within(0.0, 0.999)] = 0.0
    """Share of packets lost either way, in [0, 1)."""
    seed: int = 0
    length: Annotated[float, within(2.0, 3600.0, "s")] = 30.0
    """For how long the path is [s], in [2, 3600]."""
    body: str = "cubo"
    bandwidth: float = math.inf
    """Of either direction [bit/s]."""
    adaptive: bool = False
    """Whether RSP fits T to the link."""
    recovery: Annotated[float, within(0.01, 100.0, "m")] = RECOVERY
    """λ: over what way the local system leads the robot back to the path [m], in [0.01, 100]."""
    music: Annotated[float, within(0.0, 1.0)] = 0.0
    """Share of the time in which music plays, in [0, 1]."""

    def __post_init__(self) -> None:
        scheme(self.scheme)
        one_of("body", self.body, BODIES)


class Followed(NamedTuple):
    """What came of a run."""

    path_error: float
    """Mean distance from the path over time [m]."""
    path_error_max: float
    """Largest [m]."""
    progress: float
    """Share of the path that was reached."""
    age: float
    """Mean age of what the wheels did [s], over the ticks after something came."""
    command_age: float
    """Mean time from giving a command to its execution [s]; of those that came."""
    commands_missing: int
    """Commands that were never carried out."""
    down: float
    """Bytes to the robot a second, without the network's headers."""
    up: float
    """Bytes from it a second."""
    distance: Array
    """From the path at each step of the match, (m,) [m]."""
    arrivals: NDArray[np.intp]
    """Step of the match at which each cell of 1 cm that was reached was first reached, (n,)."""
    way: Array
    """True positions, (k, 2) [m]."""
    path: Array
    """The path, (k, 2) [m]."""

    def error_until(self, cells: int) -> float:
        """Mean distance from the path until so many of its cells were reached [m]."""
        last = int(self.arrivals[min(cells, len(self.arrivals)) - 1])
        return float(self.distance[: last + 1].mean())


@cache
def cubo_model() -> RobotModel:
    """CUBO's own model."""
    return read_model(p.MODEL_FILE)


def course(seed: int, length: float) -> Array:
    """A smooth path of curves of 0.4 m in radius or more, a point a tick at `SPEED`, (k, 2) [m]."""
    rng = np.random.default_rng([seed, 7])
    count = round(length / TICK) + 1
    phases, rates = rng.uniform(0, math.tau, 3), np.array([0.11, 0.23, 0.41]) * rng.uniform(0.8, 1.2, 3)
    t = TICK * np.arange(count)
    curvature = 2.5 * np.sin(math.tau * rates[:, None] * t + phases[:, None]).mean(axis=0)
    heading = np.concatenate(([0.0], np.cumsum(curvature[:-1] * SPEED * TICK)))
    steps = SPEED * TICK * np.column_stack([np.cos(heading), np.sin(heading)])[:-1]
    return np.vstack(([0.0, 0.0], np.cumsum(steps, axis=0)))


def path_leader(path: Array, recovery: float = RECOVERY) -> Callable[[Posture], Rims]:
    """The local system's controller: the path's own curvature, and what brings the robot back.

    For l beside the path, along the way s: d²l/ds² + 2/λ dl/ds + l/λ² = 0. The robot is back after a few λ, without
    a swing, if the position is fresh. On a curve that has no error of its own, so what is measured is the link's.

    Args:
        path: At whose start the robot begins.
        recovery: λ [m].

    Returns:
        What the wheels are to do [mm/s], from where the robot was seen.
    """
    steps = np.diff(path, axis=0)
    headings = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    curvature = np.gradient(headings, SPEED * TICK)
    at, reach = 0, round(3 * recovery / (SPEED * TICK))

    def rims(seen: Posture) -> Rims:
        nonlocal at
        near = path[at : at + reach] - (seen.x, seen.y)
        at += int(np.einsum("ij,ij->i", near, near).argmin())
        if at >= len(path) - 2:
            return 0, 0
        heading, (x, y) = float(headings[at]), path[at]
        beside = math.cos(heading) * (seen.y - y) - math.sin(heading) * (seen.x - x)
        angle = wrapped(seen.theta - heading)
        left = SPEED * TICK * (len(path) - at)
        v = SPEED * max(math.cos(angle), 0.0) * min(1.0, left / BRAKING)
        back = clipped(beside / recovery, 2.0) + 2.0 * angle
        w = clipped(SPEED * (float(curvature[at]) - back / recovery), 0.5 * p.LIMITS.w_max)
        half = 0.5 * w * p.WHEEL_BASE
        return round(1000 * (v - half)), round(1000 * (v + half))

    return rims


def plays(t: float, length: float, share: float) -> bool:
    """Whether music plays at a time [s]: three pieces, each in a third of the length [s], that end with it."""
    third = length / 3.0
    # In whole periods, so that the share is what was asked for.
    return math.floor(t % third / TICK + 0.5) * TICK >= third * (1.0 - share) - 1e-9


def resend_after(profile: DelayProfile) -> float:
    """When TCP sends again what was lost [s]: by the acknowledgements of three later packets, or at `RESEND`.

    In TCP's favour: a median round trip at most, no acknowledgement is lost, and nothing slows it down.
    """
    return min(RESEND, 2 * profile.quantile(0.5) + 3 * TICK)


def make_body(case: FollowingCase) -> MobileRobot:
    """The real robot of a case, at the path's start."""
    rng, reality = np.random.default_rng([case.seed, 1]), MobileReality(dt=0.004)
    if case.body == "bare":
        senses = Senses(sonar=None)
        return BareBody(p.CUBO, (0.0, 0.0, 0.0), reality=reality, rng=rng, limits=p.LIMITS, senses=senses)
    from robots.cubo.body import CuboBody

    return CuboBody((0.0, 0.0, 0.0), reality=reality, rng=rng, senses=Senses(sonar=None))


def run(case: FollowingCase) -> Followed:
    """Run a case; the same case gives the same to the last bit.

    Raises:
        InvalidValueError: If a name or a value isn't allowed.
        FormatError: If a trace can't be read.
    """
    chosen = scheme(case.scheme)
    bytes_rng = np.random.default_rng([case.seed, 3])
    local, robot = chosen.ends(cubo_model(), bytes_rng.bytes, case.adaptive)
    profile = delay_profile(case.delay)
    conditions = Conditions(
        delay=profile,
        loss=loss_model(str(case.loss)),
        service=chosen.service,
        retransmit_after=resend_after(profile),
        bandwidth=case.bandwidth,
        queue_packets=200,
    )
    link: Link[bytes, bytes] = Link(LinkConditions.symmetric(conditions), np.random.default_rng([case.seed, 2]))
    path = course(case.seed, case.length)
    lead = path_leader(path, case.recovery)
    way: list[tuple[float, ...]] = []
    given: list[float] = []  # when each command was [s]
    fired: dict[int, float] = {}  # when each was carried out [s]
    ages: list[float] = []
    down = up = 0
    with make_body(case) as body:
        position, steps = FusedPosition(body), round(TICK / body.reality.dt)
        for k in range(round((case.length + AFTER) / TICK)):
            now = k * TICK
            way.append(body.truth[:2])
            for arrived in link.forward.receive(now):
                robot.receive(arrived.payload, now=now)
            for answer in link.backward.receive(now):
                local.receive(answer.payload, now)
            if local.seen is not None:
                local.write(lead(local.seen))
            if k % round(FIRE / TICK) == 0 and now < case.length:
                given.append(now)
                local.fire()
            if case.music and now < case.length and plays(now, case.length, case.music):
                local.play()
            for data in local.to_send(now=now):
                size = max(len(data), chosen.least[0])
                down += size
                link.forward.send(data, now, size + chosen.header)
            left, right = robot.drive(now=now)
            for number in robot.fired():
                fired.setdefault(number, now)
            if robot.stamp is not None:
                ages.append(now - robot.stamp)
            robot.measure(position.posture())
            for data in robot.to_send(now=now):
                size = max(len(data), chosen.least[1])
                up += size
                link.backward.send(data, now, size + chosen.header)
            v, w = 0.5e-3 * (left + right), 1e-3 * (right - left) / p.WHEEL_BASE
            body.drive(clipped(v, p.LIMITS.v_max), clipped(w, p.LIMITS.w_max), steps)
    leader = np.vstack([path, np.repeat(path[-1:], len(way) - len(path), axis=0)])
    match = match_paths(TICK * np.arange(len(way)), leader, np.array(way), v_max=SPEED)
    waits = [at - given[number] for number, at in fired.items() if number < len(given)]
    seconds = len(way) * TICK
    return Followed(
        path_error=float(match.distance.mean()),
        path_error_max=float(match.distance.max()),
        progress=float(max(len(match.t_follower) - 1, 0) / max(len(match.s) - 1, 1)),
        age=float(np.mean(ages)) if ages else math.inf,
        command_age=float(np.mean(waits)) if waits else math.inf,
        commands_missing=len(given) - len(waits),
        down=down / seconds,
        up=up / seconds,
        distance=match.distance,
        arrivals=np.searchsorted(match.t, match.t_follower - 1e-9),
        way=np.array(way),
        path=path,
    )
