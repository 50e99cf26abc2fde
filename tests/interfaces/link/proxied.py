"""A proxy between real sockets on the loopback interface, a server behind it, and clients.

Timers are late by milliseconds, on a busy machine by tens of them. Waits end with an event, never with a sleep.
"""

from __future__ import annotations

import asyncio

import numpy as np

from interfaces.link import LinkConditions
from interfaces.link.proxy import Address, Proxy, ProxySettings
from vrs.clock import WallClock

LIMIT = 20.0
"""Longest wait for anything [s]."""
ANY = Address("127.0.0.1", 0)


class Peer(asyncio.DatagramProtocol):
    """A UDP socket that keeps what it got, and may echo."""

    def __init__(self, echo=False):
        self.echo, self.inbox = echo, asyncio.Queue()

    def connection_made(self, transport):
        self.transport = transport

    def datagram_received(self, data, address):
        self.inbox.put_nowait((data, address))
        if self.echo:
            self.transport.sendto(data, address)


def both_ways(conditions):
    return LinkConditions.symmetric(conditions)


def run(scenario, conditions=None, *, tcp=None, udp=False, clock=None, **settings):
    """Run a scenario with a proxy before a server: tcp handles its connections, udp echoes."""
    clock = WallClock() if clock is None else clock

    async def body():
        port, server, transports = 0, None, []
        if tcp is not None:
            server = await asyncio.start_server(tcp, "127.0.0.1", 0)
            port = server.sockets[0].getsockname()[1]
        else:
            transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
                lambda: Peer(echo=udp), local_addr=("127.0.0.1", 0)
            )
            transports.append(transport)
            port = transport.get_extra_info("sockname")[1]
        asked = ProxySettings(
            ANY,
            Address("127.0.0.1", port),
            conditions or LinkConditions(),
            tcp=tcp is not None,
            udp=tcp is None,
            **settings,
        )
        proxy = Proxy(asked, clock, np.random.default_rng(0))
        await proxy.start()
        try:
            async with asyncio.timeout(LIMIT):
                await scenario(proxy, clock)
        finally:
            proxy.close()
            for transport in transports:
                transport.close()
            if server is not None:
                server.close()
                await server.wait_closed()
            await asyncio.sleep(0)
            await asyncio.sleep(0)

    asyncio.run(body())


async def until(condition):
    """Let the loop turn until a condition holds; the limit on the scenario ends a vain wait."""
    while not condition():
        await asyncio.sleep(0.001)


async def client_of(proxy):
    return await asyncio.open_connection(proxy.listening.host, proxy.listening.port)


async def echo(reader, writer):
    while data := await reader.read(65536):
        writer.write(data)
        await writer.drain()
    writer.close()


async def udp_client(proxy):
    address = (proxy.listening.host, proxy.listening.port)
    _, peer = await asyncio.get_running_loop().create_datagram_endpoint(Peer, remote_addr=address)
    return peer
