"""A server on a loopback socket, and a program that commands, asks and looks through it."""

from __future__ import annotations

import asyncio
import threading
from queue import Queue

import numpy as np

from interfaces import connect
from interfaces.engine_server.site import Site
from interfaces.messages import ViewForm
from interfaces.stream.access import Access, hosts
from interfaces.stream.hub import Hub
from interfaces.stream.server import HubServer, application
from interfaces.stream.sockets import bind, serve
from robots import puma560
from robots.onboard.lease import Ended, Grant, Lease
from vrs import Engine, JointTarget, ManualClock, MotionCommand, WallClock

model = puma560.model()
home = model.poses["nominal"]


class Simulated:
    """A robot that stops as soon as its lease ends."""

    hub: Hub

    def began(self, grant: Grant, **_: object) -> None:
        """Commands count from now on."""
        print(f"the lease of {grant.holder} begins")

    def ended(self, _: Ended, *, now: float) -> None:
        """Stop, and say so."""
        self.hub.site.engine.stop()
        self.hub.stopped(now=now)

    def resume(self, *_: object, **__: object) -> str:
        """Why it can't go on."""
        return "it never stops by itself"


async def run(ports: Queue[int], stop: threading.Event) -> None:
    """Serve until told to stop."""
    robot, clock, listening = Simulated(), WallClock(), bind()
    site = Site(Engine(model, q=home, clock=ManualClock(clock.now())))
    robot.hub = Hub(site, Lease(), Access(), robot)
    server = HubServer(robot.hub, clock)
    port = listening.getsockname()[1]
    async with serve(application(server.routes, hosts(["127.0.0.1"], port)), listening), server.running():
        ports.put(port)
        await asyncio.to_thread(stop.wait)


ports: Queue[int] = Queue()
stop = threading.Event()
thread = threading.Thread(target=lambda: asyncio.run(run(ports, stop)))
thread.start()
try:
    with connect(f"127.0.0.1:{ports.get(timeout=10)}", name="example") as arm:
        arm.acquire()
        viewer, frames = arm.viewer(rate=50), arm.viewer(rate=60, form=ViewForm.FRAMES)
        issued = arm.designer.issue(MotionCommand(JointTarget(home + 0.2)), execute_in=0.2, wait=5.0)
        assert issued.receipt is not None
        print(f"{issued.receipt.status}; answered after {(issued.answered_at or 0) - issued.issued_at:.3f} s")
        middle = (issued.receipt.execute_at + issued.receipt.end) / 2
        answer = arm.observer.ask(middle)
        assert answer is not None
        print(
            f"at t = {middle:.2f} s it will be {answer.frame.q[0] - home[0]:+.3f} rad on its way: {answer.status}"
        )
        for each in (viewer, frames):
            each.wait(lambda v: len(v.history) >= 20)
        off = max(float(np.abs(shown.q - viewer.timeline.sample(shown.t)).max()) for shown in frames.history)
        print(f"frames agree with segments to {'1e-9' if off < 1e-9 else off} rad")
finally:
    stop.set()
    thread.join()
