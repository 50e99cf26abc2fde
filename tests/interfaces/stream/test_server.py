"""The server on real loopback sockets."""

import asyncio
import base64
import json
import os
import socket
import struct
import time
import urllib.error
import urllib.request

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from interfaces.messages import Follow, ViewForm, control
from interfaces.messages.control import Ping, Role
from interfaces.stream.codec import LARGEST, Encoding, decode, encode
from interfaces.stream.hub import HubSession
from interfaces.stream.invitations import Invitations
from tests.interfaces.stream.served import ADMIN, served
from tests.interfaces.stream.test_session import COMING

PROTOCOLS = [str(encoding) for encoding in Encoding]


def url(serving, host="127.0.0.1"):
    return f"ws://{host}:{serving.port}/ws"


def read(data):
    encoding = Encoding.JSON if isinstance(data, str) else Encoding.MSGPACK
    raw = data.encode() if isinstance(data, str) else data
    return decode(raw, encoding, allowed=COMING, largest=4 * LARGEST)


async def wait(socket, kind, timeout=5.0):
    async with asyncio.timeout(timeout):
        while True:
            message = read(await socket.recv())
            if message.kind == kind:
                return message


async def ended(connection, data):
    await connection.send(data)
    await wait(connection, "nothing")


async def greeted(serving, *, encoding=Encoding.MSGPACK, role=Role.VIEWER):
    connection = await connect(url(serving), subprotocols=[str(encoding)], compression=None, proxy=None)
    hello = encode(control.Hello(control.PROTOCOL, role, "peer"), encoding)
    await connection.send(hello.decode() if encoding is Encoding.JSON else hello)
    await wait(connection, "welcome")
    return connection


def test_both_encodings_health_and_frames():
    async def talk(serving):
        for encoding in Encoding:
            connection = await greeted(serving, encoding=encoding)
            follow = encode(Follow(1, ViewForm.FRAMES, 60.0), encoding)
            await connection.send(follow.decode() if encoding is Encoding.JSON else follow)
            first = await wait(connection, "broadcast")
            assert (await wait(connection, "broadcast")).frame.number > first.frame.number
            await connection.close()

    with served() as serving:
        asyncio.run(talk(serving))
        with urllib.request.urlopen(f"http://localhost:{serving.port}/health", timeout=5) as answer:
            health = json.load(answer)
        assert (health["ok"], health["robot"], health["lease"]) == (True, "puma560", "free")


def test_t03_without_a_token_health_says_whether_all_is_well_and_no_more():
    with served(invitations=Invitations(0.0)) as serving:
        request = urllib.request.Request(f"http://127.0.0.1:{serving.port}/health")
        with urllib.request.urlopen(request, timeout=5) as answer:
            assert json.load(answer) == {"ok": True}
        request.add_header("Authorization", f"Bearer {ADMIN}")
        with urllib.request.urlopen(request, timeout=5) as answer:
            assert json.load(answer)["robot"] == "puma560"


def test_t06_other_hosts_other_pages_and_other_protocols_are_refused():
    async def refused(serving, **options):
        with pytest.raises(InvalidStatus) as caught:
            await connect(url(serving), compression=None, proxy=None, **options)
        return caught.value.response.status_code

    async def talk(serving):
        assert await refused(serving, subprotocols=PROTOCOLS, origin="http://evil.example") == 403
        assert await refused(serving, subprotocols=PROTOCOLS, origin=f"http://localhost:{serving.port + 1}") == 403
        assert await refused(serving, subprotocols=["other"]) == 403
        assert await refused(serving) == 403
        own = f"http://localhost:{serving.port}"
        async with connect(url(serving), subprotocols=PROTOCOLS, origin=own, proxy=None) as connection:
            assert connection.subprotocol in PROTOCOLS

    with served() as serving:
        asyncio.run(talk(serving))
        for header, value in (("Host", "evil.example"), ("Origin", "http://evil.example")):
            request = urllib.request.Request(f"http://127.0.0.1:{serving.port}/health", headers={header: value})
            with pytest.raises(urllib.error.HTTPError) as caught:
                urllib.request.urlopen(request, timeout=5)
            assert caught.value.code == 403
            caught.value.close()


def test_too_large_a_message_closes_the_connection_before_it_is_read():
    async def talk(serving):
        connection, other = await greeted(serving), await greeted(serving)
        with pytest.raises(ConnectionClosed) as caught:
            await ended(connection, b"\xc1" * 65537)
        assert caught.value.rcvd.code == 1009
        await other.send(encode(Ping(1, 0.0), Encoding.MSGPACK))
        assert (await wait(other, "pong")).number == 1
        await other.close()

    with served() as serving:
        asyncio.run(talk(serving))


def handshake(serving, encoding):
    key = base64.b64encode(os.urandom(16)).decode()
    return (
        f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{serving.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
        f"Sec-WebSocket-Protocol: {encoding}\r\n\r\n"
    ).encode()


def frame(message, encoding):
    """A client's frame, its mask zero."""
    data = encode(message, encoding)
    size = struct.pack("!B", 0x80 | len(data)) if len(data) < 126 else struct.pack("!BH", 0x80 | 126, len(data))
    return (b"\x81" if encoding is Encoding.JSON else b"\x82") + size + bytes(4) + data


def stuck(serving):
    """A client that follows at 1000 Hz and reads nothing, with a small buffer."""
    connection = socket.socket()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    connection.connect(("127.0.0.1", serving.port))
    connection.sendall(handshake(serving, Encoding.JSON))
    while b"\r\n\r\n" not in connection.recv(4096, socket.MSG_PEEK):
        time.sleep(0.01)
    for message in (control.Hello(control.PROTOCOL, Role.VIEWER, "stuck"), Follow(1, ViewForm.FRAMES, 1000.0)):
        connection.sendall(frame(message, Encoding.JSON))
    return connection


def test_t11_who_reads_nothing_is_cut_off_and_the_others_get_their_frames():
    async def talk(serving):
        connection = await greeted(serving)
        await connection.send(encode(Follow(1, ViewForm.FRAMES, 60.0), Encoding.MSGPACK))
        first = (await wait(connection, "broadcast")).frame.number
        frames, until = 0, time.monotonic() + 20.0
        while not serving.server.cut_off and time.monotonic() < until:
            last = (await wait(connection, "broadcast")).frame.number
            frames += 1
        await connection.close()
        return frames / (last - first)

    with served(rates=(1000.0, 60.0)) as serving:
        lazy = stuck(serving)
        share = asyncio.run(talk(serving))
        assert serving.server.cut_off == 1
        assert share > 0.9
        lazy.close()


def test_a_thousand_that_come_and_go_leave_no_handle_and_no_task():
    async def one(serving, k):
        reader, writer = await asyncio.open_connection("127.0.0.1", serving.port)
        writer.write(handshake(serving, Encoding.MSGPACK))
        await reader.readuntil(b"\r\n\r\n")
        writer.write(frame(control.Hello(control.PROTOCOL, Role.VIEWER, "peer"), Encoding.MSGPACK))
        writer.write(frame(Follow(1, ViewForm.FRAMES, 60.0), Encoding.MSGPACK))
        await reader.readuntil(b"welcome")
        if k % 2:
            writer.write(b"\x88\x80" + bytes(4))
            await reader.readuntil(b"\x88")
        writer.transport.abort()
        await asyncio.sleep(0)

    async def churn(serving, count):
        for k in range(0, count, 20):
            await asyncio.gather(*(one(serving, k + i) for i in range(20)))

    def left(serving):
        until = time.monotonic() + 10.0
        while time.monotonic() < until:
            tasks = len(asyncio.all_tasks(serving.loop))
            if (serving.hub.sessions, serving.hub.seats) == ((), 0):
                break
            time.sleep(0.05)
        assert (serving.hub.sessions, serving.hub.seats) == ((), 0)
        time.sleep(0.2)
        return len(os.listdir("/proc/self/fd")), tasks

    with served() as serving:
        asyncio.run(churn(serving, 40))
        before = left(serving)
        asyncio.run(churn(serving, 1000))
        after = left(serving)
        assert after[0] <= before[0] + 1
        assert after[1] <= before[1] + 2


def test_a_machine_that_stood_still_is_charged_to_no_client(monkeypatch):
    receive = HubSession.receive

    def slow(self, data, *, now):
        time.sleep(0.3)
        receive(self, data, now=now)

    async def talk(serving):
        connection = await greeted(serving)
        monkeypatch.undo()
        begun = time.monotonic()
        await connection.send(encode(Ping(1, 0.0), Encoding.MSGPACK))
        await wait(connection, "pong")
        await connection.close()
        return time.monotonic() - begun

    with served() as serving:
        monkeypatch.setattr(HubSession, "receive", slow)
        assert asyncio.run(talk(serving)) < 4.0


def test_a_fault_of_ours_ends_one_connection_only(monkeypatch, caplog):
    from vrs.errors import VrsError

    receive = HubSession.receive

    def faulty(self, data, *, now):
        if b"\xc1" in data:
            raise VrsError("planted")
        receive(self, data, now=now)

    async def talk(serving):
        connection, other = await greeted(serving), await greeted(serving)
        with pytest.raises(ConnectionClosed):
            await ended(connection, b"\xc1")
        await other.send(encode(Ping(1, 0.0), Encoding.MSGPACK))
        await wait(other, "pong")
        await other.close()

    monkeypatch.setattr(HubSession, "receive", faulty)
    with served() as serving:
        asyncio.run(talk(serving))
    assert "planted" in caplog.text


def test_the_end_is_told_and_leaves_nothing_open():
    async def talk(serving):
        connection = await greeted(serving)
        serving.end()
        with pytest.raises(ConnectionClosed) as caught:
            await wait(connection, "nothing")
        return caught.value.rcvd.code

    with served() as serving:
        port = serving.port
        assert asyncio.run(talk(serving)) == 1012
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", port), timeout=2)
