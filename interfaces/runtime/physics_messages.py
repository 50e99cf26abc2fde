"""What the process of the physics and its parent tell each other, a message of `interfaces.pipes` each.

Ticks are numbered by the robot's clock: tick k is due at k times the tick's length, and then the body goes to where
its reference is to be at that time.
"""

from __future__ import annotations

from bisect import bisect_left
from enum import StrEnum
from typing import TypeAlias, TypeVar

import msgspec
import numpy as np

from robots.bullet.grasping import HandState
from robots.things import Scene
from vrs.errors import FormatError
from vrs.model import Array, Limits

LATENESS = (0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05)
"""Upper ends of the classes of lateness that are counted [s]; one more class has what is later still."""
ROWS_MOST = 1000
"""Most rows in a message."""
MESSAGE_MOST = 1 << 18
"""Most bytes of a message."""

Row: TypeAlias = tuple[float, ...]
"""A number a joint."""
Grips: TypeAlias = tuple[tuple[int, float], ...]
"""[tick, opening]: what a hand is told and from when on [m]."""


class FaultKind(StrEnum):
    """Why the body came to rest by itself."""

    STARVED = "starved"
    """There was no reference for a tick, in mid-motion."""
    PAUSED = "paused"
    """The process stood still for too long, in mid-motion."""
    JUMPED = "jumped"
    """A reference came that the one before can't go to within the limits."""
    REFUSED = "refused"
    """References that aren't numbers, are too fast, or lie too far ahead."""
    SENSOR = "sensor"
    """What it measures isn't sound, as its encoder reads NaN."""
    BODY = "body"
    """The body itself failed; the process ends."""


class PhysicsActivity(StrEnum):
    """What the process does."""

    FOLLOWING = "following"
    BRAKING = "braking"
    HOLDING = "holding"
    """At rest after a fault, until that is acknowledged."""


class PhysicsSetup(msgspec.Struct, frozen=True, tag="setup"):
    """The first message to the process."""

    robot: str
    """What `robots.load` finds it by; nothing is looked up for a body that's exact."""
    body: str
    """Which of its bodies."""
    friction: bool
    tick: float
    """Length of a tick [s]."""
    every: int
    """Ticks from one report to the next."""
    origin: float
    """Of the robot's clock: see `vrs.clock.WallClock.since`."""
    parent: int
    """The parent's process id."""
    q: Row
    """Where the body stands [rad]."""
    limits: tuple[Row, Row, Row, Row, Row]
    """q_min, q_max [rad], qd_max [rad/s], qdd_max [rad/s²], qddd_max [rad/s³]; of prismatic joints in m for rad."""
    prismatic: tuple[int, ...] = ()
    """Which are, from 0."""
    scene: Scene | None = None
    """What is around it; None for nothing that it could grasp."""

    def joint_limits(self) -> Limits:
        """The limits as a value."""
        return Limits(*map(np.array, self.limits))


class Rows(msgspec.Struct, frozen=True, tag="rows"):
    """References for ticks from `start` on, instead of all that came before for these and later ticks.

    After them the last is held, if it's at rest.
    """

    run: int
    """How many faults have been acknowledged; rows that are older than a fault don't count."""
    start: int
    """Tick of the first."""
    placed: bool
    """Whether the reference may go to the first at once: it's at rest, near where the body was measured."""
    data: bytes
    """q [rad], qd [rad/s], qdd [rad/s²]: float64, (k, 3, n)."""
    grips: Grips = ()
    """What the hand is told at ticks from `start` on, instead of all that came before for these."""

    def array(self, n: int) -> Array:
        """The rows, (k, 3, n), read-only.

        Raises:
            FormatError: If they aren't k rows of n joints, 1 ≤ k ≤ ROWS_MOST.
        """
        count, rest = divmod(len(self.data), 24 * n)
        if rest or not 1 <= count <= ROWS_MOST:
            raise FormatError("rows", f"{len(self.data)} bytes aren't 1 to {ROWS_MOST} rows of {n} joints")
        return np.frombuffer(self.data, dtype=np.float64).reshape(count, 3, n)


class Attach(msgspec.Struct, frozen=True, tag="attach"):
    """Take a load."""

    mass: float
    """[kg]."""


class ReleaseLoad(msgspec.Struct, frozen=True, tag="release"):
    """Drop the load."""


class Close(msgspec.Struct, frozen=True, tag="close"):
    """Come to rest and end."""


class PhysicsReady(msgspec.Struct, frozen=True, tag="ready"):
    """The body stands and takes references."""

    tick: int
    """Last tick before the first."""
    realtime: bool
    """Whether the operating system gives it real-time priority; without, ticks are late on a busy machine."""


class TickCounts(msgspec.Struct, frozen=True):
    """How late the ticks began."""

    ticks: int
    late: int
    """Of these, begun more than a tick's length after they were due."""
    worst: float
    """Largest lateness [s]."""
    skipped: int
    """Ticks that were never run, as the process stood still."""
    merged: int
    """Ticks on the way onto references that came late."""
    histogram: tuple[int, ...]
    """How many in each class of `LATENESS`."""


class TickCounter:
    """Counts how late ticks are."""

    def __init__(self, tick: float) -> None:
        """Count from none, of ticks so long [s]."""
        self._tick = tick
        self._ticks = self._late = 0
        self.skipped = self.merged = 0
        self._worst = 0.0
        self._histogram = [0] * (len(LATENESS) + 1)

    def add(self, late: float) -> None:
        """Count a tick that begins so much after it was due [s]."""
        self._ticks += 1
        self._late += late > self._tick
        self._worst = max(self._worst, late)
        self._histogram[bisect_left(LATENESS, late)] += 1

    def counts(self) -> TickCounts:
        """All until now."""
        histogram = tuple(self._histogram)
        return TickCounts(self._ticks, self._late, self._worst, self.skipped, self.merged, histogram)


class Measurement(msgspec.Struct, frozen=True, tag="measured"):
    """Where the body is after a tick."""

    tick: int
    doing: PhysicsActivity
    q: Row
    """Encoder readings [rad]."""
    qd: Row
    """Speeds [rad/s]."""
    tau: Row
    """Drive torques [N m]; empty for a body without."""
    q_ref: Row
    """Reference [rad]."""
    followed: int
    """Tick that the reference was meant for: an earlier one where rows came late and the motion began late."""
    counts: TickCounts
    hand: HandState | None = None
    """The hand and the things around it; None of a body without."""


class Fault(msgspec.Struct, frozen=True, tag="fault"):
    """The body comes to rest by itself; told once."""

    number: int
    """Of this fault, from 1."""
    kind: FaultKind
    text: str
    """What happened, for people."""
    tick: int
    """First tick of the stop."""
    rest: Row
    """Where its reference will rest [rad]: references after this begin here."""
    rest_tick: int
    """When, if no tick is skipped."""


Order: TypeAlias = PhysicsSetup | Rows | Attach | ReleaseLoad | Close
"""To the process."""
News: TypeAlias = PhysicsReady | Measurement | Fault
"""From the process."""

M = TypeVar("M")

_ORDERS: msgspec.msgpack.Decoder[Order] = msgspec.msgpack.Decoder(Order)
_NEWS: msgspec.msgpack.Decoder[News] = msgspec.msgpack.Decoder(News)
_ENCODER = msgspec.msgpack.Encoder()


def encode(message: Order | News) -> bytes:
    """Write a message."""
    return _ENCODER.encode(message)


def decode_order(data: bytes) -> Order:
    """Read a message to the process.

    Raises:
        FormatError: If it is none.
    """
    return _decoded(_ORDERS, data, "message to the physics")


def decode_news(data: bytes) -> News:
    """Read a message from the process.

    Raises:
        FormatError: If it is none.
    """
    return _decoded(_NEWS, data, "message from the physics")


def _decoded(decoder: msgspec.msgpack.Decoder[M], data: bytes, what: str) -> M:
    try:
        return decoder.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError) as problem:
        raise FormatError(what, str(problem)) from None
