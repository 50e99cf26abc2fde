"""What crosses between a site and the process of its robot's camera: length-prefixed msgpack on a socket pair."""

from __future__ import annotations

from enum import StrEnum
from typing import Final, TypeAlias, TypeVar

import msgspec

from interfaces.pipes import framed
from robots.mobile.camera import Lens
from robots.rooms import Room
from vrs.errors import FormatError

MESSAGE_MOST: Final = 1 << 24
"""Largest message [bytes]."""


class CameraView(StrEnum):
    """What pictures are of."""

    ROBOT = "robot"
    """What the robot's own camera sees."""
    OVERHEAD = "overhead"
    """The room from above."""
    BOTH = "both"
    """The first, with the second in its corner."""


class Setup(msgspec.Struct, frozen=True, tag=True):
    """Site: what is to be seen, and how; the first message."""

    robot: str
    """What `robots.load` finds the robot by that has the camera."""
    room: Room
    lens: Lens
    rate: float
    """Pictures a second that are asked for; the encoder spreads its bits by it."""
    video: bool
    """Whether pictures are to be encoded for RTP."""
    view: CameraView = CameraView.ROBOT


class Shot(msgspec.Struct, frozen=True, tag=True):
    """Site: draw a picture."""

    number: int
    posture: tuple[float, float, float]
    """Where the robot is, x, y [m], θ [rad]."""
    look: tuple[float, float]
    """Pan and tilt [rad]."""
    t: float
    """Time in the room [s]."""
    key: bool
    """Whether a receiver needs nothing before it."""
    still: bool
    """Whether it's also wanted by itself."""


class Taken(msgspec.Struct, frozen=True, tag=True):
    """Process: a picture."""

    number: int
    """Of the shot."""
    video: bytes
    """A VP8 frame; empty where none was wanted."""
    key: bool
    """Whether a receiver needs nothing before it."""
    still: bytes
    """A JPEG; empty where none was wanted."""
    took: float
    """How long drawing and encoding took [s]."""


Order: TypeAlias = Setup | Shot
News: TypeAlias = Taken | None
"""Process: a picture; None once, when pictures can be asked for."""
_Message = TypeVar("_Message")
_encoder = msgspec.msgpack.Encoder()
ORDERS: Final[msgspec.msgpack.Decoder[Order]] = msgspec.msgpack.Decoder(Order)
"""Reads what a site says."""
NEWS: Final[msgspec.msgpack.Decoder[News]] = msgspec.msgpack.Decoder(News)
"""Reads what the process says."""


def encode(message: Order | News) -> bytes:
    """A message with its length before it."""
    return framed(_encoder.encode(message))


def size_of(head: bytes) -> int:
    """Length of the message that follows a head.

    Raises:
        FormatError: If it's too long.
    """
    size = int.from_bytes(head, "big")
    if size > MESSAGE_MOST:
        raise FormatError("camera", f"a message of {size} bytes; {MESSAGE_MOST} are allowed")
    return size


def decode(data: bytes, decoder: msgspec.msgpack.Decoder[_Message]) -> _Message:
    """Read a message of one side.

    Raises:
        FormatError: If it's none of its messages.
    """
    try:
        return decoder.decode(data)
    except (msgspec.MsgspecError, ValueError) as error:
        raise FormatError("camera", str(error)) from None
