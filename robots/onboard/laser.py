"""A laser scanner's model and scans, and what a scan of a moving robot looks like from one place.

Beams are counted from the right (−90 deg) to the left (+90 deg) of where the robot looks. A sweep takes time: each
beam is measured from where the robot was then. *De-skewing* puts all of them into the robot's frame at one time, by
the odometry.

Source: Kim, Han, Kim, Kim 2002, section 2.1: 0 to 180 deg, 0.25 to 1 deg, 5 Hz, at most 25 Hz.

The scanner's serial frame: 11 bytes around two for each beam, 733 for 361 beams.

    06                     the request was understood
    02                     a telegram begins
    80                     it's from the scanner
    length                 of what follows, without the checksum: 2 bytes a beam and 4 more
    B0                     measured values
    count                  beams in the low 14 bits; the two high ones say the unit, 01 for millimetres
    ranges                 13 bits each [mm], 1FFF where nothing came back
    status                 00: all is well
    checksum               CRC-16 with polynomial 8005 from the telegram's first byte on

Numbers of two bytes have the low byte first. The paper gives the length of the frame alone; this is the layout of
the scanners of its time that has this length.

Source: Kim, Han, Kim, Kim 2002, section 2.1.
"""

from __future__ import annotations

import math
import struct
from bisect import bisect_left
from collections import deque
from dataclasses import dataclass
from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vrs.checks import finite, number_in, validated, within
from vrs.errors import FormatError, InvalidValueError
from vrs.mobile.model import sinc, wrapped
from vrs.model import Array, frozen_array

STEPS_DEG: Final = (0.25, 0.5, 1.0)
"""Angles between two beams that the scanner can be set to [deg]."""
RATES: Final = (5.0, 25.0)
"""Scans a second: what the serial port carries, and what the scanner can [Hz]."""
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
@validated
class LaserModel:
    """How the scanner sees, and where it sits."""

    rate: float = 5.0
    """Scans a second [Hz], 5 or 25."""
    step_deg: float = 0.5
    """Between two beams [deg], 0.25, 0.5 or 1."""
    reach: Annotated[float, within(0.5, 8.0)] = 8.0
    """Farthest that it sees [m], in [0.5, 8]: a frame has 13 bits for millimetres."""
    noise: Annotated[float, within(0.0, 0.2)] = 0.01
    """Standard deviation of a range [m], in [0, 0.2]."""
    dropouts: Annotated[float, within(0.0, 1.0)] = 0.005
    """Probability that a beam brings nothing, in [0, 1]."""
    sweep: Annotated[float, within(0.0, 0.2)] = 0.027
    """From the first beam to the last [s], in [0, 0.2], not longer than between two scans."""
    forward: Annotated[float, within(-2.0, 2.0)] = 0.1
    """How far the scanner is ahead of the driving axle [m], in [-2, 2]."""
    height: Annotated[float, within(0.01, 2.0)] = 0.3
    """Of its plane above the floor [m], in [0.01, 2]."""

    def __post_init__(self) -> None:
        for name, allowed in (("rate", RATES), ("step_deg", STEPS_DEG)):
            if getattr(self, name) not in allowed:
                raise InvalidValueError(name, getattr(self, name), f"one of {', '.join(f'{a:g}' for a in allowed)}")
        number_in("sweep", self.sweep, 0.0, 1 / self.rate, unit=f" s at {self.rate:g} Hz")

    @property
    def beams(self) -> int:
        """How many beams a scan has."""
        return round(180.0 / self.step_deg) + 1

    @property
    def angles(self) -> Array:
        """Where each beam looks [rad], (beams,), in the robot's frame."""
        return beam_angles(self.beams)


def beam_angles(count: int) -> Array:
    """Where each of so many beams over 180 deg looks [rad], in the robot's frame."""
    return np.linspace(-0.5 * math.pi, 0.5 * math.pi, count)


@dataclass(frozen=True, slots=True, eq=False)
class LaserScan:
    """One sweep."""

    time: float
    """Of its first beam [s]."""
    ranges: Array
    """[m], (beams,), from right to left; inf where nothing came back."""
    sweep: float = 0.0
    """From the first beam to the last [s]."""
    forward: float = 0.0
    """How far the scanner is ahead of the driving axle [m]."""

    def __post_init__(self) -> None:
        ranges = np.asarray(self.ranges, dtype=np.float64)
        if ranges.ndim != 1 or len(ranges) < 2 or not (ranges >= 0).all():
            raise InvalidValueError("ranges", ranges.shape, "two or more, from 0 [m], inf where nothing came back")
        for name in ("time", "sweep", "forward"):
            finite(name, getattr(self, name), "a finite number")

    @property
    def end(self) -> float:
        """Time of the last beam [s]."""
        return self.time + self.sweep


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """What a scan saw, in the robot's frame at one time."""

    places: Array
    """[m], (k, 2), in the order of the beams."""
    origins: Array
    """Where the scanner was for each [m], (k, 2)."""
    ways: Array
    """Directions of the beams, unit vectors, (k, 2)."""
    beams: NDArray[np.int64]
    """Numbers of the beams, (k,): what is missing between two wasn't seen."""

    @property
    def ranges(self) -> Array:
        """[m], (k,)."""
        return np.asarray(np.sum((self.places - self.origins) * self.ways, axis=1))


class OdometryStep(NamedTuple):
    """The arc between two readings of the odometry."""

    way: float
    """Its length, negative backwards [m]."""
    turn: float
    """By what angle it turns [rad]."""
    dt: float
    """How long it took [s]."""


class OdometryTrack:
    """The last readings of the odometry, linear in between."""

    def __init__(self, kept: float = 2.0) -> None:
        """Keep so many seconds."""
        self._kept = kept
        self._times: deque[float] = deque()
        self._postures: deque[tuple[float, float, float]] = deque()
        self._scanned = -math.inf
        """When the last scan was taken that it took in [s]."""

    @property
    def newest(self) -> tuple[float, float, float] | None:
        """The last reading, (x, y, θ) [m, m, rad]."""
        return self._postures[-1] if self._postures else None

    @property
    def time(self) -> float:
        """Of the last reading [s], −inf before the first."""
        return self._times[-1] if self._times else -math.inf

    @property
    def bend(self) -> float:
        """How much more or less the robot turned between the last two readings than before [rad]."""
        if len(self._times) < 3:
            return 0.0
        t0, t1, t2 = (self._times[k] for k in (-3, -2, -1))
        a, b, c = (self._postures[k][2] for k in (-3, -2, -1))
        return abs((c - b) - (b - a) * (t2 - t1) / (t1 - t0))

    def add(self, time: float, posture: tuple[float, float, float]) -> None:
        """Take a reading, θ counted on past ±π; one that isn't newer than the last is no news.

        Raises:
            InvalidValueError: If a number isn't finite.
        """
        if not all(map(math.isfinite, (time, *posture))):
            raise InvalidValueError("odometry", (time, *posture), "a time and three finite numbers (x, y, θ)")
        if time <= self.time:
            return
        self._times.append(time)
        self._postures.append(posture)
        while self._times[0] < time - self._kept:
            self._times.popleft()
            self._postures.popleft()

    def step(self, time: float, posture: tuple[float, float, float]) -> OdometryStep | None:
        """Take a reading as `add` does; the step from the one before; None without one, or any news."""
        before, was = self.newest, self.time
        self.add(time, posture)
        if before is None or time <= was:
            return None
        turn = wrapped(posture[2] - before[2])
        dx, dy = posture[0] - before[0], posture[1] - before[1]
        middle = before[2] + 0.5 * turn
        way = (dx * math.cos(middle) + dy * math.sin(middle)) / sinc(0.5 * turn)
        return OdometryStep(way, turn, time - was)

    def takes(self, scan: LaserScan) -> bool:
        """Whether a scan is newer than those that it said this of, and the readings cover it."""
        if scan.time <= self._scanned or not self.covers(scan.time, scan.end):
            return False
        self._scanned = scan.time
        return True

    def covers(self, start: float, end: float) -> bool:
        """Whether readings reach from one time to another [s]."""
        return bool(self._times) and self._times[0] <= start + _ROUNDING and end <= self.time + _ROUNDING

    def at(self, times: Array) -> Array:
        """Postures at times [s], (k, 3)."""
        first = max(bisect_left(self._times, float(times.min())) - 1, 0)
        t = np.array([self._times[k] for k in range(first, len(self._times))])
        rows = np.array([self._postures[k] for k in range(first, len(self._times))])
        return np.stack([np.interp(times, t, rows[:, k]) for k in range(3)], axis=-1)


def deskewed(scan: LaserScan, odometry: OdometryTrack | None = None) -> Points:
    """What a scan saw, in the robot's frame at the odometry's last reading.

    Args:
        scan: A sweep that the odometry covers.
        odometry: The readings; a robot that stood still, unless given.

    Returns:
        A point for each beam that came back.
    """
    beams = np.flatnonzero(np.isfinite(scan.ranges))
    count = len(scan.ranges)
    angles = beam_angles(count)[beams]
    ranges = scan.ranges[beams]
    if odometry is None or odometry.newest is None:
        x, y, turn = np.zeros(len(beams)), np.zeros(len(beams)), np.zeros(len(beams))
    else:
        times = scan.time + scan.sweep * beams / (count - 1)
        now_x, now_y, now_theta = odometry.newest
        at = odometry.at(times) if len(beams) else np.zeros((0, 3))
        c, s = math.cos(now_theta), math.sin(now_theta)
        dx, dy = at[:, 0] - now_x, at[:, 1] - now_y
        x, y, turn = c * dx + s * dy, c * dy - s * dx, at[:, 2] - now_theta
    origins = np.column_stack([x + scan.forward * np.cos(turn), y + scan.forward * np.sin(turn)])
    ways = np.column_stack([np.cos(angles + turn), np.sin(angles + turn)])
    places = origins + ranges[:, None] * ways
    beams.flags.writeable = False
    return Points(frozen_array(places), frozen_array(origins), frozen_array(ways), beams)


OVERHEAD: Final = 11
"""Bytes of a frame beside its ranges."""
BEAMS: Final = tuple(round(180 / step) + 1 for step in STEPS_DEG)
"""How many beams a frame can have."""
NOTHING: Final = 0x1FFF
"""Stands for a beam that brought nothing."""
_ACK, _STX, _ADDRESS, _VALUES, _MILLIMETRES = 0x06, 0x02, 0x80, 0xB0, 0x4000
_COUNT, _RANGE = 0x3FFF, 0x1FFF
_HEAD = struct.Struct("<BBBHBH")
_TAIL = struct.Struct("<BH")
_POLYNOMIAL = 0x8005
_WHERE = "laser frame"


def checksum(data: bytes) -> int:
    """CRC-16 of some bytes, each taken in with the one before it in the high half."""
    value = before = 0
    for byte in data:
        value = ((value & 0x7FFF) << 1) ^ (_POLYNOMIAL if value & 0x8000 else 0)
        value ^= before << 8 | byte
        before = byte
    return value


def encode_scan(ranges: Array) -> bytes:
    """Make a frame.

    Args:
        ranges: [m], (181,), (361,) or (721,), inf where nothing came back.

    Raises:
        InvalidValueError: If there are others than so many, or one isn't in [0, 8.19].
    """
    ranges = np.asarray(ranges, dtype=np.float64)
    if ranges.shape not in {(n,) for n in BEAMS}:
        raise InvalidValueError("ranges", ranges.shape, f"of {', '.join(map(str, sorted(BEAMS)))} beams")
    seen = ranges != np.inf
    if not ((ranges[seen] >= 0) & (ranges[seen] < NOTHING / 1000 - 5e-4)).all():
        raise InvalidValueError("ranges", ranges, "in [0, 8.19] m, or inf")
    millimetres = np.where(seen, np.round(1000 * np.where(seen, ranges, 0.0)), NOTHING).astype("<u2").tobytes()
    head = _HEAD.pack(_ACK, _STX, _ADDRESS, len(millimetres) + 4, _VALUES, len(ranges) | _MILLIMETRES)
    telegram = head[1:] + millimetres + b"\x00"
    return head[:1] + telegram + struct.pack("<H", checksum(telegram))


def decode_scan(frame: bytes) -> Array:
    """Read a whole frame.

    Returns:
        Ranges [m], inf where nothing came back.

    Raises:
        FormatError: If it isn't one.
    """
    if len(frame) < OVERHEAD:
        raise FormatError(_WHERE, f"{len(frame)} bytes; it has {OVERHEAD} at least")
    ack, stx, address, length, kind, count = _HEAD.unpack_from(frame)
    if (ack, stx, address, kind) != (_ACK, _STX, _ADDRESS, _VALUES) or count & ~_COUNT != _MILLIMETRES:
        raise FormatError(_WHERE, "doesn't begin as one in millimetres")
    beams = count & _COUNT
    if beams not in BEAMS or length != 2 * beams + 4 or len(frame) != 2 * beams + OVERHEAD:
        raise FormatError(_WHERE, f"{beams} beams in {len(frame)} bytes")
    status, told = _TAIL.unpack_from(frame, len(frame) - _TAIL.size)
    if told != checksum(frame[1:-2]):
        raise FormatError(_WHERE, "wrong checksum")
    if status:
        raise FormatError(_WHERE, f"the scanner says that something is wrong with it: status {status}")
    millimetres = np.frombuffer(frame, dtype="<u2", count=beams, offset=_HEAD.size) & _RANGE
    return frozen_array(np.where(millimetres == NOTHING, np.inf, millimetres / 1000))


class FrameReader:
    """Finds frames in a stream of bytes, whatever is between them."""

    def __init__(self) -> None:
        """Wait for the first."""
        self._buffer = bytearray()

    def receive(self, data: bytes) -> list[Array]:
        """Take some bytes; returns the ranges [m] of the frames that are whole now."""
        self._buffer += data
        found: list[Array] = []
        while (start := self._buffer.find(bytes((_ACK, _STX, _ADDRESS)))) >= 0:
            del self._buffer[:start]
            size = self._size()
            if size is None:
                return found
            if len(self._buffer) < size:
                return found
            try:
                found.append(decode_scan(bytes(self._buffer[:size])))
            except FormatError:
                size = 1
            del self._buffer[:size]
        # The last two bytes may be the beginning of a frame.
        del self._buffer[:-2]
        return found

    def _size(self) -> int | None:
        """Length of the frame at the buffer's start; 1 if it can't be one, None if that can't be said yet."""
        if len(self._buffer) < _HEAD.size:
            return None
        beams = _HEAD.unpack_from(self._buffer)[-1] & _COUNT
        return 2 * beams + OVERHEAD if beams in BEAMS else 1
