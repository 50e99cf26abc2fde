"""The session's sound: what is said, one after the other, and silence between. It's given the time."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Final

from interfaces.media.coding import SOUND_PERIOD

SILENCE: Final = b"\xfc\xff\xfe"
"""An Opus packet of 20 ms in stereo in which nothing is heard."""
LEAD: Final = 0.1
"""What is to be said begins so much later [s], so that nobody who listens misses its beginning."""


class VoicePlayout:
    """Which packet is heard at which time, by everybody alike."""

    def __init__(self) -> None:
        """Be silent."""
        self._said: deque[tuple[float, tuple[bytes, ...]]] = deque()

    def say(self, packets: Sequence[bytes], *, now: float) -> tuple[float, float]:
        """Let something be heard, after what is being said.

        Args:
            packets: Of `SOUND_PERIOD` each.
            now: [s].

        Returns:
            When it begins and when it's over [s].
        """
        begin = max(now + LEAD, self.end)
        while self._said and _end(*self._said[0]) < now - LEAD:
            self._said.popleft()
        self._said.append((begin, tuple(packets)))
        return begin, self.end

    def hush(self) -> None:
        """Be silent at once."""
        self._said.clear()

    @property
    def end(self) -> float:
        """When nothing is said any more [s]; −∞ while nothing ever was."""
        return _end(*self._said[-1]) if self._said else -math.inf

    def at(self, t: float) -> bytes:
        """The packet that is heard at a time [s]."""
        for begin, packets in self._said:
            if begin <= t < _end(begin, packets):
                return packets[min(int((t - begin) / SOUND_PERIOD), len(packets) - 1)]
        return SILENCE


def _end(begin: float, packets: Sequence[bytes]) -> float:
    return begin + len(packets) * SOUND_PERIOD
