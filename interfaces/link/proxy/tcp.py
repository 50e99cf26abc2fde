"""TCP through the emulated link: each connection is a byte stream each way over the link's shared paths."""

from __future__ import annotations

import asyncio
import enum
import socket
import struct
from dataclasses import dataclass, replace

import numpy as np

from interfaces.link.conditions import Conditions, LinkPath, Service
from interfaces.link.link import Channel
from interfaces.link.packets import PacketLog
from interfaces.timer import Timer, TimerLateness
from vrs.clock import Clock

SEGMENT = 1460
"""Most bytes in a packet."""
WINDOW_BYTES = 1_048_576
"""Bytes on their way, a direction of a connection, from which its sender waits."""
WINDOW_PACKETS = 8192
"""Packets on their way from which its sender waits."""
CONNECT_TIMEOUT = 10.0
"""Longest wait for the server to accept [s]."""


class _Mark(enum.Enum):
    """What ends a byte stream; it crosses the link behind the bytes."""

    END = "end"
    """The sender has closed its half."""
    ABORT = "abort"
    """The sender has reset the connection."""


@dataclass(slots=True)
class TcpCounts:
    """What happened to connections."""

    accepted: int = 0
    refused: int = 0
    """Beyond the limit on connections."""
    unreachable: int = 0
    """The server didn't accept."""
    aborted: int = 0
    """Ended by a reset from either side, or by a packet lost for good."""
    most_at_once: int = 0


class ProxyDirection:
    """What all connections share in one direction."""

    def __init__(self, conditions: Conditions, path: LinkPath, rng: np.random.Generator) -> None:
        capacity = 2 * (WINDOW_PACKETS + WINDOW_BYTES // SEGMENT)
        self._conditions = replace(conditions, service=Service.IN_ORDER, capacity=capacity)
        self._path, self._rng = path, rng
        self.log = PacketLog(keep=1)

    def stream(self) -> Channel[bytes | _Mark]:
        """A stream for one direction of one connection."""
        return Channel(self._conditions, self._rng, path=self._path, log=self.log)


class TcpProxy:
    """Accepts connections and makes one to the server for each.

    Args:
        target: Host and port of the server, resolved.
        ways: Client to server, and back.
        clock: Tells the time of the link.
        lateness: Told how late timers fire.
        most: Most connections at once.
    """

    def __init__(
        self,
        target: tuple[str, int],
        ways: tuple[ProxyDirection, ProxyDirection],
        clock: Clock,
        lateness: TimerLateness,
        most: int,
    ) -> None:
        self.target, self.ways, self.clock, self.lateness = target, ways, clock, lateness
        self.counts = TcpCounts()
        self._most = most
        self._server: asyncio.Server | None = None
        self.connections: set[_ProxiedConnection] = set()

    async def start(self, listener: socket.socket) -> None:
        """Accept connections on a bound socket."""
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(self._accept, sock=listener)

    def close(self) -> None:
        """Stop listening and abort every connection."""
        if self._server is not None:
            self._server.close()
        for connection in tuple(self.connections):
            connection.abort()

    def _accept(self) -> asyncio.Protocol:
        connection = _ProxiedConnection(self)
        if len(self.connections) >= self._most:
            self.counts.refused += 1
            connection.client.unwanted = True
        else:
            self.counts.accepted += 1
            self.connections.add(connection)
            self.counts.most_at_once = max(self.counts.most_at_once, len(self.connections))
        return connection.client


class _ProxiedConnection:
    """Two sockets and the two streams between them."""

    def __init__(self, proxy: TcpProxy) -> None:
        self._proxy = proxy
        self.client, self.server = (_End(self, way.stream(), proxy) for way in proxy.ways)
        self.client.peer, self.server.peer = self.server, self.client
        self._connecting: asyncio.Task[None] | None = None

    def opened(self, end: _End) -> None:
        """Make the connection to the server as soon as the client's stands; nothing is read before."""
        if end is self.client:
            self._connecting = asyncio.get_running_loop().create_task(self._connect())
        end.throttle()
        end.peer.throttle()

    async def _connect(self) -> None:
        host, port = self._proxy.target
        try:
            async with asyncio.timeout(CONNECT_TIMEOUT):
                await asyncio.get_running_loop().create_connection(lambda: self.server, host, port)
        except OSError:
            self._proxy.counts.unreachable += 1
            self.abort()

    def closed(self) -> None:
        """Forget the connection when both sockets are closed."""
        if self.client.gone and self.server.gone:
            self._forget()

    def broken(self) -> None:
        """End both halves at once: a reset has crossed the link, or a packet is lost for good."""
        self._proxy.counts.aborted += 1
        self.abort()

    def abort(self) -> None:
        """Reset both sockets."""
        if self._connecting is not None:
            self._connecting.cancel()
        self.client.reset()
        self.server.reset()
        self._forget()

    def _forget(self) -> None:
        self.client.stop()
        self.server.stop()
        self._proxy.connections.discard(self)


class _End(asyncio.Protocol):
    """One socket of a connection, and the stream of what is read from it to the other one."""

    peer: _End
    """The other socket."""

    def __init__(self, connection: _ProxiedConnection, stream: Channel[bytes | _Mark], proxy: TcpProxy) -> None:
        self._connection, self._stream, self._clock = connection, stream, proxy.clock
        self._timer = Timer(proxy.clock, self._pump, proxy.lateness)
        self.bytes_in_flight = 0
        """Read and not yet handed to the peer."""
        self.unwanted = self.open = self.gone = self.blocked = False
        self._heard_end = self._said_end = self._stopped = False
        self.transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin; a connection beyond the limit is reset."""
        assert isinstance(transport, asyncio.Transport)
        self.transport, self.open = transport, True
        if self.unwanted:
            self.reset()
        else:
            self._connection.opened(self)

    def data_received(self, data: bytes) -> None:
        """Pass bytes on."""
        self._send(*(data[start : start + SEGMENT] for start in range(0, len(data), SEGMENT)))

    def eof_received(self) -> bool:
        """Pass on that whoever is there has closed its half; ours stays open."""
        self._heard_end = True
        self._send(_Mark.END)
        self._close_when_done()
        return True

    def connection_lost(self, exc: Exception | None) -> None:
        """Pass on a reset; anything else has been passed on before."""
        self.open, self.gone = False, True
        if exc is not None and not self.unwanted and not (self._heard_end and self._said_end):
            self._send(_Mark.ABORT)
        else:
            self._connection.closed()

    def pause_writing(self) -> None:
        """Whoever is there doesn't read: what feeds it waits."""
        self.blocked = True
        self.peer.throttle()

    def resume_writing(self) -> None:
        """Whoever is there reads again."""
        self.blocked = False
        self.peer.throttle()

    def _send(self, *payloads: bytes | _Mark) -> None:
        for payload in payloads:
            size = len(payload) if isinstance(payload, bytes) else 0
            self.bytes_in_flight += size
            self._stream.send(payload, self._clock.now(), size)
        self._pump()

    def _pump(self) -> None:
        """Hand the peer what has arrived, and wait for the next."""
        if self._stopped:
            return
        for delivery in self._stream.receive(self._clock.now()):
            if isinstance(delivery.payload, bytes):
                self.bytes_in_flight -= len(delivery.payload)
            self.peer.take(delivery.payload)
        if self._stream.lost and not self._stopped:
            self._connection.broken()
        if not self._stopped:
            self._timer.set(self._stream.next_deadline())
            self.throttle()

    def throttle(self) -> None:
        """Read, or wait while too much is on its way or the peer takes nothing; nothing is read after the end."""
        if not self.open or self._heard_end or self.transport is None:
            return
        full = self.bytes_in_flight >= WINDOW_BYTES or self._stream.in_flight() >= WINDOW_PACKETS
        if full or self.peer.blocked or not self.peer.open:
            self.transport.pause_reading()
        else:
            self.transport.resume_reading()

    def take(self, payload: bytes | _Mark) -> None:
        """Write bytes, or do what a mark says; a closed socket ignores bytes."""
        if payload is _Mark.ABORT:
            self._connection.broken()
        elif self.open and self.transport is not None:
            if isinstance(payload, bytes):
                self.transport.write(payload)
            else:
                self._said_end = True
                if self.transport.can_write_eof():
                    self.transport.write_eof()
                self._close_when_done()

    def reset(self) -> None:
        """Close so that whoever is there sees a reset."""
        if self.transport is not None and not self.gone:
            self.open = False
            sock = self.transport.get_extra_info("socket")
            if sock is not None and sock.fileno() >= 0:
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            self.transport.abort()
        self.unwanted = True

    def stop(self) -> None:
        """Drop what is on its way."""
        self._stopped = True
        self._timer.set(None)

    def _close_when_done(self) -> None:
        if self._heard_end and self._said_end and self.transport is not None:
            self.open = False
            self.transport.close()
