"""A line of bytes to a terminal without a screen: telnet, `nc`, a host's driver, a pipe."""

from __future__ import annotations

import asyncio
import contextlib
import math
import os
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable
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
                if self._command == 1 and byte in _INTERRUPTS:
                    self._line.clear()
                    lines.append(INTERRUPT)
                begun = 3 if byte == _SB else 2 if _WILL <= byte <= _DONT else 0
                self._command = (begun, 0, 4 if byte == _IAC else 3, 0 if byte == _SE else 3)[self._command - 1]
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
        if byte in {10, 13}:
            lines += [] if byte == 10 and after else [self._taken()]
        elif byte == 3 and self._telnet:
            self._taken()
            lines.append(INTERRUPT)
        elif byte in _BACKSPACES and self._telnet:
            del self._line[-1:]
        elif len(self._line) >= 4 * LONGEST:
            self._overlong = True
        elif byte:
            self._line.append(byte)

    def _taken(self) -> str:
        text = OVERLONG if self._overlong else self.begun
        self._line.clear()
        self._overlong = False
        return text


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
        out = text = "".join(piece.text for piece in said)
        if self._prompt is not None and (text or prompt != self._prompt):
            out = f"\n{text}"
            self._prompt, self._within = None, False
        if text:
            self._within = not text.endswith("\n")
        if prompt and self._prompt is None and not (prompt == RUNNING and self._starred):
            out += "\n" if self._within and len(prompt) == 1 else ""
            out += prompt
            self._prompt, self._within, self._starred = prompt, True, prompt == RUNNING
        return out.replace("\n", self._newline)


class LineTerminal:
    """A monitor at a line of bytes, without the line: bytes in, texts out."""

    def __init__(
        self,
        send: Callable[[str], object],
        monitor: TerminalMonitor,
        source: Input,
        *,
        newline: str = "\n",
        piped: bool = False,
        at_once: int = sys.maxsize,
    ) -> None:
        """Begin.

        Args:
            send: Sends a text.
            monitor: Whose terminal it is.
            source: Makes lines of what comes.
            newline: What ends lines.
            piped: Whether lines wait until the monitor takes them, and are echoed.
            at_once: How many lines are taken in one turn.
        """
        self.send, self.monitor = send, monitor
        self._newline, self._piped, self._at_once = newline, piped, at_once
        self._input, self._output = source, Output(newline)
        self.lines: deque[str] = deque()
        """Lines that wait to be taken."""
        self.ended = self.end_announced = False

    def feed(self, data: bytes) -> None:
        """Take bytes; none at the end of the input."""
        self.take(self._input.feed(data) if data else self._input.end(), ended=not data)

    def take(self, lines: Iterable[str], *, ended: bool = False) -> None:
        """Take lines, and whether they are the last."""
        self.lines.extend(lines)
        self.ended |= ended

    def advance(self, *, now: float) -> None:
        """Do what is due, and what was typed."""
        monitor = self.monitor
        monitor.advance(now=now)
        self.give()
        for _ in range(min(self._at_once, len(self.lines))):
            if monitor.done or (self._piped and not monitor.takes(self.lines[0])):
                break
            text = self.lines.popleft()
            interrupts = text == INTERRUPT and not self._piped
            if interrupts or self._piped:
                self.send(f"{'' if interrupts else text}{self._newline}")
            self._output.took()
            if interrupts:
                monitor.interrupt(now=now)
            else:
                monitor.line(text, now=now)
            self.give()
        if self.ended and not self.lines and not self.end_announced:
            self.end_announced = True
            monitor.end_of_input(now=now)
            self.give()

    def give(self) -> None:
        """Send what was said, and the prompt."""
        self.send(self._output.give(self.monitor.output(), self.monitor.prompt))


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
        self._terminal = LineTerminal(sys.stdout.write, monitor, Input(telnet=False), piped=True)
        self._room = threading.Event()
        self._done = asyncio.Event()
        self._unheard: BrokenPipeError | None = None
        """Set once nobody reads standard output any more."""
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
        if self._unheard is not None:
            raise self._unheard

    def interrupt(self) -> None:
        """Ctrl-C: once for what is under way; when nothing is, for the end."""
        if not self._monitor.busy:
            self._terminal.lines.clear()
            self._monitor.leave(now=self._clock.now())
        self._monitor.interrupt(now=self._clock.now())
        self._turning.soon()

    def _read(self, loop: asyncio.AbstractEventLoop) -> None:
        """Read in a thread of its own: standard input may be a file, for which a loop can't wait."""
        data = b"\0"
        while data:
            self._room.wait()
            data = os.read(self._source, _READ)
            self._room.clear()
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(self._came, data)

    def _came(self, data: bytes) -> None:
        self._terminal.feed(data)
        self._turning.soon()

    def _turn(self, now: float) -> float:
        try:
            self._terminal.advance(now=now)
            sys.stdout.flush()
        except BrokenPipeError as error:
            self._unheard = error
            self._done.set()
            return math.inf
        if len(self._terminal.lines) <= _MOST:
            self._room.set()
        if self._monitor.done:
            self._done.set()
        return self._monitor.next_deadline()
