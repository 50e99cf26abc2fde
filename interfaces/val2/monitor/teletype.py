"""A line of bytes to a terminal without a screen: telnet, `nc`, a host's driver, a pipe."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from interfaces.val2.monitor.desk import Said
from interfaces.val2.monitor.monitor import LONGEST, OVERLONG

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

    def give(self, said: Iterable[Said], prompt: str) -> str:
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
