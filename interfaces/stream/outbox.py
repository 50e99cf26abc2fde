"""What waits to be sent to one client: bounded in bytes, and of what has a newer value only the newest."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from interfaces.stream.codec import Encoding, Value

BATCH = 16384
"""Bytes beyond which nothing more is taken at once."""


class Outbox:
    """Messages in their order, and behind them the newest of each kind of which only the newest counts.

    What finds no room is dropped, and counted: the client asks for it again.
    """

    __slots__ = ("_encode", "_encoding", "_limit", "_newest", "_queue", "_waiting", "dropped", "total")

    def __init__(self, encode: Callable[[Value, Encoding], bytes], encoding: Encoding, limit: int) -> None:
        """Begin empty.

        Args:
            encode: Writes a message; that of a `SharedEncoder`, where many clients get the same.
            encoding: The client's.
            limit: Bytes that may wait, but for a message that waits alone.
        """
        self._encode, self._encoding, self._limit = encode, encoding, limit
        self._queue: deque[bytes] = deque()
        self._newest: dict[type[Value], Value] = {}
        self._waiting = 0
        self.dropped = 0
        """Messages that found no room."""
        self.total = 0
        """Bytes that were put so far, without those of which only the newest counts."""

    def __bool__(self) -> bool:
        return bool(self._queue or self._newest)

    @property
    def waiting(self) -> int:
        """Bytes that wait, without those of which only the newest counts."""
        return self._waiting

    @property
    def is_full(self) -> bool:
        """Whether there's no room for anything."""
        return self._waiting >= self._limit

    def put(self, message: Value) -> bool:
        """Put a message behind those that wait; whether there was room. For one alone there always is."""
        data = b"" if self.is_full else self._encode(message, self._encoding)
        if self.is_full or (self._queue and self._waiting + len(data) > self._limit):
            self.dropped += 1
            return False
        self._queue.append(data)
        self._waiting += len(data)
        self.total += len(data)
        return True

    def put_newest(self, message: Value) -> None:
        """Put a message in the place of what's there of its kind."""
        self._newest[type(message)] = message

    def take(self) -> tuple[bytes, ...]:
        """Take what is sent next: some 16 KiB of what waits, or if that's all, the newest too."""
        found: list[bytes] = []
        size = 0
        while self._queue and size < BATCH:
            data = self._queue.popleft()
            size += len(data)
            found.append(data)
        self._waiting -= size
        if not self._queue and self._newest:
            found.extend(self._encode(message, self._encoding) for message in self._newest.values())
            self._newest.clear()
        return tuple(found)
