"""The monitor where standard input isn't a terminal: lines come all at once, and are shown beside the answers."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import threading
from collections import deque
from typing import Final

from interfaces.timer import Turning
from interfaces.val2.monitor.monitor import TerminalMonitor
from interfaces.val2.monitor.teletype import Input, Output
from vrs.clock import Clock

_READ: Final = 65_536
"""Bytes that are read at a time."""
_MOST: Final = 1000
"""Lines that wait to be taken; with more of them nothing is read."""


class Pipe:
    """Lines from a file descriptor to a monitor; what it says to standard output."""

    def __init__(self, monitor: TerminalMonitor, clock: Clock, *, source: int = 0) -> None:
        """Begin; `run` reads.

        Args:
            monitor: To be patient.
            clock: Session time.
            source: File descriptor.
        """
        self._monitor, self._clock, self._source = monitor, clock, source
        self._input, self._output = Input(telnet=False), Output()
        self._lines: deque[str] = deque()
        self._room = threading.Event()
        self._room.set()
        self._ended = self._told = False
        self._done = asyncio.Event()
        self._turning = Turning(clock, self._turn)

    async def run(self) -> None:
        """Until the input has ended, and all that it began."""
        reading = threading.Thread(target=self._read, args=(asyncio.get_running_loop(),), daemon=True)
        reading.start()
        self._monitor.start(now=self._clock.now())
        self._turning.start()
        try:
            await self._done.wait()
        finally:
            self._turning.stop()

    def interrupt(self) -> None:
        """Ctrl-C: once for what is under way; when nothing is, for the end."""
        monitor = self._monitor
        if not monitor.busy:
            self._lines.clear()
            monitor.leave(now=self._clock.now())
        monitor.interrupt(now=self._clock.now())
        self._turning.soon()

    def _read(self, loop: asyncio.AbstractEventLoop) -> None:
        """Read in a thread of its own: standard input may be a file, for which a loop can't wait."""
        while True:
            self._room.wait()
            data = os.read(self._source, _READ)
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(self._came, data)
            if not data:
                return

    def _came(self, data: bytes) -> None:
        self._lines.extend(self._input.feed(data) if data else self._input.end())
        self._ended = not data
        if len(self._lines) > _MOST:
            self._room.clear()
        self._turning.soon()

    def _turn(self, now: float) -> float:
        monitor = self._monitor
        monitor.advance(now=now)
        self._give()
        while self._lines and monitor.takes(self._lines[0]) and not monitor.done:
            text = self._lines.popleft()
            if len(self._lines) <= _MOST:
                self._room.set()
            self._echo(text)
            monitor.line(text, now=now)
            self._give()
        if self._ended and not self._lines and not self._told:
            self._told = True
            monitor.end_of_input(now=now)
            self._give()
        if monitor.done:
            self._done.set()
        return monitor.next_deadline()

    def _echo(self, text: str) -> None:
        sys.stdout.write(f"{text}\n")
        self._output.took()

    def _give(self) -> None:
        sys.stdout.write(self._output.give(self._monitor.output(), self._monitor.prompt))
        sys.stdout.flush()
