"""Many cheap viewers of relays in one process, for `benchmarks.relays`: raw sockets, little is read of what comes.

`python watchers.py COUNT PORT [PORT ...]` connects them to the first port, follows segments, and goes to the next
port when a connection ends. For each line on standard input it says what came since the one before.
"""

from __future__ import annotations

import asyncio
import base64
import json
import os
import sys
import time
from typing import Any, cast

import msgspec

HELLO: dict[str, Any] = {"type": "hello", "protocol": 1, "role": "viewer", "name": "watcher"}
FOLLOW: dict[str, Any] = {"type": "follow", "number": 1, "form": "segments"}
BINARY, PING, PONG = 0x2, 0x9, 0xA
"""Opcodes of WebSocket."""
AGAIN = 0.05
"""Time before the next attempt to connect [s]."""


class Head(msgspec.Struct):
    """What's read of a message."""

    type: str
    command_id: int | None = None


_head = msgspec.msgpack.Decoder(Head).decode


def masked(message: dict[str, Any]) -> bytes:
    """A message as a client's frame; the mask is zero."""
    body = msgspec.msgpack.encode(message)
    assert len(body) < 126
    return bytes([0x82, 0x80 | len(body)]) + bytes(4) + body


class Watcher(asyncio.Protocol):
    """One viewer."""

    def __init__(self, ports: list[int], at: int) -> None:
        self.ports, self.at = ports, at
        self.came: dict[int, float] = {}
        """When the change that a command made came, by the machine's clock [s]."""
        self.lost: float | None = None
        self.back: list[float] = []
        """How long it was without a relay each time [s]."""
        self.messages = 0
        self.open = False
        self._data = bytearray()

    async def connect(self) -> None:
        """Connect to the port whose turn it is, or to one after it."""
        while True:
            port = self.ports[self.at % len(self.ports)]
            try:
                await asyncio.get_running_loop().create_connection(lambda: self, "127.0.0.1", port)
                return
            except OSError:
                self.at += 1
                await asyncio.sleep(AGAIN)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Shake hands, and say at once what is to come."""
        self._data.clear()
        self._greeted = False
        key, port = base64.b64encode(os.urandom(16)).decode(), self.ports[self.at % len(self.ports)]
        self.transport = cast("asyncio.Transport", transport)
        self.transport.write(
            f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Protocol: vrs.1.msgpack\r\n\r\n".encode()
        )

    def data_received(self, data: bytes) -> None:
        """Take what has come."""
        now, held = time.monotonic(), self._data
        held += data
        if not self._greeted:
            end = held.find(b"\r\n\r\n")
            if end < 0:
                return
            del held[: end + 4]
            self._greeted = True
            self.transport.write(masked(HELLO) + masked(FOLLOW))
        place = 0
        while len(held) >= place + 2:
            size, body = held[place + 1] & 0x7F, place + 2
            if size == 126:
                size, body = int.from_bytes(held[place + 2 : place + 4], "big"), place + 4
            elif size == 127:
                size, body = int.from_bytes(held[place + 2 : place + 10], "big"), place + 10
            if len(held) < body + size:
                break
            opcode = held[place] & 0x0F
            if opcode == BINARY:
                self._take(held, body, size, now)
            elif opcode == PING:
                self.transport.write(bytes([0x80 | PONG, 0x80 | size]) + bytes(4) + held[body : body + size])
            place = body + size
        del held[:place]

    def _take(self, held: bytearray, body: int, size: int, now: float) -> None:
        self.messages += 1
        kind = bytes(held[body + 7 : body + 13])
        if kind.startswith((b"change", b"scene")) or not self.open:
            message = _head(bytes(held[body : body + size]))
            if message.type == "change" and message.command_id is not None:
                self.came.setdefault(message.command_id, now)
            elif message.type == "scene":
                self.open = True
                if self.lost is not None:
                    self.back.append(now - self.lost)
                    self.lost = None

    def connection_lost(self, _: Exception | None) -> None:
        """Go to the next one."""
        self.open, self.at = False, self.at + 1
        self.lost = self.lost or time.monotonic()
        if not ended:
            tasks.add(task := asyncio.get_running_loop().create_task(self.connect()))
            task.add_done_callback(tasks.discard)


tasks: set[asyncio.Task[None]] = set()
ended: list[bool] = []


async def main(count: int, ports: list[int]) -> None:
    """Watch until standard input ends."""
    watchers = [Watcher(ports, 0) for _ in range(count)]
    for first in range(0, count, 50):
        await asyncio.gather(*(watcher.connect() for watcher in watchers[first : first + 50]))
        await asyncio.sleep(0.1)
    while not all(watcher.open for watcher in watchers):
        await asyncio.sleep(0.05)
    print("open", flush=True)
    while line := await asyncio.to_thread(sys.stdin.readline):
        sent: dict[str, float] = json.loads(line)
        ages = [watcher.came[int(k)] - t for watcher in watchers for k, t in sent.items() if int(k) in watcher.came]
        print(
            json.dumps({
                "ages": ages, "missing": count * len(sent) - len(ages), "open": sum(one.open for one in watchers),
                "back": [time for one in watchers for time in one.back],
                "messages": sum(one.messages for one in watchers),
            }),
            flush=True,
        )  # fmt: skip
    ended.append(True)
    for watcher in watchers:
        watcher.transport.abort()


if __name__ == "__main__":
    import uvloop

    uvloop.run(main(int(sys.argv[1]), [int(port) for port in sys.argv[2:]]))
