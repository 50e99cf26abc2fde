"""UDP through the emulated link: a socket to the server for each client, forgotten when idle."""

from __future__ import annotations

import asyncio
import socket
from dataclasses import dataclass
from typing import Any, TypeAlias

from interfaces.link.link import Channel
from interfaces.timer import Timer, TimerLateness
from vrs.clock import Clock

MAX_DATAGRAM = 65_535
BATCH = 64
"""Datagrams read from one socket before others get their turn."""
HELD_BYTES = 67_108_864
"""Most bytes on their way in one direction."""

SocketAddress: TypeAlias = Any
"""What the socket module takes for an address: its form depends on the family."""


@dataclass(slots=True)
class UdpCounts:
    """What happened to clients and datagrams, beside the link's own statistics."""

    clients: int = 0
    expired: int = 0
    refused: int = 0
    """Datagrams of clients beyond the limit, or for which the machine has no socket."""
    overflowed: int = 0
    """Datagrams dropped because too many bytes were on their way."""
    unsent: int = 0
    """Datagrams that the machine didn't send: no room, or nobody listens at the other end."""
    most_at_once: int = 0


@dataclass(slots=True, eq=False)
class _ProxyClient:
    """One client and its socket to the server."""

    address: SocketAddress
    sock: socket.socket
    last: float
    """When something last passed [s]."""
    pending: int = 0
    """Datagrams on their way from or to it."""


Parcel: TypeAlias = tuple[_ProxyClient, bytes]
"""A datagram on its way."""


class UdpProxy:
    """Passes datagrams between clients and the server.

    Args:
        listener: A bound, non-blocking socket.
        target: Family and address of the server, resolved.
        channels: Client to server, and back.
        clock: Tells the time of the link.
        lateness: Told how late timers fire.
        most: Most clients at once.
        idle: A client is forgotten when nothing has passed for so long [s], and nothing is on its way.
    """

    def __init__(
        self,
        listener: socket.socket,
        target: tuple[socket.AddressFamily, SocketAddress],
        channels: tuple[Channel[Parcel], Channel[Parcel]],
        clock: Clock,
        lateness: TimerLateness,
        *,
        most: int,
        idle: float,
    ) -> None:
        self._listener, self._target, self._clock = listener, target, clock
        self.ways = self._there, self._back = channels
        self._most, self._idle = most, idle
        self._clients: dict[SocketAddress, _ProxyClient] = {}
        self._held = {id(channel): 0 for channel in channels}
        self._pump_timer = Timer(clock, self._pump, lateness)
        self.idle_timer = Timer(clock, self._expire, TimerLateness())
        self.counts = UdpCounts()

    def start(self) -> None:
        """Begin to pass datagrams."""
        asyncio.get_running_loop().add_reader(self._listener, self._from_clients)

    def close(self) -> None:
        """Close every socket; what is on its way is dropped."""
        self._pump_timer.set(None)
        self.idle_timer.set(None)
        asyncio.get_running_loop().remove_reader(self._listener)
        self._listener.close()
        for client in tuple(self._clients.values()):
            self._drop(client)

    def _from_clients(self) -> None:
        for _ in range(BATCH):
            try:
                data, address = self._listener.recvfrom(MAX_DATAGRAM)
            except BlockingIOError:
                break
            except OSError:
                self.counts.unsent += 1
                continue
            client = self._clients.get(address) or self._welcome(address)
            if client is None:
                self.counts.refused += 1
            else:
                self._send(self._there, client, data)
        self._pump()

    def _from_server(self, client: _ProxyClient) -> None:
        for _ in range(BATCH):
            try:
                data = client.sock.recv(MAX_DATAGRAM)
            except BlockingIOError:
                break
            except OSError:
                self.counts.unsent += 1
                continue
            self._send(self._back, client, data)
        self._pump()

    def _welcome(self, address: SocketAddress) -> _ProxyClient | None:
        if len(self._clients) >= self._most:
            return None
        try:
            sock = _connected(*self._target)
        except OSError:
            return None
        client = self._clients[address] = _ProxyClient(address, sock, self._clock.now())
        asyncio.get_running_loop().add_reader(sock, self._from_server, client)
        self.counts.clients += 1
        self.counts.most_at_once = max(self.counts.most_at_once, len(self._clients))
        if len(self._clients) == 1:
            self.idle_timer.set(client.last + self._idle)
        return client

    def _send(self, channel: Channel[Parcel], client: _ProxyClient, data: bytes) -> None:
        client.last = self._clock.now()
        if self._held[id(channel)] + len(data) > HELD_BYTES:
            self.counts.overflowed += 1
            return
        before = channel.in_flight()
        channel.send((client, data), client.last, len(data))
        copies = channel.in_flight() - before
        client.pending += copies
        self._held[id(channel)] += copies * len(data)

    def _pump(self) -> None:
        """Deliver what has arrived, and wait for the next."""
        now = self._clock.now()
        for channel in (self._there, self._back):
            for delivery in channel.receive(now):
                client, data = delivery.payload
                client.pending -= 1
                client.last = now
                self._held[id(channel)] -= len(data)
                try:
                    if channel is self._there:
                        client.sock.send(data)
                    else:
                        self._listener.sendto(data, client.address)
                except OSError:
                    self.counts.unsent += 1
        deadlines = (self._there.next_deadline(), self._back.next_deadline())
        self._pump_timer.set(min((t for t in deadlines if t is not None), default=None))

    def _expire(self) -> None:
        now = self._clock.now()
        for client in tuple(self._clients.values()):
            if client.last + self._idle <= now and not client.pending:
                self._drop(client)
                self.counts.expired += 1
        if self._clients:
            # Who is due already has something on its way, whose arrival moves its time on.
            due = (client.last + self._idle for client in self._clients.values())
            self.idle_timer.set(min((t for t in due if t > now), default=now + self._idle))

    def _drop(self, client: _ProxyClient) -> None:
        asyncio.get_running_loop().remove_reader(client.sock)
        client.sock.close()
        self._clients.pop(client.address, None)


def _connected(family: socket.AddressFamily, target: SocketAddress) -> socket.socket:
    """A non-blocking socket that talks to the server alone.

    Raises:
        OSError: If the machine has none, or no way there.
    """
    sock = socket.socket(family, socket.SOCK_DGRAM)
    try:
        sock.setblocking(False)
        sock.connect(target)
    except OSError:
        sock.close()
        raise
    return sock
