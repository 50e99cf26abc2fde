"""A hub on a real loopback socket, in a thread of its own; and one in memory."""

from __future__ import annotations

import asyncio
import contextlib
import threading

from interfaces.site import Site
from interfaces.stream.access import Access, hosts
from interfaces.stream.hub import Hub, HubConfig
from robots import puma560
from robots.onboard import Lease, LeaseConfig
from vrs import Engine, ManualClock
from vrs.clock import WallClock

MODEL = puma560.model()
HOME = MODEL.poses["nominal"]
ADMIN = "a" * 43


class Robot:
    """Notes what the lease did, and stops at once unless told otherwise."""

    def __init__(self, stops: bool = True) -> None:
        self.hub: Hub | None = None
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


def make_hub(*, now: float = 0.0, stops: bool = True, epoch: int = 0, **options) -> Hub:
    site = Site(Engine(MODEL, q=HOME, clock=ManualClock(now)))
    robot = Robot(stops)
    access = Access({"admin": ADMIN})
    counter = iter(range(1, 10**9))
    hub = Hub(
        site,
        Lease(epoch=epoch, config=LeaseConfig()),
        access,
        robot,
        config=HubConfig(instance="one", server="test", **options),
        random_bytes=lambda n: next(counter).to_bytes(n, "big"),
    )
    robot.hub = hub
    hub.robot = robot
    return hub


@contextlib.contextmanager
def served(**options):
    """A hub behind a port of this machine; yields it with its address."""
    from interfaces.stream.server import HubServer, application
    from interfaces.stream.sockets import bind, serve

    ready, box = threading.Event(), {}

    async def run() -> None:
        clock = WallClock(0.0)
        hub = make_hub(now=clock.now(), **options)
        server = HubServer(hub, clock)
        listening = bind()
        port = listening.getsockname()[1]
        app = application(server.routes, hosts(["127.0.0.1", "localhost"], port))
        stop = asyncio.Event()
        async with serve(app, listening), server.running():
            box.update(hub=hub, server=server, port=port, stop=stop, loop=asyncio.get_running_loop())
            ready.set()
            await stop.wait()

    def main() -> None:
        try:
            asyncio.run(run())
        except BaseException as error:
            box["error"] = error
            raise
        finally:
            ready.set()

    thread = threading.Thread(target=main)
    thread.start()
    assert ready.wait(10)
    if "error" in box:
        raise box["error"]
    try:
        yield box
    finally:
        box["loop"].call_soon_threadsafe(box["stop"].set)
        thread.join(10)
        assert not thread.is_alive()
