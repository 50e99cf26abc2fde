"""Servers on loopback in a thread, for tests with real sockets and browsers."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import (
    AbstractAsyncContextManager,
    AbstractContextManager,
    asynccontextmanager,
    contextmanager,
    suppress,
)
from typing import Any, TypeVar

from starlette.applications import Starlette
from starlette.routing import BaseRoute
from starlette.types import Receive, Scope, Send

from interfaces.stream import sockets


class Serving:
    """A server in the loop of another thread; made in that loop."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.url = f"http://127.0.0.1:{port}"
        self.loop = asyncio.get_running_loop()
        self.stop = asyncio.Event()
        self.connections: set[Any] = set()
        """Those that are open, as uvicorn knows them, from the first WebSocket on."""

    def end(self) -> None:
        """Let it end soon, unless it has."""
        with suppress(RuntimeError):
            self.loop.call_soon_threadsafe(self.stop.set)

    def call(self, function: Callable[..., Any], *args: Any, **named: Any) -> Any:
        """Call in the server's thread, and wait for it."""

        async def called() -> Any:
            return function(*args, **named)

        return asyncio.run_coroutine_threadsafe(called(), self.loop).result(10.0)


S = TypeVar("S", bound=Serving)


@contextmanager
def beside(context: AbstractAsyncContextManager[S]) -> Iterator[S]:
    """Hold a server's context open in a thread of its own."""
    entered: Future[S] = Future()

    async def hold() -> None:
        async with context as server:
            entered.set_result(server)
            await server.stop.wait()

    with ThreadPoolExecutor(1) as pool:
        done = pool.submit(asyncio.run, hold())
        wait([entered, done], 10.0, FIRST_COMPLETED)
        if not entered.done():
            done.result(0.0)
        server = entered.result(0.0)
        try:
            yield server
        finally:
            server.end()
            done.result(20.0)


@asynccontextmanager
async def _serving(
    routes: Sequence[BaseRoute], port: int, limits: sockets.SocketLimits | None
) -> AsyncIterator[Serving]:
    listening = sockets.bind(port=port)
    inner, server = Starlette(routes=list(routes)), Serving(listening.getsockname()[1])

    async def noting(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "websocket":
            server.connections = scope["state"]["socket"].connections
        await inner(scope, receive, send)

    async with sockets.serve(noting, listening, limits=limits):
        yield server


def served(
    routes: Sequence[BaseRoute], port: int = 0, limits: sockets.SocketLimits | None = None
) -> AbstractContextManager[Serving]:
    """Serve routes on loopback."""
    return beside(_serving(routes, port, limits))
