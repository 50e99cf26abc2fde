"""What a core tells whoever drives it, and what the cores of both sides share."""

from __future__ import annotations

import enum
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Generic, TypeAlias, TypeVar

from interfaces.rsp import header
from interfaces.rsp.errors import PacketError
from interfaces.rsp.handshake import SessionRefusal
from interfaces.rsp.header import Header
from interfaces.rsp.layout import Layout, PacketDirection
from interfaces.rsp.model.elements import RobotModel
from interfaces.rsp.outbox import MemoryInbox, MemoryOutbox, Settled
from interfaces.rsp.session import DropReason, PacketDropped, PacketRoundTrip


class EndReason(enum.StrEnum):
    """Why a session ended."""

    CLOSED = "closed"
    """The local system ended it."""
    LOST = "lost"
    """Nothing came for a long time."""
    TAKEN = "taken over"
    """Another local system has the robot."""


@dataclass(frozen=True, slots=True)
class Began:
    """A session began."""

    session: int


@dataclass(frozen=True, slots=True)
class Refused:
    """The robot gives no session."""

    reason: SessionRefusal


@dataclass(frozen=True, slots=True)
class SessionEnded:
    """A session ended."""

    session: int
    reason: EndReason


@dataclass(frozen=True, slots=True)
class Told:
    """A sensor or a monitor has a new value; its payload."""

    index: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class Occurred:
    """An event's condition was met; its values as they are on the wire."""

    index: int
    id: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class Commanded:
    """A command came, to be carried out now; its values as they are on the wire."""

    index: int
    id: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class Stored:
    """A memory command or a memory event came: once, in order."""

    index: int
    id: int
    data: bytes


class RobotChange(enum.Enum):
    """What else becomes of a robot."""

    CLEARED = enum.auto()
    """The data buffer was cleared: what is being played ends."""
    LINK_LOST = enum.auto()
    """Nothing came for the time of the watchdog: effectors that rest on loss do so."""
    LINK_RESTORED = enum.auto()
    """Something came again."""


LocalOutput: TypeAlias = Began | Refused | SessionEnded | Told | Occurred | Stored | Settled
RobotOutput: TypeAlias = Began | SessionEnded | Commanded | Stored | RobotChange | Settled
OutputT = TypeVar("OutputT")


class SessionCore(ABC, Generic[OutputT]):
    """One side of a session: what it drops, what it tells, and the memory items that it sends and takes."""

    way: ClassVar[PacketDirection]
    """Which way its packets go."""

    def __init__(self, model: RobotModel, timeout: float, *, sealed: bool) -> None:
        """Begin without a session.

        Args:
            model: Of the robot.
            timeout: Least time before a memory item is sent again [s].
            sealed: Whether packets are.
        """
        self.model, self.layout = model, Layout(model)
        self._timeout, self._sealed = timeout, sealed
        self.dropped = dict.fromkeys(DropReason, 0)
        """Datagrams that were dropped, by reason."""
        self.waiting_outputs: list[OutputT] = []
        self._renew()

    def _renew(self) -> None:
        """Forget what was under way."""
        self.memory_outbox, self._inbox = MemoryOutbox(self.layout.room[self.way]), MemoryInbox()
        self.packet_round_trip = PacketRoundTrip()

    def take(self) -> list[OutputT]:
        """What happened since the last call."""
        outputs, self.waiting_outputs = self.waiting_outputs, []
        return outputs

    def store(self, index: int, data: bytes, *, deadline: float) -> int:
        """Give the data of an element that must arrive, to be settled by a time [s]; returns its ID.

        Raises:
            InvalidValueError: If it's more than the element can hold.
            FullError: If too much waits already.
        """
        self.layout.check_data(index, data)
        return self.memory_outbox.put(index, data, deadline)

    def receive(self, data: bytes, address: bytes = b"", *, now: float) -> None:
        """Take a datagram from an address; whatever it holds, nothing is raised."""
        try:
            head = header.decode(data)
            if head.model != self.model.id:
                raise PacketDropped(DropReason.MODEL)
            if head.encrypted != self._sealed:
                raise PacketDropped(DropReason.DOWNGRADE)
            self._receive(head, data, address, now)
        except PacketError:
            self.dropped[DropReason.MALFORMED] += 1
        except PacketDropped as drop:
            self.dropped[drop.reason] += 1

    @abstractmethod
    def _receive(self, head: Header, data: bytes, address: bytes, now: float) -> None:
        """Take a packet of this robot."""

    def _fill(self, payloads: dict[int, bytes], number: int, now: float) -> None:
        """Add memory items and acknowledgements to the packet of a number, which goes out now [s]."""
        timeout = max(self._timeout, 2 * (self.packet_round_trip.smoothed or 0.0))
        self.memory_outbox.fill(payloads, now=now, timeout=timeout)
        self._inbox.fill(payloads, number)
        self.packet_round_trip.sent(number, now)
