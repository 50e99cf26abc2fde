"""How a session begins: the bodies of OPEN, CHALLENGE, OPENED and REFUSED.

    local                                   robot
    OPEN   nonce, no cookie        ──▶
                                   ◀──      CHALLENGE  the nonce, a cookie for this address
    OPEN   nonce, cookie           ──▶
                                   ◀──      OPENED     the nonce, the robot's nonce; session ID in the header
    DOWN   under the session       ──▶      only now does the session count, and an older one end

The robot keeps nothing before the cookie is back, and no answer is longer than its question. With keys each of
these packets carries a tag of HMAC-SHA256, cut to 16 bytes, over header and body.
"""

from __future__ import annotations

import enum
import hmac
import struct
from collections.abc import Iterable
from typing import Final, NamedTuple

from interfaces.rsp import header
from interfaces.rsp.errors import PacketError
from interfaces.rsp.header import Header, PacketType
from interfaces.rsp.security import TAG, Keyring, Rank

_OPEN: Final = struct.Struct("!BB16s16s")
_ANSWER: Final = struct.Struct("!16s16s")
_REFUSED: Final = struct.Struct("!16sB")
NO_COOKIE: Final = bytes(TAG)
COOKIE_LIFE: Final = 10.0
"""A cookie counts for so long at least, twice as long at most [s]."""


class SessionRefusal(enum.IntEnum):
    """Why a robot gives no session."""

    BUSY = 1
    """Somebody else has it."""
    FORBIDDEN = 2
    """Only an admin takes over by force."""


class Open(NamedTuple):
    """What a local system asks for."""

    rank: Rank
    takeover: bool
    """Whether another's session is to end for it."""
    nonce: bytes
    """Of the local system, 16 bytes that were never used before."""
    cookie: bytes = NO_COOKIE


class HandshakeAnswer(NamedTuple):
    """CHALLENGE or OPENED."""

    nonce: bytes
    """What OPEN had."""
    given: bytes
    """The cookie, or the robot's nonce."""


def encode_open(asked: Open) -> bytes:
    """The body of OPEN."""
    return _OPEN.pack(asked.rank, asked.takeover, asked.nonce, asked.cookie)


def decode_open(body: bytes) -> Open:
    """Read the body of OPEN.

    Raises:
        PacketError: If it isn't one.
    """
    if len(body) != _OPEN.size:
        raise PacketError("the length of its body")
    rank, takeover, nonce, cookie = _OPEN.unpack(body)
    if rank not in set(Rank) or takeover > 1:
        raise PacketError("what it asks for")
    return Open(Rank(rank), takeover == 1, nonce, cookie)


def encode_answer(answer: HandshakeAnswer) -> bytes:
    """The body of CHALLENGE or OPENED."""
    return _ANSWER.pack(*answer)


def decode_answer(body: bytes) -> HandshakeAnswer:
    """Read the body of CHALLENGE or OPENED.

    Raises:
        PacketError: If it isn't one.
    """
    if len(body) != _ANSWER.size:
        raise PacketError("the length of its body")
    return HandshakeAnswer(*_ANSWER.unpack(body))


def encode_refused(nonce: bytes, refusal: SessionRefusal) -> bytes:
    """The body of REFUSED."""
    return _REFUSED.pack(nonce, refusal)


def decode_refused(body: bytes) -> tuple[bytes, SessionRefusal]:
    """Read the body of REFUSED.

    Raises:
        PacketError: If it isn't one.
    """
    if len(body) != _REFUSED.size:
        raise PacketError("the length of its body")
    nonce, refusal = _REFUSED.unpack(body)
    if refusal not in set(SessionRefusal):
        raise PacketError("its reason")
    return nonce, SessionRefusal(refusal)


def sent(kind: PacketType, body: bytes, head: Header, keys: Keyring | None, rank: Rank) -> bytes:
    """A packet of the handshake, with its tag if there are keys; type and flag of the header are set here."""
    packet = header.encode(head._replace(type=kind, encrypted=keys is not None)) + body
    return packet if keys is None else packet + keys.mac(rank, packet)


def received(data: bytes, keys: Keyring | None, ranks: Iterable[Rank]) -> tuple[bytes, Rank | None]:
    """The body of a packet of the handshake, and whose tag it has; None where no key of those ranks made it."""
    if keys is None:
        return data[header.SIZE :], next(iter(ranks))
    packet, tag = data[:-TAG], data[-TAG:]
    right = [rank for rank in ranks if rank in keys and hmac.compare_digest(keys.mac(rank, packet), tag)]
    return packet[header.SIZE :], right[0] if right else None


class Cookies:
    """Proofs that somebody really is at an address, without a memory of who asked."""

    def __init__(self, secret: bytes) -> None:
        """Take 32 bytes that nobody knows."""
        self._secret = secret

    def cookie(self, address: bytes, nonce: bytes, now: float) -> bytes:
        """The cookie for an address and a nonce, at a time [s]."""
        return self._made(address, nonce, int(now // COOKIE_LIFE))

    def good(self, asked: Open, address: bytes, now: float) -> bool:
        """Whether a cookie is one of ours for that address, and not too old."""
        age = int(now // COOKIE_LIFE)
        now_or_before = (self._made(address, asked.nonce, age - back) for back in (0, 1))
        return any(hmac.compare_digest(one, asked.cookie) for one in now_or_before)

    def _made(self, address: bytes, nonce: bytes, age: int) -> bytes:
        return hmac.digest(self._secret, nonce + age.to_bytes(8, "big", signed=True) + address, "sha256")[:TAG]
