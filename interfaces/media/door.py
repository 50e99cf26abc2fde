"""Where pages meet the camera, the voice and the screen: a WebSocket a page, `/media`, and `/media/still`.

A page first shows its token, as at `/meshcat`; then it's told how everything is, as text in JSON, and may ask:

    {"do": "watch", "offer": SDP}                                    a viewer: picture and sound by RTP
    {"do": "choose", "view": "robot" | "overhead" | "both", "hears": …}   a viewer: which camera, and the microphone
    {"do": "leave"}                                                  a viewer: neither any more
    {"do": "aim", "session": …, "epoch": …, "pan": …, "tilt": …}     who has control: turn the camera [rad]
    {"do": "speak" | "show", "session": …, "epoch": …, "text": …}    who has control: say or show something
    {"do": "clear", "session": …, "epoch": …}                        who has control: show nothing any more

When the socket closes, so does the page's peer.
"""

from __future__ import annotations

import asyncio
import json
from typing import Any, Final

import msgspec
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from interfaces.media.camera import CameraError
from interfaces.media.live import LiveMedia, MediaChoice
from interfaces.media.messages import CameraView
from interfaces.messages.control import Role
from interfaces.stream.access import Access
from interfaces.stream.limits import Bucket
from interfaces.stream.meshcat.page import (
    PATIENCE,
    POLICY_VIOLATION,
    TRY_AGAIN_LATER,
    UNAUTHORISED,
    first_text,
    same_origin,
    token_in,
)
from interfaces.stream.server import HEADERS, admit, refusal
from interfaces.stream.sockets import let_stay
from vrs.checks import one_of
from vrs.errors import InvalidValueError, VrsError

MOST_PAGES: Final = 256
"""Pages that are told how everything is."""
RATE, BURST = 20.0, 60.0
"""Messages a second that a page may send, for long and at once."""
STILLS, STILLS_BURST = 20.0, 40.0
"""Single pictures a second for all, for long and at once."""
LARGEST: Final = 40_000
"""Characters of a message at most."""


class _MediaAsk(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a page asks for."""

    do: str
    offer: str = ""
    session: str = ""
    epoch: str = ""
    pan: float = 0.0
    tilt: float = 0.0
    text: str = ""
    view: str = CameraView.ROBOT
    hears: bool = False


class MediaDoor:
    """Answers pages. `media` does what they ask for."""

    def __init__(self, media: LiveMedia, access: Access) -> None:
        """Wait for pages.

        Args:
            media: Camera, voice and screen.
            access: Who may come in: viewers watch and listen.
        """
        self._media, self._access = media, access
        self._pages: set[_Page] = set()
        self._stills = Bucket(STILLS, STILLS_BURST, media.clock.now())
        media.changed = self.tell

    @property
    def routes(self) -> list[BaseRoute]:
        """`/media` and `/media/still`."""
        return [WebSocketRoute("/media", self._serve), Route("/media/still", self._still)]

    def tell(self) -> None:
        """Let all pages know how everything is now."""
        for page in self._pages:
            page.news.set()

    async def _serve(self, websocket: WebSocket) -> None:
        if not same_origin(websocket):
            await websocket.close()
            return
        try:
            await websocket.accept()
            said = await first_text(websocket)
            admission = admit(self._access, Role.VIEWER, websocket, token_in(said))
            if admission.refusal:
                await websocket.close(UNAUTHORISED, "a token that is valid here, please")
            elif len(self._pages) >= MOST_PAGES:
                await websocket.close(TRY_AGAIN_LATER, "too many pages")
            else:
                let_stay(websocket.scope, known=bool(said), counts=admission.counts, code=UNAUTHORISED)
                await self._attend(_Page(websocket, self._media))
        except WebSocketDisconnect:
            return

    async def _attend(self, page: _Page) -> None:
        self._pages.add(page)
        try:
            await page.run()
        finally:
            self._pages.discard(page)
            await self._media.leave(page)

    async def _still(self, request: Request) -> Response:
        """A picture by itself."""
        if refused := refusal(request, self._access, Role.VIEWER):
            return JSONResponse({"problem": refused}, 403, HEADERS)
        if not self._stills.take(self._media.clock.now()):
            return JSONResponse({"problem": "too many pictures: try again in a moment"}, 429, HEADERS)
        try:
            view = one_of("view", request.query_params.get("view", CameraView.ROBOT), CameraView)
            data = await self._media.cameras[CameraView(view)].still()
        except InvalidValueError as error:
            return JSONResponse({"problem": str(error)}, 400, HEADERS)
        except CameraError as error:
            return JSONResponse({"problem": str(error)}, 503, HEADERS)
        return Response(data, 200, {**HEADERS, "Cache-Control": "no-store"}, "image/jpeg")


class _Page:
    """One page: what it's told, and what it asks for."""

    def __init__(self, websocket: WebSocket, media: LiveMedia) -> None:
        self._websocket, self._media = websocket, media
        self.news = asyncio.Event()
        """Set when there's something new to tell."""
        self.news.set()
        self._choice = MediaChoice()
        self._replies: list[str] = []
        self._told = ""

    async def run(self) -> None:
        """Tell and listen until either ends."""
        tasks = asyncio.create_task(self._write()), asyncio.create_task(self._read())
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            ends = await asyncio.gather(*tasks, return_exceptions=True)
        for end in ends:
            if isinstance(end, Exception) and not isinstance(end, WebSocketDisconnect | TimeoutError):
                raise end

    async def _write(self) -> None:
        while True:
            await self.news.wait()
            self.news.clear()
            replies, self._replies = self._replies, []
            told = json.dumps(self._media.facts(), allow_nan=False, separators=(",", ":"))
            if told != self._told:
                self._told = told
                replies.append(told)
            for text in replies:
                await self._send(text)

    async def _send(self, text: str) -> None:
        try:
            async with asyncio.timeout(PATIENCE):
                await self._websocket.send_text(text)
        except TimeoutError:
            socket = self._websocket.scope.get("state", {}).get("socket")
            if socket is not None:
                socket.abort()
            raise

    def _reply(self, text: str) -> None:
        self._replies.append(text)
        self.news.set()

    async def _read(self) -> None:
        clock = self._media.clock
        allowed = Bucket(RATE, BURST, clock.now())
        while True:
            message = await self._websocket.receive()
            if message["type"] == "websocket.disconnect":
                return
            if not allowed.take(clock.now()):
                await self._websocket.close(POLICY_VIOLATION, "too many messages")
                return
            text = message.get("text") or ""
            if text == "beat":
                self._reply("beat")
            else:
                await self._take(text)

    async def _take(self, text: str) -> None:
        """Do what the page asks for, or say why not."""
        answer: dict[str, Any] = {}
        try:
            if len(text) > LARGEST:
                raise InvalidValueError("message", f"{len(text)} characters", f"up to {LARGEST}")
            answer = await self._do(msgspec.json.decode(text, type=_MediaAsk))
        except msgspec.MsgspecError:
            answer = {"kind": "problem", "text": "this isn't a message that is known here"}
        except VrsError as error:
            answer = {"kind": "problem", "text": str(error)}
        if answer:
            self._reply(json.dumps(answer))

    async def _do(self, ask: _MediaAsk) -> dict[str, Any]:
        media = self._media
        if ask.do == "watch":
            return {"kind": "answer", "sdp": await media.watch(self, ask.offer, self._choice)}
        if ask.do == "choose":
            self._choice = MediaChoice(CameraView(one_of("view", ask.view[:40], CameraView)), ask.hears)
            media.choose(self, self._choice)
            return {}
        if ask.do == "leave":
            await media.leave(self)
            return {}
        if ask.do not in {"aim", "speak", "show", "clear"}:
            raise InvalidValueError("do", ask.do[:40], "watch, choose, leave, aim, speak, show or clear")
        if not media.commands(ask.session, ask.epoch):
            return {"kind": "problem", "text": "only who has control moves the camera, speaks and shows"}
        if ask.do == "aim":
            media.aim(ask.pan, ask.tilt)
        elif ask.do == "speak":
            media.speak(ask.text)
        elif ask.do == "show":
            media.presenter.show(ask.text)
        else:
            media.presenter.clear()
        return {}
