"""The operator's connection to a robot's site: made again whenever it breaks."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

import msgspec
from websockets.asyncio.client import ClientConnection
from websockets.exceptions import WebSocketException

from interfaces.messages.control import PROTOCOL, Attached, Hello, Ping, Problem, ProtocolError, Role
from interfaces.messages.sites import Report
from interfaces.runtime.live.datagrams import NO_UDP, DatagramSocket, DatagramState, OperatorDatagrams, connected
from interfaces.stream.certificates import Certificate, explained
from interfaces.stream.client_socket import dial
from interfaces.stream.codec import Encoding, Value, decode, encode
from interfaces.teleop.connection import SiteLine
from robots.onboard.watchdog import LossPolicy
from vrs.clock import Clock
from vrs.errors import VrsError

AGAIN = 0.25
"""Time between two attempts to connect [s]."""
UNHEARD = 0.75
"""A robot of which nothing has come for so long [s] isn't connected, as clients are told."""
GONE = 2.0
"""A robot of which nothing has come for so long [s] is gone; as far as a lease is concerned, it has stopped."""
OPENING = 3.0
"""Longest that a connection may take to be made, and answered [s]."""
LARGEST = 4 << 20
"""Longest message of a robot: a plan of thousands of segments [B]."""
BLOCKED = "no datagram gets through, so all goes by the stream alone: is UDP let through to the port of"
"""What is said of datagrams, before an address."""
_WAITING = 64
"""Most messages that wait to be sent; older ones are dropped, for newer ones repeat what counts."""
_BLOCKED = 2.0
"""A connection that takes nothing for so long is broken [s]."""
_LOG = logging.getLogger(__name__)


class RobotRefusedError(VrsError):
    """A robot's site doesn't let this operator in."""

    def __init__(self, text: str) -> None:
        self.text = text
        super().__init__(f"the robot's site refuses: {text}")


class RobotUnfitError(VrsError):
    """A robot isn't the one that this operator's site drives."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(f"not the robot that is driven here: {reason}")


class RobotClient:
    """Keeps a `SiteLine` connected."""

    def __init__(
        self,
        line: SiteLine[Any, Any, Any],
        url: str,
        clock: Clock,
        changed: Callable[[], None],
        *,
        name: str,
        room: str = "",
        token: str | None = None,
        certificate: Certificate | None = None,
        reports: type = Report,
        link_loss: LossPolicy | None = None,
        datagrams: bool = False,
        say: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Say where the robot is; `run` connects.

        Args:
            line: What speaks and listens.
            url: From `server_url`, as `ws://HOST:PORT/site`; empty while that isn't known yet, see `url`.
            clock: Session time.
            changed: Called when something has come, or the connection has.
            name: Of the robot's model; another isn't let in.
            room: Of a mobile robot: name of the room that it's to drive in.
            token: Of the role `site`.
            certificate: What this site shows to one that asks for it.
            reports: What its robots send.
            link_loss: What the robot is to do when the link is lost; None leaves it to the robot.
            datagrams: Whether messages are also sent as datagrams, where the robot takes them.
            say: Is told, for people, why it can't connect, whenever that's another reason, and once that no
                datagram gets through.
        """
        self._coming: Any = reports | Ping | Problem
        self._name, self._room, self._link_loss = name, room, link_loss
        self._line, self.url, self._clock, self._changed, self._token = line, url, clock, changed, token
        self._certificate = certificate
        self._session = secrets.token_urlsafe(12)
        self._wants_datagrams, self._say = datagrams, say
        self._said = ""
        self._told = False
        self._datagrams: tuple[OperatorDatagrams, DatagramSocket] | None = None
        self._waiting: deque[bytes] = deque(maxlen=_WAITING)
        self._wake = asyncio.Event()
        self.attached: Attached | None = None
        """What the robot said of itself; None while there's no connection."""
        self.problem = "not connected yet"
        """Why there's no connection."""
        self.heard = -1e9
        """When something came off the connection last [s]; the emulated delay isn't in it."""
        self.connections = 0
        self.lost = ""
        """Why there's no robot to connect to any more; empty while there may be one."""

    @property
    def connected(self) -> bool:
        """Whether the robot's site is heard of."""
        return self._clock.now() - self.heard < UNHEARD and self._line.connected and not self.lost

    def health(self, also: str = "") -> dict[str, object]:
        """How the way to the robot is, for `/health`: whether all is well with it, and why not.

        Args:
            also: What else is wrong; empty if nothing is.
        """
        reason, silence = self.lost or also, self._clock.now() - self.heard
        if not reason and self.connections and silence > GONE:
            reason = f"nothing is heard of the robot at {self.url}: {self.problem or 'it is silent'}"
        return {
            "robot_at": self.url,
            "delay": self._line.link.conditions.forward.delay.name,
            "connected": self.connected,
            "problem": self.problem,
            "ok": not reason,
            "reason": reason,
            "silence": silence if silence < 1e6 else None,
            "datagrams": self.datagrams,
        }

    @property
    def datagrams(self) -> DatagramState:
        """How datagrams to and from the robot get on."""
        return DatagramState.OFF if self._datagrams is None else self._datagrams[0].state

    def _unfit(self, robot: Attached) -> str:
        """Why a robot isn't the one that is driven here; empty if it is."""
        name, room = self._name, self._room
        if robot.robot != name:
            return f"it's a {robot.robot}, and this site drives {'an' if name[0] in 'aeiou' else 'a'} {name}"
        same = robot.room == room
        return "" if same else f"its room is {robot.room!r}, and this site has {room!r}: give both one"

    def send(self, message: Value) -> None:
        """Put a message on the connection, and send it in datagrams where there are some."""
        data = encode(message, Encoding.MSGPACK)
        if self._datagrams is not None:
            sealing, sock = self._datagrams
            sock.send(sealing.seal(data))
        self._waiting.append(data)
        self._wake.set()

    async def run(self) -> None:
        """Connect, and connect again, until it's cancelled."""
        while True:
            try:
                if self.url and not self.lost:
                    await self._once()
            except (
                OSError,
                TimeoutError,
                WebSocketException,
                ProtocolError,
                RobotRefusedError,
                RobotUnfitError,
            ) as error:
                self.problem = explained(error, tls=self.url.startswith("wss"))
                if self.problem != self._said and not self.lost:
                    self._said = self.problem
                    self._say(f"no robot at {self.url.partition('#')[0]}: {self.problem}; it's tried again")
            except Exception as error:  # noqa: BLE001 - whatever it is, it ends no more than this connection
                _LOG.exception("the connection to the robot failed")
                self.problem = f"this site failed at a message of the robot's: {type(error).__name__}"
            finally:
                self._line.connected, self.attached = False, None
                self.problem = self.lost or self.problem
                self._changed()
            await asyncio.sleep(AGAIN)

    async def _once(self) -> None:
        line = dial(
            self.url,
            Encoding.MSGPACK,
            largest=LARGEST,
            opening=OPENING,
            closing=0.5,
            certificate=self._certificate,
        )
        async with line as stream:
            hello = Hello(
                PROTOCOL, Role.SITE, "vrs serve", self._token, self._session, link_loss=self._link_loss,
                datagrams=self._wants_datagrams,
            )  # fmt: skip
            await stream.send(encode(hello, Encoding.MSGPACK))
            async with asyncio.timeout(OPENING):
                answer = decode(_bytes(await stream.recv()), Encoding.MSGPACK, allowed=Attached | Problem)
            if isinstance(answer, Problem):
                raise RobotRefusedError(answer.text)
            if unfit := self._unfit(answer):
                raise RobotUnfitError(unfit)
            self.attached, self.problem = msgspec.structs.replace(answer, datagrams=""), ""
            self._said = ""
            self.connections += 1
            self._waiting.clear()
            self._line.connected = True
            self._changed()
            writer = asyncio.create_task(self._write(stream))
            try:
                with self._beside(answer.datagrams, stream):
                    async for data in stream:
                        self._streamed(_bytes(data))
            finally:
                writer.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await writer
            self.problem = "the robot's site closed the connection"

    @contextlib.contextmanager
    def _beside(self, secret: str, stream: ClientConnection) -> Iterator[None]:
        """Send and take datagrams meanwhile, to where the stream goes; none without a secret."""

        def take(datagram: bytes, _address: object) -> None:
            message = ours.take(datagram)
            try:
                if message:
                    self._take(message)
            except Exception:  # noqa: BLE001 - as on the stream: whatever it is, it ends no more than this connection
                _LOG.exception("a datagram of the robot's failed")
                stream.transport.abort()

        with contextlib.ExitStack() as stack:
            if secret and self._wants_datagrams:
                ours = OperatorDatagrams(secret)
                with contextlib.suppress(*NO_UDP):
                    reading = DatagramSocket(connected(stream.remote_address), take)
                    self._datagrams = ours, stack.enter_context(contextlib.closing(reading))
            try:
                yield
            finally:
                self._datagrams = None

    def _streamed(self, data: bytes) -> None:
        """Take a message that has come by the stream, unless it has come as a datagram already."""
        if self._datagrams is None:
            self._take(data)
        elif self._datagrams[0].streamed(data):
            self._take(data)
            if self.datagrams is DatagramState.BLOCKED and not self._told:
                self._told = True
                self._say(f"{BLOCKED} {self.url.partition('#')[0]}")

    def _take(self, data: bytes) -> None:
        message = decode(data, Encoding.MSGPACK, allowed=self._coming, largest=LARGEST)
        self.heard = self._clock.now()
        if isinstance(message, Problem):
            self.problem = message.text
            return
        self._line.receive(message, now=self.heard)
        self._changed()

    async def _write(self, stream: ClientConnection) -> None:
        try:
            while True:
                await self._wake.wait()
                self._wake.clear()
                while self._waiting:
                    async with asyncio.timeout(_BLOCKED):
                        await stream.send(self._waiting.popleft())
        except (OSError, TimeoutError, WebSocketException):
            stream.transport.abort()


def _bytes(data: str | bytes) -> bytes:
    return data.encode() if isinstance(data, str) else data
