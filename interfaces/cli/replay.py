"""`vrs replay`: play-back and rewind of a recording, in the browser or as lines."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from interfaces.cli.options import (
    Host,
    Port,
    ReachedAs,
    RecordedRobot,
    Tip,
    Tls,
    TlsCert,
    TlsKey,
    TokenFile,
    access_for,
    argument,
    asked_for,
    certificate_for,
    end_on_signal,
    option,
    recorded_robot,
    say_certificate,
    schemes,
    shown_host,
    tls_of,
)
from vrs.checks import one_of
from vrs.errors import InvalidValueError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interfaces.cli.options import Hosts
    from interfaces.recording.playback import Playback
    from interfaces.recording.recording import Recording
    from interfaces.stream.access import Access
    from interfaces.stream.certificates import Certificate

FEWEST, MOST = 0.1, 1000.0
"""Frames a second."""
RERUN = ("identical", "commands", "versions", "difference", "missing")
"""What is said of commands that were run again."""


def replay(
    run: Annotated[Path, argument("RUN.mcap", "A recording.")],
    other: Annotated[Path | None, argument("OTHER.mcap", "Another one, shown beside it.")] = None,
    at: Annotated[float | None, option("T", "Where to begin [s]; alone with --headless: that instant.")] = None,
    rate: Annotated[float | None, option("R", "−8 to 8, but not 0; negative rewinds. 1 by default.")] = None,
    loop: Annotated[str | None, option("A:B", "Loop from A to B [s].")] = None,
    align: Annotated[
        str,
        option("CLOCK", "Of two recordings: timeline, start (their beginnings) or began (the calendar)."),
    ] = "timeline",
    headless: Annotated[bool, option("--headless", "Frames as lines, at their time, instead of a page.")] = False,
    frames: Annotated[float, option("HZ", "Frames a second of your time, with --headless.")] = 30.0,
    as_json: Annotated[bool, option("--json", "With --headless or --commands: JSON lines.")] = False,
    commands: Annotated[
        bool, option("--commands", "Run the commands again on a fresh engine: is the timeline the same?")
    ] = False,
    name: RecordedRobot = None,
    tip: Tip = "",
    host: Host = "127.0.0.1",
    port: Port = 8610,
    token_file: TokenFile = None,
    reached_as: ReachedAs = None,
    tls: Tls = None,
    tls_cert: TlsCert = None,
    tls_key: TlsKey = None,
) -> int:
    """Play recordings back: either way, at any rate, in a loop, live where one is being written.

    Exit code 1 means that --commands found another timeline than the recorded one.
    """
    from interfaces.recording.playback import Align, Playback, checked_rate
    from interfaces.recording.recording import open_recording

    start = PlaybackStart(at, rate, None if loop is None else _range(loop))
    if rate is not None:
        checked_rate(rate)
    if not FEWEST <= frames <= MOST:
        raise InvalidValueError("frames", frames, f"{FEWEST:g} to {MOST:g} a second")
    aligned = Align(one_of("align", align, Align))
    if as_json and not (headless or commands):
        raise InvalidValueError("json", "--json", "with --headless or --commands")
    from interfaces.stream.access import OPEN

    robot = recorded_robot(name, tip)
    also = reached_as or ()
    access, allowed = access_for(host, token_file, free=OPEN), asked_for(host, also)
    with ExitStack() as stack:
        paths = [path for path in (run, other) if path is not None]
        recordings = [stack.enter_context(open_recording(path, robot)) for path in paths]
        for recording in recordings:
            _warn(recording)
        if commands:
            return _run_again(recordings, as_json)
        playback = Playback(recordings, align=aligned)
        if headless:
            _print(playback, start, frames, as_json)
        else:
            certificate = certificate_for(host, token_file, also, tls=tls, chain=tls_cert, key=tls_key)
            _serve(playback, start, access, allowed, host, port, certificate)
    return 0


def _range(text: str) -> tuple[float, float]:
    """The two times of `A:B` [s]."""
    start, colon, end = text.partition(":")
    try:
        times = float(start), float(end)
    except ValueError:
        raise InvalidValueError("loop", text, "A:B, two times in seconds") from None
    if not colon or not times[0] < times[1]:
        raise InvalidValueError("loop", text, "A:B, two times in seconds, the first one earlier")
    return times


def _warn(recording: Recording) -> None:
    """Say what is missing of a recording."""
    if recording.damage:
        unless = " (unless it's being written now)" if recording.damage.cut else ""
        typer.echo(f"vrs: {recording.path}: {recording.damage}{unless}", err=True)


class PlaybackStart(NamedTuple):
    """Where and how play-back begins, as far as it's said."""

    at: float | None = None
    """Where [s]; None for the start, or what `rate` and `span` ask for."""
    rate: float | None = None
    """How fast; None for 1."""
    span: tuple[float, float] | None = None
    """What is looped [s]."""

    @property
    def stands(self) -> bool:
        """Whether only the instant is given, at which it stands then."""
        return self.at is not None and self.rate is None and self.span is None


def begin(playback: Playback, start: PlaybackStart, *, now: float) -> None:
    """Go where standing play-back begins, and play there, at the user's time now [s]."""
    if start.at is not None:
        playback.seek(start.at, now=now)
    playback.play(now=now, rate=1.0 if start.rate is None else start.rate)
    if start.span is not None:
        playback.set_loop(*start.span, now=now)


def begin_shown(playback: Playback, start: PlaybackStart, *, now: float) -> None:
    """Begin when the first page looks: what is to stand is there already; what is being written is live."""
    if playback.growing and start == PlaybackStart():
        playback.seek(playback.span[1], now=now)
        playback.go_live(now=now)
    elif not start.stands:
        begin(playback, start, now=now)


def _print(playback: Playback, start: PlaybackStart, frames: float, as_json: bool) -> None:
    import asyncio

    from interfaces.recording.headless import PlaybackFrames, lines, play
    from vrs.clock import WallClock

    def say(line: str) -> None:
        sys.stdout.write(line + "\n")
        sys.stdout.flush()

    playback.read_marks()
    if start.at is not None and start.stands:
        playback.seek(start.at, now=0.0)
        found = PlaybackFrames(playback, rate=frames, begun=0.0).next(now=0.0)
        assert found is not None
        for line in lines(*found, as_json=as_json):
            say(line)
        return

    async def printed() -> None:
        clock, ended = WallClock(), asyncio.Event()
        end_on_signal(ended)
        now = clock.now()
        begin(playback, start, now=now)
        await play(PlaybackFrames(playback, rate=frames, begun=now), clock, say, ended, as_json=as_json)

    asyncio.run(printed())


def _serve(
    playback: Playback,
    start: PlaybackStart,
    access: Access,
    allowed: Hosts,
    host: str,
    port: int,
    certificate: Certificate | None,
) -> None:
    import asyncio

    from interfaces.link.proxy import Address
    from interfaces.messages.control import Role
    from interfaces.station.replay_page import ReplayPage
    from interfaces.stream import sockets
    from interfaces.stream.server import admit, application
    from vrs.clock import WallClock

    async def served() -> None:
        ended = asyncio.Event()
        end_on_signal(ended)
        listening = sockets.bind(host, port)
        clock = WallClock()

        def first(now: float) -> None:
            begin_shown(playback, start, now=now)

        if start.at is not None:
            playback.seek(start.at, now=clock.now())
        page = ReplayPage(playback, clock, authorize=partial(admit, access, Role.VIEWER), first=first)
        number = listening.getsockname()[1]
        app = application(page.routes, allowed(number))
        scheme, _, _ = schemes(certificate)
        async with sockets.serve(app, listening, tls=tls_of(certificate)), page.running():
            names = " and ".join(str(track.recording.path) for track in playback.tracks)
            typer.echo(f"vrs: playing {names} on {scheme}://{Address(shown_host(host), number)}/replay")
            say_certificate(certificate)
            sys.stdout.flush()
            await ended.wait()

    asyncio.run(served())


def _run_again(recordings: Sequence[Recording], as_json: bool) -> int:
    """Run the commands of recordings again; 1 if any gives another timeline, or none that could be compared."""
    import json

    from interfaces.recording.rerun import rerun

    same = True
    for recording in recordings:
        result = rerun(recording)
        same = same and result.identical and not result.is_void
        if as_json:
            facts = {name: getattr(result, name) for name in RERUN}
            typer.echo(json.dumps({"recording": str(recording.path), **facts}, allow_nan=False))
            continue
        what = f"{result.commands} commands and corrections, {result.versions} timelines compared"
        said = "identical" if result.identical else f"not identical: {result.difference}"
        said = "nothing could be compared" if result.is_void else said
        typer.echo(f"{recording.path}: {said} ({what})")
        if result.missing:
            typer.echo(f"vrs: {recording.path}: {result.missing}", err=True)
    return 0 if same else 1
