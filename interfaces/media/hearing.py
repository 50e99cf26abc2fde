"""The robot's microphone, live: one stream of Opus for all who listen, made while somebody does."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from interfaces.media.camera import Stand
from interfaces.media.coding import SILENCE, SOUND_PERIOD, SOUND_RATE, room_encoder
from robots.mobile.microphone import Microphone, samples_of

_KEPT: Final = 32
"""Packets that are kept for those who are late."""
_SAMPLES: Final = round(SOUND_RATE * SOUND_PERIOD)


class LiveMicrophone:
    """What the robot hears, packet by packet: each is made when it's asked for first, and is the same for all."""

    def __init__(self, microphone: Microphone, stand: Stand) -> None:
        """Hear nothing yet.

        Args:
            microphone: The robot's.
            stand: Where the robot is.
        """
        self._microphone, self._stand = microphone, stand
        self._encode: Callable[[NDArray[np.int16]], bytes] | None = None
        self._packets: dict[int, bytes] = {}
        self._before = 0.0, 0.0, 0.0

    @property
    def hears(self) -> bool:
        """Whether there's ever anything to hear."""
        return bool(self._microphone.sounds)

    def level(self, now: float) -> float:
        """How loud it is where the robot is [dB, re 20 µPa]; −inf in silence."""
        (x, y, _), t = self._stand(now)
        return self._microphone.level(x, y, t)

    def at(self, due: float) -> bytes:
        """The packet that is heard at a session time [s]; silence of one that's too old."""
        number = math.floor(due / SOUND_PERIOD + 0.5)
        if number not in self._packets:
            if self._packets and number < next(reversed(self._packets)):
                return SILENCE
            self._packets[number] = self._make(number)
            if len(self._packets) > _KEPT:
                del self._packets[next(iter(self._packets))]
        return self._packets[number]

    def _make(self, number: int) -> bytes:
        if self._encode is None:
            self._encode = room_encoder()
        end = number * SOUND_PERIOD
        (x, y, _), t = self._stand(end)
        # After a pause it hasn't been under way.
        before = self._before if number - 1 in self._packets else (x, y, t)
        self._before = x, y, t
        times = end + np.arange(1 - _SAMPLES, 1) / SOUND_RATE
        return self._encode(samples_of(self._microphone.hear(before, self._before, times)))
