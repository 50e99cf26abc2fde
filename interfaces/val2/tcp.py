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
from collections.abc import AsyncIterator, Callable, Iterable
from typing import Final

from typing_extensions import override

from interfaces.stream.access import ENDED, Access
from interfaces.stream.limits import Strangers
from interfaces.stream.sockets import PEOPLE
from interfaces.val2.monitor.monitor import OVERLONG, TerminalMonitor
from interfaces.val2.monitor.teletype import Input, LineTerminal
from interfaces.val2.rooms import TerminalRoom

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
_FOREIGN_LINE: Final = re.compile(rf"{_OTHER_PROTOCOL.pattern}|[!#$%&'*+.^_`|~0-9a-z-]+:", re.IGNORECASE)


class TcpTerminal(LineTerminal):
    """The terminal of a connection that has shown a token."""

    def __init__(
        self, writer: asyncio.StreamWriter, monitor: TerminalMonitor, source: Input, counts: Callable[[], bool]
    ) -> None:
        """Begin.

        Args:
            writer: Where to.
            monitor: Whose terminal it is.
            source: Makes lines of what comes.
            counts: Whether the token that was shown counts still.
        """
        super().__init__(self._write, monitor, source, newline=_NEWLINE, at_once=SLICE)
        self.writer, self.counts = writer, counts
        self.lost = False
        """Whether output was lost since anything was sent."""
        self._probed_at = math.inf
        """When a client that sends no more was looked after [s]; infinity before."""
        self.over = asyncio.Event()
        """Set when it's to be closed."""
        self.may_read = asyncio.Event()
        """Set while more may be read."""
        self.may_read.set()

    @property
    def unread(self) -> int:
        """Bytes that wait for the reader."""
        return self.writer.transport.get_write_buffer_size()

    @override
    def take(self, lines: Iterable[str], *, ended: bool = False) -> None:
        super().take(lines, ended=ended)
        if len(self.lines) > MOST_QUEUED:
            self.may_read.clear()

    @override
    def advance(self, *, now: float) -> None:
        if self.writer.transport.is_closing():
            self.leave(now=now)
        if self.over.is_set():
            return
        super().advance(now=now)
        if len(self.lines) <= MOST_QUEUED:
            self.may_read.set()
        if self.end_announced:
            self._probed_at = min(self._probed_at, now)
            if self.monitor.busy and now >= self._probed_at + PROBE_PERIOD:
                self._probed_at = now
                self.writer.write(_NUL)
        if self.monitor.done:
            self.over.set()

    def _write(self, text: str) -> None:
        data = text.encode()
        if self.unread + len(data) > UNREAD:
            self.lost = True
        elif data:
            told = f"{_NEWLINE}*Output lost* it wasn't read{_NEWLINE}".encode() if self.lost else b""
            self.lost = False
            self.writer.write(told + data)

    def leave(self, *, now: float) -> None:
        """The connection is gone: what it ran is stopped."""
        self.monitor.leave(now=now)
        self.over.set()

    def next_deadline(self) -> float:
        """When something is due [s]."""
        if self.over.is_set():
            return math.inf
        return -math.inf if self.lines else min(self.monitor.next_deadline(), self._probed_at + PROBE_PERIOD)


class TcpTerminalServer:
    """Terminals of a room, over TCP."""

    def __init__(self, room: TerminalRoom, access: Access) -> None:
        """Begin with `listening`.

        Args:
            room: What all terminals are at.
            access: What a terminal's token opens; there's no terminal without one.
        """
        self._room, self._access = room, access
        self._connections: set[TcpTerminal] = set()
        self._unauthenticated: Strangers[asyncio.StreamWriter] = Strangers(MOST_UNAUTHENTICATED)
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
        looking = asyncio.create_task(self._end_admissions())
        try:
            yield self
        finally:
            looking.cancel()
            server.close()
            for writer in self._unauthenticated:
                writer.transport.abort()
            for connection in self._connections:
                connection.leave(now=self._room.clock.now())
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(2.0):
                    while self._connections or len(self._unauthenticated):
                        await asyncio.sleep(0.01)

    async def _end_admissions(self) -> None:
        """Let those go whose tokens have ended."""
        while True:
            await asyncio.sleep(PEOPLE)
            for connection in [one for one in self._connections if not one.counts()]:
                connection.writer.write(f"{_NEWLINE}*Invalid token* {ENDED}{_NEWLINE}".encode())
                connection.leave(now=self._room.clock.now())

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connection = await self._let_in(reader, writer)
        if connection is not None:
            self._connections.add(connection)
            self._room.join(connection)
            reading = asyncio.create_task(self._read(connection, reader))
            try:
                await connection.over.wait()
            finally:
                reading.cancel()
                self._room.leave(connection)
                self._connections.discard(connection)
        with contextlib.suppress(OSError):
            try:
                async with asyncio.timeout(1.0):
                    writer.close()
                    await writer.wait_closed()
            except TimeoutError:
                writer.transport.abort()

    async def _let_in(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> TcpTerminal | None:
        """Wait for a token; the terminal of who shows one. Another stranger may be cut off for this one."""
        address = str(writer.get_extra_info("peername", ("",))[0])
        oldest = self._unauthenticated.add(writer, address, until=math.inf)
        if oldest is not None:
            oldest.transport.abort()
        try:
            async with asyncio.timeout(TOKEN_TIMEOUT):
                return await self._with_token(reader, writer)
        except (OSError, TimeoutError):
            return None
        finally:
            self._unauthenticated.discard(writer)

    async def _with_token(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> TcpTerminal | None:
        """Ask for a token until there's a right one, or who shows none is to be hung up on."""
        source, tries, characters, data = Input(), TOKEN_TRIES, 0, _NUL
        writer.write(_TOKEN.encode())
        while data:
            data = await reader.read(_READ)
            lines = deque(source.feed(data) if data else source.end())
            while lines:
                text = lines.popleft().strip()
                characters += len(text) + 1
                address = str(writer.get_extra_info("peername", ("",))[0])
                found = self._room.monitor(self._access, text, address=address) if text else None
                if found is not None and len(self._connections) >= MOST:
                    writer.write(f"*Too many terminals* {MOST} at most{_NEWLINE}".encode())
                    return None
                if found is not None:
                    monitor, counts = found
                    terminal = TcpTerminal(writer, monitor, source, counts)
                    terminal.take(lines, ended=not data)
                    monitor.start(now=self._room.clock.now())
                    return terminal
                if text == OVERLONG or characters > TOKEN_CHARACTERS or _FOREIGN_LINE.match(text):
                    return None
                if text:
                    tries -= 1
                    writer.write(f"*Invalid token*{_NEWLINE}{_TOKEN if tries else ''}".encode())
                    if not tries:
                        return None
            begun = source.begun.lstrip()
            if len(begun) > TOKEN_CHARACTERS or _OTHER_PROTOCOL.match(begun):
                return None
            await asyncio.sleep(0)
        return None

    async def _read(self, connection: TcpTerminal, reader: asyncio.StreamReader) -> None:
        data = _NUL
        while data:
            try:
                data = await reader.read(_READ)
            except OSError:
                connection.leave(now=self._room.clock.now())
                return
            connection.feed(data)
            self._room.soon()
            await connection.may_read.wait()
            # Others have their turn, too, where there's always something to read.
            await asyncio.sleep(0)
