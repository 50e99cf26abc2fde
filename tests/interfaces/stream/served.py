"""A hub on a real loopback socket, in a thread of its own; and one in memory."""

from __future__ import annotations

import contextlib

from interfaces.engine_server.site import Site
from interfaces.stream.access import OPEN, Access, hosts
from interfaces.stream.hub import Hub, HubConfig
from interfaces.stream.server import HubServer, application
from interfaces.stream.sockets import bind, serve
from robots import puma560
from robots.onboard.lease import Lease, LeaseConfig
from tests.interfaces.stream.serving import Serving, beside
from vrs import Engine, ManualClock
from vrs.clock import WallClock

MODEL = puma560.model()
HOME = MODEL.poses["nominal"]
ADMIN = "a" * 43


class Robot:
    """Notes what the lease did, and stops at once unless told otherwise."""

    def __init__(self, stops: bool = True) -> None:
        self.hub: Hub | None = None
        self.met = True
        self.stops, self.log, self.refusal = stops, [], ""

    def began(self, grant, *, now):
        self.log.append(("began", grant.epoch))

    def ended(self, ended, *, now):
        self.log.append(("ended", ended.epoch, ended.why.value))
        if self.stops:
            self.hub.stopped(now=now)

    def resume(self, epoch, *, now):
        self.log.append(("resume", epoch))
        return self.refusal


def make_hub(
    *,
    now: float = 0.0,
    stops: bool = True,
    epoch: int = 0,
    emulation=None,
    invitations=None,
    audit=None,
    people=None,
    **options,
) -> Hub:
    site = Site(Engine(MODEL, q=HOME, clock=ManualClock(now)))
    robot = Robot(stops)
    free = OPEN if invitations is None and people is None else ()
    access = Access({"admin": ADMIN}, free=free, invitations=invitations, people=people)
    counter = iter(range(1, 10**9))
    hub = Hub(
        site,
        Lease(epoch=epoch, config=LeaseConfig()),
        access,
        robot,
        config=HubConfig(instance="one", server="test", **options),
        emulation=emulation,
        audit=audit,
        random_bytes=lambda n: next(counter).to_bytes(n, "big"),
    )
    robot.hub = hub
    hub.robot = robot
    return hub


class ServingHub(Serving):
    """A hub behind a port of this machine."""

    def __init__(self, port: int, server: HubServer) -> None:
        super().__init__(port)
        self.server, self.hub = server, server.hub


@contextlib.asynccontextmanager
async def _serving(sockets=None, tls=None, shaking=None, port=0, **options):
    clock, listening = WallClock(0.0), bind(port=port)
    server = HubServer(make_hub(now=clock.now(), **options), clock)
    serving = ServingHub(listening.getsockname()[1], server)
    app = application(server.routes, hosts(["127.0.0.1", "localhost"], serving.port))
    async with serve(app, listening, limits=sockets, tls=shaking if tls is None else lambda: tls), server.running():
        yield serving


def served(**options) -> contextlib.AbstractContextManager[ServingHub]:
    """Serve a hub on loopback."""
    return beside(_serving(**options))
