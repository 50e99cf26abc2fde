"""A line of bytes to a terminal without a screen: telnet, `nc`, a host's driver, a pipe."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import threading
from collections import deque
from collections.abc import Iterable
from typing import Final

from interfaces.timer import Turning
from interfaces.val2.monitor.monitor import LONGEST, OVERLONG, TerminalMonitor
from interfaces.val2.monitor.state import OutputText
from vrs.clock import Clock

RUNNING: Final = "*"
"""The prompt while a program runs."""
INTERRUPT: Final = "\x03"
"""What `Input` gives for Ctrl-C and telnet's interrupts."""
_IAC, _SB, _SE, _WILL, _DONT = 255, 250, 240, 251, 254
_INTERRUPTS = frozenset({243, 244})
"""Telnet's break and interrupt process."""
_BACKSPACES = frozenset({8, 127})


class Input:
    """Bytes in, lines out: CR, LF, CR LF and CR NUL end one; telnet's negotiation is passed over."""

    def __init__(self, *, telnet: bool = True) -> None:
        """Begin.

        Args:
            telnet: Whether a byte 255 begins a telnet command, and editing keys count.
        """
        self._telnet = telnet
        self._line = bytearray()
        self._after_return = self._overlong = False
        self._command = 0
        """Telnet: 0 for none, 1 after IAC, 2 before an option, 3 in a subnegotiation, 4 after IAC in one."""

    def feed(self, data: bytes) -> list[str]:
        """Take bytes; the lines that have ended, and `INTERRUPT` and `OVERLONG` where they were.

        A line that is too long is dropped as far as its end.
        """
        lines: list[str] = []
        for byte in data:
            if self._command:
                self._negotiate(byte, lines)
            elif byte == _IAC and self._telnet:
                self._command = 1
            else:
                self._take(byte, lines)
        return lines

    @property
    def begun(self) -> str:
        """The line that hasn't ended yet, as far as it has come."""
        return self._line.decode("utf-8", errors="replace")

    def end(self) -> list[str]:
        """No more bytes come: the line without an end."""
        return [self._taken()] if self._line or self._overlong else []

    def _take(self, byte: int, lines: list[str]) -> None:
        after, self._after_return = self._after_return, byte == 13
        if byte == 10 and after:
            return
        if byte in {10, 13}:
            lines.append(self._taken())
        elif byte == 3 and self._telnet:
            self._line.clear()
            self._overlong = False
            lines.append(INTERRUPT)
        elif byte in _BACKSPACES and self._telnet:
            del self._line[-1:]
        elif len(self._line) >= 4 * LONGEST:
            self._overlong = True
        elif byte:
            self._line.append(byte)

    def _taken(self) -> str:
        text = OVERLONG if self._overlong else self._line.decode("utf-8", errors="replace")
        self._line.clear()
        self._overlong = False
        return text

    def _negotiate(self, byte: int, lines: list[str]) -> None:
        if self._command == 1:
            if byte in _INTERRUPTS:
                self._line.clear()
                lines.append(INTERRUPT)
            self._command = 3 if byte == _SB else 2 if _WILL <= byte <= _DONT else 0
        elif self._command == 2:
            self._command = 0
        elif self._command == 3:
            self._command = 4 if byte == _IAC else 3
        else:
            self._command = 0 if byte == _SE else 3


class Output:
    """What is said and the prompt, as one run of characters."""

    def __init__(self, newline: str = "\n") -> None:
        """Begin at the start of a line.

        Args:
            newline: What ends lines.
        """
        self._newline = newline
        self._prompt: str | None = None
        """The prompt that stands at the end of what was given; None where none does."""
        self._within = False
        """Whether what was given ends within a line."""
        self._starred = False
        """Whether `*` was shown since a line was taken: it isn't repeated behind what a program types."""

    def took(self) -> None:
        """A line was taken: whoever typed it ended it."""
        self._prompt, self._within, self._starred = None, False, False

    def give(self, said: Iterable[OutputText], prompt: str) -> str:
        """What to send.

        Args:
            said: What was said since.
            prompt: What is asked now; empty for nothing.
        """
        text = "".join(piece.text for piece in said)
        out = ""
        if self._prompt is not None and (text or prompt != self._prompt):
            out = "\n"
            self._prompt, self._within = None, False
        if text:
            out += text
            self._within = not text.endswith("\n")
        if prompt and self._prompt is None and not (prompt == RUNNING and self._starred):
            out += "\n" if self._within and len(prompt) == 1 else ""
            out += prompt
            self._prompt, self._within, self._starred = prompt, True, prompt == RUNNING
        return out.replace("\n", self._newline) if self._newline != "\n" else out


_READ: Final = 65_536
"""Bytes that are read at a time."""
_MOST: Final = 1000
"""Lines that wait to be taken; with more of them nothing is read."""


class Pipe:
    """Lines from a file descriptor to a monitor; what it says to standard output."""

    def __init__(self, monitor: TerminalMonitor, clock: Clock, *, source: int = 0) -> None:
        """Begin; `run` reads.

        Args:
            monitor: Queues commands.
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
