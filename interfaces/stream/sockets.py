"""Listening sockets, and uvicorn with every buffer bounded; a thin shell."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import ssl
from asyncio.transports import BaseTransport, Transport
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, cast

import uvicorn
from starlette.types import Scope
from uvicorn._types import ASGISendEvent
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from uvicorn.server import ServerState
from websockets.exceptions import InvalidState
from websockets.frames import CloseCode, Frame, Opcode
from websockets.http11 import Request

from interfaces.stream.access import ENDED
from interfaces.stream.limits import Bucket, Strangers
from interfaces.system import open_files
from vrs.checks import validated, within
from vrs.clock import processor_time
from vrs.errors import FormatError

if TYPE_CHECKING:
    from uvicorn._types import ASGIReceiveEvent

LARGEST_MESSAGE = 65536
"""Largest message that is received [bytes], and always of who hasn't shown who it is."""
KERNEL_BUFFER = 16384
"""Size of a socket's buffers [bytes]; Linux takes twice that."""
HIGH, LOW = 16384, 4096
"""Bytes waiting in the process beyond which a sender waits, and down to which it does."""
BACKLOG = 128
"""Connections that wait to be accepted. Under a flood all wait as long as this queue is, and who finds it full asks
again: a short one lets a newcomer in sooner."""
FILES = 16384
"""Open files that a server asks the system for; it does with fewer."""
FAREWELL = 2.0
"""Time for a closing handshake, and for what waits to be sent [s]."""
TURNS = 4
"""Connections with HTTP that are served in one round of the loop."""
CUT_OFF = 8
"""Connections that are cut off in one round of the loop."""
PEOPLE = 1.0
"""So often it's looked whether what a WebSocket was let in by counts still [s]."""
_LOOK = 0.1
"""Time between two looks at deadlines [s]."""
CHUNK = 512
"""Bytes of which frames are read at once: many may be in few."""
MOMENT = 1e-3
"""Longest that reading frames of one connection goes on [s], but for one chunk."""
PARTS, PARTS_BURST = 5.0, 100.0
"""Frames that are no whole message, pings and parts of messages, a second for long, and at once: they cost what
messages cost, and no client's limits count them."""
AFTERWARDS = 1000.0
"""Messages that may come after a farewell."""
_LOG = logging.getLogger(__name__)
_GRACE = 1.0
"""Time for handlers to end when a server stops [s]."""


@dataclass(frozen=True, slots=True)
@validated
class SocketLimits:
    """Deadlines of every phase of a connection, and how many there may be that haven't shown who they are."""

    strangers: Annotated[int, within(1, 100_000)] = 512
    """Most unauthenticated connections, 1 to 100,000; the oldest gives way to a new one. They never take more than
    a quarter of the files that may be open."""
    handshake: Annotated[float, within(0.01, 60, "s")] = 5.0
    """Time for the handshake of TLS [s], 0.01 to 60."""
    request: Annotated[float, within(0.01, 60, "s")] = 5.0
    """Time for a request's header, from the connection's beginning or the answer before [s], 0.01 to 60."""
    body: Annotated[float, within(0.01, 60, "s")] = 5.0
    """Time for a request's body [s], 0.01 to 60."""
    hello: Annotated[float, within(0.01, 60, "s")] = 5.0
    """Time for a WebSocket to show who it is, from its upgrade [s], 0.01 to 60."""
    blocked: Annotated[float, within(0.01, 60, "s")] = 10.0
    """A connection is cut off when it hasn't taken HIGH − LOW bytes for so long [s], 0.01 to 60."""
    backlog: Annotated[int, within(1, 4096)] = BACKLOG
    """Connections that wait to be accepted, 1 to 4096."""


_Phase: TypeAlias = Literal["header", "body", "answer"]
"""What a connection with HTTP is at: a request's header is to come, its body is, or it's answered."""


class Turns:
    """Lets few connections of many be served in each round of the loop: many may have sent at once."""

    def __init__(self) -> None:
        self._left = TURNS
        self._waiting: deque[Callable[[], None]] = deque()
        self._armed = False

    def take(self, serve: Callable[[], None]) -> None:
        """Serve a connection, now or in one of the next rounds, in the order of coming."""
        self._waiting.append(serve)
        self._serve()

    def _serve(self) -> None:
        while self._waiting and self._left:
            self._left -= 1
            self._waiting.popleft()()
        if not self._armed and self._left < TURNS:
            self._armed = True
            asyncio.get_running_loop().call_soon(self._renew)

    def _renew(self) -> None:
        self._armed, self._left = False, TURNS
        self._serve()


class ConnectionState(ServerState):
    """What the connections of a server share."""

    def __init__(self, limits: SocketLimits) -> None:
        super().__init__()
        self.limits = limits
        self.turns = Turns()
        self.strangers: Strangers[_Bounded | _Handshake] = Strangers(
            max(1, min(limits.strangers, open_files(FILES) // 4))
        )
        self.admitted: dict[BoundedWebSocket, tuple[Callable[[], bool], int]] = {}
        """WebSockets that were let in: whether what they showed counts still, and the close code if it doesn't."""


class _Bounded(asyncio.Protocol):
    """A connection with deadlines: of the phase that it's in, and of what waits to be sent."""

    loop: asyncio.AbstractEventLoop
    client: tuple[str, int] | None
    transport: asyncio.Transport

    def __init__(
        self,
        config: uvicorn.Config,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        super().__init__(config, server_state, app_state, _loop)  # type: ignore[call-arg]
        self._state = cast("ConnectionState", server_state)
        self._phase_until = self._sent_until = float("inf")

    def _enter(self, seconds: float) -> None:
        """Come in as a stranger, with a first phase that may take so long [s]; another may be cut off for it."""
        self._phase_until = self.loop.time() + seconds
        address = "" if self.client is None else self.client[0]
        oldest = self._state.strangers.add(self, address, until=self._phase_until)
        if oldest is not None:
            oldest.abort()

    def _begin_phase(self, seconds: float = float("inf")) -> None:
        """Begin a phase that may take so long [s]."""
        self._phase_until = self.loop.time() + seconds
        self._expect()

    def _expect(self) -> None:
        self._state.strangers.expect(self, until=min(self._phase_until, self._sent_until))

    def pause_writing(self) -> None:
        """Wait for the reader, but not for ever."""
        super().pause_writing()
        self._sent_until = self.loop.time() + self._state.limits.blocked
        self._expect()

    def resume_writing(self) -> None:
        """Go on: it reads."""
        super().resume_writing()
        self._sent_until = float("inf")
        self._state.strangers.renew(self)
        self._expect()

    def connection_lost(self, exc: Exception | None) -> None:
        """Let it go."""
        super().connection_lost(exc)
        self._state.strangers.discard(self)

    def abort(self) -> None:
        """Cut the connection off; what waits to be sent is dropped."""
        self.transport.abort()


@dataclass(frozen=True, slots=True, eq=False)
class _Handshake:
    """A connection that is at the handshake of TLS: a stranger, as any. HTTP follows."""

    connection: socket.socket

    def abort(self) -> None:
        """Cut the connection off: the handshake finds its end, and whoever has the socket then closes it."""
        with contextlib.suppress(OSError):
            self.connection.shutdown(socket.SHUT_RDWR)


class BoundedHttp(_Bounded, H11Protocol):
    """HTTP on a connection, each phase of which has a deadline."""

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]
        """Take a connection."""
        super().connection_made(transport)
        transport.set_write_buffer_limits(HIGH, LOW)
        self._phase: _Phase = "header"
        self._unread = b""
        self._enter(self._state.limits.request)

    def connection_lost(self, exc: Exception | None) -> None:
        """Let it go, and leave no timer that would keep it."""
        super().connection_lost(exc)
        self._unset_keepalive_if_required()

    def data_received(self, data: bytes) -> None:
        """Wait for one's turn with what has come; no more is read meanwhile."""
        waits, self._unread = bool(self._unread), self._unread + data
        if not waits:
            self.transport.pause_reading()
            self._state.turns.take(self._take)

    def _take(self) -> None:
        data, self._unread = self._unread, b""
        if self.transport.is_closing():
            return
        if not self.flow.read_paused:
            self.transport.resume_reading()
        super().data_received(data)

    def handle_events(self) -> None:
        """Take what has come."""
        before = self.cycle
        super().handle_events()
        if self.cycle is not before:
            self._state.strangers.renew(self)
            self._phase = "answer"
            self._begin_phase()
        self._look()

    def handle_websocket_upgrade(self, event: Any) -> None:
        """Give the connection to a WebSocket."""
        self._state.strangers.discard(self)
        super().handle_websocket_upgrade(event)

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        self._look()

    def _look(self) -> None:
        """Begin the next phase, if it's another one: what drips doesn't make one longer."""
        phase: _Phase = "answer"
        limits, seconds = self._state.limits, float("inf")
        if self.cycle is None or self.cycle.response_complete:
            phase, seconds = "header", limits.request
        elif self.cycle.more_body:
            phase, seconds = "body", limits.body
        if phase != self._phase:
            self._phase = phase
            self._begin_phase(seconds)


class BoundedWebSocket(_Bounded, WebSocketsSansIOProtocol):
    """A WebSocket whose sender waits early, and which the application is given: `scope["state"]["socket"]`.

    The application says `let_stay` when the other side has shown who it is.
    """

    def connection_made(self, transport: BaseTransport) -> None:
        """Take over a connection."""
        super().connection_made(transport)
        cast("Transport", transport).set_write_buffer_limits(HIGH, LOW)
        self.conn.max_message_size = min(self.config.ws_max_size, LARGEST_MESSAGE)
        self._enter(self._state.limits.hello)
        self._unread = b""
        self._parts = Bucket(PARTS, PARTS_BURST, self.loop.time())
        self._afterwards = Bucket(1.0, AFTERWARDS, self.loop.time())
        self.work = 0.0
        """Processor time that reading frames has taken, until somebody sets it back [s]."""

    def connection_lost(self, exc: Exception | None) -> None:
        """Let it go."""
        super().connection_lost(exc)
        self._state.admitted.pop(self, None)
        # The parser is a generator that holds what holds it.
        self.conn.parser.close()

    def data_received(self, data: bytes) -> None:
        """Read frames, as many as take a moment; the others when those have been taken."""
        self._unread += data
        self._read()

    def _read(self) -> None:
        """Read what is there, until there's a message or a moment is over."""
        worked = processor_time()
        begun = now = self.loop.time()
        # Once it's closed nobody takes messages any more, and the other end's farewell is read all the same.
        while self._unread and (self.queue.empty() or self.close_sent) and now < begun + MOMENT:
            if self.transport.is_closing():
                self._unread = b""
                return
            chunk, self._unread = self._unread[:CHUNK], self._unread[CHUNK:]
            super().data_received(chunk)
            now = self.loop.time()
        self.work += processor_time() - worked
        if self._unread:
            if not self.read_paused:
                self.read_paused = True
                self.transport.pause_reading()
            if self.queue.empty() or self.close_sent:
                self.loop.call_soon(self._read)
        elif self.read_paused and self.queue.empty():
            self.read_paused = False
            self.transport.resume_reading()

    def handle_ping(self) -> None:
        """Answer a ping."""
        if self._may(self._parts):
            super().handle_ping()

    def handle_pong(self, event: Frame) -> None:
        """Take the answer to one."""
        if self._may(self._parts):
            super().handle_pong(event)

    def handle_cont(self, event: Frame) -> None:
        """Take a part of a message."""
        if self._may(self._parts):
            super().handle_cont(event)

    def send_receive_event_to_app(self) -> None:
        """Take a whole message."""
        if not self.close_sent or self._may(self._afterwards):
            super().send_receive_event_to_app()

    def _may(self, allowed: Bucket) -> bool:
        """Whether one more frame may come; else the connection is closed."""
        if self.transport.is_closing():
            return False
        if allowed.take(self.loop.time()):
            return True
        self.end(CloseCode.POLICY_VIOLATION, "too many pings and parts of messages")
        return False

    def end(self, code: int, reason: str) -> None:
        """Close the connection, whatever the application is at.

        Args:
            code: Close code of WebSocket.
            reason: Why, for people; up to 123 bytes.
        """
        if not self.close_sent:
            self.conn.fail(code, reason)
            self.transport.write(b"".join(self.conn.data_to_send()))
            self.close_sent = True
        self.transport.close()
        self._begin_phase(FAREWELL)

    async def receive(self) -> ASGIReceiveEvent:
        """Take the next message; more is read when all that were have been taken."""
        if self._unread and self.queue.empty():
            self._read()
        message = await self.queue.get()
        if self.read_paused and self.queue.empty() and not self._unread:
            self.read_paused = False
            self.transport.resume_reading()
        return message

    def handle_connect(self, event: Request) -> None:
        """Take the handshake."""
        super().handle_connect(event)
        if self.response.status_code == 101:
            self.scope["state"]["socket"] = self

    def shutdown(self) -> None:
        """End the connection, as the server does; it may be ending already, by the other end's farewell."""
        with contextlib.suppress(InvalidState):
            super().shutdown()

    def on_task_complete(self, task: asyncio.Task[None]) -> None:
        """The application is done: what is left ends soon."""
        super().on_task_complete(task)
        del self.scope["state"]["socket"]
        self._begin_phase(FAREWELL)

    def let_stay(
        self, *, known: bool, counts: Callable[[], bool] | None = None, code: int = CloseCode.POLICY_VIOLATION
    ) -> None:
        """Give the connection the sizes that who is known may send, and hold its deadlines off.

        Args:
            known: Whether it has shown who it is.
            counts: Whether what it has shown counts still: the connection ends a second after it doesn't. None: the
                application sees to that.
            code: Close code then.
        """
        if known:
            self.conn.max_message_size = self.config.ws_max_size
            self._state.strangers.know(self)
        if counts is not None:
            self._state.admitted[self] = counts, code
        self._begin_phase()

    async def send(self, message: ASGISendEvent) -> None:
        """Send a message of the application; a farewell has its time.

        Raises:
            ConnectionResetError: If the connection was closed by itself.
        """
        if self.close_sent:
            raise ConnectionResetError
        await super().send(message)
        if message["type"] == "websocket.close":
            self._begin_phase(FAREWELL)

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
        # TLS may know of the end before this connection is told; it complains of each write then.
        if self.disconnected or self.close_sent or self.transport.is_closing():
            raise ConnectionResetError
        size, first = len(data), 0x80 | opcode
        if size < 126:
            head = bytes((first, size))
        elif size < 65536:
            head = bytes((first, 126, size >> 8, size & 255))
        else:
            head = bytes((first, 127)) + size.to_bytes(8, "big")
        self.transport.write(head + data)

    def waiting(self) -> int:
        """Bytes that wait in this process to be sent."""
        return self.transport.get_write_buffer_size()


def let_stay(
    scope: Scope, *, known: bool, counts: Callable[[], bool], code: int = CloseCode.POLICY_VIOLATION
) -> None:
    """Let whoever is at the other side of an application's WebSocket stay.

    Args:
        scope: The application's. Nothing happens where another server than `serve` has it.
        known: Whether it has shown who it is; else it stays as long as nobody else needs its place.
        counts: Whether what it has shown counts still: the connection ends a second after it doesn't.
        code: Close code then.
    """
    connection = scope.get("state", {}).get("socket")
    if isinstance(connection, BoundedWebSocket):
        connection.let_stay(known=known, counts=counts, code=code)


def tls_version(scope: Scope) -> str:
    """The version of TLS that an application's WebSocket comes by, as in `TLSv1.3`; empty for none."""
    connection = scope.get("state", {}).get("socket")
    transport = connection.transport if isinstance(connection, BoundedWebSocket) else None
    spoken = None if transport is None else transport.get_extra_info("ssl_object")
    return "" if spoken is None else str(spoken.version())


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
        listening.listen(BACKLOG)
    except OSError as error:
        listening.close()
        raise FormatError(f"{host}:{port}", error.strerror or "can't be listened on") from None
    return listening


@contextlib.asynccontextmanager
async def serve(
    app: object,
    listening: socket.socket,
    *,
    largest: int = LARGEST_MESSAGE,
    limits: SocketLimits | None = None,
    tls: Callable[[], ssl.SSLContext] | None = None,
) -> AsyncIterator[None]:
    """Serve an ASGI application on a socket, which is closed in the end, with all its connections.

    Args:
        app: The application.
        listening: From `bind`.
        largest: Largest message that is received [bytes].
        limits: Of connections.
        tls: Gives what a handshake is done by, as `ServerTls.context` does; None: nothing is encrypted.
    """
    limits = SocketLimits() if limits is None else limits
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
        backlog=limits.backlog,
    )
    server = uvicorn.Server(config)
    # Signals are left to whoever runs it.
    server.capture_signals = contextlib.nullcontext  # type: ignore[method-assign, assignment]
    server.server_state = state = ConnectionState(limits)
    looking = [asyncio.create_task(look(state)) for look in (_cut_off_overdue, end_admissions)]
    task = asyncio.create_task(server.serve(sockets=[listening] if tls is None else []))
    try:
        while not server.started and not task.done():
            await asyncio.sleep(0.002)
        async with contextlib.AsyncExitStack() as doors:
            if tls is not None:
                await doors.enter_async_context(_tls_door(listening, tls, server, state))
            yield
    finally:
        for one in looking:
            one.cancel()
        server.should_exit = True
        connections = server.server_state.connections
        asyncio.get_running_loop().call_later(_GRACE, _abort_all, connections)
        await task
        _abort_all(connections)


@contextlib.asynccontextmanager
async def _tls_door(
    listening: socket.socket, tls: Callable[[], ssl.SSLContext], server: uvicorn.Server, state: ConnectionState
) -> AsyncIterator[None]:
    """Take connections that speak TLS, and give them to the server when they have shaken hands."""
    loop = asyncio.get_running_loop()
    handshakes: dict[asyncio.Task[None], _Handshake] = {}

    def http() -> BoundedHttp:
        return BoundedHttp(server.config, state, server.lifespan.state, loop)

    async def shake_hands(connection: socket.socket) -> None:
        with contextlib.suppress(OSError):
            await loop.connect_accepted_socket(
                http,
                connection,
                ssl=tls(),
                ssl_handshake_timeout=state.limits.handshake,
                ssl_shutdown_timeout=FAREWELL,
            )

    def done(task: asyncio.Task[None]) -> None:
        state.strangers.discard(handshakes.pop(task))

    async def accept() -> None:
        while True:
            try:
                connection, address = await loop.sock_accept(listening)
            except OSError:
                # It has gone again, or there are too many files.
                await asyncio.sleep(_LOOK)
                continue
            task = asyncio.create_task(shake_hands(connection))
            handshake = handshakes[task] = _Handshake(connection)
            task.add_done_callback(done)
            oldest = state.strangers.add(handshake, str(address[0]), until=loop.time() + state.limits.handshake)
            if oldest is not None:
                oldest.abort()
            # A handshake takes as long as ten requests: they begin one in each round of the loop.
            await asyncio.sleep(0)

    accepting = asyncio.create_task(accept())
    try:
        yield
    finally:
        accepting.cancel()
        for handshake in handshakes.values():
            handshake.abort()
        await asyncio.wait([accepting, *handshakes])
        listening.close()


async def _cut_off_overdue(state: ConnectionState) -> None:
    clock = asyncio.get_running_loop().time
    while True:
        await asyncio.sleep(_LOOK)
        while overdue := state.strangers.overdue(clock())[:CUT_OFF]:
            for connection in overdue:
                state.strangers.discard(connection)
                connection.abort()
            # A thousand may be overdue at once: others have their turn in between.
            await asyncio.sleep(0)


async def end_admissions(state: ConnectionState) -> None:
    """Close WebSockets of a server whose tokens have ended, until it's cancelled."""
    while True:
        await asyncio.sleep(PEOPLE)
        for connection, (counts, code) in list(state.admitted.items()):
            try:
                if not counts():
                    connection.end(code, ENDED)
            except Exception:  # noqa: BLE001 - nobody stays because of it, and the others are looked at
                _LOG.exception("a connection is cut off")
                connection.abort()


def _abort_all(connections: Iterable[object]) -> None:
    for connection in list(connections):
        transport = getattr(connection, "transport", None)
        if transport is not None:
            transport.abort()
