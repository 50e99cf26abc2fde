"""The scanner's serial frame: 11 bytes around two for each beam, 733 for 361 beams.

    06                     the request was understood
    02                     a telegram begins
    80                     it's from the scanner
    length                 of what follows, without the checksum: 2 bytes a beam and 4 more
    B0                     measured values
    count                  beams in the low 14 bits; the two high ones say the unit, 01 for millimetres
    ranges                 13 bits each [mm], 1FFF where nothing came back
    status                 00: all is well
    checksum               CRC-16 with polynomial 8005 from the telegram's first byte on

Numbers of two bytes have the low byte first. The paper gives the length of the frame alone; this is the layout of
the scanners of its time that has this length.

Source: Kim, Han, Kim, Kim 2002, section 2.1.
"""

from __future__ import annotations

import struct
from typing import Final

import numpy as np

from robots.onboard.laser import STEPS_DEG
from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array, frozen_array

OVERHEAD: Final = 11
"""Bytes of a frame beside its ranges."""
BEAMS: Final = tuple(round(180 / step) + 1 for step in STEPS_DEG)
"""How many beams a frame can have."""
NOTHING: Final = 0x1FFF
"""Stands for a beam that brought nothing."""
_ACK, _STX, _ADDRESS, _VALUES, _MILLIMETRES = 0x06, 0x02, 0x80, 0xB0, 0x4000
_COUNT, _RANGE = 0x3FFF, 0x1FFF
_HEAD = struct.Struct("<BBBHBH")
_TAIL = struct.Struct("<BH")
_POLYNOMIAL = 0x8005
_WHERE = "laser frame"


def checksum(data: bytes) -> int:
    """CRC-16 of some bytes, each taken in with the one before it in the high half."""
    value = before = 0
    for byte in data:
        value = ((value & 0x7FFF) << 1) ^ (_POLYNOMIAL if value & 0x8000 else 0)
        value ^= before << 8 | byte
        before = byte
    return value


def encode_scan(ranges: Array) -> bytes:
    """Make a frame.

    Args:
        ranges: [m], (181,), (361,) or (721,), inf where nothing came back.

    Raises:
        InvalidValueError: If there are others than so many, or one isn't in [0, 8.19].
    """
    ranges = np.asarray(ranges, dtype=np.float64)
    if ranges.shape not in {(n,) for n in BEAMS}:
        raise InvalidValueError("ranges", ranges.shape, f"of {', '.join(map(str, sorted(BEAMS)))} beams")
    seen = ranges != np.inf
    if not ((ranges[seen] >= 0) & (ranges[seen] < NOTHING / 1000 - 5e-4)).all():
        raise InvalidValueError("ranges", ranges, "in [0, 8.19] m, or inf")
    millimetres = np.where(seen, np.round(1000 * np.where(seen, ranges, 0.0)), NOTHING).astype("<u2").tobytes()
    head = _HEAD.pack(_ACK, _STX, _ADDRESS, len(millimetres) + 4, _VALUES, len(ranges) | _MILLIMETRES)
    telegram = head[1:] + millimetres + b"\x00"
    return head[:1] + telegram + struct.pack("<H", checksum(telegram))


def decode_scan(frame: bytes) -> Array:
    """Read a whole frame.

    Returns:
        Ranges [m], inf where nothing came back.

    Raises:
        FormatError: If it isn't one.
    """
    if len(frame) < OVERHEAD:
        raise FormatError(_WHERE, f"{len(frame)} bytes; it has {OVERHEAD} at least")
    ack, stx, address, length, kind, count = _HEAD.unpack_from(frame)
    if (ack, stx, address, kind) != (_ACK, _STX, _ADDRESS, _VALUES) or count & ~_COUNT != _MILLIMETRES:
        raise FormatError(_WHERE, "doesn't begin as one in millimetres")
    beams = count & _COUNT
    if beams not in BEAMS or length != 2 * beams + 4 or len(frame) != 2 * beams + OVERHEAD:
        raise FormatError(_WHERE, f"{beams} beams in {len(frame)} bytes")
    status, told = _TAIL.unpack_from(frame, len(frame) - _TAIL.size)
    if told != checksum(frame[1:-2]):
        raise FormatError(_WHERE, "wrong checksum")
    if status:
        raise FormatError(_WHERE, f"the scanner says that something is wrong with it: status {status}")
    millimetres = np.frombuffer(frame, dtype="<u2", count=beams, offset=_HEAD.size) & _RANGE
    return frozen_array(np.where(millimetres == NOTHING, np.inf, millimetres / 1000))


class FrameReader:
    """Finds frames in a stream of bytes, whatever is between them."""

    def __init__(self) -> None:
        """Wait for the first."""
        self._buffer = bytearray()

    def receive(self, data: bytes) -> list[Array]:
        """Take some bytes; returns the ranges [m] of the frames that are whole now."""
        self._buffer += data
        found: list[Array] = []
        while (start := self._buffer.find(bytes((_ACK, _STX, _ADDRESS)))) >= 0:
            del self._buffer[:start]
            size = self._size()
            if size is None:
                return found
            if len(self._buffer) < size:
                return found
            try:
                found.append(decode_scan(bytes(self._buffer[:size])))
            except FormatError:
                size = 1
            del self._buffer[:size]
        # The last two bytes may be the beginning of a frame.
        del self._buffer[:-2]
        return found

    def _size(self) -> int | None:
        """Length of the frame at the buffer's start; 1 if it can't be one, None if that can't be said yet."""
        if len(self._buffer) < _HEAD.size:
            return None
        beams = _HEAD.unpack_from(self._buffer)[-1] & _COUNT
        return 2 * beams + OVERHEAD if beams in BEAMS else 1
