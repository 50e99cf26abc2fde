"""What the operator does in the runs: the same kind of commands everywhere, random from a seed."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from interfaces.clients.ports import MemoryTransport, RemotePort
from interfaces.engine_server.site import Site
from interfaces.lab.doulgeri.rivals import RobotMaker, adaptive
from interfaces.link import Channel, Conditions, ConstantDelay, LinkConditions, Service
from interfaces.messages import Broadcast, Frame, Outcome, Reply
from interfaces.runtime.laboratory import Laboratory, VirtualPart, run_parts
from interfaces.teleop import JointReference, OperatorSite, VirtualArm
from robots import puma560
from robots.onboard.playout import PlayState
from robots.robot import ArmBody
from vrs import Engine, Insertion, JointTarget, ManualClock, MotionCommand, SteerCommand, Stop
from vrs.commands import Command
from vrs.model import Array

MODEL: Final = puma560.model()
HOME: Final = MODEL.poses["nominal"]
REACH: Final = 0.8
"""How far from home targets lie, at most [rad]."""


D_F: Final = 0.3
"""Forward delay [s]."""
D_B: Final = 0.2
"""Backward delay [s]."""


class Act(NamedTuple):
    """Something that the operator does."""

    t: float
    """When, by the user's clock [s]."""
    command: Command


def target(rng: np.random.Generator, reach: float = REACH) -> JointTarget:
    """A place near home."""
    limits = MODEL.limits
    return JointTarget(np.clip(HOME + rng.uniform(-reach, reach, 6), limits.q_min, limits.q_max))


def script(rng: np.random.Generator, length: float) -> tuple[Act, ...]:
    """Moves that splice, replace and append, now and for later, steering, and stops, up to `length` [s].

    Where chance gives stops alone, a move comes at the end: nothing is said of a robot that stood all along.
    """
    acts, t = [], 0.5
    while t < length:
        choice = rng.random()
        if choice < 0.15:
            rates = rng.uniform(-0.4, 0.4, 6) * MODEL.limits.qd_max
            acts += [
                Act(t + 0.05 * k, SteerCommand(rates=rates * np.sin(0.3 * k), issued_at=t + 0.05 * k))
                for k in range(20)
            ]
            t += 1.2
        elif choice < 0.2:
            acts.append(Act(t, Stop(issued_at=t)))
        else:
            how = list(Insertion)[rng.integers(3)]
            wait, speed = float(rng.choice([0.0, 0.0, 0.5, 2.0])), float(rng.choice([0.3, 0.6, 1.0]))
            acts.append(Act(t, MotionCommand(target(rng), t, t + wait, speed, insertion=how)))
        t += float(rng.exponential(0.8))
    if all(isinstance(act.command, Stop) for act in acts):
        acts.append(Act(length, MotionCommand(target(rng), length)))
    return tuple(acts)


def replay(acts: tuple[Act, ...], D: float = 0.0) -> Engine:
    """An engine that does it all by itself, its clock ahead of the user's by D [s]."""
    clock = ManualClock(D)
    engine = Engine(MODEL, q=HOME, clock=clock)
    for act in acts:
        clock.set(max(act.t + D, clock.now()))
        engine.execute(act.command)
    return engine


def arrivals(rng: np.random.Generator, rate: float, begin: float, end: float) -> Array:
    """Moments of a Poisson process [s], (k,), ascending."""
    count = rng.poisson(rate * (end - begin))
    times: Array = np.sort(rng.uniform(begin, end, count))
    return times


def tool(q: Array) -> Array:
    """Positions of the tool [m], (k, 3), for joints (k, 6)."""
    points: Array = np.asarray(MODEL.forward(q))[:, :3, 3]
    return points


class ScriptedSite:
    """A site and its clients, in virtual time; `now` is the users' [s]."""

    def __init__(self, D: float, kind: type[Site] = Site) -> None:
        self.site = kind(Engine(MODEL, q=HOME, clock=ManualClock(D)), D=D)
        self.engine = self.site.engine
        self.now = 0.0
        self._parts: list[VirtualPart] = [self.site]

    def connect(self, there: float, back: float) -> RemotePort:
        """A port to the site over a link with constant delays [s]."""
        rng = np.random.default_rng(0).spawn(2)
        ways = [ConstantDelay(f"constant:{delay}", delay) for delay in (there, back)]
        held = [Conditions(delay=way, service=Service.IN_ORDER) for way in ways]
        transport = MemoryTransport(self.site, Channel(held[0], rng[0]), Channel(held[1], rng[1]))
        self._parts.append(transport)
        return transport.port

    def add(self, client: VirtualPart) -> None:
        """Drive a client too."""
        self._parts.append(client)

    def run(self, until: float) -> None:
        """Let time pass until `until` [s]."""
        self.now = run_parts(self._parts, now=self.now, until=until)


class PortLog:
    """What comes by a port, with when it came."""

    def __init__(self, port: RemotePort) -> None:
        self.frames: list[tuple[Frame, float]] = []
        self.outcomes: dict[int, Outcome] = {}
        """The first of each command, by the command's number."""
        port.join(self)

    def receive(self, message: Reply, *, now: float) -> None:
        """Keep it, with the user's time [s]."""
        if isinstance(message, Broadcast):
            self.frames.append((message.frame, now))
        elif isinstance(message, Outcome):
            self.outcomes.setdefault(message.number, message)


def twins(
    way: Conditions, rng: np.random.Generator, robot: RobotMaker = adaptive, body: ArmBody | None = None
) -> Laboratory:
    """Both sites of a robot at home, over a link that does the same each way.

    Args:
        way: What it does.
        rng: Source of everything random in it.
        robot: Makes the robot's site; ours adapts.
        body: What follows; without one nothing is measured.
    """
    operator = OperatorSite(VirtualArm(MODEL, HOME, now=0.0))
    return Laboratory(operator, robot(MODEL, HOME), LinkConditions.symmetric(way), rng, body=body)


def limits_used(q: Array, step: float) -> float:
    """Largest speed or acceleration of joints at even times, (k, n) [rad], as a share of its limit.

    By differences, which means of it are: who plays by a law of its own can't say that it's otherwise.

    Args:
        q: Where they were.
        step: Between two times [s].
    """
    limits, v = MODEL.limits, np.diff(q, axis=0) / step
    a = np.diff(v, axis=0) / step
    return float(max((np.abs(v) / limits.qd_max).max(initial=0.0), (np.abs(a) / limits.qdd_max).max(initial=0.0)))


def played(lab: Laboratory) -> tuple[PlayState, JointReference]:
    """Where the robot's play was at each tick of a run, and what a body was asked to do, (k, ...)."""
    _, p, pace, rate = lab.play.T
    return PlayState(p, pace, rate), lab.reference
