"""What stands between the world and NiceGUI: few paths, few visitors, few messages, no script that isn't ours."""

from __future__ import annotations

import asyncio
import math
import re
import secrets
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Final

from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from interfaces.stream.limits import Bucket, Strangers
from interfaces.stream.server import HEADERS, POLICY
from interfaces.stream.sockets import let_stay
from vrs.checks import validated, within

SOCKET: Final = "/_nicegui_ws/"
"""Where NiceGUI's own messages go, by WebSocket only."""
_PARTS: Final = "/_nicegui/"
_SCRIPT: Final = re.compile(rb"<script(?=[ >])")
_POLICY_VIOLATION: Final = 1008


@dataclass(frozen=True, slots=True)
@validated
class BoundsConfig:
    """How much NiceGUI is asked to do."""

    visitors: Annotated[int, within(1, 1e4)] = 256
    """Pages that it keeps at once, 1 to 10,000; those that opened no socket give way to new ones, the oldest first,
    and so do sockets."""
    pages: Annotated[float, within(1, 1e3)] = 20.0
    """Pages that it makes a second, for long, 1 to 1000; each takes the loop some milliseconds."""
    pages_burst: Annotated[float, within(1, 1e3)] = 20.0
    """Pages that it makes at once, 1 to 1000."""
    pages_waiting: Annotated[int, within(1, 1e4)] = 64
    """Pages that may be waited for, 1 to 10,000. The newest comes first; the oldest is refused."""
    rate: Annotated[float, within(1, 1e4)] = 40.0
    """Messages a second that a page may send for long, 1 to 10,000."""
    burst: Annotated[float, within(1, 1e4)] = 200.0
    """Messages that it may send at once, 1 to 10,000."""
    blocked: Annotated[float, within(0.1, 60)] = 2.0
    """A page is cut off when a message has waited so long to be sent [s], 0.1 to 60."""


class RequestBounds:
    """Stands before NiceGUI's application."""

    def __init__(
        self, app: ASGIApp, page: str, make_room: Callable[[int], bool], config: BoundsConfig | None = None
    ) -> None:
        """Stand before an application.

        Args:
            app: NiceGUI's.
            page: Path of the only page.
            make_room: Lets go of pages until there's room for one more among so many; whether there is.
            config: How much is let through.
        """
        self._app, self._page, self._make_room = app, page, make_room
        self._config = BoundsConfig() if config is None else config
        self._sockets: Strangers[_Ends] = Strangers(self._config.visitors)
        self._making = _Making(self._config)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or refuse."""
        path = scope["path"]
        if scope["type"] == "websocket":
            await self._socket(path, scope, receive, send)
        elif scope["type"] != "http":
            await self._app(scope, receive, send)
        elif scope["method"] not in {"GET", "HEAD"} or not (path == self._page or path.startswith(_PARTS)):
            await PlainTextResponse("not here\n", 404, HEADERS)(scope, receive, send)
        elif path == self._page and not (await self._making.turn() and self._make_room(self._config.visitors)):
            await PlainTextResponse("too many visitors: try again\n", 503, HEADERS)(scope, receive, send)
        else:
            await self._app(scope, receive, _Signed(send) if path == self._page else send)

    async def _socket(self, path: str, scope: Scope, receive: Receive, send: Send) -> None:
        if not path.startswith(SOCKET):
            await receive()
            await send({"type": "websocket.close", "code": _POLICY_VIOLATION, "reason": ""})
            return
        let_stay(scope, known=False)
        ends = _Ends(scope, receive, send, self._config)
        oldest = self._sockets.add(ends, (scope.get("client") or ("",))[0], until=math.inf)
        if oldest is not None:
            oldest.cut_off()
        try:
            await self._app(scope, ends.receive, ends.send)
        finally:
            self._sockets.discard(ends)


class _Making:
    """Whose page is made next: few at a time, for it holds the loop up, and the newest first."""

    def __init__(self, config: BoundsConfig) -> None:
        self._pause, self._most = 1.0 / config.pages, config.pages_waiting
        self._at_once = Bucket(config.pages, config.pages_burst, 0.0)
        self._waiting: deque[asyncio.Future[bool]] = deque()

    async def turn(self) -> bool:
        """Wait for a turn; whether it came."""
        loop = asyncio.get_running_loop()
        if not self._waiting and self._at_once.take(loop.time()):
            return True
        if not self._waiting:
            loop.call_later(self._pause, self._next)
        mine: asyncio.Future[bool] = loop.create_future()
        self._waiting.append(mine)
        if len(self._waiting) > self._most:
            self._give(self._waiting.popleft(), turn=False)
        return await mine

    def _next(self) -> None:
        self._give(self._waiting.pop(), turn=True)
        if self._waiting:
            asyncio.get_running_loop().call_later(self._pause, self._next)

    @staticmethod
    def _give(waiting: asyncio.Future[bool], *, turn: bool) -> None:
        if not waiting.done():
            waiting.set_result(turn)


class _Ends:
    """The two ends of a page's socket, bounded."""

    def __init__(self, scope: Scope, receive: Receive, send: Send, config: BoundsConfig) -> None:
        self._socket = scope.get("state", {}).get("socket")
        self._receive, self._send, self._blocked = receive, send, config.blocked
        self._clock = asyncio.get_running_loop().time
        self._allowed = Bucket(config.rate, config.burst, self._clock())

    def cut_off(self) -> None:
        """Let another one have its place."""
        if self._socket is not None:
            self._socket.abort()

    async def receive(self) -> Message:
        message = await self._receive()
        if message["type"] != "websocket.receive" or self._allowed.take(self._clock()):
            return message
        await self.send({"type": "websocket.close", "code": _POLICY_VIOLATION, "reason": "too many messages"})
        return {"type": "websocket.disconnect", "code": _POLICY_VIOLATION}

    async def send(self, message: Message) -> None:
        try:
            async with asyncio.timeout(self._blocked):
                await self._send(message)
        except TimeoutError:
            self.cut_off()
            raise ConnectionResetError from None


class _Signed:
    """Sends a page whose scripts carry a word that nobody else knows, and a policy that lets only those run.

    NiceGUI's page makes functions of text (Vue's templates, its events), hence `unsafe-eval`.
    """

    def __init__(self, send: Send) -> None:
        self._send = send
        self._start: dict[str, Any] | None = None
        self._parts: list[bytes] = []

    async def __call__(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self._start = dict(message)
            return
        self._parts.append(message.get("body", b""))
        if message.get("more_body") or self._start is None:
            return
        word = secrets.token_urlsafe(16)
        body = _SCRIPT.sub(f'<script nonce="{word}"'.encode(), b"".join(self._parts))
        policy = POLICY.format(scripts=f" 'nonce-{word}' 'unsafe-eval'")
        headers = {**HEADERS, "Content-Security-Policy": policy, "Cache-Control": "no-store"}
        given = [(name, value) for name, value in self._start["headers"] if name.decode().title() not in headers]
        kept = [(name, value) for name, value in given if name != b"content-length"]
        own = [(name.lower().encode(), value.encode()) for name, value in headers.items()]
        start = self._start | {"headers": [*kept, *own, (b"content-length", str(len(body)).encode())]}
        await self._send(start)
        await self._send({"type": "http.response.body", "body": body})
