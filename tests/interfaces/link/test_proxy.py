"""The proxy between real sockets on the loopback interface.

Nothing may come before the model's delay; timers are late by milliseconds, on a busy machine by tens of them,
so that upper bounds are wide. Waits end with an event, never with a sleep.
"""

from __future__ import annotations

import asyncio
import socket
import struct

import numpy as np
import pytest

from interfaces.link import BernoulliLoss, Conditions, ConstantDelay, LinkConditions, TraceDelay, delay_profile
from interfaces.link.proxy import Address, Proxy, ProxySettings
from interfaces.link.proxy.tcp import SEGMENT, WINDOW_BYTES
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


def run(scenario, conditions=None, *, tcp=None, udp=False, **settings):
    """Run a scenario with a proxy before a server: tcp handles its connections, udp echoes."""

    async def body():
        clock = WallClock()
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


def test_tcp_arrives_whole_and_not_before_the_delay():
    data = np.random.default_rng(1).bytes(300_000)

    async def scenario(proxy, clock):
        reader, writer = await client_of(proxy)
        for _ in range(3):
            began = clock.now()
            writer.write(b"ping")
            assert await reader.readexactly(4) == b"ping"
            assert 0.1 <= clock.now() - began < 2.0
        writer.write(data)
        writer.write_eof()
        assert await reader.read() == data
        await until(lambda: not proxy._tcp.connections)
        writer.close()
        tcp = proxy.statistics()["tcp"]
        assert (tcp["accepted"], tcp["aborted"], tcp["unreachable"]) == (1, 0, 0)
        assert tcp["forward"]["bytes_arrived"] == len(data) + 12
        assert tcp["forward"]["delay_min"] == pytest.approx(0.05)

    run(scenario, both_ways(Conditions(delay=ConstantDelay("c", 0.05))), tcp=echo)


def test_tcp_over_a_lossy_link_is_whole_and_late():
    data = np.random.default_rng(1).bytes(100_000)
    conditions = Conditions(
        delay=delay_profile("domain"), loss=BernoulliLoss(0.2), duplicate=0.2, reorder=0.2, retransmit_after=0.02
    )

    async def scenario(proxy, clock):
        reader, writer = await client_of(proxy)
        writer.write(data)
        writer.write_eof()
        assert await reader.read() == data
        writer.close()
        tcp = proxy.statistics()["tcp"]
        assert tcp["forward"]["resent"] > 0
        assert tcp["forward"]["discarded"] > 0
        assert tcp["forward"]["delay_max"] >= 0.02

    run(scenario, both_ways(conditions), tcp=echo)


def test_half_close_passes_and_the_other_half_goes_on():
    async def answers_after_the_end(reader, writer):
        question = await reader.read()
        writer.write(question[::-1])
        await writer.drain()
        writer.close()

    async def scenario(proxy, clock):
        reader, writer = await client_of(proxy)
        writer.write(b"abc")
        writer.write_eof()
        assert await reader.read() == b"cba"
        writer.close()

    run(scenario, both_ways(Conditions(delay=ConstantDelay("c", 0.02))), tcp=answers_after_the_end)


def reset(writer):
    sock = writer.transport.get_extra_info("socket")
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    writer.transport.abort()


def test_a_reset_by_the_client_reaches_the_server_behind_its_data():
    seen = []

    async def listens(reader, writer):
        try:
            while data := await reader.read(100):
                seen.append(data)
            seen.append("end")
        except ConnectionResetError:
            seen.append("reset")
        writer.close()

    async def scenario(proxy, clock):
        _, writer = await client_of(proxy)
        writer.write(b"last words")
        await until(lambda: proxy.statistics()["tcp"]["forward"]["sent"] == 1)
        began = clock.now()
        reset(writer)
        await until(lambda: "reset" in seen or "end" in seen)
        assert clock.now() - began >= 0.05
        assert seen == [b"last words", "reset"]
        assert proxy.statistics()["tcp"]["aborted"] == 1
        await until(lambda: not proxy._tcp.connections)

    run(scenario, both_ways(Conditions(delay=ConstantDelay("c", 0.05))), tcp=listens)


def test_a_reset_by_the_server_reaches_the_client():
    async def slams(reader, writer):
        await reader.read(1)
        reset(writer)

    async def scenario(proxy, clock):
        reader, writer = await client_of(proxy)
        writer.write(b"x")
        with pytest.raises(ConnectionResetError):
            await reader.read()
        writer.close()

    run(scenario, both_ways(Conditions(delay=ConstantDelay("c", 0.02))), tcp=slams)


def test_a_packet_lost_for_good_resets_both_sides():
    async def scenario(proxy, clock):
        reader, writer = await client_of(proxy)
        writer.write(b"x")
        with pytest.raises(ConnectionResetError):
            await reader.read()
        writer.close()
        assert proxy.statistics()["tcp"]["forward"]["lost"] == {"given-up": 1}

    conditions = Conditions(loss=BernoulliLoss(1.0), retransmit_after=0.01, attempts=3)
    run(scenario, both_ways(conditions), tcp=echo)


def test_a_server_that_is_not_there_resets_the_client():
    async def scenario(proxy, clock):
        server = proxy._settings.to
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            settings = ProxySettings(ANY, Address(server.host, free.getsockname()[1]), udp=False)
            other = Proxy(settings, clock, np.random.default_rng(0))
            await other.start()
            reader, writer = await client_of(other)
            with pytest.raises(ConnectionResetError):
                await reader.read()
            writer.close()
            assert other.statistics()["tcp"]["unreachable"] == 1
            other.close()

    run(scenario, tcp=echo)


def test_a_server_that_does_not_read_holds_back_the_client_not_our_memory():
    release, got = asyncio.Event(), []

    async def reads_late(reader, writer):
        await release.wait()
        got.append(await reader.read())
        writer.close()

    async def scenario(proxy, clock):
        _, writer = await client_of(proxy)
        writer.transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 65536)
        data = bytes(24_000_000)
        writer.write(data)
        await until(lambda: proxy._tcp.connections)
        (connection,) = proxy._tcp.connections
        await until(lambda: connection.server.blocked)
        counts, still = [-1], 0
        while still < 50:
            await asyncio.sleep(0.001)
            counts.append(proxy.statistics()["tcp"]["forward"]["bytes_sent"])
            still = still + 1 if counts[-1] == counts[-2] else 0
        assert counts[-1] < len(data)
        held = connection._flows[0]._bytes + connection.server._transport.get_write_buffer_size()
        assert held <= 2 * WINDOW_BYTES + 262_144
        release.set()
        writer.write_eof()
        await until(lambda: got)
        assert got == [data]
        writer.close()

    run(scenario, both_ways(Conditions(delay=ConstantDelay("c", 0.005))), tcp=reads_late)


def test_a_long_delay_fills_the_window_and_no_more():
    async def scenario(proxy, clock):
        _, writer = await client_of(proxy)
        writer.write(bytes(8 * WINDOW_BYTES))
        await until(lambda: proxy._tcp.connections)
        (connection,) = proxy._tcp.connections
        await until(lambda: connection._flows[0]._bytes >= WINDOW_BYTES)
        assert not connection.client._transport.is_reading()
        assert connection._flows[0]._bytes <= WINDOW_BYTES + 262_144
        writer.transport.abort()

    run(scenario, both_ways(Conditions(delay=ConstantDelay("c", 1000.0))), tcp=echo)


def test_connections_beyond_the_limit_are_reset():
    async def scenario(proxy, clock):
        first = await client_of(proxy)
        first[1].write(b"a")
        assert await first[0].readexactly(1) == b"a"
        second = await client_of(proxy)
        with pytest.raises(ConnectionResetError):
            await second[0].read()
        second[1].close()
        first[1].write(b"b")
        assert await first[0].readexactly(1) == b"b"
        first[1].close()
        await until(lambda: not proxy._tcp.connections)
        third = await client_of(proxy)
        third[1].write(b"c")
        assert await third[0].readexactly(1) == b"c"
        third[1].close()
        counts = proxy.statistics()["tcp"]
        assert (counts["accepted"], counts["refused"], counts["most_at_once"]) == (2, 1, 1)

    run(scenario, tcp=echo, most_clients=1)


def test_udp_passes_both_ways_not_before_the_delay_each_client_its_own():
    async def scenario(proxy, clock):
        clients = [await udp_client(proxy) for _ in range(3)]
        began = clock.now()
        for i, client in enumerate(clients):
            client.transport.sendto(b"from %d" % i)
        for i, client in enumerate(clients):
            data, _ = await client.inbox.get()
            assert data == b"from %d" % i
            assert clock.now() - began >= 0.1
            client.transport.close()
        udp = proxy.statistics()["udp"]
        assert (udp["clients"], udp["most_at_once"], udp["forward"]["arrived"]) == (3, 3, 3)

    run(scenario, both_ways(Conditions(delay=ConstantDelay("c", 0.05))), udp=True)


def test_udp_follows_a_trace_with_losses_and_duplicates():
    forward = Conditions(delay=TraceDelay("trace", (0.08, None, 0.01)), duplicate=0.0)
    backward = Conditions(duplicate=1.0)

    async def scenario(proxy, clock):
        client = await udp_client(proxy)
        for data in (b"slow", b"lost", b"fast"):
            client.transport.sendto(data)
        got = [(await client.inbox.get())[0] for _ in range(4)]
        assert got == [b"fast", b"fast", b"slow", b"slow"]
        udp = proxy.statistics()["udp"]
        assert udp["forward"]["lost"] == {"loss": 1}
        assert udp["backward"]["copies"] == 2
        client.transport.close()

    run(scenario, LinkConditions(forward, backward), udp=True)


def test_an_idle_udp_client_is_forgotten_but_not_its_datagrams_on_the_way():
    forward = Conditions(delay=ConstantDelay("c", 0.3))

    async def scenario(proxy, clock):
        client = await udp_client(proxy)
        client.transport.sendto(b"slow")
        assert (await client.inbox.get())[0] == b"slow"
        await until(lambda: proxy.statistics()["udp"]["expired"] == 1)
        client.transport.sendto(b"again")
        assert (await client.inbox.get())[0] == b"again"
        assert proxy.statistics()["udp"]["clients"] == 2
        client.transport.close()

    run(scenario, LinkConditions(forward, Conditions()), udp=True, udp_idle=0.05)


def test_udp_clients_beyond_the_limit_are_refused():
    async def scenario(proxy, clock):
        first, second = await udp_client(proxy), await udp_client(proxy)
        first.transport.sendto(b"a")
        assert (await first.inbox.get())[0] == b"a"
        second.transport.sendto(b"b")
        await until(lambda: proxy.statistics()["udp"]["refused"] == 1)
        assert second.inbox.empty()
        for client in (first, second):
            client.transport.close()

    run(scenario, udp=True, most_clients=1)


def test_a_full_sized_datagram_passes():
    async def scenario(proxy, clock):
        client = await udp_client(proxy)
        client.transport.sendto(bytes(65_507))
        assert len((await client.inbox.get())[0]) == 65_507
        client.transport.close()

    run(scenario, udp=True)


def test_segments_are_as_long_as_on_an_ethernet():
    assert SEGMENT == 1460
