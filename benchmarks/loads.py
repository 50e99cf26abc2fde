"""Loads on a server of this machine, each a process of its own, bounded in number and time.

`python benchmarks/loads.py KIND PORT SECONDS TOKEN [tls]` says `on` when it's on, ends with its time or its input,
and says then how much it was.
It knows the server from docs/protocol.md and docs/console.md alone.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import json
import os
import select
import socket
import ssl
import struct
import sys
import time
from collections import deque
from collections.abc import Callable

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

HERE = "127.0.0.1"
VIEWERS, WANTS = 30, 450
"""Viewers, and messages a second of each: a tenth less than closes a connection."""
IDLE = 2048
"""Sockets that are held open."""
REOPENED = 500
"""Sockets a second that are opened again where the server closed them."""
CONNECTIONS = 4000
"""Connections a second that come and go."""
HANDSHAKES = 1000
"""Handshakes of TLS a second that are begun."""
LINGERING = 64
"""So many of them are open at once."""
TERMINALS = 64
"""Sockets at the VAL-II port that show no token."""
FLOODERS = 8
"""Clients that send as fast as they can, and come again when they're cut off."""
STALLED = 64
"""Clients that ask for frames and read none."""
DRIPPING = 256
"""Sockets that send a byte of something now and then."""
DRIP = 0.05
"""Time between two bytes of each [s]."""
LOADED = "flood.v2"
"""A program of a megabyte, in the server's directory."""
_TICK = 0.02


def ended() -> bool:
    """Whether standard input has: nothing is ever written there."""
    return bool(select.select([sys.stdin], [], [], 0.0)[0])


def on() -> None:
    """Say that the load is on."""
    print("on", flush=True)


def unverified() -> ssl.SSLContext:
    """TLS to whoever is on this machine."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context


async def _view(port: int, sent: list[int], viewer: int, tls: ssl.SSLContext | None) -> None:
    """One viewer, and how many messages it has sent."""
    begun, url = time.monotonic(), f"{'ws' if tls is None else 'wss'}://{HERE}:{port}/ws"
    async with connect(url, subprotocols=[Subprotocol("vrs.1.json")], proxy=None, ssl=tls) as peer:
        await peer.send('{"type":"hello","protocol":1,"role":"viewer","name":"load"}')
        await peer.send('{"type":"follow","number":1,"form":"segments"}')
        reading = asyncio.create_task(_drop(peer))
        kinds = (
            {"type": "want", "edit": 0},
            {"type": "want", "edit": 1, "index": 0},
            {"type": "survey", "number": 1},
            {"type": "ask", "number": 1},
            {"type": "ping", "number": 1, "t": 0.0},
        )
        texts = [json.dumps(kind) for kind in kinds]
        with contextlib.suppress(ConnectionClosed):
            while True:
                while (count := sent[viewer]) < WANTS * (time.monotonic() - begun):
                    # Mostly what costs most.
                    await peer.send(texts[0 if count % 2 else count // 2 % len(texts)])
                    sent[viewer] += 1
                await asyncio.sleep(_TICK)
        reading.cancel()


async def _drop(peer: ClientConnection) -> None:
    with contextlib.suppress(ConnectionClosed):
        async for _ in peer:
            pass


async def view(port: int, seconds: float, tls: ssl.SSLContext | None) -> None:
    """Viewers at all that they may send."""
    until = time.monotonic() + seconds
    sent = VIEWERS * [0]
    tasks = [asyncio.create_task(_view(port, sent, viewer, tls)) for viewer in range(VIEWERS)]
    await asyncio.sleep(1.0)
    on()
    begun, before = time.monotonic(), sum(sent)
    while time.monotonic() < until and not ended():
        await asyncio.sleep(0.1)
    print(f"{(sum(sent) - before) / (time.monotonic() - begun):.0f} messages a second", flush=True)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


async def _flood(port: int, role: str, flooder: int, sent: list[int], told: set[int]) -> None:
    """One client that sends more than it may, again and again; it notes whether it was told so."""
    text = json.dumps({"type": "order", "number": 1, "epoch": "1", "command": {"type": "stop"}})
    if role == "viewer":
        text = json.dumps({"type": "want", "edit": 0})

    async def read(peer: ClientConnection) -> None:
        with contextlib.suppress(ConnectionClosed):
            async for said in peer:
                if "too-fast" in str(said)[:200]:
                    told.add(flooder)

    while True:
        with contextlib.suppress(ConnectionClosed, OSError):
            async with connect(
                f"ws://{HERE}:{port}/ws", subprotocols=[Subprotocol("vrs.1.json")], proxy=None, close_timeout=0.2
            ) as peer:
                await peer.send(f'{{"type":"hello","protocol":1,"role":"{role}","name":"flood"}}')
                reading = asyncio.create_task(read(peer))
                while not reading.done():
                    for _ in range(100):
                        await peer.send(text)
                        sent[flooder] += 1
                    await asyncio.sleep(0)
        await asyncio.sleep(0.1)


async def flood(port: int, seconds: float, role: str) -> None:
    """Clients of a role that send as fast as they're let."""
    until = time.monotonic() + seconds
    sent, told = FLOODERS * [0], set[int]()
    tasks = [asyncio.create_task(_flood(port, role, flooder, sent, told)) for flooder in range(FLOODERS)]
    await asyncio.sleep(0.5)
    on()
    begun = time.monotonic()
    while time.monotonic() < until and not ended():
        await asyncio.sleep(0.1)
    passed = time.monotonic() - begun
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    print(f"{sum(sent) / passed:.0f} messages a second, {FLOODERS - len(told)} flooders weren't told", flush=True)


async def stall(port: int, seconds: float) -> None:
    """Clients that ask for frames and read none: their sockets have room for little."""
    until = time.monotonic() + seconds
    async with contextlib.AsyncExitStack() as stack:
        for _ in range(STALLED):
            narrow = socket.socket()
            narrow.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            narrow.connect((HERE, port))
            narrow.setblocking(False)
            peer = await stack.enter_async_context(
                connect(f"ws://{HERE}:{port}/ws", sock=narrow, subprotocols=[Subprotocol("vrs.1.json")], proxy=None,
                        max_queue=1, close_timeout=0.1, ping_interval=None)
            )  # fmt: skip
            await peer.send('{"type":"hello","protocol":1,"role":"viewer","name":"stalls"}')
            await peer.send('{"type":"follow","number":1,"form":"frames","rate":60}')
        on()
        while time.monotonic() < until and not ended():
            await asyncio.sleep(0.1)
        print(f"{STALLED} that read nothing", flush=True)


def drip(port: int, seconds: float) -> None:
    """Sockets that send a byte of a header, of a body or of a frame now and then; opened again where closed."""
    until, opened = time.monotonic() + seconds, 0
    peers = [_idle(port, number) for number in range(DRIPPING)]
    on()
    while time.monotonic() < until and not ended():
        for number, peer in enumerate(peers):
            try:
                peer.send(b"x")
                closed = _is_closed(peer)
            except OSError:
                closed = True
            if closed:
                peer.close()
                with contextlib.suppress(OSError):
                    peers[number] = _idle(port, number)
                opened += 1
        time.sleep(DRIP)
    for peer in peers:
        peer.close()
    print(f"{DRIPPING} that drip, {opened} opened again", flush=True)


def _idle(port: int, number: int) -> socket.socket:
    """A socket that says nothing, or begins a request, or opens a WebSocket and doesn't say who it is."""
    peer = socket.create_connection((HERE, port), timeout=5.0)
    host = f"Host: {HERE}:{port}\r\n"
    if number % 3 == 1:
        peer.sendall(f"GET / HTTP/1.1\r\n{host}".encode())
    elif number % 3 == 2:
        key = base64.b64encode(os.urandom(16)).decode()
        upgrade = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        own = f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Protocol: vrs.1.json\r\n\r\n"
        peer.sendall(f"GET /ws HTTP/1.1\r\n{host}{upgrade}{own}".encode())
    peer.setblocking(False)
    return peer


def _is_closed(peer: socket.socket) -> bool:
    try:
        return peer.recv(4096) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def idle(port: int, seconds: float) -> None:
    """Sockets that are held open, and opened again where they were closed."""
    until = time.monotonic() + seconds
    peers = [_idle(port, number) for number in range(IDLE)]
    on()
    opened = 0
    while time.monotonic() < until and not ended():
        again = 0
        for number, peer in enumerate(peers):
            if again < REOPENED * 0.1 and _is_closed(peer):
                peer.close()
                with contextlib.suppress(OSError):
                    peers[number] = _idle(port, number)
                again += 1
        opened += again
        time.sleep(0.1)
    for peer in peers:
        peer.close()
    print(f"{opened} opened again", flush=True)


def first_message() -> bytes:
    """What begins a handshake; each may begin by the same."""
    out = ssl.MemoryBIO()
    with contextlib.suppress(ssl.SSLWantReadError):
        unverified().wrap_bio(ssl.MemoryBIO(), out, server_hostname=HERE).do_handshake()
    return out.read()


def come_and_go(port: int, seconds: float, rate: int, says: tuple[bytes, bytes], stay: int = 0) -> None:
    """Connections that come, say something in turn, stay till so many others have said it, and go.

    Nobody waits for the server.
    """
    begun, made, answered = time.monotonic(), 0, 0
    on()
    # Closed by a reset: what was closed otherwise keeps its port for a minute.
    linger = struct.pack("ii", 1, 0)
    under_way: deque[socket.socket] = deque()
    said: deque[socket.socket] = deque()
    while (passed := time.monotonic() - begun) < seconds:
        if made % 256 == 0 and ended():
            break
        if made >= rate * passed:
            time.sleep(0.002)
            continue
        peer = socket.socket()
        peer.setblocking(False)
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        peer.connect_ex((HERE, port))
        under_way.append(peer)
        made += 1
        if len(under_way) > LINGERING:
            said.append(under_way.popleft())
            with contextlib.suppress(OSError):
                said[-1].send(says[made % 2])
                answered += 1
        while len(said) > stay:
            said.popleft().close()
    for peer in (*under_way, *said):
        peer.close()
    passed = time.monotonic() - begun
    print(f"{made / passed:.0f} connections a second, {answered / passed:.0f} of them made", flush=True)


def type_on(port: int, seconds: float, token: str) -> None:
    """A terminal that sends lines and loads a megabyte, as fast as it's let; and others without a token."""
    until = time.monotonic() + seconds
    others: list[socket.socket] = []
    with socket.create_connection((HERE, port), timeout=5.0) as peer:
        peer.sendall(f"{token}\r\n".encode())
        on()
        peer.setblocking(False)
        lines = (f"load {LOADED}\r\n" + "x = 1\r\ndo x = x + 1\r\nlistr x\r\n" * 2000).encode()
        sent = 0
        while time.monotonic() < until and not ended():
            with contextlib.suppress(BlockingIOError):
                sent += peer.send(lines[sent % len(lines) :])
            with contextlib.suppress(BlockingIOError):
                while peer.recv(65536):
                    pass
            with contextlib.suppress(OSError):
                others.append(socket.create_connection((HERE, port), timeout=1.0))
            if len(others) > TERMINALS:
                others.pop(0).close()
            time.sleep(0.002)
    for other in others:
        other.close()
    print(f"{sent} bytes of lines", flush=True)


def main(words: list[str]) -> None:
    """Be one load."""
    kind, port, seconds = words[0], int(words[1]), float(words[2])
    tls = unverified() if words[4:] else None
    loads: dict[str, Callable[[], None]] = {
        "viewers": lambda: asyncio.run(view(port, seconds, tls)),
        "idle": lambda: idle(port, seconds),
        "stalled": lambda: asyncio.run(stall(port, seconds)),
        "dripping": lambda: drip(port, seconds),
        "flooding viewers": lambda: asyncio.run(flood(port, seconds, "viewer")),
        "flooding operators": lambda: asyncio.run(flood(port, seconds, "operator")),
        "connections": lambda: come_and_go(port, seconds, CONNECTIONS, (b"G", b"GET / HTTP/1.1\r\nHost")),
        "handshakes": lambda: come_and_go(port, seconds, HANDSHAKES, 2 * (first_message(),), LINGERING),
        "terminals": lambda: type_on(port, seconds, words[3]),
    }
    loads[kind]()


if __name__ == "__main__":
    main(sys.argv[1:])
