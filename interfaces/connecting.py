"""`connect`, `connect_mobile`: the doors to a robot elsewhere. What they need is loaded when they're called."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from interfaces.stream.connection import Connection


def connect(
    url: str | Sequence[str],
    *,
    role: str = "operator",
    token: str | None = None,
    name: str = "client",
    encoding: str = "vrs.1.msgpack",
    timeout: float = 5.0,
    alters: bool = False,
) -> Connection:
    """Reach a robot that `vrs serve` serves.

    Args:
        url: `HOST:PORT`, or an address by http, https, ws or wss; off this machine by TLS only. Behind it stands
            what the server's certificate is known by: `#sha256=` and the fingerprint that the server has printed,
            or `#ca=FILE`, authorities of one's own, PEM; else the system's authorities count. Of several, as
            of relays, each is tried when the one before it doesn't answer.
        role: What to do: `viewer`, `operator` or `admin`.
        token: What the role needs; none on a loopback address, but for an admin.
        name: For people, 1 to 100 characters.
        encoding: How messages are written, `vrs.1.msgpack` or `vrs.1.json`.
        timeout: How long to wait for the first answer [s].
        alters: Whether others may correct the path of what it commands while it has the lease: what they ask is to
            be taken by `take_corrections`, and answered.

    Raises:
        UnreachableError: If there's no answer, or the server refuses; it's a ConnectionError.
        ValueError: If role, encoding or address is none of those.
    """
    from interfaces.messages.control import Role, Welcome
    from interfaces.stream.client import ClientCore
    from interfaces.stream.codec import Encoding
    from interfaces.stream.connection import Connection

    client = partial(
        ClientCore, expects=Welcome, name=name, token=token, encoding=Encoding(encoding), alters=alters
    )
    return Connection(url, client, role=Role(role), timeout=timeout)


def connect_mobile(
    url: str | Sequence[str],
    *,
    role: str = "operator",
    token: str | None = None,
    name: str = "client",
    encoding: str = "vrs.1.msgpack",
    timeout: float = 5.0,
) -> Connection:
    """Reach a mobile robot that `vrs serve --robot NAME` serves; see `connect`."""
    from interfaces.messages.control import MobileWelcome, Role
    from interfaces.stream.client import ClientCore
    from interfaces.stream.codec import Encoding
    from interfaces.stream.connection import Connection

    client = partial(ClientCore, expects=MobileWelcome, name=name, token=token, encoding=Encoding(encoding))
    return Connection(url, client, role=Role(role), timeout=timeout)
