"""RSP on sockets: thin shells around its cores, and sessions for programs."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import select
import socket
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from interfaces.link.proxy.proxy import parse_address
from interfaces.messages.control import Role
from interfaces.rsp.errors import DeadlineError, NoSessionError
from interfaces.rsp.header import LONGEST
from interfaces.rsp.host import RspHost
from interfaces.rsp.local import MOST_PATIENCE, LocalConfig, LocalCore, LocalState
from interfaces.rsp.middleware import Middleware
from interfaces.rsp.model.elements import RobotModel
from interfaces.rsp.session import Keyring, Rank
from interfaces.stream.access import read_tokens
from interfaces.timer import Turning
from vrs.checks import finite
from vrs.clock import Clock, WallClock
from vrs.errors import FormatError

_LONGEST_WAIT: Final = 0.1


class UdpLink:
    """Runs a local system's side, from `open` to `close`."""

    def __init__(self, middleware: Middleware, address: str, clock: WallClock) -> None:
        """Take what it runs, and where the robot listens, as HOST:PORT.

        Raises:
            InvalidValueError: If that's no address.
            FormatError: If it can't be resolved.
        """
        where = parse_address("robot", address)
        self._socket = _udp(where.host, where.port, socket.socket.connect, address)
        self.middleware = middleware
        self._clock = clock
        self._wake, self._woken = socket.socketpair()
        self._woken.setblocking(False)
        self._over = False
        self._thread = threading.Thread(target=self._run, name=f"rsp {address}", daemon=True)

    def open(self, *, timeout: float, takeover: bool) -> None:
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
            raise DeadlineError("a session", timeout)
        if self.middleware.core.state is not LocalState.OPEN:
            refused = self.middleware.refused
            raise DeadlineError("a session", timeout) if refused is None else NoSessionError(refused.name.lower())

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


_RANKS = {Role.OPERATOR: Rank.OPERATOR, Role.ADMIN: Rank.ADMIN}


def keys_of(tokens: dict[Role, str], path: Path | None) -> Keyring:
    """The keys of tokens from a file.

    Raises:
        FormatError: If there's neither an operator's nor an admin's.
    """
    found = {_RANKS[role]: token.encode("ascii") for role, token in tokens.items() if role in _RANKS}
    if not found:
        raise FormatError(f"token file {path}", "it has no token of an operator or an admin")
    return Keyring(found)


@contextmanager
def opened(
    model: RobotModel,
    address: str,
    *,
    key_file: Path | None = None,
    timeout: float = 5.0,
    takeover: bool = False,
    config: LocalConfig | None = None,
) -> Iterator[Middleware]:
    """Have a session with a robot meanwhile.

    Args:
        model: Of the robot.
        address: Where it listens, HOST:PORT.
        key_file: A token file; packets are sealed with it. Without one all is in the clear.
        timeout: For the session to open [s]; it's asked for as long.
        takeover: Whether another's session is to end for it; that opens as admin where there are keys.
        config: How packets are sent.

    Raises:
        DeadlineError: If nothing answers in time.
        NoSessionError: If the robot gives no session.
        FormatError: If the address can't be resolved or the file read.
        InvalidValueError: If the timeout isn't finite.
    """
    keys = None if key_file is None else keys_of(read_tokens(key_file), key_file)
    rank = Rank.ADMIN if keys is not None and (takeover or Rank.OPERATOR not in keys) else Rank.OPERATOR
    clock = WallClock()
    config = LocalConfig() if config is None else config
    patience = max(config.patience, min(finite("timeout", timeout, "finite seconds"), MOST_PATIENCE))
    core = LocalCore(model, secrets.token_bytes, replace(config, patience=patience), keys=keys, rank=rank)
    with contextlib.closing(UdpLink(Middleware(core, clock), address, clock)) as link:
        link.open(timeout=timeout, takeover=takeover)
        yield link.middleware


BATCH: Final = 64
"""Datagrams read before the body gets its turn."""


def bind(host: str, port: int) -> socket.socket:
    """Make a UDP socket on an address of this machine.

    Raises:
        FormatError: If that can't be had.
    """
    return _udp(host, port, socket.socket.bind, f"{host}:{port}")


def _udp(host: str, port: int, use: Callable[[socket.socket, Any], None], where: str) -> socket.socket:
    """A UDP socket that doesn't block, connected or bound to an address, which is called so in errors."""
    made = None
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        made = socket.socket(family, kind, protocol)
        made.setblocking(False)
        use(made, address)
    except OSError as error:
        if made is not None:
            made.close()
        raise FormatError(where, error.strerror or "no such address") from None
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
