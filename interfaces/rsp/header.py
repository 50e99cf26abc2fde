"""The header of every packet, 20 bytes in network order.

Source: Kim, Suh, Kim, Oh, Table II; the paper leaves the byte order and the values of the fields open.
"""

from __future__ import annotations

import enum
import struct
from typing import Final, NamedTuple

from interfaces.rsp.errors import PacketError

MODULUS = 1 << 16
"""Numbers on the wire are counted modulo this."""
HALF = MODULUS // 2
STAMPS = 1 << 32
"""Stamps on the wire are counted modulo this."""


def unwrapped(number: int, near: int, modulus: int = MODULUS) -> int:
    """The number nearest to another one that is the same on the wire; of two as near, the later.

    Args:
        number: From the wire, 0 to `modulus` − 1.
        near: A number without end, not far from it.
        modulus: What numbers are counted modulo; even.
    """
    ahead = (number - near) % modulus
    return near + ahead if ahead <= modulus // 2 else near + ahead - modulus


def up_to(number: int, newest: int) -> int:
    """The latest number up to the newest one that is the same on the wire as another."""
    return newest - (newest - number) % MODULUS


VERSION: Final = 1
"""Of this protocol."""
_FORMAT: Final = struct.Struct("!BHBBHIHIHB")
SIZE: Final = _FORMAT.size
"""Of the header [byte]."""
LONGEST: Final = 65_507
"""Of a packet [byte]: what UDP over IPv4 carries."""


class PacketType(enum.IntEnum):
    """What a packet carries."""

    DOWN = 1
    """Devices, from the local system to the robot."""
    UP = 2
    """Devices, from the robot to the local system."""
    OPEN = 3
    """The local system asks for a session."""
    CHALLENGE = 4
    """The robot asks whether somebody really is at the address that asked."""
    OPENED = 5
    """The robot gives a session."""
    REFUSED = 6
    """The robot gives none; one byte says why."""
    END = 7
    """The local system ends the session; repeated until ENDED comes."""
    ENDED = 8
    """The robot acknowledges the end."""


class Header(NamedTuple):
    """What stands before the device map."""

    model: int
    """Model ID, of the robot, 0 to 65535."""
    encrypted: bool
    type: PacketType
    number: int
    """Sequence number of this packet, modulo 65536, from 0."""
    stamp: int
    """When it was made, on the sender's clock [ms], modulo 2³²."""
    session: int
    """Session ID, 48 bits; 0 before there's one."""
    last: int
    """Last received sequence number; 65535 before the first."""
    buffers: int
    """Down: how often the data buffer was cleared, modulo 256. Up: number of free buffers, 255 at most."""


_TYPES: Final = {int(kind): kind for kind in PacketType}


def encode(header: Header) -> bytes:
    """The header as 20 bytes; its values are trusted."""
    model, encrypted, kind, number, stamp, session, last, buffers = header
    return _FORMAT.pack(
        VERSION, model, encrypted, kind, number, stamp, session >> 32, session & 0xFFFFFFFF, last, buffers
    )


def decode(data: bytes) -> Header:
    """Read the header of a packet.

    Raises:
        PacketError: If it's too short or too long, of another version, or a field holds what it can't.
    """
    if not SIZE <= len(data) <= LONGEST:
        raise PacketError("its length")
    version, model, encrypted, kind, number, stamp, high, low, last, buffers = _FORMAT.unpack_from(data)
    if version != VERSION:
        raise PacketError("its version")
    if encrypted > 1:
        raise PacketError("its encryption flag")
    known = _TYPES.get(kind)
    if known is None:
        raise PacketError("its type")
    return Header(model, encrypted == 1, known, number, stamp, high << 32 | low, last, buffers)
