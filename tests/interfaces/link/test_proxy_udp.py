"""Datagrams through the proxy between real sockets on the loopback interface; see `test_proxy`."""

from __future__ import annotations

import asyncio
import errno
import socket

import numpy as np
import pytest

from interfaces.link import Conditions, ConstantDelay, LinkConditions, TraceDelay
from interfaces.link.proxy import Address, Proxy, ProxySettings
from tests.interfaces.link.proxied import ANY, Peer, both_ways, run, udp_client, until
from vrs.clock import ManualClock, OffsetClock, WallClock


def test_statistics_tell_the_ways_apart():
    forward = Conditions(delay=ConstantDelay("there", 0.02))
    backward = Conditions(delay=ConstantDelay("back", 0.01))

    async def scenario(proxy, clock):
        told = proxy.statistics()
        assert told["timers"] == {"count": 0, "late_mean_s": None, "late_max_s": None}
        client = await udp_client(proxy)
        client.transport.sendto(b"a")
        await client.inbox.get()
        client.transport.close()
        told = proxy.statistics()
        assert (told["delay_forward"], told["delay_backward"]) == ("there", "back")
        assert (told["listen"], told["to"]) == (str(proxy.listening), str(proxy.settings.to))
        assert 0.03 <= told["duration_s"] <= clock.now() - began
        assert told["timers"]["count"] == 2
        assert 0.0 <= told["timers"]["late_mean_s"] <= told["timers"]["late_max_s"]
        assert told["udp"]["forward"]["delay_min"] == pytest.approx(0.02)
        assert told["udp"]["backward"]["delay_min"] == pytest.approx(0.01)

    clock = OffsetClock(WallClock(), 1000.0)
    began = clock.now()
    run(scenario, LinkConditions(forward, backward), udp=True, clock=clock)


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


def test_an_idle_udp_client_is_forgotten_when_its_own_time_has_come():
    async def scenario(proxy, clock):
        client = await udp_client(proxy)
        for t in (0.0, 0.01):
            clock.set(t)
            client.transport.sendto(b"a")
            await client.inbox.get()
        idle = proxy.udp.idle_timer.lateness
        clock.set(0.055)
        await until(lambda: idle.count == 1)
        assert proxy.statistics()["udp"]["expired"] == 0
        clock.set(0.065)
        await until(lambda: proxy.statistics()["udp"]["expired"] == 1)
        client.transport.close()

    run(scenario, udp=True, udp_idle=0.05, clock=ManualClock(0.0))


def test_a_udp_client_for_which_there_is_no_socket_is_refused(monkeypatch):
    def none_left(*_):
        raise OSError(errno.EMFILE, "Too many open files")

    async def scenario(proxy, clock):
        client = await udp_client(proxy)
        with monkeypatch.context() as machine:
            machine.setattr(socket, "socket", none_left)
            client.transport.sendto(b"a")
            await until(lambda: proxy.statistics()["udp"]["refused"] == 1)
        client.transport.sendto(b"b")
        assert (await client.inbox.get())[0] == b"b"
        client.transport.close()

    run(scenario, udp=True)


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


def test_datagrams_beyond_the_room_are_dropped_and_counted(monkeypatch):
    monkeypatch.setattr("interfaces.link.proxy.udp.HELD_BYTES", 1000)

    async def scenario(proxy, clock):
        client = await udp_client(proxy)
        for number in (1, 2, 3):
            for _ in range(2):
                client.transport.sendto(bytes(600))
            await until(lambda number=number: proxy.statistics()["udp"]["overflowed"] == number)
            await until(lambda number=number: proxy.statistics()["udp"]["forward"]["arrived"] == 2 * number)
        await until(lambda: proxy.statistics()["udp"]["expired"])
        client.transport.close()

    forward = Conditions(delay=ConstantDelay("c", 0.05), duplicate=1.0)
    run(scenario, LinkConditions(forward, Conditions()), udp_idle=0.1)


def test_a_udp_server_that_is_not_there_is_counted_and_may_come():
    async def scenario(proxy, clock):
        with socket.socket(type=socket.SOCK_DGRAM) as nobody:
            nobody.bind(("127.0.0.1", 0))
            address = nobody.getsockname()
        other = Proxy(ProxySettings(ANY, Address(*address), tcp=False), clock, np.random.default_rng(0))
        await other.start()
        client = await udp_client(other)
        client.transport.sendto(b"a")
        await until(lambda: other.statistics()["udp"]["unsent"] == 1)
        loop = asyncio.get_running_loop()
        server, _ = await loop.create_datagram_endpoint(lambda: Peer(echo=True), local_addr=address)
        client.transport.sendto(b"b")
        assert (await client.inbox.get())[0] == b"b"
        for one in (client.transport, server, other):
            one.close()

    run(scenario, udp=True)


def test_a_full_sized_datagram_passes():
    async def scenario(proxy, clock):
        client = await udp_client(proxy)
        client.transport.sendto(bytes(65_507))
        assert len((await client.inbox.get())[0]) == 65_507
        client.transport.close()

    run(scenario, udp=True)
