"""Play-back without a screen: frames as lines, at their time."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final, TypeAlias

import msgspec

from interfaces.clients.playhead import Mode
from interfaces.recording.marks import Mark
from interfaces.recording.playback import Playback, PlaybackFrame, PlaybackMoment
from vrs.clock import Clock
from vrs.model import Array

AWAITED: Final = 1.5
"""How long it's waited for a file to grow that wasn't closed [s]."""
NOTHING: Final = 1e-9
"""Places nearer than this [s] are one."""

Passed: TypeAlias = tuple[Sequence[Mark], ...]
"""The marks that each recording passed since the frame before."""


class PlaybackFrames:
    """The frames of a play-back on an even grid of the user's time, each with the marks that were passed."""

    def __init__(self, playback: Playback, *, rate: float, begun: float) -> None:
        """Begin where the play head is.

        Args:
            playback: Already playing, or standing for one frame.
            rate: Frames a second of the user's time.
            begun: The user's time of the first [s].
        """
        self._playback, self._rate, self._begun = playback, rate, begun
        self._beat = 0
        self._before: float | None = None
        self._waiting: float | None = None

    @property
    def due(self) -> float:
        """The user's time of the next frame [s]."""
        return self._begun + self._beat / self._rate

    def next(self, *, now: float) -> tuple[float, PlaybackMoment, Passed] | None:
        """The newest frame that is due: it shows the place when it was due, however late it's asked for.

        Args:
            now: The user's time [s], `due` or later.

        Returns:
            Since when it plays [s], the frame, and what was passed; None where there's no new one.
        """
        self._beat = max(self._beat, math.floor((now - self._begun) * self._rate + 1e-6))
        due = self.due
        self._beat += 1
        moment = self._playback.advance(now=due)
        before, self._before = self._before, moment.t
        if before is not None and abs(moment.t - before) < NOTHING:
            return None
        return due - self._begun, moment, self._passed(before, moment.t)

    def over(self, *, now: float) -> bool:
        """Whether there's nothing to come: it stands, and no file grows; where one does, it plays on.

        Args:
            now: The user's time [s].
        """
        playback = self._playback
        if playback.mode is not Mode.PAUSED or playback.growing:
            if playback.mode is Mode.PAUSED:
                playback.play(now=now)
            self._waiting = None
            return False
        unclosed = any(track.recording.end is None for track in playback.tracks)
        if not unclosed or playback.head.rate < 0:
            return True
        self._waiting = now if self._waiting is None else self._waiting
        return now >= self._waiting + AWAITED

    def _passed(self, before: float | None, t: float) -> Passed:
        playback, found = self._playback, []
        loop, rate = playback.head.loop, playback.head.rate
        for track in playback.tracks:
            own = t - track.shift
            passed = track.marks.passed
            if before is None:
                marks = passed(math.nextafter(own, -math.inf), own)
            elif loop is not None and (t - before) * rate < 0:
                low, high = loop[0] - track.shift, loop[1] - track.shift
                far, near = (high, low) if rate > 0 else (low, high)
                marks = (*passed(before - track.shift, far), *passed(near, own))
            else:
                marks = passed(before - track.shift, own)
            found.append(marks)
        return tuple(found)


async def play(
    frames: PlaybackFrames, clock: Clock, say: Callable[[str], None], ended: asyncio.Event, *, as_json: bool
) -> None:
    """Print frames as time goes by, until there's nothing to come or somebody ends it.

    Args:
        frames: Of what is playing already.
        clock: The user's.
        say: Takes a line.
        ended: Ends it.
        as_json: Lines of JSON, instead of text.
    """
    while not ended.is_set():
        now = clock.now()
        if now < frames.due:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(frames.due - now):
                    await ended.wait()
            continue
        found = frames.next(now=now)
        if found is not None:
            for line in lines(*found, as_json=as_json):
                say(line)
        if frames.over(now=now):
            return


def lines(at: float, moment: PlaybackMoment, passed: Passed, *, as_json: bool) -> Iterator[str]:
    """A frame as lines: one of JSON, or one for people and one for each mark.

    Args:
        at: Since when it plays [s].
        moment: What is shown.
        passed: What was passed.
        as_json: Whether it's for programs.
    """
    if as_json:
        first, *others = (_facts(frame, marks) for frame, marks in zip(moment.frames, passed, strict=True))
        whole = {"at": at, **first} | ({"other": others[0]} if others else {})
        yield json.dumps(whole, allow_nan=False, separators=(",", ":"))
        return
    for number, (frame, marks) in enumerate(zip(moment.frames, passed, strict=True)):
        name = f"{'AB'[number]} " if len(moment.frames) > 1 else ""
        for mark in marks:
            yield f"{name}{mark.t:9.3f} s  * {mark.kind}: {mark.text}"
        line = f"{name}{frame.t:9.3f} s"
        if frame.q_virtual is not None:
            line += f"  virtual {_joints(frame.q_virtual)}"
        if frame.q_real is not None:
            line += f"  real {_joints(frame.q_real)}"
        if frame.behind is not None and frame.error is not None:
            line += f"  behind {frame.behind:.3f} s, off {frame.error:.4f} {frame.unit}"
        yield line


def _facts(frame: PlaybackFrame, marks: Sequence[Mark]) -> dict[str, Any]:
    return {
        "t": frame.t,
        "q_virtual": None if frame.q_virtual is None else frame.q_virtual.tolist(),
        "q_real": None if frame.q_real is None else frame.q_real.tolist(),
        "play": frame.play,
        "behind": frame.behind,
        "error": frame.error,
        "marks": msgspec.to_builtins(marks),
    }


def _joints(q: Array) -> str:
    return " ".join(f"{x:z8.4f}" for x in q.tolist())
