"""Addresses of sockets as the command line spells them."""

from __future__ import annotations

import re
from dataclasses import dataclass

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
