"""The robot's door: who gets a session. It keeps one claim that isn't proven yet, and nothing of who only asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from interfaces.rsp import handshake
from interfaces.rsp.handshake import Cookies, HandshakeAnswer, SessionRefusal
from interfaces.rsp.header import Header, PacketType
from interfaces.rsp.numbers import MODULUS
from interfaces.rsp.security import TAG, Keyring, Opener, Rank, Sealer
from interfaces.rsp.session import DropReason, PacketDropped, SessionNumbers, milliseconds
from interfaces.stream.limits import Bucket

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
        self._cookies = Cookies(random_bytes(32))
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
        body, rank = handshake.received(data, self._keys, Rank)
        if rank is None:
            raise PacketDropped(DropReason.AUTHENTICATION)
        asked = handshake.decode_open(body)
        if self._keys is not None and asked.rank is not rank:
            raise PacketDropped(DropReason.AUTHENTICATION)
        proven = self._cookies.good(asked, address, now)
        if not self._allowed[proven].take(now):
            raise PacketDropped(DropReason.UNEXPECTED)

        def answer(kind: PacketType, body: bytes, session: int = 0) -> list[tuple[bytes, bytes]]:
            made = Header(self._model, False, kind, 0, milliseconds(now), session, MODULUS - 1, 0)
            return [(handshake.sent(kind, body, made, self._keys, asked.rank), address)]

        if not proven:
            cookie = self._cookies.cookie(address, asked.nonce, now)
            return answer(PacketType.CHALLENGE, handshake.encode_answer(HandshakeAnswer(asked.nonce, cookie)))
        refusal = self._refusal(asked, heard, now)
        if refusal is not None:
            return answer(PacketType.REFUSED, handshake.encode_refused(asked.nonce, refusal))
        claim, over = self.pending, []
        if claim is None or claim.nonce != asked.nonce or claim.address != address:
            if claim is not None and claim.address != address:
                over = [(claim.session.make(PacketType.ENDED, b"", now), claim.address)]
            claim = self.pending = self._claim(asked, address, head.stamp)
        given = handshake.encode_answer(HandshakeAnswer(claim.nonce, claim.given))
        return [*over, *answer(PacketType.OPENED, given, claim.session.id)]

    def _refusal(self, asked: handshake.Open, heard: float | None, now: float) -> SessionRefusal | None:
        if heard is None or now - heard >= self._idle:
            return None
        if not asked.takeover:
            return SessionRefusal.BUSY
        may = self._takeover if self._keys is None else asked.rank is Rank.ADMIN
        return None if may else SessionRefusal.FORBIDDEN

    def _claim(self, asked: handshake.Open, address: bytes, stamp: int) -> SessionClaim:
        number = 0
        while not number:
            number = int.from_bytes(self._random(6), "big")
        given = self._random(TAG)
        sealer = opener = None
        if self._keys is not None:
            down, up = self._keys.session(asked.rank, asked.nonce + given, number)
            sealer, opener = Sealer(up), Opener(down)
        return SessionClaim(SessionNumbers(self._model, number, sealer, opener), address, asked.nonce, given, stamp)
