"""Listening sockets, and uvicorn with every buffer bounded; a thin shell."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from asyncio.transports import BaseTransport, Transport
from collections.abc import AsyncIterator, Iterable, Iterator
from typing import cast

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Opcode
from websockets.http11 import Request

from vrs.errors import FormatError

LARGEST_MESSAGE = 65536
"""Largest message that is received [bytes]."""
KERNEL_BUFFER = 16384
"""Size of a socket's buffers [bytes]; Linux takes twice that."""
HIGH, LOW = 16384, 4096
"""Bytes waiting in the process beyond which a sender waits, and down to which it does."""
MOST_CONNECTIONS = 2048
"""Connections that are open at once, of any kind."""
FIRST_REQUEST = 5.0
"""Time for the first request of a connection [s]."""
_GRACE = 1.0
"""Time for handlers to end when a server stops [s]."""


class BoundedHttp(H11Protocol):
    """HTTP on a connection that must ask for something soon."""

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]
        """Take a connection, unless there are too many."""
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()
            return
        self.loop.call_later(FIRST_REQUEST, self._check)

    def _check(self) -> None:
        if self.transport.get_protocol() is self and self.cycle is None:
            self.transport.abort()


class BoundedWebSocket(WebSocketsSansIOProtocol):
    """A WebSocket whose sender waits early, and which the application is given: `scope["state"]["socket"]`."""

    def connection_made(self, transport: BaseTransport) -> None:
        """Take over a connection."""
        super().connection_made(transport)
        cast("Transport", transport).set_write_buffer_limits(HIGH, LOW)

    def handle_connect(self, event: Request) -> None:
        """Take the handshake."""
        super().handle_connect(event)
        if self.response.status_code == 101:
            self.scope["state"]["socket"] = self

    async def put(self, data: bytes, opcode: Opcode) -> None:
        """Send a whole message as one frame; that takes a third of the time that `send` does.

        Args:
            data: The message.
            opcode: TEXT or BINARY.

        Raises:
            ConnectionResetError: If the connection is closed.
        """
        if not self.writable.is_set():
            await self.writable.wait()
        if self.disconnected or self.close_sent:
            raise ConnectionResetError
        size, first = len(data), 0x80 | opcode
        if size < 126:
            head = bytes((first, size))
        elif size < 65536:
            head = bytes((first, 126, size >> 8, size & 255))
        else:
            head = bytes((first, 127)) + size.to_bytes(8, "big")
        self.transport.write(head + data)

    def abort(self) -> None:
        """Cut the connection off; what waits to be sent is dropped."""
        self.transport.abort()

    def waiting(self) -> int:
        """Bytes that wait in this process to be sent."""
        return self.transport.get_write_buffer_size()


class _Server(uvicorn.Server):
    """Leaves signals to whoever runs it."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def bind(host: str = "127.0.0.1", port: int = 0) -> socket.socket:
    """Make a listening socket with small buffers, which its connections inherit.

    Args:
        host: An address or name of this machine.
        port: 0 for any that's free; the socket says which.

    Raises:
        FormatError: If that can't be listened on.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listening = socket.socket(family, kind, protocol)
    except OSError as error:
        raise FormatError(f"{host}:{port}", error.strerror or "no such address") from None
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, KERNEL_BUFFER)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, KERNEL_BUFFER)
        listening.setblocking(False)
        listening.bind(address)
        listening.listen(256)
    except OSError as error:
        listening.close()
        raise FormatError(f"{host}:{port}", error.strerror or "can't be listened on") from None
    return listening


@contextlib.asynccontextmanager
async def serve(app: object, listening: socket.socket, *, largest: int = LARGEST_MESSAGE) -> AsyncIterator[None]:
    """Serve an ASGI application on a socket, which is closed in the end, with all its connections.

    Args:
        app: The application.
        listening: From `bind`.
        largest: Largest message that is received [bytes].
    """
    config = uvicorn.Config(
        app,  # type: ignore[arg-type]
        http=BoundedHttp,
        ws=BoundedWebSocket,
        ws_max_size=largest,
        ws_per_message_deflate=False,
        lifespan="off",
        log_config=None,
        access_log=False,
        server_header=False,
        date_header=False,
        timeout_graceful_shutdown=1,
    )
    server = _Server(config)
    task = asyncio.create_task(server.serve(sockets=[listening]))
    try:
        while not server.started and not task.done():
            await asyncio.sleep(0.002)
        yield
    finally:
        server.should_exit = True
        connections = server.server_state.connections
        asyncio.get_running_loop().call_later(_GRACE, _abort_all, connections)
        await task
        _abort_all(connections)


def _abort_all(connections: Iterable[object]) -> None:
    for connection in list(connections):
        transport = getattr(connection, "transport", None)
        if transport is not None:
            transport.abort()
