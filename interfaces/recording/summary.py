"""The index at the end of a complete recording: believed only where its checksum holds."""

from __future__ import annotations

import struct
import zlib
from array import array
from dataclasses import dataclass

from interfaces.recording.block import CHANNEL, DATA_END, LARGEST, RECORD, channel_of
from interfaces.recording.source import FileSource
from vrs.errors import FormatError

MAGIC = b"\x89MCAP0\r\n"
MOST = 256 * 2**20
"""Bytes of an index, at most: that of a recording of five days."""
_FOOTER = struct.Struct("<BQQQI8s")
_DATA_END = struct.Struct("<BQI")
_CHUNK_INDEX = 0x08
_INDEX = struct.Struct("<QQQQI")
_PLACE = struct.Struct("<HQ")
_TAIL = struct.Struct("<QI")
_SIZES = struct.Struct("<QQ")


class Places:
    """Where the blocks of a file stand, and what they hold: a row a block."""

    def __init__(self) -> None:
        self.offsets, self.lengths = array("Q"), array("Q")
        self.starts, self.ends = array("Q"), array("Q")
        """Earliest and latest log time [ns]."""
        self.sizes = array("Q")
        """Bytes unpacked."""
        self.channels: list[frozenset[int]] = []
        """Numbers in the file of the channels that a block has messages of."""

    def __len__(self) -> int:
        return len(self.offsets)

    def add(self, offset: int, length: int, start: int, end: int, size: int, channels: frozenset[int]) -> None:
        """Add a block."""
        self.offsets.append(offset)
        self.lengths.append(length)
        self.starts.append(start)
        self.ends.append(end)
        self.sizes.append(size)
        self.channels.append(channels)


@dataclass(frozen=True, slots=True)
class Summary:
    """What the index says."""

    places: Places
    """Blocks, in the order of the file."""
    topics: dict[int, str]
    """Topics by number of their channel."""
    data_end: int
    """Where the blocks and all else before the index end."""
    checksum: int | None
    """Of all bytes up to there; None where there's none."""


def read_summary(source: FileSource) -> Summary | None:
    """Read the index of a file.

    Returns:
        None where there's no index, or its checksum doesn't hold.

    Raises:
        FormatError: If it holds, and says what can't be.
    """
    size = source.size
    if size < 2 * len(MAGIC) + _FOOTER.size + _DATA_END.size:
        return None
    footer = source.read(size - _FOOTER.size, _FOOTER.size)
    if len(footer) < _FOOTER.size:
        return None
    kind, length, start, _, checksum, magic = _FOOTER.unpack(footer)
    end = size - _FOOTER.size
    if magic != MAGIC or (kind, length) != (0x02, 20) or not len(MAGIC) + _DATA_END.size <= start <= end:
        return None
    if end - start > MOST:
        raise FormatError(source.where, f"its index takes {end - start} bytes, more than {MOST}")
    data = source.read(start, end - start)
    if len(data) < end - start or not checksum or zlib.crc32(footer[:25], zlib.crc32(data)) != checksum:
        return None
    places, topics = _entries(data, source.where, start)
    kind, length, whole = _DATA_END.unpack(source.read(start - _DATA_END.size, _DATA_END.size))
    known = (kind, length) == (DATA_END, 4)
    return Summary(places, topics, start - _DATA_END.size, whole if known and whole else None)


def _entries(data: bytes, where: str, limit: int) -> tuple[Places, dict[int, str]]:
    """Blocks and channels of an index."""
    places = Places()
    topics: dict[int, str] = {}
    known: dict[bytes, frozenset[int]] = {}
    at, size = 0, len(data)
    try:
        while at < size:
            kind, length = RECORD.unpack_from(data, at)
            at += RECORD.size
            if at + length > size:
                raise FormatError(where, "its index has a record of an impossible length")
            if kind == _CHUNK_INDEX:
                start, end, offset, taken, channels = _INDEX.unpack_from(data, at)
                first = at + _INDEX.size
                after = first + channels
                # Of each channel two bytes of number and eight of a place.
                names = data[first:after:10] + data[first + 1 : after : 10]
                held = known.get(names)
                if held is None:
                    held = known[names] = frozenset(number for number, _ in _PLACE.iter_unpack(data[first:after]))
                _, compression = _TAIL.unpack_from(data, after)
                _, unpacked = _SIZES.unpack_from(data, after + _TAIL.size + compression)
                places.add(offset, taken, start, end, unpacked, held)
            elif kind == CHANNEL:
                number, topic = channel_of(data[at : at + length], where)
                topics[number] = topic
            at += length
    except struct.error:
        raise FormatError(where, "its index has a record that's cut off") from None
    _check(places, where, limit)
    return places, topics


def _check(places: Places, where: str, limit: int) -> None:
    """Blocks stand one after the other, and none is too large."""
    reached = len(MAGIC)
    for offset, length, size in zip(places.offsets, places.lengths, places.sizes, strict=True):
        if offset < reached or offset + length > limit or size > LARGEST:
            raise FormatError(where, "its index has blocks that overlap, or are too large")
        reached = offset + length
