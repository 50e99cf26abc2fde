"""What must arrive: commands until acknowledged, memory items exactly once, fragments of streams in order."""

from __future__ import annotations

import enum
import math
from collections import deque
from collections.abc import Callable, Set
from dataclasses import dataclass
from typing import ClassVar, Final

from typing_extensions import override

from interfaces.rsp.errors import FullError
from interfaces.rsp.header import LONGEST, MODULUS, up_to
from interfaces.rsp.layout import FRAGMENT, ID, STORED

MOST_WAITING: Final = 4096
"""Items that wait in an outbox, and that aren't acknowledged yet."""


class DeliveryOutcome(enum.StrEnum):
    """What became of something that must arrive."""

    DONE = "done"
    """The other side has acknowledged it."""
    FAILED = "failed"
    """Nothing acknowledged it by its deadline. It was carried out once at most, and won't be from now on if a later
    one was sent."""


@dataclass(frozen=True, slots=True)
class Settled:
    """Something that must arrive came to an end."""

    index: int
    """Of its element."""
    id: int
    """As it was given out."""
    outcome: DeliveryOutcome


class ValueOutbox:
    """Newest values by element: each is told until the other side is known to have it."""

    def __init__(self) -> None:
        """Begin empty."""
        self._payloads: dict[int, bytes] = {}
        self._first: dict[int, int] = {}

    @property
    def unknown(self) -> Set[int]:
        """Elements whose values the other side may not have."""
        return self._first.keys()

    def put(self, index: int, payload: bytes) -> None:
        """Set an element's values, as they are on the wire."""
        if self._payloads.get(index) != payload:
            self._payloads[index], self._first[index] = payload, -1

    def forget(self, indices: Set[int] | None = None) -> None:
        """Take it that the other side has no values of these elements, or of any."""
        lost = self._payloads.keys() if indices is None else self._payloads.keys() & indices
        self._first |= dict.fromkeys(lost, -1)

    def fill(self, payloads: dict[int, bytes], packet: int, indices: Set[int]) -> None:
        """Add those of these elements that have values to a packet of a number."""
        for index in self._payloads.keys() & indices:
            if self._first.get(index) == -1:
                self._first[index] = packet
            payloads[index] = self._payloads[index]

    def acknowledge(self, last: int) -> None:
        """Take the newest of our packets that the other side has: whose first packet isn't newer is known."""
        self._first = {index: first for index, first in self._first.items() if not 0 <= first <= last}


@dataclass(slots=True)
class _Item:
    index: int
    id: int
    payload: bytes
    deadline: float = math.inf
    first: int = -1
    """Number of the first packet that had it; −1 before there was one."""


class _Outbox:
    """Items in one order that must arrive: some wait, the others are under way."""

    what: ClassVar[str]
    """What there are too many of, in the error."""

    def __init__(self) -> None:
        """Begin empty."""
        self._waiting: deque[_Item] = deque()
        self._flying: list[_Item] = []
        self._next = 0

    def __len__(self) -> int:
        """Items that aren't settled."""
        return len(self._waiting) + len(self._flying)

    def _add(self, index: int, payload: Callable[[int], bytes], deadline: float = math.inf) -> int:
        """Take an item, its payload made of the ID on the wire; returns its ID.

        Raises:
            FullError: If too many wait.
        """
        if len(self) >= MOST_WAITING:
            raise FullError(f"the queue of {self.what}", MOST_WAITING)
        number, self._next = self._next, self._next + 1
        self._waiting.append(_Item(index, number, payload(number % MODULUS), deadline))
        return number

    def _settle(self, over: Callable[[_Item], bool], outcome: DeliveryOutcome) -> list[Settled]:
        """Let go of what is over."""
        found = [item for item in (*self._flying, *self._waiting) if over(item)]
        if found:
            self._flying = [item for item in self._flying if not over(item)]
            self._waiting = deque(item for item in self._waiting if not over(item))
        return [Settled(item.index, item.id, outcome) for item in found]

    def expire(self, now: float) -> list[Settled]:
        """Give up what has passed its deadline by now [s]."""
        return self._settle(lambda item: item.deadline <= now, DeliveryOutcome.FAILED)

    def drain(self) -> list[Settled]:
        """Give up all."""
        return self.expire(math.inf)


class CommandOutbox(_Outbox):
    """Commands in one order: as many under way as fit into a packet, each in every packet until it's acknowledged.

    An acknowledgement is the last received number: since the command is in every packet from the first one on, a
    number from there on says that it came.
    """

    what = "commands"

    def put(self, index: int, values: bytes) -> int:
        """Take a command for an element; returns its ID.

        Raises:
            FullError: If too many wait.
        """
        return self._add(index, lambda number: ID.pack(number) + values)

    def fill(self, payloads: dict[int, bytes], packet: int) -> None:
        """Add what goes into a packet of a number."""
        taken = {item.index for item in self._flying}
        # In order: one that finds its bit taken waits, and all behind it.
        while self._waiting and self._waiting[0].index not in taken:
            item = self._waiting.popleft()
            item.first = packet
            taken.add(item.index)
            self._flying.append(item)
        payloads |= {item.index: item.payload for item in self._flying}

    def acknowledge(self, last: int) -> list[Settled]:
        """Take the other side's last received number."""
        return self._settle(lambda item: 0 <= item.first <= last, DeliveryOutcome.DONE)


class MemoryOutbox(_Outbox):
    """Memory items in one order: a flight of them is sent once, again where no acknowledgement comes, or given up.

    What follows a flight waits until all of it is acknowledged or given up, so that nothing can come out of order.
    """

    what = "memory items"

    @override
    def __init__(self, room: int = LONGEST) -> None:
        """Begin empty.

        Args:
            room: For a flight in a packet [byte]; for one item at least.
        """
        super().__init__()
        self._room = room
        self._due = -math.inf
        self._tries = 0

    def put(self, index: int, data: bytes, deadline: float) -> int:
        """Take an item for an element, to be settled by a time [s]; returns its ID.

        Raises:
            FullError: If too many wait.
        """
        return self._add(index, lambda number: STORED.pack(number, len(data)) + data, deadline)

    def fill(self, payloads: dict[int, bytes], *, now: float, timeout: float) -> None:
        """Add what goes into a packet now.

        Args:
            payloads: Of the packet, by element.
            now: [s].
            timeout: After so long without an acknowledgement it's sent again [s]; twice as long after each time.
        """
        if not self._flying:
            taken: set[int] = set()
            room = self._room
            while self._waiting and self._waiting[0].index not in taken and len(self._waiting[0].payload) <= room:
                item = self._waiting.popleft()
                taken.add(item.index)
                room -= len(item.payload)
                self._flying.append(item)
            self._due, self._tries = now, 0
        if self._flying and now >= self._due:
            payloads |= {item.index: item.payload for item in self._flying}
            self._due = now + timeout * 2.0 ** min(self._tries, 3)
            self._tries += 1

    def acknowledge(self, index: int, payload: bytes) -> list[Settled]:
        """Take an acknowledgement of an element: all of its items up to an ID came."""
        if not self._flying:
            return []
        upto = up_to(ID.unpack(payload)[0], self._flying[-1].id)
        return self._settle(lambda item: item.index == index and item.id <= upto, DeliveryOutcome.DONE)


class MemoryInbox:
    """The other end: takes each item once, in order, and says up to which it has them."""

    def __init__(self) -> None:
        """Nothing came yet."""
        self._newest = -1
        self._owed: dict[int, tuple[int, int]] = {}
        """By element: the ID to be acknowledged, and the first packet that had it, −1 before there was one."""

    def receive(self, payloads: list[tuple[int, bytes]]) -> list[tuple[int, int, bytes]]:
        """Take the items of a packet; returns (element, ID, data) of the new ones in order."""
        came = [(self._near(STORED.unpack_from(item)[0]), index, item[STORED.size :]) for index, item in payloads]
        new = []
        for number, index, data in sorted(came, key=lambda item: item[0]):
            # One that came before is acknowledged again: whoever sends it doesn't know.
            self._owed[index] = number, -1
            if number > self._newest:
                self._newest = number
                new.append((index, number, data))
        return new

    def _near(self, number: int) -> int:
        ahead = (number - self._newest) % MODULUS
        return self._newest + ahead if 0 < ahead < MODULUS // 2 else up_to(number, self._newest)

    def fill(self, payloads: dict[int, bytes], packet: int) -> None:
        """Add the acknowledgements to a packet of a number."""
        for index, (number, first) in self._owed.items():
            payloads[index] = ID.pack(number % MODULUS)
            if first < 0:
                self._owed[index] = number, packet

    def heard(self, last: int) -> None:
        """Take the other side's last received number: what it has needn't be acknowledged again."""
        done = [index for index, (_, first) in self._owed.items() if 0 <= first <= last]
        for index in done:
            del self._owed[index]


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
