"""Many open pages of the station in one process, as a server sees them: for `benchmarks.station`.

Each has loaded the page with its files, holds its two sockets, follows segments and states, and takes the 3D
view as often as it comes. `python visitors.py PORT COUNT` says `open`, and for each line on standard input what has
come since the last one: the turn of link 1 in each frame of the view, and when it came.
"""

from __future__ import annotations

import asyncio
import json
import math
import re
import sys
import time
import urllib.request
from typing import Any

import msgspec
from websockets.asyncio.client import ClientConnection, connect

LINK = b"/vrs/virtual/body/1"
_decode = msgspec.msgpack.Decoder(ext_hook=lambda code, data: None).decode  # noqa: ARG005


def load(base: str) -> None:
    """Load the page with the files that it names."""
    with urllib.request.urlopen(base) as answer:  # noqa: S310 - of this machine
        page = answer.read().decode()
    for path in re.findall(r'(?:src|href)="/((?:station|view)[^"]+)"', page):
        with urllib.request.urlopen(base + path) as answer:  # noqa: S310
            answer.read()


class Visitor:
    """One open page."""

    def __init__(self, port: str) -> None:
        self.port = port
        self.frames: list[tuple[float, float]] = []
        """When each came, by the machine's clock [s], and how far link 1 is turned [rad]."""
        self.tasks: list[asyncio.Task[None]] = []

    async def open(self) -> None:
        """Load the page, and connect as it does."""
        await asyncio.to_thread(load, f"http://127.0.0.1:{self.port}/")
        orders = await self.connect("ws", "vrs.1.json")
        await orders.send(json.dumps({"type": "hello", "protocol": 1, "role": "viewer", "name": "visitor"}))
        await orders.send(json.dumps({"type": "follow", "number": 1, "form": "segments"}))
        view = await self.connect("meshcat", "vrs.meshcat.1")
        await view.send(json.dumps({"token": None}))
        for work in (self.follow(orders), self.look(view), self.beat(view, orders)):
            self.tasks.append(asyncio.create_task(work))

    async def connect(self, path: str, protocol: Any) -> ClientConnection:
        """One of its sockets."""
        return await connect(
            f"ws://127.0.0.1:{self.port}/{path}", subprotocols=[protocol], max_size=None, compression=None
        )

    async def follow(self, socket: ClientConnection) -> None:
        """Segments and states."""
        async for message in socket:
            msgspec.json.decode(message)

    async def look(self, socket: ClientConnection) -> None:
        """The 3D view: note where link 1 is."""
        async for data in socket:
            if not isinstance(data, bytes) or LINK not in data:
                continue
            came, place = time.monotonic(), 0
            while place < len(data):
                size = int.from_bytes(data[place : place + 4], "little")
                command: dict[str, Any] = _decode(data[place + 4 : place + 4 + size])
                if command["type"] == "set_transform" and command["path"].encode() == LINK:
                    self.frames.append((came, math.atan2(command["matrix"][1], command["matrix"][0])))
                place += 4 + size

    async def beat(self, view: ClientConnection, orders: ClientConnection) -> None:
        """What a page says by itself."""
        number = 0
        while True:
            number += 1
            await orders.send(json.dumps({"type": "ping", "number": number, "t": time.monotonic()}))
            if number % 2:
                await view.send("beat")
            await asyncio.sleep(1.0)


async def main(port: str, count: str) -> None:
    """Be so many visitors until standard input ends."""
    loop = asyncio.get_running_loop()
    visitors = [Visitor(port) for _ in range(int(count))]
    for visitor in visitors:
        await visitor.open()
    print("open", flush=True)
    while await loop.run_in_executor(None, sys.stdin.readline):
        print(json.dumps([visitor.frames for visitor in visitors]), flush=True)
        for visitor in visitors:
            visitor.frames.clear()
    for visitor in visitors:
        for task in visitor.tasks:
            task.cancel()


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))
