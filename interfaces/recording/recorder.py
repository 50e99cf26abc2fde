"""Recording beside a motion: a queue with room for so much, and a thread that writes.

Nobody waits for the disk. What finds no room is counted and left out; a disk that fails ends the recording alone.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from pathlib import Path
from threading import Event, Lock, Thread

from interfaces.messages.recording import Begin, Drop, Dropped, End
from interfaces.recording.channels import CHANNELS, Message
from interfaces.recording.mcap_file import RawFile, RecordingError, Sink
from interfaces.recording.mcap_reading import LONGEST
from interfaces.recording.writer import FLUSH, RecordingWriter, encoded
from vrs.clock import Clock, WallClock

ROOM = 8 * 2**20
"""Bytes of messages that wait, at most: of both twins at 60 Hz some two minutes."""
PERIOD = 0.05
"""How often the thread looks for messages [s]."""
STALLED = 0.75
"""A disk that takes nothing for so long is called a problem [s]."""
PATIENCE = 5.0
"""How long closing waits for a disk that takes nothing [s]."""


class Recorder:
    """Takes messages from any thread at any time, and never waits."""

    def __init__(
        self,
        file: Sink | RawFile | Path,
        session: Begin,
        *,
        flush: float = FLUSH,
        room: int = ROOM,
        clock: Clock | None = None,
        first: Iterable[Message] = (),
    ) -> None:
        """Begin a recording; the beginning is in the file when this returns.

        Args:
            file: Where to; a path is made anew.
            session: How the run is set up.
            flush: Longest span of a block [s].
            room: Bytes of messages that wait, at most.
            clock: Says how long the disk takes; the machine's unless given.
            first: What is written before anything else, however long that takes.

        Raises:
            RecordingError: If the file can't be made, or doesn't take the beginning.
        """
        self._clock = WallClock() if clock is None else clock
        self._writer = RecordingWriter(file, session, flush=flush)
        try:
            for message in first:
                self._writer.write(message, t=session.t)
        except RecordingError:
            self._writer.give_up()
            raise
        self._flush, self._room = flush, room
        self.queue: deque[tuple[int, bytes, float]] = deque()
        self._lock = Lock()
        self._added = self._taken = 0
        self._counts = [0] * (len(CHANNELS) + 1)
        self._told = 0
        self._wake, self._closing = Event(), False
        self._end: End | None = None
        self._last: Iterable[Message] = ()
        self._ended = False
        self._busy: float | None = None
        self._failed = ""
        self._opened: float | None = None
        self.acknowledged = 0
        """So many of the messages that were taken are in the file: the first ones."""
        self._written = 0
        self._thread = Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    @property
    def written(self) -> float:
        """All that was put by now with an earlier time is in the file, and survives a SIGKILL [s]."""
        return self._writer.written

    @property
    def size(self) -> int:
        """Bytes in the file."""
        return self._writer.size

    @property
    def dropped(self) -> dict[str, int]:
        """Messages for which there was no room, by topic."""
        named = zip(CHANNELS, self._counts[1:], strict=True)
        return {channel.topic: count for channel, count in named if count}

    @property
    def problem(self) -> str | None:
        """What is wrong, one line; None while all goes well."""
        if self._failed:
            return self._failed
        busy = self._busy
        if busy is not None and (waited := self._clock.now() - busy) > STALLED:
            return f"recording stalls: the disk has taken nothing for {waited:.1f} s"
        if not self._thread.is_alive() and not self._ended:
            return "recording failed: its thread has ended"
        return None

    def put(self, message: Message, *, t: float) -> bool:
        """Record a message at a time [s].

        Returns:
            Whether there was room.
        """
        number, data = encoded(message)
        size = len(data)
        # The thread never holds this lock: those who put wait for each other alone, for a moment.
        with self._lock:
            full = size > LONGEST or self._added - self._taken + size > self._room
            if full or self._closing or self._failed:
                self._counts[number] += 1
                return False
            self._added += size
            self.queue.append((number, data, t))
        return True

    def close(self, end: End | None, *, patience: float = PATIENCE, last: Iterable[Message] = ()) -> bool:
        """Write what waits and the end, and close the file.

        Args:
            end: The last message; None for none: the file reads as cut.
            patience: How long to wait for a disk that takes nothing [s].
            last: What is written before the end, at its time, whether there's room or not.

        Returns:
            Whether all of that is in the file; otherwise `problem` says why not.
        """
        with self._lock:
            self._end, self._last, self._closing = end, last, True
        self._wake.set()
        size = -1
        while self._thread.is_alive() and self.size > size:
            size = self.size
            self._thread.join(patience)
        if self._thread.is_alive() and not self._failed:
            self._failed = f"recording failed: the disk didn't take the end within {patience:g} s"
        return self._ended and not self._failed

    def _run(self) -> None:
        try:
            while not self._closing:
                self._wake.wait(PERIOD)
                self._busy = self._clock.now()
                self._drain()
                self._busy = None
            self._busy = self._clock.now()
            self._drain()
            self._finish()
            self.acknowledged, self._ended = self._written, True
        except RecordingError as error:
            self._failed = str(error)
            self._writer.give_up()
            self.queue.clear()
        self._busy = None

    def _drain(self) -> None:
        """Write what waits; close the block when it has been open for long."""
        writer, queue = self._writer, self.queue
        while queue:
            number, data, t = queue.popleft()
            self._busy = self._clock.now()
            before = writer.blocks
            self._tell(t)
            writer.write_encoded(number, data, t)
            if writer.blocks != before:
                self.acknowledged = self._written
                self._opened = None
            self._written += 1
            self._taken += len(data)
        now = self._clock.now()
        if self._opened is None:
            self._opened = now
        elif now - self._opened >= self._flush + PERIOD:
            writer.flush()
            self.acknowledged = self._written
            self._opened = None

    def _finish(self) -> None:
        """Write what comes last, and close the file."""
        writer, end = self._writer, self._end
        if end is None:
            writer.flush()
            writer.abandon()
            return
        for message in self._last:
            self._busy = self._clock.now()
            number, data = encoded(message)
            if len(data) > LONGEST:
                self._counts[number] += 1
            else:
                writer.write_encoded(number, data, end.t)
        self._tell(end.t)
        writer.finish(end)

    def _tell(self, t: float) -> None:
        """Say in the file how much had no room, where that has changed."""
        if (total := sum(self._counts)) != self._told:
            self._told = total
            drops = tuple(Drop(topic, count) for topic, count in self.dropped.items())
            self._writer.write_encoded(*encoded(Dropped(t, drops)), t)
