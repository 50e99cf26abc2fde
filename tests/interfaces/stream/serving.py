"""A server on loopback in a thread, for tests with real sockets and browsers."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.routing import BaseRoute
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol


class Abortable(WebSocketsSansIOProtocol):
    """Lets the application drop a connection at once, and knows few bytes that wait."""

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 16384)

    def handle_connect(self, event: Any) -> None:
        super().handle_connect(event)
        if hasattr(self, "scope"):
            self.scope["extensions"]["vrs.abort"] = self.transport.abort


class Served:
    """A server that runs."""

    def __init__(self, server: uvicorn.Server, loop: asyncio.AbstractEventLoop, port: int) -> None:
        self.server, self.loop, self.port = server, loop, port
        self.url = f"http://127.0.0.1:{port}"

    def call(self, function: Callable[..., Any], *args: Any, **named: Any) -> Any:
        """Call in the server's thread, and wait for it."""

        async def called() -> Any:
            return function(*args, **named)

        return asyncio.run_coroutine_threadsafe(called(), self.loop).result(10.0)


@contextmanager
def served(routes: Sequence[BaseRoute], port: int = 0) -> Iterator[Served]:
    """Serve routes on loopback."""
    listener = socket.create_server(("127.0.0.1", port))
    config = uvicorn.Config(
        Starlette(routes=list(routes)), ws=Abortable, lifespan="off", log_level="error",
        timeout_graceful_shutdown=1, ws_max_size=65536, ws_per_message_deflate=False,
    )  # fmt: skip
    server = uvicorn.Server(config)
    loop = asyncio.new_event_loop()

    def run() -> None:
        loop.run_until_complete(server.serve([listener]))
        loop.run_until_complete(loop.shutdown_asyncgens())
        loop.close()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        while not server.started and thread.is_alive():
            thread.join(0.01)
        yield Served(server, loop, listener.getsockname()[1])
    finally:
        server.should_exit = True
        thread.join(20.0)
        listener.close()
        assert loop.is_closed()
