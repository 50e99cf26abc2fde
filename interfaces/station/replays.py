"""Recordings played back beside a running robot: opened in a thread, few at a time, freed when nobody looks."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from pathlib import Path
from typing import Final, TypeAlias

from starlette.requests import HTTPConnection, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute
from starlette.websockets import WebSocket

from interfaces.recording.playback import Align, Playback
from interfaces.recording.recording import Recording, open_recording
from interfaces.recording.stages import prepare
from interfaces.station.replay_page import BEGIN, MOST_HEARD, ReplayPage, page_files
from interfaces.station.shelf import LOOKED_INTO, Shelf
from interfaces.stream.access import Admission
from interfaces.stream.meshcat.newest import Newest
from interfaces.stream.meshcat.page import Authorize, Viewers
from interfaces.stream.server import HEADERS
from robots.robot import Robot
from vrs.checks import one_of
from vrs.clock import Clock
from vrs.errors import InvalidValueError, VrsError

MOST: Final = 4
"""Play-backs at once."""
IDLE: Final = 20.0
"""A play-back at which nobody looks is closed after so long [s]."""
SHOW: Final = 1.0 / 30.0
"""Time between two frames [s]: the robot comes first."""
LOOK: Final = 0.5
"""Time between two looks at who looks [s]."""
_GROWS: Final = 0.8
"""A file that is being written grows within so long [s]."""
WAITING: Final = 64
"""Play-backs that are asked for at once, opened or not."""


_Key: TypeAlias = tuple[tuple[str, ...], Align]
"""Names of the recordings, and how they lie in time."""


class _SharedReplay:
    """One play-back, or why there's none; pages that ask for the same share it, and its play head."""

    def __init__(self, key: _Key, allowed: Authorize, open_: Callable[[_SharedReplay], None]) -> None:
        self.key = key
        self.board = Newest(BEGIN)
        self.page: ReplayPage | None = None
        self.task: asyncio.Task[None] | None = None
        self._allowed, self._open = allowed, open_
        self.viewers = Viewers(self.board, self.let_in, hear=self._hear, most_heard=MOST_HEARD)
        self.say("opening", "Opening…")

    def let_in(self, connection: HTTPConnection, token: str | None) -> Admission:
        """Decide whether one may look; the first who may has it opened."""
        admission = self._allowed(connection, token)
        if not admission.refusal and self.task is None:
            self._open(self)
        return admission

    def _hear(self, text: str) -> str:
        return "" if self.page is None else self.page.hear(text)

    def say(self, kind: str, text: str) -> None:
        """Tell the pages why there's nothing to see."""
        self.board.put("standing", json.dumps({"kind": kind, "text": text}).encode())
        self.board.wake()


class Replays:
    """The page `/replay?a=NAME&b=NAME&align=…`, beside a running robot. Enter `running` in its loop."""

    def __init__(self, shelf: Shelf, clock: Clock, allowed: Authorize) -> None:
        """Wait for pages.

        Args:
            shelf: Where recordings are.
            clock: The user's.
            allowed: Whether a token lets one look, see `Viewers`.
        """
        self._shelf, self._clock, self._allowed = shelf, clock, allowed
        self.replays: dict[_Key, _SharedReplay] = {}
        self._running = False

    @property
    def routes(self) -> list[BaseRoute]:
        """What it answers."""
        return [
            *page_files(),
            WebSocketRoute("/replay/board", self._serve_board),
            WebSocketRoute("/replay/scene/{index:int}", self._serve_scene),
            Route("/replay/curves/{index:int}", self._answer_curves),
        ]

    @property
    def open(self) -> int:
        """Play-backs that are open, or being opened."""
        return sum(replay.task is not None for replay in self.replays.values())

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[Replays]:
        """Play for those who look."""
        self._running = True
        try:
            yield self
        finally:
            self._running = False
            tasks = [replay.task for replay in self.replays.values() if replay.task is not None]
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _serve_board(self, websocket: WebSocket) -> None:
        try:
            replay = self.replay_for(websocket.query_params)
        except InvalidValueError as error:
            board = Newest(BEGIN)
            board.put("standing", json.dumps({"kind": "failed", "text": str(error)}).encode())
            await Viewers(board, self._allowed).serve(websocket)
            return
        try:
            await replay.viewers.serve(websocket)
        finally:
            if replay.task is None and not replay.board.readers:
                self._forget(replay)

    def let_go(self, name: str) -> bool:
        """Close the play-backs of a recording, unless somebody looks at one; whether it's done."""
        having = [replay for replay in self.replays.values() if name in replay.key[0]]
        if any(replay.board.readers for replay in having):
            return False
        for replay in having:
            self._close(replay)
        return True

    def _close(self, replay: _SharedReplay) -> None:
        if replay.task is not None:
            replay.task.cancel()
        self._forget(replay)

    def _page_of(self, query: Mapping[str, str]) -> ReplayPage | None:
        """What is open of what a page asks for."""
        with contextlib.suppress(InvalidValueError):
            replay = self.replays.get(_key(query))
            return None if replay is None else replay.page
        return None

    async def _serve_scene(self, websocket: WebSocket) -> None:
        index, page = websocket.path_params["index"], self._page_of(websocket.query_params)
        if page is not None and index < len(page.viewers):
            await page.viewers[index].serve(websocket)
        else:
            await websocket.close()

    async def _answer_curves(self, request: Request) -> Response:
        page = self._page_of(request.query_params)
        if page is None:
            return JSONResponse({"problem": "this play-back isn't open"}, 404, HEADERS)
        return await page.answer_curves(request)

    def replay_for(self, query: Mapping[str, str]) -> _SharedReplay:
        """The play-back that a page's address asks for, made if nobody has asked for it.

        Raises:
            InvalidValueError: If a recording isn't there, or too many are asked for.
        """
        key = _key(query)
        for name in key[0]:
            self._shelf.path(name)
        replay = self.replays.get(key)
        if replay is None:
            if len(self.replays) >= WAITING:
                raise InvalidValueError("replays", len(self.replays) + 1, f"at most {WAITING}")
            replay = self.replays[key] = _SharedReplay(key, self._allowed, self._start)
        return replay

    def _forget(self, replay: _SharedReplay) -> None:
        if self.replays.get(replay.key) is replay:
            del self.replays[replay.key]

    def _start(self, replay: _SharedReplay) -> None:
        if self.open >= MOST:
            idle = [one for one in self.replays.values() if one.task is not None and not one.board.readers]
            if not idle:
                replay.say("failed", f"{MOST} play-backs are open already: close one, then load this page anew")
                return
            self._close(idle[0])
        if self._running:
            replay.task = asyncio.create_task(self._play(replay))

    async def _play(self, replay: _SharedReplay) -> None:
        """Open it, play it while somebody looks, close it."""
        try:
            names, align = replay.key
            async with _opened([self._shelf.path(name) for name in names], align, self._shelf.robot) as playback:
                await self._show(replay, playback)
        except VrsError as error:
            replay.say("failed", str(error))
        finally:
            replay.page = None
            self._forget(replay)

    async def _show(self, replay: _SharedReplay, playback: Playback) -> None:
        def first(now: float) -> None:
            if playback.growing:
                playback.seek(playback.span[1], now=now)
                playback.go_live(now=now)
            else:
                playback.play(now=now)

        if any(track.recording.end is None for track in playback.tracks):
            # One that is being written has grown by then.
            await asyncio.sleep(_GROWS)
            playback.advance(now=self._clock.now())
        page = ReplayPage(
            playback, self._clock, authorize=self._allowed, first=first, board=replay.board, show=SHOW
        )
        async with page.running():
            replay.page = page
            replay.say("open", "")
            left = 0.0
            while left < IDLE:
                await asyncio.sleep(LOOK)
                left = 0.0 if replay.board.readers else left + LOOK


def _key(query: Mapping[str, str]) -> _Key:
    """What a page asks for.

    Raises:
        InvalidValueError: If that's nothing.
    """
    names = tuple(query[letter] for letter in "ab" if letter in query)
    if not names:
        raise InvalidValueError("recordings", "none", "one or two of those that are listed")
    return names, Align(one_of("align", query.get("align", Align.START), Align))


@contextlib.asynccontextmanager
async def _opened(paths: Sequence[Path], align: Align, robot: Robot | None) -> AsyncIterator[Playback]:
    """A play-back of files that are read as far as it takes long; they're closed in the end."""
    found: list[Recording] = []
    opening = asyncio.create_task(asyncio.to_thread(_open, paths, align, found, robot))
    try:
        yield await asyncio.shield(opening)
    finally:
        if not opening.done():
            await asyncio.wait([opening])
        for recording in found:
            recording.close()


def _open(paths: Sequence[Path], align: Align, found: list[Recording], robot: Robot | None) -> Playback:
    """Open files; runs in a thread.

    Raises:
        InvalidValueError: If they are too large.
        FormatError: If one is no recording.
    """
    size = sum(path.stat().st_size for path in paths)
    if size > LOOKED_INTO:
        allowed = f"up to {LOOKED_INTO / 2**20:.0f} MiB together: vrs replay opens larger ones"
        raise InvalidValueError("recordings", f"{size / 2**20:.0f} MiB", allowed)
    found.extend(open_recording(path, robot) for path in paths)
    for recording in found:
        # What is read or put together once is read here.
        prepare(recording)
    playback = Playback(found, align=align)
    playback.read_marks()
    return playback
