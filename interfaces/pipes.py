"""Whole messages between a process of ours and one that it starts, over a stream socket that every system has."""

from __future__ import annotations

import select
import socket
import subprocess
import sys
from contextlib import suppress
from typing import Any, Final

from interfaces.system import module_process
from vrs.errors import FormatError

HEAD: Final = 4
"""Bytes of a message's length before it, big-endian."""
_BUFFER: Final = 1 << 20
"""Bytes that wait in either direction, as far as the system grants them."""
_READ: Final = 1 << 18


def start(module: str) -> tuple[subprocess.Popen[bytes], socket.socket]:
    """Run a module in a process of its own, which is given the descriptor of its end of a socket as its argument.

    Args:
        module: Its dotted name.

    Returns:
        The process, and this end.

    Raises:
        OSError: If it can't be started.
    """
    ours, theirs = socket.socketpair()
    for end in (ours, theirs):
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)
    command, environment = module_process(module, str(theirs.fileno()))
    inherited: dict[str, Any] = {"pass_fds": [theirs.fileno()], "start_new_session": True}
    if sys.platform == "win32":
        theirs.set_inheritable(True)
        inherited = {"close_fds": False}
    try:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, env=environment, **inherited
        )
    except OSError:
        ours.close()
        raise
    finally:
        theirs.close()
    return process, ours


def framed(message: bytes) -> bytes:
    """A message with its length before it."""
    return len(message).to_bytes(HEAD, "big") + message


class MessageSocket:
    """An end of such a socket. Nothing here waits, but for `flush` and `wait`."""

    def __init__(self, connection: socket.socket, most: int) -> None:
        """Take an end.

        Args:
            connection: It.
            most: Bytes that a message may have.
        """
        connection.setblocking(False)
        self._connection, self._most = connection, most
        self._read = bytearray()
        self._unsent = b""
        """The rest of a message that has begun."""
        self.ended = False
        """Whether the other end is closed."""

    def fileno(self) -> int:
        """The descriptor that can be read when there may be something to `receive`."""
        return self._connection.fileno()

    def send(self, message: bytes) -> bool:
        """Send a message, if there's room for its beginning; returns whether."""
        if self._push():
            before = self._unsent = framed(message)
            if self._push() or len(self._unsent) < len(before):
                return not self.ended
            self._unsent = b""
        return False

    def flush(self, seconds: float) -> None:
        """Send the rest of what has begun, for no longer than this [s]."""
        self._connection.settimeout(seconds)
        with suppress(OSError):
            self._connection.sendall(self._unsent)
        self._unsent = b""
        self._connection.setblocking(False)

    def receive(self) -> list[bytes]:
        """What has come, whole messages in order.

        Raises:
            FormatError: If one is longer than allowed.
        """
        with suppress(BlockingIOError):
            try:
                while not self.ended and len(self._read) <= self._most + HEAD:
                    data = self._connection.recv(_READ)
                    self._read += data
                    self.ended = not data
            except ConnectionError:
                self.ended = True
        messages, at, read = [], 0, self._read
        while len(read) - at >= HEAD:
            size = int.from_bytes(read[at : at + HEAD], "big")
            if size > self._most:
                raise FormatError("message", f"{size} bytes; {self._most} are allowed")
            if len(read) - at < HEAD + size:
                break
            messages.append(bytes(read[at + HEAD : at + HEAD + size]))
            at += HEAD + size
        del read[:at]
        return messages

    def wait(self, seconds: float) -> bool:
        """Wait until there may be something to receive, no longer than this [s]; returns whether."""
        return bool(select.select([self._connection], [], [], max(seconds, 0.0))[0])

    def close(self) -> None:
        """Close this end."""
        self._connection.close()

    def _push(self) -> bool:
        """Send as much of what has begun as there's room for; returns whether nothing is left."""
        try:
            while self._unsent and not self.ended:
                self._unsent = self._unsent[self._connection.send(self._unsent) :]
        except BlockingIOError:
            return False
        except OSError:
            self.ended = True
        return not self._unsent
