"""A router, a hub and relays on loopback, each in a thread of its own."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import replace
from typing import Any

from starlette.routing import Mount

from interfaces.messages.control import Role
from interfaces.relay.network import Network, NetworkConfig, prefix
from interfaces.relay.publisher import Publisher
from interfaces.relay.relay import Relay, RelayConfig
from interfaces.station.chain import described
from interfaces.stream.access import Access, hosts
from interfaces.stream.hub import Hub
from interfaces.stream.meshcat.newest import Nodes
from interfaces.stream.server import HubServer, application
from interfaces.stream.sockets import bind, serve
from robots.robot import load
from tests.interfaces.stream.served import make_hub
from tests.interfaces.stream.serving import Serving, beside
from vrs.clock import WallClock

SITE = "bench 1"
KEY = prefix(SITE, "puma560")


def endpoint() -> str:
    """An endpoint of a port that's free."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


class Routing(Serving):
    """A router, where others may put and ask what they like."""

    network: Network


class Published(Serving):
    """A hub that's published."""

    hub: Hub
    publisher: Publisher
    scene: Nodes


class Relayed(Serving):
    """A relay."""

    relay: Relay
    said: list[str]


@contextlib.asynccontextmanager
async def _routing(at: str, to: tuple[str, ...]) -> AsyncIterator[Routing]:
    serving = Routing(0)
    serving.network = Network(NetworkConfig(to, (at,)), WallClock())
    await serving.network.open()
    yield serving
    await serving.network.close()


@contextlib.asynccontextmanager
async def _published(at: str, instance: str, loses: Callable[[], bool]) -> AsyncIterator[Published]:
    clock, listening = WallClock(0.0), bind()
    serving = Published(listening.getsockname()[1])
    serving.hub, serving.scene = make_hub(now=clock.now()), Nodes()
    serving.hub.config = replace(serving.hub.config, instance=instance)
    network = Network(NetworkConfig((at,)), clock)
    put = network.put

    def lossy(key: str, *given: Any, **named: Any) -> None:
        if not loses() or not key.endswith("timeline"):
            put(key, *given, **named)

    network.put = lossy  # type: ignore[method-assign]
    page = described(load("puma560"))
    publisher = serving.publisher = Publisher(
        serving.hub, clock, serving.scene, network, key=KEY, page=page, address=f"{serving.url}/"
    )
    server = HubServer(serving.hub, clock, turned=publisher.turn)
    app = application(server.routes, hosts(["127.0.0.1"], serving.port))
    async with serve(app, listening), server.running(), publisher.running():
        yield serving


@contextlib.asynccontextmanager
async def _relayed(at: str, tokens: dict[Role, str] | None) -> AsyncIterator[Relayed]:
    listening = bind()
    serving = Relayed(listening.getsockname()[1])
    clock, serving.said = WallClock(), []
    access = Access(free=[Role.VIEWER]) if tokens is None else Access(tokens, free=())
    serving.relay = Relay(
        RelayConfig(page=f"{serving.url}/"), Network(NetworkConfig((at,)), clock), access, clock,
        say=serving.said.append,
    )  # fmt: skip
    app = application([Mount("/", serving.relay)], hosts(["127.0.0.1"], serving.port))
    async with serve(app, listening), serving.relay.running():
        yield serving


def routing(at: str, *to: str) -> contextlib.AbstractContextManager[Routing]:
    """A router, and others that it joins."""
    return beside(_routing(at, to))


def published(
    at: str, instance: str = "one", loses: Callable[[], bool] = lambda: False
) -> contextlib.AbstractContextManager[Published]:
    """A hub; what is to be published of the timeline while `loses` says so is lost."""
    return beside(_published(at, instance, loses))


@contextlib.contextmanager
def relayed(at: str, tokens: dict[Role, str] | None = None, *, ready: bool = True) -> Iterator[Relayed]:
    """A relay, which serves."""
    with beside(_relayed(at, tokens)) as serving:
        if ready:
            until(lambda: serving.relay.hub is not None)
        yield serving


def until(ready: Callable[[], Any], timeout: float = 15.0) -> None:
    """Wait until something is so."""
    end = time.monotonic() + timeout
    while not ready():
        assert time.monotonic() < end, "it doesn't come"
        time.sleep(0.01)
