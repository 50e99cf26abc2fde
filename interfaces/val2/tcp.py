"""VAL's monitor on plain TCP: one controller, a terminal a connection, one of them in control."""

from __future__ import annotations

import asyncio
import contextlib
import math
import socket
from collections import deque
from collections.abc import AsyncIterator, Callable
from typing import Final

from interfaces.timer import Turning
from interfaces.val2.monitor.monitor import Monitor
from interfaces.val2.monitor.switchboard import Switchboard
from interfaces.val2.monitor.teletype import INTERRUPT, Input, Output
from vrs.clock import Clock

MOST: Final = 16
"""Connections at a time."""
UNREAD: Final = 262_144
"""Bytes that may wait for a reader; what is said beyond them is lost to it."""
TRIES: Final = 3
"""Tokens that may be tried."""
ALIVE: Final = 1.0
"""How often a client that sends no more is looked after while its program runs [s]."""
_READ: Final = 4096
_NEWLINE: Final = "\r\n"
_TOKEN: Final = "Token: "  # noqa: S105 - what is asked
_NUL: Final = b"\0"
"""Nothing, to a terminal; a client that's gone answers it with a reset."""


class TcpTerminal:
    """The terminal of a connection: bytes to lines, what is said to bytes."""

    def __init__(
        self,
        writer: asyncio.StreamWriter,
        terminal: Callable[[str], Monitor | None],
        *,
        locked: bool,
    ) -> None:
        """Begin.

        Args:
            writer: Where to.
            terminal: Makes the monitor for a token; None for a wrong one.
            locked: Whether a token is asked for.
        """
        self._writer, self._terminal = writer, terminal
        self._input, self._output = Input(), Output(_NEWLINE)
        self._lines: deque[str] = deque()
        self.monitor: Monitor | None = None
        self._tries = TRIES if locked else 0
        self._locked = locked
        self._ended = self._told = self._lost = False
        self._looked = 0.0
        self.over = asyncio.Event()
        """Set when it's to be closed."""
        if locked:
            self._send(_TOKEN)

    def feed(self, data: bytes) -> None:
        """Take bytes; none at the end of the input."""
        self._lines.extend(self._input.feed(data) if data else self._input.end())
        self._ended = self._ended or not data

    def advance(self, *, now: float) -> None:
        """Do what is due, and what was typed."""
        if self._writer.transport.is_closing():
            self.leave(now=now)
            return
        if self.monitor is None and not self._unlock(now):
            return
        monitor = self.monitor
        assert monitor is not None
        monitor.advance(now=now)
        self._give()
        while self._lines and not monitor.done:
            self._type(monitor, self._lines.popleft(), now)
        if self._ended and not self._lines:
            if not self._told:
                self._told, self._looked = True, now
                monitor.end_of_input(now=now)
            self._look_after(now)
        self._give()
        if monitor.done:
            self.over.set()

    def _unlock(self, now: float) -> bool:
        """Make the monitor, where a token is asked for once one is right; whether there's one."""
        while self._locked and self._lines and self._tries:
            self._tries -= 1
            self.monitor = self._terminal(self._lines.popleft().strip())
            if self.monitor is not None:
                break
            self._send(f"*Invalid token*{_NEWLINE}{_TOKEN if self._tries else ''}")
        if not self._locked:
            self.monitor = self._terminal("")
        if self.monitor is None:
            if self._ended or not self._tries:
                self.over.set()
            return False
        self.monitor.start(now=now)
        return True

    def _type(self, monitor: Monitor, text: str, now: float) -> None:
        self._output.took()
        if text == INTERRUPT:
            self._send(_NEWLINE)
            monitor.interrupt(now=now)
        else:
            monitor.line(text, now=now)
        self._give()

    def _look_after(self, now: float) -> None:
        if self.monitor is not None and self.monitor.busy and now >= self._looked + ALIVE:
            self._looked = now
            self._writer.write(_NUL)

    def _give(self) -> None:
        assert self.monitor is not None
        self._send(self._output.give(self.monitor.output(), self.monitor.prompt))

    def _send(self, text: str) -> None:
        data = text.encode()
        waiting = self._writer.transport.get_write_buffer_size()
        if waiting + len(data) > UNREAD:
            self._lost = True
            return
        if not data:
            return
        if self._lost:
            self._lost = False
            data = f"{_NEWLINE}*Output lost* it wasn't read{_NEWLINE}".encode() + data
        self._writer.write(data)

    def leave(self, *, now: float) -> None:
        """The connection is gone: what it ran is stopped."""
        if self.monitor is not None:
            self.monitor.leave(now=now)
        self.over.set()

    def next_deadline(self) -> float:
        """When something is due [s]."""
        if self.monitor is None:
            return math.inf
        looked = self._looked + ALIVE if self._told else math.inf
        return min(self.monitor.next_deadline(), looked)


class ValDoor:
    """Terminals at one controller, over TCP."""

    def __init__(
        self,
        board: Switchboard,
        clock: Clock,
        terminal: Callable[[str], Monitor | None],
        *,
        locked: bool = False,
    ) -> None:
        """Begin with `listening`.

        Args:
            board: What all terminals are at.
            clock: Session time.
            terminal: Makes a connection's monitor for a token; None for a wrong one.
            locked: Whether a token is asked for.
        """
        self._board, self._clock, self._terminal, self._locked = board, clock, terminal, locked
        self._connections: set[TcpTerminal] = set()
        self._turning = Turning(clock, self._turn)
        self.port = 0
        """Where it listens."""

    @contextlib.asynccontextmanager
    async def listening(self, listening: socket.socket) -> AsyncIterator[ValDoor]:
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
            for connection in self._connections:
                connection.leave(now=self._clock.now())
            self._turning.stop()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(2.0):
                    while self._connections:
                        await asyncio.sleep(0.01)

    def _turn(self, now: float) -> float:
        self._board.advance(now=now)
        for connection in tuple(self._connections):
            connection.advance(now=now)
        deadlines = [connection.next_deadline() for connection in self._connections]
        return min([self._board.next_deadline(), *deadlines])

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._connections) >= MOST:
            writer.write(f"*Too many terminals* {MOST} at most{_NEWLINE}".encode())
            await _close(writer)
            return
        connection = TcpTerminal(writer, self._terminal, locked=self._locked)
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


async def _close(writer: asyncio.StreamWriter) -> None:
    """Send what waits, and close."""
    with contextlib.suppress(OSError):
        try:
            async with asyncio.timeout(1.0):
                writer.close()
                await writer.wait_closed()
        except TimeoutError:
            writer.transport.abort()
