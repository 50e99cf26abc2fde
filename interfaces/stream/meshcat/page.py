"""The page `/view` and its WebSocket: each viewer gets the newest of everything, as quickly as it can."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Sequence
from functools import lru_cache
from importlib import resources
from typing import Final, TypeAlias
from urllib.parse import urlsplit

from starlette.requests import HTTPConnection, Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from interfaces.stream import server
from interfaces.stream.access import Admission
from interfaces.stream.meshcat.meshes import viewer_bundle
from interfaces.stream.meshcat.newest import Newest
from interfaces.stream.sockets import let_stay
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
Authorize: TypeAlias = Callable[[HTTPConnection, str | None], Admission]
"""Decides whether a token that was shown lets a viewer in."""
POLICY_VIOLATION, TRY_AGAIN_LATER, UNAUTHORISED = 1008, 1013, 4401


def same_origin(connection: HTTPConnection) -> bool:
    """Whether a request comes from a page of this server, or from no page at all."""
    origin = connection.headers.get("origin")
    return origin is None or urlsplit(origin).netloc == connection.headers.get("host")


class Viewers:
    """A writer and a reader for each viewer, and one watcher for all."""

    def __init__(
        self,
        source: Newest,
        authorize: Authorize | None = None,
        *,
        hear: Callable[[str], str] | None = None,
        most_heard: int = MOST_HEARD,
    ) -> None:
        """Wait for viewers.

        Args:
            source: What all of them see.
            authorize: Whether a token lets a viewer in, and as long as it does; None lets all in.
            hear: Takes what a viewer says; its answer, unless empty, goes to that one. None: nobody listens.
            most_heard: Messages that a viewer may send in 10 s.
        """
        self._source = source
        self._authorize, self._hear, self._most_heard = authorize, hear, most_heard
        self._viewers: set[_Viewer] = set()
        self._watcher: asyncio.Task[None] | None = None

    async def serve(self, websocket: WebSocket) -> None:
        """Serve one viewer until it goes."""
        if not same_origin(websocket):
            await websocket.close()
            return
        batches = BATCHES in websocket.scope["subprotocols"]
        try:
            await websocket.accept(subprotocol=BATCHES if batches else None)
            said, admission = "", Admission()
            if self._authorize is not None:
                said = await first_text(websocket)
                admission = self._authorize(websocket, token_in(said))
                if admission.refusal:
                    await websocket.close(UNAUTHORISED, "a token that is valid here, please")
                    return
            let_stay(websocket.scope, known=bool(said), counts=admission.counts, code=UNAUTHORISED)
            try:
                viewer = _Viewer(websocket, self._source, batches, self._hear, self._most_heard)
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
            self._source.leave(viewer.slot)
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

    def __init__(
        self,
        websocket: WebSocket,
        source: Newest,
        batches: bool,
        hear: Callable[[str], str] | None,
        most_heard: int,
    ) -> None:
        self._websocket, self._batches = websocket, batches
        self._hear, self._most_heard = hear, most_heard
        self._changed = asyncio.Event()
        self._changed.set()
        self._reply = ""
        self._beats = 0
        self._tasks: tuple[asyncio.Task[None], ...] = ()
        self.slot = source.join(self._changed.set)
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
            while self.slot or self._beats or self._reply:
                self.sending_since = clock()
                if self._beats:
                    self._beats = 0
                    await self._websocket.send_text("beat")
                if self._reply:
                    reply, self._reply = self._reply, ""
                    await self._websocket.send_text(reply)
                commands = self.slot.take(MOST_SENT)
                for data in (_framed(commands),) if self._batches and commands else commands:
                    await self._websocket.send_bytes(data)
                self.sending_since = float("inf")

    async def _read(self) -> None:
        clock = asyncio.get_running_loop().time
        heard, until = 0, clock() + HEARD_PERIOD
        while heard < self._most_heard:
            message = await self._websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            if clock() >= until:
                heard, until = 0, clock() + HEARD_PERIOD
            heard += 1
            text = message.get("text")
            if text == "beat":
                self._beats += 1
                self._changed.set()
            elif text is not None and self._hear is not None:
                # Of several answers that wait the newest is sent.
                self._reply = self._hear(text) or self._reply
                self._changed.set()
        self.noisy = True


@lru_cache(maxsize=16)
def _framed(commands: tuple[bytes, ...]) -> bytes:
    """A batch as a message, made once for all viewers that are equally far."""
    return b"".join(part for data in commands for part in (len(data).to_bytes(4, "little"), data))


async def first_text(websocket: WebSocket) -> str:
    """The viewer's first message; empty if there's none in time."""
    try:
        async with asyncio.timeout(PATIENCE):
            return await websocket.receive_text()
    except (TimeoutError, KeyError):
        return ""


def token_in(text: str) -> str | None:
    """The token of a message, `{"token": "…"}`; None if there's none."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return None
    token = value.get("token") if isinstance(value, dict) else None
    return token if isinstance(token, str) else None


HEADERS: Final = server.HEADERS | {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src data: blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
    )
}
PARTS: Final = ("sheets.js", "meshcat.js", "scene.js", "licences.txt")
"""What every page with a 3D view needs."""
_TYPES: Final = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".txt": "text/plain"}


def routes(scene: Newest, *, authorize: Authorize | None = None) -> list[BaseRoute]:
    """Make the routes of the page, of its files and of the WebSocket.

    Args:
        scene: What all viewers see.
        authorize: See `Viewers`.
    """
    viewers = Viewers(scene, authorize)
    return [*files("view", "interfaces.stream"), WebSocketRoute("/meshcat", viewers.serve)]


def files(page: str, package: str, scripts: Sequence[str] = ()) -> list[BaseRoute]:
    """The routes of a page: `/PAGE` is its HTML, and below it are its scripts, its style and `PARTS`.

    Args:
        page: Name of the page, and of its files in the package's `static`.
        package: Where those are.
        scripts: What more it needs of there.
    """
    own = dict.fromkeys((f"{page}.html", f"{page}.css", f"{page}.js", *scripts), package)
    known = own | dict.fromkeys(PARTS, "interfaces.stream")

    async def whole(request: Request) -> Response:
        return await _answer(request, known, f"{page}.html")

    async def part(request: Request) -> Response:
        return await _answer(request, known, request.path_params["name"])

    handlers: list[tuple[str, Callable[[Request], Awaitable[Response]]]]
    handlers = [(f"/{page}", whole), (f"/{page}/{{name}}", part)]
    return [Route(path, handler) for path, handler in handlers]


async def _answer(request: Request, known: dict[str, str], name: str) -> Response:
    if name not in known:
        return Response("not here", 404, HEADERS, "text/plain")
    file = await asyncio.to_thread(_file, known[name], name)
    return file.answer(request, _TYPES[name[name.rindex(".") :]], HEADERS)


@lru_cache(maxsize=16)
def _file(package: str, name: str) -> server.KeptFile:
    if name in ("meshcat.js", "licences.txt"):
        content = viewer_bundle()[name == "licences.txt"].encode()
    else:
        content = resources.files(package).joinpath(f"static/{name}").read_bytes()
    return server.KeptFile.of(content)
