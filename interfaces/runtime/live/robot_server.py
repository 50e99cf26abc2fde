"""The robot's end of a connection to an operator's site: one site at a time, on a socket."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import socket
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

import msgspec
from starlette.routing import BaseRoute, WebSocketRoute
from starlette.types import Receive, Scope, Send

from interfaces.messages.control import PROTOCOL, Attached, Hello, Pong, Problem, ProblemCode, ProtocolError, Role
from interfaces.runtime.live.datagrams import NO_UDP, DatagramSocket, DatagramState, RobotDatagrams
from interfaces.stream.access import Access
from interfaces.stream.audit import AuditLog
from interfaces.stream.codec import Encoding, Value, decode, encode
from interfaces.stream.server import Endpoint
from interfaces.stream.sockets import let_stay, tls_version
from interfaces.teleop.connection import Host
from robots.onboard.watchdog import LossPolicy
from vrs.checks import one_of
from vrs.clock import Clock
from vrs.errors import InvalidValueError

LARGEST = 1 << 20
"""Longest message of an operator's site: thousands of commands that wait to be acknowledged [B]."""
HELLO = 2.0
"""Time for the first message of a connection [s]."""
_WAITING = 64
"""Most messages that wait to be sent; older ones are dropped, for newer ones say it all."""
_PROBLEMS = 32
"""So many messages that can't be taken end a connection."""
_GONE = 1001
_NO_ROOM = 1013
_POLICY = 1008
_FAILED = 1011
_KEEPS_SECRETS = {"", "TLSv1.3"}
"""Streams on which the secret of datagrams is told: those that aren't encrypted have no other."""
_LOG = logging.getLogger(__name__)


class _OperatorConnection:
    """An operator's site on a socket."""

    def __init__(self, encoding: Encoding) -> None:
        self.encoding = encoding
        self.waiting: deque[bytes] = deque(maxlen=_WAITING)
        self.wake = asyncio.Event()
        self.close: tuple[int, str] | None = None
        self.problems = 0
        self.datagrams: RobotDatagrams | None = None
        self.counts: Callable[[], bool] = lambda: True
        """Whether the token that was shown counts still."""

    def send(self, message: Value) -> bytes:
        data = encode(message, self.encoding)
        self.waiting.append(data)
        self.wake.set()
        return data

    def end(self, code: int, reason: str) -> None:
        self.close = code, reason
        self.wake.set()


class RobotServer:
    """Joins a `Host` to the operator's site that has said hello last, if it's let in."""

    def __init__(
        self,
        host: Host[Any, Any, Any],
        clock: Clock,
        access: Access,
        *,
        attached: Callable[[], Attached],
        met: Callable[[Attached], None],
        heard: Callable[[], None],
        audit: AuditLog | None = None,
    ) -> None:
        """Serve a host.

        Args:
            host: What listens and is said hello to.
            clock: The robot's.
            access: Who may come in as `Role.SITE`.
            attached: What a site is told that is let in.
            met: Is given that when one has been.
            heard: Called when a message comes that the host is given.
            audit: Where it's written who is followed, and who is refused; nowhere unless given.
        """
        self._audit = audit
        self._socket: DatagramSocket | None = None
        self._host, self._clock, self._access = host, clock, access
        self._attached, self._met, self._heard = attached, met, heard
        self._coming: Any = host.orders | Pong
        self._connection: _OperatorConnection | None = None

    @property
    def routes(self) -> list[BaseRoute]:
        """`/site`."""
        return [WebSocketRoute("/site", Endpoint(self.serve))]

    @property
    def connected(self) -> bool:
        """Whether an operator's site is there."""
        return self._connection is not None

    @property
    def datagrams(self) -> DatagramState:
        """How datagrams from the operator's site get on."""
        ours = None if self._connection is None else self._connection.datagrams
        return DatagramState.OFF if ours is None else ours.state

    def send(self, messages: Iterable[Value]) -> None:
        """Send messages to the operator's site; without one they're dropped."""
        connection = self._connection
        if connection is None:
            return
        for message in messages:
            data = connection.send(message)
            if connection.datagrams is not None and self._socket is not None:
                self._socket.send(connection.datagrams.seal(data), connection.datagrams.address)

    def start(self, datagrams: socket.socket | None) -> None:
        """Take datagrams from now on, where the loop runs: by a bound socket; None for none."""
        if datagrams is not None:
            with contextlib.suppress(*NO_UDP):
                self._socket = DatagramSocket(datagrams, self._take)

    def close(self) -> None:
        """Say farewell to the operator's site."""
        if self._connection is not None:
            self._connection.end(_GONE, "the robot's site stops")
        if self._socket is not None:
            self._socket.close()

    async def serve(self, encoding: Encoding, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a connection that was accepted, until it ends."""
        connection = _OperatorConnection(encoding)
        address = str((scope.get("client") or ("",))[0])
        writer = asyncio.create_task(self._write(connection, send))
        try:
            try:
                async with asyncio.timeout(HELLO):
                    refusal = self._greet(connection, await receive(), tls_version(scope))
            except TimeoutError:
                refusal = Problem(ProblemCode.HELLO_LATE, f"no hello within {HELLO:g} s", fatal=True)
            if refusal is None:
                let_stay(scope, known=True, counts=connection.counts)
                self._note("followed", address)
            else:
                if self._audit is not None:
                    self._audit.refused(what="hello", why=refusal.text, role=Role.SITE.value, address=address)
                connection.send(refusal)
                connection.end(_POLICY if refusal.code is not ProblemCode.FULL else _NO_ROOM, refusal.text)
            while connection.close is None and (message := await receive())["type"] != "websocket.disconnect":
                data = _data(message)
                if connection.datagrams is None or connection.datagrams.streamed(data):
                    self._hear(connection, data)
            await asyncio.wait([writer], timeout=1.0 if connection.close is not None else 0.0)
        finally:
            writer.cancel()
            if self._connection is connection:
                self._connection = None
                self._note("left", address)

    def _note(self, event: str, address: str) -> None:
        if self._audit is not None:
            self._audit.note(event, role=Role.SITE.value, address=address)

    def _greet(self, connection: _OperatorConnection, message: Any, tls: str) -> Problem | None:
        """Take the first message; why it can't be, or None if the operator is followed from now on."""
        try:
            hello = decode(_data(message), connection.encoding, allowed=Hello)
            admission = self._access.admit(Role.SITE, hello.token)
            if hello.protocol != PROTOCOL:
                return Problem(ProblemCode.VERSION, f"this is version {PROTOCOL} of the protocol", fatal=True)
            if hello.role is not Role.SITE or admission.refusal:
                text = admission.refusal or "only an operator's site comes here"
                return Problem(ProblemCode.REFUSED, text, fatal=True)
            asked = hello.link_loss
            loss = None if asked is None else LossPolicy(one_of("link_loss", asked, LossPolicy))
            busy = self._host.hello(hello.session or "", now=self._clock.now(), link_loss=loss)
        except ProtocolError as error:
            return Problem(error.code, str(error), fatal=True)
        except InvalidValueError as error:
            return Problem(ProblemCode.OUT_OF_RANGE, str(error), fatal=True)
        if busy:
            return Problem(ProblemCode.FULL, busy, fatal=True)
        if self._connection is not None:
            self._connection.end(_POLICY, "the same site has connected again")
        self._connection, connection.counts = connection, admission.counts
        attached = self._attached()
        if hello.datagrams and self._socket is not None and tls in _KEEPS_SECRETS:
            secret = secrets.token_urlsafe(32)
            connection.datagrams = RobotDatagrams(secret)
            connection.send(msgspec.structs.replace(attached, datagrams=secret))
        else:
            connection.send(attached)
        self._met(attached)
        return None

    def _take(self, datagram: bytes, address: Any) -> None:
        """Take a datagram from an address."""
        connection = self._connection
        if connection is None or connection.datagrams is None:
            return
        message, answer = connection.datagrams.take(datagram, address)
        assert self._socket is not None
        self._socket.send(answer, address)
        if message:
            self._hear(connection, message)

    def _hear(self, connection: _OperatorConnection, data: bytes) -> None:
        if self._connection is not connection:
            return
        try:
            message = decode(data, connection.encoding, allowed=self._coming, largest=LARGEST)
        except ProtocolError as error:
            connection.problems += 1
            connection.send(Problem(error.code, str(error), fatal=connection.problems >= _PROBLEMS))
            if connection.problems >= _PROBLEMS:
                connection.end(_POLICY, "too many messages that can't be taken")
            return
        self._heard()
        try:
            self._host.receive(message, now=self._clock.now())
        except Exception as error:  # noqa: BLE001 - whatever it is, it ends no more than this connection
            _LOG.exception("a message of the operator's site failed")
            reason = f"the robot's site failed at a message: {type(error).__name__}"
            self._host.halt(reason, now=self._clock.now())
            connection.end(_FAILED, reason)

    async def _write(self, connection: _OperatorConnection, send: Send) -> None:
        kind = "bytes" if connection.encoding is Encoding.MSGPACK else "text"
        with contextlib.suppress(OSError):
            while True:
                while connection.waiting:
                    data = connection.waiting.popleft()
                    await send({"type": "websocket.send", kind: data if kind == "bytes" else data.decode()})
                if connection.close is not None:
                    code, reason = connection.close
                    await send({"type": "websocket.close", "code": code, "reason": reason[:100]})
                    return
                connection.wake.clear()
                await connection.wake.wait()


def _data(message: Any) -> bytes:
    """The bytes of a frame; of none where it's a disconnect."""
    data, text = message.get("bytes"), message.get("text")
    return bytes(data) if data is not None else (text or "").encode()
