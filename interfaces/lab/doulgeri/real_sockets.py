"""Section VI-B over real sockets: the server that the product is, a bad link on loopback, and viewers behind it."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from concurrent.futures import Future
from contextlib import AsyncExitStack, asynccontextmanager
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Final

import numpy as np

from interfaces.clients.viewer import Viewer
from interfaces.engine_server.site import Site
from interfaces.lab.doulgeri.script import HOME, MODEL, PortLog, target
from interfaces.link import BernoulliLoss, Conditions, ConstantDelay, LinkConditions
from interfaces.messages import ViewForm
from interfaces.messages.control import Role, Welcome
from vrs import Engine, Insertion, ManualClock, MotionCommand, WallClock

if TYPE_CHECKING:
    from interfaces.stream.client_socket import Line
    from interfaces.stream.server import HubServer

RATE: Final = 50
"""Frames a second."""
DELAY: Final = 0.1
"""Each way [s]."""
LOSS: Final = 0.02
"""Share of packets lost; TCP sends them again."""
PATIENCE: Final = 3.0
"""How long after the last frame was due it's waited for [s]."""


class _NoRobot:
    """What a lease does where nobody takes it."""

    met = True

    def began(self, grant: object, *, now: float) -> None:
        """Do nothing."""

    def ended(self, ended: object, *, now: float) -> None:
        """Do nothing."""

    def resume(self, epoch: int, *, now: float) -> str:
        """Refuse."""
        return f"there's no robot to resume at {now} s, epoch {epoch}"


@asynccontextmanager
async def _served(kind: type[Site]) -> AsyncIterator[int]:
    """Serve a moving engine behind the link; the port to reach it by."""
    from interfaces.link.proxy import Address, Proxy, ProxySettings
    from interfaces.stream.access import Access, hosts
    from interfaces.stream.hub import Hub, HubConfig
    from interfaces.stream.server import HubServer, application
    from interfaces.stream.sockets import bind, serve
    from robots.onboard.lease import Lease

    clock = WallClock(0.0)
    engine, rng = Engine(MODEL, q=HOME, clock=ManualClock(0.0)), np.random.default_rng(0)
    for _ in range(20):
        engine.execute(MotionCommand(target(rng), speed=0.3, insertion=Insertion.APPEND))
    hub = Hub(kind(engine), Lease(), Access(), _NoRobot(), config=HubConfig(rates=(float(RATE),)))
    listening = bind()
    port = listening.getsockname()[1]
    server: HubServer = HubServer(hub, clock)
    way = Conditions(delay=ConstantDelay(f"constant:{DELAY}", DELAY), loss=BernoulliLoss(LOSS))
    settings = ProxySettings(
        Address("127.0.0.1", 0), Address("127.0.0.1", port), LinkConditions.symmetric(way), udp=False
    )
    proxy = Proxy(settings, clock, np.random.default_rng(1))
    async with AsyncExitStack() as stack:
        await proxy.start()
        stack.callback(proxy.close)
        app = application(server.routes, hosts(["127.0.0.1"], proxy.listening.port))
        await stack.enter_async_context(serve(app, listening))
        await stack.enter_async_context(server.running())
        yield proxy.listening.port


def lacking(kinds: tuple[type[Site], ...], viewers: int, length: float) -> list[float]:
    """Serve viewers for some seconds, by several servers at once: what share of the frames due lacked, at most.

    Args:
        kinds: The servers'.
        viewers: Of each.
        length: How long frames are counted [s].

    Returns:
        A share for each server.
    """
    from interfaces.stream.remote import RemoteViewer

    loop, over = asyncio.new_event_loop(), asyncio.Event()
    thread = threading.Thread(target=loop.run_forever, name="real-sockets", daemon=True)
    thread.start()
    ready: Future[list[int]] = Future()

    async def hold() -> None:
        try:
            async with AsyncExitStack() as stack:
                ready.set_result([await stack.enter_async_context(_served(kind)) for kind in kinds])
                await over.wait()
        except BaseException as error:
            if not ready.done():
                ready.set_exception(error)
            raise

    done = asyncio.run_coroutine_threadsafe(hold(), loop)
    lines: list[list[Line]] = []
    try:
        lines += [[_line(port, loop) for _ in range(viewers)] for port in ready.result()]
        logs = [[PortLog(line.port) for line in served] for served in lines]
        for line in chain(*lines):
            RemoteViewer(line, partial(Viewer, rate=RATE, form=ViewForm.FRAMES), line.close)
        return [_lacking(served, seen, length) for served, seen in zip(lines, logs, strict=True)]
    finally:
        loop.call_soon_threadsafe(over.set)
        done.result(10.0)
        for line in chain(*lines):
            line.close()
        loop.call_soon_threadsafe(loop.stop)
        thread.join(10.0)
        loop.close()


def _line(port: int, loop: asyncio.AbstractEventLoop) -> Line:
    from interfaces.stream.client import ClientCore
    from interfaces.stream.client_socket import Line
    from interfaces.stream.codec import Encoding

    core = ClientCore(expects=Welcome, role=Role.VIEWER, name="viewer", token=None, encoding=Encoding.MSGPACK)
    return Line((f"ws://127.0.0.1:{port}/ws",), core, WallClock(), loop, 10.0)


def _lacking(lines: list[Line], logs: list[PortLog], length: float) -> float:
    """Largest share of the frames due in some seconds that didn't come to a viewer."""
    for line, log in zip(lines, logs, strict=True):
        line.wait(partial(_have, log, -np.inf), PATIENCE)
    begin = max(log.frames[0][0].made_at if log.frames else np.inf for log in logs)
    end = begin + length
    for line, log in zip(lines, logs, strict=True):
        line.wait(partial(_have, log, end), length + PATIENCE)
    counts = [sum(begin <= frame.made_at < end for frame, _ in log.frames) for log in logs]
    return max(0.0, 1.0 - min(counts) / (RATE * length))


def _have(log: PortLog, t: float) -> bool:
    """Whether a frame came that was made at a time [s] or later."""
    return bool(log.frames) and log.frames[-1][0].made_at >= t
