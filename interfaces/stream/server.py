"""The HTTP and WebSocket server of a hub: one writer task a client, Host and Origin checks, cached files."""

from __future__ import annotations

import asyncio
import contextlib
import gzip
import hashlib
import logging
import math
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.types import ASGIApp, Receive, Scope, Send
from websockets.frames import Opcode

from interfaces.messages.control import Role
from interfaces.stream.access import Access, Admission, bearer, check_host, check_origin
from interfaces.stream.audit import AuditLog
from interfaces.stream.codec import Encoding
from interfaces.stream.hub import Hub, HubSession
from interfaces.stream.sockets import BoundedWebSocket
from interfaces.timer import Turning
from vrs.clock import Clock, processor_time

POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "font-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Nothing from elsewhere, and no script but the files that the server has."""
HEADERS: Final = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}


@dataclass(frozen=True, slots=True)
class KeptFile:
    """A file, as it is and compressed, and what its version is known by."""

    content: bytes
    packed: bytes
    tag: str

    @classmethod
    def of(cls, content: bytes) -> KeptFile:
        """A file of these bytes; compressing a large one takes some 50 ms."""
        return cls(content, gzip.compress(content, mtime=0), f'W/"{hashlib.sha256(content).hexdigest()[:32]}"')

    def answer(self, request: Request, kind: str, headers: Mapping[str, str]) -> Response:
        """What a browser gets that asks for it: the bytes, unless it has them.

        Args:
            request: What it asks.
            kind: Media type.
            headers: Of every answer.
        """
        given = {**headers, "ETag": self.tag, "Vary": "Accept-Encoding"}
        if request.headers.get("if-none-match") == self.tag:
            return Response(None, 304, given)
        if "gzip" in request.headers.get("accept-encoding", ""):
            return Response(self.packed, 200, {**given, "Content-Encoding": "gzip"}, kind)
        return Response(self.content, 200, given, kind)


SLICE = 2e-3
"""So long clients' messages may be worked on before all others of the loop have had their turn [s]."""
LONGEST_WAIT = 0.5
"""After so long at most it's looked again whether a client that has spent too much may go on [s]."""
LONGEST_NOTED: Final = 100
"""Characters of what a stranger says that go into the audit log."""
BLOCKED = 2.0
"""A client is cut off when a message has waited so long to be sent [s]."""
_LOOK = 0.25
"""Time between two looks at who is blocked [s]."""
_DONE = 1000, 1001
"""Close codes of a client that is done."""


_LOG = logging.getLogger(__name__)


class Slices:
    """Lets many tasks of a loop work by turns, so long together in each of its rounds.

    Whoever may go first doesn't wait: only what it takes counts.
    """

    def __init__(self, length: float = SLICE) -> None:
        """Begin with a whole slice.

        Args:
            length: So long they may work in a round [s].
        """
        self._length = self._left = length
        self._waiting: deque[asyncio.Future[None]] = deque()
        self._armed = False

    async def turn(self, *, first: bool = False) -> None:
        """Wait for one's turn."""
        while self._left <= 0.0 and not first:
            turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
            self._waiting.append(turn)
            await turn

    def spend(self, seconds: float) -> None:
        """Note what was done in one's turn."""
        self._left -= seconds
        self._arm()

    def _arm(self) -> None:
        if not self._armed:
            self._armed = True
            asyncio.get_running_loop().call_soon(self._renew)

    def _renew(self) -> None:
        """Begin another round; what was too long in the one before is left out of it."""
        self._armed = False
        self._left = min(self._left + self._length, self._length)
        while self._waiting and self._waiting[0].done():
            self._waiting.popleft()
        if self._left > 0.0 and self._waiting:
            self._waiting.popleft().set_result(None)
        if self._waiting or self._left < self._length:
            self._arm()


class _ServedClient:
    __slots__ = ("blocked_since", "session", "socket", "wake")

    def __init__(self, session: HubSession, socket: BoundedWebSocket) -> None:
        self.session, self.socket = session, socket
        self.wake = asyncio.Event()
        self.blocked_since: float | None = None


class HubServer:
    """Joins a hub to sockets. Enter it where its loop runs; `routes` go into an application."""

    def __init__(
        self,
        hub: Hub,
        clock: Clock,
        *,
        health: Callable[[], Mapping[str, Any]] | None = None,
        turned: Callable[[], None] | None = None,
    ) -> None:
        """Serve a hub.

        Args:
            hub: Nobody else calls its `advance` while this runs.
            clock: Session time.
            health: More for `/health`.
            turned: Called whenever the hub has advanced: the robot may have been told something.
        """
        self.hub, self.clock = hub, clock
        self._health, self._turned = health, turned
        self.clients: dict[HubSession, _ServedClient] = {}
        """Those that are served."""
        self._turning = Turning(clock, self._turn, longest=math.inf)
        self._now = clock.now()
        self._slices = Slices()
        self.cut_off = 0
        """Clients that were cut off because their sending was blocked."""

    @property
    def routes(self) -> list[BaseRoute]:
        """`/ws` and `/health`."""
        return [Route("/health", self._say_health), WebSocketRoute("/ws", Endpoint(self.serve))]

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[HubServer]:
        """Make frames and serve clients meanwhile."""
        watcher = asyncio.create_task(self._watch())
        self._turning.start()
        try:
            yield self
        finally:
            self._turning.stop()
            watcher.cancel()
            for session in self.hub.close():
                if session in self.clients:
                    self.clients[session].wake.set()

    def kick(self) -> None:
        """Something has come: do soon what is due."""
        self._turning.soon()

    def _turn(self, now: float) -> float | None:
        """Do what is due, and wake the writers that have something to send."""
        self._now = now
        for session in self.hub.advance(now=now):
            self.clients[session].wake.set()
        if self._turned is not None:
            self._turned()
        return self.hub.next_deadline()

    async def serve(self, encoding: Encoding, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection that was accepted, until it ends."""
        address = (scope.get("client") or ("", 0))[0]
        session = self.hub.open(encoding, now=self.clock.now(), address=address)
        socket: BoundedWebSocket = scope["state"]["socket"]
        client = self.clients[session] = _ServedClient(session, socket)
        writer = asyncio.create_task(self._write(client, send))
        writer.add_done_callback(partial(self._written, client))
        client.wake.set()
        done = known = False
        try:
            while (message := await receive())["type"] != "websocket.disconnect":
                await self._slices.turn(first=session.commands)
                # The processor's time: what stops the whole machine is no client's fault.
                begun, now = processor_time(), self.clock.now()
                data = message.get("bytes")
                session.receive(message["text"] if data is None else data, now=now)
                if not known and session.seat is not None:
                    known = True
                    socket.let_stay(known=True)
                if session.role is not Role.VIEWER:
                    self.kick()
                elif session.is_due(now):
                    client.wake.set()
                work, socket.work = processor_time() - begun + socket.work, 0.0
                self._slices.spend(work)
                session.spend(work, now=self.clock.now())
                # Meanwhile nothing more is read: it waits at the client's end.
                while (wait := session.wait(now=self.clock.now())) > 0.0:
                    if session.say_waiting(wait, now=self.clock.now()):
                        client.wake.set()
                    await asyncio.sleep(min(wait, LONGEST_WAIT))
            done = message.get("code") in _DONE and session.closing is None
        finally:
            writer.cancel()
            del self.clients[session]
            self.hub.leave(session, done=done, now=self.clock.now())
            await asyncio.wait([writer])

    async def _write(self, client: _ServedClient, send: Send) -> None:
        session, socket = client.session, client.socket
        opcode = Opcode.BINARY if session.encoding is Encoding.MSGPACK else Opcode.TEXT
        with contextlib.suppress(OSError):
            while session.closing is None or session.outbox:
                await client.wake.wait()
                client.wake.clear()
                more = True
                while more:
                    for data in session.advance(now=self._now):
                        client.blocked_since = self._now
                        await socket.put(data, opcode)
                    more = bool(session.outbox)
                client.blocked_since = None
            assert session.closing is not None
            code, reason = session.closing
            await send({"type": "websocket.close", "code": code, "reason": reason[:100]})

    def _written(self, client: _ServedClient, writer: asyncio.Task[None]) -> None:
        """Cut a client off that can't be written to, for a reason that nobody expects."""
        if not writer.cancelled() and (error := writer.exception()) is not None:
            _LOG.error("a client is cut off", exc_info=error)
            client.socket.abort()

    async def _watch(self) -> None:
        while True:
            await asyncio.sleep(_LOOK)
            limit = self.clock.now() - BLOCKED
            for client in list(self.clients.values()):
                if client.blocked_since is not None and client.blocked_since < limit:
                    self.cut_off += 1
                    client.socket.abort()

    async def _say_health(self, request: Request) -> JSONResponse:
        hub = self.hub
        facts = {
            "ok": True,
            "now": self.clock.now(),
            "robot": hub.site.robot,
            "server": hub.config.server,
            "clients": len(self.clients),
            "cut_off": self.cut_off,
            "lease": hub.lease_state.value,
        }
        if hub.audit is not None:
            facts["audit"] = hub.audit.health()
        facts |= dict(self._health() if self._health is not None else {})
        return health(facts, bool(facts["ok"]), may_see(request, hub.access, Role.VIEWER))


def admit(access: Access, role: Role, connection: HTTPConnection, token: str | None) -> Admission:
    """Decide whether who comes to a door of HTTP gets a role; a refusal goes into the audit log.

    Args:
        access: Who may come in.
        role: What it takes.
        connection: A request, or a WebSocket that has shown a token.
        token: That token.
    """
    found = access.admit(role, token)
    if found.refusal and access.audit is not None:
        person = found.person or None
        access.audit.refused(
            what=_asked(connection.scope), why=found.refusal, person=person, role=role.value,
            address=_address(connection.scope),
        )  # fmt: skip
    return found


def refusal(request: Request, access: Access, role: Role) -> str:
    """Why a request isn't one of a role, by the token in its header; empty if it is."""
    return admit(access, role, request, bearer(request.headers.get("authorization", ""))).refusal


def may_see(request: Request, access: Access, role: Role) -> bool:
    """Whether a request shows a token of a role, or needs none; one without a token is no attempt at a role."""
    if "authorization" in request.headers:
        return not refusal(request, access, role)
    return not access.refusal(role, None)


def _asked(scope: Scope) -> str:
    """What a request is for, for the audit log: strangers choose how long a path is."""
    return f"{scope.get('method', 'WebSocket')} {scope['path']}"[:LONGEST_NOTED]


def _address(scope: Scope) -> str:
    return str((scope.get("client") or ("",))[0])


def health(facts: Mapping[str, Any], ok: bool, known: bool) -> JSONResponse:
    """What `/health` answers: everything to who is known, else whether all is well and no more.

    Args:
        facts: Everything, with `ok`.
        ok: Whether all is well: else the status is 503.
        known: Who asks has shown a token, or needs none.
    """
    return JSONResponse(dict(facts) if known else {"ok": facts["ok"]}, 200 if ok else 503)


class Endpoint:
    """A WebSocket of ours as an ASGI application: it's accepted with the encoding that the client asks for."""

    def __init__(self, serve: Callable[[Encoding, Scope, Receive, Send], Awaitable[None]]) -> None:
        """Say who serves.

        Args:
            serve: Serves a connection that was accepted, until it ends.
        """
        self._serve = serve

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one connection."""
        await receive()
        chosen = next((name for name in scope["subprotocols"] if name in set(Encoding)), None)
        if chosen is None:
            await send({"type": "websocket.close", "code": 1002, "reason": "no subprotocol of ours"})
            return
        await send({"type": "websocket.accept", "subprotocol": chosen})
        await self._serve(Encoding(chosen), scope, receive, send)


REFUSED = "this Host or Origin isn't allowed here; the server's option --reached-as lets one in\n"
"""Said to what doesn't name this server."""


async def _refuse(scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008, "reason": ""})
    else:
        await PlainTextResponse(REFUSED, 403)(scope, receive, send)


def application(routes: Sequence[BaseRoute], allowed: frozenset[str], *, audit: AuditLog | None = None) -> ASGIApp:
    """An application of routes that lets in only what names this server exactly, and comes from no other's page.

    Args:
        routes: What it answers.
        allowed: From `access.hosts`.
        audit: Where it's written who isn't let in; nowhere unless given.
    """
    app = Starlette(routes=list(routes))

    async def guarded(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] in {"http", "websocket"}:
            given = [(name.lower(), value.decode("latin-1")) for name, value in scope["headers"]]
            host = [value for name, value in given if name == b"host"]
            origin = [value for name, value in given if name == b"origin"]
            tls = scope.get("scheme") in {"https", "wss"}
            if not (check_host(host, allowed) and check_origin(origin, allowed, tls=tls)):
                if audit is not None:
                    named = ", ".join(host + origin)[:LONGEST_NOTED]
                    audit.refused(what=_asked(scope), why=f"Host or Origin: {named}", address=_address(scope))
                await _refuse(scope, receive, send)
                return
        await app(scope, receive, send)

    return guarded
