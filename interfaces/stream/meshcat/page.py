"""The page `/view`, and `/meshcat`, its WebSocket: a thin shell round a `MeshcatScene`."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from functools import lru_cache
from importlib import resources
from typing import Final
from urllib.parse import urlsplit

from starlette.requests import HTTPConnection, Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from interfaces.stream.meshcat.scene import MeshcatScene
from interfaces.view_parts import viewer_bundle
from vrs.errors import InvalidValueError

BATCHES: Final = "vrs.meshcat.1"
"""WebSocket subprotocol of messages of several commands, each after its length: four bytes, little-endian.

Without it a message is one command, as MeshCat's own page takes it.
"""
MOST_SENT: Final = 64 * 1024
"""Bytes of a message, unless one command is longer."""
PATIENCE: Final = 2.0
"""How long a send may be blocked, and a token may be on its way [s]."""
WATCH_PERIOD: Final = 0.25
"""How often blocked sends are looked for [s]."""
MOST_HEARD: Final = 20
"""Messages that a viewer may send in HEARD_PERIOD."""
HEARD_PERIOD: Final = 10.0
"""[s]."""
POLICY_VIOLATION, TRY_AGAIN_LATER, UNAUTHORISED = 1008, 1013, 4401
HEADERS: Final = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src data: blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
_TYPES: Final = {
    "view.html": "text/html",
    "view.css": "text/css",
    "view.js": "text/javascript",
    "meshcat.js": "text/javascript",
    "licences.txt": "text/plain",
}


def routes(
    scene: MeshcatScene,
    *,
    admit: Callable[[HTTPConnection], bool] | None = None,
    authorize: Callable[[str | None], bool] | None = None,
) -> list[BaseRoute]:
    """Make the routes of the page, of its files and of the WebSocket.

    Args:
        scene: What all viewers see.
        admit: Whether a WebSocket may be opened, by its headers; None for this server's own pages, and programs.
        authorize: Whether a token lets a viewer in; None lets all in.
    """
    viewers = _Viewers(scene, same_origin if admit is None else admit, authorize)
    return [
        Route("/view", _page),
        Route("/view/{name}", _file),
        WebSocketRoute("/meshcat", viewers.serve),
    ]


def same_origin(connection: HTTPConnection) -> bool:
    """Whether a request comes from a page of this server, or from no page at all."""
    origin = connection.headers.get("origin")
    return origin is None or urlsplit(origin).netloc == connection.headers.get("host")


class _Viewers:
    """A writer and a reader for each viewer, and one watcher for all."""

    def __init__(
        self,
        scene: MeshcatScene,
        admit: Callable[[HTTPConnection], bool],
        authorize: Callable[[str | None], bool] | None,
    ) -> None:
        self._scene, self._admit, self._authorize = scene, admit, authorize
        self._viewers: set[_Viewer] = set()
        self._watcher: asyncio.Task[None] | None = None

    async def serve(self, websocket: WebSocket) -> None:
        """Serve one viewer until it goes."""
        if not self._admit(websocket):
            await websocket.close()
            return
        batches = BATCHES in websocket.scope["subprotocols"]
        try:
            await websocket.accept(subprotocol=BATCHES if batches else None)
            if self._authorize is not None and not self._authorize(await _token(websocket)):
                await websocket.close(UNAUTHORISED, "a token that is valid here, please")
                return
            try:
                viewer = _Viewer(websocket, self._scene, batches)
            except InvalidValueError:
                await websocket.close(TRY_AGAIN_LATER, "too many viewers")
                return
            await self._attend(viewer)
            if viewer.noisy:
                await websocket.close(POLICY_VIOLATION, "too many messages")
        except WebSocketDisconnect:
            return

    async def _attend(self, viewer: _Viewer) -> None:
        self._viewers.add(viewer)
        if self._watcher is None:
            self._watcher = asyncio.create_task(self._watch())
        try:
            await viewer.run()
        finally:
            self._viewers.discard(viewer)
            self._scene.leave(viewer.slot)
            if not self._viewers and self._watcher is not None:
                self._watcher.cancel()
                self._watcher = None

    async def _watch(self) -> None:
        """Drop those whose send is blocked for too long."""
        clock = asyncio.get_running_loop().time
        while True:
            await asyncio.sleep(WATCH_PERIOD)
            for viewer in [viewer for viewer in self._viewers if viewer.sending_since < clock() - PATIENCE]:
                viewer.drop()


class _Viewer:
    """One viewer: what it's sent, and what it says."""

    def __init__(self, websocket: WebSocket, scene: MeshcatScene, batches: bool) -> None:
        self._websocket, self._batches = websocket, batches
        self._changed = asyncio.Event()
        self._changed.set()
        self._beats = 0
        self._tasks: tuple[asyncio.Task[None], ...] = ()
        self.slot = scene.join(self._changed.set)
        self.sending_since = float("inf")
        """Since when a send is under way [s], by the loop's time; infinity if none is."""
        self.noisy = False
        """Whether it said too much."""

    async def run(self) -> None:
        """Send and hear until either ends."""
        self._tasks = asyncio.create_task(self._write()), asyncio.create_task(self._read())
        try:
            await asyncio.wait(self._tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in self._tasks:
                task.cancel()
            ends = await asyncio.gather(*self._tasks, return_exceptions=True)
        for end in ends:
            if isinstance(end, Exception) and not isinstance(end, WebSocketDisconnect):
                raise end

    def drop(self) -> None:
        """Let it go, with all that waits to be sent; its socket too, where the server can do that."""
        socket = self._websocket.scope.get("state", {}).get("socket")
        if socket is not None:
            socket.abort()
        for task in self._tasks:
            task.cancel()

    async def _write(self) -> None:
        clock = asyncio.get_running_loop().time
        while True:
            await self._changed.wait()
            self._changed.clear()
            while self.slot or self._beats:
                self.sending_since = clock()
                if self._beats:
                    self._beats = 0
                    await self._websocket.send_text("beat")
                commands = self.slot.take(MOST_SENT)
                for data in (_framed(commands),) if self._batches and commands else commands:
                    await self._websocket.send_bytes(data)
                self.sending_since = float("inf")

    async def _read(self) -> None:
        clock = asyncio.get_running_loop().time
        heard, until = 0, clock() + HEARD_PERIOD
        while heard < MOST_HEARD:
            message = await self._websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            if clock() >= until:
                heard, until = 0, clock() + HEARD_PERIOD
            heard += 1
            if message.get("text") == "beat":
                self._beats += 1
                self._changed.set()
        self.noisy = True


@lru_cache(maxsize=16)
def _framed(commands: tuple[bytes, ...]) -> bytes:
    """A batch as a message, made once for all viewers that are equally far."""
    return b"".join(part for data in commands for part in (len(data).to_bytes(4, "little"), data))


async def _token(websocket: WebSocket) -> str | None:
    """The token of the viewer's first message, `{"token": "…"}`; None if there's none in time."""
    try:
        async with asyncio.timeout(PATIENCE):
            value = json.loads(await websocket.receive_text())
    except (TimeoutError, KeyError, ValueError, RecursionError):
        return None
    token = value.get("token") if isinstance(value, dict) else None
    return token if isinstance(token, str) else None


async def _page(request: Request) -> Response:
    return _answer(request, "view.html")


async def _file(request: Request) -> Response:
    return _answer(request, request.path_params["name"])


def _answer(request: Request, name: str) -> Response:
    if name not in _TYPES:
        return Response("not here", 404, HEADERS, "text/plain")
    content, tag = _content(name)
    headers = {**HEADERS, "ETag": tag}
    if request.headers.get("if-none-match") == tag:
        return Response(None, 304, headers)
    return Response(content, 200, headers, _TYPES[name])


@lru_cache(maxsize=len(_TYPES))
def _content(name: str) -> tuple[bytes, str]:
    """A file's bytes and what its version is known by."""
    import hashlib

    if name in ("meshcat.js", "licences.txt"):
        content = viewer_bundle()[name == "licences.txt"].encode()
    else:
        content = resources.files("interfaces.stream").joinpath(f"static/{name}").read_bytes()
    return content, f'"{hashlib.sha256(content).hexdigest()[:32]}"'
