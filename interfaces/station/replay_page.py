"""The page `/replay`: a thin shell round a `Playback`, whose one play head all open pages show and move."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
from collections.abc import AsyncIterator, Callable, Sequence
from dataclasses import replace
from typing import Any, Final, Literal

import msgspec
from starlette.requests import Request
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.routing import BaseRoute, Route, WebSocketRoute

from interfaces.clients.playhead import Mode
from interfaces.recording.marks import Mark, MarkKind, clock_text
from interfaces.recording.playback import Playback, PlaybackMoment, PlaybackTrack
from interfaces.recording.recording import shows
from interfaces.recording.stages import Stage
from interfaces.station.curves import curves
from interfaces.station.page import station_files
from interfaces.stream.access import bearer
from interfaces.stream.meshcat.newest import Newest
from interfaces.stream.meshcat.page import HEADERS, Authorize, Viewers, files
from vrs.clock import Clock
from vrs.errors import VrsError

SHOW: Final = 1.0 / 60.0
"""Time between two frames [s]."""
IDLE: Final = 0.1
"""Time between two looks at the files while nobody watches [s]."""
TOLD: Final = 1.0 / 30.0
"""Time between two read-outs [s]."""
MARKED: Final = 0.5
"""Time between two looks at marks that are new [s]."""
MOST_HEARD: Final = 900
"""Messages that a page may send in 10 s."""
CELLS: Final = 480
"""Places on the seek bar: marks of one kind at one place are shown as one."""
TEXTS: Final = 3
"""Lines of what is shown as one."""


BEGIN: Final = b'{"kind":"begin"}'
"""What every page is told first."""


def page_files() -> list[BaseRoute]:
    """The routes of the page, of its style, and of what its 3D view needs; its scripts are the station's."""
    return files("replay", "interfaces.station")


class _Wish(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a page asks for; what it doesn't say is no number, and refused where it's needed."""

    do: Literal["play", "pause", "toggle", "rate", "step", "seek", "skip", "loop", "unloop", "live", "mark"]
    rate: float | None = None
    by: float = math.nan
    t: float = math.nan
    start: float = math.nan
    end: float = math.nan
    back: bool = False


_decoder = msgspec.json.Decoder(_Wish)


class ReplayPage:
    """Serves a play-back to browsers. All pages share the head: who watches together sees the same moment."""

    def __init__(
        self,
        playback: Playback,
        clock: Clock,
        *,
        authorize: Authorize | None = None,
        first: Callable[[float], None] | None = None,
        board: Newest | None = None,
        show: float = SHOW,
    ) -> None:
        """Make the scenes.

        Args:
            playback: What is played.
            clock: The user's.
            authorize: See `Viewers`.
            first: Called with the user's time [s] when the first page is there.
            board: What pages look at already; one of its own unless given.
            show: Time between two frames [s].
        """
        self.playback, self.clock, self._first, self._show = playback, clock, first, show
        self._stages = tuple(Stage(track.recording) for track in playback.tracks)
        self.scenes = tuple(stage.scene for stage in self._stages)
        self.board = Newest(BEGIN) if board is None else board
        """What pages are told: JSON by key."""
        self._told = float("-inf")
        self._marked = float("-inf")
        self._versions: list[tuple[int, tuple[float, float]] | None] = [None] * len(playback.tracks)
        self._put("recordings", {"kind": "recordings", "items": _recordings(playback)})
        self._authorize = authorize
        self._curves: dict[int, tuple[float, asyncio.Task[bytes]]] = {}
        """Of each recording: up to when [s], and what is plotted of it."""
        self._computing = asyncio.Lock()
        self.viewers = tuple(Viewers(scene, authorize) for scene in self.scenes)
        """Of each scene."""
        board_viewers = Viewers(self.board, authorize, hear=self.hear, most_heard=MOST_HEARD)
        self.routes: list[BaseRoute] = [
            Route("/", _to_page),
            *page_files(),
            station_files(),
            Route("/replay/curves/{index:int}", self.answer_curves),
            WebSocketRoute("/replay/board", board_viewers.serve),
            *(
                WebSocketRoute(f"/replay/scene/{index}", viewers.serve)
                for index, viewers in enumerate(self.viewers)
            ),
        ]
        """What it answers."""

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[ReplayPage]:
        """Play for those who look."""
        task = asyncio.create_task(self._run())
        try:
            yield self
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    async def answer_curves(self, request: Request) -> Response:
        """What is plotted of a recording, as JSON."""
        index = request.path_params["index"]
        token = bearer(request.headers.get("authorization", ""))
        if self._authorize is not None and self._authorize(request, token).refusal:
            return JSONResponse({"problem": "a token that is valid here, please"}, 403, HEADERS)
        if index >= len(self.playback.tracks):
            return JSONResponse({"problem": "there's no such recording here"}, 404, HEADERS)
        end = self.playback.tracks[index].span[1]
        known = self._curves.get(index)
        if known is None or known[0] != end:
            known = self._curves[index] = end, asyncio.create_task(self._plotted(index))
        try:
            return Response(await asyncio.shield(known[1]), 200, HEADERS, "application/json")
        except VrsError as error:
            return JSONResponse({"problem": str(error)}, 409, HEADERS)

    async def _plotted(self, index: int) -> bytes:
        track = self.playback.tracks[index]
        async with self._computing:
            return await asyncio.to_thread(curves, track.recording.path, track.recording.robot, track.shift)

    async def _run(self) -> None:
        while True:
            self.turn(now=self.clock.now())
            await asyncio.sleep(self._show if self.board.readers else IDLE)

    def turn(self, *, now: float) -> None:
        """Show what is to be shown now [s]."""
        if self._first is not None and self.board.readers:
            first, self._first = self._first, None
            first(now)
        moment = self.playback.advance(now=now)
        if not self.board.readers:
            return
        for stage, track, frame in zip(self._stages, self.playback.tracks, moment.frames, strict=True):
            # Where nobody knows where it was, it stays where it was last seen; the page says so.
            if frame.q_virtual is not None:
                stage.show(frame, track.committed(frame), now=now)
        if now >= self._told + TOLD:
            self._told = now
            self._tell(moment, now)

    def _tell(self, moment: PlaybackMoment, now: float) -> None:
        before = self.board.version
        if now >= self._marked + MARKED:
            self._marked = now
            self._tell_marks()
        self._put("state", _state(self.playback, moment))
        if self.board.version != before:
            self.board.wake()

    def _tell_marks(self) -> None:
        self._put("recordings", {"kind": "recordings", "items": _recordings(self.playback)})
        for index, track in enumerate(self.playback.tracks):
            key = track.marks.version, self.playback.span
            if self._versions[index] != key:
                self._versions[index] = key
                self._put(f"marks {index}", {"kind": "marks", "index": index, "marks": grouped(track, *key[1])})

    def _put(self, key: str, value: dict[str, Any]) -> None:
        self.board.put(key, json.dumps(value, allow_nan=False, separators=(",", ":")).encode())

    def hear(self, text: str) -> str:
        """Do what a page asks for; why it isn't done, empty if it is."""
        try:
            self._do(_decoder.decode(text), self.clock.now())
        except msgspec.MsgspecError:
            return json.dumps({"kind": "refused", "text": "this isn't a wish that is known here"})
        except VrsError as error:
            return json.dumps({"kind": "refused", "text": str(error)})
        return ""

    def _do(self, wish: _Wish, now: float) -> None:
        playback = self.playback
        match wish.do:
            case "play":
                playback.play(now=now, rate=wish.rate)
            case "pause":
                playback.pause(now=now)
            case "toggle":
                (playback.play if playback.mode is Mode.PAUSED else playback.pause)(now=now)
            case "rate":
                playback.set_rate(math.nan if wish.rate is None else wish.rate, now=now)
                if playback.mode is not Mode.PAUSED:
                    playback.play(now=now)
            case "step":
                playback.step(wish.by, now=now)
            case "seek":
                playback.seek(wish.t, now=now)
            case "skip":
                playback.seek(playback.place(now=now) + wish.by, now=now)
            case "loop":
                playback.set_loop(wish.start, wish.end, now=now)
            case "unloop":
                playback.clear_loop(now=now)
            case "live":
                playback.go_live(now=now)
            case "mark":
                playback.seek_mark(back=wish.back, now=now)
        self._told = float("-inf")


def grouped(track: PlaybackTrack, start: float, end: float) -> list[dict[str, Any]]:
    """The marks of a recording for a seek bar: those of one kind that are too near are one.

    Args:
        track: The recording.
        start: Left end of the bar [s].
        end: Its right end [s].
    """
    cell = max(end - start, 1e-9) / CELLS
    groups: dict[tuple[MarkKind, int], list[Mark]] = {}
    for mark in track.marks.marks:
        groups.setdefault((mark.kind, int((mark.t + track.shift - start) / cell)), []).append(mark)
    return [_group(marks, track.shift) for marks in groups.values()]


def _group(marks: Sequence[Mark], shift: float) -> dict[str, Any]:
    first = marks[0]
    texts = [f"{clock_text(mark.t)}  {mark.text}" for mark in marks[:TEXTS]]
    if len(marks) > TEXTS:
        texts.append(f"and {len(marks) - TEXTS} more until {clock_text(marks[-1].t)}")
    facts: dict[str, Any] = {"t": first.t + shift, "kind": str(first.kind), "texts": texts}
    if first.span is not None:
        facts["span"] = [first.span[0] + shift, max(mark.span[1] for mark in marks if mark.span) + shift]
    return facts


def _recordings(playback: Playback) -> list[dict[str, Any]]:
    """What there is; files of one name are told apart by their directories."""
    tracks = playback.tracks
    names = [track.recording.path.name for track in tracks]
    if len(set(names)) < len(names):
        names = ["/".join(track.recording.path.absolute().parts[-2:]) for track in tracks]
    return [_recording(track, name, playback.growing) for track, name in zip(tracks, names, strict=True)]


def _recording(track: PlaybackTrack, name: str, growing: bool) -> dict[str, Any]:
    recording = track.recording
    session = recording.session
    # A file that is being written isn't cut.
    damage = replace(recording.damage, cut=recording.damage.cut and not growing)
    return {
        "name": name,
        "title": session.title,
        "robot": session.robot,
        "kind": recording.kind.word,
        "unit": recording.unit,
        "shows": shows(session),
        "driver": session.driver,
        "delay": session.delay,
        "damage": "; ".join(filter(None, (str(damage) if damage else "", track.problem))),
        "shift": track.shift,
    }


def _state(playback: Playback, moment: PlaybackMoment) -> dict[str, Any]:
    head = playback.head
    panes = []
    for track, frame in zip(playback.tracks, moment.frames, strict=True):
        latest = track.marks.latest(frame.t)
        panes.append(
            {
                "t": round(frame.t, 6),
                "virtual": frame.q_virtual is not None,
                "real": frame.q_real is not None,
                "error": None if frame.error is None else round(frame.error, 7),
                "behind": None if frame.behind is None else round(frame.behind, 4),
                "mark": None if latest is None else {"t": latest.t, "kind": latest.kind, "text": latest.text},
            }
        )
    return {
        "kind": "state",
        "t": round(moment.t, 6),
        "mode": str(head.mode),
        "rate": head.rate,
        "span": list(playback.span),
        "loop": None if head.loop is None else list(head.loop),
        "growing": playback.growing,
        "panes": panes,
    }


async def _to_page(_request: Request) -> Response:
    return RedirectResponse("/replay", headers=HEADERS)
