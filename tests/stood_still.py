"""Whether the machine held a test up, so that one against the clock failed by no fault of ours.

A virtual machine is sometimes held up for longer than the 50 ms that a robot's site may miss in mid-motion; and
where all processors are busy, what isn't urgent waits. The site then stops, as it should, and a test that waits for
the end of the motion fails.
"""

from __future__ import annotations

import threading
import time
from pathlib import Path

LONG = 0.05
"""What a live site doesn't make good [s]."""
BUSY = 0.5
"""Of the time, the share in which somebody waited for a processor that makes a machine overloaded."""
_EVERY = 0.01
_STAT, _PRESSURE = Path("/proc/stat"), Path("/proc/pressure/cpu")


def stolen() -> float:
    """How long others held the processors that are ours [s], since the machine began; 0 where nobody counts it."""
    try:
        return int(_STAT.read_text(encoding="ascii").split("\n", 1)[0].split()[8]) / 100
    except (OSError, IndexError, ValueError):
        return 0.0


def waited() -> float:
    """How long somebody waited for a processor [s], since the machine began; 0 where nobody counts it."""
    try:
        return int(_PRESSURE.read_text(encoding="ascii").split("total=", 1)[1].split()[0]) / 1e6
    except (OSError, IndexError, ValueError):
        return 0.0


class StallWatch:
    """Measures by how much a thread that sleeps wakes up late, and how busy the machine is."""

    def __init__(self) -> None:
        self.reset()
        threading.Thread(target=self._watch, daemon=True, name="stall watch").start()

    def reset(self) -> None:
        """Begin anew."""
        self._longest, self._stolen, self._waited, self._begun = 0.0, stolen(), waited(), time.monotonic()

    def found(self) -> str:
        """What held us up since then; empty for nothing."""
        longest = max(self._longest, stolen() - self._stolen)
        busy = (waited() - self._waited) / max(time.monotonic() - self._begun, _EVERY)
        if longest > LONG:
            return f"the machine stood still for {longest:.3f} s"
        return f"the machine was overloaded for {busy:.0%} of the time" if busy > BUSY else ""

    def _watch(self) -> None:
        before = time.monotonic()
        while True:
            time.sleep(_EVERY)
            now = time.monotonic()
            self._longest = max(self._longest, now - before - _EVERY)
            before = now
