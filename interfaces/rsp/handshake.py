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
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, NamedTuple

from interfaces.rsp import header
from interfaces.rsp.errors import PacketError
from interfaces.rsp.header import MODULUS, Header, PacketType
from interfaces.rsp.session import (
    TAG,
    DropReason,
    Keyring,
    PacketCipher,
    PacketDropped,
    Rank,
    SessionNumbers,
    milliseconds,
)
from interfaces.stream.limits import Bucket

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


def encode_answer(nonce: bytes, given: bytes) -> bytes:
    """The body of CHALLENGE or OPENED.

    Args:
        nonce: What OPEN had.
        given: The cookie, or the robot's nonce.
    """
    return _ANSWER.pack(nonce, given)


def decode_answer(body: bytes) -> tuple[bytes, bytes]:
    """Read the body of CHALLENGE or OPENED: OPEN's nonce, and the cookie or the robot's nonce.

    Raises:
        PacketError: If it isn't one.
    """
    if len(body) != _ANSWER.size:
        raise PacketError("the length of its body")
    nonce, given = _ANSWER.unpack(body)
    return nonce, given


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


RATE: Final = 100.0
"""Requests for a session that are looked at [1/s], of proven addresses and of others."""


@dataclass(slots=True, eq=False)
class SessionClaim:
    """A session and whose it is."""

    session: SessionNumbers
    address: bytes
    nonce: bytes
    """Of the local system."""
    given: bytes
    """The robot's."""
    stamp: int
    """Newest stamp of the local system, without end [ms]."""

    def fits(self, head: Header, address: bytes) -> bool:
        """Whether a packet may be of this session."""
        return head.session == self.session.id and address == self.address


class SessionDoor:
    """Answers who asks for a session."""

    def __init__(
        self,
        model: int,
        random_bytes: Callable[[int], bytes],
        keys: Keyring | None,
        *,
        idle: float,
        takeover: bool,
    ) -> None:
        """Begin without a claim.

        Args:
            model: ID of the robot's model.
            random_bytes: So many bytes that nobody can guess.
            keys: Of who may open sessions.
            idle: A session without a packet for so long gives way [s].
            takeover: Whether anybody may take over where there are no keys.
        """
        self._model, self._random, self._keys = model, random_bytes, keys
        self._idle, self._takeover = idle, takeover
        self._secret = random_bytes(32)
        self._allowed = {proven: Bucket(RATE, RATE, 0.0) for proven in (False, True)}
        """Requests by whether their address is proven: who makes addresses up takes nothing from who has one."""
        self.pending: SessionClaim | None = None
        """A session that was given, and in which nothing came yet; whoever asks next has it instead."""

    def opened(
        self, head: Header, data: bytes, address: bytes, heard: float | None, *, now: float
    ) -> list[tuple[bytes, bytes]]:
        """Answer OPEN.

        Args:
            head: Of the packet.
            data: The packet.
            address: Where it came from.
            heard: When the session in force last heard anything [s]; None if there's none.
            now: [s].

        Raises:
            Dropped: If it isn't authentic, or too many ask.
            PacketError: If its body isn't what it should be.
        """
        body, rank = received(data, self._keys, Rank)
        if rank is None:
            raise PacketDropped(DropReason.AUTHENTICATION)
        asked = decode_open(body)
        if self._keys is not None and asked.rank is not rank:
            raise PacketDropped(DropReason.AUTHENTICATION)
        cookie, before = (self._cookie(address, asked.nonce, now - back) for back in (0.0, COOKIE_LIFE))
        proven = any(hmac.compare_digest(one, asked.cookie) for one in (cookie, before))
        if not self._allowed[proven].take(now):
            raise PacketDropped(DropReason.UNEXPECTED)

        def answer(kind: PacketType, body: bytes, session: int = 0) -> list[tuple[bytes, bytes]]:
            made = Header(self._model, False, kind, 0, milliseconds(now), session, MODULUS - 1, 0)
            return [(sent(kind, body, made, self._keys, asked.rank), address)]

        if not proven:
            return answer(PacketType.CHALLENGE, encode_answer(asked.nonce, cookie))
        refusal = self._refusal(asked, heard, now)
        if refusal is not None:
            return answer(PacketType.REFUSED, encode_refused(asked.nonce, refusal))
        claim, over = self.pending, []
        if claim is None or claim.nonce != asked.nonce or claim.address != address:
            if claim is not None and claim.address != address:
                over = [(claim.session.make(PacketType.ENDED, b"", now), claim.address)]
            claim = self.pending = self._claim(asked, address, head.stamp)
        given = encode_answer(claim.nonce, claim.given)
        return [*over, *answer(PacketType.OPENED, given, claim.session.id)]

    def _cookie(self, address: bytes, nonce: bytes, now: float) -> bytes:
        """Proof that somebody is at an address, without a memory of who asked; a new one each `COOKIE_LIFE`."""
        age = int(now // COOKIE_LIFE).to_bytes(8, "big", signed=True)
        return hmac.digest(self._secret, nonce + age + address, "sha256")[:TAG]

    def _refusal(self, asked: Open, heard: float | None, now: float) -> SessionRefusal | None:
        if heard is None or now - heard >= self._idle:
            return None
        if not asked.takeover:
            return SessionRefusal.BUSY
        may = self._takeover if self._keys is None else asked.rank is Rank.ADMIN
        return None if may else SessionRefusal.FORBIDDEN

    def _claim(self, asked: Open, address: bytes, stamp: int) -> SessionClaim:
        number = 0
        while not number:
            number = int.from_bytes(self._random(6), "big")
        given = self._random(TAG)
        cipher = None
        if self._keys is not None:
            down, up = self._keys.session(asked.rank, asked.nonce + given, number)
            cipher = PacketCipher(up, down)
        return SessionClaim(SessionNumbers(self._model, number, cipher), address, asked.nonce, given, stamp)
