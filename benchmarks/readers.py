"""Many WebSocket readers in one process, which leave the processor to the server: for `benchmarks.viewers`.

Asked on standard input, a line of JSON each; answers on standard output. Clocks of processes of one machine agree.
"""

from __future__ import annotations

import asyncio
import json
import os
import random
import socket
import struct
import sys
import time
from typing import Any

import msgspec

_HANDSHAKE = (
    "GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Protocol: {encoding}\r\n\r\n"
)
_decode = msgspec.msgpack.Decoder().decode


def masked(data: bytes, *, text: bool = False) -> bytes:
    """A client's frame."""
    head = bytes([0x81 if text else 0x82])
    size = len(data)
    head += bytes([0x80 | size]) if size < 126 else bytes([0x80 | 126]) + struct.pack("!H", size)
    return head + bytes(4) + data


class Reader(asyncio.Protocol):
    """One viewer: notes what comes when."""

    def __init__(self, origin: float, port: int, follow: dict[str, Any], role: str = "viewer") -> None:
        self.origin, self.port, self.follow, self.role = origin, port, follow, role
        self.buffer = bytearray()
        self.open = self.lost = False
        self.ages: list[float] = []
        self.q: list[float] | None = None
        self.rest: list[float] | None = None
        self.changed_at: float | None = None
        self.epoch = 0
        self.first = self.last = self.frames = self.bytes = 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport: Any = transport
        self.transport.write(_HANDSHAKE.format(port=self.port, encoding="vrs.1.msgpack").encode())

    def connection_lost(self, error: Exception | None) -> None:  # noqa: ARG002
        self.lost = True

    def say(self, message: dict[str, Any]) -> None:
        """Send a message."""
        self.transport.write(masked(msgspec.msgpack.encode(message)))

    def data_received(self, data: bytes) -> None:
        now = time.monotonic() - self.origin
        buffer = self.buffer
        buffer += data
        self.bytes += len(data)
        if not self.open:
            end = buffer.find(b"\r\n\r\n")
            if end < 0:
                return
            self.open = True
            del buffer[: end + 4]
            self.say({"type": "hello", "role": self.role, "name": "reader", "protocol": 1})
            self.say(self.follow)
        place, size = 0, len(buffer)
        while size - place >= 2:
            length, start = buffer[place + 1], place + 2
            if length == 126:
                if size - place < 4:
                    break
                length, start = int.from_bytes(buffer[place + 2 : place + 4], "big"), place + 4
            elif length == 127:
                if size - place < 10:
                    break
                length, start = int.from_bytes(buffer[place + 2 : place + 10], "big"), place + 10
            if size - start < length:
                break
            if buffer[place] & 0xF == 2:
                self.take(_decode(bytes(buffer[start : start + length])), now)
            elif buffer[place] & 0xF == 9:
                self.transport.write(bytes([0x8A, 0x80 | length]) + bytes(4) + buffer[start : start + length])
            place = start + length
        del buffer[:place]

    def take(self, message: dict[str, Any], now: float) -> None:
        """Note a message."""
        kind = message["type"]
        if kind == "broadcast":
            number, made, self.q = message["number"], message["made_at"], message["q"]
            if self.changed_at is None and self.q != self.rest:
                self.changed_at = now
        elif kind == "change":
            number, made = message["edit"], None
            if self.changed_at is None:
                self.changed_at = now
        elif kind == "pulse":
            self.ages.append(now - message["now"])
            return
        elif kind == "lease":
            self.epoch = int(message.get("epoch") or 0)
            return
        else:
            return
        if not self.frames:
            self.first = number
        self.frames += 1
        self.last = number
        if made is not None:
            self.ages.append(now - made)

    def begin(self) -> None:
        """Count from now on."""
        self.ages, self.frames, self.bytes = [], 0, 0


async def connect(count: int, origin: float, port: int, follow: dict[str, Any]) -> list[Reader]:
    """So many readers."""
    loop = asyncio.get_running_loop()
    readers: list[Reader] = []
    for _ in range(count):
        _, reader = await loop.create_connection(lambda: Reader(origin, port, follow), "127.0.0.1", port)
        readers.append(reader)
    while not all(reader.ages or reader.lost for reader in readers):
        await asyncio.sleep(0.02)
    return readers


def stuck(port: int, follow: dict[str, Any], receive: int = 4096) -> socket.socket:
    """A connection that follows, in JSON, and of which nobody reads."""
    connection = socket.socket()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive)
    connection.connect(("127.0.0.1", port))
    connection.sendall(_HANDSHAKE.format(port=port, encoding="vrs.1.json").encode())
    hello = {"type": "hello", "role": "viewer", "name": "stuck", "protocol": 1}
    time.sleep(0.1)
    for message in (hello, follow):
        connection.sendall(masked(msgspec.json.encode(message), text=True))
    return connection


async def drip(connection: socket.socket) -> None:
    """Read a little now and then."""
    connection.setblocking(False)
    loop = asyncio.get_running_loop()
    while await loop.sock_recv(connection, 100):
        await asyncio.sleep(0.05)


async def latency(origin: float, port: int, trials: int, form: str) -> list[float]:
    """Times from sending a command to the first message at a viewer that shows it [s]."""
    from interfaces.messages import Order
    from interfaces.stream.codec import Encoding, encode
    from robots.puma560.parameters import POSES
    from vrs import JointTarget, MotionCommand

    rng = random.Random(3)  # noqa: S311
    rate = 60.0 if form == "frames" else None
    viewer = (await connect(1, origin, port, {"type": "follow", "number": 1, "form": form, "rate": rate}))[0]
    _, operator = await asyncio.get_running_loop().create_connection(
        lambda: Reader(origin, port, {"type": "acquire", "number": 1}, role="operator"), "127.0.0.1", port
    )
    while not operator.epoch:
        await asyncio.sleep(0.2)
        if operator.open and not operator.epoch:
            operator.say({"type": "acquire", "number": 2})
    home, times = POSES["nominal"], []
    for k in range(1, trials + 1):
        viewer.rest, viewer.changed_at = viewer.q, None
        await asyncio.sleep(rng.uniform(0.0, 0.05))
        target = JointTarget(home + (0.05 if k % 2 else 0.0))
        order = encode(Order(k, MotionCommand(target), operator.epoch), Encoding.MSGPACK)
        sent = time.monotonic() - origin
        operator.transport.write(masked(order))
        while viewer.changed_at is None:
            await asyncio.sleep(0.002)
        times.append(viewer.changed_at - sent)
        for _ in range(3):
            operator.say({"type": "beat", "epoch": str(operator.epoch)})
            await asyncio.sleep(0.15)
    for reader in (viewer, operator):
        reader.transport.abort()
    return times


async def main() -> None:
    """Do what is asked."""
    port, origin = int(sys.argv[1]), float(sys.argv[2])
    loop = asyncio.get_running_loop()
    readers: list[Reader] = []
    stalled: list[socket.socket] = []
    drips: list[asyncio.Task[None]] = []
    while line := await loop.run_in_executor(None, sys.stdin.readline):
        wish = json.loads(line)
        answer: dict[str, Any] = {}
        if wish["do"] == "connect":
            readers += await connect(wish["count"], origin, port, wish["follow"])
        elif wish["do"] == "stall":
            stalled += [stuck(port, wish["follow"]) for _ in range(wish["count"])]
        elif wish["do"] == "drip":
            drips += [asyncio.create_task(drip(stuck(port, wish["follow"]))) for _ in range(wish["count"])]
        elif wish["do"] == "measure":
            for reader in readers:
                reader.begin()
            busy = time.process_time()
            await asyncio.sleep(wish["seconds"])
            found = [(r.frames, r.last - r.first + 1 if r.frames else 0, r.bytes, r.lost) for r in readers]
            ages = sorted(age for reader in readers for age in reader.ages)
            answer = {"found": found, "ages": ages[:: max(1, len(ages) // 20000)]}
            answer["busy"] = (time.process_time() - busy) / wish["seconds"]
        elif wish["do"] == "latency":
            answer = {"times": await latency(origin, port, wish["trials"], wish["form"])}
        elif wish["do"] == "churn":
            for turn in range(wish["count"] // 10):
                for reader in await connect(10, origin, port, wish["follow"]):
                    reader.transport.abort() if turn % 2 else reader.transport.close()
        elif wish["do"] == "leave":
            for reader in readers:
                reader.transport.abort()
            for connection in stalled:
                connection.close()
            for task in drips:
                task.cancel()
            readers, stalled, drips = [], [], []
        print(json.dumps(answer), flush=True)
    os._exit(0)


if __name__ == "__main__":
    asyncio.run(main())
