"""The local system's side on a UDP socket: a thread that runs a `Middleware` until it's closed."""

from __future__ import annotations

import select
import socket
import threading
from types import TracebackType
from typing import Final, Self

from interfaces.link.proxy.address import parse_address
from interfaces.rsp.errors import DeadlineError, NoSessionError
from interfaces.rsp.header import LONGEST
from interfaces.rsp.local import LocalState
from interfaces.rsp.middleware import Middleware
from vrs.clock import WallClock
from vrs.errors import FormatError

_LONGEST_WAIT: Final = 0.1


class UdpLink:
    """Runs a local system's side; use it as a context manager."""

    def __init__(self, middleware: Middleware, address: str, *, clock: WallClock | None = None) -> None:
        """Take what it runs, and where the robot listens, as HOST:PORT.

        Raises:
            InvalidValueError: If that's no address.
            FormatError: If it can't be resolved.
        """
        where = parse_address("robot", address)
        try:
            family, kind, protocol, _, target = socket.getaddrinfo(where.host, where.port, type=socket.SOCK_DGRAM)[
                0
            ]
            self._socket = socket.socket(family, kind, protocol)
            self._socket.connect(target)
        except OSError as error:
            raise FormatError(address, error.strerror or "no such address") from None
        self._socket.setblocking(False)
        self.middleware = middleware
        self._clock = WallClock() if clock is None else clock
        self._wake, self._woken = socket.socketpair()
        self._woken.setblocking(False)
        self._over = False
        self._thread = threading.Thread(target=self._run, name=f"rsp {address}", daemon=True)

    def open(self, *, timeout: float = 5.0, takeover: bool = False) -> Self:
        """Open a session.

        Raises:
            DeadlineError: If nothing answers in time.
            NoSessionError: If the robot gives none.
        """
        with self.middleware.changed:
            self.middleware.core.open(now=self._clock.now(), takeover=takeover)
        self._thread.start()
        self._wake.send(b"\0")
        if not self.middleware.wait_for(lambda: self.middleware.core.state is not LocalState.OPENING, timeout):
            self.close()
            raise DeadlineError("a session", timeout)
        if self.middleware.core.state is not LocalState.OPEN:
            refused = self.middleware.refused
            self.close()
            raise DeadlineError("a session", timeout) if refused is None else NoSessionError(refused.name.lower())
        return self

    def close(self) -> None:
        """End the session and the thread."""
        if self._thread.is_alive():
            with self.middleware.changed:
                self.middleware.core.end(now=self._clock.now())
            self._wake.send(b"\0")
            self.middleware.wait_for(lambda: self.middleware.core.state is LocalState.CLOSED, 1.0)
            self._over = True
            self._wake.send(b"\0")
            self._thread.join(2.0)
        for each in (self._socket, self._wake, self._woken):
            each.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _run(self) -> None:
        middleware, core, clock = self.middleware, self.middleware.core, self._clock
        while not self._over:
            deadline = core.next_deadline()
            wait = _LONGEST_WAIT if deadline is None else min(max(deadline - clock.now(), 0.0), _LONGEST_WAIT)
            readable, _, _ = select.select([self._socket, self._woken], [], [], wait)
            if self._woken in readable:
                self._woken.recv(64)
            came: list[bytes] = []
            while self._socket in readable and len(came) < 64:
                try:
                    came.append(self._socket.recv(LONGEST))
                except BlockingIOError:
                    break
                except OSError:
                    # Nobody listens there yet.
                    continue
            for data in middleware.advance(came, now=clock.now()):
                try:
                    self._socket.send(data)
                except OSError:
                    continue
