"""VAL's monitor on plain TCP: one controller, a terminal a connection, one of them in control.

Any web page can send lines to a port of this machine. So each terminal shows a token before anything else, and
what looks like HTTP or TLS is hung up on before a line of it counts.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import re
import socket
from collections import deque
from collections.abc import AsyncIterator, Callable
from typing import Final

from interfaces.stream.limits import Strangers
from interfaces.timer import Turning
from interfaces.val2.monitor.control import SharedController
from interfaces.val2.monitor.monitor import OVERLONG, TerminalMonitor
from interfaces.val2.monitor.teletype import INTERRUPT, Input, Output
from vrs.clock import Clock

MOST: Final = 16
"""Terminals at a time, those that have shown a token."""
MOST_UNAUTHENTICATED: Final = 256
"""Connections at a time that haven't shown one; the oldest gives way to a new one."""
TOKEN_TIMEOUT: Final = 60.0
"""Time for the token [s]."""
UNREAD: Final = 262_144
"""Bytes that may wait for a reader; what is said beyond them is lost to it."""
TOKEN_TRIES: Final = 3
"""Tokens that may be tried."""
TOKEN_CHARACTERS: Final = 4096
"""Characters that may come before the right token."""
SLICE: Final = 8
"""Lines of a terminal that are taken in one turn: others have theirs in between."""
MOST_QUEUED: Final = 64
"""Lines that may wait to be taken; more isn't read meanwhile."""
PROBE_PERIOD: Final = 1.0
"""How often a client that sends no more is looked after while its program runs [s]."""
_READ: Final = 4096
_NEWLINE: Final = "\r\n"
_TOKEN: Final = "Token: "  # noqa: S105 - what is asked
_NUL: Final = b"\0"
"""Nothing, to a terminal; a client that's gone answers it with a reset."""
_OTHER_PROTOCOL: Final = re.compile(
    r"\x16"  # TLS: a handshake record
    r"|[!-~]+[ \t]+(?:[/*]|[a-z][a-z0-9+.-]*://|\S+[ \t]+[a-z]+/[0-9])"  # a request line of any method
    r"|[!#$%&'*+.^_`|~0-9a-z-]+:[ \t]",  # a header line
    re.IGNORECASE,
)
_HEADER: Final = re.compile(r"[!#$%&'*+.^_`|~0-9a-z-]+:", re.IGNORECASE)


class TcpTerminal:
    """The terminal of a connection: bytes to lines, what is said to bytes."""

    def __init__(
        self,
        writer: asyncio.StreamWriter,
        terminal: Callable[[str], TerminalMonitor | None],
        full: Callable[[], bool],
    ) -> None:
        """Ask for a token.

        Args:
            writer: Where to.
            terminal: Makes the monitor for a token; None for a wrong one.
            full: Whether there are as many terminals as there may be.
        """
        self._writer, self._terminal, self._full = writer, terminal, full
        self._input, self._output = Input(), Output(_NEWLINE)
        self._lines: deque[str] = deque()
        self.monitor: TerminalMonitor | None = None
        """None before a token was accepted: nothing is carried out."""
        self._tries, self._characters = TOKEN_TRIES, 0
        self._ended = self._end_announced = False
        self.lost = False
        """Whether output was lost since anything was sent."""
        self._probed_at = 0.0
        self.over = asyncio.Event()
        """Set when it's to be closed."""
        self.may_read = asyncio.Event()
        """Set while more may be read."""
        self.may_read.set()
        self._send(_TOKEN)

    @property
    def unread(self) -> int:
        """Bytes that wait for the reader."""
        return self._writer.transport.get_write_buffer_size()

    def unlock(self, data: bytes, *, now: float) -> bool:
        """Take bytes, none at the end of the input, until a token was accepted; whether it was."""
        self.feed(data)
        return self._unlock(now)

    def feed(self, data: bytes) -> None:
        """Take bytes; none at the end of the input."""
        self._lines.extend(self._input.feed(data) if data else self._input.end())
        self._ended = self._ended or not data
        if len(self._lines) > MOST_QUEUED:
            self.may_read.clear()

    def advance(self, *, now: float) -> None:
        """Do what is due, and what was typed."""
        if self._writer.transport.is_closing():
            self.leave(now=now)
            return
        monitor = self.monitor
        if monitor is None or self.over.is_set():
            return
        monitor.advance(now=now)
        self._give()
        for _ in range(min(SLICE, len(self._lines))):
            if not monitor.done:
                self._type(monitor, self._lines.popleft(), now)
        if len(self._lines) <= MOST_QUEUED:
            self.may_read.set()
        if self._ended and not self._lines:
            if not self._end_announced:
                self._end_announced, self._probed_at = True, now
                monitor.end_of_input(now=now)
            self._probe(now)
        self._give()
        if monitor.done:
            self.over.set()

    def _unlock(self, now: float) -> bool:
        """Make the monitor, once a token is right; whether there's one."""
        while self._lines and not self.over.is_set():
            text = self._lines.popleft().strip()
            self._characters += len(text) + 1
            monitor = self._terminal(text) if text else None
            if monitor is not None and self._full():
                self._send(f"*Too many terminals* {MOST} at most{_NEWLINE}")
                self.over.set()
            elif monitor is not None:
                self.monitor = monitor
                monitor.start(now=now)
                return True
            elif (
                text == OVERLONG
                or self._characters > TOKEN_CHARACTERS
                or _OTHER_PROTOCOL.match(text)
                or _HEADER.match(text)
            ):
                self.over.set()
            elif text:
                self._tries -= 1
                self._send(f"*Invalid token*{_NEWLINE}{_TOKEN if self._tries else ''}")
                if not self._tries:
                    self.over.set()
        begun = self._input.begun.lstrip()
        if self._ended or len(begun) > TOKEN_CHARACTERS or _OTHER_PROTOCOL.match(begun):
            self.over.set()
        return False

    def _type(self, monitor: TerminalMonitor, text: str, now: float) -> None:
        self._output.took()
        if text == INTERRUPT:
            self._send(_NEWLINE)
            monitor.interrupt(now=now)
        else:
            monitor.line(text, now=now)
        self._give()

    def _probe(self, now: float) -> None:
        if self.monitor is not None and self.monitor.busy and now >= self._probed_at + PROBE_PERIOD:
            self._probed_at = now
            self._writer.write(_NUL)

    def _give(self) -> None:
        assert self.monitor is not None
        self._send(self._output.give(self.monitor.output(), self.monitor.prompt))

    def _send(self, text: str) -> None:
        data = text.encode()
        if self.unread + len(data) > UNREAD:
            self.lost = True
            return
        if not data:
            return
        if self.lost:
            self.lost = False
            data = f"{_NEWLINE}*Output lost* it wasn't read{_NEWLINE}".encode() + data
        self._writer.write(data)

    def leave(self, *, now: float) -> None:
        """The connection is gone: what it ran is stopped."""
        if self.monitor is not None:
            self.monitor.leave(now=now)
        self.over.set()

    def next_deadline(self) -> float:
        """When something is due [s]."""
        if self.monitor is None or self.over.is_set():
            return math.inf
        if self._lines:
            return -math.inf
        looked = self._probed_at + PROBE_PERIOD if self._end_announced else math.inf
        return min(self.monitor.next_deadline(), looked)


class TcpTerminalServer:
    """Terminals at one controller, over TCP."""

    def __init__(
        self, shared: SharedController, clock: Clock, terminal: Callable[[str], TerminalMonitor | None]
    ) -> None:
        """Begin with `listening`.

        Args:
            shared: What all terminals are at.
            clock: Session time.
            terminal: Makes a connection's monitor for a token; None for a wrong one.
        """
        self._shared, self._clock, self._terminal = shared, clock, terminal
        self._connections: set[TcpTerminal] = set()
        self._unauthenticated: Strangers[asyncio.StreamWriter] = Strangers(MOST_UNAUTHENTICATED)
        self._turning = Turning(clock, self._turn)
        self.port = 0
        """Where it listens."""

    @property
    def terminals(self) -> tuple[TcpTerminal, ...]:
        """Those that have shown a token."""
        return tuple(self._connections)

    @property
    def unauthenticated(self) -> int:
        """Connections that haven't."""
        return len(self._unauthenticated)

    @contextlib.asynccontextmanager
    async def listening(self, listening: socket.socket) -> AsyncIterator[TcpTerminalServer]:
        """Serve terminals meanwhile.

        Args:
            listening: On a loopback address; it's closed in the end.
        """
        server = await asyncio.start_server(self._serve, sock=listening)
        self.port = listening.getsockname()[1]
        self._turning.start()
        try:
            yield self
        finally:
            server.close()
            for writer in self._unauthenticated:
                writer.transport.abort()
            for connection in self._connections:
                connection.leave(now=self._clock.now())
            self._turning.stop()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(2.0):
                    while self._connections or len(self._unauthenticated):
                        await asyncio.sleep(0.01)

    def _turn(self, now: float) -> float:
        self._shared.advance(now=now)
        for connection in tuple(self._connections):
            connection.advance(now=now)
        deadlines = [connection.next_deadline() for connection in self._connections]
        return min([self._shared.next_deadline(), *deadlines])

    def _full(self) -> bool:
        return len(self._connections) >= MOST

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connection = TcpTerminal(writer, self._terminal, self._full)
        if not await self._let_in(connection, reader, writer):
            await _close(writer)
            return
        self._connections.add(connection)
        self._turning.soon()
        reading = asyncio.create_task(self._read(connection, reader))
        try:
            await connection.over.wait()
        finally:
            reading.cancel()
            connection.leave(now=self._clock.now())
            self._connections.discard(connection)
            await _close(writer)

    async def _let_in(
        self, connection: TcpTerminal, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> bool:
        """Wait for a token; whether one was accepted. Another stranger may be cut off for this one."""
        address = str(writer.get_extra_info("peername", ("",))[0])
        oldest = self._unauthenticated.add(writer, address, until=math.inf)
        if oldest is not None:
            oldest.transport.abort()
        try:
            async with asyncio.timeout(TOKEN_TIMEOUT):
                while not connection.over.is_set():
                    data = await reader.read(_READ)
                    if connection.unlock(data, now=self._clock.now()):
                        return True
                    await asyncio.sleep(0)
        except (OSError, TimeoutError):
            pass
        finally:
            self._unauthenticated.discard(writer)
        return False

    async def _read(self, connection: TcpTerminal, reader: asyncio.StreamReader) -> None:
        data = _NUL
        while data:
            try:
                data = await reader.read(_READ)
            except OSError:
                connection.leave(now=self._clock.now())
                return
            connection.feed(data)
            self._turning.soon()
            await connection.may_read.wait()
            # Others have their turn, too, where there's always something to read.
            await asyncio.sleep(0)


async def _close(writer: asyncio.StreamWriter) -> None:
    """Send what waits, and close."""
    with contextlib.suppress(OSError):
        try:
            async with asyncio.timeout(1.0):
                writer.close()
                await writer.wait_closed()
        except TimeoutError:
            writer.transport.abort()
