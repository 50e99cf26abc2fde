"""Many open pages of the station in one process, as a server sees them: for `benchmarks.station`.

Each has loaded the page with its files, holds its three sockets, follows segments and states, and takes the 3D
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
from typing import Any

import aiohttp
import msgspec

LINK = b"/vrs/virtual/body/1"
_decode = msgspec.msgpack.Decoder(ext_hook=lambda code, data: None).decode  # noqa: ARG005


class Visitor:
    """One open page."""

    def __init__(self, session: aiohttp.ClientSession, base: str) -> None:
        self.session, self.base = session, base
        self.frames: list[tuple[float, float]] = []
        """When each came, by the machine's clock [s], and how far link 1 is turned [rad]."""
        self.tasks: list[asyncio.Task[None]] = []

    async def open(self) -> None:
        """Load the page, and connect as it does."""
        async with self.session.get(self.base) as answer:
            page = await answer.text()
        for path in re.findall(r'(?:src|href)="(/(?:station|view|_nicegui)[^"]+)"', page):
            async with self.session.get(self.base.rstrip("/") + path) as answer:
                await answer.read()
        found = re.search(r"client_id[\"']?: ?[\"']([0-9a-f-]+)", page)
        assert found, "the page names its client"
        client = f"client_id={found[1]}&tab_id=t&document_id=d&next_message_id=0&implicit_handshake=true"
        query = f"EIO=4&transport=websocket&{client}"
        served = await self.session.ws_connect(f"{self.base}_nicegui_ws/socket.io/?{query}")
        orders = await self.session.ws_connect(f"{self.base}ws", protocols=["vrs.1.json"])
        await orders.send_json({"type": "hello", "protocol": 1, "role": "viewer", "name": "visitor"})
        await orders.send_json({"type": "follow", "number": 1, "form": "segments"})
        view = await self.session.ws_connect(f"{self.base}meshcat", protocols=["vrs.meshcat.1"])
        await view.send_json({"token": None})
        for work in (self.serve(served), self.follow(orders), self.look(view), self.beat(view, orders)):
            self.tasks.append(asyncio.create_task(work))

    async def serve(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        """NiceGUI's socket: greet, and answer its pings."""
        async for message in socket:
            if message.data[0] == "0":
                await socket.send_str("40")
            elif message.data == "2":
                await socket.send_str("3")

    async def follow(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        """Segments and states."""
        async for message in socket:
            msgspec.json.decode(message.data)

    async def look(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        """The 3D view: note where link 1 is."""
        async for message in socket:
            data = message.data
            if not isinstance(data, bytes) or LINK not in data:
                continue
            came, place = time.monotonic(), 0
            while place < len(data):
                size = int.from_bytes(data[place : place + 4], "little")
                command: dict[str, Any] = _decode(data[place + 4 : place + 4 + size])
                if command["type"] == "set_transform" and command["path"].encode() == LINK:
                    self.frames.append((came, math.atan2(command["matrix"][1], command["matrix"][0])))
                place += 4 + size

    async def beat(self, view: aiohttp.ClientWebSocketResponse, orders: aiohttp.ClientWebSocketResponse) -> None:
        """What a page says by itself."""
        number = 0
        while True:
            number += 1
            await orders.send_json({"type": "ping", "number": number, "t": time.monotonic()})
            if number % 2:
                await view.send_str("beat")
            await asyncio.sleep(1.0)


async def main(port: str, count: str) -> None:
    """Be so many visitors until standard input ends."""
    loop = asyncio.get_running_loop()
    async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(limit=0)) as session:
        visitors = [Visitor(session, f"http://127.0.0.1:{port}/") for _ in range(int(count))]
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
