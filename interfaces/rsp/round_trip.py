"""How long packets take there and back, the other side's period included."""

from __future__ import annotations

from collections import deque
from typing import Final

_MOST: Final = 4096
"""Packets whose round trip may still be measured."""


class PacketRoundTrip:
    """Measured by the last received numbers that the other side's packets carry; it knows no clock."""

    def __init__(self) -> None:
        """Begin with nothing sent."""
        self._sent: deque[tuple[int, float]] = deque(maxlen=_MOST)
        self.smoothed: float | None = None
        """[s]; None before the first."""

    def sent(self, number: int, now: float) -> None:
        """Note that a packet of a number goes out [s]."""
        self._sent.append((number, now))

    def acknowledged(self, last: int, now: float) -> float | None:
        """Take the other side's last received number; returns that packet's round trip [s], None if it's known."""
        found = None
        while self._sent and self._sent[0][0] <= last:
            number, sent = self._sent.popleft()
            if number == last:
                found = now - sent
                self.smoothed = found if self.smoothed is None else 0.875 * self.smoothed + 0.125 * found
        return found
