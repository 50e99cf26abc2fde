"""Whether the machine stood still, so that a test against the clock failed by no fault of ours.

A virtual machine is sometimes held up for longer than the 50 ms that a robot's site may miss in mid-motion. The
site then stops, as it should, and a test that waits for the end of the motion fails.
"""

from __future__ import annotations

import threading
import time
from pathlib import Path

LONG = 0.05
"""What a live site doesn't make good [s]."""
_EVERY = 0.01
_STAT = Path("/proc/stat")


def stolen() -> float:
    """How long others held the processors that are ours [s], since the machine began; 0 where nobody counts it."""
    try:
        return int(_STAT.read_text(encoding="ascii").split("\n", 1)[0].split()[8]) / 100
    except (OSError, IndexError, ValueError):
        return 0.0


class StallWatch:
    """Measures by how much a thread that sleeps wakes up late."""

    def __init__(self) -> None:
        self._longest, self._stolen = 0.0, stolen()
        threading.Thread(target=self._watch, daemon=True, name="stall watch").start()

    def reset(self) -> None:
        """Begin anew."""
        self._longest, self._stolen = 0.0, stolen()

    @property
    def longest(self) -> float:
        """The longest that the machine stood still since then [s]."""
        return max(self._longest, stolen() - self._stolen)

    def _watch(self) -> None:
        before = time.monotonic()
        while True:
            time.sleep(_EVERY)
            now = time.monotonic()
            self._longest = max(self._longest, now - before - _EVERY)
            before = now
