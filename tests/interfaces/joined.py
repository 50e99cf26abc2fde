"""Clients and engines joined here and over emulated links, in virtual time."""

from __future__ import annotations

import numpy as np

from interfaces.clients.ports import LocalPort, MemoryTransport
from interfaces.engine_server.site import Site
from interfaces.link import BernoulliLoss, Channel, Conditions, ConstantDelay, DelayProfile, GammaDelay, Service
from interfaces.runtime.laboratory import run_parts
from robots import puma560
from vrs import Engine, JointTarget, ManualClock, MotionCommand

MODEL = puma560.model()
HOME = MODEL.poses["nominal"]


def place(k: int) -> np.ndarray:
    """A place near home, another one for each k."""
    return HOME + np.random.default_rng(k).uniform(-0.4, 0.4, 6)


def to(k: int, **options) -> MotionCommand:
    return MotionCommand(JointTarget(place(k)), **options)


class Joined:
    """A site, ports to it and clients, driven in turn; `now` is the users' time."""

    def __init__(self, D: float = 0.0, now: float = 0.0, **options) -> None:
        start = options if "timeline" in options else {"q": HOME, **options}
        self.site = Site(Engine(MODEL, clock=ManualClock(now + D), **start), D=D)
        self.engine = self.site.engine
        self.parts = [self.site]
        self.now = now

    def local(self, lead: float = 0.0) -> LocalPort:
        port = LocalPort(self.site, lead=lead)
        self.parts.append(port)
        return port

    def remote(self, forward, backward, *, seed: int = 0, lead: float = 0.0):
        rng = np.random.default_rng(seed).spawn(2)
        there, back = (Channel(_conditions(way), r) for way, r in zip((forward, backward), rng, strict=True))
        transport = MemoryTransport(self.site, there, back, lead=lead)
        self.parts.append(transport)
        return transport.port

    def add(self, client):
        self.parts.append(client)
        return client

    def run(self, seconds: float) -> None:
        self.now = run_parts(self.parts, now=self.now, until=self.now + seconds)


def _conditions(way: DelayProfile | Conditions) -> Conditions:
    """Conditions themselves, or those of a link in order with a delay."""
    return way if isinstance(way, Conditions) else Conditions(delay=way, service=Service.IN_ORDER)


def constant(seconds: float) -> ConstantDelay:
    return ConstantDelay(f"constant:{seconds}", seconds)


def bad(loss: float, duplicate: float, mean: float = 0.1, spread: float = 0.2) -> Conditions:
    """A link that loses, copies and reorders: the wider the spread, the more."""
    return Conditions(
        delay=GammaDelay("gamma", mean, max(spread, 1e-3) * 5 * mean, 0.2 * mean, 0.0),
        loss=BernoulliLoss(loss),
        duplicate=duplicate,
        service=Service.DATAGRAM,
    )
