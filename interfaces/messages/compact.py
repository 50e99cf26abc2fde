"""Compact frames: quantised, predicted, integers of variable length. docs/protocol.md describes the bytes.

A joint is a whole number x of steps. Of each the encoder and the decoder keep x, its last difference v and the last
difference of that, a; the frame to come is taken to be x + v + a, and what crosses is by how much a changes. Both
count in integers, and so never drift apart.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from operator import add, sub
from typing import Final

import numpy as np

from interfaces.messages.fields import MOST_JOINTS
from interfaces.messages.requests import Broadcast, Compact, Frame, FrameStatus, Verdicts
from vrs.errors import InvalidValueError
from vrs.model import frozen_array
from vrs.record import LARGEST

STEPS: Final = 65536
"""Steps a radian: a joint that crosses is off by half a step at most, 7.63e-6 rad."""
TICKS: Final = 1_000_000
"""Ticks a second, of times."""
MOST_FRAMES: Final = 16
"""Frames in a message, at most."""
LAST_NUMBER: Final = 2**53 - 1
"""Frames are numbered up to this: JavaScript's numbers hold it, as they hold all that counts here."""
TIMED, STILL, PREDICTED = 1, 2, 4
"""What the bits of a frame's first integer say."""

_FARTHEST: Final = int(LARGEST) * STEPS
_LATEST: Final = int(LARGEST) * TICKS
_LONGEST_PERIOD: Final = 10**10
_LONGEST: Final = 18
_LAST, _MORE = "01234567", "89abcdef"
_INTEGER: Final = re.compile(f"[89a-f]{{0,{_LONGEST - 1}}}[0-7]")
_Times = tuple[int, int, int]
"""When it shows, the period, how far that's ahead of when it was made [ticks]."""
_State = tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]
"""Of each joint x, v, a [steps]."""


def _digits(value: int) -> str:
    """An unsigned integer."""
    digits = ""
    while value > 7:
        digits += _MORE[value & 7]
        value >>= 3
    return digits + _LAST[value]


_COMMON: Final = tuple(map(_digits, range(1024)))
_SHORT: Final = {digits: value for value, digits in enumerate(_COMMON)}


def _zigzag(value: int) -> str:
    """A signed integer."""
    unsigned = 2 * value if value >= 0 else -2 * value - 1
    return _COMMON[unsigned] if unsigned < 1024 else _digits(unsigned)


@dataclass(frozen=True, slots=True)
class CompactFrame:
    """A frame as digits of base 16, made once for all who get it."""

    number: int
    """The broadcaster's."""
    delta: str | None
    """How it follows from the frame before; None where it can't be told so."""
    flags: int
    times: _Times
    state: _State

    def key(self) -> str:
        """The same for one who has no frame before it."""
        ticks, period, ahead = self.times
        head = _digits(self.flags), _digits(len(self.state[0])), _zigzag(ticks), _digits(period), _zigzag(ahead)
        return "".join((*head, *(_zigzag(value) for row in self.state for value in row)))


class CompactEncoder:
    """Makes compact frames of a broadcaster's, in their order."""

    def __init__(self, rate: float) -> None:
        """Begin.

        Args:
            rate: Frames a second, 1e-4 to 1e4.
        """
        self._period = round(TICKS / rate)
        self._newest: CompactFrame | None = None

    def add(self, frame: Frame) -> CompactFrame:
        """Encode a frame; the newest one once more gives what it gave.

        Raises:
            InvalidValueError: If a joint or a time isn't finite or lies beyond ±1e9, or there are no joints or too
                many.
        """
        newest = self._newest
        if newest is not None and newest.number == frame.number:
            return newest
        q = frame.q
        if not 1 <= len(q) <= MOST_JOINTS or not np.all(np.abs(q) <= LARGEST):
            raise InvalidValueError("q", q, f"1 to {MOST_JOINTS} joints within ±1e9 rad")
        for name, t in (("t", frame.t), ("made_at", frame.made_at)):
            if not abs(t) <= LARGEST:
                raise InvalidValueError(name, t, "within ±1e9 s")
        x = tuple(np.rint(q * STEPS).astype(np.int64).tolist())
        ticks = round(frame.t * TICKS)
        times = ticks, self._period, ticks - round(frame.made_at * TICKS)
        flags = PREDICTED if frame.status is FrameStatus.PREDICTED else 0
        self._newest = _encoded(newest, frame.number, flags, times, x)
        return self._newest


def _encoded(
    before: CompactFrame | None, number: int, flags: int, times: _Times, x: tuple[int, ...]
) -> CompactFrame:
    if before is None or len(before.state[0]) != len(x):
        still = (0,) * len(x)
        return CompactFrame(number, None, flags, times, (x, still, still))
    v = tuple(map(sub, x, before.state[0]))
    a = tuple(map(sub, v, before.state[1]))
    delta = None
    if number == before.number + 1 and times[2] == before.times[2]:
        late = times[0] - before.times[0] - times[1]
        residuals = tuple(map(sub, a, before.state[2]))
        moves = any(residuals)
        head = _digits(flags | (TIMED if late else 0) | (0 if moves else STILL)), _zigzag(late) if late else ""
        delta = "".join((*head, *(map(_zigzag, residuals) if moves else ())))
    return CompactFrame(number, delta, flags, times, (x, v, a))


def packed(frames: Sequence[CompactFrame], behind: int, *, key: bool) -> bytes:
    """Frames that follow each other as the bytes of one message.

    Args:
        frames: 1 to 16; those that aren't the key frame have a `delta`.
        behind: Number of the last one less that up to which frames are confirmed, ≥ 0.
        key: Whether the first is one that can be read without the frame before.
    """
    first = frames[0]
    head = _digits(first.number), _digits(2 * (len(frames) - 1) + key), _digits(behind)
    deltas = (frame.delta or "" for frame in frames[key:])
    digits = "".join((*head, first.key() if key else "", *deltas))
    return bytes.fromhex(digits + "0" * (len(digits) % 2))


class CompactDecoder:
    """Gives the frames of messages back. Without the frame that a message builds on it waits for a key frame."""

    def __init__(self) -> None:
        """Wait for a key frame."""
        self.lacking = True
        """Whether frames are missing: only a message that begins with a key frame can be read."""
        self.number = 0
        """Number of the newest frame."""
        self._since = 1
        self._times: _Times = 0, 0, 0
        self._state: _State = (), (), ()

    def receive(self, message: Compact) -> tuple[Broadcast, ...]:
        """The frames of a message, oldest first, each with what the message says of earlier ones.

        Returns:
            Nothing where they're known already, or can't be read without frames that are missing.

        Raises:
            InvalidValueError: If the bytes aren't what they should be; it then waits for a key frame.
        """
        try:
            return self._read(message, iter(_integers(message.q)))
        except StopIteration:
            self.lacking = True
            raise InvalidValueError("compact frames", f"{len(message.q)} bytes", "whole") from None
        except InvalidValueError:
            self.lacking = True
            raise

    def _read(self, message: Compact, integers: Iterator[int]) -> tuple[Broadcast, ...]:
        first, form, behind = next(integers), next(integers), next(integers)
        count, key = form // 2 + 1, form % 2 == 1
        last = first + count - 1
        if count > MOST_FRAMES or first < 1 or last > LAST_NUMBER or behind > last:
            raise InvalidValueError("frames", (first, count, behind), f"1 to {MOST_FRAMES}, numbered from 1")
        if last <= self.number:
            return ()
        if not key and (self.lacking or first != self.number + 1):
            self.lacking = True
            return ()
        times, state = self._times, self._state
        found = []
        for number in range(first, last + 1):
            begins = key and number == first
            flags = next(integers)
            if flags > PREDICTED | TIMED | STILL or (begins and flags & ~PREDICTED):
                raise InvalidValueError("flags of a frame", flags, "of 3 bits; of a key frame, the third alone")
            times, state = _key(integers) if begins else _following(integers, flags, times, state)
            ticks, _, ahead = times
            q = frozen_array([x / STEPS for x in state[0]])
            status = FrameStatus.PREDICTED if flags & PREDICTED else FrameStatus.CONFIRMED
            found.append(Frame(number, ticks / TICKS, (ticks - ahead) / TICKS, q, status))
        if (rest := tuple(integers)) and rest != (0,):
            raise InvalidValueError("compact frames", f"{len(rest)} integers too many", "nothing after the last")
        if key or message.since is not None:
            self._since = message.since or 1
        known, self.lacking, self.number, self._times, self._state = self.number, False, last, times, state
        verdicts = Verdicts(self._since, last - behind, message.falsified)
        return tuple(Broadcast.showing(frame, verdicts) for frame in found if frame.number > known)


def _integers(data: bytes) -> list[int]:
    """The integers that bytes stand for."""
    digits = data.hex()
    texts = _INTEGER.findall(digits)
    if sum(map(len, texts)) != len(digits):
        raise InvalidValueError("compact frames", f"{len(data)} bytes", f"integers of at most {_LONGEST} digits")
    return [_SHORT[text] if text in _SHORT else _integer(text) for text in texts]


def _integer(text: str) -> int:
    value = 0
    for digit in reversed(text):
        value = value << 3 | int(digit, 16) & 7
    return value


def _signed(value: int) -> int:
    return value >> 1 if value % 2 == 0 else ~(value >> 1)


def _several(integers: Iterator[int], count: int) -> tuple[int, ...]:
    found = tuple(map(_signed, islice(integers, count)))
    if len(found) < count:
        raise StopIteration
    return found


def _key(integers: Iterator[int]) -> tuple[_Times, _State]:
    dof, ticks, period, ahead = next(integers), _signed(next(integers)), next(integers), _signed(next(integers))
    if not 1 <= dof <= MOST_JOINTS:
        raise InvalidValueError("joints", dof, f"1 to {MOST_JOINTS}")
    if not 1 <= period <= _LONGEST_PERIOD:
        raise InvalidValueError("period", period, f"1 to {_LONGEST_PERIOD} ticks")
    state = _several(integers, dof), _several(integers, dof), _several(integers, dof)
    return _checked((ticks, period, ahead), state)


def _following(integers: Iterator[int], flags: int, times: _Times, state: _State) -> tuple[_Times, _State]:
    ticks, period, ahead = times
    ticks += period + (_signed(next(integers)) if flags & TIMED else 0)
    x, v, a = state
    if not flags & STILL:
        a = tuple(map(add, a, _several(integers, len(a))))
    v = tuple(map(add, v, a))
    return _checked((ticks, period, ahead), (tuple(map(add, x, v)), v, a))


def _checked(times: _Times, state: _State) -> tuple[_Times, _State]:
    ticks, _, ahead = times
    if abs(ticks) > _LATEST or abs(ticks - ahead) > _LATEST:
        raise InvalidValueError("times of a frame", (ticks, ahead), f"within ±{_LATEST} ticks")
    for row, most in zip(state, (_FARTHEST, 2 * _FARTHEST, 4 * _FARTHEST), strict=True):
        if max(row) > most or min(row) < -most:
            raise InvalidValueError("joints", row, f"within ±{most} steps")
    return times, state
