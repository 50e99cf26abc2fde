"""The blocks of a file, complete or cut, and what is missing of them.

A complete file has an index, which is believed where its checksum holds. Any other file is gone through from its
beginning: a block counts where its own checksum holds, and after damage the search goes on at the next one. Record
headers, message indexes and the like have no checksums, so nothing follows from them.
"""

from __future__ import annotations

import math
import zlib
from collections import OrderedDict
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from interfaces.recording.block import HEAD, LARGEST, MARK, MARK_AT, Unpacker, contents, head_of, messages
from interfaces.recording.channels import CHANNELS
from interfaces.recording.damage import Damage
from interfaces.recording.source import FileSource
from interfaces.recording.summary import MAGIC, Places, Summary, read_summary
from vrs.errors import FormatError
from vrs.model import Array

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
        self._unpacker = Unpacker()
        self._held: list[NDArray[np.int64]] = [np.zeros(0, np.int64)] * (len(CHANNELS) + 1)
        self._looked = 0
        self._cache: OrderedDict[int, bytes] = OrderedDict()
        self._cached = 0
        self._unpacked = 0
        self._gaps: list[_Gap] = []
        self._newest = 0
        self._bad: set[int] = set()
        self._torn = 0
        self._marred = self._ended = False
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

    @property
    def complete(self) -> bool:
        """Whether the file was closed in order."""
        return self._ended

    def ended(self) -> None:
        """Take note that the message was found with which a recording ends."""
        self._ended = True

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
            cut=not self._ended,
            until=until * 1e-9,
            blocks=len(self._bad) + sum(gap.blocks for gap in self._gaps) + self._torn,
            spans=tuple((first * 1e-9, last * 1e-9) for first, last in spans),
            marred=self._marred,
        )

    def lost(self, number: int) -> list[tuple[int, int]]:
        """Spans of log time in which messages of a channel may be missing [ns]; past the end of a cut file too."""
        found = self._spans(number)
        if not self._ended:
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
        wanted = [theirs for theirs, ours in self._numbers.items() if ours == number]
        return messages(content, wanted, f"{self._source.where}, block {index + 1}")

    def _content(self, index: int) -> bytes | None:
        known = self._cache.get(index)
        if known is not None:
            self._cache.move_to_end(index)
            return known
        if index in self._bad:
            return None
        places = self._places
        content = self._unpacker.unpacked(self._source.read(places.offsets[index], places.lengths[index]))
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

    def _take(self, summary: Summary) -> None:
        """The blocks that an index names; a small file is checked at once."""
        self._ended = True
        self._count(sum(summary.places.sizes))
        self._numbers = {number: NUMBERS[topic] for number, topic in summary.topics.items() if topic in NUMBERS}
        self._places = summary.places
        self._newest = max(summary.places.ends, default=0)
        if self._source.size <= CHECKED and not self._whole(summary):
            self._marred = True
            for index in range(len(self)):
                self._content(index)

    def _whole(self, summary: Summary) -> bool:
        """Whether the checksum of all that stands before the index holds."""
        if summary.checksum is None:
            return False
        found = 0
        for at in range(0, summary.data_end, WINDOW):
            found = zlib.crc32(self._source.read(at, min(WINDOW, summary.data_end - at)), found)
        return found == summary.checksum

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
        content = self._unpacker.unpacked(self._ahead(at, head.length))
        if content is None:
            self._torn += 1
            return False
        known = contents(content, f"{self._source.where}, at byte {at}")
        self._numbers |= {number: NUMBERS[topic] for number, topic in known.topics.items() if topic in NUMBERS}
        follows = at in (self._tail, self._expected) if len(self) else bool(known.topics)
        if not follows:
            until = max(self._newest, known.end)
            self._gaps.append(_Gap(len(self), self._newest, until, max(self._torn, 1)))
        self._places.add(at, head.length, known.start, known.end, head.size, frozenset(known.counts))
        self._newest = max(self._newest, known.end)
        self._tail = at + head.length
        self._expected = self._tail + sum(_INDEX + _INDEXED * count for count in known.counts.values())
        self._torn = 0
        return True

    def _ahead(self, at: int, length: int) -> bytes:
        """Bytes of the file, of which more are read than asked for."""
        origin, window = self._window
        if at < origin or at + length > origin + len(window):
            origin, window = self._window = at, self._source.read(at, max(length, WINDOW))
        return window[at - origin : at - origin + length]
