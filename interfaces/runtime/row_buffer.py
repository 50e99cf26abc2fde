"""References for coming ticks, where what comes later counts instead of what came before."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vrs.model import Array

KEPT = 300
"""For how many ticks rows are kept that are over."""
_BLOCKS_MOST = 1024
"""Most blocks that are kept; a parent sends one every few ticks, and each cuts the one before."""


class _RowBlock(NamedTuple):
    start: int
    """Tick of the first row."""
    rows: Array
    """(k, 3, n)."""


class RowBuffer:
    """Rows (q, qd, qdd) by tick; it keeps what is still to come, and a little of what was."""

    def __init__(self) -> None:
        self._blocks: deque[_RowBlock] = deque()

    def clear(self) -> None:
        """Forget everything."""
        self._blocks.clear()

    def put(self, start: int, rows: Array) -> bool:
        """Take rows, (k, 3, n), for ticks from `start` on, instead of all those for these and later ticks.

        Returns:
            Whether there was room.
        """
        blocks = self._blocks
        while blocks and blocks[-1].start >= start:
            blocks.pop()
        if len(blocks) >= _BLOCKS_MOST:
            return False
        if blocks and blocks[-1].start + len(blocks[-1].rows) > start:
            last = blocks.pop()
            blocks.append(_RowBlock(last.start, np.array(last.rows[: start - last.start])))
        blocks.append(_RowBlock(start, rows))
        return True

    def take(self, tick: int, most: int) -> Array | None:
        """Rows for this tick and those after it, (1 to most, 3, n).

        After a block that ended at rest its last position is held, a row at a time. Ticks more than `KEPT` before
        this one won't be asked for again.

        Returns:
            The rows; None if there are none for this tick.
        """
        blocks = self._blocks
        while len(blocks) > 1 and blocks[1].start <= tick - KEPT:
            blocks.popleft()
        block = next((block for block in reversed(blocks) if block.start <= tick), None)
        if block is None:
            return None
        start, rows = block
        if tick - start < len(rows):
            return rows[tick - start : tick - start + most]
        if rows[-1, 1].any():
            return None
        held = np.array(rows[-1:])
        held[0, 2] = 0.0
        return held

    def kept(self, tick: int) -> Iterator[tuple[int, Array]]:
        """What there is for this tick and up to `KEPT` before it, a block at a time, the latest first.

        Yields:
            The tick of the first row, and the rows, (k, 3, n), k ≥ 1.
        """
        for start, rows in reversed(self._blocks):
            low, high = max(start, tick - KEPT), min(start + len(rows), tick + 1)
            if low < high:
                yield low, rows[low - start : high - start]
