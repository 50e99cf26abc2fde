"""What a core tells whoever drives it."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import TypeAlias

from interfaces.rsp.handshake import SessionRefusal
from interfaces.rsp.outbox import Settled


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
