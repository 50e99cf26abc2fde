"""MCAP files, written: headers, channels, compressed blocks and their index, into a file that can fail."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path
from typing import Protocol

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    MessageIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from interfaces.recording.mcap_reading import MAGIC, MESSAGE
from vrs.errors import VrsError


class RecordingError(VrsError):
    """What was to be recorded can't be written any more: a full disk, a file taken away, a wrong order of calls."""

    def __init__(self, where: str, problem: str) -> None:
        self.where, self.problem = where, problem
        super().__init__(f"recording failed: {where}: {problem}")


class RawFile(Protocol):
    """An unbuffered file: it may take less than it's given."""

    def write(self, data: bytes | memoryview, /) -> int | None:
        """Write some of the bytes; how many, or None for none."""

    def close(self) -> None:
        """Close the file."""


def _owners(name: str, flags: int) -> int:
    """Open a file that nobody but its owner may read, where it's made."""
    return os.open(name, flags, 0o600)


class Sink:
    """Writes all of its input, in order; after the first failure nothing more.

    A full disk shows first as a short write without an exception: the rest is tried again, and then it raises.
    """

    def __init__(self, file: RawFile, where: str) -> None:
        """Write to a raw file.

        Args:
            file: Unbuffered.
            where: What to call it in messages.
        """
        self._file = file
        self.where = where
        self.size = 0
        """Bytes that the file took."""
        self._failed = False

    @classmethod
    def create(cls, path: Path, *, over: bool = True) -> Sink:
        """Make a file, mode 0600, or take the place of an old one where that's allowed, whose mode it keeps.

        Raises:
            RecordingError: If that can't be done.
        """
        try:
            made = open(path, "wb" if over else "xb", buffering=0, opener=_owners)  # noqa: SIM115
            return cls(made, str(path))
        except FileExistsError:
            raise RecordingError(str(path), "it's there already: none is written over") from None
        except OSError as error:
            raise RecordingError(str(path), os.strerror(error.errno or 0)) from error

    def write(self, data: bytes) -> None:
        """Write everything.

        Raises:
            RecordingError: If the file doesn't take it all; what it took stays.
        """
        if self._failed:
            raise RecordingError(self.where, "it failed before")
        rest = memoryview(data)
        while rest:
            try:
                taken = self._file.write(rest)
            except (OSError, ValueError) as error:
                self._failed = True
                problem = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
                raise RecordingError(self.where, problem) from error
            if not taken:
                self._failed = True
                raise RecordingError(self.where, f"it takes no more after {self.size} bytes")
            self.size += taken
            rest = rest[taken:]

    def close(self) -> None:
        """Close the file.

        Raises:
            RecordingError: If its last bytes didn't get there.
        """
        try:
            self._file.close()
        except OSError as error:
            raise RecordingError(self.where, os.strerror(error.errno or 0)) from error


_MESSAGE = struct.Struct("<BQHIQQ")
_FOOTER = struct.Struct("<BQQQ")
_PARAMETERS = zstandard.ZstdCompressionParameters(
    strategy=zstandard.STRATEGY_LAZY2, min_match=6, hash_log=15, chain_log=15, search_log=6, window_log=17
)


def _bytes(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return _taken(builder)


def _taken(builder: RecordBuilder) -> bytes:
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data


class _MessageBlock:
    """Messages that wait to be written together."""

    def __init__(self) -> None:
        self.records = bytearray()
        self.indexes: dict[int, MessageIndex] = {}
        self.first, self.last = 2**64 - 1, 0
        """Earliest and latest log time [ns]."""

    def add(self, channel: int, log_time: int, data: bytes) -> None:
        index = self.indexes.get(channel)
        if index is None:
            index = self.indexes[channel] = MessageIndex(channel, [])
        index.records.append((log_time, len(self.records)))
        self.first, self.last = min(self.first, log_time), max(self.last, log_time)
        # Kind, length, channel, number, both times.
        self.records += _MESSAGE.pack(MESSAGE, 22 + len(data), channel, 0, log_time, log_time)
        self.records += data


class McapFile:
    """A file in blocks, each with an index of its messages, and an index of all at the end.

    Channels with few messages share a block, and the others share one: who reads the few needn't unpack the many.
    """

    def __init__(self, sink: Sink, profile: str, library: str) -> None:
        """Begin a file.

        Raises:
            RecordingError: If the sink doesn't take it.
        """
        self._sink = sink
        self._checksum = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._compressor = zstandard.ZstdCompressor(compression_params=_PARAMETERS)
        self._few, self._many = _MessageBlock(), _MessageBlock()
        self._open: dict[int, bool] = {}
        self._places = bytearray()
        self._counts: dict[int, int] = {}
        self._first, self._last = 2**64 - 1, 0
        self.blocks = 0
        """Blocks in the file."""
        self._put(MAGIC + _bytes(Header(profile, library)))

    @property
    def size(self) -> int:
        """Bytes of messages that wait."""
        return len(self._few.records) + len(self._many.records)

    def add_channel(
        self, number: int, topic: str, schema: str, json_schema: bytes, *, many: bool, beside: bool = False
    ) -> None:
        """Add a channel of JSON messages.

        Args:
            number: That no other has, from 1.
            topic: Of the channel.
            schema: Name of the schema.
            json_schema: The schema.
            many: Whether it has many messages.
            beside: Whether it's told where its own messages stand, whose first comes next; else among the few.
        """
        told = self._many if many and beside else self._few
        named = next((known for known in self._schemas if known.name == schema), None)
        if named is None:
            named = Schema(id=len(self._schemas) + 1, data=json_schema, encoding="jsonschema", name=schema)
            self._schemas.append(named)
            told.records += _bytes(named)
        channel = Channel(id=number, topic=topic, message_encoding="json", metadata={}, schema_id=named.id)
        self._channels.append(channel)
        told.records += _bytes(channel)
        self._open[number] = many

    def add(self, channel: int, log_time: int, data: bytes) -> None:
        """Add a message, at a time [ns]."""
        (self._many if self._open[channel] else self._few).add(channel, log_time, data)

    def flush(self) -> None:
        """Write what waits.

        Raises:
            RecordingError: If the sink doesn't take it.
        """
        few, many = self._few, self._many
        self._few, self._many = _MessageBlock(), _MessageBlock()
        data = b""
        for block in (few, many):
            if block.indexes:
                data += self._packed(block, self._sink.size + len(data))
        if data:
            self._put(data)

    def _packed(self, block: _MessageBlock, at: int) -> bytes:
        """A block as it stands in the file from a byte on, with its index."""
        records = bytes(block.records)
        packed = self._compressor.compress(records)
        chunk = Chunk(
            compression="zstd",
            data=packed,
            message_start_time=block.first,
            message_end_time=block.last,
            uncompressed_crc=zlib.crc32(records),
            uncompressed_size=len(records),
        )
        data = _bytes(chunk)
        builder, offsets = RecordBuilder(), {}
        for number, index in block.indexes.items():
            offsets[number] = at + len(data) + builder.count
            index.write(builder)
            self._counts[number] = self._counts.get(number, 0) + len(index.records)
        indexes = _taken(builder)
        self._places += _bytes(
            ChunkIndex(
                message_start_time=block.first,
                message_end_time=block.last,
                chunk_start_offset=at,
                chunk_length=len(data),
                message_index_offsets=offsets,
                message_index_length=len(indexes),
                compression="zstd",
                compressed_size=len(packed),
                uncompressed_size=len(records),
            )
        )
        self._first, self._last = min(self._first, block.first), max(self._last, block.last)
        self.blocks += 1
        return data + indexes

    def finish(self) -> None:
        """Write what waits, and the index of all.

        Raises:
            RecordingError: If the sink doesn't take it.
        """
        self.flush()
        self._put(_bytes(DataEnd(self._checksum)))
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=self.blocks,
            message_count=sum(self._counts.values()),
            message_end_time=self._last,
            message_start_time=min(self._first, self._last),
            metadata_count=0,
            schema_count=len(self._schemas),
        )
        groups = (
            (Opcode.SCHEMA, _bytes(*self._schemas)),
            (Opcode.CHANNEL, _bytes(*self._channels)),
            (Opcode.STATISTICS, _bytes(statistics)),
            (Opcode.CHUNK_INDEX, bytes(self._places)),
        )
        start = at = self._sink.size
        offsets = []
        for kind, group in groups:
            offsets.append(SummaryOffset(kind, at, len(group)))
            at += len(group)
        summary = b"".join(group for _, group in groups) + _bytes(*offsets)
        footer = _FOOTER.pack(Opcode.FOOTER, 20, start, at)
        checksum = zlib.crc32(footer, zlib.crc32(summary))
        self._put(summary + _bytes(Footer(start, at, checksum)) + MAGIC)

    def _put(self, data: bytes) -> None:
        self._checksum = zlib.crc32(data, self._checksum)
        self._sink.write(data)
