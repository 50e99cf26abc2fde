"""What both sides of a session do with every packet: numbers, stamps, sealing, and what is dropped.

A sealed packet is the header (20 bytes, in the clear and authenticated), a counter (8), the encrypted body, and a
tag (16): 24 bytes more than an open one. AES-256-GCM, a key a session and direction; the nonce is four zeros and
the counter, which is the packet's sequence number without end and so never repeats under a key.
"""

from __future__ import annotations

import enum
import hashlib
import hmac
import struct
from collections import deque
from collections.abc import Mapping
from typing import Final

from interfaces.rsp import header
from interfaces.rsp.header import MODULUS, Header, PacketType, unwrapped, up_to
from robots.onboard.watchdog import SequenceWindow
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


def hkdf(secret: bytes, salt: bytes, info: bytes, length: int) -> bytes:
    """HKDF-SHA256. Source: RFC 5869."""
    from cryptography.hazmat.primitives.hashes import SHA256
    from cryptography.hazmat.primitives.kdf.hkdf import HKDF

    return HKDF(SHA256(), length, salt, info).derive(secret)


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
        self._macs = {r: hkdf(s, b"", b"vrs rsp 1 handshake", 32) for r, s in self._secrets.items()}

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
        keys = hkdf(self._secrets[rank], hashlib.sha256(nonces).digest(), info, 64)
        return keys[:32], keys[32:]


class PacketCipher:
    """Seals what one side sends in a session, and opens what the other side sent.

    Whether a packet came before is looked at after its tag.
    """

    def __init__(self, sending: bytes, receiving: bytes) -> None:
        """Take the keys of both directions."""
        from cryptography.hazmat.primitives.ciphers.aead import AESGCM

        self._sending, self._receiving = AESGCM(sending), AESGCM(receiving)
        self._window = SequenceWindow(_WINDOW)

    def seal(self, head: bytes, body: bytes, counter: int) -> bytes:
        """The packet of a header, a body and its number without end."""
        count = _COUNTER.pack(counter)
        return head + count + self._sending.encrypt(b"\0\0\0\0" + count, body, head)

    def open(self, packet: bytes) -> tuple[bytes, int]:
        """The body of a sealed packet, and its counter.

        Raises:
            PacketDropped: If a bit of it was changed, or another key sealed it; or if it came before, or so late
                that nobody knows.
        """
        from cryptography.exceptions import InvalidTag

        if len(packet) < header.SIZE + OVERHEAD:
            raise PacketDropped(DropReason.AUTHENTICATION)
        count = packet[header.SIZE : header.SIZE + _COUNTER.size]
        try:
            body = self._receiving.decrypt(
                b"\0\0\0\0" + count, packet[header.SIZE + _COUNTER.size :], packet[: header.SIZE]
            )
        except InvalidTag:
            raise PacketDropped(DropReason.AUTHENTICATION) from None
        counter = int(_COUNTER.unpack(count)[0])
        if self._window.refusal(counter) is not None:
            raise PacketDropped(DropReason.REPLAY)
        self._window.note(counter)
        return body, counter


SLACK: Final = 1e-9
"""A deadline that's less than this ahead counts as due [s]: times are sums of periods."""


class DropReason(enum.StrEnum):
    """Why a datagram was dropped."""

    MALFORMED = "malformed"
    """It's no packet of this robot: its length, a field, a device bit."""
    MODEL = "model"
    """Of another robot model."""
    DOWNGRADE = "downgrade"
    """In the clear where packets are sealed, or the other way round."""
    SESSION = "session"
    """Of no session that there is, or from another address than the session's: spoofed, or too old."""
    AUTHENTICATION = "authentication"
    """Its tag isn't right: flipped, forged, or under another key."""
    REPLAY = "replay"
    """It was authentic, and came before."""
    LATE = "late"
    """A newer one came before it."""
    UNEXPECTED = "unexpected"
    """Of a type that isn't for this side, or not now."""
    STOPPING = "stopping"
    """The robot comes to rest after a take-over; the new session's packets count after that."""


class PacketDropped(Exception):  # noqa: N818 - it says what becomes of a packet, and never leaves a core
    """A packet isn't taken."""

    def __init__(self, reason: DropReason) -> None:
        self.reason = reason
        super().__init__(reason)


def milliseconds(now: float) -> int:
    """A time [s] as a header's stamp."""
    return round(now * 1000.0) & 0xFFFFFFFF


class SessionNumbers:
    """One side's numbers of a session, and its keys."""

    def __init__(self, model: int, session: int, cipher: PacketCipher | None = None) -> None:
        """Begin with number 0, sealed if there's a cipher."""
        self.id, self.model, self.cipher = session, model, cipher
        self.number = 0
        """Of the next packet that goes out, without end."""
        self.newest = -1
        """Number of the newest packet that came, without end."""

    def make(self, kind: PacketType, body: bytes, now: float, buffers: int = 0) -> bytes:
        """The next packet.

        Args:
            kind: Its type.
            body: Its map and payloads.
            now: When it's made [s].
            buffers: The last byte of the header.
        """
        number, self.number = self.number, self.number + 1
        head = header.encode(
            Header(
                self.model,
                self.cipher is not None,
                kind,
                number % MODULUS,
                milliseconds(now),
                self.id,
                self.newest % MODULUS,
                buffers,
            )
        )
        return head + body if self.cipher is None else self.cipher.seal(head, body, number)

    def take(self, head: Header, data: bytes) -> tuple[bytes, int]:
        """The body of a packet that came, and its number, if it's newer than all before.

        It counts as received once `newest` is set to that number: not before its body was understood.

        Raises:
            PacketDropped: If it isn't, or isn't authentic.
        """
        if self.cipher is None:
            number, body = unwrapped(head.number, self.newest), data[header.SIZE :]
        else:
            body, number = self.cipher.open(data)
            if number % MODULUS != head.number:
                raise PacketDropped(DropReason.MALFORMED)
        if number <= self.newest:
            raise PacketDropped(DropReason.LATE)
        return body, number

    def acknowledged(self, head: Header) -> int:
        """The newest of our packets that the other side says it has, without end; −1 for none."""
        return max(up_to(head.last, self.number - 1), -1)


_MOST: Final = 4096
"""Packets whose round trip may still be measured."""


class PacketRoundTrip:
    """Measured by the last received numbers that the other side's packets carry; it knows no clock."""

    def __init__(self) -> None:
        """Begin with nothing sent."""
        self._sent: deque[tuple[int, float]] = deque(maxlen=_MOST)
        self.smoothed: float | None = None
        """[s]; None before the first."""

    def sent(self, number: int, now: float) -> None:
        """Note that a packet of a number goes out [s]."""
        self._sent.append((number, now))

    def acknowledged(self, last: int, now: float) -> float | None:
        """Take the other side's last received number; returns that packet's round trip [s], None if it's known."""
        found = None
        while self._sent and self._sent[0][0] <= last:
            number, sent = self._sent.popleft()
            if number == last:
                found = now - sent
                self.smoothed = found if self.smoothed is None else 0.875 * self.smoothed + 0.125 * found
        return found
