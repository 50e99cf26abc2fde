"""What both sides of a session do with every packet: numbers, stamps, sealing, and what is dropped."""

from __future__ import annotations

import enum
from typing import Final

from interfaces.rsp import header
from interfaces.rsp.header import Header, PacketType
from interfaces.rsp.numbers import MODULUS, unwrapped, up_to
from interfaces.rsp.security import NotAuthenticError, Opener, ReplayError, Sealer

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

    def __init__(
        self, model: int, session: int, sealer: Sealer | None = None, opener: Opener | None = None
    ) -> None:
        """Begin with number 0, sealed if there are a sealer and an opener."""
        self.id = session
        self.sealed = sealer is not None
        self._model, self._sealer, self._opener = model, sealer, opener
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
                self._model,
                self.sealed,
                kind,
                number % MODULUS,
                milliseconds(now),
                self.id,
                self.newest % MODULUS,
                buffers,
            )
        )
        return head + body if self._sealer is None else self._sealer.seal(head, body, number)

    def take(self, head: Header, data: bytes) -> tuple[bytes, int]:
        """The body of a packet that came, and its number, if it's newer than all before.

        It counts as received once `newest` is set to that number: not before its body was understood.

        Raises:
            Dropped: If it isn't, or isn't authentic.
        """
        if self._opener is None:
            number, body = unwrapped(head.number, self.newest), data[header.SIZE :]
        else:
            try:
                body, number = self._opener.open(data)
            except NotAuthenticError:
                raise PacketDropped(DropReason.AUTHENTICATION) from None
            except ReplayError:
                raise PacketDropped(DropReason.REPLAY) from None
            if number % MODULUS != head.number:
                raise PacketDropped(DropReason.MALFORMED)
        if number <= self.newest:
            raise PacketDropped(DropReason.LATE)
        return body, number

    def acknowledged(self, head: Header) -> int:
        """The newest of our packets that the other side says it has, without end; −1 for none."""
        return max(up_to(head.last, self.number - 1), -1)
