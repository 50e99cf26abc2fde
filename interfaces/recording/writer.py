"""Recordings as they're written: MCAP in small blocks, each readable as soon as it's in the file."""

from __future__ import annotations

import contextlib
from pathlib import Path

import msgspec

from interfaces.messages.fields import plain
from interfaces.messages.recording import FORMAT, Begin, End, SegmentedEntry
from interfaces.recording.channels import CHANNELS, NUMBER_OF, Kinds, Message
from interfaces.recording.mcap_file import McapFile, RawFile, RecordingError, Sink
from interfaces.recording.mcap_reading import LONGEST
from interfaces.recording.poses import nanoseconds
from vrs.errors import InvalidValueError

FLUSH = 0.25
"""A block is closed when its messages span so long [s]."""
LARGE = 2**20
"""A block is closed when its messages are so many bytes."""
AGAIN = 10.0
"""How often the beginning is repeated [s]."""


_encode = msgspec.json.Encoder(enc_hook=plain).encode
_SEGMENTED = frozenset(kind for kind in NUMBER_OF if issubclass(kind, SegmentedEntry))


class RecordingWriter:
    """Writes one recording; it reads no clock, so that the laboratory's files are the same bytes for a seed."""

    def __init__(self, file: Sink | RawFile | Path, session: Begin, *, flush: float = FLUSH) -> None:
        """Begin a recording: the beginning is in the file when this returns.

        Args:
            file: Where to; a path is made anew.
            session: How the run is set up.
            flush: Longest span of a block [s].

        Raises:
            RecordingError: If the file doesn't take it.
        """
        if isinstance(file, Path):
            file = Sink.create(file)
        self._sink = file if isinstance(file, Sink) else Sink(file, "the file")
        self._session = _encode(session)
        self._flush, self._again = nanoseconds(flush), nanoseconds(AGAIN)
        self._opened: int | None = None
        self._newest = self.written = session.t
        """All that was written with an earlier time is in the file [s]."""
        self._told = nanoseconds(session.t)
        self.finished = False
        """Whether nothing more can be written."""
        try:
            self._file = McapFile(self._sink, FORMAT, session.software)
            self._rare: set[int] = set()
            """Numbers of channels that aren't there yet."""
            for number, channel in enumerate(CHANNELS, 1):
                if channel.rare:
                    self._rare.add(number)
                elif kinds := channel.arm if session.drive is None else channel.mobile:
                    self._add_channel(number, kinds)
            self.write(session, t=session.t)
            self.flush()
        except RecordingError:
            self._sink.close()
            raise

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return self._sink.size

    @property
    def blocks(self) -> int:
        """Blocks in the file."""
        return self._file.blocks

    def write(self, message: Message, *, t: float) -> None:
        """Write a message.

        Args:
            message: What to record.
            t: Its time [s]; a sample's own.

        Raises:
            RecordingError: If the file doesn't take it, or if it's finished.
            InvalidValueError: If the message is longer than `LONGEST`.
        """
        self.write_encoded(*encoded(message), t)

    def write_encoded(self, number: int, data: bytes, t: float) -> None:
        """Write a message that is JSON already, to the channel of this number at a time [s].

        Raises:
            RecordingError, InvalidValueError: See `write`.
        """
        if len(data) > LONGEST:
            raise InvalidValueError("message", f"{len(data)} bytes", f"of up to {LONGEST} bytes")
        if self.finished:
            raise RecordingError(self._sink.where, "it's finished")
        at = nanoseconds(t)
        if self._opened is not None and (at - self._opened >= self._flush or self._file.size >= LARGE):
            self.flush()
        if self._opened is None:
            self._opened = at
            if at - self._told >= self._again:
                self._told = at
                self._file.add(NUMBER_OF[Begin], at, self._session)
        self._newest = max(self._newest, t)
        if number in self._rare:
            self._rare.discard(number)
            self._add_channel(number, CHANNELS[number - 1].kinds)
        self._file.add(number, at, data)

    def _add_channel(self, number: int, kinds: Kinds) -> None:
        channel = CHANNELS[number - 1]
        schema = channel.json_schema(kinds)
        self._file.add_channel(
            number, channel.topic, channel.schema, schema, many=channel.many, beside=channel.rare
        )

    def flush(self) -> None:
        """Close the block: what was written is in the file.

        Raises:
            RecordingError: If the file doesn't take it.
        """
        self._file.flush()
        self._opened, self.written = None, self._newest

    def finish(self, end: End) -> None:
        """Write the end and the index, and close the file.

        Raises:
            RecordingError: If the file doesn't take it.
        """
        try:
            # What the end stands behind is in the file: it has a block of its own.
            self.flush()
            self.write(end, t=end.t)
            self.flush()
            self._file.finish()
        finally:
            self.finished = True
            self._sink.close()

    def abandon(self) -> None:
        """Close the file as it is: without an end it reads as cut.

        Raises:
            RecordingError: If its last bytes didn't get there.
        """
        self.finished = True
        self._sink.close()

    def give_up(self) -> None:
        """Close the file after it has failed: what closing it says is no news."""
        with contextlib.suppress(RecordingError):
            self.abandon()


def encoded(message: Message) -> tuple[int, bytes]:
    """The number of a message's channel, and its JSON."""
    kind = type(message)
    return NUMBER_OF[kind], _encode(message.as_written() if kind in _SEGMENTED else message)  # type: ignore[attr-defined]
