"""One block of a recording, an MCAP chunk: it counts only where its checksum holds, and no larger than a limit."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Container, Mapping
from typing import NamedTuple

import zstandard

from vrs.errors import FormatError

LARGEST = 16 * 2**20
"""Bytes of a block's messages, at most."""
LONGEST = 8 * 2**20
"""Bytes of a message, at most."""
CHUNK, MESSAGE, CHANNEL, MESSAGE_INDEX, DATA_END = 0x06, 0x05, 0x04, 0x07, 0x0F
RECORD = struct.Struct("<BQ")
"""Kind and length of a record."""
MARK = b"\x04\x00\x00\x00zstd"
"""What stands in every block's head."""
MARK_AT = 37
"""Where the mark begins in a block."""
_HEAD = struct.Struct("<BQQQQI8sQ")
"""Kind, length, times, length of the messages, their checksum, mark, length when packed."""
HEAD = _HEAD.size
_MESSAGE = struct.Struct("<BQHIQQ")


class Head(NamedTuple):
    """Where a block ends, and how large it is unpacked: nothing of it is protected, so it's but a claim."""

    length: int
    """Bytes of the record in the file."""
    size: int
    """Bytes unpacked."""
    checksum: int


def head_of(data: bytes) -> Head | None:
    """What a block's first bytes say; None where they can't be a block's."""
    if len(data) < HEAD:
        return None
    kind, length, _, _, size, checksum, mark, packed = _HEAD.unpack_from(data)
    if kind != CHUNK or mark != MARK or length != packed + HEAD - RECORD.size or size > LARGEST:
        return None
    return Head(RECORD.size + length, size, checksum)


class Unpacker:
    """Unpacks blocks; for one thread at a time."""

    def __init__(self) -> None:
        self._zstd = zstandard.ZstdDecompressor()

    def unpacked(self, data: bytes) -> bytes | None:
        """The messages of a block, as records; None where it isn't what was written."""
        head = head_of(data)
        if head is None or head.length != len(data):
            return None
        packed = memoryview(data)[HEAD:]
        try:
            # A frame that says its size is unpacked to that size, whatever limit is given.
            if zstandard.frame_content_size(packed) != head.size:
                return None
            content: bytes = self._zstd.decompress(packed, max_output_size=head.size)
        except (zstandard.ZstdError, MemoryError):
            return None
        return content if len(content) == head.size and zlib.crc32(content) == head.checksum else None


def messages(content: bytes, wanted: Container[int], where: str) -> list[bytes]:
    """The messages of some channels in a block, in order, as they were written.

    Args:
        content: As `Unpacker` gave it.
        wanted: Numbers of the channels in the file.
        where: What to call it in an error.

    Raises:
        FormatError: If a record runs over the end.
    """
    return [content[start:end] for channel, _, start, end in _messages(content, where) if channel in wanted]


class Contents(NamedTuple):
    """What a block holds, without reading the messages."""

    start: int
    """Earliest log time [ns]."""
    end: int
    """Latest log time [ns]."""
    counts: Mapping[int, int]
    """Messages by the channel's number in the file."""
    topics: dict[int, str]
    """Topics by number that the block introduces."""


def contents(content: bytes, where: str) -> Contents:
    """Look through a block.

    Raises:
        FormatError: If a record is none.
    """
    topics: dict[int, str] = {}
    times, counts = [], Counter[int]()
    for channel, log_time, _, _ in _messages(content, where, topics):
        times.append(log_time)
        counts[channel] += 1
    return Contents(min(times, default=0), max(times, default=0), counts, topics)


def _messages(content: bytes, where: str, topics: dict[int, str] | None = None) -> list[tuple[int, int, int, int]]:
    """Number of the channel, log time, and place of the JSON of each message; topics are noted where they stand."""
    at, size, last = 0, len(content), len(content) - _MESSAGE.size
    short, message, read = RECORD.size, _MESSAGE.size, _MESSAGE.unpack_from
    found = []
    while at < size:
        if at <= last:
            kind, length, channel, _, log_time, _ = read(content, at)
        elif size - at >= short:
            kind, length = RECORD.unpack_from(content, at)
        else:
            raise FormatError(where, "a record is cut off")
        end = at + short + length
        if end > size or (kind == MESSAGE and end < at + message):
            raise FormatError(where, "a record has an impossible length")
        if kind == MESSAGE:
            found.append((channel, log_time, at + message, end))
        elif kind == CHANNEL and topics is not None:
            number, topic = channel_of(content[at + short : end], where)
            topics[number] = topic
        at = end
    return found


def channel_of(record: bytes, where: str) -> tuple[int, str]:
    """Number and topic of a channel, from its record.

    Raises:
        FormatError: If it's none.
    """
    if len(record) < 8:
        raise FormatError(where, "a channel is cut off")
    number, _, length = struct.unpack_from("<HHI", record)
    if 8 + length > len(record):
        raise FormatError(where, "a channel is cut off")
    return number, record[8 : 8 + length].decode("utf-8", "replace")
