"""Fragments of a stream beside motion, and flow control by the robot's free buffers."""

from __future__ import annotations

from collections import deque
from typing import Final

from interfaces.rsp.errors import FullError
from interfaces.rsp.layout import FRAGMENT

MOST_QUEUED: Final = 65_536
"""Fragments that wait at the local system."""


class StreamOutbox:
    """The local system's end: a fragment a packet, as long as the robot has a buffer for it.

    The robot says how many are free, and which of our packets it had then. What was sent in later packets takes one
    each, lost or not; so no buffer is ever promised twice.
    """

    def __init__(self, buffers: int) -> None:
        """Begin with all buffers of the robot free."""
        self._free = buffers
        self._sent: deque[int] = deque()
        """Numbers of packets with fragments that the robot hasn't accounted for."""
        self._queues: dict[int, deque[bytes]] = {}
        self._numbers: dict[int, int] = {}
        self._turn = 0

    def __len__(self) -> int:
        """Fragments that wait."""
        return sum(map(len, self._queues.values()))

    @property
    def credit(self) -> int:
        """Fragments that may be sent now."""
        return max(self._free - len(self._sent), 0)

    def put(self, index: int, data: bytes, size: int) -> None:
        """Take data for an element, in fragments of a size [byte].

        Raises:
            FullError: If too much waits; nothing of it is taken then.
        """
        queue = self._queues.setdefault(index, deque())
        pieces = [data[at : at + size] for at in range(0, len(data), size)]
        if len(self) + len(pieces) > MOST_QUEUED:
            raise FullError("the queue of fragments", MOST_QUEUED)
        for piece in pieces:
            number = self._numbers.get(index, 0)
            self._numbers[index] = number + 1
            queue.append(FRAGMENT.pack(number & 0xFFFFFFFF, len(piece)) + piece.ljust(size, b"\0"))

    def fill(self, payloads: dict[int, bytes], packet: int, room: int) -> None:
        """Add a fragment of each stream that has one to a packet, streams taking turns at the first buffer.

        Args:
            payloads: Of the packet, by element.
            packet: Its number.
            room: What they leave of it [byte].
        """
        waiting = [index for index, queue in self._queues.items() if queue]
        self._turn += 1
        for k in range(len(waiting)):
            if not self.credit:
                return
            index = waiting[(self._turn + k) % len(waiting)]
            room -= len(self._queues[index][0])
            if room < 0:
                return
            payloads[index] = self._queues[index].popleft()
            self._sent.append(packet)

    def report(self, free: int, last: int) -> None:
        """Take the robot's number of free buffers, as of our packet of a number."""
        while self._sent and self._sent[0] <= last:
            self._sent.popleft()
        self._free = free

    def clear(self) -> None:
        """Drop what waits."""
        self._queues.clear()


class StreamInbox:
    """The robot's end: holds fragments until they're played, in order."""

    def __init__(self, buffers: int) -> None:
        """Begin with all buffers free."""
        self._buffers = buffers
        self._held: dict[int, deque[bytes]] = {}
        self._newest: dict[int, int] = {}
        self.missing = 0
        """Fragments that were lost on the way: silence."""
        self.overflowed = 0
        """Fragments for which there was no buffer; a local system that keeps to the protocol sends none."""

    @property
    def free(self) -> int:
        """Free buffers."""
        return self._buffers - sum(map(len, self._held.values()))

    def receive(self, index: int, payload: bytes) -> None:
        """Take a fragment of an element."""
        number, length = FRAGMENT.unpack_from(payload)
        if not self.free:
            self.overflowed += 1
            return
        gap = (number - self._newest.get(index, number - 1) - 1) & 0xFFFFFFFF
        if gap < 1 << 31:
            self.missing += gap
        self._newest[index] = number
        self._held.setdefault(index, deque()).append(payload[FRAGMENT.size : FRAGMENT.size + length])

    def take(self, index: int) -> bytes | None:
        """The next fragment of an element, whose buffer is free then; None where there's none."""
        held = self._held.get(index)
        return held.popleft() if held else None

    def clear(self) -> None:
        """Drop all that is held."""
        self._held.clear()
