"""The proxy between real sockets on the loopback interface.

Nothing may come before the model's delay; timers are late by milliseconds, on a busy machine by tens of them,
so that upper bounds are wide. Waits end with an event, never with a sleep.
"""

from __future__ import annotations

import asyncio
import socket
import struct
from dataclasses import replace

import numpy as np
import pytest

from interfaces.link import BernoulliLoss, Conditions, ConstantDelay, delay_profile
from interfaces.link.proxy import Address, Proxy, ProxySettings
from interfaces.link.proxy.tcp import SEGMENT, WINDOW_BYTES
from tests.interfaces.link.proxied import ANY, both_ways, client_of, echo, run, until


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
        await until(lambda: not proxy.tcp.connections)
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
        await until(lambda: not proxy.tcp.connections)

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
        server = proxy.settings.to
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
        await until(lambda: proxy.tcp.connections)
        (connection,) = proxy.tcp.connections
        await until(lambda: connection.server.blocked)
        counts, still = [-1], 0
        while still < 50:
            await asyncio.sleep(0.001)
            counts.append(proxy.statistics()["tcp"]["forward"]["bytes_sent"])
            still = still + 1 if counts[-1] == counts[-2] else 0
        assert counts[-1] < len(data)
        held = connection.client.bytes_in_flight + connection.server.transport.get_write_buffer_size()
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
        await until(lambda: proxy.tcp.connections)
        (connection,) = proxy.tcp.connections
        await until(lambda: connection.client.bytes_in_flight >= WINDOW_BYTES)
        assert not connection.client.transport.is_reading()
        assert connection.client.bytes_in_flight <= WINDOW_BYTES + 262_144
        writer.transport.abort()

    run(scenario, both_ways(Conditions(delay=ConstantDelay("c", 1000.0))), tcp=echo)


def test_many_small_packets_fill_the_window_too(monkeypatch):
    monkeypatch.setattr("interfaces.link.proxy.tcp.WINDOW_PACKETS", 20)

    async def scenario(proxy, clock):
        _, writer = await client_of(proxy)
        await until(lambda: proxy.tcp.connections)
        (connection,) = proxy.tcp.connections
        await until(lambda: connection.server.open)
        for sent in range(1, 21):
            assert connection.client.transport.is_reading()
            writer.write(b"x")
            await until(lambda sent=sent: proxy.statistics()["tcp"]["forward"]["sent"] == sent)
        assert not connection.client.transport.is_reading()
        writer.transport.abort()

    run(scenario, both_ways(Conditions(delay=ConstantDelay("c", 1000.0))), tcp=echo)


def test_a_proxy_may_begin_again_at_once_on_the_same_port():
    async def says_bye(reader, writer):
        writer.write(b"bye")
        writer.close()

    async def scenario(proxy, clock):
        # Who closes first keeps the port for minutes: here the proxy does.
        reader, writer = await client_of(proxy)
        assert await reader.read() == b"bye"
        writer.close()
        await until(lambda: not proxy.tcp.connections)
        proxy.close()
        again = Proxy(replace(proxy.settings, listen=proxy.listening), clock, np.random.default_rng(0))
        await again.start()
        assert again.listening == proxy.listening
        again.close()

    run(scenario, tcp=says_bye)


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
        await until(lambda: not proxy.tcp.connections)
        third = await client_of(proxy)
        third[1].write(b"c")
        assert await third[0].readexactly(1) == b"c"
        third[1].close()
        counts = proxy.statistics()["tcp"]
        assert (counts["accepted"], counts["refused"], counts["most_at_once"]) == (2, 1, 1)

    run(scenario, tcp=echo, most_clients=1)


def test_segments_are_as_long_as_on_an_ethernet():
    assert SEGMENT == 1460
