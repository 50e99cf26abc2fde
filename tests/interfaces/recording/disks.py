"""Disks that fill up, take less than they're given, or hang."""

from __future__ import annotations

import errno
import time
from pathlib import Path
from threading import Event


class Disk:
    """Takes everything, in memory."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.calls = 0
        self.closed = False

    def write(self, data: bytes | memoryview, /) -> int | None:
        self.calls += 1
        return self.take(data)

    def take(self, data: bytes | memoryview) -> int | None:
        self.data += data
        return len(data)

    def close(self) -> None:
        self.closed = True


class Slow(Disk):
    """Takes a few bytes a time."""

    def take(self, data: bytes | memoryview) -> int | None:
        return super().take(data[:777])


class Failing(Disk):
    """From the N-th write on it takes half of what it's given, and then nothing."""

    def __init__(self, last: int, *, how: str) -> None:
        super().__init__()
        self.last, self.how = last, how

    def take(self, data: bytes | memoryview) -> int | None:
        if self.calls < self.last:
            return super().take(data)
        if self.calls == self.last and len(data) > 1:
            return super().take(data[: len(data) // 2])
        if self.how == "none":
            return None
        if self.how == "zero":
            return 0
        raise OSError({"full": errno.ENOSPC, "broken": errno.EIO}[self.how], self.how)


class Hanging(Disk):
    """Hangs after so many writes, until it's let go."""

    def __init__(self, after: float = 2) -> None:
        super().__init__()
        self.after = after
        self.hangs, self.free = Event(), Event()

    def take(self, data: bytes | memoryview) -> int | None:
        if self.calls > self.after:
            self.hangs.set()
            self.free.wait(30.0)
        return super().take(data)


class Filling:
    """A file that has room for so many bytes."""

    def __init__(self, path: Path, room: int) -> None:
        self.file, self.room = path.open("wb", buffering=0), room
        self.full = 0.0
        """When it took less than it was given, by the machine's monotonic counter [s]; 0 before."""

    def write(self, data: bytes | memoryview, /) -> int | None:
        some = bytes(data)[: self.room]
        self.room -= len(some)
        if len(some) < len(data):
            self.full = self.full or time.monotonic()
        return self.file.write(some)

    def close(self) -> None:
        self.file.close()
