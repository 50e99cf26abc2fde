"""A plain client of the wire protocol: any WebSocket library, JSON or MessagePack, and maps."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from typing import Any

import msgspec
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

SECONDS = 30.0
"""The longest wait for a message [s]: robots start meanwhile."""


class Talk:
    """One connection, and all that came through it."""

    def __init__(self, connection: ClientConnection, *, text: bool) -> None:
        self._connection = connection
        self._coding: Any = msgspec.json if text else msgspec.msgpack
        self._text = text
        self._new = asyncio.Condition()
        self.came: list[dict[str, Any]] = []
        """Every message, in its order."""
        self.ended = False
        """Whether nothing more will come."""

    async def listen(self) -> None:
        """Collect what comes, until the connection ends."""
        with contextlib.suppress(ConnectionClosed):
            async for data in self._connection:
                message = self._coding.decode(data.encode() if isinstance(data, str) else data)
                async with self._new:
                    self.came.append(message)
                    self._new.notify_all()
                if message["type"] == "ping":
                    now = asyncio.get_running_loop().time()
                    await self.send({**message, "type": "pong", "received": now, "answered": now})
        async with self._new:
            self.ended = True
            self._new.notify_all()

    async def send(self, message: dict[str, Any]) -> int:
        """Send a message; returns how many had come before."""
        before = len(self.came)
        raw = self._coding.encode(message)
        await self._connection.send(raw.decode() if self._text else raw)
        return before

    async def wait(
        self, kind: str, so: Callable[[dict[str, Any]], Any] = lambda message: True, *, after: int = 0
    ) -> dict[str, Any]:
        """Wait for a message of a kind that is so, among those from an index on."""
        return await self._find(lambda message: message["type"] == kind and so(message), after, kind)

    async def ask(self, message: dict[str, Any], answer: str, field: str = "number") -> dict[str, Any]:
        """Send a message, and wait for the answer or the problem that has its number in `field`."""
        number = message["number"]
        before = await self.send(message)
        return await self._find(
            lambda came: (
                (came["type"], came.get(field)) == (answer, number)
                or (came["type"], came.get("number")) == ("problem", number)
            ),
            before,
            f"{answer} to {message}",
        )

    @contextlib.asynccontextmanager
    async def beating(self, epoch: str) -> AsyncIterator[None]:
        """Keep the lease meanwhile."""

        async def beat() -> None:
            while True:
                await asyncio.sleep(0.5)
                await self.send({"type": "beat", "epoch": epoch})

        beats = asyncio.create_task(beat())
        try:
            yield
        finally:
            beats.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await beats

    async def _find(self, so: Callable[[dict[str, Any]], Any], first: int, what: str) -> dict[str, Any]:
        """Wait for a message, among those from an index on."""
        try:
            async with asyncio.timeout(SECONDS), self._new:
                while True:
                    for index in range(first, len(self.came)):
                        if so(self.came[index]):
                            return self.came[index]
                    first = len(self.came)
                    if self.ended:
                        raise ConnectionError(f"the connection ended before: {what}; last: {self.came[-3:]}")
                    await self._new.wait()
        except TimeoutError:
            raise TimeoutError(f"it never came: {what}; last: {self.came[-3:]}") from None


@contextlib.asynccontextmanager
async def talking(
    address: str, role: str, *, text: bool = False, path: str = "ws", **hello: Any
) -> AsyncIterator[Talk]:
    """Connect and say hello."""
    protocol: Any = "vrs.1.json" if text else "vrs.1.msgpack"
    async with connect(
        f"ws://{address}/{path}", subprotocols=[protocol], compression=None, proxy=None, max_size=1 << 20
    ) as connection:
        talk = Talk(connection, text=text)
        listening = asyncio.create_task(talk.listen())
        try:
            await talk.send({"type": "hello", "protocol": 1, "role": role, "name": "contract", **hello})
            yield talk
        finally:
            listening.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await listening
