"""Recording on the fly and the list of recordings: what the panel is told, and what it may ask for."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import secrets
from collections import OrderedDict
from collections.abc import AsyncIterator, Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple
from urllib.parse import quote

import msgspec
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.types import Receive, Scope, Send

from interfaces.messages.control import Role
from interfaces.recording.mcap_file import RecordingError
from interfaces.station.replays import Replays
from interfaces.station.shelf import Shelf
from interfaces.stream.access import Access, bearer
from interfaces.stream.limits import Bucket
from interfaces.stream.meshcat.newest import Newest
from interfaces.stream.meshcat.page import Viewers
from interfaces.stream.server import HEADERS, admit, refusal
from interfaces.system import PLAIN_READ
from vrs.clock import Clock
from vrs.errors import InvalidValueError, VrsError

if TYPE_CHECKING:
    from interfaces.recording.live import LiveRecording
    from interfaces.runtime.live.recording import SiteRecording

STATE: Final = 0.25
"""Time between two looks at the recording that is made [s]."""
LIST: Final = 2.0
"""Time between two looks at the directory, while somebody has a page open [s]."""
LARGEST: Final = 4096
"""Bytes of a request."""
RATE, BURST = 5.0, 30.0
"""Requests a second of each role, for long and at once."""
TICKET: Final = 30.0
"""How long a download may be begun [s]."""
SENT_AT_ONCE: Final = 4
"""Downloads at once."""
_CHUNK: Final = 65536
"""Bytes of a download that are read at once."""


class _RecordAsk(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a page asks for."""

    do: str
    name: str = ""


class _Ticket(NamedTuple):
    """What a download may be begun by."""

    path: Path
    file: tuple[int, int]
    """Device and number of the file that was meant: another one in its place isn't sent."""
    until: float
    """[s]"""
    counts: Callable[[], bool]
    """Whether the token that it was given for counts still."""


class Recordings:
    """Joins what is recorded, the directory and the pages. Enter `running` in the loop that serves."""

    def __init__(
        self,
        recording: SiteRecording,
        clock: Clock,
        shelf: Shelf,
        access: Access,
        what: Callable[[Path], LiveRecording],
    ) -> None:
        """Wait for pages.

        Args:
            recording: What is recorded of the operator's site.
            clock: Session time.
            shelf: Where recordings are put.
            access: Who may do what: viewers look, replay and take copies, operators record and delete.
            what: Says what a new recording is, into a file.
        """
        self._recording, self._clock, self._shelf, self._access = recording, clock, shelf, access
        self._what = what
        allowed = partial(admit, access, Role.VIEWER)
        self.replays = Replays(shelf, clock, allowed)
        self._board = Newest(b'{"kind":"begin"}')
        self._viewers = Viewers(self._board, allowed)
        self._looking = asyncio.Event()
        self._asked = {role: Bucket(RATE, BURST, clock.now()) for role in Role}
        self._tickets: OrderedDict[str, _Ticket] = OrderedDict()
        self.sent = 0
        """Downloads under way."""

    @property
    def routes(self) -> list[BaseRoute]:
        """What it answers."""
        return [
            Route("/recordings", self._answer, methods=["POST"]),
            Route("/recordings/copy/{ticket}", self._copy),
            WebSocketRoute("/recordings/board", self._viewers.serve),
            *self.replays.routes,
        ]

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[Recordings]:
        """Tell pages what is going on."""
        tasks = [asyncio.create_task(work) for work in (self._tell_state(), self._tell_list())]
        try:
            async with self.replays.running():
                yield self
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _tell_state(self) -> None:
        before: str | None = None
        while True:
            recorder, now = self._recording.recorder, None
            if recorder is not None:
                facts = recorder.health()
                now = {
                    "name": recorder.path.name,
                    "length": round(self._clock.now() - recorder.since),
                    "size": recorder.size,
                    "dropped": facts["dropped"],
                    "problem": facts["problem"],
                }
            self._put("recording", {"kind": "recording", "now": now})
            name = None if recorder is None else recorder.path.name
            if name != before:
                before = name
                self._looking.set()
            await asyncio.sleep(STATE)

    async def _tell_list(self) -> None:
        while True:
            if self._board.readers:
                recorder = self._recording.recorder
                growing = None if recorder is None else recorder.path.name
                entries, more = await asyncio.to_thread(self._shelf.entries, growing)
                items = [entry.facts() for entry in entries]
                robot = "" if self._shelf.robot is None else self._shelf.robot.name
                directory = str(self._shelf.directory)
                told = {"kind": "list", "robot": robot, "directory": directory, "items": items, "more": more}
                self._put("list", told)
            self._looking.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(LIST):
                    await self._looking.wait()

    def _put(self, key: str, value: dict[str, Any]) -> None:
        version = self._board.version
        self._board.put(key, json.dumps(value, allow_nan=False, separators=(",", ":")).encode())
        if self._board.version != version:
            self._board.wake()

    async def _answer(self, request: Request) -> Response:
        """Do what a page asks for."""
        try:
            if refused := refusal(request, self._access, Role.VIEWER):
                return said(403, refused)
            ask = msgspec.json.decode(await body(request, LARGEST), type=_RecordAsk)
            role = Role.VIEWER if ask.do == "copy" else Role.OPERATOR
            admission = admit(self._access, role, request, bearer(request.headers.get("authorization", "")))
            if admission.refusal:
                return said(403, admission.refusal)
            if not self._asked[role].take(self._clock.now()):
                return said(429, "too many requests: try again in a moment")
            return JSONResponse(await self._do(ask, admission.counts), 200, HEADERS)
        except ClientDisconnect:
            return said(408, "the request didn't come to its end in time")
        except msgspec.MsgspecError:
            return said(400, "this isn't a request that is known here")
        except VrsError as error:
            return said(409 if isinstance(error, RecordingError) else 400, str(error))

    async def _do(self, ask: _RecordAsk, counts: Callable[[], bool]) -> dict[str, Any]:
        match ask.do:
            case "begin":
                await self.begin(ask.name)
            case "end":
                problem = await self._recording.end()
                return {"problem": problem}
            case "copy":
                return {"path": f"/recordings/copy/{self._ticket(ask.name, counts)}"}
            case "delete":
                self.delete(ask.name)
            case _:
                raise InvalidValueError("do", ask.do, "begin, end, copy or delete")
        return {}

    async def begin(self, name: str) -> None:
        """Record into a new file of the directory.

        Raises:
            InvalidValueError: If the name can't be, or something is being recorded already.
            RecordingError: If the file can't be made.
        """
        path = self._shelf.place(name)
        await self._recording.begin(self._what(path))

    def delete(self, name: str) -> None:
        """Delete a recording; downloads that have begun come to their end.

        Raises:
            InvalidValueError: If there's none of that name, it's being written or looked at, or can't be deleted.
        """
        path = self._ended(name)
        if not self.replays.let_go(name):
            raise InvalidValueError("recording", name, "one at which nobody looks: it's played back on a page")
        try:
            path.unlink()
        except OSError as error:
            raise InvalidValueError("recording", name, f"one that can be deleted ({error.strerror})") from None
        self._looking.set()

    def _ended(self, name: str) -> Path:
        """Where a recording is that isn't being written."""
        recorder = self._recording.recorder
        path = self._shelf.path(name)
        if recorder is not None and recorder.path.resolve() == path.resolve():
            raise InvalidValueError("recording", name, "one that has ended: this one is being written")
        return path

    def _ticket(self, name: str, counts: Callable[[], bool]) -> str:
        """A word by which a recording can be fetched once, soon; it opens nothing else."""
        path = self._ended(name)
        ticket, state = secrets.token_urlsafe(18), path.lstat()
        self._tickets[ticket] = _Ticket(path, (state.st_dev, state.st_ino), self._clock.now() + TICKET, counts)
        while len(self._tickets) > 2 * SENT_AT_ONCE:
            self._tickets.popitem(last=False)
        return ticket

    async def _copy(self, request: Request) -> Response:
        ticket = self._tickets.pop(request.path_params["ticket"], None)
        if ticket is None or self._clock.now() > ticket.until or not ticket.counts():
            return said(404, "not here, or not any more")
        if self.sent >= SENT_AT_ONCE:
            return said(503, "too many downloads at once: try again")
        try:
            descriptor = os.open(ticket.path, PLAIN_READ | getattr(os, "O_NOFOLLOW", 0))
        except OSError:
            return said(404, "not here, or not any more")
        state = os.fstat(descriptor)
        if (state.st_dev, state.st_ino) != ticket.file:
            os.close(descriptor)
            return said(404, "not here, or not any more")
        return _Copy(self, descriptor, ticket)


class _Copy(Response):
    """A file on its way, counted."""

    media_type = "application/octet-stream"

    def __init__(self, counted: Recordings, descriptor: int, ticket: _Ticket) -> None:
        named = f"attachment; filename*=utf-8''{quote(ticket.path.name)}"
        super().__init__(None, 200, {**HEADERS, "Content-Disposition": named})
        self.headers["Content-Length"] = str(os.fstat(descriptor).st_size)
        self._counted, self._descriptor, self._ticket = counted, descriptor, ticket

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:  # noqa: ARG002 - as ASGI has it
        left = int(self.headers["Content-Length"])
        self._counted.sent += 1
        try:
            await send({"type": "http.response.start", "status": 200, "headers": self.raw_headers})
            with open(self._descriptor, "rb", buffering=0) as file:
                # It ends early where the token does, and so does the connection.
                more = True
                while more and self._ticket.counts():
                    data = await asyncio.to_thread(file.read, min(left, _CHUNK))
                    left -= len(data)
                    await send({"type": "http.response.body", "body": data, "more_body": left > 0})
                    more = bool(data) and left > 0
        finally:
            self._counted.sent -= 1


async def body(request: Request, most: int) -> bytes:
    """A request's body.

    Raises:
        InvalidValueError: If it's longer than so many bytes.
    """
    found = b""
    async for part in request.stream():
        found += part
        if len(found) > most:
            raise InvalidValueError("request", "more", f"up to {most} bytes")
    return found


def said(status: int, text: str) -> Response:
    """An answer that says why something isn't done."""
    return JSONResponse({"problem": text}, status, HEADERS)
