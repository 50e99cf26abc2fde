"""A site with camera, voice and screen in this loop, and a viewer that isn't a browser, for tests."""

from __future__ import annotations

import asyncio
import contextlib
import json
import urllib.error
import urllib.request
from collections.abc import AsyncIterator
from typing import Any

import numpy as np
from websockets.asyncio.client import ClientConnection, connect

from interfaces.media import CameraConfig, LiveMedia, MediaDoor
from interfaces.messages.control import Role
from interfaces.stream import sockets
from interfaces.stream.access import Access, hosts
from interfaces.stream.server import application
from robots.mobile.camera import Lens
from robots.rooms import read_room
from vrs.clock import WallClock

ROOM = read_room("room 1\nsize 6 6\nwall 6 0  6 6\nbox 5 3  0.5 3 height=2\nsound 2 5 level=76 pitch=500\n")
"""A wooden cupboard before the robot, and something to hear 2 m to its left."""
KEY, EPOCH = "a-session", 7
LENS = Lens(width=160, height=120)
VIEWER, OPERATOR = "v" * 43, "o" * 43


class Site:
    """What a test sees of a site."""

    def __init__(self, media: LiveMedia, port: int) -> None:
        self.media, self.port = media, port
        self.url = f"127.0.0.1:{port}"

    async def still(self, token: str | None = VIEWER, view: str = "robot") -> tuple[int, str, bytes]:
        """Ask for a single picture: status, media type and body of the answer."""
        headers = {} if token is None else {"Authorization": f"Bearer {token}"}
        request = urllib.request.Request(f"http://{self.url}/media/still?view={view}", headers=headers)

        def ask() -> tuple[int, str, bytes]:
            try:
                with urllib.request.urlopen(request, timeout=30) as answer:
                    return answer.status, answer.headers["Content-Type"], answer.read()
            except urllib.error.HTTPError as refused:
                with refused:
                    return refused.code, refused.headers["Content-Type"], refused.read()

        return await asyncio.to_thread(ask)

    @contextlib.asynccontextmanager
    async def page(self, token: str | None = VIEWER, origin: str | None = None) -> AsyncIterator[Page]:
        async with connect(f"ws://{self.url}/media", origin=origin, max_size=2**20) as socket:  # type: ignore[arg-type]
            await socket.send(json.dumps({"token": token}))
            yield Page(socket)


class Page:
    """A page that isn't in a browser."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket

    async def say(self, **ask: Any) -> None:
        await self.socket.send(json.dumps(ask))

    async def hear(self, kind: str, **facts: Any) -> dict[str, Any]:
        """Wait for a message of a kind that says so."""
        async with asyncio.timeout(30):
            while True:
                message: dict[str, Any] = json.loads(await self.socket.recv())
                if message["kind"] == kind and all(message[name] == value for name, value in facts.items()):
                    return message


@contextlib.asynccontextmanager
async def site(config: CameraConfig | None = None) -> AsyncIterator[Site]:
    """A site on loopback that needs tokens; `KEY` has the lease in `EPOCH`."""
    listening = sockets.bind("127.0.0.1", 0)
    port = listening.getsockname()[1]
    media = LiveMedia(
        CameraConfig(rate=10.0, lens=LENS) if config is None else config,
        ROOM,
        WallClock(),
        stand=lambda _: ((2.0, 3.0, 0.0), 0.0),
        commands=lambda session, epoch: (session, epoch) == (KEY, EPOCH),
    )
    door = MediaDoor(media, Access({Role.VIEWER: VIEWER, Role.OPERATOR: OPERATOR}, free=()))
    app = application(door.routes, hosts(["127.0.0.1"], port))
    async with sockets.serve(app, listening), media.running():
        yield Site(media, port)


class Viewer:
    """Receives picture and sound by RTP."""

    def __init__(self) -> None:
        from aiortc import RTCConfiguration, RTCPeerConnection

        self.peer = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        for kind in ("video", "audio"):
            self.peer.addTransceiver(kind, direction="recvonly")
        self.pictures: list[np.ndarray[Any, np.dtype[np.uint8]]] = []
        self.levels: list[float] = []
        self._tasks: list[asyncio.Task[None]] = []
        self.peer.on("track", lambda track: self._tasks.append(asyncio.create_task(self._take(track))))

    async def _take(self, track: Any) -> None:
        from aiortc.mediastreams import MediaStreamError

        with contextlib.suppress(MediaStreamError):
            while True:
                frame = await track.recv()
                if track.kind == "video":
                    self.pictures.append(frame.to_ndarray(format="rgb24"))
                else:
                    self.levels.append(float(np.abs(frame.to_ndarray().astype(float)).max()))

    async def offer(self) -> str:
        await self.peer.setLocalDescription(await self.peer.createOffer())
        return str(self.peer.localDescription.sdp)

    async def accept(self, sdp: str) -> None:
        from aiortc import RTCSessionDescription

        await self.peer.setRemoteDescription(RTCSessionDescription(sdp, "answer"))

    async def watch(self, page: Page) -> Viewer:
        await page.say(do="watch", offer=await self.offer())
        await self.accept((await page.hear("answer"))["sdp"])
        return self

    async def close(self) -> None:
        await self.peer.close()
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
