"""The security processor: keys from a secret, sealed packets, and a window against replays.

A sealed packet is the header (20 bytes, in the clear and authenticated), a counter (8), the encrypted body, and a
tag (16): 24 bytes more than an open one. AES-256-GCM, a key a session and direction; the nonce is four zeros and
the counter, which is the packet's sequence number without end and so never repeats under a key.
"""

from __future__ import annotations

import enum
import hashlib
import hmac
import struct
from collections.abc import Mapping
from typing import Any, Final

from interfaces.rsp import header
from robots.onboard.stamps import SequenceWindow
from vrs.errors import InvalidValueError

TAG: Final = 16
"""Bytes of a tag, of a nonce of the handshake and of a cookie."""
OVERHEAD: Final = 24
"""What sealing adds to a packet [byte]."""
_COUNTER: Final = struct.Struct("!Q")
_WINDOW: Final = 4096
_LEAST: Final = 32
"""Shortest secret [byte]."""


class Rank(enum.IntEnum):
    """Who opens a session."""

    OPERATOR = 0
    ADMIN = 1
    """May take over by force."""


class NotAuthenticError(Exception):
    """A tag that isn't right; it never leaves a core."""


class ReplayError(Exception):
    """An authentic packet that came before; it never leaves a core."""


def _derived(secret: bytes, salt: bytes, info: bytes, length: int) -> bytes:
    """HKDF-SHA256. Source: RFC 5869."""
    key = hmac.digest(salt or bytes(32), secret, "sha256")
    out, block = b"", b""
    while len(out) < length:
        block = hmac.digest(key, block + info + bytes([len(out) // 32 + 1]), "sha256")
        out += block
    return out[:length]


class Keyring:
    """The secrets of the ranks, as keys."""

    def __init__(self, secrets: Mapping[Rank, bytes]) -> None:
        """Take a secret of 32 bytes or more for each rank that may open sessions.

        Raises:
            InvalidValueError: If there's none, or one is shorter.
        """
        if not secrets:
            raise InvalidValueError("secrets", "none", "one or more")
        for secret in secrets.values():
            if len(secret) < _LEAST:
                raise InvalidValueError("secret", f"{len(secret)} bytes", f"{_LEAST} bytes or more")
        self._secrets = {Rank(rank): bytes(secret) for rank, secret in secrets.items()}
        self._macs = {r: _derived(s, b"", b"vrs rsp 1 handshake", 32) for r, s in self._secrets.items()}

    def __repr__(self) -> str:
        return f"Keyring({', '.join(rank.name.lower() for rank in self._secrets)})"

    def __contains__(self, rank: object) -> bool:
        return rank in self._secrets

    def mac(self, rank: Rank, data: bytes) -> bytes:
        """The tag of a handshake's packet."""
        return hmac.digest(self._macs[rank], data, "sha256")[:TAG]

    def session(self, rank: Rank, nonces: bytes, session: int) -> tuple[bytes, bytes]:
        """Keys of a session, down and up: fresh nonces of both sides make them fresh."""
        info = b"vrs rsp 1 session" + session.to_bytes(6, "big")
        keys = _derived(self._secrets[rank], hashlib.sha256(nonces).digest(), info, 64)
        return keys[:32], keys[32:]


def _cipher(key: bytes) -> Any:
    from cryptography.hazmat.primitives.ciphers.aead import AESGCM

    return AESGCM(key)


class Sealer:
    """Seals what one side sends in a session."""

    def __init__(self, key: bytes) -> None:
        """Take the direction's key."""
        self._cipher = _cipher(key)

    def seal(self, head: bytes, body: bytes, counter: int) -> bytes:
        """The packet of a header, a body and its number without end."""
        count = _COUNTER.pack(counter)
        sealed: bytes = self._cipher.encrypt(b"\0\0\0\0" + count, body, head)
        return head + count + sealed


class Opener:
    """Opens what the other side sent; the window is looked at after the tag."""

    def __init__(self, key: bytes) -> None:
        """Take the direction's key."""
        self._cipher = _cipher(key)
        self._window = SequenceWindow(_WINDOW)

    def open(self, packet: bytes) -> tuple[bytes, int]:
        """The body of a sealed packet, and its counter.

        Raises:
            NotAuthenticError: If a bit of it was changed, or another key sealed it.
            ReplayError: If it came before, or so late that nobody knows.
        """
        from cryptography.exceptions import InvalidTag

        if len(packet) < header.SIZE + OVERHEAD:
            raise NotAuthenticError
        count = packet[header.SIZE : header.SIZE + _COUNTER.size]
        try:
            body: bytes = self._cipher.decrypt(
                b"\0\0\0\0" + count, packet[header.SIZE + _COUNTER.size :], packet[: header.SIZE]
            )
        except InvalidTag:
            raise NotAuthenticError from None
        counter = int(_COUNTER.unpack(count)[0])
        if self._window.refusal(counter) is not None:
            raise ReplayError
        self._window.note(counter)
        return body, counter
