"""The sockets of a client, which connect again by themselves: a thread with an event loop. A thin shell."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Protocol, TypeVar

from interfaces.clients.ports import RemotePort
from interfaces.engine_server.site import earliest
from interfaces.messages.control import Problem, ProtocolError
from interfaces.stream.certificates import Certificate, explained, peer
from interfaces.stream.client import FROM_SERVER, ClientCore, Phase
from interfaces.stream.codec import Encoding
from vrs.clock import Clock
from vrs.errors import VrsError

if TYPE_CHECKING:
    from websockets.asyncio.client import ClientConnection, connect

OPENING = 5.0
"""Time for a connection to stand [s]."""
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 2.0
"""Time before the next attempt to connect [s]: at first, and at most, doubling in between."""
_BLOCKED = 5.0
"""A message that can't be sent for so long ends the connection [s]."""


class UnreachableError(VrsError, ConnectionError):
    """No connection to a server came about, or it refuses this client."""

    def __init__(self, url: str, reason: str) -> None:
        self.url, self.reason = url, reason
        super().__init__(f"{url}: {reason}")


class ClientPart(Protocol):
    """What is moved on in session time while there's a connection."""

    def advance(self, *, now: float) -> object:
        """Do what is due."""

    def next_deadline(self) -> float | None:
        """When something is due [s]."""

    def renew(self) -> None:
        """Begin anew: the server knows nothing any more."""


T = TypeVar("T")


class Line:
    """One client's connections to a server, one after the other, for those that use it from other threads."""

    def __init__(
        self, urls: Sequence[str], core: ClientCore, clock: Clock, loop: asyncio.AbstractEventLoop, timeout: float
    ) -> None:
        """Connect, and wait until the server has said welcome.

        Args:
            urls: Of WebSockets of servers of the same robot, from `server_url`: when a connection doesn't come
                about or ends, the next one is tried.
            core: The client.
            clock: Local time.
            loop: Where it runs, in a thread of its own.
            timeout: How long to wait [s].

        Raises:
            UnreachableError: If the server doesn't say so within the time, or refuses.
        """
        self.url, self.core, self.clock = urls[0], core, clock
        self._urls, self._tried = tuple(urls), 0
        self.changed = threading.Condition(threading.RLock())
        """Lock of all that the client has, and told of whenever something has come."""
        self.parts: list[ClientPart] = []
        self.failure = ""
        """Why the last connection didn't come about or ended."""
        self._loop = loop
        self._sessions = 0
        self._wake = asyncio.Event()
        self._closing = False
        self._done = asyncio.run_coroutine_threadsafe(self._keep(), loop)
        try:
            self._wait_open(timeout)
        except UnreachableError:
            self.close()
            raise

    @property
    def port(self) -> RemotePort:
        """By which the four interfaces reach the engine."""
        return self.core.port

    def now(self) -> float:
        """Session time [s]."""
        with self.changed:
            t = self.core.time(self.clock.now())
        assert t is not None
        return t

    def do(self, action: Callable[[float], T]) -> T:
        """Call something with the session time now [s], under the lock; what it sends, is sent."""
        with self.changed:
            result = action(self.now())
        self.wake()
        return result

    def wait(self, ready: Callable[[], bool], timeout: float) -> bool:
        """Wait, until something is so or the time [s] is over; whether it is."""
        with self.changed:
            return self.changed.wait_for(ready, timeout) if timeout > 0 else ready()

    def add(self, part: ClientPart) -> None:
        """Move a part on from now on."""
        with self.changed:
            self.parts.append(part)
        self.wake()

    def wake(self) -> None:
        """Something is to be sent."""
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._wake.set)

    def _wait_open(self, timeout: float) -> None:
        core = self.core
        with self.changed:
            self.changed.wait_for(
                lambda: core.phase in {Phase.OPEN, Phase.CLOSED} or self._tried >= len(self._urls), timeout=timeout
            )
            if core.phase is not Phase.OPEN:
                said = core.problem.text if isinstance(core.problem, Problem) else ""
                raise UnreachableError(self.url, said or self.failure or f"no answer within {timeout:g} s")

    def close(self) -> None:
        """End the connection."""
        self._closing = True
        self.wake()
        with contextlib.suppress(Exception):
            self._done.result(timeout=OPENING)

    async def _keep(self) -> None:
        from websockets.exceptions import WebSocketException

        pause = FIRST_PAUSE
        while not self._closing and self.core.phase is not Phase.CLOSED:
            try:
                line = dial(self.url, self.core.encoding, largest=FROM_SERVER, opening=OPENING, closing=1.0)
                async with line as socket:
                    await self._converse(socket)
                reason = "the connection ended"
                pause = FIRST_PAUSE
            except (OSError, WebSocketException, ProtocolError, TimeoutError) as error:
                refused = isinstance(error, ConnectionRefusedError)
                reason = "no server listens there" if refused else explained(error, tls=self.url.startswith("wss"))
            with self.changed:
                self.failure, self._tried = reason, self._tried + 1
                self.core.disconnected()
                self.changed.notify_all()
            with contextlib.suppress(TimeoutError):
                if not self._closing:
                    await asyncio.wait_for(self._wait_closing(), pause)
            self.url = self._urls[self._tried % len(self._urls)]
            pause = min(2 * pause, LONGEST_PAUSE)

    async def _wait_closing(self) -> None:
        while not self._closing:
            self._wake.clear()
            await self._wake.wait()

    async def _converse(self, socket: ClientConnection) -> None:
        with self.changed:
            self.failure = ""
            self.core.connected(now=self.clock.now())
        reader = asyncio.create_task(self._read(socket))
        try:
            while not (self._closing or reader.done()):
                out, wait = self._turn()
                for data in out:
                    frame = data if self.core.encoding is Encoding.MSGPACK else data.decode()
                    await asyncio.wait_for(socket.send(frame), _BLOCKED)
                if wait > 0:
                    with contextlib.suppress(TimeoutError):
                        await asyncio.wait_for(self._wake.wait(), wait)
                self._wake.clear()
        finally:
            reader.cancel()
            await asyncio.wait([reader])
        if not reader.cancelled():
            reader.result()

    async def _read(self, socket: ClientConnection) -> None:
        try:
            async for data in socket:
                with self.changed:
                    self.core.receive(data, now=self.clock.now())
                self._wake.set()
        finally:
            self._wake.set()

    def _turn(self) -> tuple[tuple[bytes, ...], float]:
        """What is to be sent, and how long to wait then [s]."""
        core = self.core
        with self.changed:
            now = self.clock.now()
            if core.is_silent(now):
                raise TimeoutError("the server isn't heard any more")
            t = core.time(now)
            deadline = None
            if t is not None and core.phase is Phase.OPEN:
                for part in self._renewed():
                    part.advance(now=t)
                soonest = earliest(*(part.next_deadline() for part in self.parts))
                deadline = None if soonest is None else now + (soonest - t)
            out = core.advance(now=now)
            self.changed.notify_all()
            deadline = earliest(deadline, core.next_deadline())
            return out, 1.0 if deadline is None else min(max(deadline - self.clock.now(), 0.0), 1.0)

    def _renewed(self) -> Iterator[ClientPart]:
        sessions = self.core.sessions
        if sessions != self._sessions:
            if self._sessions:
                for part in self.parts:
                    part.renew()
            self._sessions = sessions
        return iter(self.parts)


def dial(
    url: str,
    encoding: Encoding,
    *,
    largest: int,
    opening: float,
    closing: float,
    certificate: Certificate | None = None,
) -> connect:
    """A connection to enter: not compressed, not by a proxy, and without WebSocket's own pings.

    Args:
        url: From `server_url`.
        encoding: What the server is asked for.
        largest: Longest message that is received [B].
        opening: Longest that it may take to be made [s].
        closing: Longest that a farewell may take [s].
        certificate: What this end shows where it's asked for one.

    Raises:
        InvalidValueError, FormatError: As `peer`.
    """
    from websockets.asyncio.client import connect
    from websockets.typing import Subprotocol

    server = peer(url, certificate)
    return connect(
        server.url,
        ssl=server.context,
        subprotocols=[Subprotocol(encoding.value)],
        compression=None,
        max_size=largest,
        open_timeout=opening,
        close_timeout=closing,
        ping_interval=None,
        proxy=None,
    )
