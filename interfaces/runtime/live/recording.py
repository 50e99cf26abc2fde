"""What is recorded of an operator's site while it serves: from its beginning, or from when somebody asks for it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from typing import Any

from typing_extensions import override

from interfaces.recording.live import TURN, LiveRecorder, LiveRecording
from interfaces.recording.mcap_file import RecordingError
from interfaces.runtime.live.devices import OperatorDevice
from interfaces.teleop.connection import SiteLine
from robots.things import Scene
from vrs.clock import Clock, seconds_since_1970
from vrs.errors import InvalidValueError


class SiteRecording(OperatorDevice):
    """Records a site into one file after the other; the loop doesn't wait for the disk."""

    name = "recording"

    def __init__(
        self,
        first: LiveRecording | None,
        line: SiteLine[Any, Any, Any],
        clock: Clock,
        connected: Callable[[], bool],
        around: Callable[[], Scene | None],
        *,
        seed: int,
    ) -> None:
        """Record from the beginning of the session, or nothing yet.

        Args:
            first: What is recorded from now on; None for nothing.
            line: From the operator's site to the robot.
            clock: Session time.
            connected: Whether the robot is heard of.
            around: What is around an arm; None where nothing is known that it could grasp.
            seed: Of the emulated link.

        Raises:
            RecordingError: If the file can't be made.
        """
        self._line, self._clock, self._seed = line, clock, seed
        self._connected, self._around = connected, around
        self.recorder: LiveRecorder | None = None
        """Of what is recorded now; None while nothing is."""
        self._task: asyncio.Task[None] | None = None
        self._changes, self._closed = asyncio.Lock(), False
        if first is not None:
            self.recorder = self._made(first, began=seconds_since_1970() - clock.now(), now=0.0)
            self.recorder.open()

    def _made(self, what: LiveRecording, *, began: float, now: float) -> LiveRecorder:
        return LiveRecorder(what, self._line, seed=self._seed, began=began, now=now)

    @override
    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[SiteRecording]:
        if self.recorder is not None:
            self._go_on(self.recorder)
        try:
            yield self
        finally:
            self._closed = True
            await self.end()

    async def begin(self, what: LiveRecording) -> None:
        """Record from now on.

        Raises:
            RecordingError: If the file can't be made.
            InvalidValueError: If something is being recorded already, or it's all over.
        """
        async with self._changes:
            if self.recorder is not None or self._closed:
                raise InvalidValueError("recording", what.path.name, "begun once the other one has ended")
            recorder = self._made(what, began=seconds_since_1970(), now=self._clock.now())
            try:
                await asyncio.to_thread(recorder.open)
            except RecordingError:
                recorder.leave()
                raise
            self.recorder = recorder
            self._go_on(recorder)

    async def end(self) -> str | None:
        """Close what is being recorded; what was wrong with it, None if nothing was."""
        async with self._changes:
            recorder, task = self.recorder, self._task
            if recorder is None or task is None:
                return None
            task.cancel()
            await asyncio.wait([task])
            recorder.end(now=self._clock.now())
            await asyncio.to_thread(recorder.close)
            self.recorder = self._task = None
            return recorder.problem

    def _go_on(self, recorder: LiveRecorder) -> None:
        def stopped(task: asyncio.Task[None]) -> None:
            """Nothing is recorded any more: say why, unless it's all over."""
            if not task.cancelled() and (error := task.exception()) is not None:
                recorder.stop(str(error) or type(error).__name__)

        self._task = asyncio.create_task(self._record(recorder))
        self._task.add_done_callback(stopped)

    async def _record(self, recorder: LiveRecorder) -> None:
        """Let what has happened be recorded."""
        while True:
            await asyncio.sleep(TURN)
            recorder.furnish(self._around())
            recorder.advance(now=self._clock.now(), connected=self._connected())

    def rerouted(self, now: float, text: str) -> None:
        """Write down that the emulated way to the robot has changed at session time now [s], and how."""
        if self.recorder is not None:
            self.recorder.tell(now, "rerouted", text)

    @override
    def health(self) -> dict[str, Any] | None:
        return None if self.recorder is None else self.recorder.health()
