"""MCAP files, read: blocks, the summary at the end, and what a cut or damaged file still holds.

One concept, so one file: which bytes are a block is decided in the light of the whole file. A complete file has an
index, which is believed where its checksum holds. Any other file is gone through from its beginning: a block counts
where its own checksum holds, and after damage the search goes on at the next one. Record headers, message indexes
and the like have no checksums, so nothing follows from them.
"""

from __future__ import annotations

import math
import os
import stat
import struct
import zlib
from array import array
from collections import Counter, OrderedDict
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import zstandard
from numpy.typing import NDArray

from interfaces.recording.channels import CHANNELS
from interfaces.system import PLAIN_READ
from vrs.errors import FormatError
from vrs.model import Array


@dataclass(frozen=True, slots=True)
class Damage:
    """What is missing; false where nothing is."""

    cut: bool = False
    """Whether the recording wasn't closed in order: nothing is known from its last moment on."""
    until: float = 0.0
    """The last moment that's known [s]."""
    blocks: int = 0
    """Blocks of up to a quarter of a second that were destroyed, as far as they could be counted."""
    spans: tuple[tuple[float, float], ...] = ()
    """When that was [s]: between these times messages may be missing; far in the future where nothing follows."""
    marred: bool = False
    """Whether a checksum or the index is wrong although nothing is missing."""

    def __bool__(self) -> bool:
        return self.cut or self.blocks > 0

    def __str__(self) -> str:
        said = []
        if self.cut:
            said.append(f"cut: nothing is known after {self.until:.3f} s")
        if self.blocks:
            some = ", ".join(f"{first:.3f} to {last:.3f} s" for first, last in self.spans[:3])
            more = f" and {len(self.spans) - 3} more" if len(self.spans) > 3 else ""
            said.append(f"{self.blocks} block{'s' * (self.blocks > 1)} lost ({some}{more})")
        if self.marred and not said:
            said.append("a checksum or the index is wrong, but nothing is missing")
        return "; ".join(said) or "none"


class FileSource:
    """Reads a file by place; errors of the disk are errors of the format."""

    def __init__(self, path: Path) -> None:
        """Open a file.

        Raises:
            FormatError: If that can't be done.
        """
        self.where = str(path)
        try:
            self._file = os.open(path, PLAIN_READ)
        except OSError as error:
            raise FormatError(self.where, os.strerror(error.errno or 0)) from None
        self.size = 0
        """Bytes when it was looked at last."""
        try:
            self.look()
        except FormatError:
            self.close()
            raise

    def look(self) -> int:
        """How large it is now [bytes].

        Raises:
            FormatError: If it's no plain file, or is gone.
        """
        try:
            state = os.fstat(self._file)
        except OSError as error:
            raise FormatError(self.where, os.strerror(error.errno or 0)) from None
        if not stat.S_ISREG(state.st_mode):
            raise FormatError(self.where, "isn't a plain file")
        self.size = state.st_size
        return self.size

    def read(self, offset: int, length: int) -> bytes:
        """Bytes from a place on; fewer at the end of the file.

        Raises:
            FormatError: If the disk doesn't give them.
        """
        if offset < 0 or offset >= self.size:
            return b""
        length = min(length, self.size - offset)
        parts = []
        try:
            while length:
                part = os.pread(self._file, length, offset)
                if not part:
                    break
                parts.append(part)
                offset, length = offset + len(part), length - len(part)
        except OSError as error:
            raise FormatError(self.where, os.strerror(error.errno or 0)) from None
        return parts[0] if len(parts) == 1 else b"".join(parts)

    def close(self) -> None:
        """Close it; it's closed once."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1


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


def unpacked(data: bytes, zstd: zstandard.ZstdDecompressor) -> bytes | None:
    """The messages of a block, as records; None where it isn't what was written."""
    head = head_of(data)
    if head is None or head.length != len(data):
        return None
    packed = memoryview(data)[HEAD:]
    try:
        # A frame that says its size is unpacked to that size, whatever limit is given.
        if zstandard.frame_content_size(packed) != head.size:
            return None
        content: bytes = zstd.decompress(packed, max_output_size=head.size)
    except (zstandard.ZstdError, MemoryError):
        return None
    return content if len(content) == head.size and zlib.crc32(content) == head.checksum else None


def _messages(content: bytes, where: str, topics: dict[int, str] | None = None) -> list[tuple[int, int, int, int]]:
    """Number of the channel, log time, and place of the JSON of each message; topics are noted where they stand.

    Raises:
        FormatError: If a record runs over the end.
    """
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


MAGIC = b"\x89MCAP0\r\n"
MOST = 256 * 2**20
"""Bytes of an index, at most: that of a recording of five days."""
_FOOTER = struct.Struct("<BQQQI8s")
_DATA_END = struct.Struct("<BQI")
_CHUNK_INDEX = 0x08
_PLACES = struct.Struct("<QQQQI")
_PLACE = struct.Struct("<HQ")
_TAIL = struct.Struct("<QI")
_SIZES = struct.Struct("<QQ")


class Places:
    """Where the blocks of a file stand, and what they hold: a row a block."""

    def __init__(self) -> None:
        self.topics: dict[int, str] = {}
        """Topics by number of their channel, of an index."""
        self.data_end = 0
        """Where the blocks and all else before the index end."""
        self.checksum: int | None = None
        """Of all bytes up to there; None where there's none."""
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


def read_summary(source: FileSource) -> Places | None:
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
    places = _entries(data, source.where, start)
    places.data_end = start - _DATA_END.size
    kind, length, whole = _DATA_END.unpack(source.read(places.data_end, _DATA_END.size))
    places.checksum = whole if whole and (kind, length) == (DATA_END, 4) else None
    return places


def _entries(data: bytes, where: str, limit: int) -> Places:
    """Blocks and channels of an index."""
    places = Places()
    known: dict[bytes, frozenset[int]] = {}
    at, size = 0, len(data)
    try:
        while at < size:
            kind, length = RECORD.unpack_from(data, at)
            at += RECORD.size
            if at + length > size:
                raise FormatError(where, "its index has a record of an impossible length")
            if kind == _CHUNK_INDEX:
                start, end, offset, taken, channels = _PLACES.unpack_from(data, at)
                first = at + _PLACES.size
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
                places.topics[number] = topic
            at += length
    except struct.error:
        raise FormatError(where, "its index has a record that's cut off") from None
    _check(places, where, limit)
    return places


def _check(places: Places, where: str, limit: int) -> None:
    """Blocks stand one after the other, and none is too large."""
    reached = len(MAGIC)
    for offset, length, size in zip(places.offsets, places.lengths, places.sizes, strict=True):
        if offset < reached or offset + length > limit or size > LARGEST:
            raise FormatError(where, "its index has blocks that overlap, or are too large")
        reached = offset + length


WINDOW = 2**20
"""Bytes that are read at a time."""
CHECKED = 256 * 2**20
"""A file up to this size is checked as a whole when it's opened; of a larger one each block when it's read."""
CACHED = 16 * 2**20
"""Bytes of unpacked blocks that are kept."""
EXPANSION = 100
"""A file may unpack to so many times its size, and four of the largest blocks beside."""
FOREVER = 2**63
"""Past every time [ns]."""
_INDEX, _INDEXED = 15, 16
"""Bytes that a channel's index takes after a block, and more for each of its messages."""
NUMBERS = {channel.topic: number for number, channel in enumerate(CHANNELS, 1)}
"""Our numbers of the channels."""


class _Gap(NamedTuple):
    """Destroyed blocks in a file without an index."""

    place: int
    """Index of the block after them."""
    since: int
    """Latest log time before [ns]."""
    until: int
    """Latest log time of the block after them [ns]."""
    blocks: int


class Blocks:
    """The blocks of one file, in its order."""

    def __init__(self, source: FileSource) -> None:
        """Find them.

        Raises:
            FormatError: If it's no MCAP file, or one that unpacks to too much.
        """
        self._source = source
        self._places = Places()
        self._zstd = zstandard.ZstdDecompressor()
        self._held: list[NDArray[np.int64]] = [np.zeros(0, np.int64)] * (len(CHANNELS) + 1)
        self._looked = 0
        self._cache: OrderedDict[int, bytes] = OrderedDict()
        self._cached = 0
        self._unpacked = 0
        self._gaps: list[_Gap] = []
        self._newest = 0
        self._bad: set[int] = set()
        self._torn = 0
        self._marred = False
        self.complete = False
        """Whether the file was closed in order: it has an index, or the message with which a recording ends."""
        self._tail = self._expected = len(MAGIC)
        self._window = (0, b"")
        self._numbers = dict(enumerate(range(1, len(CHANNELS) + 1), 1))
        summary = read_summary(source)
        if summary is None:
            if source.read(0, len(MAGIC)) != MAGIC:
                raise FormatError(source.where, "isn't a recording: it doesn't begin as MCAP files do")
            self._marred = True
            self.grow()
        else:
            self._take(summary)

    def __len__(self) -> int:
        return len(self._places)

    def span(self, index: int) -> tuple[int, int]:
        """Earliest and latest log time of a block [ns]."""
        return self._places.starts[index], self._places.ends[index]

    def having(self, number: int, since: float = -math.inf, until: float = math.inf) -> list[int]:
        """Indexes of the blocks that have messages of a channel, and messages of a time [ns]."""
        self._sort()
        held = self._held[number]
        if since > -math.inf or until < math.inf:
            columns = self._places.starts, self._places.ends
            starts, ends = (np.frombuffer(column, np.uint64)[held] for column in columns)
            held = held[(ends >= since) & (starts <= until)]
        found: list[int] = held.tolist()
        return found

    def _sort(self) -> None:
        """Which blocks have which channels."""
        places = self._places
        if self._looked == len(places):
            return
        found: list[list[int]] = [[] for _ in range(len(CHANNELS) + 1)]
        ours: dict[frozenset[int], list[int]] = {}
        for index, channels in enumerate(places.channels[self._looked :], self._looked):
            known = ours.get(channels)
            if known is None:
                known = ours[channels] = [self._numbers[one] for one in channels if one in self._numbers]
            for number in known:
                found[number].append(index)
        self._held = [np.append(old, np.array(new, np.int64)) for old, new in zip(self._held, found, strict=True)]
        self._looked = len(places)

    def damage(self) -> Damage:
        """What is missing, as far as was looked."""
        spans = self._spans(None)
        ends = self._places.ends
        until = max((end for index, end in enumerate(ends) if index not in self._bad), default=0)
        return Damage(
            cut=not self.complete,
            until=until * 1e-9,
            blocks=len(self._bad) + sum(gap.blocks for gap in self._gaps) + self._torn,
            spans=tuple((first * 1e-9, last * 1e-9) for first, last in spans),
            marred=self._marred,
        )

    def lost(self, number: int) -> list[tuple[int, int]]:
        """Spans of log time in which messages of a channel may be missing [ns]; past the end of a cut file too."""
        found = self._spans(number)
        if not self.complete:
            found.append((self._newest, FOREVER))
        return found

    def _spans(self, number: int | None) -> list[tuple[int, int]]:
        places = self._places
        found = [(places.starts[index], places.ends[index]) for index in self._bad if self._has(index, number)]
        found += [(gap.since, gap.until) for gap in self._gaps]
        if self._torn:
            found.append((self._newest, FOREVER))
        return sorted(found)

    def _has(self, index: int, number: int | None) -> bool:
        return number is None or any(self._numbers.get(one) == number for one in self._places.channels[index])

    def breaks(self, number: int) -> Array:
        """Where messages of a channel may be missing, as places among the blocks: 2.5 is between two of them."""
        places = [float(index) for index in self._bad if self._has(index, number)]
        return np.array(sorted(places + [gap.place - 0.5 for gap in self._gaps]))

    def read(self, index: int, number: int) -> list[bytes]:
        """Messages of a channel in a block, in order, as JSON.

        Nothing, and one more lost block, if the block isn't what was written.

        Raises:
            FormatError: If its checksum holds, but it's no block.
        """
        content = self._content(index)
        if content is None:
            return []
        found = _messages(content, f"{self._source.where}, block {index + 1}")
        return [content[start:end] for channel, _, start, end in found if self._numbers.get(channel) == number]

    def _content(self, index: int) -> bytes | None:
        known = self._cache.get(index)
        if known is not None:
            self._cache.move_to_end(index)
            return known
        if index in self._bad:
            return None
        places = self._places
        content = unpacked(self._source.read(places.offsets[index], places.lengths[index]), self._zstd)
        if content is None:
            self._bad.add(index)
            return None
        self._keep(index, content)
        return content

    def _keep(self, index: int, content: bytes) -> None:
        self._cache[index] = content
        self._cached += len(content)
        while self._cached > CACHED and len(self._cache) > 1:
            self._cached -= len(self._cache.popitem(last=False)[1])

    def _take(self, places: Places) -> None:
        """The blocks that an index names; a small file is checked at once."""
        self.complete = True
        self._count(sum(places.sizes))
        self._numbers = {number: NUMBERS[topic] for number, topic in places.topics.items() if topic in NUMBERS}
        self._places = places
        self._newest = max(places.ends, default=0)
        if self._source.size <= CHECKED and not self._whole():
            self._marred = True
            for index in range(len(self)):
                self._content(index)

    def _whole(self) -> bool:
        """Whether the checksum of all that stands before the index holds."""
        checksum, end, found = self._places.checksum, self._places.data_end, 0
        if checksum is None:
            return False
        for at in range(0, end, WINDOW):
            found = zlib.crc32(self._source.read(at, min(WINDOW, end - at)), found)
        return found == checksum

    def _count(self, size: int) -> None:
        """Keep account of what was unpacked."""
        self._unpacked += size
        most = EXPANSION * self._source.size + 4 * LARGEST
        if self._unpacked > most:
            raise FormatError(self._source.where, f"it unpacks to more than {most} bytes")

    def grow(self) -> bool:
        """Look for blocks after the last one that's known.

        Returns:
            Whether there are more.

        Raises:
            FormatError: If there's too much in them.
        """
        self._source.look()
        before = len(self)
        while self._block_at(self._expected) or self._resynchronised():
            pass
        return len(self) > before

    def _resynchronised(self) -> bool:
        """Find the next block whose checksum holds, past what is destroyed."""
        self._torn, at = 0, self._tail
        while (found := self._marked(at)) is not None:
            if self._block_at(found):
                return True
            at = found + 1
        return False

    def _marked(self, at: int) -> int | None:
        """The first place from one on where a block may begin."""
        at += MARK_AT
        while at < self._source.size:
            window = self._source.read(at, WINDOW)
            found = window.find(MARK)
            if found >= 0:
                return at + found - MARK_AT
            at += max(len(window) - len(MARK) + 1, 1)
        return None

    def _block_at(self, at: int) -> bool:
        """Take the block at a place, if there's one."""
        head = head_of(self._ahead(at, HEAD))
        if head is None or at + head.length > self._source.size:
            return False
        self._count(head.size + head.length)
        content = unpacked(self._ahead(at, head.length), self._zstd)
        if content is None:
            self._torn += 1
            return False
        topics: dict[int, str] = {}
        found = _messages(content, f"{self._source.where}, at byte {at}", topics)
        counts = Counter(channel for channel, *_ in found)
        times = [log_time for _, log_time, *_ in found] or [0]
        self._numbers |= {number: NUMBERS[topic] for number, topic in topics.items() if topic in NUMBERS}
        follows = at in (self._tail, self._expected) if len(self) else bool(topics)
        if not follows:
            until = max(self._newest, *times)
            self._gaps.append(_Gap(len(self), self._newest, until, max(self._torn, 1)))
        self._places.add(at, head.length, min(times), max(times), head.size, frozenset(counts))
        self._newest = max(self._newest, *times)
        self._tail = at + head.length
        self._expected = self._tail + sum(_INDEX + _INDEXED * count for count in counts.values())
        self._torn = 0
        return True

    def _ahead(self, at: int, length: int) -> bytes:
        """Bytes of the file, of which more are read than asked for."""
        origin, window = self._window
        if at < origin or at + length > origin + len(window):
            origin, window = self._window = at, self._source.read(at, max(length, WINDOW))
        return window[at - origin : at - origin + length]
