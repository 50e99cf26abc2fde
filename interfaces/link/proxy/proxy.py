"""The proxy: both transports over one link, between addresses as the command line spells them."""

from __future__ import annotations

import asyncio
import contextlib
import re
import socket
from dataclasses import asdict, dataclass, field, replace
from typing import Annotated, Any

import numpy as np

from interfaces.link.conditions import LinkConditions, LinkPath, Service
from interfaces.link.link import Channel
from interfaces.link.packets import Totals
from interfaces.link.proxy.tcp import ProxyDirection, TcpProxy
from interfaces.link.proxy.udp import Parcel, UdpProxy
from interfaces.timer import TimerLateness
from vrs.checks import number_in, validated, within
from vrs.clock import Clock
from vrs.errors import InvalidValueError

LOOPBACK = "127.0.0.1"
ALLOWED = "PORT, HOST:PORT or [IPv6]:PORT, PORT in [0, 65535]"

_SPELLING = re.compile(
    r"(?:(?:\[(?P<six>[0-9A-Fa-f:.%\w]+)\]|(?P<host>[^\s:\[\]/]+)):)?(?P<port>\d{1,5})", re.ASCII
)


@dataclass(frozen=True, slots=True)
class Address:
    """A host and a port."""

    host: str
    """Name or number."""
    port: int
    """0 to 65535; 0 lets the system choose."""

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def parse_address(name: str, text: str) -> Address:
    """Read an address; without a host it is the loopback interface's.

    Args:
        name: What the address is for, said in the error.
        text: `PORT`, `HOST:PORT` or `[IPv6]:PORT`.

    Raises:
        InvalidValueError: If text is none of these.
    """
    match = _SPELLING.fullmatch(text)
    if match is None or int(match["port"]) > 65535:
        raise InvalidValueError(name, text, ALLOWED)
    return Address(match["six"] or match["host"] or LOOPBACK, int(match["port"]))


BIND_TRIES = 20
"""Ports tried when the system chooses one that must be free for both transports."""


@dataclass(frozen=True, slots=True)
@validated
class ProxySettings:
    """Where the proxy listens, whom it talks to, and what the link between does."""

    listen: Address
    """Where clients come; port 0 lets the system choose."""
    to: Address
    """The server."""
    conditions: LinkConditions = field(default_factory=LinkConditions)
    """Forward from client to server. TCP gets in-order service, UDP datagrams, whatever is set here."""
    tcp: bool = True
    udp: bool = True
    most_clients: Annotated[int, within(1, 1000)] = 64
    """Most TCP connections, and most UDP clients, at once; 1 to 1000."""
    udp_idle: float = 60.0
    """A UDP client is forgotten after so long without a datagram [s], in [0.01, 86400]."""

    def __post_init__(self) -> None:
        if not (self.tcp or self.udp):
            raise InvalidValueError("transport", "none", "tcp, udp or both")
        if self.to.port == 0:
            raise InvalidValueError("--to", str(self.to), "an address with a port other than 0")
        if self.listen == self.to:
            raise InvalidValueError("--to", str(self.to), "another address than --listen")
        number_in("udp_idle", self.udp_idle, 0.01, 86_400.0, "seconds")


class Proxy:
    """Real sockets at both ends of an emulated link. All clients share it, as they would a real one.

    Args:
        settings: What to do.
        clock: Time of the link; a wall clock, unless a test has its own.
        rng: Source of everything random. Real clients send at times of their own, so that only the draws
            repeat from a seed, not the bytes on the wire.
    """

    def __init__(self, settings: ProxySettings, clock: Clock, rng: np.random.Generator) -> None:
        there, back, spare = rng.spawn(3)
        self.settings, self._clock, self._spare = settings, clock, spare
        conditions = settings.conditions
        self._paths = (LinkPath(conditions.forward, there), LinkPath(conditions.backward, back))
        self._began = clock.now()
        self._lateness = TimerLateness()
        self.tcp: TcpProxy | None = None
        """TCP's part, once it has been started and if the settings ask for it."""
        self.udp: UdpProxy | None = None
        self.listening = settings.listen
        """Where it really listens, once it has been started."""

    async def start(self) -> None:
        """Listen.

        Raises:
            InvalidValueError: If the server's name has no address, or this machine can't listen as asked.
        """
        settings = self.settings
        family, target = await _resolve("--to", settings.to)
        tcp, udp = await self._bind()
        both = (settings.conditions.forward, settings.conditions.backward)
        if udp is not None:
            there, back = (
                Channel[Parcel](replace(conditions, service=Service.DATAGRAM), self._spare, path=path)
                for conditions, path in zip(both, self._paths, strict=True)
            )
            self.udp = UdpProxy(
                udp,
                (family, target),
                (there, back),
                self._clock,
                self._lateness,
                most=settings.most_clients,
                idle=settings.udp_idle,
            )
            self.udp.start()
        if tcp is not None:
            forward, backward = (
                ProxyDirection(conditions, path, self._spare)
                for conditions, path in zip(both, self._paths, strict=True)
            )
            self.tcp = TcpProxy(target[:2], (forward, backward), self._clock, self._lateness, settings.most_clients)
            await self.tcp.start(tcp)

    def close(self) -> None:
        """Stop listening, end every connection, drop what is on its way."""
        for part in (self.tcp, self.udp):
            if part is not None:
                part.close()

    def statistics(self) -> dict[str, Any]:
        """What happened so far, ready for JSON; times in seconds."""
        settings, conditions = self.settings, self.settings.conditions
        value: dict[str, Any] = {
            "schema": "vrs-link/1",
            "listen": str(self.listening),
            "to": str(settings.to),
            "delay_forward": conditions.forward.delay.name,
            "delay_backward": conditions.backward.delay.name,
            "duration_s": self._clock.now() - self._began,
            "timers": {
                "count": self._lateness.count,
                "late_mean_s": self._lateness.mean,
                "late_max_s": self._lateness.worst if self._lateness.count else None,
            },
        }
        for name, part in (("tcp", self.tcp), ("udp", self.udp)):
            if part is not None:
                forward, backward = (_totals(way.log.totals()) for way in part.ways)
                value[name] = {**asdict(part.counts), "forward": forward, "backward": backward}
        return value

    async def _bind(self) -> tuple[socket.socket | None, socket.socket | None]:
        """Bind one port number for the transports asked for."""
        settings = self.settings
        family, address = await _resolve("--listen", settings.listen)
        for last in (*(False,) * (BIND_TRIES - 1), True):
            with contextlib.ExitStack() as stack:
                sockets: list[socket.socket | None] = [None, None]
                port = settings.listen.port
                try:
                    for place, kind in enumerate((socket.SOCK_STREAM, socket.SOCK_DGRAM)):
                        if (settings.tcp, settings.udp)[place]:
                            sock = sockets[place] = stack.enter_context(socket.socket(family, kind))
                            sock.setblocking(False)
                            if kind == socket.SOCK_STREAM:
                                sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                            sock.bind((address[0], port, *address[2:]))
                            port = sock.getsockname()[1]
                except OSError as error:
                    if settings.listen.port == 0 and not last:
                        continue
                    reason = error.strerror or str(error)
                    allowed = f"an address that this machine can listen on ({reason})"
                    raise InvalidValueError("--listen", str(settings.listen), allowed) from None
                stack.pop_all()
                self.listening = Address(settings.listen.host, port)
                return sockets[0], sockets[1]
        raise AssertionError


async def _resolve(name: str, address: Address) -> tuple[socket.AddressFamily, Any]:
    """The first address that the system knows for a host.

    Raises:
        InvalidValueError: If it knows none.
    """
    loop = asyncio.get_running_loop()
    try:
        found = await loop.getaddrinfo(address.host, address.port, type=socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InvalidValueError(name, str(address), f"a host that can be resolved ({reason})") from None
    return found[0][0], found[0][4]


def _totals(totals: Totals) -> dict[str, Any]:
    value = asdict(totals)
    del value["forgotten"]
    return value
