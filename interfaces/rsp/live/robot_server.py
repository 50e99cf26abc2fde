"""A robot's side on a UDP socket: a thin shell around `RspHost`."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator
from typing import Any, Final

from interfaces.rsp.header import LONGEST
from interfaces.rsp.host import RspHost
from interfaces.timer import Turning
from vrs.clock import Clock
from vrs.errors import FormatError

BATCH: Final = 64
"""Datagrams read before the body gets its turn."""


def bind(host: str, port: int) -> socket.socket:
    """Make a UDP socket on an address of this machine.

    Raises:
        FormatError: If that can't be had.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        made = socket.socket(family, kind, protocol)
    except OSError as error:
        raise FormatError(f"{host}:{port}", error.strerror or "no such address") from None
    try:
        made.setblocking(False)
        made.bind(address)
    except OSError as error:
        made.close()
        raise FormatError(f"{host}:{port}", error.strerror or "can't be listened on") from None
    return made


class RspServer:
    """Lets a host live and passes its datagrams."""

    def __init__(self, host: RspHost, sock: socket.socket, clock: Clock) -> None:
        """Take a host, a bound socket, which is closed in the end, and the clock that the host's times are of."""
        self._host, self._socket = host, sock
        self._turning = Turning(clock, self._turn)
        self.unsent = 0
        """Datagrams that the machine didn't send."""
        self.failed: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        """Done with an error when the body is of no more use."""

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Serve meanwhile."""
        loop = asyncio.get_running_loop()
        loop.add_reader(self._socket, self._turning.soon)
        self._turning.start()
        try:
            yield
        finally:
            self._turning.stop()
            loop.remove_reader(self._socket)
            self._socket.close()
            self.failed.cancel()

    def _turn(self, now: float) -> float | None:
        host, core = self._host, self._host.core
        for _ in range(BATCH):
            try:
                data, address = self._socket.recvfrom(LONGEST)
            except BlockingIOError:
                break
            except OSError:
                # Nobody listens where an answer went: said so on the next read.
                continue
            core.receive(data, _spelled(address), now=now)
        else:
            self._turning.soon()
        try:
            host.advance(now=now)
        except Exception as error:  # noqa: BLE001 - handed over to whoever runs it
            self._turning.stop()
            if not self.failed.done():
                self.failed.set_exception(error)
            return None
        for data, to in core.to_send(now=now):
            try:
                self._socket.sendto(data, _address(to))
            except OSError:
                self.unsent += 1
        deadline = core.next_deadline()
        return host.next_deadline() if deadline is None else min(deadline, host.next_deadline())


def _spelled(address: Any) -> bytes:
    """A socket's address as bytes: what a cookie is made for."""
    return "\0".join(map(str, address)).encode()


def _address(spelled: bytes) -> tuple[Any, ...]:
    """The other way round."""
    host, *numbers = spelled.decode().split("\0")
    return (host, *map(int, numbers))
