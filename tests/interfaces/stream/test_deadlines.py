"""Every phase of every connection ends, whatever drips; who hasn't shown who it is keeps nobody out."""

from __future__ import annotations

import asyncio
import gc
import json
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

import pytest
import uvloop
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route
from websockets.server import ServerProtocol
from websockets.sync.client import connect

from interfaces.messages.control import PROTOCOL, Hello, Role
from interfaces.stream import sockets
from interfaces.stream.codec import Encoding, encode
from interfaces.stream.limits import ClientLimits
from interfaces.stream.sockets import SocketLimits
from interfaces.system import open_files
from tests.interfaces.stream import serving
from tests.interfaces.stream.served import ServingHub, served
from tests.interfaces.stream.test_server import frame, handshake

SHORT = SocketLimits(request=0.4, body=0.4, hello=0.4, blocked=0.4)
SLACK = 4.0
"""How much later than its deadline a connection may be cut off on a busy machine [s]."""
DRIP = 0.05
"""Time between two bytes of what drips [s]."""
ROOM = 24
"""Strangers that a small server lets in."""
BODY = b"POST /body HTTP/1.1\r\nHost: x\r\nContent-Length: 1000\r\n\r\n"
SMALL = b"GET /small HTTP/1.1\r\nHost: x\r\n\r\n"
LARGE = b"GET /large HTTP/1.1\r\nHost: x\r\n\r\n"


async def _body(request: Request) -> Response:
    try:
        return PlainTextResponse(str(len(await request.body())))
    except ClientDisconnect:
        return PlainTextResponse("gone")


async def _small(request: Request) -> Response:
    return PlainTextResponse("small")


async def _large(request: Request) -> Response:
    return PlainTextResponse("x" * (1 << 20))


ROUTES = [Route("/body", _body, methods=["POST"]), Route("/small", _small), Route("/large", _large)]


@contextmanager
def dialled(port: int) -> Iterator[socket.socket]:
    with socket.socket() as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.settimeout(10.0)
        connection.connect(("127.0.0.1", port))
        yield connection


def lives(connection: socket.socket, drips: bytes, *, read: bool = True) -> float:
    """How long a connection lives that sends a byte after the other [s]."""
    begun = time.monotonic()
    connection.settimeout(DRIP)
    for k in range(round(10.0 / DRIP)):
        try:
            connection.sendall(drips[k : k + 1])
            if read and connection.recv(65536) == b"":
                break
            if not read:
                time.sleep(DRIP)
        except TimeoutError:
            continue
        except OSError:
            break
    return time.monotonic() - begun


@pytest.mark.parametrize(
    ("first", "drips"),
    [
        (b"", b""),
        (b"", b"G" * 1000),
        (b"GET /small HTTP/1.1\r\n", b"x-long: " + b"x" * 1000),
        (BODY, b""),
        (BODY, b"x" * 900),
        (b"POST /body HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n", b"1\r\nx\r\n" * 100),
        (SMALL, b""),
        (SMALL, b"GET /small HTTP/1.1\r\n" + b"x" * 1000),
        (SMALL * 3, b"G" * 1000),
        (b"POST /small HTTP/1.1\r\nHost: x\r\nContent-Length: 1000\r\n\r\n", b"x" * 900),
    ],
    ids=[
        "nothing", "a first byte", "a header", "no body", "a body", "chunks", "no second request",
        "a second request", "after pipelined ones", "a body that nobody reads",
    ],
)  # fmt: skip
def test_t10_what_drips_over_http_ends(first: bytes, drips: bytes) -> None:
    with serving.served(ROUTES, limits=SHORT) as server, dialled(server.port) as connection:
        connection.sendall(first)
        assert lives(connection, drips) < 2 * 0.4 + SLACK


def test_an_answer_that_nobody_reads_ends_and_one_that_is_read_comes_whole() -> None:
    with serving.served(ROUTES, limits=SHORT) as server:
        with dialled(server.port) as connection:
            connection.sendall(LARGE)
            assert lives(connection, b" " * 1000, read=False) < 2 * 0.4 + SLACK
        with dialled(server.port) as connection:
            connection.sendall(LARGE)
            heard = 0
            while heard < 1 << 20:
                heard += len(connection.recv(65536))


def test_requests_that_come_in_time_are_answered_for_as_long_as_they_come() -> None:
    with serving.served(ROUTES, limits=SHORT) as server, dialled(server.port) as connection:
        for _ in range(8):
            connection.sendall(SMALL)
            heard = b""
            while not heard.endswith(b"small"):
                heard += connection.recv(4096)
            time.sleep(0.1)


HELLO = frame(Hello(PROTOCOL, Role.OPERATOR, "Ada"), Encoding.JSON)


@pytest.mark.parametrize(
    "drips", [b"", HELLO, b"\x81\xfe\xff\xff" + b"x" * 200], ids=["nothing", "a hello", "a long one"]
)
def test_a_websocket_that_does_not_say_who_it_is_ends(drips: bytes) -> None:
    with served(sockets=SHORT) as server, dialled(server.port) as connection:
        connection.sendall(handshake(server, Encoding.JSON))
        assert b" 101 " in connection.recv(4096)
        assert lives(connection, drips) < 0.4 + SLACK


def test_who_has_said_who_it_is_stays() -> None:
    with served(sockets=SHORT) as server, greeted(server) as peer:
        time.sleep(1.0)
        assert pongs(peer)


@contextmanager
def greeted(server: ServingHub, **hello: object) -> Iterator[object]:
    with connect(f"ws://127.0.0.1:{server.port}/ws", subprotocols=["vrs.1.json"], close_timeout=1.0) as peer:
        peer.send(json.dumps({"type": "hello", "protocol": 1, "role": "operator", "name": "Ada", **hello}))
        peer.welcome = until(peer, "welcome")
        yield peer


def until(peer, kind: str):
    while True:
        message = json.loads(peer.recv(timeout=10.0))
        if message["type"] == kind:
            return message


def pongs(peer) -> bool:
    peer.send(json.dumps({"type": "ping", "number": 1, "t": 0.0}))
    return bool(until(peer, "pong"))


@pytest.mark.parametrize("upgraded", [False, True], ids=["silent", "without a hello"])
def test_t10_idle_connections_lock_nobody_out(upgraded: bool) -> None:
    """Neither a newcomer nor an operator who was cut off; who has said who it is stays."""
    with (
        served(sockets=SocketLimits(strangers=ROOM)) as server,
        ExitStack() as idle,
        greeted(server) as operator,
        greeted(server) as there,
    ):
        for _ in range(3 * ROOM):
            connection = idle.enter_context(dialled(server.port))
            if upgraded:
                connection.sendall(handshake(server, Encoding.JSON))
                assert b" 101 " in connection.recv(4096)
        operator.send('{"type":"acquire","number":1}')
        while not (lease := until(operator, "lease")).get("yours"):
            continue
        operator.socket.close()
        with greeted(server, session=operator.welcome["session"]) as back:
            assert back.welcome["resumed"]
            assert back.welcome["lease"]["epoch"] == lease["epoch"]
        assert pongs(there)


def test_of_many_connections_that_send_at_once_few_are_served_in_a_round_of_the_loop() -> None:
    served_in: list[tuple[int, int]] = []

    async def main() -> None:
        turns, rounds = sockets.Turns(), 0
        for number in range(50):
            turns.take(lambda number=number: served_in.append((rounds, number)))
        while len(served_in) < 50:
            await asyncio.sleep(0)
            rounds += 1
            assert rounds < 100
        turns.take(lambda: served_in.append((rounds, 50)))
        assert served_in[-1] == (rounds, 50)

    asyncio.run(main())
    assert [number for _, number in served_in] == list(range(51))
    each = [sum(when == one for when, _ in served_in) for one in {when for when, _ in served_in}]
    assert max(each) <= 2 * sockets.TURNS


PING, BEGIN, PART = (bytes((opcode, 0x80, 0, 0, 0, 0)) for opcode in (0x89, 0x01, 0x00))
"""Empty frames of a client."""


@pytest.mark.parametrize("greets", [False, True], ids=["a stranger", "a client"])
@pytest.mark.parametrize(("first", "flood"), [(b"", PING), (BEGIN, PART)], ids=["pings", "parts"])
def test_frames_that_are_no_messages_close_the_connection(first: bytes, flood: bytes, greets: bool) -> None:
    """No limit of messages counts them: they'd take the processor's time, and what they leave would grow."""
    # Its deadlines are far off: only the frames can end it.
    limits = SocketLimits(hello=60.0)
    with served(sockets=limits, limits=ClientLimits(hello=60.0)) as server, dialled(server.port) as connection:
        connection.sendall(handshake(server, Encoding.JSON))
        if greets:
            connection.sendall(frame(Hello(PROTOCOL, Role.VIEWER, "floods"), Encoding.JSON))
        heard = connection.recv(65536)
        with suppress(OSError):
            connection.sendall(first + flood * 2000)
        with suppress(ConnectionResetError):
            while more := connection.recv(65536):
                heard += more
        assert b"HTTP/1.1 101" in heard
        end = time.monotonic() + 10.0
        while server.hub.sessions and time.monotonic() < end:
            time.sleep(0.01)
        assert not server.hub.sessions


def test_some_pings_and_a_message_in_parts_are_taken() -> None:
    with served() as server, connect(f"ws://127.0.0.1:{server.port}/ws", subprotocols=["vrs.1.json"]) as connection:
        text = encode(Hello(PROTOCOL, Role.VIEWER, "fragments"), Encoding.JSON).decode()
        connection.send(text[k : k + 1] for k in range(len(text)))
        assert json.loads(connection.recv(5.0))["type"] == "welcome"
        for _ in range(20):
            assert connection.ping().wait(5.0)


def test_a_server_asks_for_files_and_leaves_room_for_others() -> None:
    assert sockets.ConnectionState(SocketLimits(strangers=100_000)).strangers.most <= open_files(sockets.FILES) // 4


@pytest.mark.parametrize("first", [b"", SMALL, BODY, b"GET /small"], ids=["silent", "asks", "half", "begins"])
def test_connections_that_are_gone_leave_nothing_for_the_garbage_collector(first: bytes) -> None:
    """Neither in cycles nor with a timer: full collections of what a flood leaves hold the robot's loop up."""
    count = 40

    def come_and_go(port: int) -> None:
        for _ in range(count):
            with dialled(port) as connection:
                connection.sendall(first)
                if first == SMALL:
                    connection.recv(4096)

    def alive() -> int:
        return sum(isinstance(one, sockets.BoundedHttp) for one in gc.get_objects())

    async def scenario() -> None:
        listening, loop = sockets.bind(), asyncio.get_running_loop()
        # A timer of one of these would keep a connection for a minute.
        long = SocketLimits(request=60.0, body=60.0, hello=60.0, blocked=60.0)
        async with sockets.serve(Starlette(routes=ROUTES), listening, limits=long):
            await loop.run_in_executor(None, come_and_go, listening.getsockname()[1])
            gc.collect()
            gc.disable()
            try:
                await loop.run_in_executor(None, come_and_go, listening.getsockname()[1])
                async with asyncio.timeout(20.0):
                    while alive():
                        await asyncio.sleep(0.05)
                assert gc.collect() < count
            finally:
                gc.enable()

    uvloop.run(scenario())


def test_a_websocket_that_is_gone_leaves_nothing_for_the_garbage_collector() -> None:
    with served() as server:
        for _ in range(2):
            gc.collect()
            gc.disable()
            try:
                for _ in range(20):
                    with dialled(server.port) as connection:
                        connection.sendall(handshake(server, Encoding.JSON))
                        connection.recv(4096)
                end = time.monotonic() + 3.0
                while server.hub.sessions and time.monotonic() < end:
                    time.sleep(0.02)
                time.sleep(0.1)
                kinds = sockets.BoundedWebSocket, ServerProtocol
                assert sum(isinstance(one, kinds) for one in gc.get_objects()) <= 2
            finally:
                gc.enable()
